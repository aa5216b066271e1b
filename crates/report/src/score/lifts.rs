//! Lifts of the truth, and what was declared of them.

use sample::{Estimate, Event, EventKind, LogTime, PerWheel, Side, Wheel};
use serde_json::{Value, json};

use super::contact_load_n;
use super::flights::{Flight, Flights};

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
/// A warning is due before a lift whose load fell for at least this time, s ...
const FALL_MIN_S: f64 = 0.3;
/// ... this part of that time before the lift, ...
const DUE_PART: f64 = 0.7;
/// ... but no more than this time, s.
const DUE_MAX_S: f64 = 1.0;

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
    /// How long the load took from a quarter of the static load to the lift, s; `None`: the load did not
    /// reach a quarter since the lift before.
    pub fall_s: Option<f64>,
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
    /// Times off the ground in the truth, of any length.
    pub off_ground: OffGround,
}

/// Times off the ground in the truth, lifts and shorter ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OffGround {
    /// Their number.
    pub count: usize,
    /// Their number for each kilometre; `None`: the truth has no speed.
    pub per_km: Option<f64>,
    /// Share of the time, mean of all wheels or sides.
    pub share_of_time: f64,
}

/// How many lifts were warned of in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WarningLeads {
    /// Lifts before which a warning is due.
    pub due: usize,
    /// Those of them with a warning in time.
    pub in_time: usize,
    /// Those with a late warning.
    pub late: usize,
    /// Those without a warning.
    pub missed: usize,
    /// Lifts whose load falls too quickly for a warning.
    pub not_due: usize,
}

impl Lifts {
    /// How many were warned of in time.
    #[must_use]
    pub fn warning_leads(&self) -> WarningLeads {
        let mut leads = WarningLeads::default();
        for lift in &self.lifts {
            let Some(due_s) = lift.warning_due_s() else {
                leads.not_due += 1;
                continue;
            };
            leads.due += 1;
            match lift.warned_before_s {
                Some(lead_s) if lead_s >= due_s - 1e-9 => leads.in_time += 1,
                Some(_) => leads.late += 1,
                None => leads.missed += 1,
            }
        }
        leads
    }

    /// Number of lifts of the truth that were not declared.
    #[must_use]
    pub fn missed(&self) -> usize {
        let missed = |lift: &&Lift| lift.declared_after_s.is_none();
        self.lifts.iter().filter(missed).count()
    }
}

impl OffGround {
    /// As JSON.
    #[must_use]
    pub fn to_json(self) -> Value {
        json!({
            "count": self.count,
            "per_km": self.per_km,
            "share_of_time": self.share_of_time,
        })
    }
}

impl WarningLeads {
    /// As JSON.
    #[must_use]
    pub fn to_json(self) -> Value {
        json!({
            "due": self.due,
            "in_time": self.in_time,
            "late": self.late,
            "missed": self.missed,
            "not_due": self.not_due,
        })
    }
}

impl Lift {
    /// How long before the lift a warning is due, s; `None`: no warning is due.
    #[must_use]
    pub fn warning_due_s(&self) -> Option<f64> {
        let fall_s = self.fall_s.filter(|fall_s| *fall_s >= FALL_MIN_S - 1e-9)?;
        Some((DUE_PART * fall_s).min(DUE_MAX_S))
    }

    /// As JSON; `key` is what of the vehicle left the ground.
    #[must_use]
    pub fn to_json(&self, key: &str) -> Value {
        json!({
            key: self.what,
            "at_s": self.at_s,
            "duration_s": self.duration_s,
            "declared_after_s": self.declared_after_s,
            "warned_before_s": self.warned_before_s,
            "fall_s": self.fall_s,
            "warning_due_s": self.warning_due_s(),
        })
    }
}

/// What the truth and the estimator say of one wheel or side; times in s from the start of the truth.
struct Course {
    what: &'static str,
    /// Lifts of the truth.
    lifts: Vec<Flight>,
    flights: Flights,
    /// All times off the ground, lifts or shorter.
    count: usize,
    /// Their sum, s.
    in_air_s: f64,
    /// Loads up to [`LIGHT`] as a part of the static load; of a side, that of its more loaded wheel.
    light: Vec<(f64, f64)>,
    /// Declared lifts, each until the touchdown that was declared after it.
    declared: Vec<[f64; 2]>,
    warnings: Vec<f64>,
}

