//! A run: its files, and the two threads that write to them.

use std::sync::{Arc, OnceLock};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use acq::{Sequencer, Streams};
use anyhow::Context;
use engine::config::Trigger;
use engine::{Config, Engine};
use sample::{
    Arrival, Event, EventKind, Health, LogTime, LossPlace, Notice, Payload, Severity, SourceId,
};
use store::{
    ClockState, DiskState, LogMessage, LossLedger, Losses, Record, Recorder, RecorderSummary,
};
use tokio::sync::mpsc;

use super::heartbeat::{Heartbeat, Heartbeats};
use crate::folder::{self, Protected, RunGuard, RunName};
use crate::output_can::CanSink;
use crate::session;
use crate::status::RecorderStatus;
use crate::tap::Tap;

/// Most arrivals and records that wait for the writer while a backlog is written.
const BACKLOG_WAITING_MAX: usize = 8_192;
/// Pause while more of them wait.
const BACKLOG_PAUSE: Duration = Duration::from_millis(2);
/// Polling period of the recorder thread. A wake-up for each arrival would cost several times the work
/// on the arrival. The sources have stamped the arrivals before. A kill loses the arrivals that were
/// not passed to the recorder, and those that are not in the journal yet.
const RECORDER_PERIOD: Duration = Duration::from_millis(25);
/// Polling period of an engine that estimates, and of one that only decodes.
const ESTIMATOR_PERIOD: Duration = Duration::from_millis(5);
const DECODER_PERIOD: Duration = Duration::from_millis(50);
/// Most arrivals that are received at once.
const ARRIVALS_MAX: usize = 4_096;
/// Number of waiting arrivals from which a thread polls without a pause.
const ARRIVALS_MANY: usize = 1_024;
/// Number of records that are given to the writer before the other arrivals are processed.
const RECORDS_MANY: usize = 256;
/// Time between two checks of the disk: losses and waiting data.
const DISK_INTERVAL: Duration = Duration::from_secs(1);
/// Time between two warnings of a slow disk.
const SLOW_DISK_WARNING_INTERVAL: Duration = Duration::from_secs(10);
/// A disk is slow if arrivals of this time wait for it,
const SLOW_DISK_SPAN: Duration = Duration::from_secs(2);
/// or if the arrivals fill this much of the writer's queue, per cent,
const SLOW_DISK_FILL: u8 = 10;
/// or if it has not confirmed written data for this time.
const SLOW_DISK_UNSYNCED: Duration = Duration::from_secs(3);

/// A run that is being written.
pub struct Run {
    /// Writer of the files.
    pub recorder: Arc<Recorder>,
    raw: JoinHandle<Option<Last>>,
    engine: JoinHandle<(Engine, Progress)>,
    heartbeats: [Arc<Heartbeat>; 2],
    name: RunName,
    /// Protects the logs from retention until they are closed.
    _guard: RunGuard,
}

/// Progress of an engine.
#[derive(Clone, Copy, Debug, Default)]
pub struct Progress {
    /// Log time of its last arrival.
    pub time: LogTime,
    /// Sequence number of its next arrival.
    pub next_sequence: u64,
    /// What it left at the end of the time for a stop.
    pub left: Option<Left>,
}

/// Arrivals that an engine has not processed, because it was too far behind at a stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Left {
    /// Sequence number of the first one.
    pub first_sequence: u64,
    /// Time from the last processed arrival to the last one, s.
    pub span_s: f64,
}

/// The last arrival that was passed to the recorder.
struct Last {
    sequence: u64,
    log_time: LogTime,
    realtime_ns: i64,
}

impl Left {
    /// Adds to the log which arrivals have no results. The notice covers itself, because the engine does not
    /// get it either.
    fn record(&self, recorder: &Recorder, last: &Last) {
        let sequence = last.sequence + 1;
        let count = (sequence + 1).saturating_sub(self.first_sequence);
        tracing::warn!(
            arrivals = count - 1,
            seconds = self.span_s,
            "the estimator was too far behind at the stop and was ended; the raw data is in the log, and \
             `atvrec replay -o` computes the rest"
        );
        recorder.push(Arrival {
            sequence,
            source: SourceId::HOST,
            log_time: last.log_time,
            realtime_ns: last.realtime_ns,
            payload: Payload::Notice(Notice::EstimatorSkipped {
                first_sequence: self.first_sequence,
                count,
            }),
        });
    }
}

