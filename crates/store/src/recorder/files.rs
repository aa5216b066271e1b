//! The files of a run: the open one with its journal, rotation, and new files after a failure.

mod account;
mod gone;
mod open_file;
mod sync;

use std::path::{Path, PathBuf};
use std::sync::{Arc, atomic::Ordering};
use std::time::{Duration, Instant};

use sample::Arrival;

use super::shared::Tally;
use super::{DiskState, RecorderSummary, Shared, losses_file};
use crate::file::part_path;
use crate::log_writer::{Latched, Pending};
use crate::{Error, Finished, Options, Record, Result, Session};
use open_file::OpenFile;
pub(super) use sync::UnsyncedData;
use sync::{Job, Syncer, Watched};

/// Interval between two checks that the file still exists.
const PRESENCE_INTERVAL: Duration = Duration::from_millis(500);

/// A new file, or the data that waits for one and the error.
type NewFile = std::result::Result<(Box<OpenFile>, Watched), Box<(Pending, Error)>>;

/// The files of a run. The thread of the recorder calls it for each command.
pub(super) struct Files {
    directory: PathBuf,
    stem: String,
    session: Session,
    options: Options,
    shared: Arc<Shared>,
    syncer: Syncer,
    /// Time until arrivals are written to the journal, at most.
    patience: Duration,
    part: u32,
    sink: Sink,
    summary: RecorderSummary,
    /// Bytes of the files before this one.
    bytes_before: u64,
    /// Data that was taken and is neither in the log nor in its journal, nor counted as lost.
    fresh: Tally,
    /// The folder of the logs at the start.
    folder: Option<gone::Folder>,
    /// Time of the next check that the file still exists.
    look_at: Instant,
}

enum Sink {
    Open(Box<OpenFile>),
    Failing {
        pending: Pending,
        latched: Latched,
        retry_at: Instant,
    },
}

impl Files {
    pub(super) fn open(
        directory: &Path,
        stem: &str,
        session: Session,
        options: Options,
        shared: Arc<Shared>,
    ) -> Result<Self> {
        let syncer = Syncer::start(options.sync_interval, Arc::clone(&shared))?;
        let path = part_path(directory, stem, 0);
        let file = OpenFile::create(&path, &session, &options, 0)?;
        syncer.send(Job::Watch(file.watch()?));
        shared.set_state(DiskState::Writing(path));
        Ok(Self {
            directory: directory.to_owned(),
            stem: stem.to_owned(),
            session,
            patience: options.raw_interval.min(PRESENCE_INTERVAL),
            folder: gone::Folder::of(directory),
            options,
            shared,
            syncer,
            part: 0,
            sink: Sink::Open(Box::new(file)),
            summary: RecorderSummary::default(),
            bytes_before: 0,
            fresh: Tally::default(),
            look_at: Instant::now() + PRESENCE_INTERVAL,
        })
    }

    /// Ends without writing: the time to stop is over, and the remaining data is counted as lost.
    pub(super) fn leave(self) -> RecorderSummary {
        if let Sink::Open(file) = self.sink {
            file.writer.abandon();
        }
        self.summary
    }

    /// Time after which a thread without commands calls [`Files::idle`].
    pub(super) const fn patience(&self) -> Duration {
        self.patience
    }

    /// Takes an arrival.
    pub(super) fn arrival(&mut self, arrival: Arrival) {
        let failed = match &mut self.sink {
            Sink::Open(file) => {
                self.fresh.add(&arrival);
                file.push(arrival).err()
            }
            Sink::Failing { pending, .. } => {
                if pending.arrivals.len() < self.options.backlog_capacity {
                    self.fresh.add(&arrival);
                    pending.arrivals.push(arrival);
                } else {
                    self.shared.lose(&arrival);
                }
                None
            }
        };
        match failed {
            Some(error) => self.fail(&error),
            None => self.account(),
        }
    }

