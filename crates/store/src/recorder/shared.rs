//! State that the threads of the recorder share with its callers.

use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use sample::{Arrival, LogTime, Payload};

use super::files::UnsyncedData;
use super::{Backlog, DiskState, RecorderSummary};
use crate::{LossLedger, Losses, Options};

/// State that the threads of the recorder share with its callers.
pub(crate) struct Shared {
    pub capacity: usize,
    pub waiting: AtomicUsize,
    pub bytes: AtomicU64,
    pub rotate: AtomicBool,
    /// Decoded records are left out, because the disk is nearly full.
    pub raw_only: AtomicBool,
    /// The account of this run.
    pub ledger: LossLedger,
    steps: AtomicU64,
    sync_interval: Duration,
    /// Time of the last confirmation by the disk.
    synced_at: Mutex<Instant>,
    open: Mutex<Open>,
    returned: Mutex<Option<UnsyncedData>>,
    summary: Mutex<RecorderSummary>,
    /// Losses that closed files state.
    stated: Mutex<Losses>,
    given_up: AtomicBool,
    state: Mutex<DiskState>,
}

/// Data that was taken and is neither in a log, nor in a journal, nor counted as lost.
#[derive(Debug, Default)]
struct Open {
    /// Losses if it were lost.
    losses: Losses,
    bytes: u64,
    newest: LogTime,
    /// Log clock of the newest arrival that is in a log or in a journal.
    written: LogTime,
    /// It is counted as lost, and nothing changes it any more.
    closed: bool,
}

/// Arrivals and records on the way to the disk, with the losses if they were lost.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    pub losses: Losses,
    bytes: u64,
    newest: LogTime,
}

impl Tally {
    pub(crate) fn add(&mut self, arrival: &Arrival) {
        self.losses.add_arrival(arrival);
        self.bytes += bytes_of(arrival);
        self.newest = self.newest.max(arrival.log_time);
    }

    pub(crate) fn records(records: u64) -> Self {
        let mut tally = Self::default();
        tally.losses.records = records;
        tally
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        self.losses.add(&other.losses);
        self.bytes += other.bytes;
        self.newest = self.newest.max(other.newest);
    }

    /// The difference to the earlier tally `before`.
    pub(crate) fn since(&self, before: &Self) -> Self {
        Self {
            losses: self.losses.since(&before.losses),
            bytes: self.bytes.saturating_sub(before.bytes),
            newest: self.newest,
        }
    }

    pub(crate) fn of<'a>(arrivals: impl IntoIterator<Item = &'a Arrival>) -> Self {
        let mut tally = Self::default();
        arrivals.into_iter().for_each(|arrival| tally.add(arrival));
        tally
    }
}

fn bytes_of(arrival: &Arrival) -> u64 {
    match &arrival.payload {
        Payload::Bytes(bytes) => bytes.len() as u64,
        Payload::Can(frames) => frames.iter().map(|frame| frame.bytes().len() as u64).sum(),
        Payload::Tick | Payload::Notice(_) => 0,
    }
}

impl Open {
    fn remove(&mut self, tally: &Tally) {
        self.losses = self.losses.since(&tally.losses);
        self.bytes = self.bytes.saturating_sub(tally.bytes);
    }
}

impl Shared {
    pub(crate) fn new(options: &Options, ledger: LossLedger) -> Self {
        Self {
            capacity: options.queue_capacity,
            waiting: AtomicUsize::new(0),
            bytes: AtomicU64::new(0),
            rotate: AtomicBool::new(false),
            raw_only: AtomicBool::new(false),
            ledger,
            steps: AtomicU64::new(0),
            sync_interval: options.sync_interval,
            synced_at: Mutex::new(Instant::now()),
            open: Mutex::default(),
            returned: Mutex::default(),
            summary: Mutex::default(),
            stated: Mutex::default(),
            given_up: AtomicBool::new(false),
            state: Mutex::new(DiskState::Closed),
        }
    }

    /// Adds arrivals that are on the way to the disk.
    pub(crate) fn enter(&self, arrivals: &[Arrival]) {
        self.enter_tally(&Tally::of(arrivals));
    }

