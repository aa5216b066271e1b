//! SLCAN adapters: text on a serial port into CAN frames.

use std::time::Duration;

use sample::{LossPlace, Payload};
use tokio::sync::watch;
use wire::slcan::{Command, Decoder, Event};

use crate::SlcanSpec;
use crate::context::SourceContext;
use crate::port;
use crate::protocol::{Action, SerialProtocol};

/// Time for an adapter to take a command.
const COMMAND_PAUSE: Duration = Duration::from_millis(20);
/// How often an adapter is asked whether it lost frames.
const STATUS_PERIOD: Duration = Duration::from_secs(1);

/// Runs a SLCAN source until the shutdown.
pub(crate) async fn run(
    context: &SourceContext,
    spec: &SlcanSpec,
    shutdown: watch::Receiver<bool>,
) {
    let mut protocol = SlcanProtocol::new(context.clone(), spec);
    port::run(context, &spec.port, &mut protocol, shutdown).await;
}

struct SlcanProtocol {
    context: SourceContext,
    /// What is sent at each opening, in order.
    opening: Vec<Vec<u8>>,
    /// Next of `opening`; past its end the adapter is on the bus.
    next: usize,
    /// Whether the adapter knows the status command.
    has_status: bool,
    /// The last command was a request for the status.
    asked_status: bool,
    decoder: Decoder,
    /// Malformed lines already reported.
    malformed: u64,
    /// The rest of a line that began before the opening was counted out.
    start_seen: bool,
}

impl SlcanProtocol {
    fn new(context: SourceContext, spec: &SlcanSpec) -> Self {
        let mut opening = vec![b"\r\r\r".to_vec()];
        let on_bus = if spec.listen_only {
            Command::ListenOnly
        } else {
            Command::Open
        };
        let commands = [
            Some(Command::Close),
            spec.bit_rate.map(Command::BitRate),
            Some(Command::Timestamps(spec.timestamps)),
            Some(on_bus),
        ];
        for command in commands.into_iter().flatten() {
            match command.encode() {
                Some(line) => opening.push(line),
                None => tracing::error!(
                    source = %context.name,
                    ?command,
                    "SLCAN does not support this bit rate; the adapter keeps its own"
                ),
            }
        }
        Self {
            context,
            opening,
            next: 0,
            has_status: true,
            asked_status: false,
            decoder: Decoder::new(),
            malformed: 0,
            start_seen: false,
        }
    }

    fn refused(&mut self) {
        if self.next <= self.opening.len() && self.next > 0 {
            let line = String::from_utf8_lossy(&self.opening[self.next - 1]).into_owned();
            // Leaving a bus that one is not on is refused by some adapters.
            if line != "C\r" {
                tracing::warn!(
                    source = %self.context.name,
                    command = line.trim(),
                    "the SLCAN adapter rejected a command"
                );
            }
        } else if self.asked_status {
            self.has_status = false;
        }
    }
}

impl SerialProtocol for SlcanProtocol {
    fn on_open(&mut self) -> Action {
        self.next = 0;
        self.asked_status = false;
        self.decoder = Decoder::new();
        self.malformed = 0;
        self.start_seen = false;
        self.on_timer()
    }

    fn on_bytes(&mut self, bytes: &[u8]) -> Action {
        let mut frames = Vec::new();
        let mut overrun = false;
        let mut refused = false;
        self.decoder.push(bytes, &mut |event| match event {
            Event::Frame(frame) => frames.push(frame),
            Event::Status(status) => {
                overrun |= status.lost_frames();
                if status.0 != 0 {
                    tracing::warn!(
                        source = %self.context.name,
                        status = status.describe(),
                        "the SLCAN adapter reports an error"
                    );
                }
            }
            Event::Refused => refused = true,
            _ => {}
        });
        if refused {
            self.refused();
        }
        let statistics = self.decoder.statistics();
        let mut broken = statistics.malformed - self.malformed;
        self.malformed += broken;
        // The first line may be the rest of one that began before the opening: no frame was lost.
        if statistics.first_malformed && !self.start_seen {
            self.start_seen = true;
            broken = broken.saturating_sub(1);
        }
        // An overrun is at least one frame; the adapter does not say how many.
        self.context
            .lost(LossPlace::Device, broken + u64::from(overrun));
        if !frames.is_empty() {
            let payload = Payload::Can(frames);
            self.context.sequencer.push(self.context.id, payload);
        }
        Action::default()
    }

