//! State of a running recorder: whether it writes, where, and how long the free space lasts.

use std::collections::VecDeque;
use std::fmt;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use engine::Config;
use sample::{Estimate, Event, Health, MessageCount, Parameters, SourceId};
use serde_json::{Value, json};
use store::{Record, Recorder};

use crate::output_can::CanSink;
use crate::retention::{self, Limits, Outcome, Removed};

/// Age of a run from which its data rate is measured.
const RATE_MEASURED_AFTER: Duration = Duration::from_secs(10);

/// Whether files are written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Writing {
    /// Until a stop.
    Always,
    /// Until the end of the trigger's time; holds the reason of the trigger.
    Triggered(String),
    /// Not before the next trigger.
    Armed,
    /// Not before the next start.
    Stopped,
}

impl fmt::Display for Writing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Always => f.write_str("recording"),
            Self::Triggered(reason) => write!(f, "recording, triggered by {reason}"),
            Self::Armed => f.write_str("waiting for a trigger"),
            Self::Stopped => f.write_str("stopped"),
        }
    }
}

/// State of the recorder: the pipeline sets it, the control socket reads it.
pub struct RecorderStatus(Mutex<State>);

struct State {
    writing: Writing,
    recorder: Weak<Recorder>,
    run_start: Instant,
    directory: PathBuf,
    limits: Limits,
    /// Data rate of the newest log at the start of the program, bytes/s.
    last_rate: Option<f64>,
    source_names: Vec<String>,
    removed: Removals,
    found: Found,
    can: Option<CanSink>,
    /// Limits of the log directory that are exceeded, and why.
    exceeded: Vec<String>,
}

/// Most events that are kept.
const EVENTS_MAX: usize = 10;

/// What the engine has found last.
#[derive(Default)]
struct Found {
    estimate: Option<Estimate>,
    parameters: Option<Parameters>,
    /// The last events, the newest last.
    events: VecDeque<Event>,
    health: Health,
    /// Messages of each source in the last second, 1/s.
    rates_hz: Vec<f64>,
}

impl Found {
    fn take(&mut self, record: &Record) {
        match record {
            Record::Estimate(estimate) => self.estimate = Some((**estimate).clone()),
            Record::Parameters(parameters) => self.parameters = Some(**parameters),
            Record::Event(event) => {
                if self.events.len() == EVENTS_MAX {
                    self.events.pop_front();
                }
                self.events.push_back(event.clone());
            }
            Record::Health(health) => {
                let seconds = health.time.seconds_since(self.health.time);
                let before = &self.health.sources;
                let counts = health.sources.iter().enumerate();
                self.rates_hz = counts
                    .map(|(n, source)| {
                        let before = before.get(n).map_or(0, |before| before.messages);
                        source.messages.saturating_sub(before) as f64 / seconds.max(1e-3)
                    })
                    .collect();
                if before.is_empty() {
                    self.rates_hz.clear();
                }
                self.health.clone_from(health);
            }
            _ => {}
        }
    }
}

/// Logs that retention has removed since the start.
#[derive(Default)]
struct Removals {
    count: u64,
    bytes: u64,
    last: Option<Removed>,
}

impl RecorderStatus {
    /// State of a recorder that does not write yet.
    pub fn new(config: &Config) -> Self {
        let directory = config.storage.directory.clone();
        Self(Mutex::new(State {
            writing: Writing::Stopped,
            recorder: Weak::new(),
            run_start: Instant::now(),
            last_rate: retention::last_rate(&directory),
            directory,
            limits: config.storage.limits,
            source_names: source_names(config),
            removed: Removals::default(),
            found: Found::default(),
            can: None,
            exceeded: Vec::new(),
        }))
    }

    /// Takes the values of a new configuration.
    pub fn reload(&self, config: &Config) {
        let mut state = self.lock();
        state.directory.clone_from(&config.storage.directory);
        state.limits = config.storage.limits;
        state.exceeded.clear();
        state.source_names = source_names(config);
        state.found = Found::default();
    }

    /// Takes what an engine has found.
    pub fn take(&self, record: &Record) {
        use Record::{Estimate, Event, Health, Parameters};
        // Samples are many, and change nothing here.
        if matches!(record, Estimate(_) | Parameters(_) | Event(_) | Health(_)) {
            self.lock().found.take(record);
        }
    }

    /// Sets the output to controllers.
    pub fn set_can(&self, can: Option<CanSink>) {
        self.lock().can = can;
    }

    /// Messages of a source that its decoder knows by name and does not decode.
    pub fn undecoded(&self, id: SourceId) -> Vec<MessageCount> {
        let state = self.lock();
        let mut sources = state.found.health.sources.iter();
        let source = sources.find(|source| source.source == id);
        source.map_or_else(Vec::new, |source| source.undecoded.clone())
    }

    /// Messages of a source that came late and were used at their own time, and those that came too late
    /// to be used.
    pub fn late(&self, id: SourceId) -> [u64; 2] {
        let state = self.lock();
        let mut sources = state.found.health.sources.iter();
        let source = sources.find(|source| source.source == id);
        source.map_or([0, 0], |source| [source.late, source.too_late])
    }

    /// Sensors that the estimator excludes.
    pub fn faulty_sensors(&self) -> Vec<String> {
        self.lock().found.health.faulty_sensors.clone()
    }

    /// Messages of a source in the last second, 1/s.
    pub fn rate_hz(&self, name: &str) -> Option<f64> {
        let found = &self.lock().found;
        let mut sources = found.health.sources.iter();
        let index = sources.position(|source| source.name == name)?;
        found.rates_hz.get(index).copied()
    }

