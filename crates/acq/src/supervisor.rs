//! One task a source: started here, restarted when it fails, stopped together.

use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use sample::{Notice, Payload, SourceId};
use tokio::sync::watch;
use tokio::task::{JoinHandle, JoinSet};
use tokio::time::{Instant, MissedTickBehavior};

use crate::context::{SourceContext, pause, stopped};
use crate::{Sequencer, SourceKind, SourceSpec, can, serial, slcan};

/// How long a source whose task panicked stays down.
const PANIC_PAUSE: Duration = Duration::from_secs(1);

/// Runs the sources. Needs a tokio runtime around it.
#[derive(Debug)]
pub struct Supervisor {
    sequencer: Sequencer,
    running: Vec<Running>,
}

#[derive(Debug)]
struct Running {
    name: String,
    /// Number that the task was started with.
    started: SourceId,
    /// `None` for the ticks.
    spec: Option<SourceSpec>,
    shutdown: watch::Sender<bool>,
    task: JoinHandle<()>,
}

/// Tasks that did not end after the stop request.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct StuckTasks {
    /// Their sources' names.
    pub names: Vec<String>,
    /// How long they were given.
    pub deadline: Duration,
}

impl fmt::Display for StuckTasks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "still running {:.1} s after the stop: {}",
            self.deadline.as_secs_f64(),
            self.names.join(", ")
        )
    }
}

impl Supervisor {
    /// A supervisor whose sources push into `sequencer`.
    #[must_use]
    pub fn new(sequencer: Sequencer) -> Self {
        Self {
            sequencer,
            running: Vec::new(),
        }
    }

    /// Starts a source. It opens its device, reopens it when it comes back after a failure, and
    /// tells of both with notices.
    pub fn spawn(&mut self, spec: SourceSpec) {
        let shutdown = watch::Sender::new(false);
        let started = self.free_number(spec.id);
        self.sequencer.assign(started, spec.id);
        let own = SourceSpec {
            id: started,
            ..spec.clone()
        };
        let task = supervise(own, self.sequencer.clone(), shutdown.subscribe());
        self.running.push(Running {
            name: spec.name.clone(),
            started,
            spec: Some(spec),
            shutdown,
            task: tokio::spawn(task),
        });
    }

    /// `wanted`, or else the least number that no task was started with.
    fn free_number(&self, wanted: SourceId) -> SourceId {
        let is_free = |number: &SourceId| self.running.iter().all(|r| r.started != *number);
        std::iter::once(wanted)
            .chain((0..SourceId::HOST.0).map(SourceId))
            .find(is_free)
            .unwrap_or(wanted)
    }

    /// The numbers that the running sources get when `specs` take over: of those that run on, their
    /// new ones. For [`Sequencer::begin`], before [`Supervisor::apply`].
    #[must_use]
    pub fn numbers(&self, specs: &[SourceSpec]) -> BTreeMap<SourceId, Option<SourceId>> {
        let sources = self.running.iter().filter_map(|running| {
            let spec = running.spec.as_ref()?;
            let same = specs.iter().find(|other| other.is_same_device(spec));
            Some((running.started, same.map(|same| same.id)))
        });
        sources.collect()
    }

    /// Starts the ticks that let silence be seen: one [`Payload::Tick`] of [`SourceId::HOST`] each
    /// `period` (100 ms in a recorder).
    pub fn spawn_ticks(&mut self, period: Duration) {
        let shutdown = watch::Sender::new(false);
        let task = ticks(period, self.sequencer.clone(), shutdown.subscribe());
        self.running.push(Running {
            name: "ticks".to_owned(),
            started: SourceId::HOST,
            spec: None,
            shutdown,
            task: tokio::spawn(task),
        });
    }

    /// Takes a changed set of sources over: those that are in both, whatever their numbers, run on
    /// untouched, the others are stopped, at most for `deadline`, and the new ones are started.
    ///
    /// # Errors
    /// The names of the tasks that did not end in time; they are aborted, and the new sources run.
    pub async fn apply(
        &mut self,
        specs: Vec<SourceSpec>,
        deadline: Duration,
    ) -> Result<(), StuckTasks> {
        let mut ended = Vec::new();
        for mut running in std::mem::take(&mut self.running) {
            let Some(spec) = &running.spec else {
                self.running.push(running);
                continue;
            };
            match specs.iter().find(|other| other.is_same_device(spec)) {
                Some(same) => {
                    self.sequencer.assign(running.started, same.id);
                    running.spec = Some(same.clone());
                    self.running.push(running);
                }
                None => ended.push(running),
            }
        }
        let stopped = end(ended, deadline).await;
        for spec in specs {
            let runs = |running: &Running| running.spec.as_ref() == Some(&spec);
            if !self.running.iter().any(runs) {
                self.spawn(spec);
            }
        }
        stopped
    }

