//! One run: its files, and the two threads that write into them.

use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use acq::{Sequencer, Streams};
use anyhow::Context;
use engine::config::Trigger;
use engine::{Config, Engine};
use sample::{Arrival, Event, EventKind, Health, LogTime, LossPlace, Notice, Payload, Severity};
use store::{
    ClockState, DiskState, LogMessage, LossLedger, Losses, Record, Recorder, RecorderSummary,
};
use tokio::sync::mpsc;

use super::pulse::{Pulse, Pulses};
use crate::board::Board;
use crate::folder::{self, Protected, RunGuard, RunName};
use crate::session;

/// Arrivals and records that may wait for the writer while a backlog is taken in.
const BACKLOG_WAITING_MAX: usize = 8_192;
/// Pause while more wait.
const BACKLOG_PAUSE: Duration = Duration::from_millis(2);
/// The recorder and the engine look this often for what has come: to be woken for each arrival would
/// cost several times the work on it. Stamps are set before, in the sources. A kill loses what was
/// not handed over, and what the journal has not taken in hand since.
const RECORDER_PAUSE: Duration = Duration::from_millis(25);
/// The pause of an engine that estimates, and of one that only decodes.
const ESTIMATOR_PAUSE: Duration = Duration::from_millis(5);
const DECODER_PAUSE: Duration = Duration::from_millis(50);
/// Arrivals taken at once.
const ARRIVALS_MAX: usize = 4_096;
/// While so many wait, there is no pause.
const ARRIVALS_MANY: usize = 1_024;
/// Between two looks at the disk: what is lost, and what waits for it.
const DISK_INTERVAL: Duration = Duration::from_secs(1);
/// Between two warnings of a slow disk.
const SLOW_DISK_WARNING_INTERVAL: Duration = Duration::from_secs(10);
/// A disk is slow if arrivals of this much time wait for it,
const SLOW_DISK_SPAN: Duration = Duration::from_secs(2);
/// or if they take this part of the writer's queue, per cent,
const SLOW_DISK_FILL: u8 = 10;
/// or if it has not confirmed what was written for this time.
const SLOW_DISK_UNSYNCED: Duration = Duration::from_secs(3);

/// A run of files that is being written.
pub struct Run {
    /// Writes them.
    pub recorder: Arc<Recorder>,
    raw: JoinHandle<()>,
    engine: JoinHandle<(Engine, Progress)>,
    pulses: [Arc<Pulse>; 2],
    name: RunName,
    /// Retention leaves the logs alone until they are closed.
    _guard: RunGuard,
}

/// How far an engine has come.
#[derive(Clone, Copy, Debug, Default)]
pub struct Progress {
    /// Log clock of its last arrival.
    pub time: LogTime,
    /// Number of its next arrival.
    pub next_sequence: u64,
}

/// The files of a run; made beforehand, so that the run begins between two arrivals.
pub struct Files {
    recorder: Arc<Recorder>,
    name: RunName,
    guard: RunGuard,
}

impl Files {
    /// Makes the files of a run that starts at `started` by a clock in the state `clock`.
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

    /// What writes them.
    pub const fn recorder(&self) -> &Arc<Recorder> {
        &self.recorder
    }
}

impl Run {
    /// Begins to write `streams` and what `engine` makes of them.
    pub fn start(
        files: Files,
        engine: Engine,
        sequencer: Sequencer,
        streams: Streams,
        pulses: &Pulses,
        voice: Voice,
    ) -> anyhow::Result<Self> {
        let Files {
            recorder,
            name,
            guard,
        } = files;
        let pulse = [pulses.add("recorder"), pulses.add("engine")];
        let estimates = streams.estimator.context("a stream without estimator")?;
        let raw = Raw {
            recorder: Arc::clone(&recorder),
            backlog: streams.backlog.clone(),
            queue: streams.recorder,
            pulse: Arc::clone(&pulse[0]),
            sequencer,
            stated: Losses::default(),
            checked_at: Instant::now(),
            warned_at: None,
        };
        let worker = Estimates {
            engine,
            recorder: Arc::clone(&recorder),
            backlog: streams.backlog,
            queue: estimates,
            pulse: Arc::clone(&pulse[1]),
            voice,
        };
        Ok(Self {
            recorder,
            raw: spawn("recorder", move || raw.run())?,
            engine: spawn("engine", move || worker.run())?,
            pulses: pulse,
            name,
            _guard: guard,
        })
    }

