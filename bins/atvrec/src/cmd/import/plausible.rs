//! Units of a drive that cannot be right: quantities are compared that depend on each other.

use sample::{LogTime, Measurement, STANDARD_GRAVITY_M_S2};
use wire::geodesy::Geodetic;

/// Oldest value that is compared with a newer one of another channel, s.
const AGE_MAX_S: f64 = 0.3;
/// Fewest values of a comparison.
const COUNT_MIN: usize = 50;
/// Smallest correlation of lateral acceleration with speed times yaw rate, so that they are compared.
/// An inertial unit that is mounted otherwise has a lower one.
const CORRELATION_MIN: f64 = 0.7;
/// Ratios within this factor of 1 are plausible. Roll adds gravity to a lateral acceleration.
const PLAUSIBLE: f64 = 1.45;
/// A ratio within this factor of that of a pair of units is due to the units.
const RECOGNISED: f64 = 1.2;
/// Speed below which a vehicle stands, and from which it drives, m/s.
const STANDING_M_S: f64 = 0.2;
const DRIVING_M_S: f64 = 3.0;
/// Shortest interval of positions and shortest distance that are compared with the speed, s and m.
const INTERVAL_S: f64 = 1.0;
const DISTANCE_M: f64 = 20.0;
/// Specific force at rest, as a part of gravity, below which gravity was subtracted.
const WITHOUT_GRAVITY: f64 = 0.05;
/// Rolling radius of a wheel without a vehicle file, m, and the factor within which it is known.
const RADIUS_M: f64 = 0.33;
const RADIUS_FACTOR: f64 = 1.6;

const DEGREE: f64 = 180.0 / std::f64::consts::PI;
const KM_H: f64 = 3.6;
const MPH: f64 = 1.0 / 0.447_04;
const KNOT: f64 = 3600.0 / 1852.0;
const RPM: f64 = 60.0 / std::f64::consts::TAU;

/// What a comparison found.
#[derive(Clone, Debug, PartialEq)]
pub enum Finding {
    /// A unit is wrong.
    Error(String),
    /// Something does not fit, but no unit explains it.
    Warning(String),
}

/// Measurements of a drive by quantity, in the order of arrival, SI.
#[derive(Default)]
pub struct Drive {
    speed: Vec<(LogTime, f64)>,
    ground_track: Vec<(LogTime, f64)>,
    yaw_rate: Vec<(LogTime, f64)>,
    lateral: Vec<(LogTime, f64)>,
    force: Vec<(LogTime, f64)>,
    wheels: Vec<(LogTime, f64)>,
    positions: Vec<(LogTime, Geodetic)>,
    steered: bool,
}

impl Drive {
    /// Takes a measurement with its time.
    pub fn push(&mut self, time: LogTime, measurement: &Measurement) {
        match measurement {
            Measurement::Imu(imu) => {
                let [x, y, z] = imu.specific_force_m_s2;
                let rate = imu.angular_rate_rad_s[2];
                if rate.is_finite() {
                    self.yaw_rate.push((time, rate));
                }
                if y.is_finite() {
                    self.lateral.push((time, y));
                }
                let size = math::hypot(math::hypot(x, y), z);
                if size.is_finite() {
                    self.force.push((time, size));
                }
            }
            Measurement::GroundSpeed(speed) => self.speed.push((time, speed.forward_m_s)),
            Measurement::GnssVelocity(velocity) => {
                let [east, north, _] = velocity.velocity_enu_m_s;
                self.ground_track.push((time, math::hypot(east, north)));
            }
            Measurement::GnssPosition(position) => self.positions.push((
                time,
                Geodetic {
                    latitude_rad: position.latitude_rad,
                    longitude_rad: position.longitude_rad,
                    height_m: 0.0,
                },
            )),
            Measurement::WheelSpeed(speeds) => {
                let all: Vec<f64> = speeds.angular_speed_rad_s.0.into_iter().flatten().collect();
                if !all.is_empty() {
                    let mean = all.iter().sum::<f64>() / all.len() as f64;
                    self.wheels.push((time, mean));
                }
            }
            Measurement::Steer(_) => self.steered = true,
            _ => {}
        }
    }

