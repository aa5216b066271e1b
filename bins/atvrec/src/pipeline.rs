//! The live pipeline: sources, recorder, engine. The only place that sees `acq` and `store`
//! together.
//!
//! ```text
//! sources (tokio tasks) ─► Sequencer ─┬─► thread "recorder": arrivals ─────────► store::Recorder
//!                                     └─► thread "engine": arrivals ─► records ─► store::Recorder
//! ```

use std::future::Future;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use acq::{LogClock, QueueSizes, Sequencer, Supervisor};
use anyhow::Context;
use sample::{Arrival, Health, LogTime, LossPlace, Payload, Severity};
use store::{LogMessage, Record, Recorder, RecorderSummary};
use tokio::sync::mpsc;

use crate::config::Config;
use crate::control::{self, Listener};
use crate::engine::Engine;
use crate::{retention, session};

/// Time between two ticks of the stream.
const TICK: Duration = Duration::from_millis(100);
/// How long sources may take to end; the whole stop takes less than 2 s.
const STOP_DEADLINE: Duration = Duration::from_millis(1_000);
/// The service manager hears of progress this often, at least.
const WATCHDOG: Duration = Duration::from_millis(500);

/// What became of a recording.
#[derive(Debug)]
pub struct Summary {
    /// The files that were written.
    pub files: Vec<PathBuf>,
    /// How long it took, s.
    pub duration_s: f64,
    /// Arrivals of all sources.
    pub arrivals: u64,
    /// What the disk took.
    pub recorder: RecorderSummary,
    /// Counters of each source.
    pub health: Health,
    /// Tasks that had to be cut off.
    pub stuck: Vec<String>,
}

impl Summary {
    /// Items lost, by place, over all sources.
    pub fn lost(&self) -> [u64; LossPlace::ALL.len()] {
        let mut lost = [0; LossPlace::ALL.len()];
        for source in &self.health.sources {
            for (sum, count) in lost.iter_mut().zip(source.lost) {
                *sum += count;
            }
        }
        lost[LossPlace::Disk as usize] += self.recorder.lost_arrivals;
        lost
    }
}

/// How far each consumer has come: what the watchdog looks at.
#[derive(Debug, Default)]
struct Progress {
    recorder: AtomicU64,
    engine: AtomicU64,
}

/// Records until `stop` is ready, then ends everything in order: sources, stream, threads, files.
pub async fn record(config: &Config, stop: impl Future<Output = ()>) -> anyhow::Result<Summary> {
    let clock = LogClock::start();
    let started = clock.now();
    let begin = Instant::now();
    let session = session::live(config, started);
    let engine = Engine::new(config)?;
    let recorder = start_recorder(config, session)?;
    let control = Listener::open(&control::socket_path(config))?;
    let (sequencer, streams) = Sequencer::new(clock, QueueSizes::default());
    let progress = Arc::new(Progress::default());
    let raw = spawn_recorder(
        streams.recorder,
        Arc::clone(&recorder),
        Arc::clone(&progress),
    )?;
    let estimates = streams
        .estimator
        .map(|queue| spawn_engine(engine, queue, Arc::clone(&recorder), Arc::clone(&progress)))
        .transpose()?;

    let mut supervisor = Supervisor::new(sequencer.clone());
    supervisor.spawn_ticks(TICK);
    for source in &config.sources {
        supervisor.spawn(source.spec.clone());
    }
    notify(&[sd_notify::NotifyState::Ready]);
    tracing::info!(sources = config.sources.len(), "recording");
    tokio::select! {
        () = watch(&progress, stop) => {}
        () = control.serve(sequencer.clone(), Arc::downgrade(&recorder)) => {}
        () = retention::keep(config.storage.directory.clone(), config.storage.limits) => {}
    }
    drop(control);

    notify(&[sd_notify::NotifyState::Stopping]);
    let stuck = match supervisor.stop(STOP_DEADLINE).await {
        Ok(()) => Vec::new(),
        Err(stuck) => {
            tracing::warn!(%stuck, "sources did not end in time");
            stuck.names
        }
    };
    let arrivals = sequencer.next_sequence();
    sequencer.finish();
    join("recorder", raw)?;
    let health = match estimates {
        Some(thread) => join("engine", thread)?,
        None => Health::default(),
    };
    let recorder = Arc::into_inner(recorder).context("a thread still holds the recorder")?;
    let summary = recorder.finish()?;
    Ok(Summary {
        files: summary.files.iter().map(|f| f.path.clone()).collect(),
        duration_s: begin.elapsed().as_secs_f64(),
        arrivals,
        recorder: summary,
        health,
        stuck,
    })
}

