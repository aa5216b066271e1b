use std::sync::{Arc, Mutex};
use std::time::Duration;

use sample::{Payload, SourceId};

use super::*;

/// Accepts a number of bytes and no more, like a disk that fills up.
#[derive(Clone)]
struct SmallDisk {
    taken: Arc<Mutex<Vec<u8>>>,
    room: usize,
}

impl Write for SmallDisk {
    fn write(&mut self, data: &[u8]) -> std::io::Result<usize> {
        let mut taken = self.taken.lock().expect("one thread");
        let room = self.room - taken.len();
        if room == 0 {
            return Err(std::io::ErrorKind::StorageFull.into());
        }
        let count = room.min(data.len());
        taken.extend_from_slice(&data[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

fn arrival(sequence: u64) -> Arrival {
    let bytes = (0..40).map(|n| (sequence * 37 + n * n) as u8).collect();
    Arrival {
        sequence,
        source: SourceId(1),
        log_time: LogTime(sequence * 10_000_000),
        realtime_ns: sequence as i64,
        payload: Payload::Bytes(bytes),
    }
}

fn read(directory: &std::path::Path, name: &str, bytes: &[u8]) -> Vec<Arrival> {
    let path = directory.join(name);
    std::fs::write(&path, bytes).expect("written");
    crate::Reader::open([path])
        .expect("a log")
        .arrivals()
        .collect::<Result<_>>()
        .expect("readable")
}

/// For any free space: the first log and the data that is handed over contain everything.
#[test]
fn data_that_a_full_disk_rejects_is_handed_over() {
    let directory = tempfile::tempdir().expect("a directory");
    let written: Vec<Arrival> = (0..200).map(arrival).collect();
    for room in (600..6_000).step_by(97) {
        let disk = SmallDisk {
            taken: Arc::default(),
            room,
        };
        let session = Session::default();
        let options = Options {
            raw_interval: Duration::from_millis(80),
            ..Options::default()
        };
        let mut log =
            LogWriter::new(disk.clone(), session.clone(), options, 0).expect("the first bytes fit");
        let fitted = written
            .iter()
            .position(|arrival| log.push(arrival.clone()).is_err())
            .expect("the disk fills up");
        let (pending, latched) = log.abandon();
        let first = read(
            directory.path(),
            "first",
            &disk.taken.lock().expect("one thread"),
        );
        let mut second =
            LogWriter::new(Vec::new(), session, Options::default(), 1).expect("a vector takes all");
        let continued = second.continue_from(latched, pending);
        continued.expect("a vector takes all");
        let second = second.finish(&BTreeMap::new()).expect("a vector takes all");
        let second = read(directory.path(), "second", &second);
        let mut both = first.clone();
        both.extend(
            second
                .into_iter()
                .filter(|a| a.sequence >= first.len() as u64),
        );
        assert_eq!(both, written[..=fitted], "{room} bytes");
    }
}

/// Data in the log that a failed sync did not write is handed over, too.
#[test]
fn groups_are_handed_over_until_they_have_reached_the_disk() {
    let options = Options {
        raw_interval: Duration::from_millis(100),
        ..Options::default()
    };
    let abandoned = |synced: u64| -> Vec<u64> {
        let mut log = LogWriter::new(Vec::new(), Session::default(), options.clone(), 0)
            .expect("a vector takes all");
        log.keep_unsynced();
        for sequence in 0..35 {
            log.push(arrival(sequence)).expect("a vector takes all");
        }
        assert_eq!(log.groups(), 3);
        log.reached_disk(synced);
        let (pending, _) = log.abandon();
        let all = pending.unsynced.into_iter().chain(pending.arrivals);
        all.map(|arrival| arrival.sequence).collect()
    };
    for synced in 0..=3 {
        assert!(abandoned(synced).into_iter().eq(10 * synced..35));
    }
}