    /// What a single-track model needs and the drive does not have.
    pub fn lacks(&self) -> Vec<&'static str> {
        let no_speed = self.speeds().is_empty() && self.wheels.is_empty();
        let mut lacks = Vec::new();
        if no_speed {
            lacks.push("a speed (speed.forward, a GNSS velocity or wheel speeds)");
        }
        if !self.steered {
            lacks.push("a steering-wheel angle (steer)");
        }
        lacks
    }

    /// Compares the quantities; `radius_m` is the rolling radius of the wheels, if it is known.
    pub fn findings(&self, radius_m: Option<f64>) -> Vec<Finding> {
        [
            self.latitudes(),
            self.speed_against_positions(),
            self.speed_against_receiver(),
            self.lateral_against_turns(),
            self.force_at_rest(),
            self.wheels_against_speed(radius_m),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    /// The speed over ground, of the vehicle or of the receiver.
    fn speeds(&self) -> &[(LogTime, f64)] {
        if self.speed.is_empty() {
            &self.ground_track
        } else {
            &self.speed
        }
    }

    fn latitudes(&self) -> Option<Finding> {
        let limit = std::f64::consts::FRAC_PI_2;
        let (_, beyond) = self
            .positions
            .iter()
            .find(|(_, p)| p.latitude_rad.abs() > limit)?;
        let text = format!(
            "gnss.latitude: {:.4} rad is beyond a pole: is the column in deg, or in degrees and minutes?",
            beyond.latitude_rad
        );
        Some(Finding::Error(text))
    }

    /// Distance that the speed gives over the distance between positions.
    fn speed_against_positions(&self) -> Option<Finding> {
        let (mut driven, mut between) = (0.0, 0.0);
        let mut last: Option<(LogTime, Geodetic)> = None;
        let mut speeds = self.speeds().iter().peekable();
        let mut integral = 0.0;
        let mut before: Option<(LogTime, f64)> = None;
        for (time, place) in &self.positions {
            while let Some((at, speed)) = speeds.next_if(|(at, _)| at <= time) {
                if let Some((then, _)) = before {
                    let step_s = at.seconds_since(then);
                    integral += speed.abs() * step_s.clamp(0.0, AGE_MAX_S);
                }
                before = Some((*at, *speed));
            }
            let Some((then, from)) = last else {
                (last, integral) = (Some((*time, *place)), 0.0);
                continue;
            };
            let apart_s = time.seconds_since(then);
            if apart_s < INTERVAL_S {
                continue;
            }
            if apart_s < 3.0 * INTERVAL_S {
                driven += integral;
                between += distance_m(from, *place);
            }
            (last, integral) = (Some((*time, *place)), 0.0);
        }
        if driven < DISTANCE_M || between < 0.01 * DISTANCE_M {
            return None;
        }
        let units = [
            (KM_H, "is the speed in km/h?"),
            (1.0 / KM_H, "is the speed in m/s, not in km/h?"),
            (MPH, "is the speed in mph?"),
            (1.0 / MPH, "is the speed in m/s, not in mph?"),
            (KNOT, "is the speed in kn?"),
            (1.0 / KNOT, "is the speed in m/s, not in kn?"),
            (DEGREE, "are latitude and longitude in rad, not in deg?"),
        ];
        let what = "the speed is {} times what the positions give";
        judged(driven / between, what, &units, 1.1)
    }

    fn speed_against_receiver(&self) -> Option<Finding> {
        let ratios: Vec<f64> = paired(&self.speed, &self.ground_track)
            .filter(|(_, track)| *track > DRIVING_M_S)
            .map(|(speed, track)| speed.abs() / track)
            .collect();
        let units = [
            (KM_H, "is speed.forward in km/h?"),
            (
                1.0 / KM_H,
                "is speed.forward in m/s, not in km/h, or the receiver's speed in km/h?",
            ),
            (MPH, "is speed.forward in mph?"),
            (1.0 / MPH, "is speed.forward in m/s, not in mph?"),
            (KNOT, "is the receiver's speed in m/s, not in kn?"),
            (1.0 / KNOT, "is the receiver's speed in kn?"),
        ];
        let what = "speed.forward is {} times the speed of the receiver";
        judged(median(ratios)?, what, &units, 1.1)
    }

    /// a_y = v r in steady turns; the ratio of the standard deviations does not depend on delays.
    fn lateral_against_turns(&self) -> Option<Finding> {
        let speeds = self.speeds();
        let turns: Vec<(LogTime, f64)> = {
            let mut at = Latest::new(speeds);
            let turn = |(time, rate): &(LogTime, f64)| Some((*time, rate * at.value(*time)?));
            self.yaw_rate.iter().filter_map(turn).collect()
        };
        let pairs: Vec<(f64, f64)> = paired(&self.lateral, &turns).collect();
        if pairs.len() < COUNT_MIN {
            return None;
        }
        let count = pairs.len() as f64;
        let mean = |value: fn(&(f64, f64)) -> f64| pairs.iter().map(value).sum::<f64>() / count;
        let (force, turn) = (mean(|p| p.0), mean(|p| p.1));
        let (mut ff, mut tt, mut ft) = (0.0, 0.0, 0.0);
        for (f, t) in &pairs {
            ff += (f - force) * (f - force);
            tt += (t - turn) * (t - turn);
            ft += (f - force) * (t - turn);
        }
        let correlation = ft / (ff * tt).sqrt();
        if correlation.is_nan() || correlation.abs() <= CORRELATION_MIN {
            return None;
        }
        let g = STANDARD_GRAVITY_M_S2;
        let units = [
            (g, "is it in m/s^2, not in g?"),
            (1.0 / g, "is it in g?"),
            (DEGREE, "is the yaw rate in rad/s, not in deg/s?"),
            (1.0 / DEGREE, "is the yaw rate in deg/s?"),
            (KM_H, "is the speed in m/s, not in km/h?"),
            (1.0 / KM_H, "is the speed in km/h?"),
            (1000.0, "is it in mm/s^2?"),
        ];
        let what = "a_y is {} times what speed and yaw rate give";
        judged((ff / tt).sqrt(), what, &units, RECOGNISED)
    }

    /// Size of the specific force while the vehicle stands; of the whole drive if it never stands.
    fn force_at_rest(&self) -> Option<Finding> {
        let standing: Vec<f64> = paired(&self.force, self.speeds())
            .filter(|(_, speed)| speed.abs() < STANDING_M_S)
            .map(|(force, _)| force)
            .collect();
        let is_rest = standing.len() >= COUNT_MIN;
        let all = || self.force.iter().map(|(_, force)| *force).collect();
        let ratio = median(if is_rest { standing } else { all() })? / STANDARD_GRAVITY_M_S2;
        let when = if is_rest {
            "at rest"
        } else {
            "in the middle of the drive"
        };
        if ratio < WITHOUT_GRAVITY {
            let text = format!(
                "|specific force| {when} is {:.3} m/s^2 instead of 9.81: has gravity been subtracted? An \
                 accelerometer measures it",
                ratio * STANDARD_GRAVITY_M_S2
            );
            return Some(Finding::Error(text));
        }
        let g = STANDARD_GRAVITY_M_S2;
        let units = [
            (g, "are the accelerations in m/s^2, not in g?"),
            (1.0 / g, "are the accelerations in g?"),
            (1000.0, "are the accelerations in mm/s^2, or in mg?"),
            (1000.0 / g, "are the accelerations in mg?"),
        ];
        let what = format!("|specific force| {when} is {{}} times gravity");
        judged(ratio, &what, &units, RECOGNISED)
    }

    fn wheels_against_speed(&self, radius_m: Option<f64>) -> Option<Finding> {
        let ratios: Vec<f64> = paired(&self.wheels, self.speeds())
            .filter(|(_, speed)| speed.abs() > DRIVING_M_S)
            .map(|(wheel, speed)| wheel.abs() * radius_m.unwrap_or(RADIUS_M) / speed.abs())
            .collect();
        let ratio = median(ratios)?;
        if radius_m.is_none() && (1.0 / RADIUS_FACTOR..RADIUS_FACTOR).contains(&ratio) {
            return None;
        }
        let units = [
            (RPM, "are the wheel speeds in rpm?"),
            (1.0 / RPM, "are the wheel speeds in rad/s, not in rpm?"),
            (DEGREE, "are the wheel speeds in deg/s?"),
            (1.0 / DEGREE, "are the wheel speeds in rad/s, not in deg/s?"),
            (
                1.0 / std::f64::consts::TAU,
                "are the wheel speeds in rev/s?",
            ),
            (KM_H, "is the speed in m/s, not in km/h?"),
            (1.0 / KM_H, "is the speed in km/h?"),
            (RPM / DEGREE, "are the wheel speeds in deg/s, not in rpm?"),
        ];
        let recognised = if radius_m.is_some() {
            RECOGNISED
        } else {
            RADIUS_FACTOR
        };
        let what = "the circumferential speed of the wheels is {} times the speed";
        judged(ratio, what, &units, recognised)
    }
}

/// A ratio that should be 1. `units` are ratios that a mistake of a unit gives; `{}` in `what` is the
/// ratio.
fn judged(ratio: f64, what: &str, units: &[(f64, &str)], recognised: f64) -> Option<Finding> {
    let apart = |expected: f64| math::ln(ratio / expected).abs();
    let plausible = math::ln(PLAUSIBLE);
    if apart(1.0).is_nan() || apart(1.0) <= plausible {
        return None;
    }
    let text = what.replace("{}", &format!("{ratio:.3}"));
    let nearest = units
        .iter()
        .min_by(|(a, _), (b, _)| apart(*a).total_cmp(&apart(*b)));
    match nearest {
        Some((expected, unit)) if apart(*expected) < math::ln(recognised) => {
            Some(Finding::Error(format!("{text}: {unit}")))
        }
        _ => Some(Finding::Warning(format!(
            "{text}; check units and scales in the column map"
        ))),
    }
}

/// The newest value of a channel at increasing times, while it is not too old.
struct Latest<'c> {
    channel: &'c [(LogTime, f64)],
    next: usize,
}

