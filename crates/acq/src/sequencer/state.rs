//! What the sequencer's lock guards: numbers, counters, and what each consumer has no room for.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use sample::{Arrival, LogTime, LossPlace, Notice, Payload, SourceId};
use store::LossLedger;
use tokio::sync::mpsc::{self, error::TrySendError};

use super::{QueueSizes, RingLimits, SourceCounters, Streams};
use crate::LogClock;
use crate::ring::Ring;

/// Places in the recorder's queue that only notices may take, so that what is said about a loss
/// is not lost with it.
pub(super) const NOTICE_RESERVE: usize = 64;

/// Runs of arrivals that the estimator skipped and the recorder has had no room to hear of yet.
/// Older ones are merged into an error in the program's own log.
const UNRECORDED_RUNS_MAX: usize = 64;

#[derive(Debug)]
pub(super) struct State {
    next_sequence: u64,
    sizes: QueueSizes,
    recorder: Option<mpsc::Sender<Arc<Arrival>>>,
    recorder_full: bool,
    unreported: BTreeMap<(SourceId, LossPlace), u64>,
    estimator: Option<mpsc::Sender<Arc<Arrival>>>,
    skipping: Option<Run>,
    unrecorded: VecDeque<Run>,
    counters: BTreeMap<SourceId, SourceCounters>,
    ledger: LossLedger,
    /// Nobody records, and nothing is lost by that.
    paused: bool,
    ring: Ring,
    listeners: Vec<Listener>,
    /// Numbers of the sources that have others than those they were started with; `None` for
    /// sources that are no longer listened to.
    numbers: BTreeMap<SourceId, Option<SourceId>>,
}

#[derive(Debug)]
struct Listener {
    queue: mpsc::Sender<Arc<Arrival>>,
    missed: u64,
}

#[derive(Clone, Copy, Debug)]
struct Run {
    first_sequence: u64,
    count: u64,
}

impl Run {
    const fn notice(self) -> Payload {
        Payload::Notice(Notice::EstimatorSkipped {
            first_sequence: self.first_sequence,
            count: self.count,
        })
    }
}

impl Default for State {
    fn default() -> Self {
        Self {
            next_sequence: 0,
            sizes: QueueSizes {
                recorder: 1,
                estimator: 0,
            },
            recorder: None,
            recorder_full: false,
            unreported: BTreeMap::new(),
            estimator: None,
            skipping: None,
            unrecorded: VecDeque::new(),
            counters: BTreeMap::new(),
            ledger: LossLedger::default(),
            paused: true,
            ring: Ring::default(),
            listeners: Vec::new(),
            numbers: BTreeMap::new(),
        }
    }
}

impl State {
    /// Hands everything from here on to new consumers, behind what is kept from `since` on.
    pub fn begin(
        &mut self,
        clock: &LogClock,
        sizes: QueueSizes,
        since: Option<LogTime>,
    ) -> Streams {
        self.sizes = QueueSizes {
            recorder: sizes.recorder.max(1),
            ..sizes
        };
        let (recorder, recorder_end) = mpsc::channel(self.sizes.recorder + NOTICE_RESERVE);
        let (estimator, estimator_end) = match sizes.estimator {
            0 => (None, None),
            size => {
                let (sender, receiver) = mpsc::channel(size);
                (Some(sender), Some(receiver))
            }
        };
        self.recorder = Some(recorder);
        self.estimator = estimator;
        self.paused = false;
        Streams {
            backlog: self.ring.since(since, self.next_sequence, clock.read()),
            recorder: recorder_end,
            estimator: estimator_end,
        }
    }

    pub fn pause(&mut self) {
        self.paused = true;
    }

    pub fn assign(&mut self, started: SourceId, number: SourceId) {
        self.numbers.insert(started, Some(number));
    }

    pub fn keep(&mut self, limits: RingLimits) {
        self.ring.set_limits(limits);
    }

    pub fn kept_since(&self) -> Option<LogTime> {
        self.ring.first_time()
    }

    pub fn listen(&mut self, capacity: usize) -> mpsc::Receiver<Arc<Arrival>> {
        let (queue, end) = mpsc::channel(capacity);
        self.listeners.push(Listener { queue, missed: 0 });
        end
    }

