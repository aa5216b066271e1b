//! Where all sources meet: stamps, numbers and hands on every arrival in one critical section.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::ring::Ring;
pub use crate::ring::RingLimits;

use sample::{Arrival, LogTime, LossPlace, Notice, Payload, SourceId};
use tokio::sync::mpsc::{self, error::TrySendError};

use crate::LogClock;

/// Places in the recorder's queue that only notices may take, so that what is said about a loss
/// is not lost with it.
const NOTICE_RESERVE: usize = 64;

/// Runs of arrivals that the estimator skipped and the recorder has had no room to hear of yet.
/// Older ones are merged into an error in the program's own log.
const UNRECORDED_RUNS_MAX: usize = 64;

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
    /// Items lost, in the order of [`LossPlace::ALL`].
    pub lost: [u64; LossPlace::ALL.len()],
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

#[derive(Debug)]
struct State {
    next_sequence: u64,
    sizes: QueueSizes,
    recorder: Option<mpsc::Sender<Arc<Arrival>>>,
    recorder_full: bool,
    unreported: BTreeMap<(SourceId, LossPlace), u64>,
    estimator: Option<mpsc::Sender<Arc<Arrival>>>,
    skipping: Option<Run>,
    unrecorded: VecDeque<Run>,
    counters: BTreeMap<SourceId, SourceCounters>,
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

impl Sequencer {
    /// A stream that starts at sequence 0, and its consumers' ends.
    #[must_use]
    pub fn new(clock: LogClock, sizes: QueueSizes) -> (Self, Streams) {
        let sizes = QueueSizes {
            recorder: sizes.recorder.max(1),
            ..sizes
        };
        let sequencer = Self::idle(clock);
        let streams = sequencer.begin(sizes, None, &BTreeMap::new());
        (sequencer, streams)
    }

