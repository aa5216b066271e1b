//! The motion at one instant.

use nalgebra::{Rotation3, Vector3};

/// The motion at one instant, at the centre of gravity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionState {
    /// Rotation from body to earth axes.
    pub earth_from_body: Rotation3<f64>,
    /// Velocity of the centre of gravity, body axes, m/s.
    pub velocity_m_s: Vector3<f64>,
    /// Angular rate without bias, body axes, rad/s.
    pub rate_rad_s: Vector3<f64>,
    /// Angular acceleration, body axes, rad/s^2.
    pub rate_dot_rad_s2: Vector3<f64>,
    /// Specific force at the centre of gravity without bias as last read, body axes, m/s^2.
    pub specific_force_m_s2: Vector3<f64>,
    /// The bias that was taken off, m/s^2.
    pub accel_bias_m_s2: Vector3<f64>,
    /// Its standard deviation, m/s^2.
    pub accel_bias_sigma_m_s2: Vector3<f64>,
    /// Derivative of the specific force, body axes, m/s^3.
    pub specific_force_dot_m_s3: Vector3<f64>,
    /// Sideslip angle in the horizontal plane (ISO 8855), rad.
    pub sideslip_rad: f64,
    /// Its standard deviation, rad.
    pub sideslip_sigma_rad: f64,
    /// Whether an inertial unit measures rates and forces.
    pub inertial: bool,
    /// Age of its last reading, s.
    pub inertial_age_s: f64,
}

impl MotionState {
    /// Velocity along and left of the heading, in the horizontal plane, m/s.
    #[must_use]
    pub fn level_velocity(&self) -> [f64; 2] {
        let earth = self.earth_from_body * self.velocity_m_s;
        let (sine, cosine) = math::sin_cos(self.euler_rad().2);
        [
            cosine * earth.x + sine * earth.y,
            cosine * earth.y - sine * earth.x,
        ]
    }

    /// Roll, pitch and yaw, rad.
    #[must_use]
    pub fn euler_rad(&self) -> (f64, f64, f64) {
        self.earth_from_body.euler_angles()
    }
}