    /// Waits until the stream, which has ended, is worked off, and closes the files, until `deadline`
    /// or within the configured time. Gives the engine back.
    pub fn finish(
        self,
        deadline: Option<Instant>,
    ) -> anyhow::Result<(RecorderSummary, Engine, Progress)> {
        drop(self.pulses);
        let engine = join("engine", self.engine);
        join("recorder", self.raw)?;
        let recorder =
            Arc::into_inner(self.recorder).context("a thread still holds the recorder")?;
        let mut summary = match deadline {
            Some(deadline) => recorder.finish_by(deadline)?,
            None => recorder.finish()?,
        };
        let (engine, progress) = engine?;
        if summary.cut_off.is_some() {
            // The disk does not answer in time: the next start gives the names.
            return Ok((summary, engine, progress));
        }
        // Renamed under the names' guard: retention must not meet half of it.
        match self.name.rename(engine.utc_offset()) {
            Ok(Some((old, new))) => rename_in(&mut summary, &old, &new),
            Ok(None) => {}
            Err(error) => tracing::warn!(%error, "the logs keep their names until the next start"),
        }
        folder::count_run(&self.name.directory, self.name.number);
        Ok((summary, engine, progress))
    }
}

/// The files' paths after their stem has changed.
fn rename_in(summary: &mut RecorderSummary, old: &str, new: &str) {
    for file in &mut summary.files {
        let name = file.path.file_name().unwrap_or_default().to_string_lossy();
        if let Some(rest) = name.strip_prefix(old) {
            let renamed = file.path.with_file_name(format!("{new}{rest}"));
            // One whose new name was taken has kept its old one.
            if renamed.exists() {
                file.path = renamed;
            }
        }
    }
}

/// The thread that hands arrivals to the recorder.
struct Raw {
    recorder: Arc<Recorder>,
    backlog: Vec<Arc<Arrival>>,
    queue: mpsc::Receiver<Arc<Arrival>>,
    pulse: Arc<Pulse>,
    sequencer: Sequencer,
    /// Losses on the way to the disk that notices of the stream state.
    stated: Losses,
    checked_at: Instant,
    /// When the last warning of a slow disk was given.
    warned_at: Option<Instant>,
}

impl Raw {
    fn run(mut self) {
        for arrival in std::mem::take(&mut self.backlog) {
            wait_for_room(&self.recorder, &self.queue);
            self.take(arrival);
        }
        let mut taken = Vec::new();
        while take_what_came(&mut self.queue, &mut taken, RECORDER_PAUSE) {
            let arrivals = taken.drain(..).map(Arc::unwrap_or_clone);
            self.recorder.push_all(arrivals.collect());
            self.pulse.beat();
            self.check_disk();
        }
    }

    fn take(&self, arrival: Arc<Arrival>) {
        self.recorder.push(Arc::unwrap_or_clone(arrival));
        self.pulse.beat();
    }

    /// Looks at the disk: losses become notices of the stream, and a slow disk a warning.
    fn check_disk(&mut self) {
        if self.checked_at.elapsed() < DISK_INTERVAL {
            return;
        }
        self.checked_at = Instant::now();
        let status = self.recorder.status();
        for (source, count) in status.losses.since(&self.stated).at(LossPlace::Disk) {
            let place = LossPlace::Disk;
            self.sequencer.notice(source, Notice::Lost { place, count });
        }
        self.stated = status.losses;
        let backlog = status.backlog;
        let slow = backlog.span >= SLOW_DISK_SPAN
            || backlog.queue_fill >= SLOW_DISK_FILL
            || backlog.unsynced >= SLOW_DISK_UNSYNCED;
        let quiet = |at: Instant| at.elapsed() < SLOW_DISK_WARNING_INTERVAL;
        let refuses = matches!(status.disk, DiskState::Failing { .. });
        if !slow || refuses || self.warned_at.is_some_and(quiet) {
            return;
        }
        self.warned_at = Some(Instant::now());
        tracing::warn!(
            arrivals = backlog.arrivals,
            bytes = backlog.bytes,
            seconds = backlog.span.as_secs_f64(),
            queue_percent = backlog.queue_fill,
            unsynced_s = backlog.unsynced.as_secs_f64(),
            "the disk is too slow: data waits for it, and is lost when the queue is full"
        );
    }
}

/// Waits for arrivals and takes all that are there, then pauses unless there were very many; `false`
/// at the end of the queue.
fn take_what_came(
    queue: &mut mpsc::Receiver<Arc<Arrival>>,
    taken: &mut Vec<Arc<Arrival>>,
    pause: Duration,
) -> bool {
    if !queue.is_closed() && queue.len() < ARRIVALS_MANY {
        thread::sleep(pause);
    }
    queue.blocking_recv_many(taken, ARRIVALS_MAX) > 0
}

/// The thread that estimates for the files.
struct Estimates {
    engine: Engine,
    recorder: Arc<Recorder>,
    backlog: Vec<Arc<Arrival>>,
    queue: mpsc::Receiver<Arc<Arrival>>,
    pulse: Arc<Pulse>,
    voice: Voice,
}

impl Estimates {
    fn run(mut self) -> (Engine, Progress) {
        let mut progress = Progress::default();
        let mut records = Vec::new();
        for arrival in std::mem::take(&mut self.backlog) {
            wait_for_room(&self.recorder, &self.queue);
            self.step(&arrival, &mut records, &mut progress);
        }
        let mut taken = Vec::new();
        let pause = if self.engine.estimates() {
            ESTIMATOR_PAUSE
        } else {
            DECODER_PAUSE
        };
        while take_what_came(&mut self.queue, &mut taken, pause) {
            for arrival in taken.drain(..) {
                self.step(&arrival, &mut records, &mut progress);
            }
        }
        (self.engine, progress)
    }