impl Progress {
    /// Whether `arrival` is left, because the time of the engine is over; remembers it then.
    fn leaves(&mut self, arrival: &Arrival, until: &StopTime) -> bool {
        let is_over = until.is_over();
        if is_over {
            let first_sequence = self
                .left
                .map_or(arrival.sequence, |left| left.first_sequence);
            let span_s = arrival.log_time.seconds_since(self.time);
            self.left = Some(Left {
                first_sequence,
                span_s,
            });
        }
        is_over
    }
}

/// The instant at which the engines leave the arrivals that still wait. There is none before the stop of
/// the recording.
#[derive(Clone, Debug, Default)]
pub struct StopTime(Arc<OnceLock<Instant>>);

impl StopTime {
    /// Sets the instant, once.
    pub fn set(&self, instant: Instant) {
        self.0.get_or_init(|| instant);
    }

    fn is_over(&self) -> bool {
        self.0.get().is_some_and(|until| Instant::now() >= *until)
    }
}

/// Files of a run. They are created before the run, so that the run can begin between two arrivals.
pub struct Files {
    recorder: Arc<Recorder>,
    name: RunName,
    guard: RunGuard,
}

impl Files {
    /// Creates the files of a run that starts at `started`; `clock` is the state of the clock.
    pub fn open(
        config: &Config,
        started: LogTime,
        clock: ClockState,
        protected: &Protected,
        ledger: &LossLedger,
    ) -> anyhow::Result<Self> {
        let storage = &config.storage;
        let number = folder::next_run(&storage.directory).with_context(|| {
            format!(
                "cannot read the log directory {}",
                storage.directory.display()
            )
        })?;
        let name = RunName {
            directory: storage.directory.clone(),
            name: storage.name.clone(),
            number,
            started,
            clock,
        };
        let guard = protected.begin(number);
        let session = session::live(config, started, number, clock);
        let options = storage.options.clone();
        let recorder =
            Recorder::start_in(ledger, &storage.directory, &name.stem(), session, options)?;
        Ok(Self {
            recorder: Arc::new(recorder),
            name,
            guard,
        })
    }

    /// Writer of the files.
    pub const fn recorder(&self) -> &Arc<Recorder> {
        &self.recorder
    }
}

impl Run {
    /// Starts to write `streams` and the records that `engine` computes from them until `until`.
    pub fn start(
        files: Files,
        engine: Engine,
        sequencer: Sequencer,
        streams: Streams,
        heartbeats: &Heartbeats,
        sink: RecordSink,
        until: StopTime,
    ) -> anyhow::Result<Self> {
        let Files {
            recorder,
            name,
            guard,
        } = files;
        let [raw_beat, engine_beat] = [heartbeats.add("recorder"), heartbeats.add("engine")];
        let for_engine = streams
            .estimator
            .context("the stream has no queue for the estimator")?;
        let raw = RawThread {
            recorder: Arc::clone(&recorder),
            backlog: streams.backlog.clone(),
            queue: streams.recorder,
            heartbeat: Arc::clone(&raw_beat),
            sequencer,
            reported: Losses::default(),
            checked_at: Instant::now(),
            warned_at: None,
        };
        let worker = EngineThread {
            engine,
            recorder: Arc::clone(&recorder),
            backlog: streams.backlog,
            queue: for_engine,
            until,
            heartbeat: Arc::clone(&engine_beat),
            sink,
        };
        Ok(Self {
            recorder,
            raw: spawn("recorder", move || raw.run())?,
            engine: spawn("engine", move || worker.run())?,
            heartbeats: [raw_beat, engine_beat],
            name,
            _guard: guard,
        })
    }

