//! Ground that is a plane, but not level.

use nalgebra::{Rotation3, Vector3};
use sample::STANDARD_GRAVITY_M_S2;

use crate::TruthState;

/// A slope. What is driven on it is driven in its own axes, which lie on it as east, north and up
/// do on level ground, and [laid](Self::lay) on it at the end.
pub(crate) struct Slope {
    earth_from_ground: Rotation3<f64>,
}

impl Slope {
    /// The plane that level ground becomes by a turn about an axis along the ground: its parts about
    /// east (the north side rises) and about north (the east side falls), rad.
    pub(crate) fn turned(about_east_rad: f64, about_north_rad: f64) -> Self {
        Self {
            earth_from_ground: Rotation3::new(Vector3::new(about_east_rad, about_north_rad, 0.0)),
        }
    }

    /// Bank and grade of the ground for a heading on it, rad: right side down and nose down positive.
    pub(crate) fn bank_grade_rad(&self, yaw_rad: f64) -> [f64; 2] {
        let heading = self.earth_from_ground * Rotation3::from_euler_angles(0.0, 0.0, yaw_rad);
        let (bank_rad, grade_rad, _) = heading.euler_angles();
        [bank_rad, grade_rad]
    }

    /// Lays a state of the ground's axes on the slope.
    pub(crate) fn lay(&self, state: &mut TruthState) {
        [state.bank_rad, state.grade_rad] = self.bank_grade_rad(state.yaw_rad);
        let ground_from_body =
            Rotation3::from_euler_angles(state.roll_rad, state.pitch_rad, state.yaw_rad);
        let earth_from_body = self.earth_from_ground * ground_from_body;
        let (roll_rad, pitch_rad, yaw_rad) = earth_from_body.euler_angles();
        (state.roll_rad, state.pitch_rad) = (roll_rad, pitch_rad);
        let turn = std::f64::consts::TAU;
        state.yaw_rad = yaw_rad + turn * ((state.yaw_rad - yaw_rad) / turn).round();
        let position = self.earth_from_ground * Vector3::from(state.position_m);
        state.position_m = position.into();
        let up = earth_from_body.inverse() * Vector3::z();
        let gravity = up * STANDARD_GRAVITY_M_S2;
        state.acceleration_m_s2 = (Vector3::from(state.specific_force_m_s2) - gravity).into();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_north_side_that_rises_banks_who_drives_east_and_grades_who_drives_north() {
        let slope = Slope::turned(0.1, 0.0);
        let quarter = std::f64::consts::FRAC_PI_2;
        for (yaw_rad, bank_rad, grade_rad) in [(0.0, 0.1, 0.0), (quarter, 0.0, -0.1)] {
            let [bank, grade] = slope.bank_grade_rad(yaw_rad);
            assert!((bank - bank_rad).abs() < 1e-12, "{bank}");
            assert!((grade - grade_rad).abs() < 1e-12, "{grade}");
        }
    }

    #[test]
    fn who_stands_on_a_slope_does_not_accelerate() {
        let slope = Slope::turned(0.1, -0.07);
        let yaw_rad = 7.0;
        let [bank, grade] = slope.bank_grade_rad(yaw_rad);
        let up = [
            -math::sin(grade),
            math::sin(bank) * math::cos(grade),
            math::cos(bank) * math::cos(grade),
        ];
        let mut state = TruthState {
            yaw_rad,
            specific_force_m_s2: up.map(|part| part * STANDARD_GRAVITY_M_S2),
            ..TruthState::default()
        };
        slope.lay(&mut state);
        assert!(state.acceleration_m_s2.iter().all(|a| a.abs() < 1e-12));
        assert!((state.yaw_rad - yaw_rad).abs() < 0.02);
        assert!((state.roll_rad - bank).abs() < 1e-12 && (state.pitch_rad - grade).abs() < 1e-12);
    }
}
