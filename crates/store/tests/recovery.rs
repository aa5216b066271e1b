//! Logs that were cut short: what is read from them, and what recovery saves.

mod common;

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::time::Duration;

use common::{START, arrivals, estimate, records, session};
use sample::{Arrival, Payload};
use store::{
    LogWriter, Missing, Options, Reader, Record, Selection, Writer, recover, recover_directory,
    salvage,
};

/// A log with small chunks, so that cuts meet every kind of record.
fn sample_log(count: u64) -> (Vec<Arrival>, Vec<u8>) {
    let written = arrivals(11, count);
    let bytes = log_of(&written, &records(START));
    (written, bytes)
}

fn log_of(written: &[Arrival], records: &[Record]) -> Vec<u8> {
    let options = Options {
        raw_interval: Duration::from_millis(20),
        decoded_interval: Duration::from_millis(30),
        ..Options::default()
    };
    let mut writer = LogWriter::new(Vec::new(), session(), options, 0).expect("a vector");
    for record in records {
        writer.record(record);
    }
    for arrival in written {
        if arrival.sequence % 16 == 15 {
            writer.record(&Record::Estimate(estimate(arrival.log_time)));
        }
        writer.push(arrival.clone()).expect("a vector");
    }
    writer.finish(&BTreeMap::new()).expect("a vector")
}

fn all_messages(path: &Path) -> Vec<store::Message> {
    Reader::open([path])
        .expect("a log")
        .messages(Selection::default())
        .collect::<Result<_, _>>()
        .expect("readable")
}

fn all_arrivals(path: &Path) -> Vec<Arrival> {
    Reader::open([path])
        .expect("a log")
        .arrivals()
        .collect::<Result<_, _>>()
        .expect("readable")
}

fn write_active(directory: &Path, bytes: &[u8]) -> PathBuf {
    let path = directory.join("log.mcap.active");
    std::fs::write(&path, bytes).expect("written");
    path
}

/// A message as the reference library reads it.
type Foreign = (String, u32, u64, Vec<u8>);

fn foreign(bytes: &[u8]) -> Vec<Foreign> {
    let summary = mcap::Summary::read(bytes).expect("checksums hold");
    let statistics = summary.and_then(|s| s.stats).expect("it is finished");
    let messages: Vec<Foreign> = mcap::MessageStream::new(bytes)
        .expect("it is MCAP")
        .map(|message| {
            let m = message.expect("checksums hold");
            let topic = m.channel.topic.clone();
            (topic, m.sequence, m.log_time, m.data.into_owned())
        })
        .collect();
    assert_eq!(statistics.message_count, messages.len() as u64);
    messages
}

/// Every cut: recovery works, invents nothing, and loses nothing that was whole; its result is a
/// finished log to the reference library.
#[test]
fn a_log_cut_at_any_byte_recovers_what_is_whole() {
    let mark = Record::Mark {
        time: START,
        text: "gravel".to_owned(),
    };
    // One serial port alone, since each schema takes thousands of bytes and each byte takes a cut.
    let reads = arrivals(11, 200).into_iter();
    let reads = reads.filter(|arrival| matches!(arrival.payload, Payload::Bytes(_)));
    let numbered = (0..12).zip(reads);
    let written: Vec<Arrival> = numbered
        .map(|(sequence, arrival)| Arrival {
            sequence,
            ..arrival
        })
        .collect();
    let bytes = log_of(&written, &[mark]);
    let whole = foreign(&bytes);
    assert!(whole.len() >= 4, "several chunks");
    let mut saved_before = 0;
    for length in 0..=bytes.len() {
        let mut output = Vec::new();
        let count =
            salvage(Cursor::new(&bytes[..length]), &[], &mut output).expect("recovery never fails");
        let messages = foreign(&output);
        assert_eq!(messages.len() as u64, count);
        assert_eq!(messages, whole[..messages.len()], "cut at {length}");
        assert!(messages.len() >= saved_before, "cut at {length}");
        saved_before = messages.len();
    }
    assert_eq!(saved_before, whole.len());
}

#[test]
fn a_cut_log_reads_as_it_recovers() {
    let (written, bytes) = sample_log(200);
    let directory = tempfile::tempdir().expect("a directory");
    for length in (8..=bytes.len()).step_by(997) {
        let path = write_active(directory.path(), &bytes[..length]);
        let cut_messages = all_messages(&path);
        let cut_arrivals = all_arrivals(&path);
        let recovered = recover(&path).expect("recovery never fails");
        assert!(!path.exists());
        assert_eq!(recovered.was_empty, cut_messages.is_empty());
        if recovered.was_empty {
            continue;
        }
        assert_eq!(all_messages(&recovered.path), cut_messages);
        assert_eq!(all_arrivals(&recovered.path), cut_arrivals);
        assert_eq!(cut_arrivals, written[..cut_arrivals.len()]);
        let reader = Reader::open([&recovered.path]).expect("a log");
        assert_eq!(reader.info().missing, []);
    }
}

