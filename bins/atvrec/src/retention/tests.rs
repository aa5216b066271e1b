use std::fs;
use std::time::SystemTime;

use sample::LogTime;
use store::{Options, Record, Session, Writer};

use super::*;

/// A log with a modification time that is `age_s` before a fixed time.
fn log(directory: &Path, name: &str, age_s: u64, mark: bool) -> u64 {
    let path = directory.join(name);
    let session = Session {
        run_number: LogName::parse(name).and_then(|name| name.run),
        ..Session::default()
    };
    let mut writer = Writer::create(&path, session, Options::default(), 0).expect("a log");
    if mark {
        writer.record(&Record::Mark {
            time: LogTime(1),
            text: "here".to_owned(),
        });
    }
    writer.finish().expect("closed");
    let file = File::options().write(true).open(&path).expect("a log");
    let modified = SystemTime::UNIX_EPOCH + Duration::from_secs(2_000_000_000 - age_s);
    file.set_modified(modified).expect("its time is set");
    file.metadata().expect("metadata").len()
}

fn quota(bytes: u64) -> Limits {
    Limits {
        quota: Some(bytes),
        keep_free: None,
    }
}

fn total(directory: &Path) -> u64 {
    list(directory)
        .expect("listed")
        .iter()
        .map(|log| log.bytes)
        .sum()
}

/// Names of the logs that were removed to reduce the directory to `bytes`.
fn removed(directory: &Path, bytes: u64, protected: &Protected) -> Vec<String> {
    let outcome = enforce(directory, quota(bytes), protected).expect("enforced");
    let names = outcome.removed.iter().map(|log| log.path.file_name());
    names
        .map(|name| name.expect("a name").to_string_lossy().into_owned())
        .collect()
}

/// A computer without a battery: the newest drive has the oldest date, in its name and in its
/// modification time.
#[test]
fn logs_are_removed_in_the_order_of_runs_and_parts() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path();
    let names = [
        "drive-20261120T100000Z_0000.mcap",
        "drive-20261121T100000Z_0000.mcap",
        "drive-r000008-20261122T100000Z_0000.mcap",
        "drive-r000009-20261122T100000Z_0000.mcap",
        "drive-r000009-20261122T100000Z_0001.mcap",
        "drive-r000010-20020101T000005Z-unsynced_0000.mcap",
        "drive-r000010-20020101T000005Z-unsynced_0001.mcap",
        "drive-r000011-20010101T000005Z-unsynced_0000.mcap",
    ];
    for (age, name) in names.iter().enumerate() {
        log(path, name, age as u64 * 1000, false);
    }
    let all = total(path);
    assert!(removed(path, all, &Protected::default()).is_empty());
    for name in names {
        let now = total(path);
        assert_eq!(removed(path, now - 1, &Protected::default()), [name]);
    }
}

#[test]
fn logs_with_marks_and_logs_without_a_summary_are_removed_last() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path();
    log(path, "drive-r000001-20260101T000000Z_0000.mcap", 3, true);
    fs::write(path.join("drive-r000002-20260101T000000Z_0000.mcap"), "cut").expect("written");
    log(path, "drive-r000003-20260101T000000Z_0000.mcap", 2, false);
    log(path, "drive-r000004-20260101T000000Z_0000.mcap", 1, false);
    let names = removed(path, 0, &Protected::default());
    let runs: Vec<_> = names.iter().map(|name| &name[6..13]).collect();
    assert_eq!(runs, ["r000003", "r000004", "r000001", "r000002"]);
}

#[test]
fn a_renamed_log_keeps_its_place_in_the_order() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path();
    log(path, "drive-r000005-20260101T000000Z_0000.mcap", 0, false);
    let kept = path.join("hill climb.mcap");
    fs::rename(path.join("drive-r000005-20260101T000000Z_0000.mcap"), &kept).expect("renamed");
    log(path, "drive-r000004-20260101T000000Z_0000.mcap", 0, false);
    let names = removed(path, total(path) - 1, &Protected::default());
    assert_eq!(names, ["drive-r000004-20260101T000000Z_0000.mcap"]);
}

