//! Live pipeline of sources, recorder and engine. Only this module uses `acq` and `store` together.
//!
//! ```text
//! sources (tokio tasks) ─► Sequencer ─┬─► thread "recorder": arrivals ─────────► store::Recorder
//!                                     ├─► thread "engine": arrivals ─► records ─► store::Recorder
//!                                     └─► memory before a trigger, thread "live engine", triggers
//! ```
//!
//! The sources run from the start of the program to its end. A run begins and ends between two
//! arrivals: at the start of the program, with `atvrec start` and `stop`, at triggers, and with a new
//! configuration. Every run has its own engine, which begins with the first arrival of the run, so
//! that a replay of the run's files gives the same estimates.

mod heartbeat;
mod recovery;
mod run;

use std::collections::BTreeMap;
use std::future::Future;
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use acq::{LogClock, QueueSizes, RingLimits, Sequencer, SourceSpec, Supervisor};
use anyhow::Context;
use engine::config::Trigger;
use engine::{Config, Engine};
use sample::{Arrival, Health, LogTime, LossPlace, SourceId};
use store::{ClockState, Losses, Record, RecorderSummary};
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::mpsc;
use tokio::task::{JoinError, JoinSet};

use crate::control::{
    self, Command, CommandResult, ControlHandler, Listener, RecorderStatus, Writing,
};
use crate::folder::{Folder, Protected};
use crate::output_can::CanSink;
use crate::progress::StatusLine;
use crate::tap::Tap;
use crate::{retention, session, values};
use heartbeat::{Heartbeats, extend_stop, notify};
use run::{
    Files, Left, LiveEngine, Progress, RecordSink, Run, StopTime, TriggerEvent, join,
    watch_for_triggers,
};

/// Period of the ticks of the stream.
const TICK: Duration = Duration::from_millis(100);
/// Longest time that sources may take to end.
const STOP_DEADLINE: Duration = Duration::from_millis(1_000);
/// Time that is kept in memory in addition to the time before a trigger, while files are created.
const MEMORY_SLACK: Duration = Duration::from_secs(2);
/// Most arrivals that wait for the live engine and for the triggers.
const LISTENER_QUEUE: usize = 8_192;
/// Most trigger events that wait.
const TRIGGER_QUEUE: usize = 256;
/// Longest time for the truth of a simulation at the end.
const TRUTH_DEADLINE: Duration = Duration::from_secs(2);
/// Period of the line on the terminal.
const LINE_PERIOD: Duration = Duration::from_millis(500);
/// Most commands that wait.
const COMMAND_QUEUE: usize = 8;

/// Result of a recording.
#[derive(Debug, Default)]
pub struct Summary {
    /// The files that were written.
    pub files: Vec<PathBuf>,
    /// Duration, s.
    pub duration_s: f64,
    /// Number of arrivals of all sources.
    pub arrivals: u64,
    /// What was written to the disk.
    pub recorder: RecorderSummary,
    /// Health of each source, of the last run or of the time without a run.
    pub health: Health,
    /// Losses of all sources and runs.
    pub losses: Losses,
    /// Tasks that were aborted because they did not end in time.
    pub stuck: Vec<String>,
    /// What the engine of a run had not processed at the stop.
    pub left: Option<Left>,
    /// What arrived from each source, by name, over all runs.
    received: BTreeMap<String, Received>,
}

/// What arrived from a source.
#[derive(Debug, Default)]
struct Received {
    has_data: bool,
    /// What is wrong with the data of all runs so far.
    problem: Option<String>,
}

impl Summary {
    /// Losses of all sources by place: items, and for the disk arrivals.
    pub fn lost(&self) -> [u64; LossPlace::ALL.len()] {
        let mut lost = self.losses.totals();
        lost[LossPlace::Disk as usize] = self.losses.arrivals;
        lost
    }

    /// Whether raw data was lost, or a log was deleted, renamed or not closed.
    pub fn has_loss(&self) -> bool {
        self.losses.has_raw() || !self.recorder.gone.is_empty() || self.recorder.cut_off.is_some()
    }

