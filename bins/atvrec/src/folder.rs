//! Log folder: its owner, the numbers of its runs, and the names of its logs.

use std::collections::BTreeSet;
use std::io;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::fs::MetadataExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use anyhow::Context;
use engine::session::utc_compact;
use sample::LogTime;
use store::{ClockState, UtcOffset};

/// File with the number of the last run.
const COUNTER: &str = "run_counter";
/// Largest run number; a larger number in a file is damage.
const RUN_MAX: u64 = 999_999_999;
/// Smallest number of digits of the run number in a name.
const RUN_DIGITS: usize = 6;
/// Suffix of a start time that may be wrong.
const UNSYNCED: &str = "unsynced";
/// Smallest offset to UTC for which a run with a synchronised clock is renamed, ns.
const RENAME_OFFSET_MIN_NS: u64 = 1_000_000_000;

/// A log folder that this process owns until the value is dropped.
///
/// The lock is an abstract socket whose name contains device and inode of the directory. It leaves no
/// file, and it keeps no file of the disk open, so that a disk that is no longer used can be unmounted.
pub struct Folder {
    path: PathBuf,
    _lock: Option<UnixDatagram>,
}

impl Folder {
    /// Creates the directory if it does not exist, and locks it.
    pub fn take(directory: &Path) -> anyhow::Result<Self> {
        std::fs::create_dir_all(directory).with_context(|| {
            format!(
                "cannot create the log directory {}; set another one in storage.directory",
                directory.display()
            )
        })?;
        let lock = match lock(directory) {
            Ok(lock) => Some(lock),
            Err(error) if error.kind() == io::ErrorKind::AddrInUse => anyhow::bail!(
                "another recorder writes to {}; stop it, or set another storage.directory",
                directory.display()
            ),
            Err(error) => {
                tracing::warn!(
                    directory = %directory.display(),
                    %error,
                    "cannot lock the log directory; do not start a second recorder with it"
                );
                None
            }
        };
        Ok(Self {
            path: resolved(directory),
            _lock: lock,
        })
    }

    /// Whether this is the directory `path`.
    pub fn is(&self, path: &Path) -> bool {
        self.path == resolved(path)
    }
}

fn lock(directory: &Path) -> io::Result<UnixDatagram> {
    let data = std::fs::metadata(directory)?;
    let name = format!("atvrec-folder-{:x}-{:x}", data.dev(), data.ino());
    UnixDatagram::bind_addr(&SocketAddr::from_abstract_name(name)?)
}

