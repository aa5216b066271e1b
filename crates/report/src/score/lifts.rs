//! Lifts of the truth, and what was declared of them.

use sample::{Estimate, Event, EventKind, LogTime, PerWheel, Side, Wheel};
use serde_json::{Value, json};

use super::contact_load_n;

/// A wheel is off the ground while the load in the contact frame is below this part of its static load.
const LIFTED: f64 = 0.02;
/// A wheel is off the ground for at least this time, s.
const LIFT_MIN_S: f64 = 0.1;
/// A declared lift is false if the load does not fall below this part of the static load ...
const NEARLY_LIFTED: f64 = 0.1;
/// ... within this time of the declaration, s. A lift is missed if it is not declared within this time
/// of its beginning and end.
const NEAR_S: f64 = 0.1;
/// A warning is false if the load stays above this part of the static load ...
const LIGHT: f64 = 0.15;
/// ... for this time after the warning, s.
const WARNING_S: f64 = 2.0;
/// A warning belongs to a lift that follows within this time, s.
const WARNING_LEAD_MAX_S: f64 = 10.0;

/// A lift of the truth and what the estimator said of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Lift {
    /// `FL`, `FR`, `RL`, `RR`, or of both wheels of a side `left`, `right`.
    pub what: &'static str,
    /// When, s from the start of the truth.
    pub at_s: f64,
    /// How long, s.
    pub duration_s: f64,
    /// How long after it was declared, s; `None`: it was missed.
    pub declared_after_s: Option<f64>,
    /// How long before it was warned of, s.
    pub warned_before_s: Option<f64>,
}

/// Lifts of wheels, or of sides.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lifts {
    /// Those of the truth.
    pub lifts: Vec<Lift>,
    /// Number of declared ones.
    pub declared: usize,
    /// Declared ones that the truth does not have.
    pub false_lifts: usize,
    /// Number of warnings.
    pub warnings: usize,
    /// Warnings without a wheel that became light.
    pub false_warnings: usize,
}

impl Lifts {
    /// Number of lifts of the truth that were not declared.
    #[must_use]
    pub fn missed(&self) -> usize {
        let missed = |lift: &&Lift| lift.declared_after_s.is_none();
        self.lifts.iter().filter(missed).count()
    }
}

impl Lift {
    /// As JSON; `key` is what of the vehicle left the ground.
    #[must_use]
    pub fn to_json(&self, key: &str) -> Value {
        json!({
            key: self.what,
            "at_s": self.at_s,
            "duration_s": self.duration_s,
            "declared_after_s": self.declared_after_s,
            "warned_before_s": self.warned_before_s,
        })
    }
}

/// What the truth and the estimator say of one wheel or side; times in s from the start of the truth.
struct Course {
    what: &'static str,
    /// Begin and end of each lift of the truth.
    lifts: Vec<[f64; 2]>,
    /// Whether the wheel was on the ground since the start. What begins in the air does not count.
    was_down: bool,
    /// Since when it is off the ground.
    up_since_s: Option<f64>,
    /// Time of the last load.
    last_s: f64,
    /// Loads up to [`LIGHT`] as a part of the static load; of a side, that of its more loaded wheel.
    light: Vec<(f64, f64)>,
    /// Declared lifts, each until the touchdown that was declared after it.
    declared: Vec<[f64; 2]>,
    warnings: Vec<f64>,
}

