//! The recorder of a run, in three layers: this file and [`queue`] take arrivals and records in a queue and
//! empty it on a thread; [`files`] has the open file, rotation, journal and sync; [`LogWriter`] and its
//! channels make the bytes of a log.
//!
//! [`LogWriter`]: crate::LogWriter

#![allow(
    clippy::disallowed_types,
    reason = "the recorder's threads time the disk: when to sync, when to try again; they stamp nothing"
)]

mod files;
mod losses_file;
mod queue;
mod shared;
mod stop;

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use sample::Arrival;

use crate::{Error, Finished, LossLedger, Losses, Options, Record, Result, Session};
use files::Files;
pub(crate) use losses_file::read as read_losses;
pub(crate) use shared::Shared;
use shared::Tally;

/// Writes a run of log files on threads of its own. Its methods for arrivals and records never block:
/// data for which there is no room is counted as lost.
///
/// [`Recorder::status`] reports a disk that fails. Up to [`Options::backlog_capacity`] arrivals are kept
/// then, and the recorder tries a new file until one can be written.
pub struct Recorder {
    commands: SyncSender<Command>,
    shared: Arc<Shared>,
    /// Receives the summary when the thread has ended; `None` after that.
    ended: Option<Mutex<Receiver<RecorderSummary>>>,
    session: Session,
    options: Options,
}

pub(crate) enum Command {
    Arrivals(Vec<Arrival>),
    Records(Vec<Record>),
    Rotate,
    Finish,
}

/// State of the disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DiskState {
    /// Data is written to this file (its final name).
    Writing(PathBuf),
    /// The disk rejects data; a new file is tried at regular intervals.
    Failing {
        /// The last error of the disk.
        reason: String,
    },
    /// The run is closed.
    Closed,
}

/// State of a [`Recorder`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecorderStatus {
    /// State of the disk.
    pub disk: DiskState,
    /// Bytes written in all files.
    pub bytes: u64,
    /// Arrivals and records in the queue of the writer.
    pub waiting: usize,
    /// Data that waits for the disk.
    pub backlog: Backlog,
    /// Whether decoded records are left out, because the disk is nearly full.
    pub raw_only: bool,
    /// Losses of the run on the way to the disk. A replay computes decoded records again.
    pub losses: Losses,
    /// Files that were deleted or renamed while they were being written.
    pub gone: Vec<GoneLog>,
}

/// Data that waits for the disk: it is neither in a log nor in a journal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Backlog {
    /// Raw arrivals.
    pub arrivals: u64,
    /// Their payload, bytes.
    pub bytes: u64,
    /// The log clock's time between the oldest and the newest of them.
    pub span: Duration,
    /// Fill level of the writer's queue, per cent.
    pub queue_fill: u8,
    /// Time for which the disk has not confirmed the written data, beyond the regular interval.
    pub unsynced: Duration,
}

/// A file that was deleted or renamed while it was being written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GoneLog {
    /// Its name while it was being written.
    pub path: PathBuf,
    /// Raw arrivals that are lost with it; 0 if it was renamed.
    pub arrivals: u64,
    /// Whether it was deleted; otherwise it has another name.
    pub deleted: bool,
}

/// Results of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecorderSummary {
    /// Closed files, in order.
    pub files: Vec<Finished>,
    /// Files that could not be closed and wait for recovery.
    pub unfinished: Vec<PathBuf>,
    /// Files that were deleted or renamed while they were being written.
    pub gone: Vec<GoneLog>,
    /// Losses on the way to the disk.
    pub losses: Losses,
    /// Why the files were not closed within [`Options::stop_within`], if they were not.
    pub cut_off: Option<String>,
    /// The last error of the disk, if there was one.
    pub last_failure: Option<String>,
}

/// Progress of a [`Recorder`]; lives longer than the recorder.
#[derive(Clone)]
pub struct Progress(Arc<Shared>);

impl Progress {
    /// A number that rises with each write and with each sync.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.0.steps()
    }
}

impl Recorder {
    /// Begins a run: files `<directory>/<stem>_0000.mcap` and so on.
    ///
    /// # Errors
    /// If the first file cannot be made.
    pub fn start(directory: &Path, stem: &str, session: Session, options: Options) -> Result<Self> {
        Self::start_in(&LossLedger::default(), directory, stem, session, options)
    }

    /// Begins a run that enters its losses in a ledger that exists.
    ///
    /// # Errors
    /// If the first file cannot be made.
    pub fn start_in(
        ledger: &LossLedger,
        directory: &Path,
        stem: &str,
        session: Session,
        options: Options,
    ) -> Result<Self> {
        let (commands, queue) = sync_channel(options.queue_capacity);
        let shared = Arc::new(Shared::new(&options, ledger.account()));
        let files = Files::open(
            directory,
            stem,
            session.clone(),
            options.clone(),
            Arc::clone(&shared),
        )?;
        let (end, ended) = sync_channel(1);
        let of_thread = Arc::clone(&shared);
        std::thread::Builder::new()
            .name("store-write".to_owned())
            .spawn(move || {
                // The receiver may have stopped waiting.
                let _ = end.send(queue::run(files, &queue, &of_thread));
            })
            .map_err(Error::file("start a thread for", directory))?;
        Ok(Self {
            commands,
            shared,
            ended: Some(Mutex::new(ended)),
            session,
            options,
        })
    }