    /// Sources from which nothing was understood, each with the reason, or that nothing was received at
    /// all. One silent device among others is no fault of the recording: it may be off on purpose.
    pub fn useless(&self) -> Vec<String> {
        if !self.received.values().any(|source| source.has_data) {
            let hint =
                "nothing was received from any source: `atvrec check` shows what each device sends";
            return vec![hint.to_owned()];
        }
        let sources = self.received.iter();
        let received = sources.filter(|(_, source)| source.has_data);
        received
            .filter_map(|(name, source)| Some(format!("{name}: {}", source.problem.as_ref()?)))
            .collect()
    }

    /// Adds what arrived in a run.
    fn receive(&mut self, engine: &Engine) {
        for run in engine.reception() {
            let problem = run.problem();
            let known = self.received.contains_key(&run.name);
            let source = self.received.entry(run.name).or_default();
            let has_data = run.bytes > 0 || run.frames > 0;
            // One run that was understood is enough.
            if !source.has_data || !known || problem.is_none() && has_data {
                source.problem = problem;
            }
            source.has_data |= has_data;
        }
    }

    fn add(&mut self, more: RecorderSummary) {
        self.files.extend(more.files.iter().map(|f| f.path.clone()));
        let all = &mut self.recorder;
        all.files.extend(more.files);
        all.unfinished.extend(more.unfinished);
        all.gone.extend(more.gone);
        all.cut_off = more.cut_off.or(all.cut_off.take());
        all.last_failure = more.last_failure.or(all.last_failure.take());
    }
}

/// Function that reads the configuration again.
pub type Reload<'a> = &'a dyn Fn() -> anyhow::Result<Config>;

/// What a recording does beside recording.
#[derive(Default)]
pub struct Extras<'a> {
    /// Reads the configuration again.
    pub reload: Option<Reload<'a>>,
    /// Control sockets at which the recorder is found too, if no other recorder has them.
    pub also_found_at: Vec<PathBuf>,
    /// Truth of a simulation, with times of the log clock.
    pub truth: Option<mpsc::Receiver<Record>>,
    /// Receives the log clock at the start.
    pub clock: Option<std::sync::mpsc::Sender<LogClock>>,
    /// Whether the state is shown as a line on the terminal.
    pub shows_line: bool,
    /// File that says whether the computer's clock is synchronised, if the kernel does not.
    pub clock_state: Option<PathBuf>,
}

/// Records until `stop` is ready, then stops sources, stream, threads and files in this order.
pub async fn record(
    config: Config,
    extras: Extras<'_>,
    stop: impl Future<Output = ()>,
) -> anyhow::Result<Summary> {
    let begin = Instant::now();
    let mut hangup = signal(SignalKind::hangup()).context("cannot listen for SIGHUP")?;
    // The folder is locked before any file is created in it: another recorder may own it.
    let folder = Folder::take(&config.storage.directory)?;
    let sockets = control::paths(&config);
    let (commands, mut received) = mpsc::channel(COMMAND_QUEUE);
    let (trigger_events, mut triggers) = mpsc::channel(TRIGGER_QUEUE);
    let mut controller = RecordingController::new(config, &extras, trigger_events, folder)?;
    controller.start().await?;
    if let Some(clock) = &extras.clock {
        // A receiver that has gone needs no clock.
        let _ = clock.send(*controller.sequencer.clock());
    }
    // The sockets are opened after the start: a client that finds them finds a recorder that records.
    let listener = open_control(&sockets);
    notify(&[sd_notify::NotifyState::Ready]);
    controller.check_folder();

    let handler = ControlHandler {
        sequencer: controller.sequencer.clone(),
        status: Arc::clone(&controller.status),
        commands,
        tap: controller.tap.clone(),
    };
    let watchdog = tokio::spawn(controller.heartbeats.clone().watch());
    let views = Views::start(&handler, &sockets, extras.truth, extras.shows_line);
    let mut serving = Box::pin(serve_both(listener, &extras.also_found_at, handler));
    let mut stop = std::pin::pin!(stop);
    let mut retention = Box::pin(controller.retention());
    loop {
        let trigger_ends = sleep_for(controller.remaining_trigger_time());
        tokio::select! {
            biased;
            () = &mut stop => break,
            () = &mut serving => {}
            Some((command, reply)) = received.recv() => {
                let result = controller.handle_command(command).await;
                // The client may have disconnected.
                let _ = reply.send(result);
                retention = Box::pin(controller.retention());
            }
            _ = hangup.recv() => {
                if let Err(error) = controller.reload().await {
                    tracing::error!(
                        "cannot reload the configuration; the recording continues with the \
                         previous one: {error:#}"
                    );
                }
                retention = Box::pin(controller.retention());
            }
            Some(event) = triggers.recv() => controller.handle_trigger(event).await,
            () = trigger_ends => controller.pause(),
            Some(closed) = controller.closing.join_next() => controller.closed(closed),
            () = &mut retention => {}
        }
    }
    watchdog.abort();
    views.stop().await;
    notify(&[sd_notify::NotifyState::Stopping]);
    drop(serving);
    drop(triggers);
    let mut summary = controller.finish().await?;
    summary.duration_s = begin.elapsed().as_secs_f64();
    Ok(summary)
}