impl Course {
    fn new(what: &'static str) -> Self {
        Self {
            what,
            lifts: Vec::new(),
            flights: Flights::default(),
            count: 0,
            in_air_s: 0.0,
            light: Vec::new(),
            declared: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// Takes the next load of the truth.
    fn push(&mut self, at_s: f64, part: f64) {
        if part <= LIGHT {
            self.light.push((at_s, part));
        }
        if let Some(flight) = self.flights.push(at_s, part) {
            self.end_flight(flight);
        }
    }

    fn end_flight(&mut self, flight: Flight) {
        self.count += 1;
        self.in_air_s += flight.end_s - flight.begin_s;
        if flight.is_lift() {
            self.lifts.push(flight);
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
        if let Some(flight) = self.flights.finish() {
            self.end_flight(flight);
        }
        let mut earlier_s = f64::NEG_INFINITY;
        for flight in &self.lifts {
            let (at_s, end_s) = (flight.begin_s, flight.end_s);
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
                    fall_s: flight.fall_s,
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
    ride: Ride,
}

/// Duration and length of the drive by the truth.
#[derive(Clone, Copy, Default)]
struct Ride {
    last_s: f64,
    /// Of the instants with a speed.
    distance_m: f64,
}

impl Ride {
    fn push(&mut self, at_s: f64, speed_m_s: f64) {
        let length_m = speed_m_s.abs() * (at_s - self.last_s).max(0.0);
        if length_m.is_finite() {
            self.distance_m += length_m;
        }
        self.last_s = at_s;
    }

    fn off_ground(&self, courses: &[Course]) -> OffGround {
        let count = courses.iter().map(|course| course.count).sum();
        let in_air_s: f64 = courses.iter().map(|course| course.in_air_s).sum();
        let time_s = self.last_s.max(f64::MIN_POSITIVE) * courses.len() as f64;
        OffGround {
            count,
            per_km: (self.distance_m > 0.0).then(|| 1e3 * count as f64 / self.distance_m),
            share_of_time: in_air_s / time_s,
        }
    }
}

impl Default for Courses {
    fn default() -> Self {
        Self {
            wheels: Wheel::ALL.map(|wheel| Course::new(wheel.abbreviation())),
            sides: Side::ALL.map(|side| Course::new(side.name())),
            ride: Ride::default(),
        }
    }
}

impl Courses {
    /// Takes the next instant of the truth.
    pub fn push(&mut self, truth: &Estimate, start: LogTime, loads: &PerWheel<f64>) {
        let at_s = truth.time.seconds_since(start);
        self.ride.push(at_s, truth.motion.velocity_x_m_s);
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
        [
            judged(wheels, from_s, &self.ride),
            judged(sides, from_s, &self.ride),
        ]
    }
}

fn judged(courses: &mut [Course], from_s: f64, ride: &Ride) -> Lifts {
    let mut all = Lifts::default();
    for course in &mut *courses {
        course.judge(from_s, &mut all);
    }
    all.lifts.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    all.off_ground = ride.off_ground(courses);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    const RIDE: Ride = Ride {
        last_s: 20.0,
        distance_m: 50.0,
    };

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
        let found = judged(&mut [wheel], 2.0, &RIDE);
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
        let found = judged(&mut [wheel], 2.0, &RIDE);
        assert_eq!((found.declared, found.false_lifts), (4, 2));
        assert_eq!((found.warnings, found.false_warnings), (3, 1));
    }

    #[test]
    fn a_slow_fall_is_due_a_warning_and_a_quick_one_is_not() {
        let mut wheel = Course::new("FL");
        // Parts of the static load: from 1 to 0 in 2 s, and in 0.4 s; between both lifts, the load does not
        // return to a quarter once.
        let knots = [
            (0.0, 1.0),
            (3.0, 1.0),
            (5.0, 0.0),
            (5.5, 0.0),
            (5.6, 0.1),
            (5.8, 0.0),
            (6.0, 0.0),
            (7.0, 1.0),
            (10.0, 1.0),
            (10.4, 0.0),
            (10.8, 0.0),
            (10.9, 1.0),
            (20.0, 1.0),
        ];
        for k in 0..=2000 {
            let at_s = f64::from(k) * 0.01;
            let after = knots.partition_point(|knot| knot.0 < at_s).max(1);
            let ((t0, p0), (t1, p1)) = (knots[after - 1], knots[after]);
            wheel.push(at_s, p0 + (p1 - p0) * (at_s - t0) / (t1 - t0));
        }
        let judge = |warnings: &[f64]| {
            let mut wheel = Course {
                warnings: warnings.to_vec(),
                lifts: wheel.lifts.clone(),
                count: wheel.count,
                in_air_s: wheel.in_air_s,
                ..Course::new("FL")
            };
            judged(std::slice::from_mut(&mut wheel), 2.0, &RIDE)
        };
        let found = judge(&[]);
        let falls: Vec<_> = found.lifts.iter().map(|lift| lift.fall_s).collect();
        let [Some(slow_s), None, Some(quick_s)] = falls[..] else {
            panic!("{falls:?}");
        };
        // From 25 to 2 % of the static load, at 50 and 250 % a second, to a step of the truth.
        assert!((slow_s - 0.46).abs() < 0.021, "{slow_s}");
        assert!((quick_s - 0.092).abs() < 0.021, "{quick_s}");
        let leads = found.warning_leads();
        assert_eq!((leads.due, leads.missed, leads.not_due), (1, 1, 2));
        let lead_s = found.lifts[0].at_s - DUE_PART * slow_s;
        let leads = judge(&[lead_s]).warning_leads();
        assert_eq!((leads.in_time, leads.late, leads.missed), (1, 0, 0));
        let leads = judge(&[lead_s + 0.02]).warning_leads();
        assert_eq!((leads.in_time, leads.late, leads.missed), (0, 1, 0));
        // Three times off the ground in 20 s and 50 m.
        assert_eq!(found.off_ground.count, 3);
        assert_eq!(found.off_ground.per_km, Some(60.0));
        let air_s = found.off_ground.share_of_time * RIDE.last_s;
        assert!((air_s - 1.21).abs() < 0.05, "{air_s}");
    }
}
