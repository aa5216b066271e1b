//! Damage of every kind to a log: each message of an intact chunk is saved, none is invented, and the
//! original is kept. How many messages are to be saved is computed by `damage/expected.py`, which
//! reads the same log without this crate.

#![allow(
    clippy::disallowed_types,
    clippy::disallowed_methods,
    reason = "the tests measure time and read the environment"
)]

use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use atvrec_store::{LogWriter, Options, recover};
use sample::Payload;

use crate::common::{START, arrivals, records, session};

/// An unfinished log, small enough to damage each of its headers in a moment.
fn small_log() -> Vec<u8> {
    let options = Options {
        raw_interval: Duration::from_millis(60),
        decoded_interval: Duration::from_millis(90),
        ..Options::default()
    };
    let mut writer = LogWriter::new(Vec::new(), session(), options, 0).expect("a vector");
    let records = records(START);
    let serial = arrivals(3, 600).into_iter();
    let serial = serial.filter(|arrival| matches!(arrival.payload, Payload::Bytes(_)));
    for (sequence, mut arrival) in (0..60).zip(serial) {
        arrival.sequence = sequence;
        if sequence % 7 == 3 {
            writer.record(&records[0]);
        }
        writer.push(arrival).expect("a vector");
    }
    let bytes = writer.finish(&BTreeMap::new()).expect("a vector");
    let summary = mcap::Summary::read(&bytes).expect("good").expect("there");
    let last = summary.chunk_indexes.last().expect("chunks");
    let indexes = last.chunk_start_offset + last.chunk_length + last.message_index_length;
    bytes[..indexes as usize].to_vec()
}

/// One damage, and how many messages are to be saved.
struct Case {
    offset: usize,
    damage: Damage,
    expected: usize,
}

enum Damage {
    Bit(u8),
    Zeros(usize),
}

impl Case {
    fn apply(&self, bytes: &[u8]) -> Vec<u8> {
        let mut bytes = bytes.to_vec();
        match self.damage {
            Damage::Bit(bit) => bytes[self.offset] ^= 1 << bit,
            Damage::Zeros(length) => {
                let end = (self.offset + length).min(bytes.len());
                bytes[self.offset..end].fill(0);
            }
        }
        bytes
    }
}

/// The cases of a file that `expected.py` wrote, and the CRC-32 of the log.
fn cases(text: &str) -> (u32, Vec<Case>) {
    let mut cases = Vec::new();
    let mut checksum = 0;
    for line in text.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        let number = |index: usize| -> usize { words[index].parse().expect("a number") };
        match words[0] {
            "log" => checksum = number(1) as u32,
            "bits" => {
                for offset in number(1)..number(2) {
                    cases.extend((0..8).map(|bit| Case {
                        offset,
                        damage: Damage::Bit(bit),
                        expected: number(3),
                    }));
                }
            }
            "bit" => cases.push(Case {
                offset: number(1),
                damage: Damage::Bit(number(2) as u8),
                expected: number(3),
            }),
            "zeros" => cases.push(Case {
                offset: number(1),
                damage: Damage::Zeros(number(2)),
                expected: number(3),
            }),
            other => panic!("{other}"),
        }
    }
    (checksum, cases)
}

/// What makes a message itself.
type Key = (u16, u32, u64, u64, u32);

fn messages(log: &[u8]) -> (HashMap<Key, usize>, HashMap<u16, String>) {
    let mut found = HashMap::new();
    let mut topics = HashMap::new();
    // The log that is damaged was not closed.
    let options = mcap::read::Options::IgnoreEndMagic.into();
    for message in mcap::MessageStream::new_with_options(log, options).expect("it is MCAP") {
        let m = message.expect("checksums hold");
        let data = crc32(&m.data);
        let key = (m.channel.id, m.sequence, m.log_time, m.publish_time, data);
        *found.entry(key).or_default() += 1;
        topics.insert(m.channel.id, m.channel.topic.clone());
    }
    (found, topics)
}

fn crc32(bytes: &[u8]) -> u32 {
    crc32fast::hash(bytes)
}

/// Recovers one damaged log after the other. Gives how many damages cost something, and how many
/// messages were saved beyond the expected ones.
fn run(log: &[u8], cases: &[Case], strict: bool) -> (usize, usize) {
    let (whole, topics) = messages(log);
    let total: usize = whole.values().sum();
    let next = AtomicUsize::new(0);
    let (costly, more) = (AtomicUsize::new(0), AtomicUsize::new(0));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                let directory = tempfile::tempdir().expect("a directory");
                while let Some(case) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let saved = check(directory.path(), log, case, (&whole, &topics), strict);
                    costly.fetch_add(usize::from(saved < total), Ordering::Relaxed);
                    more.fetch_add(saved - case.expected, Ordering::Relaxed);
                }
            });
        }
    });
    (costly.into_inner(), more.into_inner())
}

