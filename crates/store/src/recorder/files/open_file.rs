//! The open file of a run, with its journals.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use sample::{Arrival, LogTime};

use super::sync::{ClosedLog, Groups, Watched};
use crate::file::Writer;
use crate::journal::Journal;
use crate::log_writer::{Latched, Pending};
use crate::{Options, Result, Session};

/// Free bytes of a disk that are reserved for raw data; on a small disk a sixteenth of it.
#[cfg(unix)]
const RAW_RESERVE: u64 = 16 << 20;
#[cfg(unix)]
const RAW_RESERVE_SHARE: u64 = 16;

/// The open file of a run, with its journals.
pub(crate) struct OpenFile {
    pub writer: Writer,
    /// Decoded records that were taken for it.
    pub records: u64,
    /// Decoded records were left out because the disk is nearly full, and this was not read yet.
    left_out: bool,
    /// Groups written when they were last asked for.
    groups_seen: u64,
    /// Log clock of the first arrival in it.
    pub since: Option<LogTime>,
    journal: Option<Journal>,
    /// When the journal was last written.
    kept_at: Instant,
    groups: Arc<Groups>,
}

impl OpenFile {
    pub(crate) fn create(
        path: &Path,
        session: &Session,
        options: &Options,
        part: u32,
    ) -> Result<Self> {
        let mut writer = Writer::create(path, session.clone(), options.clone(), part)?;
        writer.keep_unsynced();
        let journal = options
            .journal_interval
            .map(|interval| Journal::create(path, session.clone(), interval))
            .transpose();
        match journal {
            Ok(journal) => Ok(Self {
                writer,
                records: 0,
                left_out: false,
                groups_seen: 0,
                since: None,
                journal,
                kept_at: Instant::now(),
                groups: Arc::default(),
            }),
            Err(error) => {
                let (_, _, unfinished) = writer.abandon();
                // The next attempt uses another name if this file cannot be removed.
                let _ = unfinished.discard();
                Err(error)
            }
        }
    }

    /// The handles that the syncing thread needs.
    pub(crate) fn watch(&self) -> Result<Watched> {
        let mut files = vec![self.writer.handle()?];
        if let Some(journal) = &self.journal {
            files.extend(journal.handles()?);
        }
        Ok(Watched {
            files,
            groups: Arc::clone(&self.groups),
        })
    }

    /// The error of the last sync, if it failed.
    pub(crate) fn refused(&self) -> Option<&str> {
        self.groups.refused()
    }

    #[cfg(test)]
    pub(crate) fn refuse(&self, reason: String) {
        self.groups.refuse(reason);
    }

    /// Closes the file. `ClosedLog::whole` is whether that was possible; the error is the reason if not.
    pub(crate) fn close(mut self) -> (ClosedLog, Result<()>) {
        let kept = self.writer.take_unsynced();
        let (file, closed) = self.writer.close();
        let left = ClosedLog {
            file,
            whole: closed.is_ok(),
            groups: self.groups,
            kept,
        };
        (left, closed)
    }

    /// Repeats the last states, and takes the data that another file could not take.
    pub(crate) fn begin(&mut self, latched: Latched, pending: Pending) -> Result<()> {
        self.since = pending.arrivals.first().map(|arrival| arrival.log_time);
        self.writer.continue_from(latched, pending)?;
        self.writer.flush_raw()?;
        self.begin_journal_group()
    }

    pub(crate) fn push(&mut self, arrival: Arrival) -> Result<()> {
        self.since.get_or_insert(arrival.log_time);
        if self.writer.decoded_is_due(arrival.log_time) {
            self.keep_room_for_raw();
        }
        self.writer.push(arrival)?;
        self.begin_journal_group()
    }

    /// Discards the decoded records that wait for the next flush, if the disk is nearly full.
    fn keep_room_for_raw(&mut self) {
        if self.writer.has_decoded() && nearly_full(&self.writer.unfinished().file) {
            self.writer.drop_decoded();
            self.left_out = true;
        }
    }

    /// Whether decoded records were left out since the last call.
    pub(crate) fn take_left_out(&mut self) -> bool {
        std::mem::take(&mut self.left_out)
    }

    /// The arrivals that are neither in the log nor in its journal; `None` if their number did not fall
    /// since the last call.
    pub(crate) fn unwritten(&mut self) -> Option<&[Arrival]> {
        let group = self.writer.group();
        let kept = match &self.journal {
            Some(journal) => !journal.is_behind(group),
            None => group.is_empty(),
        };
        if kept {
            return Some(&[]);
        }
        let groups = self.writer.groups();
        let turned = groups != std::mem::replace(&mut self.groups_seen, groups);
        turned.then(|| self.writer.group())
    }

    /// Writes pushed arrivals to the journal, or returns the time to wait until that is due.
    pub(crate) fn write_journal(&mut self) -> Result<Option<Duration>> {
        let group = self.writer.group();
        let Some(journal) = self.journal.as_mut().filter(|j| j.is_behind(group)) else {
            return Ok(None);
        };
        let wait = journal.append(group, self.kept_at.elapsed())?;
        if wait.is_none() {
            self.kept_at = Instant::now();
        }
        Ok(wait)
    }

    /// Called when no data arrives: without a journal, writes the waiting arrivals to the log.
    pub(crate) fn idle(&mut self) -> Result<()> {
        match self.journal {
            Some(_) => Ok(()),
            None => self.flush(),
        }
    }

    pub(crate) fn flush(&mut self) -> Result<()> {
        self.keep_room_for_raw();
        self.writer.flush()?;
        self.begin_journal_group()
    }

    fn begin_journal_group(&mut self) -> Result<()> {
        let channels = self.writer.take_new_channels();
        if let Some(journal) = self.journal.as_mut().filter(|_| !channels.is_empty()) {
            journal.define(channels)?;
        }
        let written = self.writer.groups();
        if written == self.groups.written.load(Ordering::Relaxed) {
            return Ok(());
        }
        self.groups.written.store(written, Ordering::Release);
        let synced = self.groups.synced.load(Ordering::Acquire);
        self.writer.reached_disk(synced);
        self.journal
            .as_mut()
            .map_or(Ok(()), |journal| journal.begin_group(written, synced))
    }
}

/// Whether the free space of a file's disk is only the reserve for raw data.
#[cfg(unix)]
fn nearly_full(file: &File) -> bool {
    if let Ok(disk) = rustix::fs::fstatvfs(file) {
        let bytes = |blocks: u64| blocks.saturating_mul(disk.f_frsize);
        let reserve = RAW_RESERVE.min(bytes(disk.f_blocks) / RAW_RESERVE_SHARE);
        return bytes(disk.f_bavail) < reserve;
    }
    false
}

#[cfg(not(unix))]
fn nearly_full(_: &File) -> bool {
    false
}
