//! Inputs and measurements of the single-track filter, from samples.

use model::vehicle::Vehicle;
use nalgebra::Vector3;
use sample::{LogTime, Measurement, STANDARD_GRAVITY_M_S2, Sample};

use crate::calibration::Resolved;
use crate::steering_column::SteeringColumn;
use crate::tuning::PlanarInputTuning;
use crate::{EstimatorError, Input, Settings};

/// Input at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarInput {
    /// The instant, s from any zero.
    pub time_s: f64,
    /// Forward speed, m/s.
    pub speed_m_s: f64,
    /// Its rate of change, m/s^2.
    pub acceleration_m_s2: f64,
    /// Road-wheel angle over the vehicle file's steering ratio, left positive, rad.
    pub steer_rad: f64,
    /// Yaw rate, if it was measured since the instant before, rad/s.
    pub yaw_rate_rad_s: Option<f64>,
    /// Lateral specific force at the inertial unit, likewise, m/s^2.
    pub lateral_m_s2: Option<f64>,
}

/// Accepted difference between two values: at once, and for each second between them.
#[derive(Clone, Copy, Debug)]
struct Reach {
    at_once: f64,
    per_second: f64,
}

impl Reach {
    fn new([at_once, per_second]: [f64; 2]) -> Self {
        Self {
            at_once,
            per_second,
        }
    }
}

/// Yaw rate and force: the filter has its own gate.
const ANY: Reach = Reach {
    at_once: f64::INFINITY,
    per_second: 0.0,
};

/// Measured quantities, in the order in which values of one instant are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Quantity {
    Speed,
    Satellite,
    Wheels,
    SteeringWheel,
    YawRate,
    Lateral,
}

/// Mean of the values since the last step, else the last value.
#[derive(Clone, Copy, Debug)]
struct Slot {
    out_of_reach_max_s: f64,
    held_max_s: f64,
    reach: Reach,
    sum: f64,
    count: u32,
    last: Option<(LogTime, f64)>,
    /// Since when values have been out of reach.
    astray: Option<LogTime>,
}

impl Slot {
    fn new(reach: Reach, tuning: &PlanarInputTuning) -> Self {
        Self {
            out_of_reach_max_s: tuning.out_of_reach_max_s,
            held_max_s: tuning.held_max_s,
            reach,
            sum: 0.0,
            count: 0,
            last: None,
            astray: None,
        }
    }

    fn push(&mut self, time: LogTime, value: f64) {
        if !value.is_finite() || self.last.is_some_and(|(last, _)| time < last) {
            return;
        }
        let is_astray = self.last.is_some_and(|(last, before)| {
            let since_s = time.seconds_since(last);
            (value - before).abs() > self.reach.at_once + self.reach.per_second * since_s
        });
        if is_astray {
            let since = *self.astray.get_or_insert(time);
            if time.seconds_since(since) < self.out_of_reach_max_s {
                return;
            }
        }
        self.astray = None;
        self.sum += value;
        self.count += 1;
        self.last = Some((time, value));
    }

    /// The mean of the new values, if there are any.
    fn fresh(&mut self) -> Option<f64> {
        let mean = (self.count > 0).then(|| self.sum / f64::from(self.count));
        (self.sum, self.count) = (0.0, 0);
        mean
    }

    /// The new values' mean, or the last value while it is not too old.
    fn held(&mut self, now: LogTime) -> Option<f64> {
        let last = self
            .last
            .filter(|(t, _)| now.seconds_since(*t) < self.held_max_s);
        self.fresh().or(last.map(|(_, value)| value))
    }
}

/// Capacity of the buffer; a step of 10 ms has a handful of values.
const CAPACITY: usize = 1024;

/// Buffer of samples. A step takes them in the order of their own time, so the order of arrival has
/// no effect; values faster than 100 Hz are averaged over the step.
#[derive(Clone, Debug)]
pub struct PlanarReadings {
    tuning: PlanarInputTuning,
    waiting: Vec<(LogTime, Quantity, f64)>,
    column: SteeringColumn,
    steering_ratio: f64,
    rolling_radius_m: f64,
    speed: Slot,
    satellite: Slot,
    wheels: Slot,
    steer: Slot,
    yaw_rate: Slot,
    lateral: Slot,
    smoothed: Option<(LogTime, f64)>,
    slope: f64,
}

impl PlanarReadings {
    /// Readings without any value.
    pub fn new(vehicle: &Vehicle, tuning: PlanarInputTuning) -> Result<Self, EstimatorError> {
        let slot = |reach| Slot::new(reach, &tuning);
        let speed = Reach::new(tuning.speed_reach);
        Ok(Self {
            tuning,
            waiting: Vec::with_capacity(CAPACITY),
            column: SteeringColumn::new(vehicle)?,
            steering_ratio: vehicle.steering.ratio,
            rolling_radius_m: rolling_radius_m(vehicle),
            speed: slot(speed),
            satellite: slot(speed),
            wheels: slot(speed),
            steer: slot(Reach::new(tuning.steer_reach)),
            yaw_rate: slot(ANY),
            lateral: slot(ANY),
            smoothed: None,
            slope: 0.0,
        })
    }

