//! Logs that were cut short: what is read from them, and what recovery saves.

#![allow(
    clippy::disallowed_types,
    clippy::disallowed_methods,
    reason = "the tests measure time and read the environment"
)]

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::time::Duration;

use atvrec_store::{
    LogWriter, Missing, Options, Reader, Record, RecoverOptions, Recovered, Selection, Writer,
    companions, recover, recover_directory, recover_with, salvage,
};
use sample::{Arrival, Payload};

use crate::common::{START, arrivals, estimate, records, session};

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
            writer.record(&Record::Estimate(Box::new(estimate(arrival.log_time))));
        }
        writer.push(arrival.clone()).expect("a vector");
    }
    writer.finish(&BTreeMap::new()).expect("a vector")
}

fn all_messages(path: &Path) -> Vec<atvrec_store::Message> {
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
        if recovered.was_empty {
            assert_eq!(cut_messages, []);
            continue;
        }
        assert_eq!(all_messages(&recovered.path), cut_messages);
        let name = directory.path().join(format!("{length}.mcap"));
        std::fs::rename(&recovered.path, &name).expect("renamed");
        let recovered = Recovered {
            path: name,
            ..recovered
        };
        assert_eq!(all_arrivals(&recovered.path), cut_arrivals);
        assert_eq!(cut_arrivals, written[..cut_arrivals.len()]);
        let reader = Reader::open([&recovered.path]).expect("a log");
        assert_eq!(reader.info().missing, []);
    }
}

/// Nothing confirms what a chunk that is cut lets through: it is given out where that is asked for, and
/// the log says so.
#[test]
fn messages_of_a_chunk_that_is_cut_are_saved_unchecked_only() {
    // One chunk far larger than zstd's blocks, so that whole blocks stand before the cut.
    let options = Options {
        raw_interval: Duration::from_secs(3600),
        decoded_interval: Duration::from_secs(3600),
        decoded_chunk_bytes: usize::MAX,
        ..Options::default()
    };
    let mut writer = LogWriter::new(Vec::new(), session(), options, 0).expect("a vector");
    for n in 0..4_000 {
        writer.record(&Record::Estimate(Box::new(estimate(START + n))));
    }
    let bytes = writer.finish(&BTreeMap::new()).expect("a vector");
    let summary = mcap::Summary::read(&bytes).expect("good").expect("there");
    let chunk = &summary.chunk_indexes[0];
    let cut = (chunk.chunk_start_offset + chunk.chunk_length / 2) as usize;
    for unchecked in [false, true] {
        let directory = tempfile::tempdir().expect("a directory");
        let path = write_active(directory.path(), &bytes[..cut]);
        assert_eq!(all_messages(&path), []);
        let options = RecoverOptions {
            unchecked,
            ..RecoverOptions::default()
        };
        let recovered = recover_with(&path, &options).expect("recovered");
        assert!(recovered.loss.is_some(), "{recovered:?}");
        let original = recovered.original.expect("kept");
        assert_eq!(std::fs::read(original).expect("there"), bytes[..cut]);
        let saved = all_messages(&recovered.path).len() as u64;
        assert_eq!(saved, recovered.messages);
        assert_eq!(saved, recovered.messages_of_cut_chunk);
        assert_eq!(saved > 1_000, unchecked, "{saved}");
        let metadata = Reader::open([&recovered.path]).expect("a log").metadata();
        let mark = metadata["atvrec.recovered"].get("unchecked");
        assert_eq!(mark.is_some(), unchecked);
    }
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
    std::fs::remove_file(&recovered.path).expect("removed");

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
    // Losses on the way to the disk stand in closed files only.
    let [device, kernel, queue, _] = expected.losses.totals();
    let lost = device + kernel + queue;
    let told = found.iter().filter(|(name, _)| name.starts_with("lost."));
    assert_eq!(told.map(|(_, count)| count).sum::<u64>(), lost);
    let is_raw = |m: &&atvrec_store::Message| m.channel.schema.starts_with("atvrec.Raw");
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
    assert!(matches!(
        recover(&active),
        Err(atvrec_store::Error::InUse(_))
    ));
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
        // The recorder makes the journals with the log.
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
    assert!(matches!(
        recover(&path),
        Err(atvrec_store::Error::NotMcap { .. })
    ));
    assert!(path.exists());
}

