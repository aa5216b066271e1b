//! MCAP files of other programs.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::PathBuf;

use atvrec_store::{Error, Reader};
use mcap::records::MessageHeader;
use mcap::{Channel, Schema, WriteOptions};
use sample::LogTime;

/// What a writer leaves out of the summary.
#[derive(Clone, Copy, Debug)]
struct Omissions {
    chunks: bool,
    channels: bool,
    schemas: bool,
    statistics: bool,
    chunk_indexes: bool,
    message_indexes: bool,
}

impl Omissions {
    fn of(bits: u32) -> Self {
        let has = |bit: u32| bits >> bit & 1 == 1;
        Self {
            chunks: has(0),
            channels: has(1),
            schemas: has(2),
            statistics: has(3),
            chunk_indexes: has(4),
            message_indexes: has(5),
        }
    }
}

/// Topics with messages: `/thing` with as many as given, `/other` with one, in `encoding`.
fn foreign(omitted: Omissions, encoding: &str, messages: u64) -> Vec<u8> {
    let options = WriteOptions::new()
        .use_chunks(!omitted.chunks)
        .compression(None)
        .repeat_channels(!omitted.channels)
        .repeat_schemas(!omitted.schemas)
        .emit_statistics(!omitted.statistics)
        .emit_chunk_indexes(!omitted.chunk_indexes)
        .emit_message_indexes(!omitted.message_indexes);
    let mut bytes = Vec::new();
    let mut writer = options.create(Cursor::new(&mut bytes)).expect("a vector");
    let schema = std::sync::Arc::new(Schema {
        id: 1,
        name: "Thing".to_owned(),
        encoding: "jsonschema".to_owned(),
        data: Cow::Borrowed(b"{}"),
    });
    for (id, topic, count) in [(1, "/thing", messages), (2, "/other", 1)] {
        let channel = Channel {
            id,
            topic: topic.to_owned(),
            schema: Some(schema.clone()),
            message_encoding: encoding.to_owned(),
            metadata: BTreeMap::new(),
        };
        let schema = writer_schema(&mut writer, &schema);
        let id = writer
            .add_channel(schema, topic, &channel.message_encoding, &channel.metadata)
            .expect("a channel");
        for at in 0..count {
            let header = MessageHeader {
                channel_id: id,
                sequence: at as u32,
                log_time: 1_000_000_000 * at,
                publish_time: 1_000_000_000 * at,
            };
            writer
                .write_to_known_channel(&header, b"{\"a\":1}")
                .expect("a vector");
        }
    }
    writer.finish().expect("a vector");
    drop(writer);
    bytes
}

fn writer_schema<W: std::io::Write + std::io::Seek>(
    writer: &mut mcap::Writer<W>,
    schema: &Schema<'_>,
) -> u16 {
    writer
        .add_schema(&schema.name, &schema.encoding, &schema.data)
        .expect("a schema")
}

fn opened(directory: &tempfile::TempDir, bytes: &[u8]) -> Reader {
    let path: PathBuf = directory.path().join("in.mcap");
    std::fs::write(&path, bytes).expect("written");
    Reader::open(&[path]).expect("a log")
}

#[test]
fn every_topic_and_schema_is_found_whatever_the_summary_leaves_out() {
    let directory = tempfile::tempdir().expect("a directory");
    for bits in 0..64 {
        let omitted = Omissions::of(bits);
        let reader = opened(&directory, &foreign(omitted, "json", 5));
        let found: Vec<(String, (String, u64))> = reader.info().channels.into_iter().collect();
        let thing = |topic: &str, count| (topic.to_owned(), ("Thing".to_owned(), count));
        assert_eq!(
            found,
            [thing("/other", 1), thing("/thing", 5)],
            "{omitted:?}"
        );
    }
}

#[test]
fn a_table_of_an_unknown_encoding_says_what_reads_it() {
    let directory = tempfile::tempdir().expect("a directory");
    for (encoding, name, reader) in [
        ("json", "JSON", "Python package mcap reads them"),
        ("cdr", "CDR", "mcap-ros2-support"),
        ("ros1", "ros1", "mcap-ros1-support"),
    ] {
        let log = opened(&directory, &foreign(Omissions::of(0), encoding, 5));
        let error = log
            .table("/thing", LogTime(0), LogTime(u64::MAX))
            .expect_err("not decoded");
        assert!(matches!(error, Error::Encoding { .. }), "{error:?}");
        let text = error.to_string();
        assert!(
            text.contains(&format!("the messages of /thing are {name}")),
            "{text}"
        );
        assert!(text.contains(reader), "{text}");
    }
}