#[test]
fn messages_of_a_chunk_that_is_cut_are_saved() {
    // One chunk far larger than zstd's blocks, so that whole blocks stand before the cut.
    let options = Options {
        raw_interval: Duration::from_secs(3600),
        decoded_interval: Duration::from_secs(3600),
        decoded_chunk_bytes: usize::MAX,
        ..Options::default()
    };
    let mut writer = LogWriter::new(Vec::new(), session(), options, 0).expect("a vector");
    for n in 0..4_000 {
        writer.record(&Record::Estimate(estimate(START + n)));
    }
    let bytes = writer.finish(&BTreeMap::new()).expect("a vector");
    let summary = mcap::Summary::read(&bytes).expect("good").expect("there");
    let chunk = &summary.chunk_indexes[0];
    let cut = (chunk.chunk_start_offset + chunk.chunk_length / 2) as usize;
    let directory = tempfile::tempdir().expect("a directory");
    let path = write_active(directory.path(), &bytes[..cut]);
    let recovered = recover(&path).expect("recovered");
    assert!(recovered.messages_of_cut_chunk > 1_000, "{recovered:?}");
    assert_eq!(
        all_messages(&recovered.path).len() as u64,
        recovered.messages
    );
}

/// Counters are made again from what is saved; what was lost on the way to the disk stands only in
/// the file's own ones.
#[test]
fn a_recovered_log_has_counters_of_what_was_saved() {
    let (written, bytes) = sample_log(400);
    let directory = tempfile::tempdir().expect("a directory");
    let whole = directory.path().join("whole.mcap");
    std::fs::write(&whole, &bytes).expect("written");
    let counters = |path: &Path| Reader::open([path]).expect("a log").info().counters;
    // The footer alone is cut: nothing is lost.
    let path = write_active(directory.path(), &bytes[..bytes.len() - 20]);
    let recovered = recover(&path).expect("recovered");
    assert!(!recovered.was_whole);
    assert_eq!(counters(&recovered.path), counters(&whole));

    let summary = mcap::Summary::read(&bytes).expect("good").expect("there");
    let chunk = &summary.chunk_indexes[summary.chunk_indexes.len() / 2];
    let cut = chunk.chunk_start_offset as usize + 30;
    let path = write_active(directory.path(), &bytes[..cut]);
    let recovered = recover(&path).expect("recovered");
    let saved = all_arrivals(&recovered.path);
    assert!(!saved.is_empty() && saved.len() < written.len());
    let mut again = LogWriter::new(Vec::new(), session(), Options::default(), 0).expect("a vector");
    for arrival in &saved {
        again.push(arrival.clone()).expect("a vector");
    }
    let expected = again.counters();
    let found = counters(&recovered.path);
    assert_eq!(found["arrivals"], expected.arrivals);
    assert_eq!(found["can_frames"], expected.can_frames);
    assert_eq!(found["serial_bytes"], expected.serial_bytes);
    assert_eq!(found["first_sequence"], 0);
    assert_eq!(found["last_sequence"], saved.len() as u64 - 1);
    // Of losses on the way to the disk, only a file that was closed can tell.
    let before_disk = expected
        .lost
        .iter()
        .filter(|((_, place), _)| *place != "disk");
    let lost: u64 = before_disk.map(|(_, count)| count).sum();
    let told = found.iter().filter(|(name, _)| name.starts_with("lost."));
    assert_eq!(told.map(|(_, count)| count).sum::<u64>(), lost);
    let is_raw = |m: &&store::Message| m.channel.schema.starts_with("atvrec.Raw");
    let messages = all_messages(&recovered.path);
    let raw = messages.iter().filter(is_raw).count();
    assert_eq!(found["messages"], (messages.len() - raw) as u64);
}

#[test]
fn losses_that_a_cut_log_told_of_are_kept() {
    let writer = LogWriter::new(Vec::new(), session(), Options::default(), 0).expect("a vector");
    let lost = BTreeMap::from([("lost.can0.disk".to_owned(), "7".to_owned())]);
    let bytes = writer.finish(&lost).expect("a vector");
    let directory = tempfile::tempdir().expect("a directory");
    let path = write_active(directory.path(), &bytes[..bytes.len() - 20]);
    let recovered = recover(&path).expect("recovered");
    let info = Reader::open([&recovered.path]).expect("a log").info();
    assert_eq!(info.counters["lost.can0.disk"], 7);
}

