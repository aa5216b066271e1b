//! Engine: computes records from arrivals, in a recording and in a replay alike.
//!
//! The engine is deterministic: it reads no clock, no device and no environment. The same configuration
//! and the same arrivals give the same records, bit for bit. Its time is the log time of the arrivals,
//! among which are ticks, so that time also advances without data.

mod adapter;
mod can;
mod clock;
mod counts;
mod lateness;
mod own;
mod rate;
mod reception;
mod source;
mod timely;
mod utc;

use std::collections::BTreeSet;

use estimator::smoother::{LAG_STEPS, Smoother};
use estimator::{Estimator, LatencyEstimate, LatencyPrior, MistakeReport, Output};
use sample::{
    Arrival, Estimate, EventKind, ForceFrame, Health, LogTime, NANOS_PER_SECOND, Notice, Payload,
    Sample, Severity, SourceId,
};
use store::{LogMessage, Losses, Record, Stage, UtcOffset};

use crate::Result;
use crate::config::{self, Config};
use crate::latency::{self, describe_latency};
use crate::scene::SceneMaker;
pub use can::DM1;
pub(crate) use can::{Scales, conversion};
pub use counts::MessageCounts;
use own::OwnFrames;
pub use reception::Reception;
use source::{SilenceChange, SourceState};
use timely::{Patience, Timely};

/// Time between two health reports.
const HEALTH_INTERVAL_NS: i64 = NANOS_PER_SECOND;
/// Time without data of any source after which there is no estimate, ns.
pub const SILENCE_NS: i64 = NANOS_PER_SECOND;
/// Time between two checks for silent sources.
const WATCH_INTERVAL_NS: i64 = NANOS_PER_SECOND / 10;

/// Text of the notice of a source that was closed normally.
const STOPPED: &str = "stopped";

/// Computes records from arrivals.
pub struct Engine {
    sources: Vec<SourceState>,
    own: Option<OwnFrames>,
    estimator: Option<Timely>,
    smoother: Option<Smoother>,
    samples: Vec<Sample>,
    silence: Silence,
    patience: Patience,
    /// Losses in the notices of the stream, so that a replay computes the same health.
    losses: Losses,
    faulty_sensors: BTreeSet<String>,
    next_watch: Option<LogTime>,
    next_health: Option<LogTime>,
    utc_offset: Option<UtcOffset>,
    scene: Option<SceneMaker>,
    /// Whether each latency that the configuration does not know was found and reported.
    latencies_found: Vec<bool>,
}

impl Engine {
    /// Engine before the first arrival.
    pub fn new(config: &Config) -> Result<Self> {
        let mut sources = config
            .sources
            .iter()
            .map(|source| SourceState::new(source, config.estimator.as_ref()))
            .collect::<Result<Vec<_>>>()?;
        let uncertain = latency::uncertain(&config.sources);
        for (place, one) in uncertain.iter().enumerate() {
            for source in sources
                .iter_mut()
                .filter(|source| source.id() == one.source)
            {
                source.set_uncertain(one.message, place);
            }
        }
        let latencies_found = vec![false; uncertain.len()];
        let priors = uncertain.into_iter().map(|one| one.prior).collect();
        let estimator = config.estimator.as_ref();
        let estimator = estimator
            .map(|settings| new_estimator(settings, priors))
            .transpose()?;
        Ok(Self {
            sources,
            own: OwnFrames::of(config),
            estimator,
            smoother: None,
            samples: Vec::new(),
            silence: Silence::default(),
            patience: Patience::default(),
            losses: Losses::default(),
            faulty_sensors: BTreeSet::new(),
            next_watch: None,
            next_health: None,
            utc_offset: None,
            scene: config.output.scene.then(SceneMaker::default),
            latencies_found,
        })
    }

    /// Engine that also smooths, for a replay. [`Engine::finish`] returns the last smoothed estimates.
    pub fn smoothing(config: &Config) -> Result<Self> {
        let mut engine = Self::new(config)?;
        engine.estimator = engine.estimator.map(Timely::traced);
        let settings = config.estimator.as_ref();
        if let Some(settings) = settings {
            let loaded = settings.vehicle.loaded(&settings.settings.payload);
            let loaded = loaded.map_err(estimator::EstimatorError::from)?;
            engine.smoother = Some(Smoother::new(&loaded.vehicle, LAG_STEPS));
        }
        Ok(engine)
    }

    /// Last offset of UTC from the log clock that a receiver gave.
    pub const fn utc_offset(&self) -> Option<UtcOffset> {
        self.utc_offset
    }

