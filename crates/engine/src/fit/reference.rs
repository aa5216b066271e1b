//! Speed, accelerations and yaw rate that the other readings are compared with.

use estimator::calibration::Resolved;
use model::steering::SteeringGear;
use model::vehicle::Vehicle;
use sample::{PerWheel, Wheel};

use super::columns::{Columns, INTERVAL_S};
use super::line::{Follows, Line};

/// Speed from which a course has a meaning, m/s.
pub const COURSE_SPEED_MIN_M_S: f64 = 2.0;
/// Least root mean square of a yaw rate that a sign is judged by, rad/s.
pub const YAW_RATE_MIN_RAD_S: f64 = 0.06;

/// A yaw rate and where it comes from.
#[derive(Debug)]
pub struct YawRate {
    /// What measures it.
    pub name: &'static str,
    /// Values, rad/s.
    pub value: Vec<f64>,
}

/// Names of the yaw rates.
pub const COURSE: &str = "course of the GNSS receiver";
pub const GYRO: &str = "yaw rate of the inertial unit";
pub const STEER: &str = "steering-wheel angle";
pub const FRONT_WHEELS: &str = "speeds of the front wheels";
pub const REAR_WHEELS: &str = "speeds of the rear wheels";

/// What the readings are compared with.
#[derive(Debug)]
pub struct Reference {
    /// Speed of the GNSS receiver, m/s; empty without one.
    pub gnss_speed_m_s: Vec<f64>,
    /// Speed of the vehicle, from the first that is there of GNSS, ground speed and wheels, m/s.
    pub speed_m_s: Vec<f64>,
    /// Course of the GNSS receiver, rad.
    pub course_rad: Vec<f64>,
    /// Mean speed of the wheels, m/s, with its sign.
    pub rolling_m_s: Vec<f64>,
    /// Rolling radii, m.
    pub radius_m: PerWheel<f64>,
    /// All yaw rates, each by another sensor.
    pub yaw_rates: Vec<YawRate>,
    /// Index of the yaw rate that the others are compared with.
    pub chosen: Option<usize>,
    /// Derivative of the speed, m/s^2.
    pub longitudinal_m_s2: Vec<f64>,
    /// Speed times yaw rate, m/s^2.
    pub lateral_m_s2: Vec<f64>,
}

impl Reference {
    /// Computes all from the readings.
    pub fn new(columns: &Columns, vehicle: &Vehicle, calibration: &Resolved) -> Self {
        let rows = columns.rows;
        let radius_m = PerWheel::from_fn(|wheel| {
            let own = calibration.rolling_radius_m[wheel];
            own.unwrap_or(vehicle.axle(wheel).tyre.unloaded_radius_m)
        });
        let wheels = PerWheel::from_fn(|wheel| columns.wheel_rad_s[wheel].smoothed(rows));
        let rolling_m_s = (0..rows)
            .map(|row| mean(Wheel::ALL.map(|wheel| wheels[wheel][row] * radius_m[wheel])))
            .collect::<Vec<_>>();
        let [east, north] = [0, 1].map(|axis| columns.velocity_m_s[axis].smoothed(rows));
        let gnss = columns.velocity_m_s[0].is_known();
        let pairs = || east.iter().zip(&north);
        let gnss_speed_m_s: Vec<f64> = match gnss {
            true => pairs()
                .map(|(east, north)| math::hypot(*east, *north))
                .collect(),
            false => Vec::new(),
        };
        let course_rad: Vec<f64> = pairs()
            .map(
                |(east, north)| match math::hypot(*east, *north) > COURSE_SPEED_MIN_M_S {
                    true => math::atan2(*north, *east),
                    false => f64::NAN,
                },
            )
            .collect();
        let speed_m_s = if gnss {
            gnss_speed_m_s.clone()
        } else if columns.ground_speed_m_s.is_known() {
            absolute(&columns.ground_speed_m_s.smoothed(rows))
        } else {
            absolute(&rolling_m_s)
        };
        let pairs = speed_m_s.iter().zip(&rolling_m_s);
        let forward: Vec<f64> = pairs
            .map(|(speed, rolling)| signed(*speed, *rolling))
            .collect();
        let mut reference = Self {
            longitudinal_m_s2: derivative(&forward, |change| change),
            lateral_m_s2: vec![f64::NAN; rows],
            gnss_speed_m_s,
            course_rad,
            rolling_m_s,
            radius_m,
            yaw_rates: Vec::new(),
            chosen: None,
            speed_m_s,
        };
        reference.add_yaw_rates(columns, vehicle, &wheels);
        reference.choose();
        reference
    }