    pub(crate) fn enter_tally(&self, tally: &Tally) {
        let mut open = lock(&self.open);
        open.losses.add(&tally.losses);
        open.bytes += tally.bytes;
        open.newest = open.newest.max(tally.newest);
        if open.written == LogTime::default() {
            open.written = open.newest;
        }
    }

    /// Removes arrivals and records that are now in a log or in its journal.
    pub(crate) fn written(&self, tally: &Tally) {
        let mut open = lock(&self.open);
        if !open.closed {
            open.remove(tally);
            open.written = open.written.max(tally.newest);
        }
        drop(open);
        self.step();
    }

    /// Counts an arrival that was on the way to the disk as lost.
    pub(crate) fn lose(&self, arrival: &Arrival) {
        self.lose_tally(&Tally::of([arrival]));
    }

    /// Counts arrivals that were on the way to the disk as lost.
    pub(crate) fn lose_tally(&self, tally: &Tally) {
        let mut open = lock(&self.open);
        if !open.closed {
            open.remove(tally);
            self.ledger.enter_unwritten(&tally.losses);
        }
    }

    /// Counts everything that is on the way to the disk as lost, finally, and returns these losses.
    pub(crate) fn give_up(&self) -> Losses {
        let mut open = lock(&self.open);
        self.given_up.store(true, Ordering::Release);
        open.closed = true;
        open.bytes = 0;
        let losses = std::mem::take(&mut open.losses);
        self.ledger.enter_unwritten(&losses);
        losses
    }

    /// Whether everything that was on the way to the disk is counted as lost.
    pub(crate) fn has_given_up(&self) -> bool {
        self.given_up.load(Ordering::Acquire)
    }

    pub(crate) fn backlog(&self) -> Backlog {
        let unsynced = lock(&self.synced_at).elapsed();
        let waiting = self.waiting.load(Ordering::Relaxed);
        let fill = waiting.saturating_mul(100) / self.capacity.max(1);
        let open = lock(&self.open);
        let span_ns = match open.losses.arrivals {
            0 => 0,
            _ => (open.newest - open.written).max(0),
        };
        Backlog {
            arrivals: open.losses.arrivals,
            bytes: open.bytes,
            span: Duration::from_nanos(span_ns.unsigned_abs()),
            queue_fill: u8::try_from(fill.min(100)).unwrap_or(100),
            unsynced: unsynced.saturating_sub(self.sync_interval),
        }
    }

    /// The disk has confirmed the written data, or there is nothing to confirm.
    pub(crate) fn synced(&self) {
        *lock(&self.synced_at) = Instant::now();
        self.step();
    }

    fn step(&self) {
        self.steps.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn steps(&self) -> u64 {
        self.steps.load(Ordering::Relaxed)
    }

    /// Returns arrivals of a closed log that did not reach the disk.
    pub(crate) fn return_unsynced(&self, reason: String, arrivals: Vec<Arrival>) {
        let mut returned = lock(&self.returned);
        match returned.as_mut() {
            Some(before) => before.arrivals.extend(arrivals),
            None => *returned = Some(UnsyncedData { reason, arrivals }),
        }
    }

    pub(crate) fn take_unsynced(&self) -> Option<UnsyncedData> {
        lock(&self.returned).take()
    }

    pub(crate) fn taken(&self) {
        self.waiting.fetch_sub(1, Ordering::Relaxed);
    }

    pub(crate) fn state(&self) -> DiskState {
        lock(&self.state).clone()
    }

    pub(crate) fn set_state(&self, state: DiskState) {
        *lock(&self.state) = state;
    }

    /// The results of the run so far.
    pub(crate) fn summary(&self) -> RecorderSummary {
        lock(&self.summary).clone()
    }

    /// Losses that closed files state.
    pub(crate) fn stated(&self) -> Losses {
        lock(&self.stated).clone()
    }

    pub(crate) fn set_stated(&self, losses: &Losses) {
        lock(&self.stated).clone_from(losses);
    }

    pub(crate) fn set_summary(&self, summary: &RecorderSummary) {
        lock(&self.summary).clone_from(summary);
    }
}

fn lock<T>(value: &Mutex<T>) -> MutexGuard<'_, T> {
    value.lock().unwrap_or_else(PoisonError::into_inner)
}
