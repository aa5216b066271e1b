//! Keeps the log directory within its limits: the oldest logs go first, those with marks last. The
//! file that is being written is never touched.

use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use store::{ACTIVE_SUFFIX, Reader};

/// How often the directory is looked at.
const PERIOD: Duration = Duration::from_secs(10);

/// Limits of the log directory, in bytes; `None` is no limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Limits {
    /// Most that all logs together may take.
    pub quota: Option<u64>,
    /// Least that is to stay free on the disk.
    pub keep_free: Option<u64>,
}

/// A log of the directory.
struct Log {
    path: PathBuf,
    bytes: u64,
    modified: SystemTime,
}

/// Keeps `directory` within `limits` until it is dropped.
pub async fn keep(directory: PathBuf, limits: Limits) {
    if limits == Limits::default() {
        return std::future::pending().await;
    }
    let mut interval = tokio::time::interval(PERIOD);
    loop {
        interval.tick().await;
        let directory = directory.clone();
        let enforced = tokio::task::spawn_blocking(move || enforce(&directory, limits)).await;
        match enforced {
            Ok(Ok(removed)) => {
                for path in removed {
                    tracing::warn!(log = %path.display(), "removed to keep within the limits");
                }
            }
            Ok(Err(error)) => tracing::error!(%error, "the log directory was not looked at"),
            Err(error) => tracing::error!(%error, "the look at the log directory failed"),
        }
    }
}

/// Removes logs until the limits hold, and says which.
pub fn enforce(directory: &Path, limits: Limits) -> io::Result<Vec<PathBuf>> {
    let (mut logs, total) = list(directory)?;
    let mut excess = limits
        .quota
        .map_or(0, |quota| total.saturating_sub(quota))
        .max(shortage(directory, limits)?);
    if excess == 0 {
        return Ok(Vec::new());
    }
    logs.sort_by_cached_key(|log| (has_mark(&log.path), log.modified, log.path.clone()));
    let mut removed = Vec::new();
    for log in logs {
        if excess == 0 {
            break;
        }
        std::fs::remove_file(&log.path)?;
        excess = excess.saturating_sub(log.bytes);
        removed.push(log.path);
    }
    Ok(removed)
}

/// `stem`, or with a number behind it if logs of that stem are there: a computer without a clock
/// that lasts begins each of its days at the same second.
pub fn free_stem(directory: &Path, stem: &str) -> io::Result<String> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(directory)? {
        names.push(entry?.file_name().to_string_lossy().into_owned());
    }
    // Names keep the order of the runs.
    let numbered = (2..).map(|number| format!("{stem}x{number:02}"));
    let is_free = |stem: &String| {
        let start = format!("{stem}_");
        !names.iter().any(|name| name.starts_with(&start))
    };
    let mut stems = std::iter::once(stem.to_owned()).chain(numbered);
    Ok(stems.find(is_free).unwrap_or_else(|| stem.to_owned()))
}

/// Bytes that logs may still take before the disk is full or the oldest ones go.
pub fn room(directory: &Path, limits: Limits) -> io::Result<u64> {
    let free = acq::free_bytes(directory)?.saturating_sub(limits.keep_free.unwrap_or(0));
    match limits.quota {
        Some(quota) => Ok(free.min(quota.saturating_sub(list(directory)?.1))),
        None => Ok(free),
    }
}

/// Bytes a second of the newest whole log.
pub fn last_rate(directory: &Path) -> Option<f64> {
    let (logs, _) = list(directory).ok()?;
    let newest = logs.iter().max_by_key(|log| (log.modified, &log.path))?;
    let (first, last) = Reader::open([&newest.path]).ok()?.info().span?;
    let seconds = last.seconds_since(first);
    (seconds > 0.0).then(|| newest.bytes as f64 / seconds)
}

/// Whole logs, and the bytes that all logs take, unfinished ones included.
fn list(directory: &Path) -> io::Result<(Vec<Log>, u64)> {
    let mut logs = Vec::new();
    let mut total = 0;
    for entry in std::fs::read_dir(directory)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let metadata = entry.metadata()?;
        if name.ends_with(&format!(".mcap{ACTIVE_SUFFIX}")) {
            total += metadata.len();
        } else if name.ends_with(".mcap") && metadata.is_file() {
            total += metadata.len();
            logs.push(Log {
                path: entry.path(),
                bytes: metadata.len(),
                modified: metadata.modified()?,
            });
        }
    }
    Ok((logs, total))
}