fn resolved(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

/// Number of the next run: one more than the largest number in the counter file and in the names of the
/// logs. A lost or damaged counter file has no effect as long as a log of the last run exists.
pub fn next_run(directory: &Path) -> io::Result<u64> {
    let mut last = 0;
    for entry in std::fs::read_dir(directory)? {
        let name = entry?.file_name();
        let run = LogName::parse(&name.to_string_lossy()).and_then(|name| name.run);
        last = last.max(run.unwrap_or(0));
    }
    let path = directory.join(COUNTER);
    let counted = std::fs::metadata(&path)
        .ok()
        .filter(|data| data.is_file() && data.len() <= 32)
        .and_then(|_| std::fs::read_to_string(&path).ok())
        .and_then(|text| text.trim().parse::<u64>().ok())
        .filter(|run| *run < RUN_MAX);
    Ok(last.max(counted.unwrap_or(0)) + 1)
}

/// Stores the number of a closed run, which is needed when its logs have been moved.
pub fn count_run(directory: &Path, run: u64) {
    let path = directory.join(COUNTER);
    let temporary = directory.join(format!("{COUNTER}.new"));
    let written = std::fs::write(&temporary, format!("{run}\n"))
        .and_then(|()| std::fs::rename(&temporary, &path));
    if let Err(error) = written {
        tracing::warn!(
            file = %path.display(),
            %error,
            "cannot write the run counter; the next run number follows from the logs only"
        );
    }
}

/// Parts of the names of a run's logs.
#[derive(Clone, Debug)]
pub struct RunName {
    /// The directory.
    pub directory: PathBuf,
    /// First part of the name, from the configuration.
    pub name: String,
    /// Number of the run.
    pub number: u64,
    /// Start of the run on the log clock.
    pub started: LogTime,
    /// State of the host's clock at the start.
    pub clock: ClockState,
}

impl RunName {
    /// Beginning of all names of the run: `drive-r000042-20261121T140500Z`, followed by `-unsynced` if
    /// the time may be wrong.
    pub fn stem(&self) -> String {
        let stem = self.stem_at(self.started.0);
        if self.clock.is_implausible() {
            format!("{stem}-{UNSYNCED}")
        } else {
            stem
        }
    }

    /// Stem with the UTC of a receiver; `None` if the names are correct, or if the date of the receiver
    /// is before the build of this program and thus wrong.
    pub fn stem_by_utc(&self, offset: &UtcOffset) -> Option<String> {
        let start_ns = u64::try_from(offset.utc_ns(self.started)).ok()?;
        let differs = offset.offset_ns.unsigned_abs() >= RENAME_OFFSET_MIN_NS;
        let is_plausible = start_ns >= engine::session::build_time().0;
        (is_plausible && (differs || self.clock.is_implausible())).then(|| self.stem_at(start_ns))
    }

    /// Renames all logs of the closed run by UTC. Returns the old and the new stem if they differ.
    pub fn rename(&self, offset: Option<UtcOffset>) -> store::Result<Option<(String, String)>> {
        let Some(new) = offset.and_then(|offset| self.stem_by_utc(&offset)) else {
            return Ok(None);
        };
        let old = self.stem();
        if old == new || !store::rename_run(&self.directory, &old, &new)? {
            return Ok(None);
        }
        tracing::info!(%old, %new, "renamed the logs of the run by the receiver's date");
        Ok(Some((old, new)))
    }

    fn stem_at(&self, unix_ns: u64) -> String {
        let time = utc_compact(unix_ns / 1_000_000_000);
        let (name, number) = (&self.name, self.number);
        format!("{name}-r{number:0RUN_DIGITS$}-{time}")
    }
}

/// Parts of the name of a log or of a file beside a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogName<'a> {
    /// First part of the name, from the configuration of that run.
    pub name: &'a str,
    /// Name up to the part number.
    pub stem: &'a str,
    /// Run number; `None` in names of older versions and in names that a person gave.
    pub run: Option<u64>,
    /// Number of the part.
    pub part: Option<u32>,
    /// Whether the start time may be wrong.
    pub unsynced: bool,
}

impl<'a> LogName<'a> {
    /// Parses the name of a log or of a file beside it; `None` for a file that is neither.
    pub fn parse(file: &'a str) -> Option<Self> {
        let log = &file[..file.find(".mcap")?];
        let (stem, part) = match log.rsplit_once('_') {
            Some((stem, part)) => (stem, part.parse().ok()),
            None => (log, None),
        };
        let unsynced = stem
            .strip_suffix(UNSYNCED)
            .and_then(|s| s.strip_suffix('-'));
        let mut rest = unsynced.unwrap_or(stem).rsplitn(3, '-');
        let (_time, run) = (rest.next(), rest.next());
        let run = run
            .and_then(|run| run.strip_prefix('r'))
            .filter(|digits| digits.len() >= RUN_DIGITS)
            .and_then(|digits| digits.parse().ok())
            .filter(|run| *run <= RUN_MAX);
        Some(Self {
            name: rest.next().unwrap_or_default(),
            stem,
            run,
            part,
            unsynced: unsynced.is_some(),
        })
    }
}

/// Runs of this process whose logs are not removed: runs that are being written or closed, and the
/// newest run.
#[derive(Clone, Debug, Default)]
pub struct Protected(Arc<Mutex<Runs>>);

#[derive(Debug, Default)]
struct Runs {
    open: BTreeSet<u64>,
    newest: Option<u64>,
}

impl Protected {
    /// Protects a run until the guard is dropped and a newer run has begun.
    pub fn begin(&self, run: u64) -> RunGuard {
        let mut runs = self.lock();
        runs.open.insert(run);
        runs.newest = runs.newest.max(Some(run));
        drop(runs);
        RunGuard {
            runs: self.clone(),
            run,
        }
    }

    /// Whether logs of this run are protected.
    pub fn contains(&self, run: u64) -> bool {
        let runs = self.lock();
        runs.newest == Some(run) || runs.open.contains(&run)
    }

