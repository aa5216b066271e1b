//! Frames of `output.can` that the kernel delivers to the source of the same interface.
//!
//! They are in the log as raw frames of the bus, marked as local. They are no data of the vehicle: an
//! estimate that is made because the estimate before it was sent would have no end.

use acq::SourceKind;
use sample::{Arrival, CanFrame, Payload, SourceId};

use crate::Config;
use crate::config::{CanOutput, CanPort};

/// The output, and the sources that receive it.
pub struct OwnFrames {
    output: CanOutput,
    sources: Vec<SourceId>,
}

impl OwnFrames {
    /// `None` if the output goes to no interface of a source.
    pub fn of(config: &Config) -> Option<Self> {
        let output = config.output.can.clone()?;
        let CanPort::Interface(name) = &output.port else {
            return None;
        };
        let sources = config.sources.iter().filter(
            |source| matches!(&source.spec.kind, SourceKind::Can(can) if can.interface == *name),
        );
        let sources: Vec<SourceId> = sources.map(|source| source.spec.id).collect();
        (!sources.is_empty()).then_some(Self { output, sources })
    }

    /// The arrival without the output; `None` if there is no output in it.
    pub fn without(&self, arrival: &Arrival) -> Option<Arrival> {
        let Payload::Can(frames) = &arrival.payload else {
            return None;
        };
        let is_own = |frame: &CanFrame| frame.flags.local_echo && self.output.has(frame);
        if !self.sources.contains(&arrival.source) || !frames.iter().any(is_own) {
            return None;
        }
        let others = frames.iter().filter(|frame| !is_own(frame)).cloned();
        Some(Arrival {
            payload: Payload::Can(others.collect()),
            ..*arrival
        })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use sample::{CanFlags, LogTime};
    use store::Record;

    use crate::{Config, Engine};

    use super::*;

    const CONFIGURATION: &str = r#"
[source.t]
kind = "line"
device = "imported/t"
steer = "steering_wheel"

[source.t.fields.steering_wheel]
index = 0
scale = 0.001
unit = "rad"

[source.bus]
kind = "can"
interface = "vcan0"
dbc = []
silent_after_s = 1

[output.can]
interface = "vcan0"
share = true

[vehicle]
file = "prowler"
"#;

    fn frame(id: u32, local_echo: bool) -> CanFrame {
        let flags = CanFlags {
            local_echo,
            ..CanFlags::default()
        };
        CanFrame::new(id, flags, &[0; 8]).expect("a frame")
    }

    /// One second of data, then four seconds of frames on the bus: number of estimates, frames of the bus
    /// and whether it is silent.
    fn run(frames: &[CanFrame]) -> (usize, u64, bool) {
        let config = Config::from_text(CONFIGURATION, Path::new(".")).expect("a configuration");
        let of = |name: &str| {
            let source = config.sources.iter().find(|s| s.spec.name == name);
            source.expect("a source").spec.id
        };
        let mut engine = Engine::new(&config).expect("an engine");
        let start = LogTime(1_000_000_000_000_000_000);
        let (mut records, mut now) = (Vec::new(), start);
        for step in 0..500_u64 {
            now = start.offset_seconds(step as f64 / 100.0);
            let (source, payload) = if step < 100 {
                (of("t"), Payload::Bytes(b"12\r\n".to_vec()))
            } else {
                (of("bus"), Payload::Can(frames.to_vec()))
            };
            let arrival = Arrival {
                sequence: step,
                source,
                log_time: now,
                realtime_ns: 0,
                payload,
            };
            engine.push(&arrival, &mut records);
            if step == 100 {
                engine.push(&opened(of("bus"), now), &mut records);
            }
        }
        let estimates = records.iter().filter(|r| matches!(r, Record::Estimate(_)));
        let health = engine.health(now);
        let bus = health.sources.iter().find(|source| source.name == "bus");
        let bus = bus.expect("the bus");
        (estimates.count(), bus.messages, bus.silent)
    }

    fn opened(source: SourceId, log_time: LogTime) -> Arrival {
        Arrival {
            sequence: 0,
            source,
            log_time,
            realtime_ns: 0,
            payload: Payload::Notice(sample::Notice::Opened("vcan0".to_owned())),
        }
    }

    /// Without data of the vehicle there is no estimate after 1 s, although the output goes on.
    #[test]
    fn own_output_is_no_data() {
        let none = run(&[]);
        assert!((150..250).contains(&none.0), "{none:?}");
        assert_eq!(run(&[frame(0x500, true), frame(0x50A, true)]), none);
        assert!(none.2, "the bus is silent");
        // Frames of others: another identifier, or the same one from another computer.
        for other in [frame(0x50B, true), frame(0x500, false)] {
            let found = run(&[frame(0x500, true), other.clone()]);
            assert!(found.0 > none.0 + 200, "{found:?}");
            assert_eq!((found.1, found.2), (400, false), "{other:?}");
        }
    }
}