/// A directory, a FIFO or a file of another kind with the name of an unfinished log used to be tried
/// at each start; opening the FIFO blocked it.
#[cfg(unix)]
#[test]
fn what_recovery_cannot_handle_is_set_aside_after_one_try() {
    let directory = tempfile::tempdir().expect("a directory");
    let name = |name: &str| directory.path().join(name);
    std::fs::create_dir(name("a.mcap.active")).expect("made");
    let fifo = std::process::Command::new("mkfifo")
        .arg(name("b.mcap.active"))
        .status();
    assert!(fifo.expect("mkfifo runs").success());
    std::fs::write(name("c.mcap.active"), b"can0 100#0011\n").expect("written");
    std::fs::write(name("d.mcap.active"), testkit::log_of_zeros(2_000_000_000)).expect("written");
    let (_, bytes) = sample_log(50);
    std::fs::write(name("e.mcap.active"), &bytes).expect("written");
    let results = recover_directory(directory.path()).expect("readable");
    assert_eq!(results.len(), 5);
    for (path, result) in &results[..4] {
        let Err(atvrec_store::Error::SetAside { to, .. }) = result else {
            panic!("{}: {result:?}", path.display());
        };
        assert!(!path.exists() && to.exists(), "{}", path.display());
        assert_eq!(to.extension(), Some("unrecoverable".as_ref()));
    }
    assert!(results[4].1.as_ref().expect("recovered").was_whole);
    assert_eq!(
        recover_directory(directory.path()).expect("readable").len(),
        0
    );
}

/// Cut by one to eight bytes, a closed log used to be called whole (nothing is lost in it); with a
/// damaged chunk too, or with a hole.
#[test]
fn a_closed_log_is_whole_only_if_all_of_it_is() {
    let (_, bytes) = sample_log(300);
    let whole = foreign(&bytes);
    let summary = mcap::Summary::read(&bytes).expect("good").expect("there");
    let chunk = &summary.chunk_indexes[2];
    let in_chunk = (chunk.chunk_start_offset + chunk.chunk_length / 2) as usize;
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("log.mcap");
    for cut in 1..=8 {
        std::fs::write(&path, &bytes[..bytes.len() - cut]).expect("written");
        let recovered = recover(&path).expect("recovered");
        assert!(
            !recovered.was_whole && recovered.loss.is_none(),
            "{recovered:?}"
        );
        assert_eq!(foreign(&std::fs::read(&path).expect("there")), whole);
        assert_eq!(companions(&path), [] as [PathBuf; 0]);
    }
    let mut flipped = bytes.clone();
    flipped[in_chunk] ^= 1;
    let mut hole = bytes.clone();
    hole[chunk.chunk_start_offset as usize..][..64].fill(0);
    for (number, damaged) in [flipped, hole].into_iter().enumerate() {
        std::fs::write(&path, &damaged).expect("written");
        let reader = Reader::open([&path]).expect("a log");
        assert_eq!(reader.changed().expect("readable").len(), 1, "{number}");
        let recovered = recover(&path).expect("recovered");
        let loss = recovered.loss.expect("a chunk");
        assert_eq!(loss.chunks, 1, "{loss:?}");
        let original = recovered.original.expect("kept");
        assert_eq!(std::fs::read(&original).expect("there"), damaged);
        assert_eq!(companions(&path).len(), number + 1);
        let saved = foreign(&std::fs::read(&path).expect("there"));
        let in_it: u64 = chunk_messages(&bytes, chunk);
        assert_eq!(saved.len() as u64, whole.len() as u64 - in_it);
        let metadata = Reader::open([&path]).expect("a log").metadata();
        assert_eq!(metadata["atvrec.recovered"]["lost_chunks"], "1");
    }
}