    /// Engine that also estimates during silence, as earlier versions did, to verify their logs.
    pub fn through_silence(mut self) -> Self {
        self.silence.is_ignored = true;
        self
    }

    /// Number of estimates during silence of an engine
    /// [`through_silence`](Self::through_silence).
    pub const fn estimates_during_silence(&self) -> u64 {
        self.silence.estimates
    }

    /// Whether the engine estimates or only decodes.
    pub const fn estimates(&self) -> bool {
        self.estimator.is_some()
    }

    /// Appends the records that were waiting for more arrivals.
    pub fn finish(&mut self, records: &mut Vec<Record>) {
        if let (Some(smoother), Some(estimator)) = (&mut self.smoother, &mut self.estimator) {
            estimator.finish(&mut |output| {
                if let Output::Step(step) = output {
                    smoother.push(*step, &mut |estimate| {
                        push_stage(records, Stage::Smoothed, &estimate);
                    });
                }
            });
            smoother.finish(&mut |estimate| push_stage(records, Stage::Smoothed, &estimate));
        }
    }

    /// Processes the next arrival and appends its records to `records`.
    pub fn push(&mut self, arrival: &Arrival, records: &mut Vec<Record>) {
        let others = self.own.as_ref().and_then(|own| own.without(arrival));
        let arrival = others.as_ref().unwrap_or(arrival);
        let now = arrival.log_time;
        self.samples.clear();
        let is_data = has_data(&arrival.payload);
        let limit_ns = self.patience.limit_ns(now, is_data);
        if let Some(source) = self.sources.get_mut(usize::from(arrival.source.0)) {
            source.push(arrival, limit_ns, &mut self.samples);
        }
        if let Payload::Notice(notice) = &arrival.payload {
            self.losses.add_notice(arrival.source, notice);
            self.log_notice(arrival.source, now, notice, records);
            if let Notice::Mark(text) = notice {
                self.mark(now, text, records);
            }
        }
        self.estimate(arrival, is_data, limit_ns, records);
        records.extend(self.samples.drain(..).map(Record::Sample));
        self.watch(now, records);
        self.report_health(now, records);
    }

    fn estimate(
        &mut self,
        arrival: &Arrival,
        has_data: bool,
        limit_ns: i64,
        records: &mut Vec<Record>,
    ) {
        let now = arrival.log_time;
        let Some(estimator) = &mut self.estimator else {
            return;
        };
        let first = records.len();
        let smoother = &mut self.smoother;
        let faulty = &mut self.faulty_sensors;
        let silent_from = self.silence.begins(now, has_data);
        let is_ignored = self.silence.is_ignored;
        let estimates = &mut self.silence.estimates;
        let mut take = |output| match output {
            Output::Estimate(estimate) => {
                *estimates += u64::from(silent_from.is_some_and(|from| estimate.time >= from));
                records.push(Record::Estimate(Box::new(estimate)));
            }
            Output::Parameters(all) => records.push(Record::Parameters(Box::new(all))),
            Output::Limits(limits) => records.push(Record::Limits(Box::new(limits))),
            Output::Terrain(terrain) => records.push(Record::Terrain(terrain)),
            Output::Road(road) => records.push(Record::Road {
                stage: Stage::Estimate,
                road: Box::new(road),
            }),
            Output::LaggedRoad(road) => records.push(Record::Road {
                stage: Stage::Lagged,
                road: Box::new(road),
            }),
            Output::Event(event) => {
                match &event.kind {
                    EventKind::SensorFault(name) => drop(faulty.insert(name.clone())),
                    EventKind::SensorRecovered(name) => drop(faulty.remove(name)),
                    _ => {}
                }
                records.push(Record::Event(event));
            }
            Output::Lagged(estimate) => push_stage(records, Stage::Lagged, &estimate),
            Output::Step(step) => {
                if let Some(smoother) = smoother {
                    smoother.push(*step, &mut |estimate| {
                        push_stage(records, Stage::Smoothed, &estimate);
                    });
                }
            }
        };
        match silent_from {
            Some(from) if !is_ignored => {
                estimator.advance(from, limit_ns, &mut take);
                if has_data {
                    estimator.skip_to(now);
                }
            }
            _ => estimator.advance(now, limit_ns, &mut take),
        }
        if let Some(scene) = &mut self.scene {
            scene.advance(estimator.estimator(), first, records);
            self.samples.iter().for_each(|sample| scene.sample(sample));
        }
        let source = self.sources.get(usize::from(arrival.source.0));
        for (n, sample) in self.samples.iter().enumerate() {
            let message = source.and_then(|source| source.uncertain(n));
            let is_too_late = source.is_some_and(|source| source.is_too_late(n));
            estimator.push(sample, message, is_too_late);
        }
    }