fn spawn_recorder(
    mut queue: mpsc::Receiver<Arc<Arrival>>,
    recorder: Arc<Recorder>,
    progress: Arc<Progress>,
) -> anyhow::Result<JoinHandle<()>> {
    let run = move || {
        while let Some(arrival) = queue.blocking_recv() {
            let sequence = arrival.sequence;
            recorder.push(Arc::unwrap_or_clone(arrival));
            progress.recorder.store(sequence, Ordering::Relaxed);
        }
    };
    spawn("recorder", run)
}

fn spawn_engine(
    mut engine: Engine,
    mut queue: mpsc::Receiver<Arc<Arrival>>,
    recorder: Arc<Recorder>,
    progress: Arc<Progress>,
) -> anyhow::Result<JoinHandle<Health>> {
    let run = move || {
        let mut last = LogTime::default();
        let mut records = Vec::new();
        while let Some(arrival) = queue.blocking_recv() {
            last = arrival.log_time;
            engine.push(&arrival, &mut records);
            for record in records.drain(..) {
                // What happened to a source itself, the source has said on the terminal.
                if let Record::Log(message) = &record
                    && !matches!(arrival.payload, Payload::Notice(_))
                {
                    say(message);
                }
                recorder.record(record);
            }
            progress.engine.store(arrival.sequence, Ordering::Relaxed);
        }
        engine.health(last)
    };
    spawn("engine", run)
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

fn join<T>(name: &str, thread: JoinHandle<T>) -> anyhow::Result<T> {
    thread
        .join()
        .map_err(|_| anyhow::anyhow!("the thread {name} ended with a panic; see its message above"))
}

/// What the log says to people is said on the terminal too.
fn say(message: &LogMessage) {
    let (name, text) = (&message.name, &message.text);
    match message.severity {
        Severity::Info => tracing::info!(source = %name, "{text}"),
        Severity::Warning => tracing::warn!(source = %name, "{text}"),
        Severity::Error => tracing::error!(source = %name, "{text}"),
    }
}

/// Waits for the end, and tells the service manager that all is well as long as both consumers
/// take arrivals. Ticks give them some even if every device is silent.
async fn watch(progress: &Progress, stop: impl Future<Output = ()>) {
    let mut stop = std::pin::pin!(stop);
    let mut interval = tokio::time::interval(WATCHDOG);
    let mut last = None;
    loop {
        tokio::select! {
            () = &mut stop => return,
            _ = interval.tick() => {
                let now = (
                    progress.recorder.load(Ordering::Relaxed),
                    progress.engine.load(Ordering::Relaxed),
                );
                let moved = last.is_none_or(|(recorder, engine)| now.0 > recorder && now.1 > engine);
                last = Some(now);
                if moved {
                    notify(&[sd_notify::NotifyState::Watchdog]);
                } else {
                    tracing::debug!(?now, "no progress");
                }
            }
        }
    }
}

/// Tells the service manager, if there is one.
fn notify(states: &[sd_notify::NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(states) {
        tracing::debug!(%error, "the service manager was not told");
    }
}

/// Makes whole what an earlier run could not close. What cannot be made whole stays as it is.
fn recover_unfinished(directory: &Path) {
    let logs = match store::recover_directory(directory) {
        Ok(logs) => logs,
        Err(error) => {
            tracing::warn!(%error, "unfinished logs were not looked for");
            return;
        }
    };
    for (path, result) in logs {
        match result {
            Ok(recovered) => tracing::warn!(
                log = %recovered.path.display(),
                messages = recovered.messages,
                "an unfinished log was made whole"
            ),
            Err(error) => tracing::error!(
                log = %path.display(),
                %error,
                "an unfinished log was not made whole"
            ),
        }
    }
}

fn start_recorder(config: &Config, session: store::Session) -> anyhow::Result<Arc<Recorder>> {
    let storage = &config.storage;
    std::fs::create_dir_all(&storage.directory).with_context(|| {
        format!(
            "cannot make the log directory {}; name another one in storage.directory",
            storage.directory.display()
        )
    })?;
    recover_unfinished(&storage.directory);
    let time = session::utc_compact(session.started.0 / 1_000_000_000);
    let stem = format!("{}-{time}", storage.name);
    let options = storage.options.clone();
    let recorder = Recorder::start(&storage.directory, &stem, session, options)?;
    Ok(Arc::new(recorder))
}
