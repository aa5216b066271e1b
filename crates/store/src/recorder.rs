//! The recorder's own threads: one compresses and writes, one syncs.

#![allow(
    clippy::disallowed_types,
    reason = "the recorder's threads time the disk: when to sync, when to try again; they stamp nothing"
)]

mod losses_file;
mod open_file;
mod shared;
mod stop;
mod sync;
mod worker;

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use sample::Arrival;

use crate::{Error, Finished, LossLedger, Losses, Options, Record, Result, Session};
pub(crate) use losses_file::read as read_losses;
pub(crate) use shared::Shared;
use shared::Tally;
use worker::Worker;

/// Writes a run of log files on threads of its own. Feeding it never blocks: what cannot be taken
/// is counted.
///
/// [`Recorder::status`] reports a disk that fails; arrivals are kept as far as
/// [`Options::backlog_capacity`] goes, and a new file is tried until one can be written.
pub struct Recorder {
    commands: SyncSender<Command>,
    shared: Arc<Shared>,
    /// Gives the summary when the worker has ended; `None` once it is asked for.
    ended: Option<Mutex<Receiver<RecorderSummary>>>,
    session: Session,
    stop_within: Duration,
}

pub(crate) enum Command {
    Arrivals(Vec<Arrival>),
    Record(Box<Record>),
    Rotate,
    Finish,
}

/// How the disk does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DiskState {
    /// Data go to this file (its final name).
    Writing(PathBuf),
    /// The disk refuses; a new file is tried again and again.
    Failing {
        /// The disk's last answer.
        reason: String,
    },
    /// The run is closed.
    Closed,
}

/// What a [`Recorder`] says about itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecorderStatus {
    /// How the disk does.
    pub disk: DiskState,
    /// Bytes written in all files.
    pub bytes: u64,
    /// Arrivals and records in the queue of the writer.
    pub waiting: usize,
    /// What waits for the disk.
    pub backlog: Backlog,
    /// Whether decoded records are left out, because the disk is nearly full.
    pub raw_only: bool,
    /// What the run lost on the way to the disk. Decoded records can be computed again by a replay.
    pub losses: Losses,
    /// Files that were deleted or renamed while they were being written.
    pub gone: Vec<GoneLog>,
}

/// What waits for the disk: it is neither in a log nor in a log's journal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Backlog {
    /// Raw arrivals.
    pub arrivals: u64,
    /// Their payload, bytes.
    pub bytes: u64,
    /// The log clock's time between the oldest and the newest of them.
    pub span: Duration,
    /// Per cent of the writer's queue that are taken.
    pub queue_fill: u8,
    /// How long the disk has not confirmed what was written, beyond the regular interval.
    pub unsynced: Duration,
}

/// A file that was deleted or renamed while it was being written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GoneLog {
    /// Its name while it was being written.
    pub path: PathBuf,
    /// Raw arrivals that are lost with it; 0 if it was renamed.
    pub arrivals: u64,
    /// Whether it was deleted; otherwise it lies under another name.
    pub deleted: bool,
}

/// What a run left behind.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecorderSummary {
    /// Closed files, in order.
    pub files: Vec<Finished>,
    /// Files that could not be closed and wait for recovery.
    pub unfinished: Vec<PathBuf>,
    /// Files that were deleted or renamed while they were being written.
    pub gone: Vec<GoneLog>,
    /// What was lost on the way to the disk.
    pub losses: Losses,
    /// Why the files were not closed within [`Options::stop_within`], if they were not.
    pub cut_off: Option<String>,
    /// The disk's last refusal, if there was one.
    pub last_failure: Option<String>,
}

/// How far a [`Recorder`] is; outlives it.
#[derive(Clone)]
pub struct Progress(Arc<Shared>);

impl Progress {
    /// A number that rises with each piece of data that is written and with each sync.
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
        let stop_within = options.stop_within;
        let worker = Worker::open(
            directory,
            stem,
            session.clone(),
            options,
            Arc::clone(&shared),
        )?;
        let (end, ended) = sync_channel(1);
        std::thread::Builder::new()
            .name("store-write".to_owned())
            .spawn(move || {
                // Who asked may have given up.
                let _ = end.send(worker.run(&queue));
            })
            .map_err(Error::file("start a thread for", directory))?;
        Ok(Self {
            commands,
            shared,
            ended: Some(Mutex::new(ended)),
            session,
            stop_within,
        })
    }

    /// Takes the next arrival of the ordered stream. If the queue is full the arrival is lost and
    /// counted; `false` then.
    pub fn push(&self, arrival: Arrival) -> bool {
        self.push_all(vec![arrival]) == 0
    }

    /// Takes the next arrivals of the ordered stream, at the price of one. What the queue has no
    /// room for is lost, from the end, and counted; says how many arrivals that were.
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

    /// Takes a decoded record. Records make way for arrivals: they are lost, and counted, when the
    /// queue is three quarters full.
    pub fn record(&self, record: Record) -> bool {
        let waiting = self.shared.waiting.fetch_add(1, Ordering::Relaxed);
        self.shared.enter_tally(&Tally::records(1));
        let room = waiting < self.shared.capacity - self.shared.capacity / 4;
        let taken = room
            && self
                .commands
                .try_send(Command::Record(Box::new(record)))
                .is_ok();
        if !taken {
            self.shared.waiting.fetch_sub(1, Ordering::Relaxed);
            self.shared.lose_tally(&Tally::records(1));
        }
        taken
    }

    /// Goes on in a new file, without a gap.
    pub fn rotate(&self) {
        // A full queue will be seen to sooner or later: the flag waits for it.
        self.shared.rotate.store(true, Ordering::Relaxed);
        let _ = self.commands.try_send(Command::Rotate);
    }

    /// Arrivals and records that wait for the writer.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.shared.waiting.load(Ordering::Relaxed)
    }

    /// How it does.
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

    /// How far it is, for somebody who watches while it is closed.
    #[must_use]
    pub fn progress(&self) -> Progress {
        Progress(Arc::clone(&self.shared))
    }

    /// Writes what waits, closes the file, and ends the threads. Takes [`Options::stop_within`] at
    /// most; see [`Recorder::finish_by`].
    ///
    /// # Errors
    /// If the writer's thread is gone. The summary reports a disk that refused.
    pub fn finish(self) -> Result<RecorderSummary> {
        let stop_within = self.stop_within;
        self.finish_by(stop::deadline(stop_within))
    }

    /// Writes what waits, closes the file, and ends the threads, until `deadline`. What is not
    /// written shortly before it is counted as lost and stated in a file beside the log (see
    /// [`crate::losses_path`]); the log keeps its unfinished name, and the threads, which wait for the
    /// disk, are left behind.
    ///
    /// # Errors
    /// If the writer's thread is gone. The summary reports a disk that refused.
    pub fn finish_by(mut self, deadline: Instant) -> Result<RecorderSummary> {
        self.stop(deadline).unwrap_or(Err(Error::WriterGone))
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if let Some(Err(error)) = self.stop(stop::deadline(self.stop_within)) {
            tracing::error!(%error, "the log was not closed");
        }
    }
}
