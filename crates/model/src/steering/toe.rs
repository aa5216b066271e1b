use serde::{Deserialize, Serialize};

use crate::vehicle::Vehicle;

/// Lateral force that moves a front wheel from the middle of its play to a contact, N. Assumed: the
/// friction of two ball joints at the lever of the caster trail.
pub const TOE_PLAY_FORCE_N: f64 = 50.0;

/// Compliance and play of the front wheels between the rack and the upright, left and right (thesis,
/// section 5.2.5, which names the play without an equation).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Toe {
    /// Angle by which the wheel yields to one newton of its lateral force, rad/N. Positive: a force
    /// to the left turns the wheel to the right.
    pub compliance_rad_n: [f64; 2],
    /// Play, rad, from one contact to the other.
    pub play_rad: [f64; 2],
}

impl Toe {
    /// Compliance and play of a vehicle file.
    #[must_use]
    pub fn of(vehicle: &Vehicle) -> Self {
        Self {
            compliance_rad_n: vehicle.steering.toe_compliance_rad_n,
            play_rad: vehicle.steering.toe_play_rad,
        }
    }

    /// Whether the wheels follow the rack exactly.
    #[must_use]
    pub fn is_rigid(&self) -> bool {
        *self == Self::default()
    }

    /// Steer angle of a front wheel (0 left, 1 right) beside the one that rack and linkage give, rad,
    /// left positive, under a lateral force F_y, N, left positive:
    ///
    /// delta = -c F_y - (p/2) clamp(F_y/F_p, -1, 1)
    ///
    /// | symbol | name | unit |
    /// |---|---|---|
    /// | c | compliance | rad/N |
    /// | p | play | rad |
    /// | F_p | [`TOE_PLAY_FORCE_N`] | N |
    #[must_use]
    pub fn angle_rad(&self, side: usize, lateral_n: f64) -> f64 {
        let in_play = (lateral_n / TOE_PLAY_FORCE_N).clamp(-1.0, 1.0);
        -self.compliance_rad_n[side] * lateral_n - 0.5 * self.play_rad[side] * in_play
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wheel_yields_to_its_force_and_crosses_its_play() {
        let toe = Toe {
            compliance_rad_n: [2e-5, 1e-5],
            play_rad: [0.01, 0.0],
        };
        // 1 kN to the left: 0.02 rad of compliance and half of the play, to the right.
        assert!((toe.angle_rad(0, 1000.0) + 0.025).abs() < 1e-15);
        assert!((toe.angle_rad(0, -1000.0) - 0.025).abs() < 1e-15);
        assert!((toe.angle_rad(1, 1000.0) + 0.01).abs() < 1e-15);
        // In the play, the wheel moves with the force.
        assert!((toe.angle_rad(0, 25.0) + 5e-4 + 2.5e-3).abs() < 1e-15);
        assert!(!toe.is_rigid() && Toe::default().is_rigid());
    }
}