/// Tells the service manager that the program is ready.
#[cfg(feature = "live")]
pub fn ready() {
    notify(&[sd_notify::NotifyState::Ready]);
}

/// Opens the control socket. If that fails, the recording continues without a socket.
fn open_control(paths: &[PathBuf]) -> Option<Listener> {
    match Listener::open(paths) {
        Ok(listener) => {
            tracing::info!(path = %listener.path().display(), "opened the control socket");
            Some(listener)
        }
        Err(error) => {
            tracing::warn!(
                "cannot open the control socket; recording continues, but mark, status, start, \
                 stop and reload cannot reach this recorder: {error:#}"
            );
            None
        }
    }
}

/// Tasks that show the recording, beside it.
struct Views {
    tap: Tap,
    serving: tokio::task::JoinHandle<()>,
    line: tokio::task::JoinHandle<()>,
    truth: tokio::task::JoinHandle<()>,
}

impl Views {
    fn start(
        handler: &ControlHandler,
        sockets: &[PathBuf],
        truth: Option<mpsc::Receiver<Record>>,
        shows_line: bool,
    ) -> Self {
        let tap = handler.tap.clone();
        Self {
            serving: tokio::spawn(serve_tap(tap.clone(), control::tap_paths(sockets))),
            line: tokio::spawn(show_line(shows_line, handler.clone())),
            truth: tokio::spawn(write_truth(truth, handler.clone())),
            tap,
        }
    }

    async fn stop(self) {
        self.serving.abort();
        self.line.abort();
        // A simulation has ended before the recording: all of its truth waits.
        let _ = tokio::time::timeout(TRUTH_DEADLINE, self.truth).await;
        self.tap.close();
    }
}

/// Serves the control socket, and the first of the other sockets that no recorder has.
async fn serve_both(listener: Option<Listener>, also: &[PathBuf], handler: ControlHandler) {
    let other = match also {
        [] => None,
        paths => Listener::open(paths).ok(),
    };
    tokio::join!(serve(listener, handler.clone()), serve(other, handler));
}

/// Serves the tap; without it, recording continues.
async fn serve_tap(tap: Tap, paths: Vec<PathBuf>) {
    match Listener::open(&paths) {
        Ok(listener) => {
            tracing::debug!(path = %listener.path().display(), "opened the tap");
            tap.serve(listener).await;
        }
        Err(error) => tracing::warn!(
            "cannot open the tap; recording continues, but `atvrec live` cannot show it: {error:#}"
        ),
    }
}

/// Writes the truth of a simulation.
async fn write_truth(truth: Option<mpsc::Receiver<Record>>, handler: ControlHandler) {
    let Some(mut truth) = truth else {
        return;
    };
    while let Some(record) = truth.recv().await {
        handler.tap.push(&record);
        if let Some(recorder) = handler.status.recorder() {
            recorder.record(record);
        }
    }
}

/// Shows the state of the recorder on one line of the terminal.
async fn show_line(shows: bool, handler: ControlHandler) {
    if !shows {
        return std::future::pending().await;
    }
    let line = StatusLine::new();
    let mut interval = tokio::time::interval(LINE_PERIOD);
    loop {
        interval.tick().await;
        line.show(&values::line(&control::status(&handler)));
    }
}

