//! Units of rates, angles and speeds. A wrong unit makes a reading too large or too small by a factor that no other
//! error has.
//!
//! Over means of half a second, four relations hold roughly, with the yaw rate w of the gyros, the rate h of the heading,
//! the rate c of the course over ground, the speed v of the receiver, the speed u of the wheels and the lateral
//! specific force f:
//!
//! | relation | if the factor s is not 1 |
//! |---|---|
//! | w = s c | unit of the gyros |
//! | h = s c | unit of the attitude |
//! | v = s u | unit of the receiver's velocity or of the wheels; the next relation tells which |
//! | f = s c v, f = s c u | unit of this speed |
//!
//! The factors s are those of least squares. A wrong unit is wrong from the beginning: where some windows agree with
//! s = 1, a sensor is faulty. The units of gyros and attitude are right where w and h agree. The course does not depend
//! on the unit of the velocity. Without a receiver of velocity, f/u takes the place of c.

use std::f64::consts::PI;

use sample::LogTime;

use crate::mistakes::Described;
use crate::tuning::UnitTuning;

/// A signal whose unit can be wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Rates of the gyros.
    Rates,
    /// Heading, roll and pitch of the receiver of attitude.
    Attitude,
    /// Velocity of the receiver.
    Velocity,
    /// Speeds of the wheels.
    WheelSpeeds,
}

/// A signal that is read in a wrong unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrongUnit {
    /// The signal.
    pub quantity: Quantity,
    /// What the drive shows: reading over value.
    pub ratio: f64,
    /// The same by the units.
    pub factor: f64,
    /// The unit of the values, and the unit that they are taken for.
    pub units: [&'static str; 2],
}

impl Quantity {
    /// Units by which its readings can be wrong: factor, unit of the values, unit that they are taken for.
    fn candidates(self) -> &'static [(f64, [&'static str; 2])] {
        match self {
            Self::Rates => &[
                (180.0 / PI, ["deg/s", "rad/s"]),
                (PI / 180.0, ["rad/s", "deg/s"]),
            ],
            Self::Attitude => &[(180.0 / PI, ["deg", "rad"]), (PI / 180.0, ["rad", "deg"])],
            Self::Velocity => &[(3.6, ["km/h", "m/s"]), (1.0 / 3.6, ["m/s", "km/h"])],
            Self::WheelSpeeds => &[
                (3.6, ["km/h", "m/s"]),
                (1.0 / 3.6, ["m/s", "km/h"]),
                (30.0 / PI, ["rpm", "rad/s"]),
                (PI / 30.0, ["rad/s", "rpm"]),
            ],
        }
    }

    /// The unit that a ratio shows, if it is near one.
    fn wrong(self, ratio: f64, nearest: f64) -> Option<WrongUnit> {
        let near = |factor: f64| math::ln(ratio / factor).abs() < nearest;
        let mut all = self.candidates().iter();
        let (factor, units) = all.find(|(factor, _)| near(*factor))?;
        Some(WrongUnit {
            quantity: self,
            ratio,
            factor: *factor,
            units: *units,
        })
    }
}

impl WrongUnit {
    /// In words.
    #[must_use]
    pub fn describe(&self) -> Described {
        let (subject, remedy) = match self.quantity {
            Quantity::Rates => ("gyros: unit", "the roles rate"),
            Quantity::Attitude => ("attitude of GNSS: unit", "the roles yaw, pitch and roll"),
            Quantity::Velocity => ("velocity of GNSS: unit", "the roles velocity"),
            Quantity::WheelSpeeds => ("wheel speeds: unit", "the roles wheel_speed"),
        };
        let (times, size) = if self.factor > 1.0 {
            (self.factor, "large")
        } else {
            (1.0 / self.factor, "small")
        };
        let [unit, taken_for] = self.units;
        Described {
            subject: subject.to_owned(),
            cause: format!(
                "the readings are {times:.1} times too {size}: values in {unit} are taken for {taken_for} (factor {:.3} \
                 against the other sensors)",
                self.ratio
            ),
            remedy: format!("correct the unit of the signals of {remedy}, or of the protocol"),
        }
    }
}

/// Mean of readings.
#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    sum: f64,
    count: u32,
}

impl Mean {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1;
    }

    fn take(&mut self) -> Option<f64> {
        let Self { sum, count } = std::mem::take(self);
        (count > 0).then(|| sum / f64::from(count))
    }
}

/// An angle, and the one at the end of the window before: with their times.
#[derive(Clone, Copy, Debug, Default)]
struct Turning {
    before: Option<(LogTime, f64)>,
    last: Option<(LogTime, f64)>,
}