fn check(
    directory: &Path,
    log: &[u8],
    case: &Case,
    (whole, topics): (&HashMap<Key, usize>, &HashMap<u16, String>),
    strict: bool,
) -> usize {
    let at = case.offset;
    let damaged = case.apply(log);
    let path = directory.join("log.mcap.active");
    std::fs::write(&path, &damaged).expect("written");
    let recovered = recover(&path).unwrap_or_else(|error| panic!("byte {at}: {error}"));
    assert!(!recovered.was_empty, "byte {at}: removed");
    let result = std::fs::read(&recovered.path).expect("there");
    mcap::Summary::read(&result)
        .expect("sound")
        .expect("finished");
    let (saved, saved_topics) = messages(&result);
    for (key, count) in &saved {
        assert!(
            whole.get(key) >= Some(count),
            "byte {at}: {key:?} is invented"
        );
    }
    for (id, topic) in &saved_topics {
        let undefined = format!("/undefined/channel_{id:05}");
        assert!(
            *topic == topics[id] || *topic == undefined,
            "byte {at}: {topic}"
        );
    }
    let count: usize = saved.values().sum();
    assert!(
        count >= case.expected,
        "byte {at}: {count} messages, expected {}",
        case.expected
    );
    let total: usize = whole.values().sum();
    let changes_something = damaged != log;
    assert!(
        count == total || recovered.loss.is_some(),
        "byte {at}: the loss is not told"
    );
    if strict && changes_something {
        assert!(
            recovered.loss.is_some(),
            "byte {at}: the damage is not seen"
        );
    }
    if recovered.loss.is_some() {
        let original = recovered.original.expect("kept");
        assert_eq!(
            std::fs::read(&original).expect("there"),
            damaged,
            "byte {at}"
        );
        std::fs::remove_file(original).expect("removed");
    }
    std::fs::remove_file(&recovered.path).expect("removed");
    count
}

#[test]
fn every_header_bit_of_a_log_may_be_damaged() {
    let log = include_bytes!("damage/small.mcap.active");
    let (checksum, all) = cases(include_str!("damage/small.txt"));
    assert_eq!(
        crc32(log),
        checksum,
        "the expected numbers are another log's"
    );
    // A prime step, so that all bits of the headers take turns with the offsets.
    let some: Vec<Case> = all.into_iter().step_by(7).collect();
    let (costly, _) = run(log, &some, false);
    assert!(costly > 0);
}

/// Writes the log of the test above again. What is expected of it then follows from
/// `expected.py small.mcap.active 300 60 >small.txt`.
#[test]
#[ignore = "writes the log of the test: `cargo test -p atvrec-store --test suite write_small_log -- --ignored`"]
fn write_small_log() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/suite/damage/small.mcap.active"
    );
    std::fs::write(path, small_log()).expect("written");
}

/// The shared case, where it is there.
fn shared_case() -> Option<Vec<u8>> {
    let path = testkit::shared("cases/61-recover-one-bit/intact.mcap.active")?;
    Some(std::fs::read(path).expect("readable"))
}

/// All header bits, 3,000 seeded bits and 600 zeroed sectors of a log of a real recorder.
#[test]
#[ignore = "a campaign, and it needs the shared cases: make campaigns"]
fn campaign_of_damage() {
    let log = shared_case().expect("../shared/cases is there");
    let (checksum, all) = cases(include_str!("damage/case61.txt"));
    assert_eq!(crc32(&log), checksum, "it is another log");
    // With STEP=10 every tenth damage alone.
    let step = std::env::var("STEP").map_or(1, |step| step.parse().expect("a number"));
    let all: Vec<Case> = all.into_iter().step_by(step).collect();
    let count = all.len();
    let (costly, more) = run(&log, &all, false);
    println!(
        "{count} damages, {costly} of which cost messages; {more} messages were saved beyond those of \
         intact chunks"
    );
}

/// The rows of the shared case's description.
#[test]
fn single_bits_of_a_recorded_log() {
    let Some(log) = shared_case() else { return };
    let bit = |offset, bit, expected| Case {
        offset,
        damage: Damage::Bit(bit),
        expected,
    };
    let zeros = |offset, length, expected| Case {
        offset,
        damage: Damage::Zeros(length),
        expected,
    };
    let total = 25_673;
    let first = total - 1_930;
    let cases = [
        bit(19_956, 6, first),
        bit(47_922, 0, first),
        bit(107_216, 0, total - 1_583),
        bit(185_102, 1, total),
        bit(195_151, 0, total - 9),
        zeros(16_384, 4096, first),
        zeros(19_456, 512, first),
    ];
    let (costly, _) = run(&log, &cases, true);
    assert!(costly >= 3);
}
