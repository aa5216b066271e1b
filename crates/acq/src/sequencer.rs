//! Where all sources meet: stamps, numbers and hands on every arrival in one critical section.

mod state;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use sample::{Arrival, LogTime, Notice, Payload, SourceId};
use store::LossLedger;
use tokio::sync::mpsc;

use crate::{LogClock, RingLimits};
use state::State;

/// How many arrivals each consumer may lag behind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QueueSizes {
    /// Arrivals between the sources and the recorder.
    pub recorder: usize,
    /// Arrivals between the sources and the estimator; 0 means that there is none.
    pub estimator: usize,
}

impl Default for QueueSizes {
    /// Half a second of four full CAN buses for the recorder when every frame comes alone, and half
    /// a minute when the sources lag and frames come 64 at a time; a quarter of it for the
    /// estimator. Memory is bounded by 7 KiB an arrival.
    fn default() -> Self {
        Self {
            recorder: 16_384,
            estimator: 4_096,
        }
    }
}

/// The consumers' ends of the queues. `recv` is for tasks, `blocking_recv` for threads; both end
/// with `None` after [`Sequencer::finish`], [`Sequencer::pause`] or the next [`Sequencer::begin`].
#[derive(Debug)]
pub struct Streams {
    /// What both take before their queues: the states that last, then what was kept in memory.
    pub backlog: Vec<Arc<Arrival>>,
    /// For the recorder.
    pub recorder: mpsc::Receiver<Arc<Arrival>>,
    /// For the estimator; `None` if its queue has size 0.
    pub estimator: Option<mpsc::Receiver<Arc<Arrival>>>,
}

/// What has come from one source so far.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SourceCounters {
    /// Arrivals, notices included.
    pub arrivals: u64,
    /// Frames on CAN, reads on serial ports.
    pub items: u64,
    /// Payload bytes.
    pub bytes: u64,
    /// When data last came.
    pub last_data: Option<LogTime>,
    /// Whether the device is open.
    pub open: bool,
    /// What the last `Opened` or `Closed` notice said.
    pub state: String,
}

/// Gives every arrival its sequence number and stamps and pushes it to the recorder and to the
/// estimator. Clones share one stream.
///
/// Number and stamp are taken under one lock, so the order of `sequence` is the order of
/// `log_time`. A full queue never blocks: the arrival is left out for that consumer alone.
/// - Recorder: items are counted by source, and [`Notice::Lost`] tells so when there is room
///   again; the gap in `sequence` says where.
/// - Estimator: once full it is left alone until half of its queue is free, then
///   [`Notice::EstimatorSkipped`] tells both consumers which arrivals it did not see.
///
/// The stream outlives its consumers: [`Sequencer::begin`] hands it over to new ones between two
/// arrivals, and after [`Sequencer::pause`] it goes on without any. [`Sequencer::listen`] gives
/// what comes in any case, and [`Sequencer::keep`] keeps the last of it for the next beginning.
#[derive(Clone, Debug)]
pub struct Sequencer {
    clock: LogClock,
    state: Arc<Mutex<State>>,
}

impl Sequencer {
    /// A stream that starts at sequence 0, and its consumers' ends.
    #[must_use]
    pub fn new(clock: LogClock, sizes: QueueSizes) -> (Self, Streams) {
        let sequencer = Self::idle(clock);
        let streams = sequencer.begin(sizes, None, &BTreeMap::new());
        (sequencer, streams)
    }

    /// A stream that starts at sequence 0 and has no consumers yet.
    #[must_use]
    pub fn idle(clock: LogClock) -> Self {
        Self {
            clock,
            state: Arc::new(Mutex::new(State::default())),
        }
    }

    /// Hands the stream over to new consumers, between two arrivals: those of before get everything
    /// up to here, as with [`Sequencer::finish`], the new ones everything from here on. Before that
    /// they get, as a backlog, the states that last and what is kept in memory from `since` on.
    ///
    /// `numbers`, from [`crate::Supervisor::numbers`], gives sources other numbers from here on;
    /// memory of before is then forgotten. Empty, it changes nothing.
    #[must_use]
    pub fn begin(
        &self,
        sizes: QueueSizes,
        since: Option<LogTime>,
        numbers: &BTreeMap<SourceId, Option<SourceId>>,
    ) -> Streams {
        let mut state = self.lock();
        state.end(&self.clock);
        state.renumber(numbers);
        state.begin(&self.clock, sizes, since)
    }

    /// What was started with the number `started` has the number `number` from here on.
    pub(crate) fn assign(&self, started: SourceId, number: SourceId) {
        self.lock().assign(started, number);
    }

    /// Ends what the consumers get, as [`Sequencer::finish`] does, and goes on without: what comes
    /// from here on is not recorded, and not lost.
    pub fn pause(&self) {
        let mut state = self.lock();
        state.end(&self.clock);
        state.pause();
    }

    /// Gives sources other numbers, as [`Sequencer::begin`] does, while nobody records.
    pub fn renumber(&self, numbers: &BTreeMap<SourceId, Option<SourceId>>) {
        self.lock().renumber(numbers);
    }

    /// Keeps the last of the stream in memory.
    pub fn keep(&self, limits: RingLimits) {
        self.lock().keep(limits);
    }

    /// The instant of the oldest arrival that is kept in memory.
    #[must_use]
    pub fn kept_since(&self) -> Option<LogTime> {
        self.lock().kept_since()
    }

    /// Everything from here on, whether somebody records or not. What does not fit into the queue
    /// is left out for this listener alone; [`Sequencer::missed`] counts it.
    #[must_use]
    pub fn listen(&self, capacity: usize) -> mpsc::Receiver<Arc<Arrival>> {
        self.lock().listen(capacity.max(1))
    }

    /// Arrivals that listeners had no room for.
    #[must_use]
    pub fn missed(&self) -> u64 {
        self.lock().missed()
    }

    /// Takes what `source` delivered into the stream and returns its stamp.
    pub fn push(&self, source: SourceId, payload: Payload) -> LogTime {
        let mut state = self.lock();
        state.settle(&self.clock);
        state.enter_loss(source, &payload);
        state.emit(&self.clock, source, payload)
    }

    /// Takes a notice into the stream.
    pub fn notice(&self, source: SourceId, notice: Notice) -> LogTime {
        self.push(source, Payload::Notice(notice))
    }

    /// Takes a person's or program's mark into the stream and returns the instant it stands for.
    pub fn mark(&self, text: &str) -> LogTime {
        self.notice(SourceId::HOST, Notice::Mark(text.to_owned()))
    }

    /// The clock that stamps the stream.
    #[must_use]
    pub const fn clock(&self) -> &LogClock {
        &self.clock
    }

    /// The ledger of losses: what sources and queues lost is entered here, and recorders may enter
    /// what does not reach the disk.
    #[must_use]
    pub fn ledger(&self) -> LossLedger {
        self.lock().ledger().clone()
    }

    /// What has come so far, by source.
    #[must_use]
    pub fn counters(&self) -> BTreeMap<SourceId, SourceCounters> {
        self.lock().counters().clone()
    }

    /// Sequence number of the next arrival: how many there were.
    #[must_use]
    pub fn next_sequence(&self) -> u64 {
        self.lock().next_sequence()
    }

    /// Ends the stream: writes the notices that were waiting for room, then closes both queues.
    /// Call it after [`crate::Supervisor::stop`]. What is pushed later is counted as lost.
    pub fn finish(&self) {
        let mut state = self.lock();
        state.end(&self.clock);
        state.forget_listeners();
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests;