fn chunk_messages(bytes: &[u8], chunk: &mcap::records::ChunkIndex) -> u64 {
    let indexes = chunk.message_index_offsets.values();
    indexes
        .map(|offset| {
            let list = &bytes[*offset as usize + 11..][..4];
            u64::from(u32::from_le_bytes(list.try_into().expect("four"))) / 16
        })
        .sum()
}

/// A chunk of a compression that the program does not know used to be dropped with the file.
#[test]
fn a_chunk_of_unknown_compression_is_kept() {
    let (_, mut bytes) = sample_log(100);
    let summary = mcap::Summary::read(&bytes).expect("good").expect("there");
    for chunk in &summary.chunk_indexes {
        let start = chunk.chunk_start_offset as usize;
        bytes[start + 41..start + 45].copy_from_slice(b"brot");
        // A frame of another kind.
        bytes[start + 53..start + 57].copy_from_slice(b"BROT");
    }
    bytes.truncate(bytes.len() - 40);
    let directory = tempfile::tempdir().expect("a directory");
    let path = write_active(directory.path(), &bytes);
    let recovered = recover(&path).expect("recovered");
    assert_eq!(recovered.messages, 0);
    let told = recovered.missing.iter().map(ToString::to_string);
    assert!(told.filter(|text| text.contains("\"brot\"")).count() > 1);
    let original = recovered.original.expect("kept");
    assert_eq!(std::fs::read(original).expect("there"), bytes);
}

