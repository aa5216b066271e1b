//! What is written is read back, in the same order, from whole logs.

use std::collections::{BTreeMap, VecDeque};

use atvrec_store::{LogWriter, Missing, Options, Reader, Record, Selection, Stage, Writer};
use proptest::prelude::*;
use sample::{Arrival, LogTime};

use crate::common::{START, arrivals, estimate, records, session};

fn write(arrivals: &[Arrival], records: &[Record], options: &Options) -> Vec<u8> {
    let mut writer =
        LogWriter::new(Vec::new(), session(), options.clone(), 0).expect("a vector takes all");
    for arrival in arrivals {
        writer.push(arrival.clone()).expect("a vector takes all");
    }
    for record in records {
        writer.record(record);
    }
    writer.finish(&BTreeMap::new()).expect("a vector takes all")
}

fn on_disk(bytes: &[u8]) -> (tempfile::TempDir, Reader) {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("log.mcap");
    std::fs::write(&path, bytes).expect("written");
    let reader = Reader::open([&path]).expect("a log");
    (directory, reader)
}

fn read_arrivals(reader: &Reader) -> (Vec<Arrival>, Vec<Missing>) {
    let mut stream = reader.arrivals();
    let arrivals = stream
        .by_ref()
        .collect::<Result<_, _>>()
        .expect("arrivals can be read");
    (arrivals, stream.missing())
}

#[test]
fn arrivals_come_back_in_their_order() {
    let written = arrivals(1, 3_000);
    let (_directory, reader) = on_disk(&write(&written, &[], &Options::default()));
    let (read, missing) = read_arrivals(&reader);
    assert_eq!(missing, []);
    assert_eq!(read, written);
}

#[test]
fn every_record_comes_back() {
    let written = records(START);
    let (_directory, reader) = on_disk(&write(&[], &written, &Options::default()));
    // Chunks of sensors and chunks of estimates, each in the order of writing.
    let mut kinds = [VecDeque::new(), VecDeque::new()];
    for message in reader.messages(Selection::default()) {
        let message = message.expect("readable");
        let kind = usize::from(Stage::from_topic(&message.channel.topic).is_some());
        kinds[kind].extend(message.record().expect("by its schema"));
    }
    for record in written {
        let own = kinds.iter_mut().find(|kind| kind.front() == Some(&record));
        assert!(own.and_then(VecDeque::pop_front).is_some(), "{record:?}");
    }
    assert_eq!(kinds, [VecDeque::new(), VecDeque::new()]);
}

/// A reader of estimates inflates no signals of sensors.
#[test]
fn sensors_and_estimates_are_in_different_chunks() {
    let (_directory, reader) = on_disk(&write(&[], &records(START), &Options::default()));
    let path = &reader.info().files[0].0;
    let bytes = std::fs::read(path).expect("the log");
    let summary = mcap::Summary::read(&bytes)
        .expect("a log")
        .expect("indexes");
    let is_estimate = |id: &u16| Stage::from_topic(&summary.channels[id].topic).is_some();
    let mut kinds = Vec::new();
    for chunk in &summary.chunk_indexes {
        let mut found: Vec<bool> = chunk
            .message_index_offsets
            .keys()
            .map(is_estimate)
            .collect();
        found.dedup();
        kinds.push(found);
    }
    kinds.sort();
    assert_eq!(kinds, [[false], [true]]);
}

#[test]
fn estimates_are_put_together_again() {
    let written: Vec<_> = (0..300).map(|n| estimate(START + n * 10_000_000)).collect();
    let records: Vec<_> = written
        .iter()
        .cloned()
        .map(Box::new)
        .map(Record::Estimate)
        .collect();
    let (_directory, reader) = on_disk(&write(&[], &records, &Options::default()));
    let read: Vec<_> = reader
        .estimates()
        .collect::<Result<_, _>>()
        .expect("readable");
    assert_eq!(read, written);
}

#[test]
fn same_input_gives_same_bytes() {
    let arrivals = arrivals(2, 2_000);
    let records = records(START);
    let once = write(&arrivals, &records, &Options::default());
    let again = write(&arrivals, &records, &Options::default());
    assert!(once == again);
}

#[test]
fn a_log_explains_itself() {
    let (_directory, reader) = on_disk(&write(&arrivals(3, 500), &[], &Options::default()));
    let expected = session();
    assert_eq!(reader.session().sources, expected.sources);
    assert_eq!(reader.session().git_hash, expected.git_hash);
    assert_eq!(reader.session().started, expected.started);
    assert_eq!(
        reader.attachments().expect("readable"),
        expected.attachments
    );
    let info = reader.info();
    assert_eq!(info.counters["arrivals"], 500);
    assert_eq!(info.missing, []);
    assert!(info.channels.contains_key("/raw/can0"));
    assert!(info.channels.contains_key("/clock"));
}

/// `docs/log.md` is the contract: what is in a log is in it.
#[test]
fn schemas_and_metadata_are_documented() {
    let contract = include_str!("../../../../docs/log.md");
    let mut records = records(START);
    records.push(Record::Estimate(Box::new(estimate(START))));
    let (_directory, reader) = on_disk(&write(&arrivals(8, 500), &records, &Options::default()));
    let info = reader.info();
    for (topic, (schema, _)) in &info.channels {
        let made = schema.starts_with("atvrec.signals.");
        let known = made || contract.contains(&format!("`{schema}`"));
        assert!(known, "{schema} of {topic} is not documented");
    }
    for (name, record) in reader.metadata() {
        assert!(contract.contains(&format!("`{name}`")), "{name}");
        for key in record.keys() {
            let lists = ["source.", "lost.", "injected_fault."];
            let generic = lists.iter().any(|list| key.starts_with(list));
            let known = generic || contract.contains(&format!("`{key}`"));
            assert!(known, "{key} of {name} is not documented");
        }
    }
}

