//! `[output.can]`: sends each estimate to controllers.
//!
//! The engine hands estimates and events to a thread through a bounded queue and never waits. The
//! thread sends a set of frames for each estimate, and marks the output stale if none comes.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use acq::{FrameSender, LogClock, SourceKind};
use anyhow::Context;
use engine::Config;
use engine::config::{CanOutput, CanPort};
use sample::LogTime;
use serde_json::{Value, json};
use store::Record;
use wire::e2e;
use wire::output::{OutputState, encode_frames};

/// Period of estimates and of stale sets of frames.
const PERIOD: Duration = Duration::from_millis(10);
/// Time without a new estimate after which the output is stale: one period after the next was due.
const STALE_AFTER: Duration = Duration::from_millis(20);
/// Age from which even a new estimate is stale, s.
const AGE_MAX_S: f64 = 0.05;
/// Most estimates and events that wait.
const QUEUE: usize = 64;
/// Time between two attempts to open the port.
const OPEN_AGAIN: Duration = Duration::from_secs(1);

/// Queue of the thread. Clones share it.
#[derive(Clone)]
pub struct CanSink {
    queue: SyncSender<(LogTime, Record)>,
    counters: Arc<Counters>,
}

/// What was sent.
#[derive(Default)]
pub struct Counters {
    sets: AtomicU64,
    lost_frames: AtomicU64,
    /// Estimates that did not fit into the queue.
    lost_estimates: AtomicU64,
    stale_sets: AtomicU64,
    is_open: AtomicBool,
    latency: Mutex<Histogram>,
    problem: Mutex<String>,
}

/// Upper ends of the classes in which the state shows the latencies, in bins.
const CLASSES: [usize; 11] = [10, 20, 30, 50, 70, 100, 150, 200, 300, 500, 1000];

/// Latencies in steps of 0.1 ms.
struct Histogram {
    bins: Box<[u32; 1000]>,
    count: u64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self {
            bins: Box::new([0; 1000]),
            count: 0,
        }
    }
}

impl Histogram {
    fn add(&mut self, latency_s: f64) {
        let bin = (latency_s * 1e4).clamp(0.0, 999.0) as usize;
        self.bins[bin] = self.bins[bin].saturating_add(1);
        self.count += 1;
    }

    /// Latency that this part of the sets does not exceed, ms.
    fn quantile_ms(&self, part: f64) -> Option<f64> {
        let limit = (part * self.count as f64).ceil().max(1.0) as u64;
        let mut sum = 0;
        let bin = self.bins.iter().position(|count| {
            sum += u64::from(*count);
            sum >= limit
        })?;
        Some((bin + 1) as f64 * 0.1)
    }

    /// Upper end of each class, ms, and the number of sets in it. The last class has no upper end.
    fn classes(&self) -> Vec<(f64, u64)> {
        let mut begin = 0;
        let class = |end| {
            let bins = &self.bins[begin..end];
            begin = end;
            (
                end as f64 * 0.1,
                bins.iter().map(|count| u64::from(*count)).sum(),
            )
        };
        CLASSES.into_iter().map(class).collect()
    }
}

impl CanSink {
    /// Starts the thread of the output of a configuration. It ends when the last sink is dropped.
    pub fn start(config: &Config, clock: LogClock) -> anyhow::Result<Option<Self>> {
        let Some(output) = &config.output.can else {
            return Ok(None);
        };
        let (queue, received) = sync_channel(QUEUE);
        let counters = Arc::new(Counters::default());
        let sender = Sender {
            port: Port::of(config, output),
            first_id: output.first_id,
            extended: output.extended,
            clock,
            counters: Arc::clone(&counters),
            open: None,
            tried: None,
            counter: 0,
        };
        thread::Builder::new()
            .name("output.can".to_owned())
            .spawn(move || sender.run(&received))
            .context("cannot start the thread of output.can")?;
        Ok(Some(Self { queue, counters }))
    }