    pub fn forget_listeners(&mut self) {
        self.listeners.clear();
    }

    pub fn missed(&self) -> u64 {
        self.listeners.iter().map(|l| l.missed).sum()
    }

    pub const fn counters(&self) -> &BTreeMap<SourceId, SourceCounters> {
        &self.counters
    }

    pub const fn ledger(&self) -> &LossLedger {
        &self.ledger
    }

    /// Enters what a source's notice states into the ledger. Losses in a queue or on the way to the
    /// disk are entered where they happen, before a notice states them.
    pub fn enter_loss(&self, source: SourceId, payload: &Payload) {
        if let Payload::Notice(Notice::Lost { place, count }) = payload
            && matches!(place, LossPlace::Device | LossPlace::Kernel)
            && let Some(number) = self.number(source)
        {
            self.ledger.enter_items(number, *place, *count);
        }
    }

    /// The number of a source; `None` if nobody listens to it any more.
    fn number(&self, started: SourceId) -> Option<SourceId> {
        self.numbers.get(&started).copied().unwrap_or(Some(started))
    }

    pub const fn next_sequence(&self) -> u64 {
        self.next_sequence
    }

    /// Writes the notices that waited for room and closes the consumers' queues.
    pub fn end(&mut self, clock: &LogClock) {
        self.report_losses(clock);
        self.report_skips(clock);
        self.estimator = None;
        if let Some(run) = self.skipping.take() {
            // The estimator does not get this notice either, so the notice covers itself.
            let run = Run {
                count: run.count + 1,
                ..run
            };
            self.emit(clock, SourceId::HOST, run.notice());
        }
        self.recorder = None;
        self.recorder_full = false;
        self.unreported.clear();
        self.unrecorded.clear();
    }

    pub fn renumber(&mut self, numbers: &BTreeMap<SourceId, Option<SourceId>>) {
        if numbers.is_empty() {
            return;
        }
        let before = std::mem::take(&mut self.numbers);
        let mut states = BTreeMap::new();
        let mut counters = BTreeMap::new();
        for (started, number) in numbers {
            let old = before.get(started).copied().unwrap_or(Some(*started));
            let Some((old, new)) = old.zip(*number) else {
                continue;
            };
            states.insert(old, new);
            counters.extend(self.counters.remove(&old).map(|counters| (new, counters)));
        }
        let host = self.counters.remove(&SourceId::HOST);
        counters.extend(host.map(|counters| (SourceId::HOST, counters)));
        self.counters = counters;
        let mut lost = states.clone();
        lost.insert(SourceId::HOST, SourceId::HOST);
        self.ledger.renumber(&lost);
        self.ring.renumber(&states);
        self.numbers = numbers.clone();
    }

    /// Reports what was left out, where there is room to.
    pub fn settle(&mut self, clock: &LogClock) {
        if self.recorder_full && self.recorder_room() >= self.sizes.recorder.div_ceil(4) {
            self.report_losses(clock);
        }
        let resume = self.sizes.estimator.div_ceil(2);
        let resumes = self.skipping.is_some() && self.estimator_room() >= resume;
        if resumes || !self.unrecorded.is_empty() {
            self.report_skips(clock);
        }
    }

    fn report_losses(&mut self, clock: &LogClock) {
        self.recorder_full = false;
        while self.notice_room()
            && let Some(((source, place), count)) = self.unreported.pop_first()
        {
            let lost = Notice::Lost { place, count };
            self.emit(clock, source, Payload::Notice(lost));
        }
        self.recorder_full = !self.unreported.is_empty();
    }

    /// Ends the run that the estimator skips, if it has room again, and tells the recorder of all
    /// runs that it has room for.
    fn report_skips(&mut self, clock: &LogClock) {
        if self.estimator_room() >= self.sizes.estimator.div_ceil(2) {
            self.unrecorded.extend(self.skipping.take());
        }
        while self.notice_room()
            && let Some(run) = self.unrecorded.pop_front()
        {
            self.emit(clock, SourceId::HOST, run.notice());
        }
        while self.unrecorded.len() > UNRECORDED_RUNS_MAX {
            let run = self.unrecorded.pop_front();
            tracing::error!(
                ?run,
                "the estimator skipped arrivals, and the recorder's queue is too full to record \
                 which; a replay will not be identical"
            );
        }
    }