    /// Writes arrivals to the journal, or sets the time until that is due.
    pub(super) fn write_journal(&mut self) {
        self.patience = self.options.raw_interval.min(PRESENCE_INTERVAL);
        let Sink::Open(file) = &mut self.sink else {
            return;
        };
        match file.write_journal() {
            Ok(wait) => {
                self.patience = wait.map_or(self.patience, |wait| wait.min(self.patience));
                self.account();
            }
            Err(error) => self.fail(&error),
        }
    }

    /// Takes a decoded record.
    pub(super) fn record(&mut self, record: &Record) {
        match &mut self.sink {
            Sink::Open(file) => {
                file.writer.record(record);
                file.records += 1;
                self.fresh.losses.records += 1;
            }
            // A replay computes it again from the arrivals that are kept.
            Sink::Failing { .. } => self.shared.lose_tally(&Tally::records(1)),
        }
    }

    /// Writes what is due without a command.
    pub(super) fn idle(&mut self) {
        if let Sink::Open(file) = &mut self.sink
            && let Err(error) = file.idle()
        {
            self.fail(&error);
        }
    }

    /// Rotates, notices failures and deleted files, and tries a new file after a failure, if one is due.
    pub(super) fn look_after_disk(&mut self) {
        let refused = match &self.sink {
            Sink::Open(file) => file.refused().map(str::to_owned),
            Sink::Failing { .. } => None,
        };
        if let Some(reason) = refused {
            self.fail_because(reason, true);
        }
        self.take_back();
        if Instant::now() >= self.look_at {
            self.look_at = Instant::now() + PRESENCE_INTERVAL;
            self.look_for_file();
        }
        match &self.sink {
            Sink::Open(file) => {
                let bytes = self.bytes_before + file.writer.bytes();
                self.shared.bytes.store(bytes, Ordering::Relaxed);
                if self.rotation_due(file) {
                    self.shared.rotate.store(false, Ordering::Relaxed);
                    self.rotate();
                }
            }
            Sink::Failing { retry_at, .. } => {
                if Instant::now() >= *retry_at {
                    self.retry();
                }
            }
        }
    }

    fn rotation_due(&self, file: &OpenFile) -> bool {
        let writer = &file.writer;
        let age = file.since.zip(writer.last_log_time()).map(|(a, b)| b - a);
        let old = self.options.rotate_after.zip(age);
        old.is_some_and(|(limit, age)| age >= limit.as_nanos() as i64)
            || self
                .options
                .rotate_bytes
                .is_some_and(|limit| writer.bytes() >= limit)
            || (self.shared.rotate.load(Ordering::Relaxed) && file.since.is_some())
    }

    fn rotate(&mut self) {
        let Sink::Open(file) = &mut self.sink else {
            return;
        };
        if let Err(error) = file.flush() {
            return self.fail(&error);
        }
        self.account();
        let Sink::Open(file) = &mut self.sink else {
            return;
        };
        let latched = file.writer.latched().clone();
        // The new file is created before the old one is closed.
        let next = self.new_file(latched.clone(), Pending::default());
        match next {
            Ok((next, watched)) => {
                let old = std::mem::replace(&mut self.sink, Sink::Open(next));
                if let Sink::Open(file) = old {
                    self.close(*file, Some(watched));
                }
            }
            Err(failed) => {
                let (pending, error) = *failed;
                tracing::error!(%error, "cannot begin a new file; the log continues in the present one");
                let old = std::mem::replace(
                    &mut self.sink,
                    Sink::Failing {
                        pending,
                        latched,
                        retry_at: Instant::now() + self.options.retry_interval,
                    },
                );
                let reason = error.to_string();
                self.summary.last_failure = Some(reason.clone());
                self.set_failing(reason);
                if let Sink::Open(file) = old {
                    self.close(*file, None);
                }
            }
        }
    }