    /// Adds the estimate, the last events, the start of the run and the output to controllers.
    pub fn add_to(&self, status: &mut Value) {
        let state = self.lock();
        let is_running = state.recorder.strong_count() > 0;
        status["since_s"] = is_running
            .then(|| state.run_start.elapsed().as_secs_f64())
            .into();
        status["directory"] = state.directory.display().to_string().into();
        let estimate = state.found.estimate.as_ref();
        status["estimate"] = json!(estimate);
        status["next_lift"] = json!(estimate.and_then(|found| found.rollover.next_lift()));
        status["parameters"] = json!(state.found.parameters);
        status["events"] = json!(state.found.events);
        status["output_can"] = state.can.as_ref().map(CanSink::state).into();
    }

    /// Adds the result of a retention check.
    pub fn add_retention(&self, outcome: Outcome) {
        let mut state = self.lock();
        state.exceeded = outcome.exceeded;
        for log in outcome.removed {
            state.removed.count += 1;
            state.removed.bytes += log.bytes;
            state.removed.last = Some(log);
        }
    }

    /// Logs that were removed since the start: `removed`, `removed_bytes`, `last`, `reason` (the
    /// limit), and `broken`, the limits that are exceeded.
    pub fn retention(&self) -> Value {
        let state = self.lock();
        let last = state.removed.last.as_ref();
        json!({
            "removed": state.removed.count,
            "removed_bytes": state.removed.bytes,
            "last": last.map(|log| log.path.display().to_string()),
            "reason": last.map(|log| log.reason.to_string()),
            "broken": state.exceeded,
        })
    }

    /// Starts a run with this recorder.
    pub fn begin_run(&self, recorder: &Arc<Recorder>) {
        let mut state = self.lock();
        state.recorder = Arc::downgrade(recorder);
        state.run_start = Instant::now();
    }

    /// Sets whether files are written.
    pub fn set_writing(&self, writing: Writing) {
        self.lock().writing = writing;
    }

    /// Whether files are written.
    pub fn writing(&self) -> Writing {
        self.lock().writing.clone()
    }

    /// Recorder of the present run.
    pub fn recorder(&self) -> Option<Arc<Recorder>> {
        self.lock().recorder.upgrade()
    }

    /// Name of a source.
    pub fn source_name(&self, id: SourceId) -> String {
        match self.lock().source_names.get(usize::from(id.0)) {
            Some(name) => name.clone(),
            None => "recorder".to_owned(),
        }
    }

    /// How long the free space lasts: at the rate of the present run, or at the rate of the newest
    /// log before [`RATE_MEASURED_AFTER`].
    pub fn disk_forecast(&self) -> DiskForecast {
        let (rate_bytes_s, directory, limits) = {
            let state = self.lock();
            let age = state.run_start.elapsed();
            let bytes = state
                .recorder
                .upgrade()
                .map(|recorder| recorder.status().bytes);
            let measured = bytes.filter(|bytes| age >= RATE_MEASURED_AFTER && *bytes > 0);
            let measured = measured.map(|bytes| bytes as f64 / age.as_secs_f64());
            (
                measured.or(state.last_rate),
                state.directory.clone(),
                state.limits,
            )
        };
        DiskForecast {
            available_bytes: retention::available_bytes(&directory, limits).ok(),
            rate_bytes_s,
            removes_oldest: limits != Limits::default(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn source_names(config: &Config) -> Vec<String> {
    let sources = config.sources.iter();
    sources.map(|source| source.spec.name.clone()).collect()
}

/// How long the free space lasts.
#[derive(Clone, Debug, PartialEq)]
pub struct DiskForecast {
    /// Bytes that are available for logs; `None` if the disk cannot be queried.
    pub available_bytes: Option<u64>,
    /// Data rate, bytes/s, if it is known.
    pub rate_bytes_s: Option<f64>,
    /// Whether the oldest logs are removed when the space is used up.
    pub removes_oldest: bool,
}

impl DiskForecast {
    /// Time until the space is used up, s.
    pub fn lasts_s(&self) -> Option<f64> {
        let (available, rate) = self.available_bytes.zip(self.rate_bytes_s)?;
        (rate > 0.0).then(|| available as f64 / rate)
    }
}

impl fmt::Display for DiskForecast {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(available) = self.available_bytes else {
            return f.write_str("the free space of the disk is unknown");
        };
        let gib = available as f64 / (1 << 30) as f64;
        write!(f, "{gib:.1} GiB are available for logs")?;
        if let (Some(lasts_s), Some(rate)) = (self.lasts_s(), self.rate_bytes_s) {
            write!(
                f,
                ", {:.1} h at {:.1} kB/s",
                lasts_s / 3600.0,
                rate / 1000.0
            )?;
        }
        if self.removes_oldest {
            f.write_str("; then the oldest logs are removed")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_of_a_forecast_contains_the_known_values() {
        let mut forecast = DiskForecast {
            available_bytes: Some(36 << 30),
            rate_bytes_s: None,
            removes_oldest: false,
        };
        assert_eq!(forecast.to_string(), "36.0 GiB are available for logs");
        forecast.rate_bytes_s = Some(1e6);
        forecast.removes_oldest = true;
        assert_eq!(
            forecast.to_string(),
            "36.0 GiB are available for logs, 10.7 h at 1000.0 kB/s; then the oldest logs are removed"
        );
    }
}
