//! Commands to a serial device after its port was opened.

use std::time::Duration;

use tokio::time::Instant;
use wire::crossbow440;

use crate::Setup;
use crate::protocol::Action;

/// A unit that was set up and sends no packet for this long is set up again: its power was cut, and
/// its settings are lost.
const SILENCE: Duration = Duration::from_secs(2);

/// The dialogue with one device.
pub(crate) enum Dialogue {
    None,
    Commands(Commands),
    Crossbow440(Box<Crossbow440>),
}

impl Dialogue {
    pub fn new(setup: &Setup, baud: u32) -> Self {
        match setup {
            Setup::None => Self::None,
            Setup::Commands { commands, pause } => Self::Commands(Commands {
                commands: commands.clone(),
                pause: *pause,
                next: 0,
            }),
            Setup::Crossbow440(options) => {
                Self::Crossbow440(Box::new(Crossbow440::new(*options, baud)))
            }
        }
    }

    /// The port was opened.
    pub fn on_open(&mut self) -> Action {
        match self {
            Self::None => Action::default(),
            Self::Commands(commands) => {
                commands.next = 0;
                commands.send()
            }
            Self::Crossbow440(unit) => unit.begin(),
        }
    }

    /// Bytes came.
    pub fn on_bytes(&mut self, bytes: &[u8]) -> Action {
        match self {
            Self::None | Self::Commands(_) => Action::default(),
            Self::Crossbow440(unit) => unit.on_bytes(bytes),
        }
    }

    /// The time asked for has passed.
    pub fn on_timer(&mut self) -> Action {
        match self {
            Self::None => Action::default(),
            Self::Commands(commands) => commands.send(),
            Self::Crossbow440(unit) => unit.on_timer(),
        }
    }
}

/// Commands sent one after the other, without a look at the answers.
pub(crate) struct Commands {
    commands: Vec<Vec<u8>>,
    pause: Duration,
    next: usize,
}

impl Commands {
    fn send(&mut self) -> Action {
        let write = self.commands.get(self.next).cloned().unwrap_or_default();
        self.next += 1;
        Action {
            write,
            wake: (self.next < self.commands.len()).then_some(self.pause),
            baud: None,
        }
    }
}

/// Finds the line speed, sets the unit up, then watches that it sends.
pub(crate) struct Crossbow440 {
    options: crossbow440::SetupOptions,
    /// The port's own line speed, for a unit that takes no commands.
    baud: u32,
    started: Instant,
    /// `None` while the unit is watched.
    setup: Option<crossbow440::Setup>,
    decoder: crossbow440::Decoder,
    packets: u64,
}

impl Crossbow440 {
    fn new(options: crossbow440::SetupOptions, baud: u32) -> Self {
        Self {
            options,
            baud,
            started: Instant::now(),
            setup: None,
            decoder: crossbow440::Decoder::default(),
            packets: 0,
        }
    }

    fn begin(&mut self) -> Action {
        self.started = Instant::now();
        self.setup = Some(crossbow440::Setup::new(self.options));
        self.advance()
    }

    fn on_bytes(&mut self, bytes: &[u8]) -> Action {
        if let Some(setup) = &mut self.setup {
            setup.receive(bytes);
            return self.advance();
        }
        let packets = &mut self.packets;
        self.decoder.push(bytes, |_| *packets += 1);
        Action::default()
    }

    fn on_timer(&mut self) -> Action {
        if self.setup.is_some() {
            return self.advance();
        }
        if self.packets == 0 {
            tracing::info!(
                silence_s = SILENCE.as_secs(),
                "no packet from the Crossbow 440; it is set up again"
            );
            return self.begin();
        }
        self.watch()
    }

    fn watch(&mut self) -> Action {
        self.setup = None;
        self.packets = 0;
        Action {
            wake: Some(SILENCE),
            ..Action::default()
        }
    }

    /// Collects the actions of the setup until it waits.
    fn advance(&mut self) -> Action {
        let mut action = Action::default();
        while let Some(setup) = &mut self.setup {
            match setup.poll(self.started.elapsed()) {
                Some(crossbow440::Action::SetBaud(baud)) => action.baud = Some(baud),
                Some(crossbow440::Action::Send(bytes)) => action.write.extend(bytes),
                Some(crossbow440::Action::Done { baud }) => {
                    tracing::info!(baud, "the Crossbow 440 is set up");
                    action.wake = self.watch().wake;
                }
                Some(crossbow440::Action::Failed(error)) => {
                    tracing::warn!(
                        %error,
                        baud = self.baud,
                        "cannot set up the Crossbow 440; its data is recorded at the port's own \
                         baud rate"
                    );
                    action.baud = Some(self.baud);
                    action.wake = self.watch().wake;
                }
                None => {
                    let due = setup.deadline();
                    let wait = due.map(|due| due.saturating_sub(self.started.elapsed()));
                    action.wake = wait.or(action.wake);
                    break;
                }
            }
        }
        action
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_sent_in_order_each_time() {
        let setup = Setup::Commands {
            commands: vec![b"a\r".to_vec(), b"b\r".to_vec()],
            pause: Duration::from_millis(5),
        };
        let mut dialogue = Dialogue::new(&setup, 9600);
        for _ in 0..2 {
            let first = dialogue.on_open();
            assert_eq!(
                (first.write, first.wake),
                (b"a\r".to_vec(), Some(Duration::from_millis(5)))
            );
            let second = dialogue.on_timer();
            assert_eq!((second.write, second.wake), (b"b\r".to_vec(), None));
        }
    }

    #[tokio::test(start_paused = true)]
    async fn a_crossbow_that_takes_no_commands_is_listened_to_at_the_ports_own_speed() {
        let setup = Setup::Crossbow440(crossbow440::SetupOptions::default());
        let mut dialogue = Dialogue::new(&setup, 38_400);
        let mut action = dialogue.on_open();
        let mut bauds = Vec::new();
        for _ in 0..100 {
            bauds.extend(action.baud);
            let wake = action.wake.expect("it always wakes again");
            if wake == SILENCE {
                break;
            }
            tokio::time::advance(wake).await;
            action = dialogue.on_timer();
        }
        assert_eq!(bauds, [57_600, 38_400, 19_200, 9_600, 38_400]);
        // `PK` is a packet too: while one comes, nothing is set up.
        dialogue.on_bytes(b"\x55\x55PK\x00\x9E\xF4");
        tokio::time::advance(SILENCE).await;
        let action = dialogue.on_timer();
        assert_eq!((action.baud, action.wake), (None, Some(SILENCE)));
        tokio::time::advance(SILENCE).await;
        assert_eq!(dialogue.on_timer().baud, Some(57_600));
    }
}