/// The chunk that introduces the channels is lost: they come from the journal.
#[test]
fn channels_come_from_the_journal() {
    let directory = tempfile::tempdir().expect("a directory");
    let recorder =
        atvrec_store::Recorder::start(directory.path(), "run", session(), Options::default())
            .expect("started");
    for arrival in arrivals(7, 3_000) {
        while !recorder.push(arrival.clone()) {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    let begin = std::time::Instant::now();
    while recorder.status().waiting > 0 {
        assert!(begin.elapsed() < Duration::from_secs(20), "it never came");
        std::thread::sleep(Duration::from_millis(10));
    }
    let copies = tempfile::tempdir().expect("a directory");
    for entry in std::fs::read_dir(directory.path()).expect("readable") {
        let path = entry.expect("an entry").path();
        std::fs::copy(&path, copies.path().join(path.file_name().expect("a name")))
            .expect("copied");
    }
    recorder.finish().expect("finished");
    let path = copies.path().join("run_0000.mcap.active");
    let mut bytes = std::fs::read(&path).expect("there");
    let reader = Reader::open([&path]).expect("a log");
    let topics: Vec<String> = reader
        .channels()
        .map(|channel| channel.topic.clone())
        .collect();
    let marker = bytes
        .windows(8)
        .position(|bytes| bytes == b"\x04\0\0\0zstd");
    let chunk = marker.expect("a chunk") - 37;
    bytes[chunk..chunk + 200].fill(0);
    std::fs::write(&path, &bytes).expect("written");
    let recovered = recover(&path).expect("recovered");
    assert!(
        recovered.loss.is_some() && recovered.messages > 0,
        "{recovered:?}"
    );
    let reader = Reader::open([&recovered.path]).expect("a log");
    for channel in reader.channels() {
        assert!(topics.contains(&channel.topic), "{}", channel.topic);
        assert!(!channel.schema.is_empty(), "{}", channel.topic);
    }
    let journals = companions(&recovered.path);
    assert_eq!(journals.len(), 4, "{journals:?}");
}

/// A file that has the name which an unfinished log would get is not replaced.
#[test]
fn a_recovered_log_replaces_no_other() {
    let (_, bytes) = sample_log(50);
    let directory = tempfile::tempdir().expect("a directory");
    let other = directory.path().join("log.mcap");
    for length in [bytes.len(), bytes.len() - 3] {
        let path = write_active(directory.path(), &bytes[..length]);
        std::fs::write(&other, b"another recording").expect("written");
        let error = recover(&path).expect_err("the name is taken");
        assert!(
            matches!(error, atvrec_store::Error::NameTaken { .. }),
            "{error}"
        );
        assert_eq!(std::fs::read(&other).expect("there"), b"another recording");
        assert_eq!(std::fs::read(&path).expect("there"), bytes[..length]);
    }
}

#[test]
fn profile_and_library_survive() {
    let mut bytes = Vec::new();
    let mut writer = mcap::WriteOptions::new()
        .profile("ros2")
        .library("another library")
        .create(Cursor::new(&mut bytes))
        .expect("a vector");
    let channel = writer
        .add_channel(0, "/x", "", &BTreeMap::new())
        .expect("a vector");
    let header = mcap::records::MessageHeader {
        channel_id: channel,
        sequence: 1,
        log_time: 2,
        publish_time: 3,
    };
    writer
        .write_to_known_channel(&header, b"data")
        .expect("a vector");
    writer.finish().expect("a vector");
    drop(writer);
    let mut output = Vec::new();
    salvage(Cursor::new(&bytes[..bytes.len() - 1]), &[], &mut output).expect("recovered");
    let record = mcap::read::LinearReader::new(&output).expect("MCAP").next();
    let mcap::records::Record::Header(header) = record.expect("there").expect("sound") else {
        panic!("no header");
    };
    assert_eq!(
        (header.profile.as_str(), header.library.as_str()),
        ("ros2", "another library")
    );
}

/// A recovery that is stopped leaves the log unchanged. The next recovery completes it.
#[test]
fn a_recovery_that_is_stopped_changes_nothing() {
    let (_, bytes) = sample_log(300);
    let directory = tempfile::tempdir().expect("a directory");
    let path = write_active(directory.path(), &bytes[..bytes.len() / 2]);
    let options = RecoverOptions {
        stop: Some(std::sync::Arc::new(true.into())),
        ..RecoverOptions::default()
    };
    assert!(matches!(
        recover_with(&path, &options),
        Err(atvrec_store::Error::Stopped(_))
    ));
    assert_eq!(
        std::fs::read_dir(directory.path())
            .expect("readable")
            .count(),
        1
    );
    assert!(recover(&path).expect("recovered").messages > 0);
}

/// Messages outside of chunks and chunks without a checksum are given out of a whole file, not of a
/// damaged one.
#[test]
fn what_no_checksum_confirms_is_left_out() {
    for chunked in [false, true] {
        let mut bytes = Vec::new();
        let mut writer = mcap::WriteOptions::new()
            .use_chunks(chunked)
            .calculate_chunk_crcs(false)
            .calculate_data_section_crc(false)
            .create(Cursor::new(&mut bytes))
            .expect("a vector");
        let channel = writer
            .add_channel(0, "/x", "", &BTreeMap::new())
            .expect("a vector");
        for time in 0..10 {
            let header = mcap::records::MessageHeader {
                channel_id: channel,
                sequence: 1,
                log_time: time,
                publish_time: time,
            };
            writer
                .write_to_known_channel(&header, b"data")
                .expect("a vector");
        }
        writer.finish().expect("a vector");
        drop(writer);
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("log.mcap");
        std::fs::write(&path, &bytes).expect("written");
        assert_eq!(all_messages(&path).len(), 10);
        assert!(recover(&path).expect("recovered").was_whole);
        let cut = &bytes[..bytes.len() - 1];
        std::fs::write(&path, cut).expect("written");
        assert_eq!(all_messages(&path).len(), 0);
        let recovered = recover(&path).expect("recovered");
        assert_eq!(recovered.messages, 0);
        assert!(recovered.loss.is_some() && recovered.original.is_some());
        std::fs::write(&path, cut).expect("written");
        let options = RecoverOptions {
            unchecked: true,
            ..RecoverOptions::default()
        };
        assert_eq!(
            recover_with(&path, &options).expect("recovered").messages,
            10
        );
    }
}
