//! Retention: keeps the log directory within its limits. The oldest logs are removed first, logs with
//! marks last.
//!
//! The order is the order of the run numbers, not of the modification times, which are wrong on a
//! computer whose clock has no battery. Logs of the present drive are not removed, and no log is
//! removed if the limit cannot be met.

use std::collections::BTreeMap;
use std::fmt;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use store::{ACTIVE_SUFFIX, Summary};

use crate::folder::{LogName, Protected};
use crate::status::RecorderStatus;
pub use engine::config::Limits;

/// Period of the checks of the directory.
const PERIOD: Duration = Duration::from_secs(10);
/// One MiB, bytes.
const MIB: f64 = 1_048_576.0;

/// Limit for which a log was removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// All logs together exceeded the quota.
    Quota,
    /// The free space of the disk was below the limit.
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

/// A log that was removed together with its other files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Removed {
    /// The log.
    pub path: PathBuf,
    /// Bytes of the log and of its other files.
    pub bytes: u64,
    /// Limit for which it was removed.
    pub reason: Reason,
}

/// Result of a check of the directory.
#[derive(Debug, Default)]
pub struct Outcome {
    /// Logs that were removed.
    pub removed: Vec<Removed>,
    /// Limits that are exceeded, and why.
    pub exceeded: Vec<String>,
}

/// A log of the directory and its other files: journals, damaged original, list of losses.
struct Log {
    /// Path up to and including `.mcap`.
    path: PathBuf,
    run: Option<u64>,
    part: Option<u32>,
    /// All files.
    files: Vec<PathBuf>,
    bytes: u64,
    /// Whether the log is closed and is not being recovered.
    is_closed: bool,
}

/// Enforces `limits` in `directory` periodically, and adds the results to `status`.
pub async fn enforce_periodically(
    directory: PathBuf,
    limits: Limits,
    protected: Protected,
    status: Arc<RecorderStatus>,
) {
    if limits == Limits::default() {
        return std::future::pending().await;
    }
    let mut interval = tokio::time::interval(PERIOD);
    let mut exceeded_before = Vec::new();
    loop {
        interval.tick().await;
        let (path, protected) = (directory.clone(), protected.clone());
        let check = move || enforce(&path, limits, &protected);
        match tokio::task::spawn_blocking(check).await {
            Ok(Ok(outcome)) => {
                for log in &outcome.removed {
                    tracing::warn!(
                        log = %log.path.display(),
                        bytes = log.bytes,
                        limit = %log.reason,
                        "removed a log because a limit of the log directory was exceeded"
                    );
                }
                if outcome.exceeded != exceeded_before {
                    for text in &outcome.exceeded {
                        tracing::warn!("{text}");
                    }
                    exceeded_before.clone_from(&outcome.exceeded);
                }
                status.add_retention(outcome);
            }
            Ok(Err(error)) => tracing::error!(
                directory = %directory.display(),
                %error,
                "cannot read the log directory; no log is removed"
            ),
            Err(error) => tracing::error!(
                directory = %directory.display(),
                %error,
                "the check of the log directory failed"
            ),
        }
    }
}