    fn on_timer(&mut self) -> Action {
        if let Some(line) = self.opening.get(self.next) {
            self.next += 1;
            return Action {
                write: line.clone(),
                wake: Some(COMMAND_PAUSE),
                baud: None,
            };
        }
        self.next = self.opening.len() + 1;
        let status = Command::ReadStatus.encode().filter(|_| self.has_status);
        self.asked_status = status.is_some();
        Action {
            wake: status.is_some().then_some(STATUS_PERIOD),
            write: status.unwrap_or_default(),
            baud: None,
        }
    }

    fn on_close(&mut self) -> Vec<u8> {
        Command::Close.encode().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use sample::{Notice, SourceId};

    use super::*;
    use crate::{LogClock, PortSpec, QueueSizes, Sequencer};

    fn protocol() -> (SlcanProtocol, crate::Streams) {
        let (sequencer, streams) = Sequencer::new(LogClock::start(), QueueSizes::default());
        let context = SourceContext {
            id: SourceId(1),
            name: "can".to_owned(),
            sequencer,
        };
        let spec = SlcanSpec {
            port: PortSpec::new("/dev/null", 115_200),
            bit_rate: Some(500_000),
            listen_only: false,
            timestamps: true,
        };
        (SlcanProtocol::new(context, &spec), streams)
    }

    #[test]
    fn the_adapter_is_set_up_then_asked_for_losses() {
        let (mut protocol, _streams) = protocol();
        let mut sent = protocol.on_open().write;
        for _ in 0..5 {
            sent.extend(protocol.on_timer().write);
        }
        assert_eq!(sent, b"\r\r\rC\rS6\rZ1\rO\rF\r");
        protocol.on_bytes(b"\x07");
        assert_eq!(protocol.on_timer(), Action::default());
        assert_eq!(protocol.on_close(), b"C\r");
    }

    /// After good lines, the first broken line is a loss too.
    #[test]
    fn every_broken_line_behind_the_first_is_lost() {
        let (mut protocol, mut streams) = protocol();
        protocol.on_open();
        protocol.on_bytes(b"t1231AA\rt1231AB\rt1231AC\rt12\rt1231ZZ\rt123\r");
        let mut lost = 0;
        while let Ok(arrival) = streams.recorder.try_recv() {
            if let Payload::Notice(Notice::Lost { count, .. }) = arrival.payload {
                lost += count;
            }
        }
        assert_eq!(lost, 3);
    }

    #[test]
    fn frames_and_losses_become_arrivals() {
        let (mut protocol, mut streams) = protocol();
        protocol.on_open();
        protocol.on_bytes(b"33\rt1002");
        protocol.on_bytes(b"AABB0005\rt1001CC0006\r");
        protocol.on_bytes(b"t10garbage\rF08\r");
        let frames = streams.recorder.try_recv().expect("frames");
        let Payload::Can(frames) = &frames.payload else {
            panic!("{frames:?}");
        };
        assert_eq!(frames.len(), 2);
        assert_eq!(frames[0].bytes(), [0xAA, 0xBB]);
        assert_eq!(frames[1].hardware_ns, Some(6_000_000));
        let lost = streams.recorder.try_recv().expect("a notice");
        let expected = Notice::Lost {
            place: LossPlace::Device,
            count: 2,
        };
        assert_eq!(lost.payload, Payload::Notice(expected));
        assert!(streams.recorder.try_recv().is_err());
    }
}
