use std::borrow::Cow;

use mcap::records::MessageHeader;
use mcap::write::{Metadata, NoSeek, WriteOptions};

use super::*;

/// Topic and metadata of a channel.
type ChannelOf = (&'static str, &'static [(&'static str, &'static str)]);

const CHANNELS: [ChannelOf; 3] = [
    ("/estimate/motion", &[]),
    ("/imu/front", &[("source", "1")]),
    ("/raw/can0", &[("source", "2"), ("unit.x", "m")]),
];

fn header(number: u32) -> MessageHeader {
    MessageHeader {
        channel_id: 1 + (number % 3) as u16,
        sequence: number,
        // The times of channels do not rise together.
        log_time: u64::from(1_000 + number * 7 % 500),
        publish_time: u64::from(number),
    }
}

fn data(number: u32) -> Vec<u8> {
    (0..number % 97).map(|n| (n * n + number) as u8).collect()
}

fn metadata(pairs: &[(&str, &str)]) -> BTreeMap<String, String> {
    let owned = |(key, value): &(&str, &str)| ((*key).to_owned(), (*value).to_owned());
    pairs.iter().map(owned).collect()
}

fn attachment() -> mcap::Attachment<'static> {
    mcap::Attachment {
        log_time: 5,
        create_time: 6,
        name: "vehicle.toml".to_owned(),
        media_type: "application/toml".to_owned(),
        data: Cow::Borrowed(b"mass_kg = 700"),
    }
}

/// Three chunks of the same messages: by this writer.
fn ours(level: Option<u32>) -> Vec<u8> {
    let mut file = McapFile::create(Vec::new(), "atvrec", level).unwrap();
    file.write_metadata("run", &metadata(&[("a", "b")]))
        .unwrap();
    file.attach(&attachment()).unwrap();
    for (topic, pairs) in CHANNELS {
        let schema = file.add_schema(&topic[..4], topic.as_bytes()).unwrap();
        assert_eq!(
            file.add_schema(&topic[..4], topic.as_bytes()).unwrap(),
            schema
        );
        file.add_channel(schema, topic, &metadata(pairs)).unwrap();
    }
    let mut chunk = Chunk::default();
    for number in 0..3_000 {
        chunk.push(header(number), |out| out.extend(data(number)));
        if number % 1_000 == 999 {
            file.write_chunk(&mut chunk).unwrap();
        }
    }
    file.write_metadata("counters", &metadata(&[])).unwrap();
    file.finish().unwrap()
}

/// The same file by the writer of the `mcap` crate.
fn of_the_crate() -> Vec<u8> {
    let mut file = WriteOptions::new()
        .profile("")
        .library("atvrec")
        .compression(None)
        .chunk_size(None)
        .disable_seeking(true)
        .create(NoSeek::new(Vec::new()))
        .unwrap();
    let named = |name: &str, metadata| Metadata {
        name: name.to_owned(),
        metadata,
    };
    file.write_metadata(&named("run", metadata(&[("a", "b")])))
        .unwrap();
    file.attach(&attachment()).unwrap();
    for (topic, pairs) in CHANNELS {
        let schema = file.add_schema(&topic[..4], "protobuf", topic.as_bytes());
        file.add_channel(schema.unwrap(), topic, "protobuf", &metadata(pairs))
            .unwrap();
    }
    for number in 0..3_000 {
        file.write_to_known_channel(&header(number), &data(number))
            .unwrap();
        if number % 1_000 == 999 {
            file.flush().unwrap();
        }
    }
    file.write_metadata(&named("counters", metadata(&[])))
        .unwrap();
    file.finish().unwrap();
    file.into_inner().into_inner()
}

#[test]
fn the_bytes_are_those_of_the_mcap_crate() {
    let (ours, theirs) = (ours(None), of_the_crate());
    let differs = ours.iter().zip(&theirs).position(|(a, b)| a != b);
    assert_eq!((differs, ours.len()), (None, theirs.len()));
}

/// Compressed chunks contain what uncompressed ones contain.
#[test]
fn compression_changes_no_message() {
    let read = |bytes: &[u8]| -> Vec<(u16, u32, u64, Vec<u8>)> {
        let messages = mcap::MessageStream::new(bytes).unwrap();
        let all = messages.map(|message| {
            let message = message.unwrap();
            let data = message.data.into_owned();
            (message.channel.id, message.sequence, message.log_time, data)
        });
        all.collect()
    };
    let (plain, packed) = (ours(None), ours(Some(0)));
    assert!(packed.len() < plain.len());
    assert_eq!(read(&plain).len(), 3_000);
    assert_eq!(read(&plain), read(&packed));
}

#[test]
fn messages_can_be_read_back_before_the_chunk_is_written() {
    let mut chunk = Chunk::default();
    for number in 0..10 {
        chunk.push(header(number), |out| out.extend(data(number)));
    }
    let mut record_of_a_channel = Vec::new();
    record(&mut record_of_a_channel, op::CHANNEL, &[&sized("x")]);
    chunk.prepend(&record_of_a_channel);
    let back: Vec<_> = chunk.messages().collect();
    assert_eq!(back.len(), 10);
    for (number, (of, contents)) in (0..).zip(back) {
        assert_eq!((of, contents), (header(number), &*data(number)));
    }
}