    /// Waits until all arrivals of the ended stream are processed, and closes the files, until
    /// `deadline` or within the configured time. Returns the engine.
    pub fn finish(
        self,
        deadline: Option<Instant>,
    ) -> anyhow::Result<(RecorderSummary, Engine, Progress)> {
        drop(self.heartbeats);
        let engine = join("engine", self.engine);
        let last = join("recorder", self.raw)?;
        let recorder =
            Arc::into_inner(self.recorder).context("a thread still holds the recorder")?;
        if let (
            Ok((
                _,
                Progress {
                    left: Some(left), ..
                },
            )),
            Some(last),
        ) = (&engine, last)
        {
            left.record(&recorder, &last);
        }
        let mut summary = match deadline {
            Some(deadline) => recorder.finish_by(deadline)?,
            None => recorder.finish()?,
        };
        let (engine, progress) = engine?;
        if summary.cut_off.is_some() {
            // The disk does not respond in time: the next start renames the logs.
            return Ok((summary, engine, progress));
        }
        // The guard still protects the logs, so that retention sees no half-renamed run.
        match self.name.rename(engine.utc_offset()) {
            Ok(Some((old, new))) => rename_in(&mut summary, &old, &new),
            Ok(None) => {}
            Err(error) => tracing::warn!(
                %error,
                "cannot rename the logs by the receiver's date; the next start tries again"
            ),
        }
        folder::count_run(&self.name.directory, self.name.number);
        Ok((summary, engine, progress))
    }
}

/// Changes the paths of the files after their stem was renamed.
fn rename_in(summary: &mut RecorderSummary, old: &str, new: &str) {
    for file in &mut summary.files {
        let name = file.path.file_name().unwrap_or_default().to_string_lossy();
        if let Some(rest) = name.strip_prefix(old) {
            let renamed = file.path.with_file_name(format!("{new}{rest}"));
            // A file keeps its old name if the new name was taken.
            if renamed.exists() {
                file.path = renamed;
            }
        }
    }
}

/// Thread that passes arrivals to the recorder.
struct RawThread {
    recorder: Arc<Recorder>,
    backlog: Vec<Arc<Arrival>>,
    queue: mpsc::Receiver<Arc<Arrival>>,
    heartbeat: Arc<Heartbeat>,
    sequencer: Sequencer,
    /// Disk losses that were already reported as notices of the stream.
    reported: Losses,
    checked_at: Instant,
    /// Time of the last warning of a slow disk.
    warned_at: Option<Instant>,
}

impl RawThread {
    fn run(mut self) -> Option<Last> {
        let of = |arrival: &Arc<Arrival>| Last {
            sequence: arrival.sequence,
            log_time: arrival.log_time,
            realtime_ns: arrival.realtime_ns,
        };
        let mut last = self.backlog.last().map(of);
        for arrival in std::mem::take(&mut self.backlog) {
            wait_for_writer(&self.recorder, &self.queue);
            self.recorder.push(Arc::unwrap_or_clone(arrival));
            self.heartbeat.beat();
        }
        let mut received = Vec::new();
        while receive(&mut self.queue, &mut received, RECORDER_PERIOD) {
            last = received.last().map(of).or(last);
            let arrivals = received.drain(..).map(Arc::unwrap_or_clone);
            self.recorder.push_all(arrivals.collect());
            self.heartbeat.beat();
            self.check_disk();
        }
        last
    }

    /// Reports losses of the disk as notices of the stream, and warns of a slow disk.
    fn check_disk(&mut self) {
        if self.checked_at.elapsed() < DISK_INTERVAL {
            return;
        }
        self.checked_at = Instant::now();
        let status = self.recorder.status();
        for (source, count) in status.losses.since(&self.reported).at(LossPlace::Disk) {
            let place = LossPlace::Disk;
            self.sequencer.notice(source, Notice::Lost { place, count });
        }
        self.reported = status.losses;
        let backlog = status.backlog;
        let slow = backlog.span >= SLOW_DISK_SPAN
            || backlog.queue_fill >= SLOW_DISK_FILL
            || backlog.unsynced >= SLOW_DISK_UNSYNCED;
        let is_recent = |at: Instant| at.elapsed() < SLOW_DISK_WARNING_INTERVAL;
        let fails = matches!(status.disk, DiskState::Failing { .. });
        if !slow || fails || self.warned_at.is_some_and(is_recent) {
            return;
        }
        self.warned_at = Some(Instant::now());
        tracing::warn!(
            arrivals = backlog.arrivals,
            bytes = backlog.bytes,
            seconds = backlog.span.as_secs_f64(),
            queue_percent = backlog.queue_fill,
            unsynced_s = backlog.unsynced.as_secs_f64(),
            "the disk is too slow; data waits for it, and will be lost when the queue is full; \
             use a faster disk or fewer sources"
        );
    }
}