    /// Hands a record to the thread; `arrived` is the time of the arrival that gave the record.
    pub fn push(&self, record: &Record, arrived: LogTime) {
        if !matches!(record, Record::Estimate(_) | Record::Event(_)) {
            return;
        }
        if self.queue.try_send((arrived, record.clone())).is_err() {
            self.counters.lost_estimates.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Counters as JSON.
    pub fn state(&self) -> Value {
        let counters = &self.counters;
        let load = |count: &AtomicU64| count.load(Ordering::Relaxed);
        let latency = lock(&counters.latency);
        json!({
            "open": counters.is_open.load(Ordering::Relaxed),
            "problem": *lock(&counters.problem),
            "sets": load(&counters.sets),
            "stale_sets": load(&counters.stale_sets),
            "lost_frames": load(&counters.lost_frames),
            "lost_estimates": load(&counters.lost_estimates),
            "latency_median_ms": latency.quantile_ms(0.5),
            "latency_99_ms": latency.quantile_ms(0.99),
            "latency_max_ms": latency.quantile_ms(1.0),
            "latency_classes_ms": latency.classes(),
        })
    }
}

enum Port {
    Can(String),
    Slcan(PathBuf, u32, Option<u32>),
    Shared(PathBuf),
}

impl Port {
    fn of(config: &Config, output: &CanOutput) -> Self {
        match &output.port {
            CanPort::Interface(name) => Self::Can(name.clone()),
            CanPort::Slcan {
                device,
                baud,
                bit_rate,
            } => Self::Slcan(device.clone(), *baud, *bit_rate),
            CanPort::Source(name) => {
                let mut sources = config.sources.iter();
                let source = sources.find(|source| source.spec.name == *name);
                Self::Shared(match source.map(|source| &source.spec.kind) {
                    Some(SourceKind::Slcan(slcan)) => slcan.port.path.clone(),
                    _ => PathBuf::new(),
                })
            }
        }
    }

    fn name(&self) -> String {
        match self {
            Self::Can(interface) => interface.clone(),
            Self::Slcan(path, ..) | Self::Shared(path) => path.display().to_string(),
        }
    }

    fn open(&self) -> std::io::Result<FrameSender> {
        match self {
            Self::Can(interface) => FrameSender::can(interface),
            Self::Slcan(path, baud, bit_rate) => FrameSender::slcan(path, *baud, *bit_rate),
            Self::Shared(path) => FrameSender::shared_slcan(path),
        }
    }
}

struct Sender {
    port: Port,
    first_id: u32,
    extended: bool,
    clock: LogClock,
    counters: Arc<Counters>,
    open: Option<FrameSender>,
    /// Last attempt to open the port.
    tried: Option<Instant>,
    counter: u8,
}

impl Sender {
    fn run(mut self, received: &Receiver<(LogTime, Record)>) {
        let mut state = OutputState::default();
        let mut wait = PERIOD;
        loop {
            match received.recv_timeout(wait) {
                Ok((arrived, Record::Estimate(estimate))) => {
                    state.estimate(&estimate);
                    if self.send(&state, AGE_MAX_S) {
                        let latency_s = self.clock.now().seconds_since(arrived);
                        lock(&self.counters.latency).add(latency_s);
                    }
                    wait = STALE_AFTER;
                }
                Ok((_, Record::Event(event))) => state.event(&event),
                Ok(_) => {}
                Err(RecvTimeoutError::Timeout) => {
                    // No estimate is repeated as a new one.
                    if self.send(&state, 0.0) {
                        self.counters.stale_sets.fetch_add(1, Ordering::Relaxed);
                    }
                    wait = PERIOD;
                }
                Err(RecvTimeoutError::Disconnected) => {
                    self.send(&state, 0.0);
                    return;
                }
            }
        }
    }

    /// Sends a set of frames; whether all frames were taken.
    fn send(&mut self, state: &OutputState, stale_s: f64) -> bool {
        if !self.is_open() {
            return false;
        }
        let output = state.at(self.clock.now(), stale_s);
        let frames = encode_frames(&output, self.first_id, self.extended, self.counter);
        self.counter = e2e::next_counter(self.counter);
        let Some(port) = &mut self.open else {
            return false;
        };
        for (sent, frame) in frames.iter().enumerate() {
            let Err(error) = port.send(frame) else {
                continue;
            };
            let lost = (frames.len() - sent) as u64;
            self.counters.lost_frames.fetch_add(lost, Ordering::Relaxed);
            if !is_full(&error) {
                self.failed(&error);
            }
            return false;
        }
        self.counters.sets.fetch_add(1, Ordering::Relaxed);
        true
    }

    fn is_open(&mut self) -> bool {
        let is_recent = |at: Instant| at.elapsed() < OPEN_AGAIN;
        if self.open.is_none() && !self.tried.is_some_and(is_recent) {
            self.tried = Some(Instant::now());
            match self.port.open() {
                Ok(port) => {
                    self.open = Some(port);
                    self.counters.is_open.store(true, Ordering::Relaxed);
                    lock(&self.counters.problem).clear();
                    tracing::info!(port = %self.port.name(), "output.can is open");
                }
                Err(error) => self.failed(&error),
            }
        }
        self.open.is_some()
    }

    fn failed(&mut self, error: &std::io::Error) {
        self.open = None;
        self.counters.is_open.store(false, Ordering::Relaxed);
        let text = format!(
            "{}: {error}; check that it exists and is up",
            self.port.name()
        );
        let mut problem = lock(&self.counters.problem);
        if *problem != text {
            tracing::warn!(
                port = %self.port.name(),
                %error,
                "output.can cannot send; recording and estimates continue, and the port is tried \
                 again each second: check that the interface exists and is up"
            );
            *problem = text;
        }
    }
}

/// Whether the port takes no more bytes at present.
fn is_full(error: &std::io::Error) -> bool {
    use std::io::ErrorKind::{TimedOut, WouldBlock};
    // A full queue of an interface.
    const ENOBUFS: i32 = 105;
    matches!(error.kind(), TimedOut | WouldBlock) || error.raw_os_error() == Some(ENOBUFS)
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_upper_ends_of_the_bins() {
        let mut histogram = Histogram::default();
        assert_eq!(histogram.quantile_ms(0.5), None);
        for n in 0..100 {
            histogram.add(f64::from(n) * 1e-4 + 5e-5);
        }
        histogram.add(10.0);
        let near = |part, expected: f64| {
            let found = histogram.quantile_ms(part).expect("values");
            assert!((found - expected).abs() < 1e-9, "{found}");
        };
        near(0.5, 5.1);
        near(0.99, 10.0);
        near(1.0, 100.0);
        let classes = histogram.classes();
        assert_eq!(classes[0], (1.0, 10));
        assert_eq!(classes[3], (5.0, 20));
        assert_eq!(classes[10], (100.0, 1));
        let sum: u64 = classes.iter().map(|(_, count)| count).sum();
        assert_eq!(sum, histogram.count);
    }
}