impl Course {
    const fn new(what: &'static str) -> Self {
        Self {
            what,
            lifts: Vec::new(),
            was_down: false,
            up_since_s: None,
            last_s: 0.0,
            light: Vec::new(),
            declared: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// Takes the next load of the truth.
    fn push(&mut self, at_s: f64, part: f64) {
        self.last_s = at_s;
        if part.is_nan() {
            return;
        }
        if part <= LIGHT {
            self.light.push((at_s, part));
        }
        if part >= LIFTED {
            self.was_down = true;
            self.end_lift(at_s);
        } else if self.was_down {
            self.up_since_s.get_or_insert(at_s);
        }
    }

    fn end_lift(&mut self, at_s: f64) {
        if let Some(since_s) = self.up_since_s.take()
            && at_s - since_s >= LIFT_MIN_S - 1e-9
        {
            self.lifts.push([since_s, at_s]);
        }
    }

    fn lift(&mut self, at_s: f64) {
        self.touch_down(at_s);
        self.declared.push([at_s, f64::INFINITY]);
    }

    fn touch_down(&mut self, at_s: f64) {
        if let Some([_, end_s]) = self.declared.last_mut() {
            *end_s = end_s.min(at_s);
        }
    }

    /// Least load between two times; infinite if it is above [`LIGHT`].
    fn least(&self, from_s: f64, to_s: f64) -> f64 {
        let first = self.light.partition_point(|load| load.0 < from_s - 1e-9);
        let within = self.light[first..]
            .iter()
            .take_while(|load| load.0 <= to_s + 1e-9);
        within.map(|load| load.1).fold(f64::INFINITY, f64::min)
    }

    fn judge(&mut self, from_s: f64, all: &mut Lifts) {
        self.end_lift(self.last_s);
        let mut earlier_s = f64::NEG_INFINITY;
        for &[at_s, end_s] in &self.lifts {
            let mut declared = self.declared.iter();
            let found =
                declared.find(|[up_s, down_s]| *up_s <= end_s + NEAR_S && *down_s >= at_s - NEAR_S);
            // A warning is of the next lift.
            let mut warnings = self.warnings.iter().map(|warned_s| at_s - warned_s);
            let lead_s = warnings.find(|lead_s| {
                at_s - lead_s > earlier_s && (0.0..WARNING_LEAD_MAX_S).contains(lead_s)
            });
            earlier_s = at_s;
            if at_s >= from_s {
                all.lifts.push(Lift {
                    what: self.what,
                    at_s,
                    duration_s: end_s - at_s,
                    declared_after_s: found.map(|[up_s, _]| up_s - at_s),
                    warned_before_s: lead_s,
                });
            }
        }
        for [at_s, _] in self.declared.iter().filter(|lift| lift[0] >= from_s) {
            all.declared += 1;
            let least = self.least(at_s - NEAR_S, at_s + NEAR_S);
            all.false_lifts += usize::from(least >= NEARLY_LIFTED);
        }
        for at_s in self.warnings.iter().filter(|at_s| **at_s >= from_s) {
            all.warnings += 1;
            let least = self.least(*at_s, at_s + WARNING_S);
            all.false_warnings += usize::from(least > LIGHT);
        }
    }
}

/// What the truth says of the lifts of wheels and of sides.
pub(super) struct Courses {
    wheels: [Course; 4],
    sides: [Course; 2],
}

impl Default for Courses {
    fn default() -> Self {
        Self {
            wheels: Wheel::ALL.map(|wheel| Course::new(wheel.abbreviation())),
            sides: Side::ALL.map(|side| Course::new(side.name())),
        }
    }
}

impl Courses {
    /// Takes the next instant of the truth.
    pub fn push(&mut self, truth: &Estimate, start: LogTime, loads: &PerWheel<f64>) {
        let at_s = truth.time.seconds_since(start);
        let part = PerWheel::from_fn(|wheel| contact_load_n(truth, wheel) / loads[wheel]);
        for wheel in Wheel::ALL {
            self.wheels[wheel.index()].push(at_s, part[wheel]);
        }
        for side in Side::ALL {
            let [front, rear] = side.wheels().map(|wheel| part[wheel]);
            self.sides[side.index()].push(at_s, front.max(rear));
        }
    }

    /// Compares the lifts of wheels and of sides with the events, without the first `from_s` seconds.
    pub fn finish(mut self, start: LogTime, from_s: f64, events: &[Event]) -> [Lifts; 2] {
        let (wheels, sides) = (&mut self.wheels, &mut self.sides);
        for event in events {
            let at_s = event.time.seconds_since(start);
            match event.kind {
                EventKind::Lift(wheel) => wheels[wheel.index()].lift(at_s),
                EventKind::Touchdown(wheel) => {
                    wheels[wheel.index()].touch_down(at_s);
                    let of_wheel = Side::ALL
                        .into_iter()
                        .filter(|side| side.wheels().contains(&wheel));
                    of_wheel.for_each(|side| sides[side.index()].touch_down(at_s));
                }
                EventKind::LiftWarning(wheel, _) => wheels[wheel.index()].warnings.push(at_s),
                EventKind::TwoWheelLift(side) => sides[side.index()].lift(at_s),
                EventKind::TwoWheelLiftWarning(side, _) => sides[side.index()].warnings.push(at_s),
                _ => {}
            }
        }
        [judged(wheels, from_s), judged(sides, from_s)]
    }
}

fn judged(courses: &mut [Course], from_s: f64) -> Lifts {
    let mut all = Lifts::default();
    for course in courses {
        course.judge(from_s, &mut all);
    }
    all.lifts.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A load that is `part` in each of the intervals and 1 elsewhere, for 20 s.
    fn course(light: &[(f64, f64, f64)]) -> Course {
        let mut course = Course::new("FL");
        for k in 0..2000 {
            let at_s = f64::from(k) * 0.01;
            let within = |(from_s, to_s, _): &&(f64, f64, f64)| (*from_s..*to_s).contains(&at_s);
            course.push(at_s, light.iter().find(within).map_or(1.0, |light| light.2));
        }
        course
    }

    #[test]
    fn a_lift_lasts_a_tenth_of_a_second_and_is_found_or_missed() {
        let mut wheel = course(&[
            (0.0, 1.0, 0.0),
            (4.0, 4.105, 0.0),
            (6.0, 6.05, 0.0),
            (8.0, 9.0, 0.01),
        ]);
        wheel.lift(7.0);
        wheel.touch_down(8.5);
        let found = judged(&mut [wheel], 2.0);
        let lifts: Vec<_> = (found.lifts.iter())
            .map(|lift| (lift.at_s, lift.declared_after_s))
            .collect();
        // That of the start does not count, and that of 50 ms is none.
        assert_eq!(lifts, [(4.0, None), (8.0, Some(-1.0))]);
        assert_eq!((found.missed(), found.declared), (1, 1));
        // A second before, the wheel carried its load.
        assert_eq!(found.false_lifts, 1);
    }

    #[test]
    fn a_declared_lift_of_a_light_wheel_is_not_false() {
        let mut wheel = course(&[(5.0, 5.02, 0.09), (10.0, 10.02, 0.14)]);
        for at_s in [4.91, 5.1, 5.2, 10.0] {
            wheel.lift(at_s);
        }
        wheel.warnings = vec![3.5, 5.5, 8.5];
        let found = judged(&mut [wheel], 2.0);
        assert_eq!((found.declared, found.false_lifts), (4, 2));
        assert_eq!((found.warnings, found.false_warnings), (3, 1));
    }
}