/// Removes logs until each limit is met that removing logs can meet. Logs of `protected` runs,
/// unfinished logs and logs that another process has locked are not removed.
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
        .filter(|log| log.is_closed && !log.run.is_some_and(|run| protected.contains(run)))
        .collect();
    let removable_bytes: u64 = removable.iter().map(|log| log.bytes).sum();
    let mut needed = (0, Reason::Quota);
    for (reason, bytes) in excess {
        if bytes > removable_bytes {
            outcome.exceeded.push(format!(
                "storage.{reason} is exceeded by {:.0} MiB, but the logs that may be removed have \
                 only {:.0} MiB; no log is removed for it; free space on the disk, or change the \
                 limit",
                bytes as f64 / MIB,
                removable_bytes as f64 / MIB
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
                .exceeded
                .push(format!("cannot remove {}: {error}", log.path.display())),
        }
    }
    Ok(outcome)
}

/// Bytes that are available for logs until the disk is full or the oldest logs are removed.
pub fn available_bytes(directory: &Path, limits: Limits) -> io::Result<u64> {
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

/// Data rate of the newest closed log by its summary, bytes/s.
pub fn last_rate(directory: &Path) -> Option<f64> {
    let logs = list(directory).ok()?;
    let closed = logs.iter().filter(|log| log.is_closed);
    let newest = closed.max_by_key(|log| (log.run, log.part, &log.path))?;
    let (first, last) = Summary::read(&newest.path).ok()??.span?;
    let seconds = last.seconds_since(first);
    (seconds > 0.0).then(|| newest.bytes as f64 / seconds)
}

/// Warnings of limits that cannot be met on this disk. `rate_bytes_s` is the data rate of the newest
/// log.
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
            "storage.keep_free_mb cannot be met: it is {}, and the whole disk has {}; lower it",
            mib(keep_free),
            mib(disk)
        ));
    }
    if let (Some(quota), Some(disk)) = (limits.quota, disk)
        && quota > disk
    {
        warnings.push(format!(
            "storage.quota_mb has no effect: it is {}, and the whole disk has {}; lower it",
            mib(quota),
            mib(disk)
        ));
    }
    if let Some(quota) = limits.quota {
        match part_bytes(options, rate_bytes_s) {
            Some(part) if quota < part.saturating_mul(2) => warnings.push(format!(
                "storage.quota_mb may be exceeded: it is {}, and two parts of a drive need {}; \
                 lower storage.rotate_after_mb",
                mib(quota),
                mib(part.saturating_mul(2))
            )),
            Some(_) => {}
            None => warnings.push(
                "storage.quota_mb may be exceeded: a drive is one file, because rotate_after_s and \
                 rotate_after_mb are 0; set one of them"
                    .to_owned(),
            ),
        }
    }
    warnings
}

/// Largest size of a part, if there is one: by size, or by time at a known rate.
fn part_bytes(options: &store::Options, rate_bytes_s: Option<f64>) -> Option<u64> {
    let by_time = options.rotate_after.zip(rate_bytes_s);
    let by_time = by_time.map(|(after, rate)| (after.as_secs_f64() * rate) as u64);
    match (options.rotate_bytes, by_time) {
        (Some(a), Some(b)) => Some(a.min(b)),
        // Rotated by time, at an unknown rate: there is no size to compare with.
        (None, None) if options.rotate_after.is_some() => Some(0),
        (a, b) => a.or(b),
    }
}

/// All logs of the directory with their other files.
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
        // A file that does not exist any more was renamed or removed meanwhile.
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
            is_closed: true,
        });
        log.bytes += data.len();
        log.is_closed &= !rest.ends_with(ACTIVE_SUFFIX) && !rest.ends_with(".recovering");
        log.files.push(entry.path());
    }
    let mut logs: Vec<Log> = logs.into_values().collect();
    for log in &mut logs {
        log.is_closed &= log.files.contains(&log.path);
    }
    Ok(logs)
}

impl Log {
    /// Sort key of the removal: logs without marks first; among these, logs without a run number by
    /// name, then logs by run number and part number.
    fn order(&self) -> (bool, Option<u64>, Option<u32>, PathBuf) {
        let summary = Summary::read(&self.path).ok().flatten();
        // The summary of a renamed log still contains the numbers.
        let of_summary = |summary: &Summary| (summary.session.run_number, summary.part);
        let (run, part) = match (self.run, &summary) {
            (None, Some(summary)) => of_summary(summary),
            _ => (self.run, self.part),
        };
        // A log whose summary cannot be read is treated like a log with a mark.
        let has_mark = summary.is_none_or(|summary| summary.marks > 0);
        (has_mark, run, run.and(part), self.path.clone())
    }

    /// Removes the log and its other files; `false` if another process has locked it.
    fn remove(&self) -> io::Result<bool> {
        let lock = File::open(&self.path)?;
        if lock.try_lock().is_err() {
            return Ok(false);
        }
        // The log is removed last, so that its other files are never left without it.
        let others = self.files.iter().filter(|file| **file != self.path);
        for file in others.chain([&self.path]) {
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