/// A byte that changed is found by the chunk's checksum; the chunks around it are saved.
#[test]
fn a_damaged_chunk_is_left_out_and_told() {
    let (written, mut bytes) = sample_log(600);
    let summary = mcap::Summary::read(&bytes).expect("good").expect("there");
    let raw = summary.chunk_indexes.len() / 2;
    let chunk = &summary.chunk_indexes[raw];
    let middle = chunk.chunk_start_offset + chunk.chunk_length - 10;
    bytes.truncate(bytes.len() - 200);
    bytes[middle as usize] ^= 0x55;
    let directory = tempfile::tempdir().expect("a directory");
    let path = write_active(directory.path(), &bytes);
    let recovered = recover(&path).expect("recovered");
    let told = |wanted: &dyn Fn(&Missing) -> bool| recovered.missing.iter().any(wanted);
    assert!(
        told(&|m| matches!(m, Missing::Damaged { .. })),
        "{recovered:?}"
    );
    let read = all_arrivals(&recovered.path);
    assert!(read.len() > written.len() * 3 / 4, "{}", read.len());
    for arrival in &read {
        assert_eq!(arrival, &written[arrival.sequence as usize]);
    }
}

#[test]
fn zeros_that_a_power_cut_left_behind_are_not_data() {
    let (_, bytes) = sample_log(300);
    let expected = foreign(&bytes);
    for cut in [bytes.len() / 3, bytes.len() / 2, bytes.len() * 2 / 3] {
        let mut zeros = bytes[..cut].to_vec();
        zeros.resize(cut + 5_000, 0);
        let mut output = Vec::new();
        salvage(Cursor::new(zeros), &[], &mut output).expect("recovered");
        let messages = foreign(&output);
        assert!(!messages.is_empty());
        assert_eq!(messages, expected[..messages.len()]);
    }
}

#[test]
fn a_log_that_is_being_written_is_left_alone() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("log.mcap");
    let mut writer = Writer::create(&path, session(), Options::default(), 0).expect("a file");
    for arrival in arrivals(1, 10) {
        writer.push(arrival).expect("written");
    }
    let active = directory.path().join("log.mcap.active");
    assert!(matches!(recover(&active), Err(store::Error::InUse(_))));
    assert_eq!(
        recover_directory(directory.path()).expect("readable").len(),
        0
    );
    writer.finish().expect("closed");
    assert_eq!(all_arrivals(&path).len(), 10);
}

#[test]
fn a_whole_log_that_kept_its_unfinished_name_gets_its_own() {
    let (_, bytes) = sample_log(50);
    let directory = tempfile::tempdir().expect("a directory");
    write_active(directory.path(), &bytes);
    let results = recover_directory(directory.path()).expect("readable");
    assert_eq!(results.len(), 1);
    let recovered = results[0].1.as_ref().expect("recovered");
    assert!(recovered.was_whole);
    assert_eq!(std::fs::read(&recovered.path).expect("there"), bytes);
}

/// A power cut just behind a rotation used to leave a log without anything in it.
#[test]
fn a_log_cut_before_its_first_arrival_is_removed() {
    let (_, bytes) = sample_log(20);
    let before_first_chunk = bytes.len().min(200);
    for length in [0, 8, before_first_chunk] {
        let directory = tempfile::tempdir().expect("a directory");
        write_active(directory.path(), &bytes[..length]);
        std::fs::write(directory.path().join("log.mcap.journal-a"), b"").expect("written");
        let results = recover_directory(directory.path()).expect("readable");
        assert!(results[0].1.as_ref().expect("recovered").was_empty);
        let left = std::fs::read_dir(directory.path()).expect("readable");
        assert_eq!(left.count(), 0);
    }
}

#[test]
fn journals_that_outlived_their_log_are_removed() {
    let (_, bytes) = sample_log(20);
    let directory = tempfile::tempdir().expect("a directory");
    let log = directory.path().join("log.mcap");
    let journal = directory.path().join("log.mcap.journal-a");
    std::fs::write(&log, &bytes).expect("written");
    std::fs::write(&journal, b"ATVJ").expect("written");
    recover_directory(directory.path()).expect("readable");
    assert!(log.exists() && !journal.exists());
}

#[test]
fn what_is_no_log_is_refused_and_kept() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = write_active(directory.path(), b"can0 100#0011\n");
    assert!(matches!(recover(&path), Err(store::Error::NotMcap { .. })));
    assert!(path.exists());
}
