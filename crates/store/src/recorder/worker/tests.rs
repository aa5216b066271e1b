use std::path::Path;

use sample::{LogTime, Payload, SourceId};

use super::*;

const SOURCE: SourceId = SourceId(1);

fn arrival(sequence: u64) -> Arrival {
    Arrival {
        sequence,
        source: SOURCE,
        log_time: LogTime(sequence * 10_000_000),
        realtime_ns: sequence as i64,
        payload: Payload::Bytes(vec![sequence as u8; 20]),
    }
}

/// A worker whose logs take a group each 100 ms, and are never synced but when they are closed.
fn worker(directory: &Path) -> Worker {
    let options = Options {
        raw_interval: Duration::from_millis(100),
        sync_interval: Duration::from_secs(3600),
        retry_interval: Duration::ZERO,
        ..Options::default()
    };
    let shared = Arc::new(Shared::new(options.queue_capacity));
    Worker::open(directory, "run", Session::default(), options, shared).expect("a file")
}

impl Worker {
    fn take(&mut self, sequences: std::ops::Range<u64>) {
        for sequence in sequences {
            self.arrival(arrival(sequence));
            self.look_after_disk();
        }
    }

    /// The next sync of the open log fails.
    fn refuse(&mut self) {
        if let Sink::Open(file) = &self.sink {
            file.refuse("the disk is broken".to_owned());
        }
    }
}

/// What the logs hold that are neither unfinished nor lost.
fn read(summary: &RecorderSummary) -> Vec<u64> {
    let reader = crate::Reader::open(summary.files.iter().map(|file| &file.path)).expect("logs");
    let sequences = reader.arrivals().map(|a| a.map(|a| a.sequence));
    sequences.collect::<Result<_>>().expect("readable")
}

#[test]
fn what_a_log_that_was_rotated_away_did_not_bring_to_the_disk_comes_again() {
    let directory = tempfile::tempdir().expect("a directory");
    let mut worker = worker(directory.path());
    worker.take(0..35);
    worker.refuse();
    worker.rotate();
    worker.take(35..70);
    worker.rotate();
    worker.take(70..100);
    worker.syncer.settle();
    worker.take(100..130);
    let summary = worker.finish();
    assert_eq!(read(&summary), (0..130).collect::<Vec<_>>());
    assert_eq!(summary.lost_arrivals, 0);
    assert!(!summary.unfinished.is_empty());
    // By when each of the two logs is given back, the first's reason or the second's is the last.
    let reason = summary.last_failure.expect("a reason");
    let reasons = [
        "the disk is broken",
        "the log before it did not reach the disk",
    ];
    assert!(reasons.iter().any(|r| reason.contains(r)), "{reason}");
}

#[test]
fn the_last_log_comes_again_too() {
    let directory = tempfile::tempdir().expect("a directory");
    let mut worker = worker(directory.path());
    worker.take(0..35);
    worker.refuse();
    let summary = worker.finish();
    assert_eq!(read(&summary), (0..35).collect::<Vec<_>>());
    assert_eq!((summary.lost_arrivals, summary.unfinished.len()), (0, 1));
}

#[test]
fn what_cannot_come_again_is_counted() {
    let parent = tempfile::tempdir().expect("a directory");
    let directory = parent.path().join("logs");
    std::fs::create_dir(&directory).expect("made");
    let mut worker = worker(&directory);
    worker.take(0..35);
    worker.refuse();
    std::fs::rename(&directory, parent.path().join("away")).expect("moved");
    let summary = worker.finish();
    assert_eq!(summary.files, []);
    assert_eq!(summary.lost_arrivals, 35);
    assert_eq!(summary.lost_items[&SOURCE], 35);
}