    /// Stops all sources and waits for them, at most for `deadline`. Close the stream with
    /// [`Sequencer::finish`] afterwards.
    ///
    /// # Errors
    /// The names of the tasks that did not end in time; they are aborted.
    pub async fn stop(self, deadline: Duration) -> Result<(), StuckTasks> {
        end(self.running, deadline).await
    }
}

/// Stops tasks, all at once, and waits for them.
async fn end(running: Vec<Running>, deadline: Duration) -> Result<(), StuckTasks> {
    for task in &running {
        task.shutdown.send_replace(true);
    }
    let end = Instant::now() + deadline;
    let mut names = Vec::new();
    for mut running in running {
        let ended = tokio::time::timeout_at(end, &mut running.task).await;
        if ended.is_err() {
            running.task.abort();
            names.push(running.name);
        }
    }
    if names.is_empty() {
        Ok(())
    } else {
        Err(StuckTasks { names, deadline })
    }
}

/// Runs a source until the shutdown, again and again should its task panic.
async fn supervise(spec: SourceSpec, sequencer: Sequencer, mut shutdown: watch::Receiver<bool>) {
    while !*shutdown.borrow() {
        // A set, so that aborting this task aborts the one inside.
        let mut inner = JoinSet::new();
        inner.spawn(run(spec.clone(), sequencer.clone(), shutdown.clone()));
        let Some(Err(error)) = inner.join_next().await else {
            return;
        };
        tracing::error!(source = %spec.name, %error, "internal error in a source; it is restarted");
        let text = format!(
            "{}: internal error ({error}); the source is restarted",
            spec.name
        );
        sequencer.notice(spec.id, Notice::Closed(text));
        pause(PANIC_PAUSE, &mut shutdown).await;
    }
}

async fn run(spec: SourceSpec, sequencer: Sequencer, shutdown: watch::Receiver<bool>) {
    let context = SourceContext {
        id: spec.id,
        name: spec.name,
        sequencer,
    };
    match spec.kind {
        SourceKind::Serial(serial) => serial::run(&context, &serial, shutdown).await,
        SourceKind::Slcan(slcan) => slcan::run(&context, &slcan, shutdown).await,
        SourceKind::Can(can) => can::run(&context, &can, shutdown).await,
    }
}

