//! Lifts of the truth, and what was declared of them.

use sample::{Event, EventKind, LogTime, PerWheel, Side, Wheel};
use serde_json::{Value, json};
use store::Reader;

use super::ScoreError;

/// A wheel has left the ground when its load is below this part of its static load, and is back
/// above the second.
const LIFTED: [f64; 2] = [0.02, 0.1];
/// A declaration belongs to a lift if it is this near, s.
const NEAR_S: f64 = 2.0;
/// A warning belongs to a lift that follows within this time, s.
const WARNING_LEAD_MAX_S: f64 = 10.0;

/// A lift of the truth and what the estimator said of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Lift {
    /// `FL`, `FR`, `RL`, `RR`, or of both wheels of a side `left`, `right`.
    pub what: &'static str,
    /// When, s from the start of the truth.
    pub at_s: f64,
    /// How long after it was declared, s.
    pub declared_after_s: Option<f64>,
    /// How long before it was warned of, s.
    pub warned_before_s: Option<f64>,
}

/// Lifts of wheels, or of sides.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lifts {
    /// Those of the truth.
    pub lifts: Vec<Lift>,
    /// Declared ones that the truth does not have.
    pub false_lifts: usize,
    /// Warnings that no lift followed.
    pub false_warnings: usize,
}

impl Lift {
    /// As JSON; `key` is what of the vehicle left the ground.
    #[must_use]
    pub fn to_json(&self, key: &str) -> Value {
        json!({
            key: self.what,
            "at_s": self.at_s,
            "declared_after_s": self.declared_after_s,
            "warned_before_s": self.warned_before_s,
        })
    }
}

/// What the estimator said: of whom and when, s from the start of the truth.
#[derive(Default)]
struct Said {
    lifts: Vec<(&'static str, f64)>,
    warnings: Vec<(&'static str, f64)>,
}

/// Finds the lifts of a log's truth, of wheels and of sides, without the first `from_s` seconds.
pub(super) fn find(
    reader: &Reader,
    start: LogTime,
    from_s: f64,
    loads: &PerWheel<f64>,
    events: &[Event],
) -> Result<[Lifts; 2], ScoreError> {
    let (mut of_wheels, mut of_sides) = (Said::default(), Said::default());
    for event in events {
        let at_s = event.time.seconds_since(start);
        let (said, what) = match event.kind {
            EventKind::Lift(wheel) => (&mut of_wheels.lifts, wheel.abbreviation()),
            EventKind::LiftWarning(wheel, _) => (&mut of_wheels.warnings, wheel.abbreviation()),
            EventKind::TwoWheelLift(side) => (&mut of_sides.lifts, side.name()),
            EventKind::TwoWheelLiftWarning(side, _) => (&mut of_sides.warnings, side.name()),
            _ => continue,
        };
        said.push((what, at_s));
    }
    let (mut wheels, mut sides) = (Vec::new(), Vec::new());
    let mut up = PerWheel([true; 4]);
    let mut side_up = [true; 2];
    for truth in reader.truth() {
        let truth = truth?;
        let at_s = truth.time.seconds_since(start);
        let part = PerWheel::from_fn(|wheel| truth.measured[wheel].force_n[2] / loads[wheel]);
        for wheel in Wheel::ALL {
            if begins(&mut up[wheel], part[wheel]) {
                wheels.push((wheel.abbreviation(), at_s));
            }
        }
        for side in Side::ALL {
            let [front, rear] = side.wheels().map(|wheel| part[wheel]);
            if begins(&mut side_up[side.index()], front.max(rear)) {
                sides.push((side.name(), at_s));
            }
        }
    }
    Ok([
        judged(&wheels, &of_wheels, from_s),
        judged(&sides, &of_sides, from_s),
    ])
}

/// Whether a lift begins, with hysteresis. What begins in the air does not count.
fn begins(up: &mut bool, part: f64) -> bool {
    if *up {
        *up = part < LIFTED[1];
        false
    } else {
        *up = part < LIFTED[0];
        *up
    }
}

fn judged(true_lifts: &[(&'static str, f64)], said: &Said, from_s: f64) -> Lifts {
    let lift = |(i, (what, at_s)): (usize, &(&'static str, f64))| {
        let mut earlier = true_lifts[..i].iter().rev();
        let earlier_s = earlier.find(|(other, _)| other == what);
        let since_s = earlier_s.map_or(f64::NEG_INFINITY, |(_, earlier_s)| *earlier_s);
        let after_s = |list: &[(&'static str, f64)]| -> Vec<f64> {
            let mine = list.iter().filter(|(other, _)| other == what);
            mine.map(|(_, said_s)| said_s - at_s).collect()
        };
        Lift {
            what,
            at_s: *at_s,
            declared_after_s: after_s(&said.lifts)
                .into_iter()
                .find(|after_s| after_s.abs() < NEAR_S),
            // A warning is of the next lift.
            warned_before_s: after_s(&said.warnings)
                .into_iter()
                .map(|after_s| -after_s)
                .filter(|before_s| at_s - before_s > since_s)
                .find(|before_s| (0.0..WARNING_LEAD_MAX_S).contains(before_s)),
        }
    };
    let without = |said: &[(&'static str, f64)], most_s: f64| {
        let has_none = |(what, said_s): &&(&'static str, f64)| {
            let of_it = |(other, at_s): &(&'static str, f64)| {
                other == what && (-NEAR_S..=most_s).contains(&(at_s - said_s))
            };
            *said_s >= from_s && !true_lifts.iter().any(of_it)
        };
        said.iter().filter(has_none).count()
    };
    Lifts {
        lifts: (true_lifts.iter().enumerate().map(lift))
            .filter(|lift| lift.at_s >= from_s)
            .collect(),
        false_lifts: without(&said.lifts, NEAR_S),
        false_warnings: without(&said.warnings, WARNING_LEAD_MAX_S),
    }
}