impl<'c> Latest<'c> {
    const fn new(channel: &'c [(LogTime, f64)]) -> Self {
        Self { channel, next: 0 }
    }

    fn value(&mut self, now: LogTime) -> Option<f64> {
        while self
            .channel
            .get(self.next)
            .is_some_and(|(time, _)| *time <= now)
        {
            self.next += 1;
        }
        let (time, value) = self.channel[..self.next].last()?;
        (now.seconds_since(*time) <= AGE_MAX_S).then_some(*value)
    }
}

/// The values of `a` with the newest value of `b`.
fn paired<'c>(
    a: &'c [(LogTime, f64)],
    b: &'c [(LogTime, f64)],
) -> impl Iterator<Item = (f64, f64)> + use<'c> {
    let mut latest = Latest::new(b);
    a.iter()
        .filter_map(move |(time, value)| Some((*value, latest.value(*time)?)))
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    if values.len() < COUNT_MIN {
        return None;
    }
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

fn distance_m(from: Geodetic, to: Geodetic) -> f64 {
    let (a, b) = (from.to_ecef(), to.to_ecef());
    let [x, y, z] = [0, 1, 2].map(|axis| b[axis] - a[axis]);
    math::hypot(math::hypot(x, y), z)
}

#[cfg(test)]
mod tests;
