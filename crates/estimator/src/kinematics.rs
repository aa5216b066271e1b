//! The reported motion, from the state of the motion filter.

use model::vehicle::Vehicle;
use nalgebra::Vector3;
use sample::{Motion, PerWheel, STANDARD_GRAVITY_M_S2, Wheel};

use crate::corners::Corners;
use crate::motion::{MotionState, wrap};

/// Speed below which a slip angle is reported as zero, m/s.
const SLIP_SPEED_MIN_M_S: f64 = 0.5;

/// The motion without bank, grade and slip angles.
pub fn motion(state: &MotionState) -> Motion {
    let (roll, pitch, _) = state.euler_rad();
    let gravity = state.earth_from_body.inverse() * Vector3::z() * STANDARD_GRAVITY_M_S2;
    let force = state.specific_force_m_s2 + state.specific_force_dot_m_s3 * state.inertial_age_s;
    Motion {
        velocity_x_m_s: state.velocity_m_s.x,
        velocity_y_m_s: state.velocity_m_s.y,
        sideslip_rad: state.sideslip_rad,
        sideslip_sigma_rad: state.sideslip_sigma_rad,
        roll_rad: roll,
        pitch_rad: pitch,
        rate_rad_s: state.rate_rad_s.into(),
        acceleration_m_s2: (force - gravity).into(),
        ..Motion::default()
    }
}

/// Slip angle of each wheel of a vehicle with linkages, rad: direction of the wheel centre's
/// velocity over the ground, with yaw, roll and the linkage's travel.
pub fn slip_angles_on(corners: &Corners, state: &MotionState) -> PerWheel<f64> {
    PerWheel::from_fn(|wheel: Wheel| {
        let [along, across] = corners.wheel_velocity(wheel.index(), state);
        direction(along, across).unwrap_or(0.0)
    })
}

fn direction(along_m_s: f64, across_m_s: f64) -> Option<f64> {
    let moves = math::hypot(along_m_s, across_m_s) >= SLIP_SPEED_MIN_M_S;
    moves.then(|| math::atan2(across_m_s, along_m_s))
}

/// Slip angle of each wheel whose steer angle is `steer_rad`, rad, of a vehicle that neither rolls
/// nor pitches.
pub fn slip_angles(vehicle: &Vehicle, state: &MotionState, steer_rad: [f64; 4]) -> PerWheel<f64> {
    let [u, v] = state.level_velocity();
    let yaw_rate = state.rate_rad_s.z;
    PerWheel::from_fn(|wheel: Wheel| {
        let [x, y] = vehicle.wheel_place_m(wheel);
        direction(u - yaw_rate * y, v + yaw_rate * x)
            .map_or(0.0, |angle| wrap(angle - steer_rad[wheel.index()]))
    })
}

/// Roll and pitch of the body against the ground whose normal is given in body axes, rad.
pub fn ground_angles(normal: Vector3<f64>) -> (f64, f64) {
    (
        math::atan2(normal.y, normal.z),
        math::atan2(-normal.x, math::hypot(normal.y, normal.z)),
    )
}