    /// Takes a sample. Samples without planar motion and ignored inputs are skipped.
    pub fn push(&mut self, sample: &Sample, calibration: &Resolved, settings: &Settings) {
        let t = self.tuning;
        let time = sample.valid_time.min(sample.log_time);
        let uses = |input| settings.uses(input);
        match &sample.measurement {
            Measurement::GroundSpeed(speed)
                if uses(Input::GroundSpeed) && speed.forward_m_s.abs() < t.speed_max_m_s =>
            {
                self.wait(time, Quantity::Speed, speed.forward_m_s);
            }
            Measurement::GnssVelocity(velocity) if uses(Input::GnssVelocity) => {
                let [east, north, _] = velocity.velocity_enu_m_s;
                let speed = math::hypot(east, north);
                if velocity.quality.is_measured() && speed < t.speed_max_m_s {
                    let time = time.offset_seconds(-calibration.velocity_latency_s);
                    self.wait(time, Quantity::Satellite, speed);
                }
            }
            Measurement::WheelSpeed(speeds) if uses(Input::WheelSpeed) => {
                let all = speeds.angular_speed_rad_s.0;
                let (sum, count) = all
                    .iter()
                    .flatten()
                    .fold((0.0, 0.0), |(sum, count), speed| (sum + speed, count + 1.0));
                if count > 0.0 {
                    let speed = self.rolling_radius_m * sum / count;
                    self.wait(time, Quantity::Wheels, speed);
                }
            }
            Measurement::Steer(steer)
                if uses(Input::Steer)
                    && steer.steering_wheel_rad.abs() < t.steering_wheel_max_rad =>
            {
                let angle = steer.steering_wheel_rad - calibration.steer_offset_rad;
                self.wait(time, Quantity::SteeringWheel, angle);
            }
            Measurement::Imu(imu) if uses(Input::Imu) && imu.valid => {
                // A unit that measures only in the plane has no other axes.
                let or = |value: f64, other: f64| if value.is_finite() { value } else { other };
                let [fx, fy, fz] = imu.specific_force_m_s2;
                let [p, q, r] = imu.angular_rate_rad_s;
                if fy.is_finite() && fy.abs() < t.force_max_m_s2 {
                    let force = Vector3::new(or(fx, 0.0), fy, or(fz, STANDARD_GRAVITY_M_S2));
                    let force = calibration.body_from_imu * (force - calibration.accel_bias_m_s2);
                    self.wait(time, Quantity::Lateral, force.y);
                }
                if r.is_finite() && r.abs() < t.rate_max_rad_s {
                    let rate = Vector3::new(or(p, 0.0), or(q, 0.0), r);
                    let rate = calibration.body_from_imu * (rate - calibration.gyro_bias_rad_s);
                    self.wait(time, Quantity::YawRate, rate.z);
                }
            }
            _ => {}
        }
    }

    /// Adds a value. Values beyond the capacity, hundreds of times what a vehicle sends, are
    /// dropped.
    fn wait(&mut self, time: LogTime, quantity: Quantity, value: f64) {
        if self.waiting.len() < CAPACITY {
            self.waiting.push((time, quantity, value));
        }
    }

    fn take_waiting(&mut self) {
        let mut waiting = std::mem::take(&mut self.waiting);
        waiting.sort_unstable_by(|(t, q, x), (u, r, y)| (t, q).cmp(&(u, r)).then(x.total_cmp(y)));
        for (time, quantity, value) in waiting.drain(..) {
            match quantity {
                Quantity::Speed => self.speed.push(time, value),
                Quantity::Satellite => self.satellite.push(time, value),
                Quantity::Wheels => self.wheels.push(time, value),
                Quantity::SteeringWheel => {
                    let angle = self.column.follow(value);
                    self.steer.push(time, angle / self.steering_ratio);
                }
                Quantity::YawRate => self.yaw_rate.push(time, value),
                Quantity::Lateral => self.lateral.push(time, value),
            }
        }
        self.waiting = waiting;
    }

    /// Input at `now`; `None` without a speed and a steer angle.
    pub fn take(&mut self, now: LogTime) -> Option<PlanarInput> {
        self.take_waiting();
        let (satellite, wheels) = (self.satellite.held(now), self.wheels.held(now));
        let speed = self.speed.held(now).or(satellite).or(wheels);
        let steer = self.steer.held(now);
        let (yaw_rate_rad_s, lateral_m_s2) = (self.yaw_rate.fresh(), self.lateral.fresh());
        let (speed_m_s, steer_rad) = (speed?, steer?);
        Some(PlanarInput {
            time_s: now.0 as f64 * 1e-9,
            speed_m_s,
            acceleration_m_s2: self.slope(now, speed_m_s),
            steer_rad,
            yaw_rate_rad_s,
            lateral_m_s2,
        })
    }

    /// Filtered difference quotient of the speed.
    fn slope(&mut self, now: LogTime, speed_m_s: f64) -> f64 {
        let t = &self.tuning;
        match &mut self.smoothed {
            Some((then, smooth)) if (0.0..1.0).contains(&now.seconds_since(*then)) => {
                let dt = now.seconds_since(*then);
                let most = t.acceleration_max_m_s2;
                self.slope = ((speed_m_s - *smooth) / t.acceleration_time_s).clamp(-most, most);
                *smooth += (dt / t.acceleration_time_s).min(1.0) * (speed_m_s - *smooth);
                *then = now;
            }
            _ => {
                self.smoothed = Some((now, speed_m_s));
                self.slope = 0.0;
            }
        }
        self.slope
    }
}

/// Speed over the wheels' angular speed, rolling freely, m.
fn rolling_radius_m(vehicle: &Vehicle) -> f64 {
    let load_n = 0.25 * vehicle.body.mass_kg * STANDARD_GRAVITY_M_S2;
    let radii = [&vehicle.front, &vehicle.rear].map(|axle| axle.tyre.rolling_radius_m(load_n));
    0.5 * (radii[0] + radii[1])
}
