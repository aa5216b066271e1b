//! Logs of the layout before contract version 0 are read as if they were written today.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use atvrec_store::{
    DynamicMessage, Error, LogWriter, Message, Options, Reader, Record, Selection, Values,
};
use sample::LogTime;

use crate::common::session;

fn earlier() -> Reader {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/compat/slow-sine-0.mcap");
    Reader::open([path]).expect("a log")
}

fn present(records: &[Record]) -> (tempfile::TempDir, Reader) {
    let directory = tempfile::tempdir().expect("a directory");
    let path: PathBuf = directory.path().join("present.mcap");
    let mut session = earlier().session().clone();
    session.attachments = Vec::new();
    let mut log = LogWriter::new(Vec::new(), session, Options::default(), 0).expect("a vector");
    records.iter().for_each(|record| log.record(record));
    let bytes = log.finish(&BTreeMap::new()).expect("a vector");
    std::fs::write(&path, bytes).expect("written");
    let reader = Reader::open([path]).expect("a log");
    (directory, reader)
}

/// Messages without those that records are not made of: raw ones and positions for viewers.
fn by_topic(reader: &Reader) -> BTreeMap<String, Vec<(LogTime, LogTime, Vec<u8>)>> {
    let mut all: BTreeMap<String, Vec<_>> = BTreeMap::new();
    for message in reader.messages(Selection::default()) {
        let Message {
            channel,
            log_time,
            publish_time,
            data,
            ..
        } = message.expect("a message");
        if !channel.schema.starts_with("atvrec.Raw") {
            let messages = all.entry(channel.topic.clone()).or_default();
            messages.push((log_time, publish_time, data));
        }
    }
    all
}

#[test]
fn messages_of_the_earlier_layout_are_those_of_the_present_one() {
    let old = earlier();
    assert_eq!(old.contract(), None);
    let records: Vec<Record> = old
        .messages(Selection::default())
        .filter_map(|message| {
            message
                .and_then(|message| message.record())
                .expect("a record")
        })
        .collect();
    let (_directory, new) = present(&records);
    assert_eq!(new.contract(), Some(0));
    let (before, after) = (by_topic(&old), by_topic(&new));
    assert!(before.keys().eq(after.keys()), "{:?}", before.keys());
    for (topic, messages) in &before {
        assert_eq!(messages.len(), after[topic].len(), "{topic}");
        for (old, new) in messages.iter().zip(&after[topic]) {
            assert_eq!(old, new, "{topic} at {} s", old.0);
        }
    }
    for topic in [
        "/strain",
        "/deflection",
        "/wheel_speed",
        "/steer",
        "/truth/friction",
        "/estimate/parameters",
        "/estimate/rollover",
        "/model/tyre_forces",
        "/estimate/contact_forces",
        "/truth/contact_forces",
    ] {
        assert!(before.contains_key(topic), "{topic}");
    }
}

#[test]
fn columns_of_the_earlier_layout_are_those_of_the_present_one() {
    let old = earlier();
    let all = (LogTime(0), LogTime(u64::MAX));
    let forces = old
        .table("/truth/contact_forces", all.0, all.1)
        .expect("columns");
    let load = forces.columns.iter().find(|column| column.name == "rr.z_n");
    let Some(Values::F64(loads_n)) = load.map(|column| &column.values) else {
        panic!("{load:?}");
    };
    assert!(loads_n.iter().all(|load_n| *load_n > 100.0));
    let steer = old.table("/steer", all.0, all.1).expect("columns");
    assert_eq!(steer.columns[0].name, "steering_wheel_rad");
}

#[test]
fn nothing_but_decoded_messages_lies_below_can() {
    let old = earlier();
    let channels = old.info().channels;
    assert_eq!(channels["/raw/can0"].0, "atvrec.RawCan");
    let below = channels
        .iter()
        .filter(|(topic, _)| topic.starts_with("/can/"));
    for (topic, (schema, _)) in below {
        assert!(schema.starts_with("atvrec.signals."), "{topic}");
    }
    assert!(old.arrivals().all(|arrival| arrival.is_ok()));
    assert!(old.arrivals().count() > 1000);
}

#[test]
fn the_topic_of_checkpoints_is_refused_for_other_messages() {
    let mut session = session();
    session.dynamic.push(DynamicMessage {
        topic: "/checkpoint".to_owned(),
        name: "checkpoint".to_owned(),
        can_id: None,
        parameter_group: None,
        signals: Vec::new(),
    });
    let refused = LogWriter::new(Vec::new(), session, Options::default(), 0);
    let error = refused.err().expect("a reserved topic");
    assert!(
        matches!(error, Error::ReservedTopic("/checkpoint")),
        "{error}"
    );
}
