//! Lifts of the truth, and what was declared of them.

use sample::{EventKind, LogTime, PerWheel, Wheel};
use serde_json::{Value, json};
use store::{Reader, Record, Selection};

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

/// All lifts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lifts {
    /// Of wheels.
    pub wheels: Vec<Lift>,
    /// Of both wheels of a side.
    pub sides: Vec<Lift>,
    /// Declared lifts of wheels without one.
    pub false_wheels: usize,
    /// Declared lifts of sides without one.
    pub false_sides: usize,
    /// Warnings that no lift followed.
    pub false_warnings: usize,
}

impl Lift {
    /// As JSON.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let (key, what) = match self.what {
            "left" | "right" => ("side", self.what),
            wheel => ("wheel", wheel),
        };
        json!({
            key: what,
            "at_s": self.at_s,
            "declared_after_s": self.declared_after_s,
            "warned_before_s": self.warned_before_s,
        })
    }
}

/// Declarations: of whom and when.
#[derive(Default)]
struct Declared {
    lifts: Vec<(&'static str, f64)>,
    warnings: Vec<(&'static str, f64)>,
    sides: Vec<(&'static str, f64)>,
}

/// Finds the lifts of a log's truth.
pub(super) fn find(
    reader: &Reader,
    start: LogTime,
    loads: &PerWheel<f64>,
) -> Result<Lifts, ScoreError> {
    let mut declared = Declared::default();
    for message in reader.messages(Selection::topics(["/estimate/events"])) {
        if let Some(Record::Event(event)) = message?.record()? {
            let at_s = event.time.seconds_since(start);
            match event.kind {
                EventKind::Lift(wheel) => declared.lifts.push((wheel.abbreviation(), at_s)),
                EventKind::LiftWarning(wheel, _) => {
                    declared.warnings.push((wheel.abbreviation(), at_s));
                }
                EventKind::TwoWheelLift(left) => declared.sides.push((side_name(left), at_s)),
                _ => {}
            }
        }
    }
    let mut found = Lifts::default();
    let mut up = PerWheel([true; 4]);
    let mut side_up = [true; 2];
    for truth in reader.truth() {
        let truth = truth?;
        let at_s = truth.time.seconds_since(start);
        let part = PerWheel::from_fn(|wheel| truth.measured[wheel].force_n[2] / loads[wheel]);
        for wheel in Wheel::ALL {
            if begins(&mut up[wheel], part[wheel]) {
                let (lifts, warnings) = (&declared.lifts, &declared.warnings);
                let name = wheel.abbreviation();
                let earlier = found.wheels.iter().rev().find(|lift| lift.what == name);
                let since_s = earlier.map_or(f64::NEG_INFINITY, |lift| lift.at_s);
                // A warning is of the next lift.
                let warnings: Vec<_> = warnings
                    .iter()
                    .filter(|(_, warned_s)| *warned_s > since_s)
                    .copied()
                    .collect();
                let lift = lift(name, at_s, lifts, &warnings);
                found.wheels.push(lift);
            }
        }
        for (side, wheels) in [[0, 2], [1, 3]].into_iter().enumerate() {
            let heavier = part.0[wheels[0]].max(part.0[wheels[1]]);
            if begins(&mut side_up[side], heavier) {
                let lift = lift(side_name(side == 0), at_s, &declared.sides, &[]);
                found.sides.push(lift);
            }
        }
    }
    found.false_wheels = without(&declared.lifts, &found.wheels, -NEAR_S, NEAR_S);
    found.false_sides = without(&declared.sides, &found.sides, -NEAR_S, NEAR_S);
    found.false_warnings = without(
        &declared.warnings,
        &found.wheels,
        -NEAR_S,
        WARNING_LEAD_MAX_S,
    );
    Ok(found)
}

fn side_name(left: bool) -> &'static str {
    if left { "left" } else { "right" }
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

/// How many declarations have no lift of theirs from `least` to `most` seconds later.
fn without(declared: &[(&'static str, f64)], lifts: &[Lift], least: f64, most: f64) -> usize {
    let has_none = |(what, at_s): &&(&'static str, f64)| {
        !lifts
            .iter()
            .any(|lift| lift.what == *what && (least..=most).contains(&(lift.at_s - at_s)))
    };
    declared.iter().filter(has_none).count()
}

fn lift(
    what: &'static str,
    at_s: f64,
    declared: &[(&'static str, f64)],
    warned: &[(&'static str, f64)],
) -> Lift {
    let of_it = |list: &[(&'static str, f64)]| -> Vec<f64> {
        let mine = list.iter().filter(|(other, _)| *other == what);
        mine.map(|(_, time_s)| time_s - at_s).collect()
    };
    Lift {
        what,
        at_s,
        declared_after_s: of_it(declared)
            .into_iter()
            .find(|after_s| after_s.abs() < NEAR_S),
        warned_before_s: of_it(warned)
            .into_iter()
            .map(|after_s| -after_s)
            .find(|before_s| (0.0..WARNING_LEAD_MAX_S).contains(before_s)),
    }
}
