//! The live pipeline: sources, recorder, engine. The only place that sees `acq` and `store`
//! together.
//!
//! ```text
//! sources (tokio tasks) ─► Sequencer ─┬─► thread "recorder": arrivals ─────────► store::Recorder
//!                                     ├─► thread "engine": arrivals ─► records ─► store::Recorder
//!                                     └─► memory before a trigger, thread "live engine", triggers
//! ```
//!
//! The sources run from start to end. Runs of files come and go: at the start, with `atvrec start`
//! and `stop`, at triggers, and with a new configuration, each between two arrivals. Every run has
//! an engine of its own that begins with its first arrival, so that a replay of its files finds the
//! same.

mod pulse;
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
use store::{ClockState, Losses, RecorderSummary};
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::mpsc;
use tokio::task::{JoinError, JoinSet};

use crate::control::{self, Answer, Board, Desk, Listener, Order, Writing};
use crate::folder::{Folder, Protected};
use crate::{retention, session};
use pulse::{Pulses, extend_stop, notify};
use run::{Files, Fired, Live, Progress, Run, Voice, join, judge};

/// Time between two ticks of the stream.
const TICK: Duration = Duration::from_millis(100);
/// How long sources may take to end.
const STOP_DEADLINE: Duration = Duration::from_millis(1_000);
/// Kept in memory beyond the time before a trigger, while files are being made.
const MEMORY_SLACK: Duration = Duration::from_secs(2);
/// Arrivals that may wait for an engine that nobody writes down, and for the look at triggers.
const LISTENER_QUEUE: usize = 8_192;
/// Triggers that may wait.
const FIRED_QUEUE: usize = 256;
/// Orders that may wait.
const ORDER_QUEUE: usize = 8;

/// What became of a recording.
#[derive(Debug, Default)]
pub struct Summary {
    /// The files that were written.
    pub files: Vec<PathBuf>,
    /// How long it took, s.
    pub duration_s: f64,
    /// Arrivals of all sources.
    pub arrivals: u64,
    /// What the disk took.
    pub recorder: RecorderSummary,
    /// Counters of each source, of the last run or of the time without one.
    pub health: Health,
    /// What was lost, over all sources and runs.
    pub losses: Losses,
    /// Tasks that had to be cut off.
    pub stuck: Vec<String>,
}

impl Summary {
    /// Losses over all sources, by place: items, and arrivals on the way to the disk.
    pub fn lost(&self) -> [u64; LossPlace::ALL.len()] {
        let mut lost = self.losses.totals();
        lost[LossPlace::Disk as usize] = self.losses.arrivals;
        lost
    }

