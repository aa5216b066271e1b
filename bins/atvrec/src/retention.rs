//! Keeps the log directory within its limits: the oldest logs go first, those with marks last.
//!
//! The order is that of the runs' numbers, never that of modification times: a computer without a
//! battery behind its clock has wrong ones. Logs of the present drive stay, and nothing is removed
//! where that would not reach the limit.

use std::collections::BTreeMap;
use std::fmt;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use store::{ACTIVE_SUFFIX, Summary};

use crate::board::Board;
use crate::folder::{LogName, Protected};
pub use engine::config::Limits;

/// How often the directory is looked at.
const PERIOD: Duration = Duration::from_secs(10);
/// One MiB, bytes.
const MIB: f64 = 1_048_576.0;

/// The limit that a log was removed for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// All logs together took more than the quota.
    Quota,
    /// Less than the limit was free on the disk.
    KeepFree,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Quota => "quota_mb",
            Self::KeepFree => "keep_free_mb",
        })
    }
}

/// A log that was removed with all that belongs to it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Removed {
    /// The log.
    pub path: PathBuf,
    /// Bytes of it and of what belonged to it.
    pub bytes: u64,
    /// For which limit.
    pub reason: Reason,
}

/// What a look at the directory led to.
#[derive(Debug, Default)]
pub struct Outcome {
    /// Logs that were removed.
    pub removed: Vec<Removed>,
    /// Limits that do not hold, and why.
    pub broken: Vec<String>,
}

/// A log of the directory and the files that belong to it: its journals, the original of a damaged
/// one, what was lost.
struct Log {
    /// Up to `.mcap`, which is included.
    path: PathBuf,
    run: Option<u64>,
    part: Option<u32>,
    /// All files.
    files: Vec<PathBuf>,
    bytes: u64,
    /// It is closed, and nothing shows that it is being recovered.
    whole: bool,
}

/// Keeps `directory` within `limits` until it is dropped, and states on `board` what was removed.
pub async fn keep(directory: PathBuf, limits: Limits, protected: Protected, board: Arc<Board>) {
    if limits == Limits::default() {
        return std::future::pending().await;
    }
    let mut interval = tokio::time::interval(PERIOD);
    let mut broken_before = Vec::new();
    loop {
        interval.tick().await;
        let (directory, protected) = (directory.clone(), protected.clone());
        let look = move || enforce(&directory, limits, &protected);
        match tokio::task::spawn_blocking(look).await {
            Ok(Ok(outcome)) => {
                for log in &outcome.removed {
                    tracing::warn!(
                        log = %log.path.display(),
                        bytes = log.bytes,
                        limit = %log.reason,
                        "removed a log to keep within a limit"
                    );
                }
                if outcome.broken != broken_before {
                    for text in &outcome.broken {
                        tracing::warn!("{text}");
                    }
                    broken_before.clone_from(&outcome.broken);
                }
                board.note_retention(outcome);
            }
            Ok(Err(error)) => tracing::error!(%error, "cannot look at the log directory"),
            Err(error) => tracing::error!(%error, "the look at the log directory failed"),
        }
    }
}

/// Removes logs until each limit holds that removing can reach. Logs of `protected` runs, unfinished
/// logs and logs that another process holds stay.
pub fn enforce(directory: &Path, limits: Limits, protected: &Protected) -> io::Result<Outcome> {
    let logs = list(directory)?;
    let total: u64 = logs.iter().map(|log| log.bytes).sum();
    let free = acq::disk_space(directory)?.free_bytes;
    let excess = [
        (
            Reason::Quota,
            limits.quota.map_or(0, |q| total.saturating_sub(q)),
        ),
        (
            Reason::KeepFree,
            limits.keep_free.map_or(0, |k| k.saturating_sub(free)),
        ),
    ];
    let mut outcome = Outcome::default();
    if excess.iter().all(|(_, bytes)| *bytes == 0) {
        return Ok(outcome);
    }
    let mut removable: Vec<Log> = logs
        .into_iter()
        .filter(|log| log.whole && !log.run.is_some_and(|run| protected.contains(run)))
        .collect();
    let most: u64 = removable.iter().map(|log| log.bytes).sum();
    let mut needed = (0, Reason::Quota);
    for (reason, bytes) in excess {
        if bytes > most {
            outcome.broken.push(format!(
                "{reason} does not hold: {:.0} MiB too much, and the logs that may be removed take \
                 {:.0} MiB; no log is removed for it. Free the disk, or change the limit",
                bytes as f64 / MIB,
                most as f64 / MIB
            ));
        } else if bytes > needed.0 {
            needed = (bytes, reason);
        }
    }
    let (mut missing, reason) = needed;
    if missing == 0 {
        return Ok(outcome);
    }
    removable.sort_by_cached_key(Log::order);
    for log in removable {
        if missing == 0 {
            break;
        }
        match log.remove() {
            Ok(true) => {
                missing = missing.saturating_sub(log.bytes);
                outcome.removed.push(Removed {
                    path: log.path,
                    bytes: log.bytes,
                    reason,
                });
            }
            Ok(false) => {}
            Err(error) => outcome
                .broken
                .push(format!("cannot remove {}: {error}", log.path.display())),
        }
    }
    Ok(outcome)
}

/// Bytes that logs may still take before the disk is full or the oldest ones go.
pub fn room(directory: &Path, limits: Limits) -> io::Result<u64> {
    let free = acq::disk_space(directory)?.free_bytes;
    let free = free.saturating_sub(limits.keep_free.unwrap_or(0));
    Ok(match limits.quota {
        Some(quota) => {
            let total: u64 = list(directory)?.iter().map(|log| log.bytes).sum();
            free.min(quota.saturating_sub(total))
        }
        None => free,
    })
}