    /// A stream that starts at sequence 0 and has no consumers yet.
    #[must_use]
    pub fn idle(clock: LogClock) -> Self {
        let state = State {
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
            paused: true,
            ring: Ring::default(),
            listeners: Vec::new(),
            numbers: BTreeMap::new(),
        };
        Self {
            clock,
            state: Arc::new(Mutex::new(state)),
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
        let sizes = QueueSizes {
            recorder: sizes.recorder.max(1),
            ..sizes
        };
        let (recorder, recorder_end) = mpsc::channel(sizes.recorder + NOTICE_RESERVE);
        let (estimator, estimator_end) = match sizes.estimator {
            0 => (None, None),
            size => {
                let (sender, receiver) = mpsc::channel(size);
                (Some(sender), Some(receiver))
            }
        };
        let boundary = self.clock.read();
        let backlog = state.ring.since(since, state.next_sequence, boundary);
        state.sizes = sizes;
        state.recorder = Some(recorder);
        state.estimator = estimator;
        state.paused = false;
        Streams {
            backlog,
            recorder: recorder_end,
            estimator: estimator_end,
        }
    }

    /// What was started with the number `started` has the number `number` from here on.
    pub(crate) fn assign(&self, started: SourceId, number: SourceId) {
        self.lock().numbers.insert(started, Some(number));
    }

    /// Ends what the consumers get, as [`Sequencer::finish`] does, and goes on without: what comes
    /// from here on is not recorded, and not lost.
    pub fn pause(&self) {
        let mut state = self.lock();
        state.end(&self.clock);
        state.paused = true;
    }

    /// Gives sources other numbers, as [`Sequencer::begin`] does, while nobody records.
    pub fn renumber(&self, numbers: &BTreeMap<SourceId, Option<SourceId>>) {
        self.lock().renumber(numbers);
    }

    /// Keeps the last of the stream in memory.
    pub fn keep(&self, limits: RingLimits) {
        self.lock().ring.set_limits(limits);
    }

    /// The instant of the oldest arrival that is kept in memory.
    #[must_use]
    pub fn kept_since(&self) -> Option<LogTime> {
        self.lock().ring.first_time()
    }

    /// Everything from here on, whether somebody records or not. What does not fit into the queue
    /// is left out for this listener alone; [`Sequencer::missed`] counts it.
    #[must_use]
    pub fn listen(&self, capacity: usize) -> mpsc::Receiver<Arc<Arrival>> {
        let (queue, end) = mpsc::channel(capacity.max(1));
        self.lock().listeners.push(Listener { queue, missed: 0 });
        end
    }

    /// Arrivals that listeners had no room for.
    #[must_use]
    pub fn missed(&self) -> u64 {
        self.lock().listeners.iter().map(|l| l.missed).sum()
    }

    /// Takes what `source` delivered into the stream and returns its stamp.
    pub fn push(&self, source: SourceId, payload: Payload) -> LogTime {
        let mut state = self.lock();
        state.settle(&self.clock);
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

    /// What has come so far, by source.
    #[must_use]
    pub fn counters(&self) -> BTreeMap<SourceId, SourceCounters> {
        self.lock().counters.clone()
    }

    /// Sequence number of the next arrival: how many there were.
    #[must_use]
    pub fn next_sequence(&self) -> u64 {
        self.lock().next_sequence
    }

    /// Ends the stream: writes the notices that were waiting for room, then closes both queues.
    /// Call it after [`crate::Supervisor::stop`]. What is pushed later is counted as lost.
    pub fn finish(&self) {
        let mut state = self.lock();
        state.end(&self.clock);
        state.listeners.clear();
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Writes the notices that waited for room and closes the consumers' queues.
    fn end(&mut self, clock: &LogClock) {
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

    fn renumber(&mut self, numbers: &BTreeMap<SourceId, Option<SourceId>>) {
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
        self.ring.renumber(&states);
        self.numbers = numbers.clone();
    }

    /// Reports what was left out, where there is room to.
    fn settle(&mut self, clock: &LogClock) {
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
                "estimator skipped arrivals, and the log cannot say so"
            );
        }
    }

    fn emit(&mut self, clock: &LogClock, source: SourceId, payload: Payload) -> LogTime {
        let reading = clock.read();
        let Some(source) = self.numbers.get(&source).copied().unwrap_or(Some(source)) else {
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
        let told = match arrival.payload {
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
        let counters = self.counters.entry(source).or_default();
        let unreported = match told {
            None if items == 0 => return,
            None => {
                counters.lost[queue_index()] += items;
                (LossPlace::Queue, items)
            }
            // What a lost notice told of is told again, and counted then.
            Some((place, count)) => {
                if place != LossPlace::Queue {
                    counters.lost[place as usize] -= count;
                }
                (place, count)
            }
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
                    Notice::Lost { place, count } if *place != LossPlace::Queue => {
                        counters.lost[*place as usize] += count;
                    }
                    _ => {}
                }
                0
            }
        }
    }
}

const fn queue_index() -> usize {
    LossPlace::Queue as usize
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    const PORT: SourceId = SourceId(3);

    fn sequencer(recorder: usize, estimator: usize) -> (Sequencer, Streams) {
        Sequencer::new(
            LogClock::start(),
            QueueSizes {
                recorder,
                estimator,
            },
        )
    }

    fn drain(queue: &mut mpsc::Receiver<Arc<Arrival>>) -> Vec<Arc<Arrival>> {
        std::iter::from_fn(|| queue.try_recv().ok()).collect()
    }

    fn bytes(value: u8) -> Payload {
        Payload::Bytes(vec![value])
    }

    #[test]
    fn threads_get_one_order_without_gaps() {
        let (sequencer, mut streams) = sequencer(10_000, 10_000);
        let threads: Vec<_> = (0..4)
            .map(|source| {
                let sequencer = sequencer.clone();
                std::thread::spawn(move || {
                    for value in 0..500 {
                        sequencer.push(SourceId(source), bytes(value as u8));
                    }
                })
            })
            .collect();
        for thread in threads {
            thread.join().expect("pushing does not panic");
        }
        let recorded = drain(&mut streams.recorder);
        assert_eq!(recorded.len(), 2000);
        for (index, pair) in recorded.windows(2).enumerate() {
            assert_eq!(pair[0].sequence, index as u64);
            assert!(pair[0].log_time <= pair[1].log_time);
        }
        let estimated = drain(streams.estimator.as_mut().expect("a queue"));
        assert_eq!(recorded, estimated);
    }

    #[test]
    fn a_full_recorder_queue_counts_and_reports() {
        let (sequencer, mut streams) = sequencer(8, 0);
        for value in 0..20 {
            sequencer.push(PORT, bytes(value));
        }
        let kept = drain(&mut streams.recorder);
        assert_eq!(kept.len(), 8);
        sequencer.push(PORT, bytes(99));
        let after = drain(&mut streams.recorder);
        assert_eq!(
            after[0].payload,
            Payload::Notice(Notice::Lost {
                place: LossPlace::Queue,
                count: 12
            })
        );
        assert_eq!(after[0].sequence, 20);
        assert_eq!(after[1].payload, bytes(99));
        assert_eq!(sequencer.counters()[&PORT].lost[queue_index()], 12);
        assert_eq!(sequencer.counters()[&PORT].items, 21);
    }

    #[test]
    fn a_notice_of_loss_that_is_itself_lost_is_told_again_and_counted_once() {
        let (sequencer, mut streams) = sequencer(2, 0);
        sequencer.push(PORT, bytes(0));
        sequencer.push(PORT, bytes(0));
        for _ in 0..NOTICE_RESERVE {
            sequencer.mark("no room behind this");
        }
        let (place, count) = (LossPlace::Kernel, 5);
        sequencer.notice(PORT, Notice::Lost { place, count });
        let in_kernel = || sequencer.counters()[&PORT].lost[place as usize];
        assert_eq!(in_kernel(), 0, "nobody knows of it yet");
        assert_eq!(drain(&mut streams.recorder).len(), 2 + NOTICE_RESERVE);
        sequencer.push(PORT, bytes(1));
        let after = drain(&mut streams.recorder);
        assert_eq!(
            after[0].payload,
            Payload::Notice(Notice::Lost { place, count })
        );
        assert_eq!(after[1].payload, bytes(1));
        assert_eq!((after.len(), in_kernel()), (2, count));
        assert_eq!(sequencer.counters()[&PORT].lost[queue_index()], 0);
    }

    #[test]
    fn notices_pass_a_full_queue() {
        let (sequencer, mut streams) = sequencer(1, 0);
        sequencer.push(PORT, bytes(0));
        sequencer.push(PORT, bytes(1));
        sequencer.mark("gravel");
        let kept = drain(&mut streams.recorder);
        assert_eq!(
            kept.last().expect("a mark").payload,
            Payload::Notice(Notice::Mark("gravel".to_owned()))
        );
    }

    #[test]
    fn a_slow_estimator_is_told_what_it_missed_and_the_recorder_too() {
        let (sequencer, mut streams) = sequencer(100, 4);
        for value in 0..10 {
            sequencer.push(PORT, bytes(value));
        }
        let queue = streams.estimator.as_mut().expect("a queue");
        assert_eq!(drain(queue).len(), 4);
        sequencer.push(PORT, bytes(10));
        let seen = drain(queue);
        let expected = Payload::Notice(Notice::EstimatorSkipped {
            first_sequence: 4,
            count: 6,
        });
        assert_eq!(seen[0].payload, expected);
        assert_eq!(seen[0].sequence, 10);
        assert_eq!(seen[1].sequence, 11);
        let recorded = drain(&mut streams.recorder);
        assert_eq!(recorded.len(), 12);
        assert_eq!(recorded[10].payload, expected);
    }

    #[test]
    fn an_estimator_that_died_is_told_of_at_the_end() {
        let (sequencer, mut streams) = sequencer(100, 4);
        sequencer.push(PORT, bytes(0));
        streams.estimator = None;
        sequencer.push(PORT, bytes(1));
        sequencer.push(PORT, bytes(2));
        sequencer.finish();
        let recorded = drain(&mut streams.recorder);
        assert_eq!(
            recorded.last().expect("a notice").payload,
            Payload::Notice(Notice::EstimatorSkipped {
                first_sequence: 1,
                count: 3
            })
        );
        assert!(streams.recorder.blocking_recv().is_none());
    }

    /// While sources push without a pause, the stream changes hands again and again: every arrival
    /// is in exactly one run, and both consumers of a run get the same.
    #[test]
    fn the_stream_changes_hands_between_two_arrivals() {
        let sizes = QueueSizes {
            recorder: 100_000,
            estimator: 100_000,
        };
        let (sequencer, first) = sequencer(sizes.recorder, sizes.estimator);
        let mut runs = vec![first];
        let threads: Vec<_> = (0..4)
            .map(|source| {
                let sequencer = sequencer.clone();
                std::thread::spawn(move || {
                    for value in 0..5_000 {
                        sequencer.push(SourceId(source), bytes(value as u8));
                    }
                })
            })
            .collect();
        while threads.iter().any(|thread| !thread.is_finished()) {
            runs.push(sequencer.begin(sizes, None, &BTreeMap::new()));
        }
        for thread in threads {
            thread.join().expect("pushing does not panic");
        }
        sequencer.finish();
        let mut next = 0;
        for mut run in runs {
            assert_eq!(run.backlog, []);
            let recorded = drain(&mut run.recorder);
            assert_eq!(recorded, drain(run.estimator.as_mut().expect("a queue")));
            for arrival in recorded {
                assert_eq!(arrival.sequence, next);
                next += 1;
            }
        }
        assert_eq!(next, 20_000);
    }

    #[test]
    fn nothing_lies_between_what_was_kept_and_what_comes() {
        let sequencer = Sequencer::idle(LogClock::start());
        sequencer.keep(RingLimits {
            duration: std::time::Duration::from_secs(60),
            bytes: 1 << 20,
        });
        sequencer.notice(PORT, Notice::Opened("port".to_owned()));
        for value in 0..10 {
            sequencer.push(PORT, bytes(value));
        }
        let since = sequencer.kept_since().expect("something is kept");
        let sizes = QueueSizes::default();
        let mut run = sequencer.begin(sizes, Some(since), &BTreeMap::new());
        sequencer.push(PORT, bytes(10));
        sequencer.pause();
        sequencer.push(PORT, bytes(11));
        let mut all = run.backlog.clone();
        all.extend(drain(&mut run.recorder));
        let numbers: Vec<u64> = all.iter().map(|arrival| arrival.sequence).collect();
        assert_eq!(numbers, (0..12).collect::<Vec<_>>());
        // What came while nobody recorded is in the next run's memory, and is not lost.
        assert_eq!(sequencer.counters()[&PORT].lost, [0; 4]);
        let next = sequencer.begin(sizes, Some(since), &BTreeMap::new());
        assert_eq!(next.backlog.last().expect("kept").payload, bytes(11));
    }

    #[test]
    fn a_listener_that_lags_or_goes_disturbs_nobody() {
        let (sequencer, mut streams) = sequencer(100, 0);
        let mut small = sequencer.listen(2);
        drop(sequencer.listen(2));
        for value in 0..5 {
            sequencer.push(PORT, bytes(value));
        }
        assert_eq!(drain(&mut small).len(), 2);
        assert_eq!(sequencer.missed(), 3);
        assert_eq!(drain(&mut streams.recorder).len(), 5);
    }

    #[test]
    fn sources_get_their_new_numbers_at_the_boundary_and_their_counters_go_along() {
        let (sequencer, mut old) = sequencer(100, 0);
        sequencer.notice(PORT, Notice::Opened("port".to_owned()));
        sequencer.push(SourceId(1), bytes(1));
        let numbers = BTreeMap::from([(PORT, Some(SourceId(1))), (SourceId(1), None)]);
        let mut new = sequencer.begin(QueueSizes::default(), None, &numbers);
        sequencer.push(PORT, bytes(2));
        sequencer.push(SourceId(1), bytes(3));
        let opened = &new.backlog[0];
        assert_eq!(opened.source, SourceId(1));
        let after = drain(&mut new.recorder);
        assert_eq!(after.len(), 1);
        assert_eq!(
            (after[0].source, &after[0].payload),
            (SourceId(1), &bytes(2))
        );
        assert_eq!(sequencer.counters()[&SourceId(1)].arrivals, 2);
        assert!(sequencer.counters()[&SourceId(1)].open);
        assert_eq!(drain(&mut old.recorder).len(), 2);
    }

    #[derive(Clone, Copy, Debug)]
    enum Step {
        Push(u8),
        Record(u8),
        Estimate(u8),
    }

    fn steps() -> impl Strategy<Value = Vec<Step>> {
        let step = prop_oneof![
            (0_u8..20).prop_map(Step::Push),
            (0_u8..20).prop_map(Step::Record),
            (0_u8..20).prop_map(Step::Estimate),
        ];
        proptest::collection::vec(step, 0..60)
    }

    proptest! {
        /// However the consumers lag: data pushed is data recorded plus data reported lost, and
        /// every arrival is either seen by the estimator or within exactly one run that the
        /// recorder knows of.
        #[test]
        fn nothing_is_lost_in_silence(
            steps in steps(),
            recorder in 1_usize..30,
            estimator in 1_usize..10,
        ) {
            let (sequencer, mut streams) = sequencer(recorder, estimator);
            let mut queue = streams.estimator.take().expect("a queue");
            let (mut recorded, mut seen, mut pushed) = (Vec::new(), BTreeSet::new(), 0_u64);
            for step in steps {
                match step {
                    Step::Push(count) => {
                        pushed += u64::from(count);
                        for value in 0..count {
                            sequencer.push(SourceId(u16::from(value % 3)), bytes(value));
                        }
                    }
                    Step::Record(count) => {
                        for _ in 0..count {
                            recorded.extend(streams.recorder.try_recv());
                        }
                    }
                    Step::Estimate(count) => {
                        for _ in 0..count {
                            seen.extend(queue.try_recv().map(|arrival| arrival.sequence));
                        }
                    }
                }
            }
            sequencer.finish();
            recorded.extend(drain(&mut streams.recorder));
            seen.extend(drain(&mut queue).iter().map(|arrival| arrival.sequence));

            let (mut kept, mut lost) = (0, 0);
            let mut skipped = BTreeSet::new();
            for arrival in &recorded {
                match &arrival.payload {
                    Payload::Bytes(_) => kept += 1,
                    Payload::Notice(Notice::Lost { count, .. }) => lost += count,
                    Payload::Notice(Notice::EstimatorSkipped { first_sequence, count }) => {
                        for sequence in *first_sequence..first_sequence + count {
                            prop_assert!(skipped.insert(sequence), "told twice: {}", sequence);
                        }
                    }
                    _ => {}
                }
            }
            prop_assert_eq!(kept + lost, pushed);
            prop_assert!(seen.is_disjoint(&skipped));
            let all: BTreeSet<u64> = (0..sequencer.next_sequence()).collect();
            prop_assert_eq!(&seen | &skipped, all);
        }
    }
}
