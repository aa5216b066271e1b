use std::time::Duration;

use super::{Command, Decoder, Field, Packet, PacketRate};
use crate::{Message, WireError};

/// Line speeds that the unit knows, the likeliest first.
pub const BAUDS: [u32; 4] = [57_600, 38_400, 19_200, 9_600];

/// How long an answer is waited for. At 9600 baud a packet that the unit was about to send takes
/// 32 ms, and it answers within two of its 10 ms steps.
const ANSWER_TIME: Duration = Duration::from_millis(300);
/// How often each command is sent before it counts as failed.
const ATTEMPTS: u32 = 3;
const DEVICE: &str = "Crossbow 440";

/// What the unit is to do after the set-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SetupOptions {
    /// Type of the continuous packets, `S1` or `S2` on an IMU440.
    pub packet: [u8; 2],
    /// Their rate.
    pub rate: PacketRate,
    /// The only line speed to try; `None` tries all of [`BAUDS`].
    pub baud: Option<u32>,
}

impl Default for SetupOptions {
    fn default() -> Self {
        Self {
            packet: *b"S1",
            rate: PacketRate::Hz100,
            baud: None,
        }
    }
}

/// What the owner of the port is to do next.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Change the line speed and drop what the port still holds.
    SetBaud(u32),
    /// Send these bytes.
    Send(Vec<u8>),
    /// The unit runs as asked, at this line speed.
    Done {
        /// Line speed that was found.
        baud: u32,
    },
    /// The set-up failed; the port may be closed and tried again later.
    Failed(WireError),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Open,
    Quiet,
    Ping,
    Packet,
    Rate,
    Verify,
    Finished,
}

/// The dialogue that finds the unit's line speed and sets packet type and rate, without I/O and
/// without a clock: the owner feeds bytes and the time since the start, and does what
/// [`Setup::poll`] returns until that is `None`; it polls again when bytes came or time passed.
#[derive(Clone, Debug)]
pub struct Setup {
    options: SetupOptions,
    decoder: Decoder,
    bauds: Vec<u32>,
    baud_index: usize,
    step: Step,
    attempts: u32,
    sent_at: Option<Duration>,
    heard: Heard,
}

/// Answers since the last command.
#[derive(Clone, Debug, Default)]
struct Heard {
    pong: bool,
    taken: Vec<u16>,
    values: Vec<(u16, u16)>,
    refused: Option<[u8; 2]>,
}

impl Setup {
    /// A dialogue that has not begun.
    #[must_use]
    pub fn new(options: SetupOptions) -> Self {
        Self {
            options,
            decoder: Decoder::default(),
            bauds: options.baud.map_or_else(|| BAUDS.to_vec(), |b| vec![b]),
            baud_index: 0,
            step: Step::Open,
            attempts: 0,
            sent_at: None,
            heard: Heard::default(),
        }
    }

    /// Bytes from the unit.
    pub fn receive(&mut self, bytes: &[u8]) {
        let heard = &mut self.heard;
        self.decoder.push(bytes, |item| {
            let Message::Crossbow440(packet) = item.message else {
                return;
            };
            match packet {
                Packet::Pong => heard.pong = true,
                Packet::FieldsSet {
                    stored: false,
                    fields,
                } => heard.taken.extend(fields),
                Packet::Fields {
                    stored: false,
                    fields,
                } => heard.values.extend(fields),
                Packet::Refused(kind) => heard.refused = Some(kind),
                _ => {}
            }
        });
    }

    /// When [`Setup::poll`] is due though no byte came, in the caller's time.
    #[must_use]
    pub fn deadline(&self) -> Option<Duration> {
        self.sent_at.map(|sent| sent + ANSWER_TIME)
    }

    /// The next thing to do at `now`, time since any fixed start.
    pub fn poll(&mut self, now: Duration) -> Option<Action> {
        if self.step == Step::Finished {
            return None;
        }
        if self.step == Step::Open {
            self.enter(Step::Quiet);
            self.decoder = Decoder::default();
            return Some(Action::SetBaud(self.bauds[self.baud_index]));
        }
        let Some(sent_at) = self.sent_at else {
            return Some(self.send(now));
        };
        if let Some(kind) = self.heard.refused.take()
            && self.command().kind() == kind
        {
            return Some(self.fail(WireError::Refused {
                device: DEVICE,
                command: String::from_utf8_lossy(&kind).into_owned(),
            }));
        }
        if self.answered() {
            return self.advance(now);
        }
        if now < sent_at + ANSWER_TIME {
            return None;
        }
        if self.attempts < ATTEMPTS {
            return Some(self.send(now));
        }
        self.give_up()
    }

    /// Sends the step's command and begins to wait for its answer.
    fn send(&mut self, now: Duration) -> Action {
        self.sent_at = Some(now);
        self.attempts += 1;
        Action::Send(self.command().encode())
    }

    fn enter(&mut self, step: Step) {
        self.step = step;
        self.attempts = 0;
        self.sent_at = None;
        self.heard = Heard::default();
    }

    fn command(&self) -> Command {
        match self.step {
            Step::Open | Step::Quiet => Command::quiet(),
            Step::Ping => Command::Ping,
            Step::Packet => Command::SetFields(vec![Field::PacketType(self.options.packet)]),
            Step::Verify => Command::GetFields(vec![Field::PACKET_TYPE]),
            Step::Rate | Step::Finished => Command::SetFields(vec![Field::Rate(self.options.rate)]),
        }
    }