    fn new_file(&mut self, latched: Latched, pending: Pending) -> NewFile {
        self.part += 1;
        self.make_folder();
        let path = part_path(&self.directory, &self.stem, self.part);
        let mut file = match OpenFile::create(&path, &self.session, &self.options, self.part) {
            Ok(file) => file,
            Err(error) => {
                self.take_part_back(&path);
                return Err(Box::new((pending, error)));
            }
        };
        match file.begin(latched, pending).and_then(|()| file.watch()) {
            Ok(watched) => {
                self.shared.set_state(DiskState::Writing(path));
                Ok((Box::new(file), watched))
            }
            Err(error) => {
                let (pending, _, unfinished) = file.writer.abandon();
                if let Err(error) = unfinished.discard() {
                    tracing::warn!(%error, "cannot remove an empty log");
                }
                self.take_part_back(&path);
                Err(Box::new((pending.with_unsynced(), error)))
            }
        }
    }

    /// The next attempt uses the same number, unless a file of that name exists: a failing disk may have
    /// created it and not removed it.
    fn take_part_back(&mut self, path: &Path) {
        if !crate::file::active_path(path).exists() {
            self.part -= 1;
        }
    }

    /// Closes a log, which `next` follows.
    fn close(&mut self, mut file: OpenFile, next: Option<Watched>) {
        // Losses since the last file that could be closed, so that the sum over the files is complete.
        let losses = self.shared.ledger.losses();
        let writer = &mut file.writer;
        writer.state_losses(&losses.since(&self.shared.stated()));
        self.bytes_before += writer.bytes();
        let finished = Finished {
            path: writer.path().to_owned(),
            bytes: writer.bytes(),
            counters: writer.counters().clone(),
        };
        let (left, closed) = file.close();
        match closed {
            Ok(()) => {
                self.shared.set_stated(&losses);
                let size = left.file.file.metadata().map(|m| m.len());
                self.summary.files.push(Finished {
                    bytes: size.unwrap_or(finished.bytes),
                    ..finished
                });
            }
            Err(error) => {
                tracing::error!(%error, "cannot close the log; it waits for recovery");
                self.summary.last_failure = Some(error.to_string());
                self.summary.unfinished.push(left.file.active.clone());
            }
        }
        self.shared.set_summary(&self.summary);
        self.syncer.send(Job::Leave(Box::new(left), next));
    }

    fn set_failing(&self, reason: String) {
        self.shared.set_state(DiskState::Failing { reason });
    }

    fn fail(&mut self, error: &Error) {
        // A full disk keeps the data that it accepted. After any other error, data that the system
        // accepted may not have reached the disk.
        self.fail_because(error.to_string(), !error.is_full_disk());
    }

    /// Abandons the file. `again` is whether data that did not reach the disk is written to the next
    /// file, too; readers use data that is in both files once.
    fn fail_because(&mut self, reason: String, again: bool) {
        tracing::error!(reason, "cannot write the log; a new file will be tried");
        self.summary.last_failure = Some(reason.clone());
        self.set_failing(reason);
        if let Some(active) = self.give_file_up(again) {
            self.summary.unfinished.push(active);
        }
        self.shared.set_summary(&self.summary);
    }

    /// Closes the file as it is, keeps the data for the next one, and returns its unfinished name.
    fn give_file_up(&mut self, again: bool) -> Option<PathBuf> {
        let failing = Sink::Failing {
            pending: Pending::default(),
            latched: Latched::default(),
            retry_at: Instant::now() + self.options.retry_interval,
        };
        let Sink::Open(file) = std::mem::replace(&mut self.sink, failing) else {
            return None;
        };
        self.bytes_before += file.writer.bytes();
        self.syncer.send(Job::Forget);
        let (kept, last, file) = file.writer.abandon();
        let kept = if again { kept.with_unsynced() } else { kept };
        let mut fresh = Tally::of(&kept.arrivals);
        fresh.losses.records = self.fresh.losses.records;
        self.shared.enter_tally(&fresh.since(&self.fresh));
        self.fresh = fresh;
        if let Sink::Failing {
            pending, latched, ..
        } = &mut self.sink
        {
            *pending = kept;
            *latched = last;
        }
        Some(file.active)
    }

