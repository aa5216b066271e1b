//! Changes of the surface in the truth, and what was declared of them.

use sample::{Axle, Estimate, Event, EventKind, ForceFrame, LogTime, PerWheel, Wheel};
use serde_json::{Value, json};

use super::{TruthByTime, contact_load_n};

/// Change of an axle's mean friction that is one of the surface, as a part of it.
const CHANGED: f64 = 0.1;
/// Time that both wheels of an axle take onto the other surface, s.
const CROSSING_S: f64 = 0.3;
/// A declaration belongs to a change that came at most so long before, s.
const NEAR_S: f64 = 5.0;
/// A change is detectable if a loaded wheel of the axle uses more than this part of the lower friction
/// ...
const USED: f64 = 0.7;
/// ... for this time, s, before the next change and within [`NEAR_S`].
const USED_MIN_S: f64 = 0.3;
/// A wheel is loaded from this part of its static load on.
const LOADED: f64 = 0.15;

/// A change of the surface under an axle and what the estimator said of it.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceChange {
    /// The axle.
    pub axle: Axle,
    /// When its first wheel crossed, s from the start of the truth.
    pub at_s: f64,
    /// Friction after over friction before.
    pub friction_ratio: f64,
    /// Whether the tyres used enough of the lower friction for the change to show.
    pub detectable: bool,
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

impl SurfaceChanges {
    /// Number of detectable changes that were not declared.
    #[must_use]
    pub fn missed(&self) -> usize {
        let missed =
            |change: &&SurfaceChange| change.detectable && change.declared_after_s.is_none();
        self.changes.iter().filter(missed).count()
    }
}

impl SurfaceChange {
    /// As JSON.
    #[must_use]
    pub fn to_json(&self) -> Value {
        json!({
            "axle": self.axle.name(),
            "at_s": self.at_s,
            "friction_ratio": self.friction_ratio,
            "detectable": self.detectable,
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
    /// Takes the friction of one instant in; tells when a change began, its ratio and the lower
    /// friction, once both wheels are across.
    fn take(&mut self, at_s: f64, friction: f64) -> Option<(f64, f64, f64)> {
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
                return changed.then_some((crossed_s, ratio, friction.min(before)));
            }
            _ => {}
        }
        None
    }
}

/// Finds the changes of surface of a log's truth without its first `from_s` seconds; `None` where
/// the truth does not tell the friction.
pub(super) fn find(
    truth: &TruthByTime,
    friction: &[(LogTime, PerWheel<f64>)],
    start: LogTime,
    from_s: f64,
    loads: &PerWheel<f64>,
    events: &[Event],
) -> Option<SurfaceChanges> {
    let said: Vec<(Axle, f64, f64)> = events
        .iter()
        .filter_map(|event| match event.kind {
            EventKind::SurfaceChange(axle, ratio) => {
                Some((axle, event.time.seconds_since(start), ratio))
            }
            _ => None,
        })
        .collect();
    let mut grounds = [Ground::default(), Ground::default()];
    let mut changes = Vec::new();
    for (time, coefficient) in friction {
        let at_s = time.seconds_since(start);
        for (axle, ground) in Axle::ALL.into_iter().zip(&mut grounds) {
            let [left, right] = axle.wheels().map(|wheel| coefficient[wheel]);
            let change = ground.take(at_s, 0.5 * (left + right));
            changes.extend(change.map(|(at_s, ratio, lower)| Change {
                axle,
                at_s,
                ratio,
                lower,
            }));
        }
    }
    let detectable = detectable(truth, start, loads, &changes);
    let of_it = |said: &(Axle, f64, f64), change: &Change| {
        said.0 == change.axle && (0.0..NEAR_S).contains(&(said.1 - change.at_s))
    };
    let false_changes = said
        .iter()
        .filter(|said| said.1 >= from_s && !changes.iter().any(|change| of_it(said, change)))
        .count();
    let judged = |(change, detectable): (&Change, bool)| {
        let first = said.iter().find(|said| of_it(said, change));
        SurfaceChange {
            axle: change.axle,
            at_s: change.at_s,
            friction_ratio: change.ratio,
            detectable,
            declared_after_s: first.map(|said| said.1 - change.at_s),
            declared_force_ratio: first.map(|said| said.2),
        }
    };
    (!friction.is_empty()).then(|| SurfaceChanges {
        changes: (changes.iter().zip(detectable).map(judged))
            .filter(|change| change.at_s >= from_s)
            .collect(),
        false_changes,
    })
}

/// A change of the surface under an axle.
struct Change {
    axle: Axle,
    at_s: f64,
    /// Friction after over friction before.
    ratio: f64,
    /// The lower of the two.
    lower: f64,
}

/// For each change whether a loaded wheel of the axle used enough of the lower friction.
fn detectable(
    truth: &TruthByTime,
    start: LogTime,
    loads: &PerWheel<f64>,
    changes: &[Change],
) -> Vec<bool> {
    let mut found = vec![false; changes.len()];
    // Since when each wheel of a change's axle has used enough.
    let mut since = vec![[None; 2]; changes.len()];
    let next_s = |change: &Change| {
        let mut later = changes.iter().filter(|other| other.axle == change.axle);
        let next = later.find(|other| other.at_s > change.at_s);
        next.map_or(f64::INFINITY, |next| next.at_s)
    };
    let ends: Vec<f64> = (changes.iter())
        .map(|change| next_s(change).min(change.at_s + NEAR_S))
        .collect();
    if changes.is_empty() {
        return found;
    }
    for truth in truth.values() {
        let at_s = truth.time.seconds_since(start);
        for (i, change) in changes.iter().enumerate() {
            if !(change.at_s..ends[i]).contains(&at_s) {
                continue;
            }
            for (wheel, since) in change.axle.wheels().into_iter().zip(&mut since[i]) {
                let is_loaded = contact_load_n(truth, wheel) > LOADED * loads[wheel];
                if is_loaded && utilisation(truth, wheel) > USED * change.lower {
                    let since_s: f64 = *since.get_or_insert(at_s);
                    found[i] |= at_s - since_s >= USED_MIN_S - 1e-9;
                } else {
                    *since = None;
                }
            }
        }
    }
    found
}

/// Force along the ground over the load, contact frame.
fn utilisation(truth: &Estimate, wheel: Wheel) -> f64 {
    let [x, y, z] = truth.forces(ForceFrame::Contact)[wheel].force_n;
    math::hypot(x, y) / z
}