async fn serve(listener: Option<Listener>, handler: ControlHandler) {
    match listener {
        Some(listener) => listener.serve(handler).await,
        None => std::future::pending().await,
    }
}

/// Sleeps for this time; for ever if there is none.
async fn sleep_for(time: Option<Duration>) {
    match time {
        Some(time) => tokio::time::sleep(time).await,
        None => std::future::pending().await,
    }
}

/// Controls when files are written, and with which configuration.
struct RecordingController<'a> {
    config: Arc<Config>,
    reload: Option<Reload<'a>>,
    sequencer: Sequencer,
    supervisor: Supervisor,
    heartbeats: Heartbeats,
    engines_until: StopTime,
    status: Arc<RecorderStatus>,
    trigger_events: mpsc::Sender<TriggerEvent>,
    run: Option<Run>,
    /// End of a triggered run; `None` for a run without a trigger.
    run_end: Option<LogTime>,
    live: Option<JoinHandle<Health>>,
    /// Tasks for the triggers and the live engine; they end when the set is dropped.
    listeners: JoinSet<()>,
    closing: JoinSet<Closed>,
    /// Progress of the files that are closed at present.
    closing_files: Vec<store::Progress>,
    summary: Summary,
    /// Error of the first run that failed.
    failed: Option<anyhow::Error>,
    /// Log folders that this process owns.
    folders: Vec<Folder>,
    /// Runs whose logs retention does not remove.
    protected: Protected,
    /// State of the host's clock when the log clock was set from it.
    clock: ClockState,
    /// Tap of the live process.
    tap: Tap,
    /// Output to controllers.
    can: Option<CanSink>,
}

type Closed = anyhow::Result<(RecorderSummary, Engine, Progress)>;

impl<'a> RecordingController<'a> {
    fn new(
        config: Config,
        extras: &Extras<'a>,
        trigger_events: mpsc::Sender<TriggerEvent>,
        folder: Folder,
    ) -> anyhow::Result<Self> {
        let log_clock = LogClock::start();
        let clock = session::clock_state(log_clock.now(), extras.clock_state.as_deref());
        let sequencer = Sequencer::idle(log_clock);
        let (session, hello) = session::tap(&config, log_clock.now());
        let can = CanSink::start(&config, log_clock)?;
        let status = Arc::new(RecorderStatus::new(&config));
        status.set_can(can.clone());
        Ok(Self {
            tap: Tap::new(log_clock, session, hello),
            can,
            status,
            config: Arc::new(config),
            reload: extras.reload,
            supervisor: Supervisor::new(sequencer.clone()),
            sequencer,
            heartbeats: Heartbeats::default(),
            engines_until: StopTime::default(),
            trigger_events,
            run: None,
            run_end: None,
            live: None,
            listeners: JoinSet::new(),
            closing: JoinSet::new(),
            closing_files: Vec::new(),
            summary: Summary::default(),
            failed: None,
            folders: vec![folder],
            protected: Protected::default(),
            clock,
        })
    }

    /// Sink of the records of an engine.
    fn sink(
        &self,
        shows: bool,
        events: Option<(Arc<Trigger>, mpsc::Sender<TriggerEvent>)>,
    ) -> RecordSink {
        RecordSink {
            status: Arc::clone(&self.status),
            shows,
            tap: self.tap.clone(),
            can: self.can.clone(),
            events,
        }
    }

    /// Warns of limits that cannot be met and of an implausible clock, and starts the recovery of
    /// unfinished logs in the background.
    fn check_folder(&self) {
        let storage = &self.config.storage;
        let rate = self.status.disk_forecast().rate_bytes_s;
        let options = &storage.options;
        for text in retention::warnings(&storage.directory, storage.limits, options, rate) {
            tracing::warn!("{text}");
        }
        if self.clock.is_implausible() {
            tracing::warn!(
                clock = self.clock.name(),
                "the date of the computer's clock may be wrong; the names of the logs contain \
                 \"unsynced\" until a GNSS receiver gives the date"
            );
        }
        recovery::start(storage.directory.clone(), self.protected.clone());
    }

