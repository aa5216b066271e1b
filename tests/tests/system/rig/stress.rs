//! Sources that go down, vanish, babble and speak garbage, and a wall clock that jumps, in a real
//! kernel. The guest's clock counts its instructions, so that times do not hang on the host's load.

use atvrec_tests::rig::{boot, new_output_folder};
use atvrec_tests::{health_reports, logs_in};
use sample::{Arrival, Health, LogTime, Notice, Payload, SourceId};
use store::{Reader, Record, Selection};
use wire::crossbow440::Scaled;

/// A source is back within this time of its device's return, s.
const BACK_S: f64 = 1.0;
/// Frames of the babbling node.
const BABBLE: usize = 30_000;
/// A repeated second, and no more, is what a leap second does to the wall clock.
const LEAP_S: std::ops::Range<f64> = 0.9..1.1;
const YEAR_S: f64 = 365.25 * 86_400.0;

/// Packets of an inertial unit that counts them.
fn packets() -> Vec<u8> {
    let mut bytes = Vec::new();
    for counter in 0..1_000 {
        let packet = Scaled {
            specific_force_m_s2: [0.3, -0.2, 9.81],
            counter,
            ..Scaled::default()
        };
        packet.encode_s1(&mut bytes);
    }
    bytes
}

struct Log {
    arrivals: Vec<Arrival>,
    /// When the inertial unit's samples came.
    samples: Vec<LogTime>,
    wire: SourceId,
    bus: SourceId,
    imu: SourceId,
}

impl Log {
    fn read(reader: &Reader) -> Self {
        let id = |name: &str| {
            let sources = &reader.session().sources;
            let source = sources.iter().find(|source| source.name == name);
            source.expect("a source").id
        };
        let imu = id("imu");
        let samples = reader.messages(Selection::topics(["/imu/imu"]));
        let samples = samples.filter_map(|message| {
            match message.expect("readable").record().expect("valid") {
                Some(Record::Sample(sample)) if sample.source == imu => Some(sample.log_time),
                _ => None,
            }
        });
        let arrivals = reader.arrivals().collect::<Result<_, _>>();
        Self {
            arrivals: arrivals.expect("readable"),
            samples: samples.collect(),
            wire: id("wire"),
            bus: id("bus"),
            imu,
        }
    }

    fn mark(&self, text: &str) -> usize {
        let wanted = Payload::Notice(Notice::Mark(text.to_owned()));
        let found = self.arrivals.iter().position(|a| a.payload == wanted);
        found.unwrap_or_else(|| panic!("no mark {text}"))
    }

    /// Time from a mark to the wire's first frame after it, s.
    fn frame_after_s(&self, mark: &str) -> f64 {
        let mark = self.mark(mark);
        self.frame_from_s(mark, mark)
    }

    /// Time from a mark to the wire's first frame after its closing, which follows the mark, s: frames
    /// on their way at the mark do not count.
    fn frame_after_closing_s(&self, mark: &str) -> f64 {
        let mark = self.mark(mark);
        let is_closing = |a: &Arrival| {
            a.source == self.wire && matches!(a.payload, Payload::Notice(Notice::Closed(_)))
        };
        let closing = self.arrivals[mark..].iter().position(is_closing);
        let closing = mark + closing.expect("the wire is closed behind the mark");
        self.frame_from_s(mark, closing)
    }

    fn frame_from_s(&self, mark: usize, from: usize) -> f64 {
        let is_frame = |a: &&Arrival| a.source == self.wire && matches!(a.payload, Payload::Can(_));
        let frame = self.arrivals[from..].iter().find(is_frame);
        let frame = frame.unwrap_or_else(|| panic!("no frames after arrival {from}"));
        frame.log_time.seconds_since(self.arrivals[mark].log_time)
    }

    /// Time from a mark to the inertial unit's next sample, s.
    fn sample_after_s(&self, mark: &str) -> f64 {
        let time = self.arrivals[self.mark(mark)].log_time;
        let sample = self.samples.iter().find(|sample| **sample > time);
        sample.expect("samples come again").seconds_since(time)
    }