    fn add_yaw_rates(&mut self, columns: &Columns, vehicle: &Vehicle, wheels: &PerWheel<Vec<f64>>) {
        let rows = columns.rows;
        let mut add = |name, value| self.yaw_rates.push(YawRate { name, value });
        if !self.gnss_speed_m_s.is_empty() {
            add(COURSE, derivative(&self.course_rad, wrapped));
        }
        if columns.rate_rad_s[2].is_known() {
            add(GYRO, columns.rate_rad_s[2].smoothed(rows));
        }
        if let (true, Ok(gear)) = (
            columns.steer_rad.is_known(),
            SteeringGear::from_vehicle(vehicle),
        ) {
            const SMALL_RAD: f64 = 0.1;
            let mean = |hand: f64| 0.5 * (gear.left.at(hand) + gear.right.at(hand));
            let ratio = (mean(SMALL_RAD) - mean(-SMALL_RAD)) / (2.0 * SMALL_RAD);
            let steer = columns.steer_rad.smoothed(rows);
            // While driving backwards, the vehicle turns the other way.
            let forward = |row: usize| signed(self.speed_m_s[row], self.rolling_m_s[row]);
            let turn = |row: usize| forward(row) * steer[row] * ratio / vehicle.wheelbase_m();
            add(STEER, (0..rows).map(turn).collect());
        }
        let axles = [
            (FRONT_WHEELS, Wheel::FrontLeft, Wheel::FrontRight),
            (REAR_WHEELS, Wheel::RearLeft, Wheel::RearRight),
        ];
        for (name, left, right) in axles {
            if columns.wheel_rad_s[left].is_known() && columns.wheel_rad_s[right].is_known() {
                let track_m = vehicle.axle(left).track_m;
                let speed = |wheel: Wheel, row: usize| wheels[wheel][row] * self.radius_m[wheel];
                let turn = |row| (speed(right, row) - speed(left, row)) / track_m;
                add(name, (0..rows).map(turn).collect());
            }
        }
    }

    /// Chooses the receiver's course, or the yaw rate with which most others agree.
    fn choose(&mut self) {
        let agreement = |k: usize| {
            let others = self
                .yaw_rates
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != k);
            let lines = others.filter_map(|(_, other)| {
                Line::through_zero(&self.yaw_rates[k].value, &other.value)
            });
            lines.map(|line| line.correlation).sum::<f64>()
        };
        let is_excited = |rate: &YawRate| {
            let line = Line::through_zero(&rate.value, &rate.value);
            line.is_some_and(|line| line.expected_rms >= YAW_RATE_MIN_RAD_S)
        };
        let usable = |(_, rate): &(usize, &YawRate)| is_excited(rate);
        let candidates = || {
            self.yaw_rates
                .iter()
                .enumerate()
                .filter(usable)
                .map(|(k, _)| k)
        };
        let by_course = candidates().find(|k| self.yaw_rates[*k].name == COURSE);
        // The course says that the vehicle drives straight.
        let is_straight = self.yaw_rates.iter().any(|rate| {
            let known = rate.value.iter().filter(|value| value.is_finite()).count();
            rate.name == COURSE && known >= super::line::ROWS_MIN
        });
        self.chosen = match by_course {
            None if is_straight => None,
            None => candidates().reduce(|a, b| {
                if agreement(b) > agreement(a) + 1e-9 {
                    b
                } else {
                    a
                }
            }),
            found => found,
        };
        let Some(chosen) = self.chosen else {
            // Nothing turns, so that the lateral acceleration is small.
            self.lateral_m_s2 = self.speed_m_s.iter().map(|speed| 0.0 * speed).collect();
            return;
        };
        // The gyro has less noise than a course, and also measures at a low speed.
        let smooth = self.yaw_rates.iter().find(|rate| {
            let line = Line::through_zero(&self.yaw_rates[chosen].value, &rate.value);
            let agrees = line.is_some_and(|line| {
                line.follows() == Follows::Yes && (0.7..1.4).contains(&line.ratio)
            });
            rate.name == GYRO && agrees
        });
        let rate = smooth.unwrap_or(&self.yaw_rates[chosen]);
        let rows = self
            .speed_m_s
            .iter()
            .zip(&self.rolling_m_s)
            .zip(&rate.value);
        self.lateral_m_s2 = rows
            .map(|((speed, rolling), rate)| signed(*speed, *rolling) * rate)
            .collect();
    }

    /// Rows in which the vehicle neither turns nor changes its speed.
    pub fn is_steady(&self, row: usize) -> bool {
        let small = |value: f64| value.abs() < 0.5;
        let moved = self.lateral_m_s2[row];
        small(self.longitudinal_m_s2[row])
            && (small(moved) || moved.is_nan() && self.yaw_rates.is_empty())
    }
}

/// A speed with the sign of the wheels' rotation.
fn signed(speed_m_s: f64, rolling_m_s: f64) -> f64 {
    if rolling_m_s < 0.0 {
        -speed_m_s
    } else {
        speed_m_s
    }
}

fn absolute(values: &[f64]) -> Vec<f64> {
    values.iter().map(|value| value.abs()).collect()
}

/// Mean of the finite values.
fn mean(values: [f64; 4]) -> f64 {
    let known = values.iter().filter(|value| value.is_finite());
    let (sum, count) = known.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

/// Central difference over two intervals on each side; `change` corrects the difference.
fn derivative(values: &[f64], change: impl Fn(f64) -> f64) -> Vec<f64> {
    const SIDE: usize = 2;
    let at = |row: usize| match (
        row.checked_sub(SIDE).map(|before| values[before]),
        values.get(row + SIDE),
    ) {
        (Some(before), Some(after)) => change(after - before) / (2.0 * SIDE as f64 * INTERVAL_S),
        _ => f64::NAN,
    };
    (0..values.len()).map(at).collect()
}

/// An angle between -pi and pi.
fn wrapped(angle_rad: f64) -> f64 {
    math::atan2(math::sin(angle_rad), math::cos(angle_rad))
}