    /// Whether raw data was lost, or its file is not where it was written.
    pub fn has_loss(&self) -> bool {
        self.losses.has_raw() || !self.recorder.gone.is_empty() || self.recorder.cut_off.is_some()
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

/// Reads the configuration again.
pub type Reload<'a> = &'a dyn Fn() -> anyhow::Result<Config>;

/// Records until `stop` is ready, then ends everything in order: sources, stream, threads, files.
pub async fn record(
    config: Config,
    reload: Option<Reload<'_>>,
    stop: impl Future<Output = ()>,
) -> anyhow::Result<Summary> {
    let begin = Instant::now();
    let mut hangup = signal(SignalKind::hangup()).context("cannot listen for SIGHUP")?;
    // Whoever must stop because another recorder is there has made no file.
    let folder = Folder::take(&config.storage.directory)?;
    let sockets = control::paths(&config);
    let (orders, mut waiting) = mpsc::channel(ORDER_QUEUE);
    let (fired, mut triggers) = mpsc::channel(FIRED_QUEUE);
    let mut conductor = Conductor::new(config, reload, fired, folder);
    conductor.start().await?;
    // Whoever finds the socket finds a recorder that records.
    let listener = open_control(&sockets);
    notify(&[sd_notify::NotifyState::Ready]);
    conductor.look_after_folder();

    let desk = Desk {
        sequencer: conductor.sequencer.clone(),
        board: Arc::clone(&conductor.board),
        orders,
    };
    let mut serving = Box::pin(serve(listener, desk));
    let watchdog = tokio::spawn(conductor.pulses.clone().watch());
    let mut stop = std::pin::pin!(stop);
    let mut keep = Box::pin(conductor.retention());
    loop {
        let trigger_ends = until(conductor.left_of_trigger());
        tokio::select! {
            biased;
            () = &mut stop => break,
            () = &mut serving => {}
            Some((order, reply)) = waiting.recv() => {
                let answer = conductor.obey(order).await;
                // Who asked may have gone.
                let _ = reply.send(answer);
                keep = Box::pin(conductor.retention());
            }
            _ = hangup.recv() => {
                if let Err(error) = conductor.reload().await {
                    tracing::error!("the configuration was not read again: {error:#}");
                }
                keep = Box::pin(conductor.retention());
            }
            Some(fired) = triggers.recv() => conductor.fire(fired).await,
            () = trigger_ends => conductor.pause(),
            Some(closed) = conductor.closing.join_next() => conductor.closed(closed),
            () = &mut keep => {}
        }
    }
    watchdog.abort();
    notify(&[sd_notify::NotifyState::Stopping]);
    drop(serving);
    drop(triggers);
    let mut summary = conductor.finish().await?;
    summary.duration_s = begin.elapsed().as_secs_f64();
    Ok(summary)
}

/// Opens the control socket; a recording without one goes on.
fn open_control(paths: &[PathBuf]) -> Option<Listener> {
    match Listener::open(paths) {
        Ok(listener) => {
            tracing::info!(path = %listener.path().display(), "control socket");
            Some(listener)
        }
        Err(error) => {
            tracing::warn!(
                "no control socket, so mark, status, start, stop and reload cannot reach this \
                 recorder; recording goes on: {error:#}"
            );
            None
        }
    }
}

async fn serve(listener: Option<Listener>, desk: Desk) {
    match listener {
        Some(listener) => listener.serve(desk).await,
        None => std::future::pending().await,
    }
}

async fn until(left: Option<Duration>) {
    match left {
        Some(left) => tokio::time::sleep(left).await,
        None => std::future::pending().await,
    }
}

/// Decides when files are written, and by which configuration.
struct Conductor<'a> {
    config: Arc<Config>,
    reload: Option<Reload<'a>>,
    sequencer: Sequencer,
    supervisor: Supervisor,
    pulses: Pulses,
    board: Arc<Board>,
    fired: mpsc::Sender<Fired>,
    run: Option<Run>,
    /// When a triggered run ends; `None` for one that goes on until it is told otherwise.
    until: Option<LogTime>,
    live: Option<JoinHandle<Health>>,
    /// Ends the look for triggers and the engine that looks for events, when dropped.
    armed: JoinSet<()>,
    closing: JoinSet<Closed>,
    /// How far the files are that are being closed.
    watched: Vec<store::Progress>,
    summary: Summary,
    /// The first run that did not end well.
    failed: Option<anyhow::Error>,
    /// Log folders that this process owns.
    folders: Vec<Folder>,
    /// Runs whose logs retention leaves alone.
    protected: Protected,
    /// State of the host's clock when the log clock was set to it.
    clock: ClockState,
}

type Closed = anyhow::Result<(RecorderSummary, Engine, Progress)>;

impl<'a> Conductor<'a> {
    fn new(
        config: Config,
        reload: Option<Reload<'a>>,
        fired: mpsc::Sender<Fired>,
        folder: Folder,
    ) -> Self {
        let log_clock = LogClock::start();
        let clock = session::clock_state(log_clock.now());
        let sequencer = Sequencer::idle(log_clock);
        Self {
            board: Arc::new(Board::new(&config)),
            config: Arc::new(config),
            reload,
            supervisor: Supervisor::new(sequencer.clone()),
            sequencer,
            pulses: Pulses::default(),
            fired,
            run: None,
            until: None,
            live: None,
            armed: JoinSet::new(),
            closing: JoinSet::new(),
            watched: Vec::new(),
            summary: Summary::default(),
            failed: None,
            folders: vec![folder],
            protected: Protected::default(),
            clock,
        }
    }

    /// Beside the recording: makes whole what an earlier run could not close, and states which
    /// limits cannot hold.
    fn look_after_folder(&self) {
        let storage = &self.config.storage;
        let rate = self.board.estimate().rate_bytes_s;
        let options = &storage.options;
        for text in retention::warnings(&storage.directory, storage.limits, options, rate) {
            tracing::warn!("{text}");
        }
        if self.clock.is_implausible() {
            tracing::warn!(
                clock = self.clock.name(),
                "the date of the computer's clock may be wrong; the logs are marked until a \
                 receiver gives the date"
            );
        }
        recovery::start(storage.directory.clone(), self.protected.clone());
    }

    async fn start(&mut self) -> anyhow::Result<()> {
        if self.config.storage.trigger.is_none() {
            self.begin(Arc::clone(&self.config), None, None).await?;
        }
        self.arm()?;
        self.supervisor.spawn_ticks(TICK);
        for spec in specs(&self.config) {
            self.supervisor.spawn(spec);
        }
        let sources = self.config.sources.len();
        let state = self.board.writing();
        tracing::info!(sources, "{state}; {}", self.board.estimate());
        Ok(())
    }