    /// Steps of the wall clock against the log clock between two marks, s.
    fn steps_s(&self, from: &str, to: &str) -> Vec<f64> {
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

    fn of(&self, source: SourceId) -> impl Iterator<Item = &Arrival> {
        self.arrivals.iter().filter(move |a| a.source == source)
    }
}

/// Every frame of the babbling node is recorded or counted; bus-off and the restart stand in the log.
fn babble_is_counted(log: &Log) {
    let (mut data, mut errors, mut lost) = (0, Vec::new(), 0);
    for arrival in log.of(log.bus) {
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
    assert_eq!(errors, [0x40, 0x100]);
}

/// What the inertial unit's port gave is counted, and what made no sense of it too.
fn garbage_is_counted(log: &Log, health: &Health) {
    let imu = health.sources.iter().find(|source| source.name == "imu");
    let imu = imu.expect("it has a health");
    println!("garbage: {imu:?}");
    let told_of = log.of(log.imu).filter(|a| a.log_time <= health.time);
    let read: usize = told_of
        .map(|arrival| match &arrival.payload {
            Payload::Bytes(bytes) => bytes.len(),
            _ => 0,
        })
        .sum();
    assert_eq!(imu.bytes, read as u64);
    assert!(
        imu.skipped_bytes > 500_000 && imu.messages > 1_000,
        "{imu:?}"
    );
    assert_eq!((imu.reopened, imu.lost), (1, [0; 4]));
}

#[test]
fn sources_come_back_and_time_never_turns() {
    let out = new_output_folder("stress");
    std::fs::write(out.join("packets"), packets()).expect("written");
    let speak = atvrec_tests::project().join("tests/rig/guest/speak.py");
    std::fs::copy(speak, out.join("speak.py")).expect("copied");
    boot("stress", &["--usb-serial", "--count", "--timeout", "900"]);
    let logs = logs_in(&out.join("logs"));
    let reader = Reader::open(&logs).expect("the log opens");
    assert_eq!(reader.info().missing, []);
    let log = Log::read(&reader);
    for pair in log.arrivals.windows(2) {
        assert_eq!(pair[1].sequence, pair[0].sequence + 1, "nothing is missing");
        assert!(pair[1].log_time >= pair[0].log_time, "time never turns");
    }

    let back_s = [
        (
            "the interface was taken down",
            log.frame_after_closing_s("down"),
        ),
        (
            "the CAN adapter was plugged in",
            log.frame_after_s("plugged"),
        ),
        (
            "the USB adapter was plugged in",
            log.sample_after_s("plugged"),
        ),
        ("the garbage", log.sample_after_s("packets after garbage")),
        (
            "the wrong bit rate",
            log.sample_after_s("packets at the right bit rate"),
        ),
        (
            "the clock went to 2002",
            log.sample_after_s("clock to 2002"),
        ),
        (
            "the clock was put right",
            log.sample_after_s("clock right again"),
        ),
        (
            "the clock went a second back",
            log.sample_after_s("small step"),
        ),
        (
            "the GPS week began anew",
            log.sample_after_s("GPS week rollover"),
        ),
    ];
    println!("seconds until data came again, after: {back_s:.3?}");
    assert!(back_s.iter().all(|(_, s)| *s <= BACK_S), "{back_s:?}");

    babble_is_counted(&log);
    let reports = health_reports(&logs);
    garbage_is_counted(&log, reports.last().expect("a health message"));

    let far_s = log.steps_s("clock to 2002", "clock right again");
    assert!(far_s[0] < -20.0 * YEAR_S, "{far_s:?}");
    let leap_s = log.steps_s("leap second", "end");
    println!("steps of the wall clock at the leap second, s: {leap_s:.2?}");
    assert!(leap_s.iter().any(|s| LEAP_S.contains(&-s)), "{leap_s:?}");
}
