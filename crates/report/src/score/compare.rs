//! Estimates of two logs of the same drive.

use std::collections::BTreeMap;
use std::rc::Rc;

use sample::{Estimate, Event, ForceFrame, LogTime, Parameters, Wheel};
use serde_json::{Value, json};
use store::{Reader, Record, Selection, Stage};

use super::{Pairs, ScoreError, each_signal, events, forces};

/// Events of the same kind this near each other are the same, s.
const SAME_EVENT_S: f64 = 0.1;

/// How one signal differs.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Its name.
    pub signal: &'static str,
    /// The wheel, if it is a wheel's.
    pub wheel: Option<Wheel>,
    /// Unit.
    pub unit: &'static str,
    /// Instants at which both know it.
    pub count: usize,
    /// Mean of this log's estimate less the other's.
    pub mean: f64,
    /// Root mean square of the difference.
    pub rms: f64,
    /// Largest difference, sign left out.
    pub largest: f64,
    /// When it was, s from the first common estimate.
    pub largest_at_s: f64,
    /// Instants at which one side alone knows it.
    pub one_sided: usize,
    /// Largest difference of the stated standard deviations, sign left out, where both tell them.
    pub largest_of_sigma: Option<f64>,
}

/// An event that one log alone has.
#[derive(Clone, Debug, PartialEq)]
pub struct LoneEvent {
    /// Its kind.
    pub kind: &'static str,
    /// When, s from the first common estimate.
    pub at_s: f64,
    /// Its text.
    pub text: String,
}

/// Two logs compared.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Estimates at the same instants.
    pub common: usize,
    /// Estimates of this log without a counterpart.
    pub only_here: usize,
    /// Estimates of the other log without a counterpart.
    pub only_there: usize,
    /// Signals that either side knows.
    pub signals: Vec<Difference>,
    /// Reports of parameters at the same instants, and how many of them differ in anything.
    pub parameters: [usize; 2],
    /// Events that both have.
    pub same_events: usize,
    /// Events that both have, but not to the instant and the letter.
    pub similar_events: usize,
    /// Events of this log alone.
    pub events_only_here: Vec<LoneEvent>,
    /// Events of the other log alone.
    pub events_only_there: Vec<LoneEvent>,
}

/// Compares the estimates of `here` with those of `there`, both causal or both smoothed, instant by
/// instant.
///
/// # Errors
/// If a log cannot be read, or they have no instant in common.
pub fn compare(
    here: &Reader,
    there: &Reader,
    stage: Stage,
    from_s: f64,
) -> Result<Comparison, ScoreError> {
    let mut others: BTreeMap<LogTime, Estimate> = BTreeMap::new();
    for estimate in there.of_stage(stage) {
        let estimate = estimate?;
        others.insert(estimate.time, estimate);
    }
    let (mut pairs, mut only_here, mut start) = (Pairs::new(), 0, None);
    for estimate in here.of_stage(stage) {
        let estimate = estimate?;
        match others.remove(&estimate.time) {
            Some(other) => {
                let first = *start.get_or_insert(estimate.time);
                if estimate.time.seconds_since(first) >= from_s {
                    pairs.push((Box::new(estimate), Rc::new(Box::new(other))));
                }
            }
            None => only_here += 1,
        }
    }
    let start = start.ok_or(ScoreError::NoPair("estimate of the other log"))?;
    let mut signals = Vec::new();
    // A log of an earlier version has no forces in the wheel-carrier frame to compare with.
    let frames = [
        forces::frames(pairs.iter().map(|(a, _)| &**a)),
        forces::frames(pairs.iter().map(|(_, b)| &***b)),
    ];
    let is_common = |frame| frames.iter().all(|own| own[0][0] == frame);
    let both = [[ForceFrame::WheelCarrier; 2], [ForceFrame::Contact; 2]];
    let own = if is_common(ForceFrame::WheelCarrier) {
        &both[..]
    } else {
        &both[1..]
    };
    each_signal(own, |signal| {
        let pick = signal.estimate;
        let values = pairs
            .iter()
            .map(|(a, b)| (a.time.seconds_since(start), pick.of(a), pick.of(b)));
        signals.extend(difference(values).map(|found| Difference {
            signal: signal.name,
            wheel: signal.wheel,
            unit: signal.unit,
            ..found
        }));
    });
    let [mine, theirs] = [events(here)?, events(there)?].map(|all| told(all, start, from_s));
    let events_only_here = alone(&mine, &theirs);
    let same_events = mine.iter().filter(|event| theirs.contains(event)).count();
    Ok(Comparison {
        common: pairs.len(),
        only_here,
        only_there: others.len(),
        signals,
        parameters: parameters(here, there, start.offset_seconds(from_s))?,
        same_events,
        similar_events: mine.len() - events_only_here.len() - same_events,
        events_only_here,
        events_only_there: alone(&theirs, &mine),
    })
}