/// Bytes that the disk lacks.
fn shortage(directory: &Path, limits: Limits) -> io::Result<u64> {
    match limits.keep_free {
        Some(keep_free) => Ok(keep_free.saturating_sub(acq::free_bytes(directory)?)),
        None => Ok(0),
    }
}

/// Whether somebody set a mark in the log. One that cannot be read is kept as if it had one.
fn has_mark(path: &Path) -> bool {
    match Reader::open([path]) {
        Ok(reader) => reader
            .info()
            .channels
            .get("/mark")
            .is_some_and(|(_, count)| *count > 0),
        Err(_) => true,
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use sample::LogTime;
    use store::{Options, Record, Session, Writer};

    use super::*;

    fn log(directory: &Path, name: &str, age_s: u64, mark: bool) -> u64 {
        let path = directory.join(name);
        let mut writer =
            Writer::create(&path, Session::default(), Options::default(), 0).expect("a log");
        if mark {
            writer.record(&Record::Mark {
                time: LogTime(1),
                text: "here".to_owned(),
            });
        }
        writer.finish().expect("closed");
        let file = fs::File::options().write(true).open(&path).expect("a log");
        let modified = SystemTime::UNIX_EPOCH + Duration::from_secs(2_000_000_000 - age_s);
        file.set_modified(modified).expect("its time is set");
        file.metadata().expect("metadata").len()
    }

    #[test]
    fn the_oldest_go_first_and_marked_ones_last() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path();
        log(path, "a.mcap", 400, true);
        log(path, "b.mcap", 300, false);
        log(path, "c.mcap", 200, false);
        let newest = log(path, "d.mcap", 100, false);
        fs::write(path.join("e.mcap.active"), "being written").expect("written");
        fs::write(path.join("notes.txt"), "not a log").expect("written");
        let total: u64 = list(path).expect("listed").1;
        let within = |quota| Limits {
            quota: Some(quota),
            keep_free: None,
        };
        assert!(enforce(path, within(total)).expect("enforced").is_empty());
        let removed = enforce(path, within(total - newest - 1)).expect("enforced");
        assert_eq!(removed, [path.join("b.mcap"), path.join("c.mcap")]);
        let removed = enforce(path, within(0)).expect("enforced");
        assert_eq!(removed, [path.join("d.mcap"), path.join("a.mcap")]);
        assert!(path.join("e.mcap.active").exists() && path.join("notes.txt").exists());
    }

    #[test]
    fn a_run_never_takes_the_names_of_another() {
        let directory = tempfile::tempdir().expect("a directory");
        let free = || free_stem(directory.path(), "drive-20020101T000005Z").expect("listed");
        assert_eq!(free(), "drive-20020101T000005Z");
        log(
            directory.path(),
            "drive-20020101T000005Z_0000.mcap",
            1,
            false,
        );
        assert_eq!(free(), "drive-20020101T000005Zx02");
        let active = directory
            .path()
            .join("drive-20020101T000005Zx02_0000.mcap.active");
        fs::write(active, "").expect("written");
        assert_eq!(free(), "drive-20020101T000005Zx03");
    }

    #[test]
    fn the_room_is_what_the_limits_leave() {
        let directory = tempfile::tempdir().expect("a directory");
        let bytes = log(directory.path(), "a.mcap", 1, false);
        let limits = Limits {
            quota: Some(bytes + 1000),
            keep_free: None,
        };
        assert_eq!(room(directory.path(), limits).expect("listed"), 1000);
        let limits = Limits {
            quota: None,
            keep_free: Some(u64::MAX),
        };
        assert_eq!(room(directory.path(), limits).expect("listed"), 0);
    }

    #[test]
    fn free_space_is_a_limit_too() {
        let directory = tempfile::tempdir().expect("a directory");
        log(directory.path(), "a.mcap", 1, false);
        let limits = Limits {
            quota: None,
            keep_free: Some(u64::MAX),
        };
        assert_eq!(
            enforce(directory.path(), limits).expect("enforced").len(),
            1
        );
    }
}
