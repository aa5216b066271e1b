//! Changes of the surface in the truth, and what was declared of them.

use std::collections::VecDeque;

use sample::{Axle, Estimate, Event, EventKind, ForceFrame, LogTime, PerWheel, Wheel};
use serde_json::{Value, json};

use super::contact_load_n;

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

/// The changes of the surface in the truth so far.
#[derive(Default)]
pub(super) struct Surfaces {
    /// Friction coefficients that the truth of motion has not reached.
    friction: VecDeque<(LogTime, PerWheel<f64>)>,
    is_known: bool,
    grounds: [Ground; 2],
    changes: Vec<Change>,
    /// The last instants of the truth.
    recent: VecDeque<Instant>,
}

/// An instant of the truth.
struct Instant {
    at_s: f64,
    is_loaded: PerWheel<bool>,
    utilisation: PerWheel<f64>,
}

/// How long an instant is kept, s: longer than a change can become known after its begin, and than
/// [`NEAR_S`].
const KEPT_S: f64 = 2.0 * NEAR_S;

impl Surfaces {
    /// Takes the friction coefficients of an instant.
    pub fn push_friction(&mut self, time: LogTime, coefficient: PerWheel<f64>) {
        self.is_known = true;
        self.friction.push_back((time, coefficient));
    }

    /// Takes the next instant of the truth.
    pub fn push(&mut self, truth: &Estimate, start: LogTime, loads: &PerWheel<f64>) {
        if !self.is_known {
            return;
        }
        let at_s = truth.time.seconds_since(start);
        self.recent.push_back(Instant {
            at_s,
            is_loaded: PerWheel::from_fn(|wheel| {
                contact_load_n(truth, wheel) > LOADED * loads[wheel]
            }),
            utilisation: PerWheel::from_fn(|wheel| utilisation(truth, wheel)),
        });
        self.find_changes(start);
        self.judge_changes(at_s - 1.5 * NEAR_S);
        while self
            .recent
            .front()
            .is_some_and(|old| old.at_s < at_s - KEPT_S)
        {
            self.recent.pop_front();
        }
    }

    /// Finds the changes in the friction that was read.
    fn find_changes(&mut self, start: LogTime) {
        for (time, coefficient) in self.friction.drain(..) {
            let at_s = time.seconds_since(start);
            for (axle, ground) in Axle::ALL.into_iter().zip(&mut self.grounds) {
                let [left, right] = axle.wheels().map(|wheel| coefficient[wheel]);
                let change = ground.take(at_s, 0.5 * (left + right));
                self.changes
                    .extend(change.map(|(at_s, ratio, lower)| Change {
                        axle,
                        at_s,
                        ratio,
                        lower,
                        detectable: None,
                    }));
            }
        }
    }

    /// Judges the changes before `until_s`, after which the next change of the axle is known.
    fn judge_changes(&mut self, until_s: f64) {
        for place in 0..self.changes.len() {
            let change = &self.changes[place];
            if change.detectable.is_some() || change.at_s > until_s {
                continue;
            }
            let mut later = self.changes[place + 1..].iter();
            let next = later.find(|other| other.axle == change.axle);
            let next_s = next.map_or(f64::INFINITY, |next| next.at_s);
            let end_s = next_s.min(change.at_s + NEAR_S);
            self.changes[place].detectable = Some(self.is_detectable(change, end_s));
        }
    }

    /// Whether a loaded wheel of the axle used enough of the lower friction before `end_s`.
    fn is_detectable(&self, change: &Change, end_s: f64) -> bool {
        change.axle.wheels().into_iter().any(|wheel| {
            let mut since_s = None;
            let mut within = self.recent.iter();
            within.any(|truth| {
                if !(change.at_s..end_s).contains(&truth.at_s) {
                    return false;
                }
                if truth.is_loaded[wheel] && truth.utilisation[wheel] > USED * change.lower {
                    let since_s: f64 = *since_s.get_or_insert(truth.at_s);
                    truth.at_s - since_s >= USED_MIN_S - 1e-9
                } else {
                    since_s = None;
                    false
                }
            })
        })
    }

    /// Compares the changes with the events, without the first `from_s` seconds; `None` where the truth
    /// does not tell the friction.
    pub fn finish(
        mut self,
        start: LogTime,
        from_s: f64,
        events: &[Event],
    ) -> Option<SurfaceChanges> {
        self.find_changes(start);
        self.judge_changes(f64::INFINITY);
        let told: Vec<(Axle, f64, f64)> = events
            .iter()
            .filter_map(|event| match event.kind {
                EventKind::SurfaceChange(axle, ratio) => {
                    Some((axle, event.time.seconds_since(start), ratio))
                }
                _ => None,
            })
            .collect();
        let changes = &self.changes;
        let of_it = |told: &(Axle, f64, f64), change: &Change| {
            told.0 == change.axle && (0.0..NEAR_S).contains(&(told.1 - change.at_s))
        };
        let false_changes = told
            .iter()
            .filter(|told| told.1 >= from_s && !changes.iter().any(|change| of_it(told, change)))
            .count();
        let judged = |change: &Change| {
            let first = told.iter().find(|told| of_it(told, change));
            SurfaceChange {
                axle: change.axle,
                at_s: change.at_s,
                friction_ratio: change.ratio,
                detectable: change.detectable.unwrap_or(false),
                declared_after_s: first.map(|told| told.1 - change.at_s),
                declared_force_ratio: first.map(|told| told.2),
            }
        };
        self.is_known.then(|| SurfaceChanges {
            changes: (changes.iter().map(judged))
                .filter(|change| change.at_s >= from_s)
                .collect(),
            false_changes,
        })
    }
}

/// A change of the surface under an axle.
struct Change {
    axle: Axle,
    at_s: f64,
    /// Friction after over friction before.
    ratio: f64,
    /// The lower of the two.
    lower: f64,
    /// Whether the tyres used enough of it, once that is known.
    detectable: Option<bool>,
}

/// Force along the ground over the load, contact frame.
fn utilisation(truth: &Estimate, wheel: Wheel) -> f64 {
    let [x, y, z] = truth.forces(ForceFrame::Contact)[wheel].force_n;
    math::hypot(x, y) / z
}