    fn retention(&self) -> impl Future<Output = ()> + use<> {
        let storage = &self.config.storage;
        let (protected, board) = (self.protected.clone(), Arc::clone(&self.board));
        retention::keep(storage.directory.clone(), storage.limits, protected, board)
    }

    async fn obey(&mut self, order: Order) -> Answer {
        match order {
            Order::Start => {
                self.until = None;
                if self.run.is_none() {
                    let config = Arc::clone(&self.config);
                    self.begin(config, None, None).await?;
                }
                self.board.set(Writing::Always);
            }
            Order::Stop => self.stop().await?,
            Order::Reload => self.reload().await?,
        }
        Ok(self.board.writing())
    }

    /// Begins a run, in the place of the one that there may be; with `numbers`, by another
    /// configuration.
    async fn begin(
        &mut self,
        config: Arc<Config>,
        since: Option<LogTime>,
        numbers: Option<Numbers>,
    ) -> anyhow::Result<()> {
        let started = since.unwrap_or_else(|| self.sequencer.clock().now());
        let engine = Engine::new(&config)?;
        let voice = Voice {
            board: Arc::clone(&self.board),
            aloud: match numbers {
                Some(_) => config.storage.trigger.is_none(),
                None => self.live.is_none(),
            },
            events: None,
        };
        let (clock, protected) = (self.clock, self.protected.clone());
        let ledger = self.sequencer.ledger();
        let made = move || Files::open(&config, started, clock, &protected, &ledger);
        let made = tokio::task::spawn_blocking(made);
        let files = made.await.context("making the files failed")??;
        let numbers = numbers.unwrap_or_default();
        let sizes = QueueSizes::default();
        let streams = self.sequencer.begin(sizes, since, &numbers);
        self.board.write_to(files.recorder());
        let sequencer = self.sequencer.clone();
        let next = Run::start(files, engine, sequencer, streams, &self.pulses, voice)?;
        if let Some(old) = self.run.replace(next) {
            self.close(old, None);
        }
        self.board.set(Writing::Always);
        Ok(())
    }

    /// Closes a run's files beside everything else.
    fn close(&mut self, run: Run, deadline: Option<Instant>) {
        if self.closing.is_empty() {
            self.watched.clear();
        }
        self.watched.push(run.recorder.progress());
        self.closing.spawn_blocking(move || run.finish(deadline));
    }

    fn closed(&mut self, closed: Result<Closed, JoinError>) {
        match closed.context("closing the files failed").and_then(|c| c) {
            Ok((more, engine, progress)) => {
                self.summary.add(more);
                self.summary.health = engine.health(progress.time);
            }
            Err(error) => {
                tracing::error!("a run did not end well: {error:#}");
                self.failed.get_or_insert(error);
            }
        }
    }

    /// A trigger was met: what was kept in memory before it is written, and what follows.
    async fn fire(&mut self, fired: Fired) {
        let Some(trigger) = self.config.storage.trigger.clone() else {
            return;
        };
        let until = fired.time + nanos(trigger.post);
        if self.run.is_some() {
            self.until = self.until.map(|before| before.max(until));
            return;
        }
        let since = LogTime(
            fired
                .time
                .0
                .saturating_sub(nanos(trigger.memory.duration) as u64),
        );
        let config = Arc::clone(&self.config);
        match self.begin(config, Some(since), None).await {
            Ok(()) => {
                self.until = Some(until);
                tracing::info!(reason = %fired.reason, "triggered");
                self.board.set(Writing::Triggered(fired.reason));
            }
            Err(error) => tracing::error!("the trigger was not recorded: {error:#}"),
        }
    }

    /// Time until the end of a triggered run.
    fn left_of_trigger(&self) -> Option<Duration> {
        let until = self.until.filter(|_| self.run.is_some())?;
        let left_ns = until - self.sequencer.clock().now();
        Some(Duration::from_nanos(u64::try_from(left_ns).unwrap_or(0)))
    }

    /// Ends the run and goes on listening.
    fn pause(&mut self) {
        self.until = None;
        self.sequencer.pause();
        if let Some(run) = self.run.take() {
            self.close(run, None);
        }
        self.board.set(self.at_rest());
        tracing::info!("{}", self.board.writing());
    }

    fn at_rest(&self) -> Writing {
        match &self.config.storage.trigger {
            Some(_) => Writing::Armed,
            None => Writing::Stopped,
        }
    }

