//! Serial devices as raw byte sources, with the dialogues that set them up.

use std::time::Duration;

use sample::Payload;
use tokio::sync::watch;

use crate::port::{self, Act, Owner, Talk};
use crate::{SerialSpec, Setup};

/// Runs a serial source until the shutdown.
pub(crate) async fn run(owner: &Owner, spec: &SerialSpec, shutdown: watch::Receiver<bool>) {
    let mut talk = RawTalk {
        owner: owner.clone(),
        dialogue: Dialogue::new(&spec.setup),
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
        self.dialogue.start()
    }

    fn received(&mut self, bytes: &[u8]) -> Act {
        let payload = Payload::Bytes(bytes.to_vec());
        self.owner.sequencer.push(self.owner.id, payload);
        Act::default()
    }

    fn woken(&mut self) -> Act {
        self.dialogue.next()
    }

    fn farewell(&mut self) -> Vec<u8> {
        Vec::new()
    }
}

/// What is said to a device after its port was opened.
enum Dialogue {
    None,
    Commands {
        commands: Vec<Vec<u8>>,
        pause: Duration,
        next: usize,
    },
}

impl Dialogue {
    fn new(setup: &Setup) -> Self {
        match setup {
            Setup::Commands { commands, pause } => Self::Commands {
                commands: commands.clone(),
                pause: *pause,
                next: 0,
            },
            Setup::None | Setup::Crossbow440 { .. } => Self::None,
        }
    }

    fn start(&mut self) -> Act {
        if let Self::Commands { next, .. } = self {
            *next = 0;
        }
        self.next()
    }

    fn next(&mut self) -> Act {
        match self {
            Self::None => Act::default(),
            Self::Commands {
                commands,
                pause,
                next,
            } => {
                let write = commands.get(*next).cloned().unwrap_or_default();
                *next += 1;
                Act {
                    wake: (*next < commands.len()).then_some(*pause),
                    write,
                    baud: None,
                }
            }
        }
    }
}