    fn answered(&self) -> bool {
        match self.step {
            Step::Quiet | Step::Rate => self.heard.taken.contains(&Field::RATE),
            Step::Ping => self.heard.pong,
            Step::Packet => self.heard.taken.contains(&Field::PACKET_TYPE),
            Step::Verify => self
                .heard
                .values
                .contains(&Field::PacketType(self.options.packet).to_pair()),
            Step::Open | Step::Finished => false,
        }
    }

    fn advance(&mut self, now: Duration) -> Option<Action> {
        let next = match self.step {
            Step::Open | Step::Quiet => Step::Ping,
            Step::Ping => Step::Packet,
            Step::Packet => Step::Verify,
            Step::Verify => Step::Rate,
            Step::Rate | Step::Finished => {
                self.enter(Step::Finished);
                return Some(Action::Done {
                    baud: self.bauds[self.baud_index],
                });
            }
        };
        self.enter(next);
        Some(self.send(now))
    }

    /// No answer in all attempts. Before the unit was heard this means the wrong line speed.
    fn give_up(&mut self) -> Option<Action> {
        if matches!(self.step, Step::Quiet | Step::Ping) {
            self.baud_index += 1;
            if self.baud_index < self.bauds.len() {
                self.enter(Step::Quiet);
                self.decoder = Decoder::default();
                return Some(Action::SetBaud(self.bauds[self.baud_index]));
            }
            return Some(self.fail(WireError::NoAnswer {
                device: DEVICE,
                bauds: self.bauds.clone(),
            }));
        }
        let command = String::from_utf8_lossy(&self.command().kind()).into_owned();
        Some(self.fail(WireError::Unconfirmed {
            device: DEVICE,
            command,
            attempts: ATTEMPTS,
        }))
    }

    fn fail(&mut self, error: WireError) -> Action {
        self.enter(Step::Finished);
        Action::Failed(error)
    }
}

#[cfg(test)]
mod tests {
    use super::super::append_packet;
    use super::*;

    /// A unit at one line speed that drops every `deaf_every`-th command.
    struct Unit {
        baud: u32,
        commands: u32,
        deaf_every: u32,
        packet: u16,
        rate: u16,
    }

    impl Unit {
        fn answer(&mut self, baud: u32, command: &[u8]) -> Vec<u8> {
            self.commands += 1;
            if baud != self.baud || self.commands.is_multiple_of(self.deaf_every) {
                return Vec::new();
            }
            let mut out = b"\x55\x00noise\x55".to_vec();
            match &command[2..4] {
                b"PK" => append_packet(*b"PK", &mut out, |_| {}),
                b"SF" => {
                    let value = u16::from_be_bytes([command[8], command[9]]);
                    if command[7] == 1 {
                        self.rate = value;
                    } else {
                        self.packet = value;
                    }
                    append_packet(*b"SF", &mut out, |o| o.extend([1, 0, command[7]]));
                }
                b"GF" => append_packet(*b"GF", &mut out, |o| {
                    o.extend([1, 0, 3]);
                    o.extend(self.packet.to_be_bytes());
                }),
                other => panic!("unexpected command {other:?}"),
            }
            out
        }
    }

    fn run(unit: &mut Unit, options: SetupOptions) -> (Action, u32) {
        let mut setup = Setup::new(options);
        let (mut now, mut baud) = (Duration::ZERO, 0);
        for _ in 0..1000 {
            match setup.poll(now) {
                Some(Action::SetBaud(new)) => baud = new,
                Some(Action::Send(bytes)) => {
                    let answer = unit.answer(baud, &bytes);
                    setup.receive(&answer);
                }
                Some(end) => return (end, baud),
                None => now = setup.deadline().expect("a silent wait has a deadline"),
            }
        }
        panic!("the dialogue does not end");
    }

    fn unit(baud: u32, deaf_every: u32) -> Unit {
        Unit {
            baud,
            commands: 0,
            deaf_every,
            packet: 0,
            rate: 9,
        }
    }

    #[test]
    fn finds_every_line_speed_and_sets_the_unit() {
        for baud in BAUDS {
            for deaf_every in [2, 3, 1000] {
                let mut unit = unit(baud, deaf_every);
                let (end, _) = run(&mut unit, SetupOptions::default());
                assert_eq!(end, Action::Done { baud });
                assert_eq!((unit.packet, unit.rate), (0x5331, 1));
            }
        }
    }

    #[test]
    fn a_silent_port_is_named_with_what_was_tried() {
        let (end, _) = run(&mut unit(0, 1000), SetupOptions::default());
        let bauds = BAUDS.to_vec();
        let device = DEVICE;
        assert_eq!(end, Action::Failed(WireError::NoAnswer { device, bauds }));
    }

    #[test]
    fn a_refusal_ends_the_dialogue() {
        let mut setup = Setup::new(SetupOptions::default());
        assert_eq!(setup.poll(Duration::ZERO), Some(Action::SetBaud(57_600)));
        assert!(matches!(setup.poll(Duration::ZERO), Some(Action::Send(_))));
        let mut nak = Vec::new();
        append_packet([0x15, 0x15], &mut nak, |o| o.extend(b"SF"));
        setup.receive(&nak);
        let Some(Action::Failed(WireError::Refused { command, .. })) = setup.poll(Duration::ZERO)
        else {
            panic!("not refused");
        };
        assert_eq!(command, "SF");
        assert_eq!(setup.poll(Duration::from_secs(9)), None);
    }
}