/// No log is removed for a limit that cannot be met by removing all removable logs.
#[test]
fn no_log_is_removed_for_a_limit_that_cannot_be_met() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path();
    let old = log(path, "drive-r000001-20260101T000000Z_0000.mcap", 9, false);
    let protected = Protected::default();
    let guard = protected.begin(2);
    log(path, "drive-r000002-20260101T000000Z_0000.mcap", 99, false);
    let part = log(path, "drive-r000002-20260101T000000Z_0001.mcap", 99, false);
    fs::write(
        path.join("drive-r000002-20260101T000000Z_0002.mcap.active"),
        "x",
    )
    .expect("written");
    fs::write(path.join("notes.txt"), "not a log").expect("written");
    let keep_free = Limits {
        quota: None,
        keep_free: Some(u64::MAX),
    };
    for limits in [keep_free, quota(part)] {
        let outcome = enforce(path, limits, &protected).expect("enforced");
        assert_eq!(outcome.removed, []);
        assert_eq!(outcome.exceeded.len(), 1, "{:?}", outcome.exceeded);
    }
    // A limit that can be met is met, although another limit cannot be met.
    let both = Limits {
        quota: Some(total(path) - 1),
        ..keep_free
    };
    let outcome = enforce(path, both, &protected).expect("enforced");
    assert_eq!(outcome.removed.len(), 1);
    assert_eq!(outcome.removed[0].bytes, old);
    assert_eq!(outcome.removed[0].reason, Reason::Quota);
    assert_eq!(outcome.exceeded.len(), 1);
    // The run is closed, but it is still the newest one.
    drop(guard);
    assert!(removed(path, total(path) - 1, &protected).is_empty());
    drop(protected.begin(3));
    assert_eq!(removed(path, total(path) - 1, &protected).len(), 1);
}

#[test]
fn free_space_is_a_limit_too() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path();
    let name = "drive-r000001-20260101T000000Z_0000.mcap";
    log(path, name, 1, false);
    let big = File::options()
        .append(true)
        .open(path.join(name))
        .expect("a log");
    // The size of the file counts, although it is a sparse file.
    big.set_len(1 << 40).expect("made longer");
    let free = acq::disk_space(path).expect("a disk").free_bytes;
    let limits = Limits {
        quota: None,
        keep_free: Some(free + (1 << 30)),
    };
    let outcome = enforce(path, limits, &Protected::default()).expect("enforced");
    assert_eq!(outcome.removed.len(), 1);
    assert_eq!(outcome.removed[0].reason, Reason::KeepFree);
}

#[test]
fn other_files_of_a_log_are_removed_with_it_and_logs_in_use_are_kept() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path();
    let [first, second, third] =
        [1, 2, 3].map(|run| format!("drive-r{run:06}-20260101T000000Z_0000.mcap"));
    for name in [&first, &second, &third] {
        log(path, name, 0, false);
    }
    for end in [".damaged", ".journal-a"] {
        fs::write(path.join(format!("{first}{end}")), [0; 1000]).expect("written");
    }
    fs::write(path.join(format!("{second}.recovering")), "half").expect("written");
    let lock = File::open(path.join(&third)).expect("opened");
    lock.lock().expect("locked");
    // A directory with the name of a log is not a log.
    fs::create_dir(path.join("drive-r000000-20260101T000000Z_0000.mcap")).expect("made");
    let outcome = enforce(path, quota(total(path) - 500), &Protected::default()).expect("enforced");
    assert_eq!(outcome.removed.len(), 1);
    assert!(outcome.removed[0].bytes > 2000);
    assert!(!path.join(format!("{first}.damaged")).exists());
    assert!(!path.join(format!("{first}.journal-a")).exists());
    assert!(removed(path, total(path) - 1, &Protected::default()).is_empty());
    assert!(path.join(&second).exists() && path.join(&third).exists());
}

#[test]
fn available_bytes_respect_the_limits() {
    let directory = tempfile::tempdir().expect("a directory");
    let bytes = log(directory.path(), "a.mcap", 1, false);
    assert_eq!(
        available_bytes(directory.path(), quota(bytes + 1000)).expect("listed"),
        1000
    );
    let limits = Limits {
        quota: None,
        keep_free: Some(u64::MAX),
    };
    assert_eq!(
        available_bytes(directory.path(), limits).expect("listed"),
        0
    );
}

#[test]
fn limits_that_cannot_be_met_are_found() {
    let directory = tempfile::tempdir().expect("a directory");
    let absent = directory.path().join("not/made/yet");
    let options = Options {
        rotate_bytes: Some(100 << 20),
        ..Options::default()
    };
    let count = |limits, options: &Options, rate| warnings(&absent, limits, options, rate).len();
    let keep_free = |bytes| Limits {
        quota: None,
        keep_free: Some(bytes),
    };
    assert_eq!(count(Limits::default(), &options, None), 0);
    assert_eq!(count(keep_free(1 << 20), &options, None), 0);
    assert_eq!(count(keep_free(u64::MAX), &options, None), 1);
    assert_eq!(count(quota(200 << 20), &options, None), 0);
    assert_eq!(count(quota(199 << 20), &options, None), 1);
    // 600 s at 10 kB/s are 6 MB: far less than the size.
    assert_eq!(count(quota(20 << 20), &options, Some(1e4)), 0);
    assert_eq!(count(quota(10 << 20), &options, Some(1e4)), 1);
    assert_eq!(count(quota(u64::MAX), &options, None), 1);
    let never = Options {
        rotate_bytes: None,
        rotate_after: None,
        ..options
    };
    assert_eq!(count(quota(1 << 30), &never, None), 1);
}
