//! Changes of the surface in the truth, and what was declared of them.

use sample::{Axle, Event, EventKind, LogTime};
use serde_json::{Value, json};
use store::{Reader, Record, Selection};

use super::ScoreError;

/// Change of an axle's mean friction that is one of the surface, as a part of it.
const CHANGED: f64 = 0.1;
/// Time that both wheels of an axle take onto the other surface, s.
const CROSSING_S: f64 = 0.3;
/// A declaration belongs to a change that came at most so long before, s.
const NEAR_S: f64 = 5.0;

/// A change of the surface under an axle and what the estimator said of it.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceChange {
    /// The axle.
    pub axle: Axle,
    /// When its first wheel crossed, s from the start of the truth.
    pub at_s: f64,
    /// Friction after over friction before.
    pub friction_ratio: f64,
    /// How long after it was declared, s.
    pub declared_after_s: Option<f64>,
    /// Part of the lateral force that was declared to be left.
    pub declared_force_ratio: Option<f64>,
}

/// All changes of the surface.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceChanges {
    /// Those of the truth.
    pub changes: Vec<SurfaceChange>,
    /// Declared ones that the truth does not have.
    pub false_changes: usize,
}

impl SurfaceChange {
    /// As JSON.
    #[must_use]
    pub fn to_json(&self) -> Value {
        json!({
            "axle": self.axle.name(),
            "at_s": self.at_s,
            "friction_ratio": self.friction_ratio,
            "declared_after_s": self.declared_after_s,
            "declared_force_ratio": self.declared_force_ratio,
        })
    }
}

/// An axle's friction as it goes on.
#[derive(Default)]
struct Ground {
    friction: Option<f64>,
    crossed_s: Option<f64>,
}

impl Ground {
    /// Takes the friction of one instant in; tells when a change began and its ratio, once both
    /// wheels are across.
    fn take(&mut self, at_s: f64, friction: f64) -> Option<(f64, f64)> {
        let before = *self.friction.get_or_insert(friction);
        let ratio = friction / before;
        let changed = (ratio - 1.0).abs() > CHANGED;
        match self.crossed_s {
            None if changed => self.crossed_s = Some(at_s),
            Some(crossed_s) if at_s - crossed_s >= CROSSING_S => {
                *self = Self {
                    friction: Some(friction),
                    crossed_s: None,
                };
                return changed.then_some((crossed_s, ratio));
            }
            _ => {}
        }
        None
    }
}

/// Finds the changes of surface of a log's truth without its first `from_s` seconds; `None` where
/// the truth does not tell the friction.
pub(super) fn find(
    reader: &Reader,
    start: LogTime,
    from_s: f64,
    events: &[Event],
) -> Result<Option<SurfaceChanges>, ScoreError> {
    let said: Vec<(Axle, f64, f64)> = events
        .iter()
        .filter_map(|event| match event.kind {
            EventKind::SurfaceChange(axle, ratio) => {
                Some((axle, event.time.seconds_since(start), ratio))
            }
            _ => None,
        })
        .collect();
    let mut known = false;
    let mut grounds = [Ground::default(), Ground::default()];
    let mut changes = Vec::new();
    for message in reader.messages(Selection::topics(["/truth/friction"])) {
        let Some(Record::Friction { time, coefficient }) = message?.record()? else {
            continue;
        };
        known = true;
        let at_s = time.seconds_since(start);
        for (axle, ground) in Axle::ALL.into_iter().zip(&mut grounds) {
            let [left, right] = axle.wheels().map(|wheel| coefficient[wheel]);
            let change = ground.take(at_s, 0.5 * (left + right));
            changes.extend(change.map(|(at_s, ratio)| (axle, at_s, ratio)));
        }
    }
    let of_it = |said: &(Axle, f64, f64), change: &(Axle, f64, f64)| {
        said.0 == change.0 && (0.0..NEAR_S).contains(&(said.1 - change.1))
    };
    let false_changes = said
        .iter()
        .filter(|said| said.1 >= from_s && !changes.iter().any(|change| of_it(said, change)))
        .count();
    let judged = |change: &(Axle, f64, f64)| {
        let first = said.iter().find(|said| of_it(said, change));
        let (axle, at_s, friction_ratio) = *change;
        SurfaceChange {
            axle,
            at_s,
            friction_ratio,
            declared_after_s: first.map(|said| said.1 - at_s),
            declared_force_ratio: first.map(|said| said.2),
        }
    };
    Ok(known.then(|| SurfaceChanges {
        changes: (changes.iter().map(judged))
            .filter(|change| change.at_s >= from_s)
            .collect(),
        false_changes,
    }))
}
