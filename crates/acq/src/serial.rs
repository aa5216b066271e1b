//! Serial devices as raw byte sources.

use sample::Payload;
use tokio::sync::watch;

use crate::SerialSpec;
use crate::context::SourceContext;
use crate::dialogue::Dialogue;
use crate::port;
use crate::protocol::{Action, SerialProtocol};

/// Runs a serial source until the shutdown.
pub(crate) async fn run(
    context: &SourceContext,
    spec: &SerialSpec,
    shutdown: watch::Receiver<bool>,
) {
    let mut protocol = RawProtocol {
        context: context.clone(),
        dialogue: Dialogue::new(&spec.setup, spec.port.baud),
    };
    port::run(context, &spec.port, &mut protocol, shutdown).await;
}

/// Takes every read into the stream as it came, whatever the dialogue makes of it.
struct RawProtocol {
    context: SourceContext,
    dialogue: Dialogue,
}

impl SerialProtocol for RawProtocol {
    fn on_open(&mut self) -> Action {
        self.dialogue.on_open()
    }

    fn on_bytes(&mut self, bytes: &[u8]) -> Action {
        let payload = Payload::Bytes(bytes.to_vec());
        self.context.sequencer.push(self.context.id, payload);
        self.dialogue.on_bytes(bytes)
    }

    fn on_timer(&mut self) -> Action {
        self.dialogue.on_timer()
    }

    fn on_close(&mut self) -> Vec<u8> {
        Vec::new()
    }
}