    fn retry(&mut self) {
        let Sink::Failing {
            pending, latched, ..
        } = &mut self.sink
        else {
            return;
        };
        let (pending, latched) = (std::mem::take(pending), std::mem::take(latched));
        match self.new_file(latched.clone(), pending) {
            Ok((file, watched)) => {
                tracing::warn!("the log can be written again");
                self.syncer.send(Job::Watch(watched));
                self.sink = Sink::Open(file);
                self.account();
            }
            Err(failed) => {
                let (pending, error) = *failed;
                let reason = error.to_string();
                self.set_failing(reason.clone());
                self.summary.last_failure = Some(reason);
                self.sink = Sink::Failing {
                    pending,
                    latched,
                    retry_at: Instant::now() + self.options.retry_interval,
                };
            }
        }
    }

    /// Moves the arrivals of closed logs that did not reach the disk to the next one; `false` if there
    /// are none.
    fn take_back(&mut self) -> bool {
        let Some(returned) = self.shared.take_unsynced() else {
            return false;
        };
        if matches!(self.sink, Sink::Open(_)) {
            self.fail_because(returned.reason, true);
        } else {
            self.summary.last_failure = Some(returned.reason);
        }
        if let Sink::Failing { pending, .. } = &mut self.sink {
            let returned_tally = Tally::of(&returned.arrivals);
            self.shared.enter_tally(&returned_tally);
            self.fresh.merge(&returned_tally);
            pending.arrivals.splice(..0, returned.arrivals);
            // The arrivals of two logs may be returned in two parts.
            pending.arrivals.sort_by_key(|arrival| arrival.sequence);
        }
        true
    }

    /// Writes the waiting data and closes the last file.
    pub(super) fn finish(mut self) -> RecorderSummary {
        self.close_last();
        if self.take_back() {
            self.close_last();
            self.take_back();
        }
        self.shared.lose_tally(&std::mem::take(&mut self.fresh));
        self.shared.set_state(DiskState::Closed);
        let mut summary = self.summary;
        let unnamed = self.syncer.finish();
        summary
            .files
            .retain(|file| !unnamed.contains(&crate::file::active_path(&file.path)));
        summary.unfinished.extend(unnamed);
        summary.losses = self.shared.ledger.losses();
        let unstated = summary.losses.since(&self.shared.stated());
        let mut files = summary.files.iter().map(|file| &file.path);
        if let Some(log) = summary.unfinished.last().or(files.next_back())
            && !unstated.is_empty()
            && !self.shared.has_given_up()
        {
            let reason = summary.last_failure.clone().unwrap_or_default();
            if let Err(error) = losses_file::write(log, &self.session, &unstated, &reason) {
                tracing::error!(%error, "cannot write the file with the losses");
            }
        }
        summary
    }

    /// Writes the waiting data, in a new file if necessary, closes the file, and waits for the sync. Data
    /// that did not reach the disk stays in the sink.
    fn close_last(&mut self) {
        self.look_for_file();
        if matches!(self.sink, Sink::Failing { .. }) {
            self.retry();
        }
        let flushed = match &mut self.sink {
            Sink::Open(file) => file.flush(),
            Sink::Failing { .. } => return,
        };
        if let Err(error) = flushed {
            return self.fail(&error);
        }
        self.account();
        let closed = Sink::Failing {
            pending: Pending::default(),
            latched: Latched::default(),
            retry_at: Instant::now(),
        };
        if let Sink::Open(file) = std::mem::replace(&mut self.sink, closed) {
            if let Sink::Failing { latched, .. } = &mut self.sink {
                *latched = file.writer.latched().clone();
            }
            self.close(*file, None);
        }
        self.syncer.wait_for_jobs();
    }
}

#[cfg(test)]
mod tests;
