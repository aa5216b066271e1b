//! What one step of the estimator feeds back to the next.

use nalgebra::Vector3;
use sample::{PerWheel, TyreForce};

use crate::gaussian::Gaussian;

/// Results of the last step that the next step uses.
#[derive(Clone, Copy, Debug, Default)]
pub struct EstimatorFeedback {
    /// Measured tyre forces.
    pub forces: PerWheel<TyreForce>,
    /// The struts.
    pub struts: [StrutEstimate; 4],
    /// Motion of the centre of gravity from the sum of all tyre forces; less noisy than the
    /// inertial unit's. `None` while the inertial unit is silent or contradicts the forces.
    pub body_motion: Option<BodyMotionEstimate>,
    /// Angular acceleration of the body from the balance of moments, body axes, rad/s². The derivative of
    /// the gyros is late and noisy. `None` while the inertial unit does not agree with the balances, and for
    /// a vehicle that stands.
    pub rate_dot_rad_s2: Option<Vector3<f64>>,
    /// Error of the front wheels' steer angle: how much further left they point than the steering
    /// wheel's zero states, rad.
    pub steer_offset_rad: f64,
    /// Steering-wheel angle that the front axle's lateral force implies, rad.
    pub steering_wheel: Option<Gaussian>,
    /// Whether the balances of forces and moments confirm the inertial unit.
    pub imu_consistent: bool,
}

/// Estimate of a strut beside its potentiometer, for the pose of the linkage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StrutEstimate {
    /// Length by the hard-points, m, and rate, m/s, that the force filter expects at the next step; `None`
    /// before it has settled.
    pub moved: Option<[f64; 2]>,
}

/// Acceleration of the body as the sum of all tyre forces gives it for the next step, body axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BodyMotionEstimate {
    /// Specific force of the centre of gravity, m/s².
    pub specific_force_m_s2: Vector3<f64>,
    /// Angular acceleration, rad/s².
    pub rate_dot_rad_s2: Vector3<f64>,
}
