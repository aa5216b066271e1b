//! What a running recorder says of itself: whether it writes, where to, and how long the disk lasts.

use std::fmt;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use engine::Config;
use sample::SourceId;
use serde_json::{Value, json};
use store::Recorder;

use crate::retention::{self, Limits, Outcome, Removed};

/// A rate is measured once a run is this old.
const MEASURED_AFTER: Duration = Duration::from_secs(10);

/// Whether files are written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Writing {
    /// Until told otherwise.
    Always,
    /// Because of this, for a while.
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

/// Told by the pipeline, read by whoever asks.
pub struct Board(Mutex<State>);

struct State {
    writing: Writing,
    recorder: Weak<Recorder>,
    begun: Instant,
    directory: PathBuf,
    limits: Limits,
    /// Of the newest log, from before there was one to measure.
    last_rate: Option<f64>,
    names: Vec<String>,
    faulty_sensors: Vec<String>,
    removed: Removals,
    /// Limits of the log directory that do not hold, and why.
    broken: Vec<String>,
}

/// Logs that retention has removed since the start.
#[derive(Default)]
struct Removals {
    count: u64,
    bytes: u64,
    last: Option<Removed>,
}

impl Board {
    /// The board of a recorder that does not write yet.
    pub fn new(config: &Config) -> Self {
        let directory = config.storage.directory.clone();
        Self(Mutex::new(State {
            writing: Writing::Stopped,
            recorder: Weak::new(),
            begun: Instant::now(),
            last_rate: retention::last_rate(&directory),
            directory,
            limits: config.storage.limits,
            names: names(config),
            faulty_sensors: Vec::new(),
            removed: Removals::default(),
            broken: Vec::new(),
        }))
    }

    /// Another configuration is in force.
    pub fn reload(&self, config: &Config) {
        let mut state = self.lock();
        state.directory.clone_from(&config.storage.directory);
        state.limits = config.storage.limits;
        state.broken.clear();
        state.names = names(config);
        state.faulty_sensors.clear();
    }

    /// Tells which sensors the estimator leaves out.
    pub fn set_faulty_sensors(&self, names: Vec<String>) {
        self.lock().faulty_sensors = names;
    }

    /// Sensors that the estimator leaves out.
    pub fn faulty_sensors(&self) -> Vec<String> {
        self.lock().faulty_sensors.clone()
    }

    /// Takes in what a look at the log directory led to.
    pub fn note_retention(&self, outcome: Outcome) {
        let mut state = self.lock();
        state.broken = outcome.broken;
        for log in outcome.removed {
            state.removed.count += 1;
            state.removed.bytes += log.bytes;
            state.removed.last = Some(log);
        }
    }

    /// Which logs were removed since the start, and why: `removed`, `removed_bytes`, `last`,
    /// `reason` (the limit), and `broken`, the limits that do not hold.
    pub fn retention(&self) -> Value {
        let state = self.lock();
        let last = state.removed.last.as_ref();
        json!({
            "removed": state.removed.count,
            "removed_bytes": state.removed.bytes,
            "last": last.map(|log| log.path.display().to_string()),
            "reason": last.map(|log| log.reason.to_string()),
            "broken": state.broken,
        })
    }

    /// A run begins.
    pub fn write_to(&self, recorder: &Arc<Recorder>) {
        let mut state = self.lock();
        state.recorder = Arc::downgrade(recorder);
        state.begun = Instant::now();
    }

    /// Tells whether files are written.
    pub fn set(&self, writing: Writing) {
        self.lock().writing = writing;
    }

    /// Whether files are written.
    pub fn state(&self) -> Writing {
        self.lock().writing.clone()
    }

    /// Whether files are written, in words.
    pub fn writing(&self) -> String {
        self.lock().writing.to_string()
    }

    /// Who writes, if somebody does.
    pub fn recorder(&self) -> Option<Arc<Recorder>> {
        self.lock().recorder.upgrade()
    }

    /// Name of a source.
    pub fn source_name(&self, id: SourceId) -> String {
        match self.lock().names.get(usize::from(id.0)) {
            Some(name) => name.clone(),
            None => "recorder".to_owned(),
        }
    }

    /// How long the disk lasts: at the rate of the present run once it is old enough, before that
    /// at the rate of the newest log.
    pub fn estimate(&self) -> Estimate {
        let (rate_bytes_s, directory, limits) = {
            let state = self.lock();
            let age = state.begun.elapsed();
            let bytes = state
                .recorder
                .upgrade()
                .map(|recorder| recorder.status().bytes);
            let measured = bytes.filter(|bytes| age >= MEASURED_AFTER && *bytes > 0);
            let measured = measured.map(|bytes| bytes as f64 / age.as_secs_f64());
            (
                measured.or(state.last_rate),
                state.directory.clone(),
                state.limits,
            )
        };
        Estimate {
            room_bytes: retention::room(&directory, limits).ok(),
            rate_bytes_s,
            oldest_go: limits != Limits::default(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn names(config: &Config) -> Vec<String> {
    let sources = config.sources.iter();
    sources.map(|source| source.spec.name.clone()).collect()
}

/// How long the disk lasts.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Bytes that logs may still take.
    pub room_bytes: Option<u64>,
    /// Bytes a second, where that is known.
    pub rate_bytes_s: Option<f64>,
    /// What is full then is made room in: the oldest logs go.
    pub oldest_go: bool,
}

impl Estimate {
    /// Seconds until the room is used up.
    pub fn lasts_s(&self) -> Option<f64> {
        let (room, rate) = self.room_bytes.zip(self.rate_bytes_s)?;
        (rate > 0.0).then(|| room as f64 / rate)
    }
}

impl fmt::Display for Estimate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(room) = self.room_bytes else {
            return f.write_str("the disk does not tell its room");
        };
        write!(f, "room for {:.1} GiB", room as f64 / (1 << 30) as f64)?;
        if let (Some(lasts_s), Some(rate)) = (self.lasts_s(), self.rate_bytes_s) {
            write!(
                f,
                ", {:.1} h at {:.1} kB/s",
                lasts_s / 3600.0,
                rate / 1000.0
            )?;
        }
        if self.oldest_go {
            f.write_str("; then the oldest logs go")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_estimate_is_told_as_far_as_it_is_known() {
        let mut estimate = Estimate {
            room_bytes: Some(36 << 30),
            rate_bytes_s: None,
            oldest_go: false,
        };
        assert_eq!(estimate.to_string(), "room for 36.0 GiB");
        estimate.rate_bytes_s = Some(1e6);
        estimate.oldest_go = true;
        let text = estimate.to_string();
        assert_eq!(
            text,
            "room for 36.0 GiB, 10.7 h at 1000.0 kB/s; then the oldest logs go"
        );
    }
}