/// Sleeps for `period` unless many arrivals wait, then receives all arrivals that wait; `false` at
/// the end of the queue.
fn receive(
    queue: &mut mpsc::Receiver<Arc<Arrival>>,
    received: &mut Vec<Arc<Arrival>>,
    period: Duration,
) -> bool {
    if !queue.is_closed() && queue.len() < ARRIVALS_MANY {
        thread::sleep(period);
    }
    queue.blocking_recv_many(received, ARRIVALS_MAX) > 0
}

/// Thread that runs the engine of a run and writes its records.
struct EngineThread {
    engine: Engine,
    recorder: Arc<Recorder>,
    backlog: Vec<Arc<Arrival>>,
    queue: mpsc::Receiver<Arc<Arrival>>,
    until: StopTime,
    heartbeat: Arc<Heartbeat>,
    sink: RecordSink,
}

impl EngineThread {
    fn run(mut self) -> (Engine, Progress) {
        let mut progress = Progress::default();
        let mut records = Vec::new();
        for arrival in std::mem::take(&mut self.backlog) {
            wait_for_writer(&self.recorder, &self.queue);
            self.step(&arrival, &mut records, &mut progress);
            self.recorder.record_all(std::mem::take(&mut records));
        }
        let mut received = Vec::new();
        let period = if self.engine.estimates() {
            ESTIMATOR_PERIOD
        } else {
            DECODER_PERIOD
        };
        while receive(&mut self.queue, &mut received, period) {
            for arrival in received.drain(..) {
                self.step(&arrival, &mut records, &mut progress);
                if records.len() >= RECORDS_MANY {
                    self.recorder.record_all(std::mem::take(&mut records));
                }
            }
            self.recorder.record_all(std::mem::take(&mut records));
        }
        (self.engine, progress)
    }

    fn step(&mut self, arrival: &Arrival, records: &mut Vec<Record>, progress: &mut Progress) {
        if progress.leaves(arrival, &self.until) {
            return;
        }
        let known = records.len();
        self.engine.push(arrival, records);
        for record in &records[known..] {
            self.sink.append(record, arrival);
        }
        *progress = Progress {
            time: arrival.log_time,
            next_sequence: arrival.sequence + 1,
            left: None,
        };
        self.heartbeat.beat();
    }
}

/// Waits until few arrivals wait for the writer, or until the stream ends: the disk may hang.
fn wait_for_writer(recorder: &Recorder, queue: &mpsc::Receiver<Arc<Arrival>>) {
    while recorder.waiting() > BACKLOG_WAITING_MAX && !queue.is_closed() {
        thread::sleep(BACKLOG_PAUSE);
    }
}

/// Engine whose records are not written: it prints messages and finds events that are triggers.
pub struct LiveEngine {
    /// Sequence number of the first arrival that the engine has not processed.
    pub next_sequence: u64,
    /// Engine.
    pub engine: Engine,
    /// Arrivals.
    pub queue: mpsc::Receiver<Arc<Arrival>>,
    /// Receives the records.
    pub sink: RecordSink,
    /// When it leaves the arrivals that wait.
    pub until: StopTime,
}

impl LiveEngine {
    /// Runs the engine in a thread until the queue ends.
    pub fn start(mut self, heartbeats: &Heartbeats) -> anyhow::Result<JoinHandle<Health>> {
        let heartbeat = heartbeats.add("live engine");
        let run = move || {
            let mut records = Vec::new();
            let mut last = LogTime::default();
            while let Some(arrival) = self.queue.blocking_recv() {
                heartbeat.beat();
                if arrival.sequence < self.next_sequence {
                    continue;
                }
                if self.until.is_over() {
                    break;
                }
                last = arrival.log_time;
                self.engine.push(&arrival, &mut records);
                for record in records.drain(..) {
                    self.sink.append(&record, &arrival);
                }
            }
            self.engine.health(last)
        };
        spawn("live engine", run)
    }
}

/// A trigger condition was met.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TriggerEvent {
    /// Time of the arrival or event.
    pub time: LogTime,
    /// Reason, for people.
    pub reason: String,
}

