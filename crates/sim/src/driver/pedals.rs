//! Speed control.

use model::vehicle::Vehicle;
use sample::STANDARD_GRAVITY_M_S2;

use super::STEP_S;

/// Speed control: acceleration for a speed error, 1/s, and for its integral, 1/s^2.
const SPEED_GAIN: f64 = 1.5;
const SPEED_INTEGRAL: f64 = 0.4;
/// How fast a foot follows, s.
const FOOT_S: f64 = 0.12;
/// Below this speed a driver who wants to stand holds the brake, m/s.
const STANDING_M_S: f64 = 0.05;

/// The driver's feet.
#[derive(Default)]
pub(super) struct Pedals {
    speed_integral_m: f64,
    /// Acceleration that the pedals stand for now, m/s^2.
    pedal_m_s2: f64,
}

impl Pedals {
    /// Drive and brake torque of each wheel, N m, for the speed wanted now and a step later, in the
    /// direction of the gear.
    pub(super) fn torques(
        &mut self,
        vehicle: &Vehicle,
        wanted_m_s: [f64; 2],
        speed_m_s: f64,
        radius_m: f64,
    ) -> [[f64; 4]; 2] {
        let [wanted, wanted_next] = wanted_m_s;
        let error_m_s = wanted - speed_m_s;
        let planned_m_s2 = (wanted_next - wanted) / STEP_S;
        // The integral learns resistance while cruising, not the lag of a launch.
        if planned_m_s2.abs() < 1.0 {
            self.speed_integral_m += error_m_s * STEP_S;
        }
        let mass_kg = vehicle.body.mass_kg;
        let demand_m_s2 = planned_m_s2
            + SPEED_GAIN * error_m_s
            + SPEED_INTEGRAL * self.speed_integral_m
            + vehicle.front.tyre.rolling_resistance * STANDARD_GRAVITY_M_S2;
        self.pedal_m_s2 += (demand_m_s2 - self.pedal_m_s2) * STEP_S / FOOT_S;
        let torque_n_m = mass_kg * self.pedal_m_s2 * radius_m;
        let drivetrain = &vehicle.drivetrain;
        let standing = wanted == 0.0 && speed_m_s.abs() < STANDING_M_S;
        let (drive_n_m, brake_n_m) = if standing {
            (0.0, 0.5 * mass_kg * radius_m)
        } else {
            (torque_n_m.max(0.0), (-torque_n_m).max(0.0))
        };
        let part = |wheel: usize, front: f64| 0.5 * if wheel < 2 { front } else { 1.0 - front };
        [
            std::array::from_fn(|wheel| drive_n_m * part(wheel, drivetrain.drive_split_front)),
            std::array::from_fn(|wheel| brake_n_m * part(wheel, drivetrain.brake_split_front)),
        ]
    }
}
