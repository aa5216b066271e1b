//! The thread that compresses and writes.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::sync::{Arc, PoisonError, atomic::Ordering};
use std::time::Instant;

use sample::Arrival;

use super::open_file::OpenFile;
use super::sync::{Job, Syncer};
use super::{Command, DiskState, LostItems, RecorderSummary, Shared, on_disk};
use crate::file::{Writer, part_path};
use crate::log_writer::{Latched, Pending};
use crate::{Error, Finished, Options, Record, Result, Session};

pub(crate) struct Worker {
    directory: PathBuf,
    stem: String,
    session: Session,
    options: Options,
    shared: Arc<Shared>,
    syncer: Syncer,
    part: u32,
    sink: Sink,
    summary: RecorderSummary,
    /// Bytes of the files before this one.
    bytes_before: u64,
    /// Losses that closed files tell of.
    told: Losses,
}

enum Sink {
    Open(Box<OpenFile>),
    Failing {
        pending: Pending,
        latched: Latched,
        retry_at: Instant,
    },
}

/// What was lost on the way to the disk since the start of the run.
#[derive(Default)]
struct Losses {
    items: LostItems,
    records: u64,
}

impl Losses {
    fn since(&self, before: &Self) -> Self {
        let items = self.items.iter().filter_map(|(of, count)| {
            let more = count - before.items.get(of).copied().unwrap_or_default();
            (more > 0).then_some((*of, more))
        });
        Self {
            items: items.collect(),
            records: self.records - before.records,
        }
    }
}

impl Worker {
    pub(crate) fn open(
        directory: &Path,
        stem: &str,
        session: Session,
        options: Options,
        shared: Arc<Shared>,
    ) -> Result<Self> {
        let syncer = Syncer::start(options.sync_interval, Arc::clone(&shared))?;
        let path = part_path(directory, stem, 0);
        let file = OpenFile::create(&path, &session, &options, 0)?;
        syncer.send(file.watch()?);
        shared.set_state(DiskState::Writing(path));
        Ok(Self {
            directory: directory.to_owned(),
            stem: stem.to_owned(),
            session,
            options,
            shared,
            syncer,
            part: 0,
            sink: Sink::Open(Box::new(file)),
            summary: RecorderSummary::default(),
            bytes_before: 0,
            told: Losses::default(),
        })
    }

    pub(crate) fn run(mut self, queue: &Receiver<Command>) -> RecorderSummary {
        loop {
            let patience = self.options.journal_interval;
            match queue.recv_timeout(patience.unwrap_or(self.options.raw_interval)) {
                Ok(Command::Arrivals(arrivals)) => {
                    for arrival in arrivals {
                        self.shared.taken();
                        self.arrival(arrival);
                    }
                }
                Ok(Command::Record(record)) => {
                    self.shared.taken();
                    self.record(&record);
                }
                Ok(Command::Rotate) => {}
                Err(RecvTimeoutError::Timeout) => self.idle(),
                Ok(Command::Finish) | Err(RecvTimeoutError::Disconnected) => break,
            }
            self.look_after_disk();
        }
        self.finish()
    }

    fn arrival(&mut self, arrival: Arrival) {
        let failed = match &mut self.sink {
            Sink::Open(file) => file.push(arrival).err(),
            Sink::Failing { pending, .. } => {
                if pending.arrivals.len() < self.options.backlog_capacity {
                    pending.arrivals.push(arrival);
                } else {
                    self.shared.lose(&arrival);
                }
                None
            }
        };
        if let Some(error) = failed {
            self.fail(&error);
        }
    }

    fn record(&mut self, record: &Record) {
        match &mut self.sink {
            Sink::Open(file) => file.writer.record(record),
            // A replay makes it again from the arrivals that are kept.
            Sink::Failing { .. } => {
                self.shared.dropped_records.fetch_add(1, Ordering::Relaxed);
            }
        }
    }

    fn idle(&mut self) {
        if let Sink::Open(file) = &mut self.sink
            && let Err(error) = file.idle()
        {
            self.fail(&error);
        }
    }