    /// Lets the estimator do what a mark says of a payload.
    fn mark(&mut self, now: LogTime, text: &str, records: &mut Vec<Record>) {
        let marked = self
            .estimator
            .as_mut()
            .map(|estimator| estimator.mark(now, text));
        if let Some(Err(error)) = marked {
            let text = format!("the mark \"{text}\" has no effect: {error}");
            let name = "estimator".to_owned();
            records.push(log(now, Severity::Warning, name, text));
        }
    }

    fn source_name(&self, id: SourceId) -> &str {
        self.sources
            .get(usize::from(id.0))
            .map_or("recorder", SourceState::name)
    }

    // `replay --verify` compares the texts of log messages with those of older logs: they must not
    // change.
    fn log_notice(
        &self,
        source: SourceId,
        time: LogTime,
        notice: &Notice,
        records: &mut Vec<Record>,
    ) {
        let (severity, text) = match notice {
            Notice::Opened(text) => (Severity::Info, format!("opened: {text}")),
            Notice::Closed(text) => {
                let severity = if text == STOPPED {
                    Severity::Info
                } else {
                    Severity::Warning
                };
                (severity, format!("closed: {text}"))
            }
            Notice::Lost { place, count } => (
                Severity::Error,
                format!("{count} items lost ({})", place.name()),
            ),
            Notice::EstimatorSkipped {
                first_sequence,
                count,
            } => (
                Severity::Warning,
                format!("the estimator left out {count} arrivals from {first_sequence} on"),
            ),
            Notice::Mark(text) => {
                let text = text.clone();
                records.push(Record::Mark { time, text });
                return;
            }
        };
        let name = self.source_name(source).to_owned();
        records.push(log(time, severity, name, text));
    }

    fn watch(&mut self, now: LogTime, records: &mut Vec<Record>) {
        if !is_due(&mut self.next_watch, now, WATCH_INTERVAL_NS) {
            return;
        }
        for source in &mut self.sources {
            let (severity, text) = match source.watch(now) {
                Some(SilenceChange::Began) => (Severity::Error, "fell silent"),
                Some(SilenceChange::Ended) => (Severity::Info, "speaks again"),
                None => continue,
            };
            let name = source.name().to_owned();
            records.push(log(now, severity, name, text.to_owned()));
        }
    }

    fn report_health(&mut self, now: LogTime, records: &mut Vec<Record>) {
        if !is_due(&mut self.next_health, now, HEALTH_INTERVAL_NS) {
            return;
        }
        records.push(Record::Health(self.health(now)));
        self.report_latencies(now, records);
        for source in &self.sources {
            records.extend(source.clocks(now).map(Record::ClockFit));
        }
        let offsets = self.sources.iter_mut().filter_map(|s| s.utc_offset(now));
        // Of equally good offsets, the first one is used.
        if let Some(best) = offsets.min_by(|a, b| a.sigma_s.total_cmp(&b.sigma_s)) {
            self.utc_offset = Some(best);
            records.push(Record::UtcOffset(best));
        }
    }

    /// Reports each latency that has been found since the last call.
    fn report_latencies(&mut self, now: LogTime, records: &mut Vec<Record>) {
        if self.latencies_found.iter().all(|is_found| *is_found) {
            return;
        }
        let found = self.latencies();
        for (one, is_reported) in found.iter().zip(&mut self.latencies_found) {
            if one.is_found && !std::mem::replace(is_reported, true) {
                let text = describe_latency(one);
                records.push(log(now, Severity::Info, "estimator".to_owned(), text));
            }
        }
    }

    /// What the run says of the latencies that the configuration does not know.
    #[must_use]
    pub fn latencies(&self) -> Vec<LatencyEstimate> {
        let estimator = self.estimator.as_ref();
        estimator.map_or_else(Vec::new, |estimator| estimator.estimator().latencies())
    }

    /// What the run says of its configuration; `None` without a vehicle with linkages.
    #[must_use]
    pub fn mistake_report(&self) -> Option<MistakeReport> {
        self.estimator.as_ref()?.estimator().mistake_report()
    }

    /// What arrived from each source since the start.
    pub fn reception(&self) -> impl Iterator<Item = Reception> {
        self.sources.iter().map(SourceState::reception)
    }