    async fn start(&mut self) -> anyhow::Result<()> {
        if self.config.storage.trigger.is_none() {
            self.begin_run(Arc::clone(&self.config), None, None).await?;
        }
        self.start_listeners()?;
        self.supervisor.spawn_ticks(TICK);
        for spec in specs(&self.config) {
            self.supervisor.spawn(spec);
        }
        let sources = self.config.sources.len();
        let state = self.status.writing();
        tracing::info!(sources, "{state}; {}", self.status.disk_forecast());
        Ok(())
    }

    fn retention(&self) -> impl Future<Output = ()> + use<> {
        let storage = &self.config.storage;
        let (protected, status) = (self.protected.clone(), Arc::clone(&self.status));
        retention::enforce_periodically(
            storage.directory.clone(),
            storage.limits,
            protected,
            status,
        )
    }

    async fn handle_command(&mut self, command: Command) -> CommandResult {
        match command {
            Command::Start => {
                self.run_end = None;
                if self.run.is_none() {
                    let config = Arc::clone(&self.config);
                    self.begin_run(config, None, None).await?;
                }
                self.status.set_writing(Writing::Always);
            }
            Command::Stop => self.stop().await?,
            Command::Reload => self.reload().await?,
        }
        Ok(self.status.writing().to_string())
    }

    /// Begins a run, and ends the present one if there is one. `numbers` are the new numbers of the
    /// sources if `config` is another configuration.
    async fn begin_run(
        &mut self,
        config: Arc<Config>,
        since: Option<LogTime>,
        numbers: Option<Numbers>,
    ) -> anyhow::Result<()> {
        let started = since.unwrap_or_else(|| self.sequencer.clock().now());
        let engine = Engine::new(&config)?;
        let shows = match numbers {
            Some(_) => config.storage.trigger.is_none(),
            None => self.live.is_none(),
        };
        let sink = self.sink(shows, None);
        let (clock, protected) = (self.clock, self.protected.clone());
        let ledger = self.sequencer.ledger();
        let open = move || Files::open(&config, started, clock, &protected, &ledger);
        let files = tokio::task::spawn_blocking(open);
        let files = files.await.context("cannot create the files")??;
        let numbers = numbers.unwrap_or_default();
        let sizes = QueueSizes::default();
        let streams = self.sequencer.begin(sizes, since, &numbers);
        self.status.begin_run(files.recorder());
        let sequencer = self.sequencer.clone();
        let (heartbeats, until) = (&self.heartbeats, self.engines_until.clone());
        let next = Run::start(files, engine, sequencer, streams, heartbeats, sink, until)?;
        if let Some(old) = self.run.replace(next) {
            self.close(old, None);
        }
        self.status.set_writing(Writing::Always);
        Ok(())
    }

    /// Closes a run's files in the background.
    fn close(&mut self, run: Run, deadline: Option<Instant>) {
        if self.closing.is_empty() {
            self.closing_files.clear();
        }
        self.closing_files.push(run.recorder.progress());
        self.closing.spawn_blocking(move || run.finish(deadline));
    }

    fn closed(&mut self, closed: Result<Closed, JoinError>) {
        match closed.context("cannot close the files").and_then(|c| c) {
            Ok((more, engine, progress)) => {
                self.summary.add(more);
                self.summary.health = engine.health(progress.time);
                self.summary.left = progress.left.or(self.summary.left);
                self.summary.receive(&engine);
            }
            Err(error) => {
                tracing::error!("a run ended with an error: {error:#}");
                self.failed.get_or_insert(error);
            }
        }
    }