    /// Ends the run and waits for its files. Its engine goes on, where no other one runs.
    async fn stop(&mut self) -> anyhow::Result<()> {
        let Some(run) = self.run.take() else {
            return Ok(());
        };
        self.until = None;
        let queue = self.live.is_none().then(|| self.listen());
        self.sequencer.pause();
        self.board.set(self.at_rest());
        let closed = tokio::task::spawn_blocking(move || run.finish(None));
        let (summary, engine, progress) = closed.await.context("closing the files failed")??;
        self.summary.add(summary);
        if let Some(queue) = queue {
            let live = Live {
                next_sequence: progress.next_sequence,
                engine,
                queue,
                voice: Voice {
                    board: Arc::clone(&self.board),
                    aloud: true,
                    events: None,
                },
            };
            self.live = Some(live.start(&self.pulses)?);
        }
        tracing::info!("{}", self.board.writing());
        Ok(())
    }

    /// Looks out for triggers, where there are any, and lets an engine run where no run has one.
    fn arm(&mut self) -> anyhow::Result<()> {
        // What listened by the configuration before has heard its last.
        self.armed = JoinSet::new();
        self.live = None;
        let trigger = self.config.storage.trigger.clone().map(Arc::new);
        let memory = trigger.as_deref().map_or_else(RingLimits::default, memory);
        self.sequencer.keep(memory);
        if let Some(trigger) = &trigger {
            let queue = self.sequencer.listen(LISTENER_QUEUE);
            let judge = judge(Arc::clone(trigger), queue, self.fired.clone());
            self.armed.spawn(judge);
        }
        if trigger.is_some() || self.run.is_none() {
            let live = Live {
                next_sequence: 0,
                engine: Engine::new(&self.config)?,
                queue: self.listen(),
                voice: Voice {
                    board: Arc::clone(&self.board),
                    aloud: true,
                    events: trigger.map(|trigger| (trigger, self.fired.clone())),
                },
            };
            self.live = Some(live.start(&self.pulses)?);
        }
        if self.run.is_none() {
            self.board.set(self.at_rest());
        }
        Ok(())
    }

    /// A queue of everything that ends when the configuration changes.
    fn listen(&mut self) -> mpsc::Receiver<Arc<Arrival>> {
        let mut from = self.sequencer.listen(LISTENER_QUEUE);
        let (to, queue) = mpsc::channel(1);
        self.armed.spawn(async move {
            while let Some(arrival) = from.recv().await {
                if to.send(arrival).await.is_err() {
                    return;
                }
            }
        });
        queue
    }

    /// Takes the configuration as it is now over: a new run begins with it between two arrivals,
    /// and the sources that are the same run on.
    async fn reload(&mut self) -> anyhow::Result<()> {
        let Some(reload) = self.reload else {
            anyhow::bail!("this recording has no configuration file");
        };
        let config = Arc::new(reload()?);
        // What only the engine finds wrong is to be found before anything changes.
        Engine::new(&config)?;
        let directory = &config.storage.directory;
        let is_new = !self.folders.iter().any(|folder| folder.is(directory));
        if is_new {
            self.folders.push(Folder::take(directory)?);
        }
        if control::paths(&config) != control::paths(&self.config) {
            tracing::warn!("the control socket stays where it is until the next start");
        }
        let specs = specs(&config);
        let numbers = self.supervisor.numbers(&specs);
        let stopped = self.run.is_none() && self.config.storage.trigger.is_none();
        if self.run.is_some() || (config.storage.trigger.is_none() && !stopped) {
            let writing = self.board.state();
            self.begin(Arc::clone(&config), None, Some(numbers)).await?;
            self.until = self.until.filter(|_| config.storage.trigger.is_some());
            if self.until.is_some() {
                self.board.set(writing);
            }
        } else {
            self.sequencer.renumber(&numbers);
        }
        self.config = config;
        self.board.reload(&self.config);
        self.arm()?;
        if let Err(stuck) = self.supervisor.apply(specs, STOP_DEADLINE).await {
            tracing::warn!(%stuck, "sources did not end in time");
            self.summary.stuck.extend(stuck.names);
        }
        if is_new {
            self.look_after_folder();
        }
        let sources = self.config.sources.len();
        tracing::info!(sources, "the configuration was read again");
        Ok(())
    }

    /// Ends everything in order.
    async fn finish(mut self) -> anyhow::Result<Summary> {
        let deadline = Instant::now() + self.config.storage.options.stop_within;
        let nobody = Supervisor::new(self.sequencer.clone());
        let supervisor = std::mem::replace(&mut self.supervisor, nobody);
        if let Err(stuck) = supervisor.stop(STOP_DEADLINE).await {
            tracing::warn!(%stuck, "sources did not end in time");
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
        let extending = tokio::spawn(extend_stop(self.watched.clone()));
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

/// New numbers of the sources that run, by the numbers they were started with.
type Numbers = BTreeMap<SourceId, Option<SourceId>>;

/// What is kept in memory: somewhat more than the time before a trigger.
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