/// Receives the records of an engine, in addition to the log: prints messages and events, sets the
/// recorder's state, feeds tap and outputs, and finds events that are triggers.
#[derive(Clone)]
pub struct RecordSink {
    /// State of the recorder: receives the faulty sensors.
    pub status: Arc<RecorderStatus>,
    /// Whether the engine is the one whose records are shown: messages and events are printed, and
    /// status, tap and outputs get the records.
    pub shows: bool,
    /// Tap of the live process.
    pub tap: Tap,
    /// Output to controllers.
    pub can: Option<CanSink>,
    /// Triggers, and the queue of trigger events.
    pub events: Option<(Arc<Trigger>, mpsc::Sender<TriggerEvent>)>,
}

impl RecordSink {
    fn append(&self, record: &Record, arrival: &Arrival) {
        if self.shows {
            self.tap.push(record);
            self.status.take(record);
            if let Some(can) = &self.can {
                can.push(record, arrival.log_time);
            }
        }
        match record {
            // A source prints its own notices.
            Record::Log(message)
                if self.shows && !matches!(arrival.payload, Payload::Notice(_)) =>
            {
                log_message(message);
            }
            Record::Event(event) => {
                if self.shows {
                    log_event(event);
                }
                let Some((trigger, trigger_events)) = &self.events else {
                    return;
                };
                if trigger.fires_on(event) {
                    // Fails only when the recording ends.
                    let _ = trigger_events.blocking_send(TriggerEvent {
                        time: event.time,
                        reason: event.text.clone(),
                    });
                }
            }
            _ => {}
        }
    }
}

/// Prints events that concern sensors and the filter; lifts and surfaces belong to a drive.
fn log_event(event: &Event) {
    let text = &event.text;
    match event.kind {
        EventKind::SensorFault(_) | EventKind::FilterReset | EventKind::Mistake(_) => {
            tracing::warn!(source = "estimator", "{text}");
        }
        EventKind::SensorRecovered(_)
        | EventKind::FilterRecovered
        | EventKind::InexactParameters(_) => {
            tracing::info!(source = "estimator", "{text}")
        }
        _ => {}
    }
}

fn log_message(message: &LogMessage) {
    let (name, text) = (&message.name, &message.text);
    match message.severity {
        Severity::Info => tracing::info!(source = %name, "{text}"),
        Severity::Warning => tracing::warn!(source = %name, "{text}"),
        Severity::Error => tracing::error!(source = %name, "{text}"),
    }
}

/// Checks all arrivals for marks and frames that are triggers, until the queue ends.
pub async fn watch_for_triggers(
    trigger: Arc<Trigger>,
    mut queue: mpsc::Receiver<Arc<Arrival>>,
    events: mpsc::Sender<TriggerEvent>,
) {
    while let Some(arrival) = queue.recv().await {
        if let Some(reason) = trigger.fires(&arrival) {
            let time = arrival.log_time;
            if events.send(TriggerEvent { time, reason }).await.is_err() {
                return;
            }
        }
    }
}

fn spawn<T: Send + 'static>(
    name: &str,
    run: impl FnOnce() -> T + Send + 'static,
) -> anyhow::Result<JoinHandle<T>> {
    thread::Builder::new()
        .name(name.to_owned())
        .spawn(run)
        .with_context(|| format!("cannot start the thread \"{name}\""))
}

/// Waits for the end of a thread.
pub fn join<T>(name: &str, thread: JoinHandle<T>) -> anyhow::Result<T> {
    thread.join().map_err(|_| {
        anyhow::anyhow!("the thread \"{name}\" panicked; its message is printed above")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_engine_leaves_arrivals_only_after_its_time() {
        let start = LogTime(1_000_000_000);
        let arrival = |sequence, after_s| Arrival {
            sequence,
            source: SourceId(0),
            log_time: start.offset_seconds(after_s),
            realtime_ns: 0,
            payload: Payload::Bytes(Vec::new()),
        };
        let mut progress = Progress {
            time: start,
            ..Progress::default()
        };
        let now = Instant::now();
        let [none, later, over] = [(); 3].map(|()| StopTime::default());
        later.set(now + Duration::from_secs(3_600));
        over.set(now);
        for until in [none, later] {
            assert!(!progress.leaves(&arrival(7, 0.5), &until));
        }
        assert_eq!(progress.left, None);
        for (sequence, after_s) in [(8, 0.5), (9, 1.5)] {
            assert!(progress.leaves(&arrival(sequence, after_s), &over));
        }
        let left = Left {
            first_sequence: 8,
            span_s: 1.5,
        };
        assert_eq!(progress.left, Some(left));
    }
}