    /// Counters of all sources, and the sensors that the estimator excludes.
    pub fn health(&self, time: LogTime) -> Health {
        Health {
            time,
            sources: self
                .sources
                .iter()
                .map(|s| s.health(&self.losses))
                .collect(),
            faulty_sensors: self.faulty_sensors.iter().cloned().collect(),
        }
    }
}

/// Time without data of any source.
#[derive(Default)]
struct Silence {
    /// Log time of the last data; before the first data, of the first arrival.
    last_data: Option<LogTime>,
    /// Whether estimates continue during silence.
    is_ignored: bool,
    /// Number of estimates during silence.
    estimates: u64,
}

impl Silence {
    /// Begin of the silence that contains or ends at `now`, if there is one.
    fn begins(&mut self, now: LogTime, has_data: bool) -> Option<LogTime> {
        let from = *self.last_data.get_or_insert(now) + SILENCE_NS;
        if has_data {
            self.last_data = Some(now);
        }
        (now > from).then_some(from)
    }
}

/// Whether the payload contains data of a source.
fn has_data(payload: &Payload) -> bool {
    match payload {
        Payload::Bytes(bytes) => !bytes.is_empty(),
        Payload::Can(frames) => !frames.is_empty(),
        Payload::Notice(_) | Payload::Tick => false,
    }
}

fn new_estimator(config: &config::Estimator, latencies: Vec<LatencyPrior>) -> Result<Timely> {
    let mut estimator = Estimator::new(
        &config.vehicle,
        &config.sensors,
        &config.calibration,
        config.settings.clone(),
    )?;
    estimator.set_latencies(latencies);
    Ok(Timely::new(estimator))
}

/// Motion and forces of a later stage.
fn push_stage(records: &mut Vec<Record>, stage: Stage, estimate: &Estimate) {
    let time = estimate.time;
    records.push(Record::Motion {
        time,
        stage,
        motion: Box::new(estimate.motion),
    });
    for frame in [ForceFrame::WheelCarrier, ForceFrame::Contact] {
        records.push(Record::TyreForces {
            time,
            stage,
            frame,
            forces: Box::new(*estimate.forces(frame)),
        });
    }
}

fn log(time: LogTime, severity: Severity, name: String, text: String) -> Record {
    Record::Log(LogMessage {
        time,
        severity,
        name,
        text,
    })
}

/// Whether a periodic action is due; if so, sets the next due time. The first arrival starts the
/// period.
fn is_due(next: &mut Option<LogTime>, now: LogTime, interval_ns: i64) -> bool {
    match *next {
        None => {
            *next = Some(now + interval_ns);
            false
        }
        Some(due) if now >= due => {
            let periods = (now - due) / interval_ns + 1;
            *next = Some(due + periods * interval_ns);
            true
        }
        Some(_) => false,
    }
}

/// Arrivals that the estimator skipped while recording.
#[derive(Clone, Debug, Default)]
pub struct Skipped(BTreeSet<(u64, u64)>);

impl Skipped {
    /// Adds the arrivals of a notice.
    pub fn add(&mut self, notice: &Notice) {
        if let Notice::EstimatorSkipped {
            first_sequence,
            count,
        } = notice
        {
            let end = first_sequence.saturating_add(*count);
            self.0.insert((*first_sequence, end));
        }
    }

    /// Whether the arrival with this number was skipped.
    pub fn contains(&self, sequence: u64) -> bool {
        self.0
            .range(..=(sequence, u64::MAX))
            .next_back()
            .is_some_and(|(_, end)| sequence < *end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skipped_arrivals_are_found_by_their_bounds() {
        let mut skipped = Skipped::default();
        for (first_sequence, count) in [(10, 5), (100, 1)] {
            skipped.add(&Notice::EstimatorSkipped {
                first_sequence,
                count,
            });
        }
        let found: Vec<u64> = (0..200).filter(|s| skipped.contains(*s)).collect();
        assert_eq!(found, [10, 11, 12, 13, 14, 100]);
    }

    #[test]
    fn periodic_actions_keep_their_grid_over_gaps() {
        let mut next = None;
        let due = |next: &mut Option<LogTime>, ms: u64| {
            is_due(next, LogTime(ms * 1_000_000), HEALTH_INTERVAL_NS)
        };
        assert!(!due(&mut next, 500));
        assert!(!due(&mut next, 1_499));
        assert!(due(&mut next, 1_500));
        assert!(due(&mut next, 7_700));
        assert!(!due(&mut next, 8_400));
        assert!(due(&mut next, 8_500));
    }
}