    /// Starts a triggered run, which begins with the arrivals in memory before the trigger, or
    /// extends the present one.
    async fn handle_trigger(&mut self, event: TriggerEvent) {
        let Some(trigger) = self.config.storage.trigger.clone() else {
            return;
        };
        let run_end = event.time + nanos(trigger.post);
        if self.run.is_some() {
            self.run_end = self.run_end.map(|before| before.max(run_end));
            return;
        }
        let since = LogTime(
            event
                .time
                .0
                .saturating_sub(nanos(trigger.memory.duration) as u64),
        );
        let config = Arc::clone(&self.config);
        match self.begin_run(config, Some(since), None).await {
            Ok(()) => {
                self.run_end = Some(run_end);
                tracing::info!(reason = %event.reason, "triggered");
                self.status.set_writing(Writing::Triggered(event.reason));
            }
            Err(error) => tracing::error!(
                reason = %event.reason,
                "cannot record the data of a trigger: {error:#}"
            ),
        }
    }

    /// Time until the end of a triggered run.
    fn remaining_trigger_time(&self) -> Option<Duration> {
        let run_end = self.run_end.filter(|_| self.run.is_some())?;
        let remaining_ns = run_end - self.sequencer.clock().now();
        Some(Duration::from_nanos(
            u64::try_from(remaining_ns).unwrap_or(0),
        ))
    }

    /// Ends the run; sources and live engine continue.
    fn pause(&mut self) {
        self.run_end = None;
        self.sequencer.pause();
        if let Some(run) = self.run.take() {
            self.close(run, None);
        }
        self.status.set_writing(self.writing_without_run());
        tracing::info!("{}", self.status.writing());
    }

    fn writing_without_run(&self) -> Writing {
        match &self.config.storage.trigger {
            Some(_) => Writing::Armed,
            None => Writing::Stopped,
        }
    }

    /// Ends the run and waits for its files. Its engine becomes the live engine if there is none.
    async fn stop(&mut self) -> anyhow::Result<()> {
        let Some(run) = self.run.take() else {
            return Ok(());
        };
        self.run_end = None;
        let queue = self.live.is_none().then(|| self.listen());
        self.sequencer.pause();
        self.status.set_writing(self.writing_without_run());
        let closed = tokio::task::spawn_blocking(move || run.finish(None));
        let (summary, engine, progress) = closed.await.context("cannot close the files")??;
        self.summary.add(summary);
        if let Some(queue) = queue {
            let live = LiveEngine {
                next_sequence: progress.next_sequence,
                engine,
                queue,
                sink: self.sink(true, None),
                until: self.engines_until.clone(),
            };
            self.live = Some(live.start(&self.heartbeats)?);
        }
        tracing::info!("{}", self.status.writing());
        Ok(())
    }

    /// Starts the tasks that wait for triggers, if the configuration has triggers, and the live
    /// engine, if no run has an engine.
    fn start_listeners(&mut self) -> anyhow::Result<()> {
        // Listeners of the previous configuration end here.
        self.listeners = JoinSet::new();
        self.live = None;
        let trigger = self.config.storage.trigger.clone().map(Arc::new);
        let memory = trigger.as_deref().map_or_else(RingLimits::default, memory);
        self.sequencer.keep(memory);
        if let Some(trigger) = &trigger {
            let queue = self.sequencer.listen(LISTENER_QUEUE);
            let events = self.trigger_events.clone();
            self.listeners
                .spawn(watch_for_triggers(Arc::clone(trigger), queue, events));
        }
        if trigger.is_some() || self.run.is_none() {
            let events = trigger.map(|trigger| (trigger, self.trigger_events.clone()));
            let live = LiveEngine {
                next_sequence: 0,
                engine: Engine::new(&self.config)?,
                queue: self.listen(),
                sink: self.sink(true, events),
                until: self.engines_until.clone(),
            };
            self.live = Some(live.start(&self.heartbeats)?);
        }
        if self.run.is_none() {
            self.status.set_writing(self.writing_without_run());
        }
        Ok(())
    }

    /// Queue of all arrivals; it ends when the configuration changes.
    fn listen(&mut self) -> mpsc::Receiver<Arc<Arrival>> {
        let mut from = self.sequencer.listen(LISTENER_QUEUE);
        let (to, queue) = mpsc::channel(1);
        self.listeners.spawn(async move {
            while let Some(arrival) = from.recv().await {
                if to.send(arrival).await.is_err() {
                    return;
                }
            }
        });
        queue
    }