    fn step(&mut self, arrival: &Arrival, records: &mut Vec<Record>, progress: &mut Progress) {
        self.engine.push(arrival, records);
        for record in records.drain(..) {
            self.voice.hear(&record, arrival);
            self.recorder.record(record);
        }
        *progress = Progress {
            time: arrival.log_time,
            next_sequence: arrival.sequence + 1,
        };
        self.pulse.beat();
    }
}

/// Waits until the writer has caught up, but not beyond the end of the stream: the disk may hang.
fn wait_for_room(recorder: &Recorder, queue: &mpsc::Receiver<Arc<Arrival>>) {
    while recorder.waiting() > BACKLOG_WAITING_MAX && !queue.is_closed() {
        thread::sleep(BACKLOG_PAUSE);
    }
}

/// An engine that nobody writes down: it says what is the matter and looks out for events.
pub struct Live {
    /// Number of the first arrival that it has not seen.
    pub next_sequence: u64,
    /// The machine.
    pub engine: Engine,
    /// What it gets.
    pub queue: mpsc::Receiver<Arc<Arrival>>,
    /// What it does with what it finds.
    pub voice: Voice,
}

impl Live {
    /// Lets it run until its queue ends.
    pub fn start(mut self, pulses: &Pulses) -> anyhow::Result<JoinHandle<Health>> {
        let pulse = pulses.add("live engine");
        let run = move || {
            let mut records = Vec::new();
            let mut last = LogTime::default();
            while let Some(arrival) = self.queue.blocking_recv() {
                pulse.beat();
                if arrival.sequence < self.next_sequence {
                    continue;
                }
                last = arrival.log_time;
                self.engine.push(&arrival, &mut records);
                for record in records.drain(..) {
                    self.voice.hear(&record, &arrival);
                }
            }
            self.engine.health(last)
        };
        spawn("live engine", run)
    }
}

/// A trigger that was met.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fired {
    /// When.
    pub time: LogTime,
    /// What it was, for people.
    pub reason: String,
}

/// What is done with an engine's records beside writing them.
#[derive(Clone)]
pub struct Voice {
    /// Where sensors that are left out are written up.
    pub board: Arc<Board>,
    /// What the log says to people is said on the terminal too.
    pub aloud: bool,
    /// Events that are triggers, and where to tell of them.
    pub events: Option<(Arc<Trigger>, mpsc::Sender<Fired>)>,
}

impl Voice {
    fn hear(&self, record: &Record, arrival: &Arrival) {
        match record {
            // What happened to a source itself, the source has said on the terminal.
            Record::Log(message)
                if self.aloud && !matches!(arrival.payload, Payload::Notice(_)) =>
            {
                say(message);
            }
            Record::Event(event) => {
                if self.aloud {
                    announce(event);
                }
                let Some((trigger, fired)) = &self.events else {
                    return;
                };
                if trigger.fires_on(event) {
                    // At the end nobody listens any more.
                    let _ = fired.blocking_send(Fired {
                        time: event.time,
                        reason: event.text.clone(),
                    });
                }
            }
            Record::Health(health) if self.aloud => {
                self.board.set_faulty_sensors(health.faulty_sensors.clone());
            }
            _ => {}
        }
    }
}

/// Tells a person what needs a look at the rig; lifts and surfaces are the drive's own.
fn announce(event: &Event) {
    let text = &event.text;
    match event.kind {
        EventKind::SensorFault(_) | EventKind::FilterReset => {
            tracing::warn!(source = "estimator", "{text}");
        }
        EventKind::SensorRecovered(_) | EventKind::FilterRecovered => {
            tracing::info!(source = "estimator", "{text}")
        }
        _ => {}
    }
}

fn say(message: &LogMessage) {
    let (name, text) = (&message.name, &message.text);
    match message.severity {
        Severity::Info => tracing::info!(source = %name, "{text}"),
        Severity::Warning => tracing::warn!(source = %name, "{text}"),
        Severity::Error => tracing::error!(source = %name, "{text}"),
    }
}

/// Looks for marks and frames that are triggers, until the queue ends.
pub async fn judge(
    trigger: Arc<Trigger>,
    mut queue: mpsc::Receiver<Arc<Arrival>>,
    fired: mpsc::Sender<Fired>,
) {
    while let Some(arrival) = queue.recv().await {
        if let Some(reason) = trigger.fires(&arrival) {
            let time = arrival.log_time;
            if fired.send(Fired { time, reason }).await.is_err() {
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
        .with_context(|| format!("cannot start the thread {name}"))
}

/// Waits for a thread.
pub fn join<T>(name: &str, thread: JoinHandle<T>) -> anyhow::Result<T> {
    thread
        .join()
        .map_err(|_| anyhow::anyhow!("the thread {name} ended with a panic; see its message above"))
}
