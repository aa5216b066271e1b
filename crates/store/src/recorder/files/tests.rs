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

/// Files that write a group every 100 ms and sync a log only when they close the log.
fn files(directory: &Path) -> Files {
    let options = Options {
        raw_interval: Duration::from_millis(100),
        sync_interval: Duration::from_secs(3600),
        retry_interval: Duration::ZERO,
        ..Options::default()
    };
    let shared = Arc::new(Shared::new(&options, crate::LossLedger::default()));
    Files::open(directory, "run", Session::default(), options, shared).expect("a file")
}

impl Files {
    fn take(&mut self, sequences: std::ops::Range<u64>) {
        for sequence in sequences {
            self.shared.enter(&[arrival(sequence)]);
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

/// Sequences in the logs that are neither unfinished nor lost.
fn read(summary: &RecorderSummary) -> Vec<u64> {
    let reader = crate::Reader::open(summary.files.iter().map(|file| &file.path)).expect("logs");
    let sequences = reader.arrivals().map(|a| a.map(|a| a.sequence));
    sequences.collect::<Result<_>>().expect("readable")
}

#[test]
fn arrivals_of_a_rotated_log_that_did_not_reach_the_disk_are_written_again() {
    let directory = tempfile::tempdir().expect("a directory");
    let mut files = files(directory.path());
    files.take(0..35);
    files.refuse();
    files.rotate();
    files.take(35..70);
    files.rotate();
    files.take(70..100);
    files.syncer.wait_for_jobs();
    files.take(100..130);
    let summary = files.finish();
    assert_eq!(read(&summary), (0..130).collect::<Vec<_>>());
    assert_eq!(summary.losses.arrivals, 0);
    assert!(!summary.unfinished.is_empty());
    // Either of the two reasons may be the last one.
    let reason = summary.last_failure.expect("a reason");
    let reasons = [
        "the disk is broken",
        "the log before it did not reach the disk",
    ];
    assert!(reasons.iter().any(|r| reason.contains(r)), "{reason}");
}

#[test]
fn arrivals_of_the_last_log_are_written_again() {
    let directory = tempfile::tempdir().expect("a directory");
    let mut files = files(directory.path());
    files.take(0..35);
    files.refuse();
    let summary = files.finish();
    assert_eq!(read(&summary), (0..35).collect::<Vec<_>>());
    assert_eq!((summary.losses.arrivals, summary.unfinished.len()), (0, 1));
}

#[test]
fn arrivals_that_cannot_be_written_again_are_counted() {
    let parent = tempfile::tempdir().expect("a directory");
    let directory = parent.path().join("logs");
    std::fs::create_dir(&directory).expect("made");
    let mut files = files(&directory);
    files.take(0..35);
    files.refuse();
    std::fs::rename(&directory, parent.path().join("away")).expect("moved");
    std::fs::write(&directory, "").expect("no folder can be made");
    let summary = files.finish();
    assert_eq!(summary.files, []);
    assert_eq!(summary.losses.arrivals, 35);
    assert_eq!(summary.losses.at(sample::LossPlace::Disk)[&SOURCE], 35);
}

fn control(log_time: u64, names: &[&str]) -> Record {
    let value = |name: &&str| sample::Signal {
        name: (*name).into(),
        value: 1.0,
        unit: "1".into(),
    };
    Record::Sample(sample::Sample {
        source: SOURCE,
        log_time: LogTime(log_time),
        valid_time: LogTime(log_time),
        device_time: None,
        measurement: sample::Measurement::Control(sample::ControlSample {
            values: names.iter().map(value).collect(),
        }),
    })
}

/// After a full disk the next file held decoded messages of a controller whose schema only the file
/// before knew: a channel with a schema of 0 bytes.
#[test]
fn every_channel_of_every_part_has_its_schema() {
    let directory = tempfile::tempdir().expect("a directory");
    let mut files = files(directory.path());
    for (part, fails) in (0..).zip([true, false, true]) {
        files.take(part * 30..part * 30 + 30);
        files.record(&control(part * 300_000_000, &["throttle", "brake"]));
        if fails {
            files.fail(&Error::Sink(std::io::ErrorKind::StorageFull.into()));
            files.retry();
            // The waiting data is written before the controller sends again.
            if let Sink::Open(file) = &mut files.sink {
                file.flush().expect("room");
            }
        } else {
            files.rotate();
        }
    }
    files.record(&control(1_000_000_000, &["brake"]));
    let summary = files.finish();
    let mut seen = 0;
    for file in &summary.files {
        let reader = crate::Reader::open([&file.path]).expect("a log");
        let without = |m: &crate::Missing| matches!(m, crate::Missing::NoSchema { .. });
        assert!(!reader.info().missing.iter().any(without));
        for channel in reader.channels() {
            assert!(!channel.schema_data.is_empty(), "{}", channel.topic);
        }
        let table = reader.table("/control/source1", LogTime(0), LogTime(u64::MAX));
        seen += table.map_or(0, |table| table.log_time_ns.len());
    }
    assert_eq!(seen, 4);
}

/// A disk that hangs took 36 s to stop, the service manager killed the recorder after 5 s, and the
/// loss was counted nowhere.
#[test]
fn a_stop_while_the_disk_hangs_ends_in_time_and_counts_what_is_lost() {
    let directory = tempfile::tempdir().expect("a directory");
    let options = Options {
        raw_interval: Duration::from_millis(100),
        stop_within: Duration::from_secs(1),
        queue_capacity: 200,
        ..Options::default()
    };
    let session = Session::default();
    let recorder =
        crate::Recorder::start(directory.path(), "run", session, options).expect("started");
    let wait = |done: &dyn Fn() -> bool| {
        let begin = Instant::now();
        while !done() {
            assert!(begin.elapsed() < Duration::from_secs(20), "it never came");
            std::thread::sleep(Duration::from_millis(5));
        }
    };
    (0..50).for_each(|sequence| assert!(recorder.push(arrival(sequence))));
    wait(&|| recorder.status().backlog.arrivals == 0);
    crate::file::hung::hang(directory.path());
    let taken = (50..500)
        .filter(|sequence| recorder.push(arrival(*sequence)))
        .count();
    std::thread::sleep(Duration::from_millis(300));
    let backlog = recorder.status().backlog;
    assert!(
        backlog.arrivals >= 190 && backlog.bytes >= 3_800,
        "{backlog:?}"
    );
    assert!(
        backlog.queue_fill > 80 && backlog.span >= Duration::from_secs(1),
        "{backlog:?}"
    );
    let refused = recorder.status().losses.arrivals;
    assert_eq!(refused, 450 - taken as u64);
    let begin = Instant::now();
    let summary = recorder.finish().expect("a summary");
    assert!(
        begin.elapsed() < Duration::from_millis(1_300),
        "{:?}",
        begin.elapsed()
    );
    crate::file::hung::release(directory.path());
    assert!(summary.cut_off.is_some());
    assert_eq!(summary.losses.arrivals, refused + backlog.arrivals);
    let log = directory.path().join("run_0000.mcap.active");
    assert_eq!(summary.unfinished, std::slice::from_ref(&log));
    // Readers find the losses in the file beside the log, also after the log is recovered.
    let beside = std::fs::read_to_string(crate::losses_path(&log)).expect("written");
    assert!(beside.contains("lost_arrivals"), "{beside}");
    std::thread::sleep(Duration::from_millis(200));
    let info = crate::Reader::open([&log]).expect("a log").info();
    assert_eq!(info.counters["lost_arrivals"], summary.losses.arrivals);
    assert_eq!(info.counters["lost.source1.disk"], summary.losses.arrivals);
    let stated = |m: &crate::Missing| matches!(m, crate::Missing::Unwritten { .. });
    assert!(info.missing.iter().any(stated), "{:?}", info.missing);
}
