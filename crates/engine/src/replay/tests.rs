use std::path::{Path, PathBuf};

use sample::SourceId;
use store::Writer;

use super::*;
use crate::SILENCE_NS;

const CONFIGURATION: &str = r#"
[source.t]
kind = "line"
device = "imported/t"
steer = "steering_wheel"

[source.t.fields.steering_wheel]
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
        ..session::simulated(&config, "old", start)
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

/// Whether a verified replay, which may be written as a log too, gives what the log holds.
fn is_verified(log: &Path, output: Option<&Path>) -> bool {
    let reader = Reader::open([log]).expect("a log");
    let attachments = reader.attachments().expect("attachments");
    let config = Config::from_attachments(&attachments).expect("a configuration");
    let options = ReplayOptions {
        verify: true,
        ..ReplayOptions::default()
    };
    let replay = Replay::new(&reader, &config, options).expect("a replay");
    let mut writer = output.map(|path| {
        let options = config.storage.options.clone();
        Writer::create(path, replay.session().clone(), options, 0).expect("a log")
    });
    let replayed = replay.run(|entry| -> Result<()> {
        match (&mut writer, entry) {
            (Some(writer), Entry::Arrival(arrival)) => writer.push(arrival)?,
            (Some(writer), Entry::Record(record)) => writer.record(&record),
            (None, _) => {}
        }
        Ok(())
    });
    if let Some(writer) = writer {
        writer.finish().expect("closed");
    }
    let replayed = replayed.expect("it replays");
    let verification = replayed.verification.expect("it was asked for");
    verification.is_identical() && !replayed.changed
}

#[test]
fn logs_of_earlier_versions_verify_with_their_estimates_during_silence() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let now = SILENCE_NS.cast_unsigned();
    assert!(is_verified(&log(here, "new.mcap", false, now), None));
    let old = log(here, "old.mcap", true, 0);
    assert!(is_verified(&old, None));
    // What is written is what this version gives.
    let again = here.join("again.mcap");
    assert!(is_verified(&old, Some(&again)));
    assert!(is_verified(&again, None));
    let estimates = |path: &Path| {
        let reader = Reader::open([path]).expect("a log");
        reader.estimates().count()
    };
    let of_new = estimates(&here.join("new.mcap"));
    assert_eq!(estimates(&again), of_new);
    assert!(estimates(&old) > of_new + 150);
    // Estimates during silence in a log of this version are a difference.
    assert!(!is_verified(&log(here, "wrong.mcap", true, now), None));
}
