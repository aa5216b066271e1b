//! The recorder's own threads: one compresses and writes, one syncs.

#![allow(
    clippy::disallowed_types,
    reason = "the recorder's threads time the disk: when to sync, when to try again; they stamp nothing"
)]

mod open_file;
mod sync;
mod worker;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

use sample::{Arrival, LossPlace, Notice, Payload, SourceId};

use crate::{Error, Finished, Options, Record, Result, Session};
use sync::Returned;
use worker::Worker;

/// Writes a run of log files on threads of its own. Feeding it never blocks: what cannot be taken
/// is counted.
///
/// A disk that fails is told by [`Recorder::status`]; what was on its way is kept as far as
/// [`Options::backlog_capacity`] goes, and a new file is tried until one can be written.
pub struct Recorder {
    commands: SyncSender<Command>,
    shared: Arc<Shared>,
    worker: Option<JoinHandle<RecorderSummary>>,
}

pub(crate) enum Command {
    Arrivals(Vec<Arrival>),
    Record(Box<Record>),
    Rotate,
    Finish,
}

/// What the recorder's threads share with those who ask.
pub(crate) struct Shared {
    capacity: usize,
    waiting: AtomicUsize,
    pub bytes: AtomicU64,
    pub dropped_records: AtomicU64,
    pub rotate: AtomicBool,
    returned: Mutex<Option<Returned>>,
    lost: Mutex<Lost>,
    state: Mutex<DiskState>,
}

#[derive(Default)]
struct Lost {
    arrivals: u64,
    items: LostItems,
}

/// Items lost, by source and place.
pub(crate) type LostItems = BTreeMap<(SourceId, LossPlace), u64>;

/// Those that were lost on the way to the disk.
fn on_disk(items: &LostItems) -> BTreeMap<SourceId, u64> {
    let on_disk = items
        .iter()
        .filter(|((_, place), _)| *place == LossPlace::Disk);
    on_disk
        .map(|((source, _), count)| (*source, *count))
        .collect()
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
    /// Arrivals and records that wait for the writer.
    pub waiting: usize,
    /// Raw arrivals lost on the way to the disk.
    pub lost_arrivals: u64,
    /// Items in them, by source: frames on CAN, reads on serial ports.
    pub lost_items: BTreeMap<SourceId, u64>,
    /// Decoded records lost on the way to the disk; a replay makes them again.
    pub lost_records: u64,
}

/// What a run left behind.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecorderSummary {
    /// Closed files, in order.
    pub files: Vec<Finished>,
    /// Files that could not be closed and wait for recovery.
    pub unfinished: Vec<PathBuf>,
    /// Raw arrivals lost on the way to the disk.
    pub lost_arrivals: u64,
    /// Items in them, by source: frames on CAN, reads on serial ports.
    pub lost_items: BTreeMap<SourceId, u64>,
    /// Decoded records lost on the way to the disk.
    pub lost_records: u64,
    /// The disk's last refusal, if there was one.
    pub last_failure: Option<String>,
}

impl Recorder {
    /// Begins a run: files `<directory>/<stem>_0000.mcap` and so on.
    ///
    /// # Errors
    /// If the first file cannot be made.
    pub fn start(directory: &Path, stem: &str, session: Session, options: Options) -> Result<Self> {
        let (commands, queue) = sync_channel(options.queue_capacity);
        let shared = Arc::new(Shared::new(options.queue_capacity));
        let worker = Worker::open(directory, stem, session, options, Arc::clone(&shared))?;
        let worker = std::thread::Builder::new()
            .name("store-write".to_owned())
            .spawn(move || worker.run(&queue))
            .map_err(Error::file("start a thread for", directory))?;
        Ok(Self {
            commands,
            shared,
            worker: Some(worker),
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
        let room = waiting < self.shared.capacity - self.shared.capacity / 4;
        let taken = room
            && self
                .commands
                .try_send(Command::Record(Box::new(record)))
                .is_ok();
        if !taken {
            self.shared.waiting.fetch_sub(1, Ordering::Relaxed);
            self.shared.dropped_records.fetch_add(1, Ordering::Relaxed);
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
        let lost = self
            .shared
            .lost
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        RecorderStatus {
            disk: self.shared.state(),
            bytes: self.shared.bytes.load(Ordering::Relaxed),
            waiting: self.shared.waiting.load(Ordering::Relaxed),
            lost_arrivals: lost.arrivals,
            lost_items: on_disk(&lost.items),
            lost_records: self.shared.dropped_records.load(Ordering::Relaxed),
        }
    }

    /// Writes what waits, closes the file, and ends the threads. Blocks until all is on the disk.
    ///
    /// # Errors
    /// If the writer's thread is gone. A disk that refused is told by the summary.
    pub fn finish(mut self) -> Result<RecorderSummary> {
        self.stop().unwrap_or(Err(Error::WriterGone))
    }

    fn stop(&mut self) -> Option<Result<RecorderSummary>> {
        let worker = self.worker.take()?;
        // Blocks while the queue is full: the worker empties it whatever the disk does.
        let _ = self.commands.send(Command::Finish);
        Some(worker.join().map_err(|_| Error::WriterGone))
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if let Some(Err(error)) = self.stop() {
            tracing::error!(%error, "the log was not closed");
        }
    }
}

impl Shared {
    fn new(capacity: usize) -> Self {
        Self {
            capacity,
            waiting: AtomicUsize::new(0),
            bytes: AtomicU64::new(0),
            dropped_records: AtomicU64::new(0),
            rotate: AtomicBool::new(false),
            returned: Mutex::new(None),
            lost: Mutex::default(),
            state: Mutex::new(DiskState::Closed),
        }
    }

    pub(crate) fn lose(&self, arrival: &Arrival) {
        let (place, items) = match &arrival.payload {
            Payload::Can(frames) => (LossPlace::Disk, frames.len() as u64),
            Payload::Bytes(_) => (LossPlace::Disk, 1),
            // What it told of is not forgotten with it. Losses on the way to the disk are counted
            // here anyhow.
            Payload::Notice(Notice::Lost { place, count }) if *place != LossPlace::Disk => {
                (*place, *count)
            }
            Payload::Tick | Payload::Notice(_) => (LossPlace::Disk, 0),
        };
        let mut lost = self.lost.lock().unwrap_or_else(PoisonError::into_inner);
        lost.arrivals += 1;
        if items > 0 {
            *lost.items.entry((arrival.source, place)).or_default() += items;
        }
    }

    pub(crate) fn lost(&self) -> (u64, LostItems) {
        let lost = self.lost.lock().unwrap_or_else(PoisonError::into_inner);
        (lost.arrivals, lost.items.clone())
    }

    /// These arrivals did not reach the disk in a log that is closed.
    fn give_back(&self, reason: String, arrivals: Vec<Arrival>) {
        let mut returned = self.returned.lock().unwrap_or_else(PoisonError::into_inner);
        match returned.as_mut() {
            Some(before) => before.arrivals.extend(arrivals),
            None => *returned = Some(Returned { reason, arrivals }),
        }
    }

    fn take_returned(&self) -> Option<Returned> {
        self.returned
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take()
    }

    pub(crate) fn taken(&self) {
        self.waiting.fetch_sub(1, Ordering::Relaxed);
    }

    pub(crate) fn state(&self) -> DiskState {
        self.state
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    pub(crate) fn set_state(&self, state: DiskState) {
        *self.state.lock().unwrap_or_else(PoisonError::into_inner) = state;
    }
}