    /// Reloads the configuration: a new run begins between two arrivals, and unchanged sources
    /// continue.
    async fn reload(&mut self) -> anyhow::Result<()> {
        let Some(reload) = self.reload else {
            anyhow::bail!("this recording has no configuration file");
        };
        let config = Arc::new(reload()?);
        // The engine checks the configuration further, before anything changes.
        Engine::new(&config)?;
        let directory = &config.storage.directory;
        let is_new = !self.folders.iter().any(|folder| folder.is(directory));
        if is_new {
            self.folders.push(Folder::take(directory)?);
        }
        if control::paths(&config) != control::paths(&self.config) {
            tracing::warn!("the new path of the control socket is used from the next start on");
        }
        let clock = *self.sequencer.clock();
        if config.output.can != self.config.output.can {
            self.can = CanSink::start(&config, clock)?;
            self.status.set_can(self.can.clone());
        }
        let (session, hello) = session::tap(&config, clock.now());
        self.tap.restart(session, hello);
        let specs = specs(&config);
        let numbers = self.supervisor.numbers(&specs);
        let stopped = self.run.is_none() && self.config.storage.trigger.is_none();
        if self.run.is_some() || (config.storage.trigger.is_none() && !stopped) {
            let writing = self.status.writing();
            self.begin_run(Arc::clone(&config), None, Some(numbers))
                .await?;
            self.run_end = self.run_end.filter(|_| config.storage.trigger.is_some());
            if self.run_end.is_some() {
                self.status.set_writing(writing);
            }
        } else {
            self.sequencer.renumber(&numbers);
        }
        self.config = config;
        self.status.reload(&self.config);
        self.start_listeners()?;
        if let Err(stuck) = self.supervisor.apply(specs, STOP_DEADLINE).await {
            tracing::warn!(%stuck, "sources did not end in time and were aborted");
            self.summary.stuck.extend(stuck.names);
        }
        if is_new {
            self.check_folder();
        }
        let sources = self.config.sources.len();
        tracing::info!(sources, "reloaded the configuration");
        Ok(())
    }

    /// Stops sources, stream, threads and files in this order. Engines that are far behind leave the files
    /// half of the time to stop; a replay computes what they left.
    async fn finish(mut self) -> anyhow::Result<Summary> {
        let (now, within) = (Instant::now(), self.config.storage.options.stop_within);
        let deadline = now + within;
        self.engines_until.set(now + within / 2);
        let empty = Supervisor::new(self.sequencer.clone());
        let supervisor = std::mem::replace(&mut self.supervisor, empty);
        if let Err(stuck) = supervisor.stop(STOP_DEADLINE).await {
            tracing::warn!(%stuck, "sources did not end in time and were aborted");
            self.summary.stuck.extend(stuck.names);
        }
        self.summary.arrivals = self.sequencer.next_sequence();
        self.sequencer.finish();
        if let Some(live) = self.live.take() {
            let ended = tokio::task::spawn_blocking(move || join("live engine", live));
            self.summary.health = ended.await.context("the live engine failed")??;
        }
        if let Some(run) = self.run.take() {
            self.close(run, Some(deadline));
        }
        let extending = tokio::spawn(extend_stop(self.closing_files.clone()));
        while let Some(closed) = self.closing.join_next().await {
            self.closed(closed);
        }
        extending.abort();
        self.summary.losses = self.sequencer.ledger().losses();
        match self.failed {
            Some(error) => Err(error),
            None => {
                self.summary.files.sort();
                Ok(self.summary)
            }
        }
    }
}

/// New numbers of the running sources, by the numbers with which they were started.
type Numbers = BTreeMap<SourceId, Option<SourceId>>;

/// Limits of the memory before a trigger, with a margin of [`MEMORY_SLACK`].
fn memory(trigger: &Trigger) -> RingLimits {
    RingLimits {
        duration: trigger.memory.duration + MEMORY_SLACK,
        ..trigger.memory
    }
}

fn nanos(duration: Duration) -> i64 {
    i64::try_from(duration.as_nanos()).unwrap_or(i64::MAX)
}

fn specs(config: &Config) -> Vec<SourceSpec> {
    config
        .sources
        .iter()
        .map(|source| source.spec.clone())
        .collect()
}
