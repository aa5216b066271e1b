//! Buses that go down, vanish and babble, and a wall clock that jumps, in a real kernel.
#![cfg(feature = "rig")]

use atvrec_tests::logs_in;
use atvrec_tests::rig::{boot, new_output_folder};
use sample::{Arrival, Notice, Payload};
use store::Reader;

/// A bus is back within this time of the device's return, s.
const BACK_S: f64 = 1.0;
/// Frames of the babbling node.
const BABBLE: usize = 30_000;
/// A repeated second, and no more, is what a leap second does to the wall clock.
const LEAP_S: std::ops::Range<f64> = 0.9..1.1;

struct Log {
    arrivals: Vec<Arrival>,
    wire: sample::SourceId,
    bus: sample::SourceId,
}

impl Log {
    fn mark(&self, text: &str) -> usize {
        let wanted = Payload::Notice(Notice::Mark(text.to_owned()));
        let found = self.arrivals.iter().position(|a| a.payload == wanted);
        found.unwrap_or_else(|| panic!("no mark {text}"))
    }

    /// Time from the instant of an arrival to the first frame of the wire after it, s, once the
    /// wire has been seen closed.
    fn back_after(&self, mark: usize) -> f64 {
        let closed = self.arrivals[mark..].iter().position(|arrival| {
            arrival.source == self.wire
                && matches!(arrival.payload, Payload::Notice(Notice::Closed(_)))
        });
        let from = mark + closed.unwrap_or(0);
        let frame = self.arrivals[from..].iter().find(|arrival| {
            arrival.source == self.wire && matches!(arrival.payload, Payload::Can(_))
        });
        let frame = frame.expect("frames come again");
        frame.log_time.seconds_since(self.arrivals[mark].log_time)
    }

    /// Steps of the wall clock against the log clock between two marks, s.
    fn steps(&self, from: &str, to: &str) -> Vec<f64> {
        let between = &self.arrivals[self.mark(from)..=self.mark(to)];
        let offset = |a: &Arrival| a.realtime_ns - a.log_time.0 as i64;
        let steps = between
            .windows(2)
            .map(|pair| offset(&pair[1]) - offset(&pair[0]));
        steps
            .map(|step| step as f64 * 1e-9)
            .filter(|step| step.abs() > 0.2)
            .collect()
    }
}

#[test]
fn sources_come_back_and_time_never_turns() {
    let out = new_output_folder("stress");
    boot("stress", &[]);
    let logs = logs_in(&out.join("logs"));
    let reader = Reader::open(&logs).expect("the log opens");
    assert_eq!(reader.info().missing, []);
    let id = |name: &str| {
        let sources = &reader.session().sources;
        let source = sources.iter().find(|source| source.name == name);
        source.expect("a source").id
    };
    let log = Log {
        arrivals: reader
            .arrivals()
            .collect::<Result<_, _>>()
            .expect("readable"),
        wire: id("wire"),
        bus: id("bus"),
    };
    for pair in log.arrivals.windows(2) {
        assert_eq!(pair[1].sequence, pair[0].sequence + 1, "nothing is missing");
        assert!(pair[1].log_time >= pair[0].log_time, "time never turns");
    }

    let down = log.back_after(log.mark("down"));
    let plugged = log.back_after(log.mark("plugged"));
    println!(
        "frames {down:.2} s after the interface went down, {plugged:.2} s after the adapter came back"
    );
    assert!(down <= BACK_S && plugged <= BACK_S, "{down} s, {plugged} s");

    let of_bus = log
        .arrivals
        .iter()
        .filter(|arrival| arrival.source == log.bus);
    let (mut data, mut errors, mut lost) = (0, Vec::new(), 0);
    for arrival in of_bus {
        match &arrival.payload {
            Payload::Can(frames) => {
                data += frames.iter().filter(|frame| !frame.flags.error).count();
                errors.extend(frames.iter().filter(|f| f.flags.error).map(|f| f.id));
            }
            Payload::Notice(Notice::Lost { count, .. }) => lost += *count as usize,
            _ => {}
        }
    }
    println!("babbling node: {data} frames recorded, {lost} counted as lost, of {BABBLE}");
    assert_eq!(data + lost, BABBLE);
    assert_eq!(
        errors,
        [0x40, 0x100],
        "bus-off and the restart stand in the log"
    );

    let year = 365.25 * 86_400.0;
    let far = log.steps("clock to 2002", "clock right again");
    assert!(far[0] < -20.0 * year, "{far:?}");
    let leap = log.steps("leap second", "end");
    println!("steps of the wall clock at the leap second, s: {leap:.2?}");
    assert!(leap.iter().any(|step| LEAP_S.contains(&-step)), "{leap:?}");
}
