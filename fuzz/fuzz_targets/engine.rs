//! Arrivals of any source with any bytes: never a panic, and two engines give the same records.
#![no_main]

use std::path::Path;
use std::sync::LazyLock;

use engine::{Config, Engine};
use libfuzzer_sys::fuzz_target;
use sample::{Arrival, LogTime, Payload, SourceId};
use store::Record;

/// One source of each kind that delivers bytes, and an estimator on them.
const CONFIGURATION: &str = r#"
[source.a_gnss]
kind = "gnss"
device = "a"
[source.b_imu]
kind = "crossbow440"
device = "b"
[source.c_line]
kind = "line"
device = "c"
steer = "angle"
[source.c_line.fields.angle]
index = 0
scale = 0.001
unit = "rad"
[vehicle]
file = "prowler"
"#;

static CONFIG: LazyLock<Config> = LazyLock::new(|| {
    Config::from_text(CONFIGURATION, Path::new(".")).expect("a valid configuration")
});

/// Arrivals from runs of source, time since the last one in 4 ms, length, bytes.
fn arrivals(mut data: &[u8]) -> Vec<Arrival> {
    let mut arrivals = Vec::new();
    let mut time = LogTime(1_000_000_000_000_000_000);
    while let [source, wait, length, rest @ ..] = data {
        let (bytes, behind) = rest.split_at(usize::from(*length).min(rest.len()));
        time = time + i64::from(*wait) * 4_000_000;
        arrivals.push(Arrival {
            sequence: arrivals.len() as u64,
            source: SourceId(u16::from(source % 3)),
            log_time: time,
            realtime_ns: 0,
            payload: Payload::Bytes(bytes.to_vec()),
        });
        data = behind;
    }
    arrivals
}

/// Text of all records, in which a NaN equals itself.
fn run(arrivals: &[Arrival]) -> String {
    let mut engine = Engine::new(&CONFIG).expect("an engine");
    let mut records: Vec<Record> = Vec::new();
    for arrival in arrivals {
        engine.push(arrival, &mut records);
    }
    format!("{records:?}")
}

fuzz_target!(|data: &[u8]| {
    let arrivals = arrivals(data);
    assert!(run(&arrivals) == run(&arrivals), "the records differ");
});