/// Counts reports of parameters that stand in both logs, and those that differ.
fn parameters(here: &Reader, there: &Reader, from: LogTime) -> Result<[usize; 2], ScoreError> {
    let of = |reader: &Reader| -> Result<BTreeMap<LogTime, Parameters>, ScoreError> {
        let mut all = BTreeMap::new();
        for message in reader.messages(Selection::topics(["/estimate/parameters"])) {
            if let Some(Record::Parameters(found)) = message?.record()? {
                all.insert(found.time, *found);
            }
        }
        Ok(all)
    };
    let others = of(there)?;
    let (mut common, mut different) = (0, 0);
    for (_, own) in of(here)?.range(from..) {
        if let Some(other) = others.get(&own.time) {
            common += 1;
            // By what is printed, in which NaN equals NaN.
            different += usize::from(format!("{own:?}") != format!("{other:?}"));
        }
    }
    Ok([common, different])
}

fn difference(values: impl Iterator<Item = (f64, (f64, f64), (f64, f64))>) -> Option<Difference> {
    let mut found = Difference {
        signal: "",
        wheel: None,
        unit: "",
        count: 0,
        mean: 0.0,
        rms: 0.0,
        largest: 0.0,
        largest_at_s: 0.0,
        one_sided: 0,
        largest_of_sigma: None,
    };
    for (time_s, (a, sigma_a), (b, sigma_b)) in values {
        let sigma = (sigma_a - sigma_b).abs();
        if sigma.is_finite() {
            found.largest_of_sigma = Some(sigma.max(found.largest_of_sigma.unwrap_or(0.0)));
        }
        match (a.is_finite(), b.is_finite()) {
            (true, true) => {
                let apart = a - b;
                found.count += 1;
                found.mean += apart;
                found.rms += apart * apart;
                if apart.abs() > found.largest {
                    (found.largest, found.largest_at_s) = (apart.abs(), time_s);
                }
            }
            (false, false) => {}
            _ => found.one_sided += 1,
        }
    }
    if found.count > 0 {
        found.mean /= found.count as f64;
        found.rms = (found.rms / found.count as f64).sqrt();
    }
    (found.count + found.one_sided > 0).then_some(found)
}

fn told(events: Vec<Event>, start: LogTime, from_s: f64) -> Vec<LoneEvent> {
    events
        .into_iter()
        .map(|event| LoneEvent {
            kind: event.kind.name(),
            at_s: event.time.seconds_since(start),
            text: event.text,
        })
        .filter(|event| event.at_s >= from_s)
        .collect()
}

fn alone(mine: &[LoneEvent], theirs: &[LoneEvent]) -> Vec<LoneEvent> {
    let has_twin = |event: &LoneEvent| {
        theirs.iter().any(|other| {
            other.kind == event.kind && (other.at_s - event.at_s).abs() <= SAME_EVENT_S
        })
    };
    mine.iter().filter(|e| !has_twin(e)).cloned().collect()
}

impl Comparison {
    /// Whether nothing at all differs.
    #[must_use]
    pub fn is_identical(&self) -> bool {
        self.only_here + self.only_there == 0
            && self.parameters[1] == 0
            && self.similar_events == 0
            && self.events_only_here.is_empty()
            && self.events_only_there.is_empty()
            && self.signals.iter().all(|s| {
                s.largest == 0.0 && s.one_sided == 0 && s.largest_of_sigma.unwrap_or(0.0) == 0.0
            })
    }

    /// As JSON, by the keys of `docs/score.md`.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let signals: Vec<Value> = self
            .signals
            .iter()
            .map(|row| {
                json!({
                    "signal": row.signal,
                    "wheel": row.wheel.map(Wheel::abbreviation),
                    "unit": row.unit,
                    "count": row.count,
                    "mean": row.mean,
                    "rms": row.rms,
                    "largest": row.largest,
                    "largest_at_s": row.largest_at_s,
                    "one_sided": row.one_sided,
                    "largest_of_sigma": row.largest_of_sigma,
                })
            })
            .collect();
        let events = |events: &[LoneEvent]| -> Vec<Value> {
            let json = |e: &LoneEvent| json!({ "kind": e.kind, "at_s": e.at_s, "text": e.text });
            events.iter().map(json).collect()
        };
        json!({
            "common": self.common,
            "only_here": self.only_here,
            "only_there": self.only_there,
            "identical": self.is_identical(),
            "signals": signals,
            "parameters": self.parameters[0],
            "parameters_different": self.parameters[1],
            "same_events": self.same_events,
            "similar_events": self.similar_events,
            "events_only_here": events(&self.events_only_here),
            "events_only_there": events(&self.events_only_there),
        })
    }
}