    fn look_after_disk(&mut self) {
        let refused = self
            .shared
            .sync_failed
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        if let Some(reason) = refused
            && matches!(self.sink, Sink::Open(_))
        {
            self.fail_because(reason, true);
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
        let latched = file.writer.latched().clone();
        // The new file is there before the old one is closed.
        let next = self.new_file(latched.clone(), Pending::default());
        match next {
            Ok(next) => {
                let old = std::mem::replace(&mut self.sink, next);
                if let Sink::Open(file) = old {
                    self.close(file.writer);
                }
            }
            Err(failed) => {
                let (pending, error) = *failed;
                tracing::error!(%error, "cannot go on in a new file");
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
                self.shared.set_state(DiskState::Failing { reason });
                if let Sink::Open(file) = old {
                    self.close(file.writer);
                }
            }
        }
    }

    fn new_file(
        &mut self,
        latched: Latched,
        pending: Pending,
    ) -> std::result::Result<Sink, Box<(Pending, Error)>> {
        self.part += 1;
        let path = part_path(&self.directory, &self.stem, self.part);
        let mut file = match OpenFile::create(&path, &self.session, &self.options, self.part) {
            Ok(file) => file,
            Err(error) => {
                self.take_part_back(&path);
                return Err(Box::new((pending, error)));
            }
        };
        match file.begin(latched, pending).and_then(|()| file.watch()) {
            Ok(job) => {
                self.syncer.send(job);
                self.shared.set_state(DiskState::Writing(path));
                Ok(Sink::Open(Box::new(file)))
            }
            Err(error) => {
                let (pending, _, unfinished) = file.writer.abandon();
                if let Err(error) = unfinished.discard() {
                    tracing::warn!(%error, "cannot remove an empty log");
                }
                self.take_part_back(&path);
                Err(Box::new((pending, error)))
            }
        }
    }

    /// The next attempt bears the same number, unless a file of that name is there: one that a
    /// failing disk made, but would not remove.
    fn take_part_back(&mut self, path: &Path) {
        if !crate::file::active_path(path).exists() {
            self.part -= 1;
        }
    }

    fn close(&mut self, mut writer: Writer) {
        // What was lost since the last file that could be closed: the sum over the files is all.
        let losses = self.losses();
        let own = losses.since(&self.told);
        writer.lose(&own.items, own.records);
        self.bytes_before += writer.bytes();
        let finished = Finished {
            path: writer.path().to_owned(),
            bytes: writer.bytes(),
            counters: writer.counters().clone(),
        };
        let active = crate::file::active_path(writer.path());
        match writer.close() {
            Ok(file) => {
                self.told = losses;
                let size = file.file.metadata().map(|m| m.len());
                self.summary.files.push(Finished {
                    bytes: size.unwrap_or(finished.bytes),
                    ..finished
                });
                self.syncer.send(Job::Finish(file));
            }
            Err(error) => {
                tracing::error!(%error, "cannot close the log; it waits for recovery");
                self.summary.last_failure = Some(error.to_string());
                self.summary.unfinished.push(active);
            }
        }
    }

    fn losses(&self) -> Losses {
        let (_, items) = self.shared.lost();
        let records = self.shared.dropped_records.load(Ordering::Relaxed);
        Losses { items, records }
    }

    fn fail(&mut self, error: &Error) {
        // A full disk keeps what it took; any other may have refused what the system took for it.
        self.fail_because(error.to_string(), !error.is_full_disk());
    }

    /// Gives the file up. `again` is whether what had not reached the disk goes into the next file
    /// too; readers take what stands in both once.
    fn fail_because(&mut self, reason: String, again: bool) {
        tracing::error!(reason, "the disk refuses the log; a new file will be tried");
        self.summary.last_failure = Some(reason.clone());
        self.shared.set_state(DiskState::Failing { reason });
        let failing = Sink::Failing {
            pending: Pending::default(),
            latched: Latched::default(),
            retry_at: Instant::now() + self.options.retry_interval,
        };
        if let Sink::Open(file) = std::mem::replace(&mut self.sink, failing) {
            self.bytes_before += file.writer.bytes();
            self.syncer.send(Job::Forget);
            let (mut kept, last, file) = file.writer.abandon();
            let unsynced = std::mem::take(&mut kept.unsynced);
            if again {
                kept.arrivals.splice(..0, unsynced);
            }
            self.summary.unfinished.push(file.active);
            if let Sink::Failing {
                pending, latched, ..
            } = &mut self.sink
            {
                *pending = kept;
                *latched = last;
            }
        }
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
            Ok(sink) => {
                tracing::warn!("the disk takes the log again");
                self.sink = sink;
            }
            Err(failed) => {
                let (pending, error) = *failed;
                let reason = error.to_string();
                self.shared.set_state(DiskState::Failing {
                    reason: reason.clone(),
                });
                self.summary.last_failure = Some(reason);
                self.sink = Sink::Failing {
                    pending,
                    latched,
                    retry_at: Instant::now() + self.options.retry_interval,
                };
            }
        }
    }

    fn finish(mut self) -> RecorderSummary {
        if matches!(self.sink, Sink::Failing { .. }) {
            self.retry();
        }
        let closing = Sink::Failing {
            pending: Pending::default(),
            latched: Latched::default(),
            retry_at: Instant::now(),
        };
        match std::mem::replace(&mut self.sink, closing) {
            Sink::Open(mut file) => match file.flush() {
                Ok(()) => self.close(file.writer),
                Err(error) => {
                    self.summary.last_failure = Some(error.to_string());
                    let (pending, _, file) = file.writer.abandon();
                    self.summary.unfinished.push(file.active);
                    self.give_up(&pending);
                }
            },
            Sink::Failing { pending, .. } => self.give_up(&pending),
        }
        self.shared.set_state(DiskState::Closed);
        let (lost_arrivals, lost_items) = self.shared.lost();
        let mut summary = self.summary;
        summary.lost_arrivals = lost_arrivals;
        summary.lost_items = on_disk(&lost_items);
        summary.lost_records = self.shared.dropped_records.load(Ordering::Relaxed);
        let unnamed = self.syncer.finish();
        summary
            .files
            .retain(|file| !unnamed.contains(&crate::file::active_path(&file.path)));
        summary.unfinished.extend(unnamed);
        summary
    }

    fn give_up(&self, pending: &Pending) {
        for arrival in &pending.arrivals {
            self.shared.lose(arrival);
        }
        self.shared
            .dropped_records
            .fetch_add(pending.messages.len() as u64, Ordering::Relaxed);
    }
}
