//! The file that a run is being written to, with its journals.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use sample::{Arrival, LogTime};

use super::sync::{Groups, Left, Watched};
use crate::file::Writer;
use crate::journal::Journal;
use crate::log_writer::{Latched, Pending};
use crate::{Options, Result, Session};

/// The last bytes of a disk are kept for raw data: this many, or a sixteenth of a small disk.
const RAW_RESERVE: u64 = 16 << 20;
const RAW_RESERVE_SHARE: u64 = 16;

/// The file that a run is being written to, with its journals.
pub(crate) struct OpenFile {
    pub writer: Writer,
    /// Decoded records that were taken for it.
    pub records: u64,
    /// Decoded records were left out for want of room, and nobody has asked yet.
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
                // What cannot be removed is passed over by the next attempt.
                let _ = unfinished.discard();
                Err(error)
            }
        }
    }

    /// What the syncing thread needs of it.
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

    /// Why the disk refused to sync it, if it did.
    pub(crate) fn refused(&self) -> Option<&str> {
        self.groups.refused()
    }

    #[cfg(test)]
    pub(crate) fn refuse(&self, reason: String) {
        self.groups.refuse(reason);
    }

    /// Closes it: `Left::whole` tells whether that was possible, an error why not.
    pub(crate) fn close(mut self) -> (Left, Result<()>) {
        let kept = self.writer.take_unsynced();
        let (file, closed) = self.writer.close();
        let left = Left {
            file,
            whole: closed.is_ok(),
            groups: self.groups,
            kept,
        };
        (left, closed)
    }

    /// Repeats the states that last, and takes what another file did not take.
    pub(crate) fn begin(&mut self, latched: Latched, pending: Pending) -> Result<()> {
        self.since = pending.arrivals.first().map(|arrival| arrival.log_time);
        self.writer.resume(pending);
        self.writer.continue_from(latched)?;
        self.writer.flush_raw()?;
        self.turn_journal()
    }

    pub(crate) fn push(&mut self, arrival: Arrival) -> Result<()> {
        self.since.get_or_insert(arrival.log_time);
        if self.writer.decoded_is_due(arrival.log_time) {
            self.keep_room_for_raw();
        }
        self.writer.push(arrival)?;
        self.turn_journal()
    }

    /// Leaves the decoded records out that wait for the next flush, if the disk is nearly full.
    fn keep_room_for_raw(&mut self) {
        if self.writer.has_decoded() && nearly_full(&self.writer.unfinished().file) {
            self.writer.drop_decoded();
            self.left_out = true;
        }
    }

    /// Whether decoded records were left out since this was last asked.
    pub(crate) fn take_left_out(&mut self) -> bool {
        std::mem::take(&mut self.left_out)
    }

    /// The arrivals that are neither in the log nor in its journal; `None` if they are as many as when
    /// this was last asked, or more.
    pub(crate) fn unwritten(&mut self) -> Option<&[Arrival]> {
        let group = self.writer.group();
        let kept = match &self.journal {
            Some(journal) => !journal.lags(group),
            None => group.is_empty(),
        };
        if kept {
            return Some(&[]);
        }
        let groups = self.writer.groups();
        let turned = groups != std::mem::replace(&mut self.groups_seen, groups);
        turned.then(|| self.writer.group())
    }

    /// What was pushed goes into the journal; if that has to wait for a moment, says how long.
    pub(crate) fn keep_up(&mut self) -> Result<Option<Duration>> {
        let group = self.writer.group();
        let Some(journal) = self.journal.as_mut().filter(|j| j.lags(group)) else {
            return Ok(None);
        };
        let wait = journal.keep_up(group, self.kept_at.elapsed())?;
        if wait.is_none() {
            self.kept_at = Instant::now();
        }
        Ok(wait)
    }

    /// Nothing came for a while: without a journal, what waits goes into the log.
    pub(crate) fn idle(&mut self) -> Result<()> {
        match self.journal {
            Some(_) => Ok(()),
            None => self.flush(),
        }
    }

    pub(crate) fn flush(&mut self) -> Result<()> {
        self.keep_room_for_raw();
        self.writer.flush()?;
        self.turn_journal()
    }

    fn turn_journal(&mut self) -> Result<()> {
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
            .map_or(Ok(()), |journal| journal.turn(written, synced))
    }
}

/// Whether only the room that is kept for raw data is left on a file's disk.
fn nearly_full(file: &File) -> bool {
    #[cfg(unix)]
    if let Ok(disk) = rustix::fs::fstatvfs(file) {
        let bytes = |blocks: u64| blocks.saturating_mul(disk.f_frsize);
        let reserve = RAW_RESERVE.min(bytes(disk.f_blocks) / RAW_RESERVE_SHARE);
        return bytes(disk.f_bavail) < reserve;
    }
    false
}