async fn ticks(period: Duration, sequencer: Sequencer, mut shutdown: watch::Receiver<bool>) {
    let mut interval = tokio::time::interval(period.max(Duration::from_millis(1)));
    interval.set_missed_tick_behavior(MissedTickBehavior::Skip);
    loop {
        tokio::select! {
            () = stopped(&mut shutdown) => return,
            _ = interval.tick() => {
                sequencer.push(SourceId::HOST, Payload::Tick);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::os::fd::AsRawFd;
    use std::sync::Arc;

    use sample::Arrival;
    use tokio::sync::mpsc::Receiver;

    use super::*;
    use crate::{LogClock, PortSpec, QueueSizes, SerialSpec, Setup, sys};

    const PORT: SourceId = SourceId(0);
    const PATIENCE: Duration = Duration::from_secs(20);

    async fn next(recorder: &mut Receiver<Arc<Arrival>>) -> Arc<Arrival> {
        tokio::time::timeout(PATIENCE, recorder.recv())
            .await
            .expect("an arrival in time")
            .expect("an open stream")
    }

    async fn collect(recorder: &mut Receiver<Arc<Arrival>>, count: usize) -> Vec<u8> {
        let mut bytes = Vec::new();
        while bytes.len() < count {
            if let Payload::Bytes(read) = &next(recorder).await.payload {
                bytes.extend_from_slice(read);
            }
        }
        bytes
    }

    async fn until(recorder: &mut Receiver<Arc<Arrival>>, wanted: impl Fn(&Notice) -> bool) {
        loop {
            if let Payload::Notice(notice) = &next(recorder).await.payload
                && wanted(notice)
            {
                return;
            }
        }
    }

    fn serial_source(path: &std::path::Path, setup: Setup) -> SourceSpec {
        SourceSpec {
            id: PORT,
            name: "port".to_owned(),
            kind: SourceKind::Serial(SerialSpec {
                port: PortSpec::new(path, 57_600),
                setup,
            }),
        }
    }

    fn noise(count: usize) -> Vec<u8> {
        let mut state = 0x2545_f491_4f6c_dd1d_u64;
        std::iter::repeat_with(|| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 24) as u8
        })
        .take(count)
        .collect()
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn all_byte_values_arrive_and_the_port_comes_back_after_unplugging() {
        let folder = tempfile::tempdir().expect("a folder");
        let link = folder.path().join("imu");
        let (sequencer, mut streams) = Sequencer::new(LogClock::start(), QueueSizes::default());
        let mut supervisor = Supervisor::new(sequencer);
        supervisor.spawn(serial_source(&link, Setup::None));
        let recorder = &mut streams.recorder;
        until(recorder, |notice| matches!(notice, Notice::Closed(_))).await;
        for round in 0..3 {
            let (mut device, path) = sys::open_pseudo_terminal().expect("a pseudo-terminal");
            assert!(device.as_raw_fd() >= 0);
            std::os::unix::fs::symlink(&path, &link).expect("a link");
            until(recorder, |notice| matches!(notice, Notice::Opened(_))).await;
            let sent = noise(3000 + round);
            for chunk in sent.chunks(97) {
                device.write_all(chunk).expect("the terminal takes bytes");
            }
            assert_eq!(collect(recorder, sent.len()).await, sent);
            std::fs::remove_file(&link).expect("the link is there");
            drop(device);
            until(recorder, |notice| matches!(notice, Notice::Closed(_))).await;
        }
        supervisor.stop(PATIENCE).await.expect("the source stops");
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn commands_are_sent_at_each_opening() {
        let (device, path) = sys::open_pseudo_terminal().expect("a pseudo-terminal");
        let (sequencer, _streams) = Sequencer::new(LogClock::start(), QueueSizes::default());
        let mut supervisor = Supervisor::new(sequencer);
        let commands = vec![b"unlogall\r\n".to_vec(), b"log bestvelb\r\n".to_vec()];
        let expected = commands.concat();
        let setup = Setup::Commands {
            commands,
            pause: Duration::from_millis(1),
        };
        supervisor.spawn(serial_source(&path, setup));
        let read = tokio::task::spawn_blocking(move || {
            let mut device = device;
            let mut received = vec![0; expected.len()];
            std::io::Read::read_exact(&mut device, &mut received).expect("commands");
            (received, expected)
        });
        let (received, expected) = read.await.expect("the reader does not panic");
        assert_eq!(received, expected);
        supervisor.stop(PATIENCE).await.expect("the source stops");
    }

    #[tokio::test]
    async fn stuck_tasks_are_named() {
        let (sequencer, _streams) = Sequencer::new(LogClock::start(), QueueSizes::default());
        let mut supervisor = Supervisor::new(sequencer);
        supervisor.running.push(Running {
            name: "gnss".to_owned(),
            started: PORT,
            spec: None,
            shutdown: watch::Sender::new(false),
            task: tokio::spawn(std::future::pending()),
        });
        supervisor.spawn_ticks(Duration::from_millis(10));
        let error = supervisor
            .stop(Duration::from_millis(50))
            .await
            .expect_err("a stuck task");
        assert_eq!(error.names, ["gnss"]);
        assert!(error.to_string().contains("gnss"));
    }

    #[tokio::test(start_paused = true)]
    async fn ticks_come_at_their_rate() {
        let (sequencer, mut streams) = Sequencer::new(LogClock::start(), QueueSizes::default());
        let mut supervisor = Supervisor::new(sequencer.clone());
        supervisor.spawn_ticks(Duration::from_millis(100));
        tokio::time::sleep(Duration::from_millis(950)).await;
        supervisor.stop(PATIENCE).await.expect("ticks stop");
        sequencer.finish();
        let mut ticks = 0;
        while let Some(arrival) = streams.recorder.recv().await {
            assert_eq!(arrival.payload, Payload::Tick);
            assert_eq!(arrival.source, SourceId::HOST);
            ticks += 1;
        }
        assert_eq!(ticks, 10);
    }
}