impl Turning {
    /// Rate of the angle over the window, rad/s; `wrap` brings the difference of the angles into its range.
    fn take(&mut self, wrap: impl Fn(f64) -> Option<f64>) -> Option<f64> {
        let last = self.last.take();
        let before = std::mem::replace(&mut self.before, last)?;
        let (time, angle) = last?;
        let span_s = time.seconds_since(before.0);
        let difference = wrap(angle - before.1)?;
        (span_s > 0.0).then(|| difference / span_s)
    }
}

/// Sums of a relation y = s x.
#[derive(Clone, Copy, Debug, Default)]
struct Relation {
    xx: f64,
    xy: f64,
    yy: f64,
    count: u32,
    /// Windows that agree with s = 1.
    agreeing: u32,
}

impl Relation {
    fn add(&mut self, x: f64, y: f64, t: &UnitTuning) {
        let ratio = y / x;
        let agrees = ratio > 0.0 && math::ln(ratio).abs() < t.roughly;
        self.agreeing += u32::from(agrees);
        self.xx += x * x;
        self.xy += x * y;
        self.yy += y * y;
        self.count += 1;
    }

    /// The factor s, if enough windows agree on it.
    fn factor(&self, t: &UnitTuning) -> Option<f64> {
        let factor = self.xy / self.xx;
        let correlation = self.xy / (self.xx * self.yy).sqrt();
        let is_known = self.count >= t.windows && correlation > t.correlation_min;
        (is_known && factor > 0.0).then_some(factor)
    }

    /// The factor, if it can be that of a wrong unit.
    fn wrong_factor(&self, t: &UnitTuning) -> Option<f64> {
        let may_be_wrong = f64::from(self.agreeing) < t.agreeing_max * f64::from(self.count);
        self.factor(t).filter(|_| may_be_wrong)
    }

    /// Whether the factor is 1, as far as the relation holds.
    fn is_one(&self, t: &UnitTuning) -> bool {
        self.factor(t)
            .is_some_and(|factor| math::ln(factor).abs() < t.roughly)
    }
}

/// Factors by which readings are multiplied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scales {
    pub rates: f64,
    pub attitude: f64,
    pub velocity: f64,
    pub wheel_speeds: f64,
}

/// The search for wrong units.
#[derive(Clone, Debug)]
pub(crate) struct UnitWatch {
    tuning: UnitTuning,
    /// Factors that correct what was found.
    pub scales: Scales,
    /// The first step since the last correction, and the begin of the window.
    begun: Option<LogTime>,
    started: Option<LogTime>,
    rate: Mean,
    lateral: Mean,
    receiver: Mean,
    wheels: Mean,
    heading: Turning,
    course: Turning,
    rates: Relation,
    headings: Relation,
    /// Rate of the heading against that of the gyros.
    turns: Relation,
    speeds: Relation,
    by_receiver: Relation,
    by_wheels: Relation,
}

impl UnitWatch {
    pub(crate) fn new(tuning: &UnitTuning) -> Self {
        Self {
            tuning: *tuning,
            scales: Scales {
                rates: 1.0,
                attitude: 1.0,
                velocity: 1.0,
                wheel_speeds: 1.0,
            },
            begun: None,
            started: None,
            rate: Mean::default(),
            lateral: Mean::default(),
            receiver: Mean::default(),
            wheels: Mean::default(),
            heading: Turning::default(),
            course: Turning::default(),
            rates: Relation::default(),
            headings: Relation::default(),
            turns: Relation::default(),
            speeds: Relation::default(),
            by_receiver: Relation::default(),
            by_wheels: Relation::default(),
        }
    }

    /// Begins again with other factors, or another unit of the accelerometers.
    pub(crate) fn restart(&mut self) {
        *self = Self {
            scales: self.scales,
            ..Self::new(&self.tuning)
        };
    }

    /// Takes yaw rate, rad/s, and lateral specific force, m/s^2.
    pub(crate) fn take_inertial(&mut self, rate_rad_s: f64, lateral_m_s2: f64) {
        self.rate.add(rate_rad_s);
        self.lateral.add(lateral_m_s2);
    }

    /// Takes the velocity of a receiver, east and north, m/s.
    pub(crate) fn take_velocity(&mut self, time: LogTime, east_m_s: f64, north_m_s: f64) {
        let speed_m_s = math::hypot(east_m_s, north_m_s);
        self.receiver.add(speed_m_s);
        if speed_m_s > self.tuning.course_speed_min_m_s {
            self.course.last = Some((time, math::atan2(north_m_s, east_m_s)));
        }
    }

    /// Takes a heading, rad.
    pub(crate) fn take_heading(&mut self, time: LogTime, heading_rad: f64) {
        self.heading.last = Some((time, heading_rad));
    }

    /// Takes the speed of a wheel, m/s.
    pub(crate) fn take_wheel(&mut self, speed_m_s: f64) {
        self.wheels.add(speed_m_s);
    }

