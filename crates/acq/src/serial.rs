//! Serial devices as raw byte sources.

use sample::Payload;
use tokio::sync::watch;

use crate::SerialSpec;
use crate::dialogue::Dialogue;
use crate::port::{self, Act, Owner, Talk};

/// Runs a serial source until the shutdown.
pub(crate) async fn run(owner: &Owner, spec: &SerialSpec, shutdown: watch::Receiver<bool>) {
    let mut talk = RawTalk {
        owner: owner.clone(),
        dialogue: Dialogue::new(&spec.setup, spec.port.baud),
    };
    port::run(owner, &spec.port, &mut talk, shutdown).await;
}

/// Takes every read into the stream as it came, whatever the dialogue makes of it.
struct RawTalk {
    owner: Owner,
    dialogue: Dialogue,
}

impl Talk for RawTalk {
    fn opened(&mut self) -> Act {
        self.dialogue.opened()
    }

    fn received(&mut self, bytes: &[u8]) -> Act {
        let payload = Payload::Bytes(bytes.to_vec());
        self.owner.sequencer.push(self.owner.id, payload);
        self.dialogue.received(bytes)
    }

    fn woken(&mut self) -> Act {
        self.dialogue.woken()
    }

    fn farewell(&mut self) -> Vec<u8> {
        Vec::new()
    }
}