    fn lock(&self) -> MutexGuard<'_, Runs> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Protects the logs of a run that is being written or closed.
#[derive(Debug)]
pub struct RunGuard {
    runs: Protected,
    run: u64,
}

impl Drop for RunGuard {
    fn drop(&mut self) {
        self.runs.lock().open.remove(&self.run);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run_name(clock: ClockState) -> RunName {
        RunName {
            directory: PathBuf::new(),
            name: "drive-2".to_owned(),
            number: 42,
            started: LogTime(1_009_843_205_000_000_000),
            clock,
        }
    }

    #[test]
    fn names_contain_run_start_and_part() {
        let stem = run_name(ClockState::BeforeBuild).stem();
        assert_eq!(stem, "drive-2-r000042-20020101T000005Z-unsynced");
        for end in [".mcap", ".mcap.active", ".mcap.damaged"] {
            let file = format!("{stem}_0003{end}");
            let parsed = LogName::parse(&file).expect("a log");
            let expected = LogName {
                name: "drive-2",
                stem: &stem,
                run: Some(42),
                part: Some(3),
                unsynced: true,
            };
            assert_eq!(parsed, expected);
        }
        let old = LogName::parse("drive-20020101T000005Zx02_0001.mcap").expect("a log");
        assert_eq!((old.run, old.part, old.unsynced), (None, Some(1), false));
        assert_eq!(LogName::parse("keep.mcap").expect("a log").run, None);
        assert_eq!(LogName::parse("notes.txt"), None);
    }

    #[test]
    fn a_run_is_renamed_by_a_receiver_with_a_plausible_date() {
        let run = run_name(ClockState::BeforeBuild);
        let seconds = |s: i64| UtcOffset {
            time: run.started,
            offset_ns: s * 1_000_000_000,
            sigma_s: 0.1,
            source: sample::SourceId(0),
            leap_seconds: None,
        };
        let to_2031 = seconds(1_925_000_000 - 1_009_843_205);
        assert_eq!(
            run.stem_by_utc(&to_2031).as_deref(),
            Some("drive-2-r000042-20310101T021320Z")
        );
        assert_eq!(run.stem_by_utc(&seconds(0)), None);
        let good = RunName {
            started: LogTime(1_925_000_000_000_000_000),
            ..run_name(ClockState::Synchronised)
        };
        assert_eq!(good.stem_by_utc(&seconds(0)), None);
        assert!(good.stem_by_utc(&seconds(2)).is_some());
    }

    #[test]
    fn run_numbers_increase_although_logs_or_the_counter_are_lost() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path();
        let next = || {
            let run = next_run(path).expect("counted");
            count_run(path, run);
            run
        };
        assert_eq!((next(), next()), (1, 2));
        // All logs were moved away: the counter file keeps the number.
        assert_eq!(next(), 3);
        std::fs::write(
            path.join("drive-r000040-20020101T000005Z_0000.mcap.active"),
            "",
        )
        .expect("written");
        assert_eq!(next(), 41);
        for damage in ["", "x", "999999999999999999999", "1"] {
            std::fs::write(path.join(COUNTER), damage).expect("written");
            assert_eq!(next(), 41, "{damage}");
        }
        std::fs::remove_file(path.join(COUNTER)).expect("removed");
        assert_eq!(next(), 41);
        assert_eq!(next(), 42);
    }

    #[test]
    fn a_folder_has_one_owner() {
        let directory = tempfile::tempdir().expect("a directory");
        let first = Folder::take(directory.path()).expect("taken");
        let refused = Folder::take(directory.path()).err().expect("refused");
        assert!(refused.to_string().contains("another recorder"));
        drop(first);
        assert!(Folder::take(directory.path()).is_ok());
        let entries = std::fs::read_dir(directory.path()).expect("listed");
        assert_eq!(entries.count(), 0);
    }

    #[test]
    fn open_runs_and_the_newest_are_protected() {
        let runs = Protected::default();
        let (first, second) = (runs.begin(1), runs.begin(2));
        assert!(runs.contains(1) && runs.contains(2) && !runs.contains(3));
        drop((first, second));
        assert!(!runs.contains(1) && runs.contains(2));
    }
}