    /// Ends a window where one is complete. Returns a unit that is wrong.
    pub(crate) fn step(&mut self, now: LogTime) -> Option<WrongUnit> {
        self.begun.get_or_insert(now);
        let started = *self.started.get_or_insert(now);
        if now.seconds_since(started) < self.tuning.window_s {
            return None;
        }
        self.started = Some(now);
        self.relate();
        self.judge()
    }

    /// Adds the means of a window to the relations.
    fn relate(&mut self) {
        let t = self.tuning;
        let tau = std::f64::consts::TAU;
        let course = self
            .course
            .take(|turn| Some(turn - tau * (turn / tau).round()));
        // Values in degrees wrap elsewhere: then the difference is not used.
        let heading = self
            .heading
            .take(|turn| (turn.abs() < t.turn_max).then_some(turn));
        let (rate, lateral) = (self.rate.take(), self.lateral.take());
        let (receiver, wheels) = (self.receiver.take(), self.wheels.take());
        let by_wheels =
            || Some(lateral? / wheels.filter(|wheels| *wheels > t.course_speed_min_m_s)?);
        // One of both can be too small.
        let fastest = receiver.unwrap_or(0.0).max(wheels.unwrap_or(0.0));
        if fastest < t.speed_min_m_s {
            return;
        }
        if let (Some(receiver), Some(wheels)) = (receiver, wheels) {
            self.speeds.add(wheels, receiver, &t);
        }
        let turning = if receiver.is_some() {
            course
        } else {
            by_wheels()
        };
        let Some(turning) = turning.filter(|turning| turning.abs() > t.turning_min_rad_s) else {
            return;
        };
        if let Some(rate) = rate {
            self.rates.add(turning, rate, &t);
        }
        if let Some(heading) = heading {
            self.headings.add(turning, heading, &t);
        }
        if let (Some(rate), Some(heading)) = (rate, heading) {
            self.turns.add(rate, heading, &t);
        }
        if let (Some(lateral), Some(receiver), Some(wheels)) = (lateral, receiver, wheels) {
            self.by_receiver.add(turning * receiver, lateral, &t);
            self.by_wheels.add(turning * wheels, lateral, &t);
        }
    }

    /// Whether a reading is so far from the others that its unit can be wrong, although this is not certain yet: for
    /// a limited time, because the wheels of a vehicle that is stuck turn, too.
    pub(crate) fn is_doubtful(&self, now: LogTime) -> bool {
        let t = &self.tuning;
        let near = |quantity: Quantity, ratio: f64, limit| quantity.wrong(ratio, limit).is_some();
        let [rates, headings, speeds] =
            [&self.rates, &self.headings, &self.speeds].map(|relation| relation.xy / relation.xx);
        let doubtful = near(Quantity::Rates, rates, t.near[0])
            || near(Quantity::Attitude, headings, t.near[0])
            || near(Quantity::Velocity, speeds, t.near[1])
            || near(Quantity::WheelSpeeds, 1.0 / speeds, t.near[1]);
        doubtful
            && self
                .begun
                .is_some_and(|begun| now.seconds_since(begun) < t.hold_s)
    }

    fn judge(&mut self) -> Option<WrongUnit> {
        let t = self.tuning;
        let angles = [
            (Quantity::Rates, self.rates, self.headings),
            (Quantity::Attitude, self.headings, self.rates),
        ];
        let is_long = self.speeds.count >= t.speed_windows;
        let ratio = self.speeds.wrong_factor(&t).filter(|_| is_long);
        let speeds = [
            (Quantity::Velocity, ratio, self.by_wheels),
            (
                Quantity::WheelSpeeds,
                ratio.map(|ratio| 1.0 / ratio),
                self.by_receiver,
            ),
        ];
        // Both off by the same factor: then it is the course.
        let by_angles = angles.into_iter().find_map(|(quantity, own, other)| {
            let is_long = own.count >= t.alone_windows;
            let is_alone = other.is_one(&t) || other.count < t.windows && is_long;
            own.wrong_factor(&t)
                .filter(|_| is_alone && !self.turns.is_one(&t))
                .and_then(|ratio| quantity.wrong(ratio, t.near[0]))
        });
        let found = by_angles.or_else(|| {
            speeds.into_iter().find_map(|(quantity, ratio, other)| {
                let ratio = ratio.filter(|_| other.is_one(&t))?;
                quantity.wrong(ratio, t.near[1])
            })
        })?;
        let scale = match found.quantity {
            Quantity::Rates => &mut self.scales.rates,
            Quantity::Attitude => &mut self.scales.attitude,
            Quantity::Velocity => &mut self.scales.velocity,
            Quantity::WheelSpeeds => &mut self.scales.wheel_speeds,
        };
        *scale /= found.factor;
        self.restart();
        Some(found)
    }
}