    /// Takes the next arrival of the ordered stream. If the queue is full the arrival is lost and
    /// counted; `false` then.
    pub fn push(&self, arrival: Arrival) -> bool {
        self.push_all(vec![arrival]) == 0
    }

    /// Takes the next arrivals of the ordered stream as one command. Arrivals for which the queue has no
    /// room are lost, from the end, and counted. Returns the number of lost arrivals.
    pub fn push_all(&self, mut arrivals: Vec<Arrival>) -> usize {
        let waiting = self
            .shared
            .waiting
            .fetch_add(arrivals.len(), Ordering::Relaxed);
        self.shared.enter(&arrivals);
        let room = self.shared.capacity.saturating_sub(waiting);
        let mut lost = arrivals.split_off(room.min(arrivals.len()));
        if !arrivals.is_empty()
            && let Err(
                TrySendError::Full(Command::Arrivals(refused))
                | TrySendError::Disconnected(Command::Arrivals(refused)),
            ) = self.commands.try_send(Command::Arrivals(arrivals))
        {
            lost.extend(refused);
        }
        self.shared.waiting.fetch_sub(lost.len(), Ordering::Relaxed);
        for arrival in &lost {
            self.shared.lose(arrival);
        }
        lost.len()
    }

    /// Takes a decoded record, unless [`Options::left_out`] names it. Arrivals have priority: if the queue
    /// is three quarters full, the record is lost and counted.
    pub fn record(&self, record: Record) -> bool {
        self.record_all(vec![record]) == 0
    }

    /// Takes decoded records as one command, as [`Recorder::record`] takes one. Returns the number of lost
    /// records; those at the end are lost.
    pub fn record_all(&self, mut records: Vec<Record>) -> usize {
        records.retain(|record| !self.options.leaves_out(record));
        let count = records.len();
        if count == 0 {
            return 0;
        }
        let waiting = self.shared.waiting.fetch_add(count, Ordering::Relaxed);
        self.shared.enter_tally(&Tally::records(count as u64));
        let limit = self.shared.capacity - self.shared.capacity / 4;
        records.truncate(limit.saturating_sub(waiting));
        let room = records.len();
        let is_taken = room > 0 && self.commands.try_send(Command::Records(records)).is_ok();
        let lost = if is_taken { count - room } else { count };
        if lost > 0 {
            self.shared.waiting.fetch_sub(lost, Ordering::Relaxed);
            self.shared.lose_tally(&Tally::records(lost as u64));
        }
        lost
    }

    /// Continues in a new file, without a gap.
    pub fn rotate(&self) {
        // If the queue is full, the thread reads the flag later.
        self.shared.rotate.store(true, Ordering::Relaxed);
        let _ = self.commands.try_send(Command::Rotate);
    }

    /// Arrivals and records that wait for the writer.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.shared.waiting.load(Ordering::Relaxed)
    }

    /// The state of the recorder.
    #[must_use]
    pub fn status(&self) -> RecorderStatus {
        let waiting = self.shared.waiting.load(Ordering::Relaxed);
        RecorderStatus {
            disk: self.shared.state(),
            bytes: self.shared.bytes.load(Ordering::Relaxed),
            waiting,
            backlog: self.shared.backlog(),
            raw_only: self.shared.raw_only.load(Ordering::Relaxed),
            losses: self.shared.ledger.losses(),
            gone: self.shared.summary().gone,
        }
    }

    /// The progress, for a caller that watches the recorder while it is closed.
    #[must_use]
    pub fn progress(&self) -> Progress {
        Progress(Arc::clone(&self.shared))
    }

    /// Writes the waiting data, closes the file, and ends the threads. Takes at most
    /// [`Options::stop_within`]; see [`Recorder::finish_by`].
    ///
    /// # Errors
    /// If the writer's thread has ended early. The summary reports errors of the disk.
    pub fn finish(self) -> Result<RecorderSummary> {
        let stop_within = self.options.stop_within;
        self.finish_by(stop::deadline(stop_within))
    }

    /// Writes the waiting data, closes the file, and ends the threads, until `deadline`. Data that is not
    /// written shortly before the deadline is counted as lost and stated in a file beside the log (see
    /// [`crate::losses_path`]). The log then keeps its unfinished name, and the threads, which wait for
    /// the disk, continue without the caller.
    ///
    /// # Errors
    /// If the writer's thread has ended early. The summary reports errors of the disk.
    pub fn finish_by(mut self, deadline: Instant) -> Result<RecorderSummary> {
        self.stop(deadline).unwrap_or(Err(Error::WriterGone))
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if let Some(Err(error)) = self.stop(stop::deadline(self.options.stop_within)) {
            tracing::error!(%error, "the log was not closed");
        }
    }
}
