//! What the planar filter is driven and corrected by, put together from samples.

use nalgebra::Vector3;
use sample::{FixQuality, LogTime, Measurement, STANDARD_GRAVITY_M_S2, Sample};

use crate::calibration::Resolved;

/// A reading older than this is not held on to, s.
const HELD_MAX_S: f64 = 0.25;
/// Speed that no road vehicle has, m/s.
const SPEED_MAX_M_S: f64 = 150.0;
/// Time constant of the difference quotient of the speed, s.
const ACCELERATION_TIME_S: f64 = 0.15;

/// What is known at one instant.
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

/// The mean of what came since it was last asked for, else what came last.
#[derive(Clone, Copy, Debug, Default)]
struct Slot {
    sum: f64,
    count: u32,
    last: Option<(LogTime, f64)>,
}

impl Slot {
    fn push(&mut self, time: LogTime, value: f64) {
        if value.is_finite() && self.last.is_none_or(|(last, _)| time >= last) {
            self.sum += value;
            self.count += 1;
            self.last = Some((time, value));
        }
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
            .filter(|(t, _)| now.seconds_since(*t) < HELD_MAX_S);
        self.fresh().or(last.map(|(_, value)| value))
    }
}

/// Gathers samples. Values of more than 100 Hz are averaged over the step.
#[derive(Clone, Debug, Default)]
pub struct PlanarReadings {
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
    /// Takes a sample in; those that tell nothing of planar motion are left alone.
    /// `steering_ratio` is hand-wheel over road-wheel angle, `rolling_radius_m` the wheels'.
    pub fn push(
        &mut self,
        sample: &Sample,
        calibration: &Resolved,
        steering_ratio: f64,
        rolling_radius_m: f64,
    ) {
        let time = sample.valid_time.min(sample.log_time);
        match &sample.measurement {
            Measurement::GroundSpeed(speed) if speed.forward_m_s.abs() < SPEED_MAX_M_S => {
                self.speed.push(time, speed.forward_m_s);
            }
            Measurement::GnssVelocity(velocity) => {
                let [east, north, _] = velocity.velocity_enu_m_s;
                let speed = east.hypot(north);
                let known = !matches!(
                    velocity.quality,
                    FixQuality::None | FixQuality::DeadReckoning
                );
                if known && speed < SPEED_MAX_M_S {
                    self.satellite.push(time, speed);
                }
            }
            Measurement::WheelSpeed(speeds) => {
                let all = speeds.angular_speed_rad_s.0;
                let (sum, count) = all
                    .iter()
                    .flatten()
                    .fold((0.0, 0.0), |(sum, count), speed| (sum + speed, count + 1.0));
                if count > 0.0 {
                    self.wheels.push(time, rolling_radius_m * sum / count);
                }
            }
            Measurement::Steer(steer) if steer.hand_wheel_rad.abs() < 50.0 => {
                let angle = steer.hand_wheel_rad - calibration.steer_offset_rad;
                self.steer.push(time, angle / steering_ratio);
            }
            Measurement::Imu(imu) => {
                // A unit that measures in the plane alone leaves the other axes open.
                let or = |value: f64, other: f64| if value.is_finite() { value } else { other };
                let [fx, fy, fz] = imu.specific_force_m_s2;
                let [p, q, r] = imu.angular_rate_rad_s;
                if fy.is_finite() && fy.abs() < 100.0 {
                    let force = Vector3::new(or(fx, 0.0), fy, or(fz, STANDARD_GRAVITY_M_S2));
                    let force = calibration.body_from_imu * (force - calibration.accel_bias_m_s2);
                    self.lateral.push(time, force.y);
                }
                if r.is_finite() && r.abs() < 20.0 {
                    let rate = Vector3::new(or(p, 0.0), or(q, 0.0), r);
                    let rate = calibration.body_from_imu * (rate - calibration.gyro_bias_rad_s);
                    self.yaw_rate.push(time, rate.z);
                }
            }
            _ => {}
        }
    }

    /// What is known at `now`; nothing without a speed and a steer angle.
    pub fn take(&mut self, now: LogTime) -> Option<PlanarInput> {
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
        match &mut self.smoothed {
            Some((then, smooth)) if (0.0..1.0).contains(&now.seconds_since(*then)) => {
                let dt = now.seconds_since(*then);
                self.slope = ((speed_m_s - *smooth) / ACCELERATION_TIME_S).clamp(-15.0, 15.0);
                *smooth += (dt / ACCELERATION_TIME_S).min(1.0) * (speed_m_s - *smooth);
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
