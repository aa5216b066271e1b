//! State of the motion filter at one instant, and the motion from it.

use nalgebra::{Rotation3, SMatrix, SVector, Vector3};
use sample::{LogTime, STANDARD_GRAVITY_M_S2};

use super::{
    ACCEL_BIAS, ATTITUDE, GYRO_BIAS, MotionState, STATES, STEP_MAX_S, VELOCITY, orthonormal, wrap,
};

/// Nominal state and covariance at the last reading of the inertial unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// When; `None` before the first reading.
    pub time: Option<LogTime>,
    /// Rotation from body to earth axes.
    pub earth_from_body: Rotation3<f64>,
    /// Velocity of the inertial unit, earth axes, m/s.
    pub velocity_m_s: Vector3<f64>,
    /// Accelerometer bias, body axes, m/s^2.
    pub accel_bias: Vector3<f64>,
    /// Gyro bias, body axes, rad/s.
    pub gyro_bias: Vector3<f64>,
    /// Covariance of the error state.
    pub covariance: SMatrix<f64, STATES, STATES>,
    /// Rate that the unit read, body axes, rad/s.
    pub rate: Vector3<f64>,
    /// Its derivative, rad/s^2.
    pub rate_dot: Vector3<f64>,
    /// Specific force that the unit read, body axes, m/s^2.
    pub force: Vector3<f64>,
    /// Its derivative, m/s^3.
    pub force_dot: Vector3<f64>,
    /// The unit from the centre of gravity, m.
    pub imu_m: Vector3<f64>,
    /// Whether an inertial unit measures rates and forces.
    pub inertial: bool,
}

impl Solution {
    /// The solution with an error added to the nominal state and a new covariance.
    #[must_use]
    pub fn corrected(
        mut self,
        error: &SVector<f64, STATES>,
        covariance: SMatrix<f64, STATES, STATES>,
    ) -> Self {
        let turn = Rotation3::new(error.fixed_rows::<3>(ATTITUDE).into_owned());
        self.earth_from_body = orthonormal(&(turn * self.earth_from_body));
        self.velocity_m_s += error.fixed_rows::<3>(VELOCITY);
        self.accel_bias += error.fixed_rows::<3>(ACCEL_BIAS);
        self.gyro_bias += error.fixed_rows::<3>(GYRO_BIAS);
        self.covariance = covariance;
        self
    }

    /// The motion at `now`, extrapolated from the last reading by at most 50 ms.
    #[must_use]
    pub fn state(&self, now: LogTime) -> MotionState {
        self.state_turning(now, self.rate_dot)
    }

    /// The same with the body's angular acceleration from another source, body axes, rad/s².
    #[must_use]
    pub fn state_turning(&self, now: LogTime, rate_dot: Vector3<f64>) -> MotionState {
        let ahead_s = self
            .time
            .map_or(0.0, |time| now.seconds_since(time).clamp(-0.02, STEP_MAX_S));
        let rate = self.rate - self.gyro_bias + rate_dot * ahead_s;
        let earth_from_body =
            self.earth_from_body * Rotation3::new((self.rate - self.gyro_bias) * ahead_s);
        let force = self.force - self.accel_bias;
        let acceleration = self.earth_from_body * force - Vector3::z() * STANDARD_GRAVITY_M_S2;
        let at_imu = self.velocity_m_s + acceleration * ahead_s;
        let arm = -self.imu_m;
        let earth = at_imu + earth_from_body * rate.cross(&arm);
        let body = earth_from_body.inverse() * earth;
        let (_, _, yaw) = earth_from_body.euler_angles();
        let speed = math::hypot(earth.x, earth.y);
        let course = math::atan2(earth.y, earth.x);
        let mut slope = SVector::<f64, STATES>::zeros();
        slope[ATTITUDE + 2] = -1.0;
        slope[VELOCITY] = -math::sin(course) / speed.max(0.1);
        slope[VELOCITY + 1] = math::cos(course) / speed.max(0.1);
        let variance = (slope.transpose() * self.covariance * slope)[0];
        let moving = speed > 0.3;
        MotionState {
            earth_from_body,
            velocity_m_s: body,
            rate_rad_s: rate,
            rate_dot_rad_s2: rate_dot,
            specific_force_m_s2: force + rate_dot.cross(&arm) + rate.cross(&rate.cross(&arm)),
            accel_bias_m_s2: self.accel_bias,
            accel_bias_sigma_m_s2: Vector3::from_fn(|axis, _| {
                self.covariance[(ACCEL_BIAS + axis, ACCEL_BIAS + axis)]
                    .max(0.0)
                    .sqrt()
            }),
            specific_force_dot_m_s3: self.force_dot,
            sideslip_rad: if moving { wrap(course - yaw) } else { 0.0 },
            sideslip_sigma_rad: if moving {
                variance.max(0.0).sqrt()
            } else {
                f64::NAN
            },
            inertial: self.inertial,
            inertial_age_s: ahead_s,
        }
    }
}
