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
    edited_log(directory, name, through_silence, silence_ns, |_, _| ())
}

/// The same; `edit` changes the records of each step before they are written.
fn edited_log(
    directory: &Path,
    name: &str,
    through_silence: bool,
    silence_ns: u64,
    edit: impl Fn(u64, &mut Vec<Record>),
) -> PathBuf {
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
        edit(step, &mut records);
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
    let replayed = verified(log, output);
    let verification = replayed.verification.expect("it was asked for");
    verification.is_identical() && !replayed.changed
}

/// A verified replay, whose sink gets the records if it writes a log.
fn verified(log: &Path, output: Option<&Path>) -> Replayed {
    let reader = Reader::open([log]).expect("a log");
    let attachments = reader.attachments().expect("attachments");
    let config = Config::from_attachments(&attachments).expect("a configuration");
    let options = ReplayOptions {
        verify: true,
        without_records: output.is_none(),
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
    replayed.expect("it replays")
}

/// The first estimate among records.
fn estimate(records: &mut [Record]) -> &mut sample::Estimate {
    let mut estimates = records.iter_mut().filter_map(|record| match record {
        Record::Estimate(estimate) => Some(&mut **estimate),
        _ => None,
    });
    estimates.next().expect("an estimate in each step")
}

/// What a verification reports of a log that was changed by `edit`: counts of different messages, of those
/// in the log alone and in the replay alone, and the differences.
fn found(name: &str, edit: impl Fn(u64, &mut Vec<Record>)) -> ([u64; 3], Vec<String>) {
    let directory = tempfile::tempdir().expect("a directory");
    let silence_ns = SILENCE_NS.cast_unsigned();
    let path = edited_log(directory.path(), name, false, silence_ns, edit);
    let [alone, written] = [None, Some(directory.path().join("again.mcap"))].map(|output| {
        let found = verified(&path, output.as_deref()).verification;
        found.expect("it was asked for").as_json()
    });
    assert_eq!(alone, written);
    let sum = |of: &serde_json::Value| {
        let counts = of.as_object().expect("topics").values();
        counts.filter_map(serde_json::Value::as_u64).sum()
    };
    let different = alone["different"].as_u64().expect("a count");
    let counts = [
        different,
        sum(&alone["only_recorded"]),
        sum(&alone["only_computed"]),
    ];
    let texts = alone["first_differences"].as_array().expect("texts");
    let text = |text: &serde_json::Value| text.as_str().expect("a text").to_owned();
    (counts, texts.iter().map(text).collect())
}

/// Time of a message as the report prints it. The first estimate of an arrival is 0.1 s before it.
fn at(seconds: f64) -> String {
    format!(
        " at {} s",
        LogTime(1_000_000_000_000_000_000).offset_seconds(seconds)
    )
}

#[test]
fn changed_messages_are_reported_in_the_order_of_their_times() {
    let (counts, texts) = found("changed.mcap", |step, records| match step {
        5 => estimate(records).expected[sample::Wheel::FrontLeft].force_n[0] = 1.25,
        45 => estimate(records).motion.roll_rad += 1e-9,
        _ => {}
    });
    assert_eq!(counts, [2, 0, 0], "{texts:?}");
    assert!(
        texts[0].starts_with(&format!("/model/tyre_forces{}: byte", at(0.4))),
        "{texts:?}"
    );
    assert!(texts[1].starts_with("/estimate/motion at "), "{texts:?}");
}

#[test]
fn missing_and_added_messages_are_reported_at_their_times() {
    let is_estimate = |record: &Record| matches!(record, Record::Estimate(_));
    let (counts, texts) = found("missing.mcap", |step, records| {
        if step == 5 {
            let first = records.iter().position(is_estimate).expect("an estimate");
            records.remove(first);
        }
    });
    assert_eq!(counts[..2], [0, 0], "{texts:?}");
    assert!((3..=5).contains(&counts[2]), "{counts:?}");
    let expected = format!(
        "/estimate/contact_forces{} is in the replay, but not in the log",
        at(0.4)
    );
    assert_eq!(texts[0], expected);
    let (counts, texts) = found("added.mcap", |step, records| {
        if step == 5 {
            let mut added = estimate(records).clone();
            added.time = added.time.offset_seconds(0.004);
            records.push(Record::Estimate(Box::new(added)));
        }
    });
    assert_eq!((counts[0], counts[2]), (0, 0), "{texts:?}");
    assert!((3..=5).contains(&counts[1]), "{counts:?}");
    let expected = format!(
        "/estimate/contact_forces{} is in the log, but not in the replay",
        at(0.404)
    );
    assert_eq!(texts[0], expected);
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