/// Bytes a second of the newest closed log, by its summary.
pub fn last_rate(directory: &Path) -> Option<f64> {
    let logs = list(directory).ok()?;
    let closed = logs.iter().filter(|log| log.whole);
    let newest = closed.max_by_key(|log| (log.run, log.part, &log.path))?;
    let (first, last) = Summary::read(&newest.path).ok()??.span?;
    let seconds = last.seconds_since(first);
    (seconds > 0.0).then(|| newest.bytes as f64 / seconds)
}

/// Limits that cannot hold on this disk, in words. `rate_bytes_s` is that of the newest log.
pub fn warnings(
    directory: &Path,
    limits: Limits,
    options: &store::Options,
    rate_bytes_s: Option<f64>,
) -> Vec<String> {
    let mut warnings = Vec::new();
    let there = directory.ancestors().find(|path| path.is_dir());
    let there = there.unwrap_or_else(|| Path::new("."));
    let disk = acq::disk_space(there).ok().map(|space| space.total_bytes);
    let mib = |bytes: u64| format!("{:.0} MiB", bytes as f64 / MIB);
    if let (Some(keep_free), Some(disk)) = (limits.keep_free, disk)
        && keep_free >= disk
    {
        warnings.push(format!(
            "storage.keep_free_mb cannot hold: {} is to stay free, and the disk has {}",
            mib(keep_free),
            mib(disk)
        ));
    }
    if let (Some(quota), Some(disk)) = (limits.quota, disk)
        && quota > disk
    {
        warnings.push(format!(
            "storage.quota_mb has no effect: it is {}, and the disk has {}",
            mib(quota),
            mib(disk)
        ));
    }
    if let Some(quota) = limits.quota {
        match part_bytes(options, rate_bytes_s) {
            Some(part) if quota < part.saturating_mul(2) => warnings.push(format!(
                "storage.quota_mb may not hold: it is {}, and two parts of a drive take {}; lower \
                 storage.rotate_after_mb",
                mib(quota),
                mib(part.saturating_mul(2))
            )),
            Some(_) => {}
            None => warnings.push(
                "storage.quota_mb may not hold: a drive is one file, since rotate_after_s and \
                 rotate_after_mb are 0"
                    .to_owned(),
            ),
        }
    }
    warnings
}

/// Largest size of a part, where it has one: by size, or by time at a known rate.
fn part_bytes(options: &store::Options, rate_bytes_s: Option<f64>) -> Option<u64> {
    let by_time = options.rotate_after.zip(rate_bytes_s);
    let by_time = by_time.map(|(after, rate)| (after.as_secs_f64() * rate) as u64);
    match (options.rotate_bytes, by_time) {
        (Some(a), Some(b)) => Some(a.min(b)),
        // Rotated by time at a rate that is not known yet: no size to compare with.
        (None, None) if options.rotate_after.is_some() => Some(0),
        (a, b) => a.or(b),
    }
}

/// All logs with what belongs to them.
fn list(directory: &Path) -> io::Result<Vec<Log>> {
    let mut logs: BTreeMap<PathBuf, Log> = BTreeMap::new();
    for entry in std::fs::read_dir(directory)? {
        let entry = entry?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let (Some(end), Some(parsed)) = (name.find(".mcap"), LogName::parse(&name)) else {
            continue;
        };
        let end = end + ".mcap".len();
        let rest = &name[end..];
        // A file that vanished has been given its name or was removed.
        let Some(data) = entry.metadata().ok().filter(std::fs::Metadata::is_file) else {
            continue;
        };
        if !(rest.is_empty() || rest.starts_with('.')) {
            continue;
        }
        let path = directory.join(&name[..end]);
        let log = logs.entry(path.clone()).or_insert_with(|| Log {
            path,
            run: parsed.run,
            part: parsed.part,
            files: Vec::new(),
            bytes: 0,
            whole: true,
        });
        log.bytes += data.len();
        log.whole &= !rest.ends_with(ACTIVE_SUFFIX) && !rest.ends_with(".recovering");
        log.files.push(entry.path());
    }
    let mut logs: Vec<Log> = logs.into_values().collect();
    for log in &mut logs {
        log.whole &= log.files.contains(&log.path);
    }
    Ok(logs)
}

impl Log {
    /// What is removed first comes first: logs without marks; logs without a run's number, by name;
    /// runs by their number, parts by theirs.
    fn order(&self) -> (bool, Option<u64>, Option<u32>, PathBuf) {
        let summary = Summary::read(&self.path).ok().flatten();
        // A log that a person has renamed still knows its number.
        let of_summary = |summary: &Summary| (summary.session.run_number, summary.part);
        let (run, part) = match (self.run, &summary) {
            (None, Some(summary)) => of_summary(summary),
            _ => (self.run, self.part),
        };
        // A log whose end cannot be read is kept as if it had a mark.
        let has_mark = summary.is_none_or(|summary| summary.marks > 0);
        (has_mark, run, run.and(part), self.path.clone())
    }

    /// Removes the log and what belongs to it; `false` if another process holds it.
    fn remove(&self) -> io::Result<bool> {
        let lock = File::open(&self.path)?;
        if lock.try_lock().is_err() {
            return Ok(false);
        }
        // The log goes last: what belongs to it is never left alone.
        let beside = self.files.iter().filter(|file| **file != self.path);
        for file in beside.chain([&self.path]) {
            match std::fs::remove_file(file) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {}
            }
        }
        Ok(true)
    }
}

#[cfg(test)]
mod tests;