#[test]
fn a_stretch_of_time_is_read_through_the_indexes() {
    let written = arrivals(4, 5_000);
    let (_directory, reader) = on_disk(&write(&written, &[], &Options::default()));
    let (start, end) = (written[1_000].log_time, written[1_500].log_time);
    let mut stream = reader.arrivals_between(start, end);
    let read: Vec<Arrival> = stream.by_ref().collect::<Result<_, _>>().expect("readable");
    let wanted: Vec<Arrival> = written
        .iter()
        .filter(|arrival| (start..=end).contains(&arrival.log_time))
        .cloned()
        .collect();
    assert_eq!(read, wanted);
    assert_eq!(stream.missing(), []);
}

#[test]
fn lost_arrivals_are_told() {
    let mut written = arrivals(5, 1_000);
    written.retain(|arrival| !(300..310).contains(&arrival.sequence) && arrival.sequence != 700);
    let (_directory, reader) = on_disk(&write(&written, &[], &Options::default()));
    let (read, missing) = read_arrivals(&reader);
    assert_eq!(read, written);
    let gap = |first_sequence, count| Missing::Arrivals {
        first_sequence,
        count,
    };
    assert_eq!(missing, [gap(300, 10), gap(700, 1)]);
}

#[test]
fn parts_of_a_run_are_one_log_whatever_order_they_are_given_in() {
    let directory = tempfile::tempdir().expect("a directory");
    let written = arrivals(6, 900);
    let mut paths = Vec::new();
    for (part, piece) in written.chunks(300).enumerate() {
        let path = directory.path().join(format!("{part}.mcap"));
        let mut writer =
            Writer::create(&path, session(), Options::default(), part as u32).expect("a file");
        for arrival in piece {
            writer.push(arrival.clone()).expect("written");
        }
        assert!(!path.exists(), "a log has its name only when it is whole");
        assert_eq!(writer.finish().expect("closed").path, path);
        paths.insert(0, path);
    }
    let reader = Reader::open(&paths).expect("one run");
    // The first sequence of a run is 0, and that of the next file does not add to it.
    let counters = reader.info().counters;
    assert_eq!(counters["first_sequence"], 0);
    assert_eq!(counters["last_sequence"], 899);
    assert_eq!(counters["arrivals"], 900);
    assert_eq!(read_arrivals(&reader), (written, vec![]));
}

/// Fields that are not optional leave a zero out of the message, and minus zero equals it.
#[test]
fn minus_zero_loses_its_sign_and_nan_keeps_its_bits() {
    let nan = f64::from_bits(0x7ff8_0000_dead_beef);
    let mut written = estimate(START);
    written.motion.velocity_y_m_s = -0.0;
    written.motion.sideslip_rad = nan;
    let signal = |value| sample::Signal {
        name: "x".into(),
        value,
        unit: "".into(),
    };
    let control = Record::Sample(sample::Sample {
        source: sample::SourceId(1),
        log_time: START,
        valid_time: START,
        device_time: None,
        measurement: sample::Measurement::Control(sample::ControlSample {
            values: vec![signal(-0.0)],
        }),
    });
    let records = [Record::Estimate(Box::new(written)), control];
    let (_directory, reader) = on_disk(&write(&[], &records, &Options::default()));
    let read = reader.estimates().next().expect("one").expect("readable");
    assert_eq!(read.motion.velocity_y_m_s.to_bits(), 0.0_f64.to_bits());
    assert_eq!(read.motion.sideslip_rad.to_bits(), nan.to_bits());
    // Optional fields, such as a signal's, are written whatever their value.
    let mut controls = reader.messages(Selection::topics(["/control/*"]));
    let message = controls.next().expect("one").expect("readable");
    let signals = message.signals().expect("by its schema");
    assert_eq!(signals[0].value.to_bits(), (-0.0_f64).to_bits());
}

#[test]
fn different_runs_are_not_mixed() {
    let directory = tempfile::tempdir().expect("a directory");
    let paths = ["a", "b"].map(|run| {
        let path = directory.path().join(run);
        let session = atvrec_store::Session {
            run_id: run.to_owned(),
            ..session()
        };
        let writer = Writer::create(&path, session, Options::default(), 0).expect("a file");
        writer.finish().expect("closed");
        path
    });
    assert!(matches!(
        Reader::open(&paths),
        Err(atvrec_store::Error::MixedRuns { .. })
    ));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn order_is_restored_for_any_stream(
        seed in any::<u64>(),
        count in 0_u64..400,
        interval_ms in 1_u64..400,
    ) {
        let written = arrivals(seed, count);
        let options = Options {
            raw_interval: std::time::Duration::from_millis(interval_ms),
            ..Options::default()
        };
        let (_directory, reader) = on_disk(&write(&written, &[], &options));
        let (read, missing) = read_arrivals(&reader);
        prop_assert_eq!(missing, vec![]);
        prop_assert_eq!(read, written);
    }
}

#[test]
fn the_clock_may_stand_still() {
    let mut written = arrivals(7, 50);
    for arrival in &mut written {
        arrival.log_time = LogTime(5);
        arrival.realtime_ns = i64::MIN;
    }
    let (_directory, reader) = on_disk(&write(&written, &[], &Options::default()));
    assert_eq!(read_arrivals(&reader).0, written);
}
