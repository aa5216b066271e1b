use std::path::{Path, PathBuf};

use sample::SourceId;

use super::*;

const CONFIGURATION: &str = r#"
[source.t]
kind = "line"
device = "imported/t"
steer = "hand_wheel"

[source.t.fields.hand_wheel]
index = 0
scale = 0.001
unit = "rad"

[vehicle]
file = "prowler"
"#;

/// A log of one second of data, three of ticks, one of data, as an engine before the rule on silence
/// made it, or one after.
fn log(directory: &Path, name: &str, through_silence: bool, silence_ns: u64) -> PathBuf {
    let config = Config::from_text(CONFIGURATION, Path::new(".")).expect("a configuration");
    let start = LogTime(1_000_000_000_000_000_000);
    let session = Session {
        silence_ns,
        ..engine::session::simulated(&config, session::PROGRAM, "old", start)
    };
    let mut engine = Engine::new(&config).expect("an engine");
    if through_silence {
        engine = engine.through_silence();
    }
    let path = directory.join(name);
    let options = config.storage.options.clone();
    let mut writer = Writer::create(&path, session, options, 0).expect("a log");
    let mut records = Vec::new();
    for step in 0..50_u64 {
        let is_silent = (10..40).contains(&step);
        let (source, payload) = match is_silent {
            true => (SourceId::HOST, Payload::Tick),
            false => (SourceId(0), Payload::Bytes(b"12\r\n".to_vec())),
        };
        let arrival = Arrival {
            sequence: step,
            source,
            log_time: start.offset_seconds(step as f64 / 10.0),
            realtime_ns: 0,
            payload,
        };
        records.clear();
        engine.push(&arrival, &mut records);
        writer.push(arrival).expect("written");
        for record in &records {
            writer.record(record);
        }
    }
    writer.finish().expect("closed");
    path
}

fn verified(log: PathBuf, output: Option<PathBuf>) -> Outcome {
    let args = ReplayArgs {
        logs: vec![log],
        output,
        config: None,
        changes: crate::cli::ReplayChanges::default(),
        smooth: false,
        rate: None,
        verify: true,
        json: false,
        replace: crate::cli::Replace::default(),
    };
    run(&args, true).expect("it replays")
}

#[test]
fn logs_of_earlier_versions_verify_with_their_estimates_during_silence() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let now = engine::SILENCE_NS.cast_unsigned();
    assert_eq!(
        verified(log(here, "new.mcap", false, now), None),
        Outcome::Good
    );
    let old = log(here, "old.mcap", true, 0);
    assert_eq!(verified(old.clone(), None), Outcome::Good);
    // What is written is what this version gives.
    assert_eq!(verified(old, Some(here.join("again.mcap"))), Outcome::Good);
    assert_eq!(verified(here.join("again.mcap"), None), Outcome::Good);
    let estimates = |name: &str| {
        Reader::open([here.join(name)])
            .expect("a log")
            .estimates()
            .count()
    };
    assert_eq!(estimates("again.mcap"), estimates("new.mcap"));
    assert!(estimates("old.mcap") > estimates("new.mcap") + 150);
    // Estimates during silence in a log of this version are a difference.
    assert_eq!(
        verified(log(here, "wrong.mcap", true, now), None),
        Outcome::Failed
    );
}