    pub fn emit(&mut self, clock: &LogClock, source: SourceId, payload: Payload) -> LogTime {
        let reading = clock.read();
        let Some(source) = self.number(source) else {
            return reading.log_time;
        };
        let sequence = self.next_sequence;
        self.next_sequence += 1;
        let items = self.count(source, &payload, reading.log_time);
        let is_notice = matches!(payload, Payload::Notice(_));
        let arrival = Arc::new(Arrival {
            sequence,
            source,
            log_time: reading.log_time,
            realtime_ns: reading.realtime_ns,
            payload,
        });
        self.ring.push(&arrival);
        self.tell_listeners(&arrival);
        self.offer_estimator(&arrival);
        if !self.paused {
            self.offer_recorder(arrival, items, is_notice);
        }
        reading.log_time
    }

    fn tell_listeners(&mut self, arrival: &Arc<Arrival>) {
        self.listeners.retain_mut(
            |listener| match listener.queue.try_send(Arc::clone(arrival)) {
                Ok(()) => true,
                Err(TrySendError::Full(_)) => {
                    listener.missed += 1;
                    true
                }
                Err(TrySendError::Closed(_)) => false,
            },
        );
    }

    fn offer_recorder(&mut self, arrival: Arc<Arrival>, items: u64, is_notice: bool) {
        let source = arrival.source;
        let stated = match arrival.payload {
            Payload::Notice(Notice::Lost { place, count }) => Some((place, count)),
            _ => None,
        };
        let admitted = is_notice || (!self.recorder_full && self.recorder_room() > 0);
        let sent = admitted
            && self
                .recorder
                .as_ref()
                .is_some_and(|queue| queue.try_send(arrival).is_ok());
        if sent {
            return;
        }
        self.recorder_full = true;
        let unreported = match stated {
            None if items == 0 => return,
            None => {
                self.ledger.enter_items(source, LossPlace::Queue, items);
                (LossPlace::Queue, items)
            }
            // The notice is written when there is room again.
            Some(stated) => stated,
        };
        *self.unreported.entry((source, unreported.0)).or_default() += unreported.1;
    }

    fn offer_estimator(&mut self, arrival: &Arc<Arrival>) {
        if let Some(run) = &mut self.skipping {
            run.count += 1;
            return;
        }
        let Some(queue) = &self.estimator else {
            return;
        };
        if queue.try_send(Arc::clone(arrival)).is_err() {
            self.skipping = Some(Run {
                first_sequence: arrival.sequence,
                count: 1,
            });
        }
    }

    /// Whether the recorder's queue takes a notice.
    fn notice_room(&self) -> bool {
        self.recorder
            .as_ref()
            .is_some_and(|queue| queue.capacity() > 0)
    }

    /// Free places for data in the recorder's queue.
    fn recorder_room(&self) -> usize {
        self.recorder
            .as_ref()
            .map_or(0, |queue| queue.capacity().saturating_sub(NOTICE_RESERVE))
    }

    /// Free places in the estimator's queue; none once its end is dropped.
    fn estimator_room(&self) -> usize {
        match &self.estimator {
            Some(queue) if !queue.is_closed() => queue.capacity(),
            _ => 0,
        }
    }

    /// Counts an arrival and returns how many items it holds.
    fn count(&mut self, source: SourceId, payload: &Payload, log_time: LogTime) -> u64 {
        let counters = self.counters.entry(source).or_default();
        counters.arrivals += 1;
        match payload {
            Payload::Bytes(bytes) => {
                counters.bytes += bytes.len() as u64;
                counters.last_data = Some(log_time);
                counters.items += 1;
                1
            }
            Payload::Can(frames) => {
                counters.bytes += frames
                    .iter()
                    .map(|frame| frame.bytes().len() as u64)
                    .sum::<u64>();
                counters.last_data = Some(log_time);
                counters.items += frames.len() as u64;
                frames.len() as u64
            }
            Payload::Tick => 0,
            Payload::Notice(notice) => {
                match notice {
                    Notice::Opened(text) | Notice::Closed(text) => {
                        counters.open = matches!(notice, Notice::Opened(_));
                        counters.state.clone_from(text);
                    }
                    _ => {}
                }
                0
            }
        }
    }
}
