//! Tyre moments about the contact point from the tyre force, and their errors.

use nalgebra::Vector3;

use super::Fusion;
use super::body::Body;
use super::layout::{FORCE, MOMENT};
use crate::corners::CornerState;
use crate::gaussian::Gaussian;
use crate::tuning::MomentTuning;

/// A tyre's moment about the contact point, wheel-carrier frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct KnownMoment {
    /// Moment without rolling resistance, N m.
    pub moment_n_m: Vector3<f64>,
    /// Standard deviations of the remaining M_x and M_z, N m.
    pub sigma_n_m: [f64; 2],
}

impl Body {
    /// Initial standard deviations of M_x and M_z, N m.
    pub(super) fn moment_sigma_n_m(&self, wheel: usize, tuning: &MomentTuning) -> [f64; 2] {
        let treaded = self.tyres[wheel].width_m > 0.0;
        let tipping = if treaded {
            tuning.sigma_n_m
        } else {
            tuning.untreaded_sigma_n_m
        };
        [tipping, tuning.sigma_n_m]
    }
}

impl Fusion {
    /// Moment of the ground on a tyre about the contact point, wheel-carrier frame: of tread, trail and rolling
    /// resistance, with the estimated rest of M_x and M_z.
    #[must_use]
    pub fn moment(&self, wheel: usize, corner: &CornerState, speed_m_s: f64) -> [Gaussian; 3] {
        let known = self.known_moment(wheel, corner, speed_m_s).moment_n_m;
        let load_n = self.state[FORCE + 3 * wheel + 2];
        let rolling = -self.body.rolling[wheel] * speed_m_s.clamp(-1.0, 1.0) * load_n;
        let with_rest = |known: f64, i: usize| {
            let at = MOMENT + 2 * wheel + i;
            let variance = self.covariance.variance(at).max(0.0);
            Gaussian::new(known + self.state[at], variance)
        };
        [
            with_rest(known.x, 0),
            Gaussian::new(known.y + rolling, rolling * rolling),
            with_rest(known.z, 1),
        ]
    }

    /// Moment that belongs to the force of the last step: M_x of the cambered tread, and M_z = -n
    /// F_y of a rolling wheel with a trail n of one sixth of the contact length that vanishes as
    /// the tyre begins to slide (brush model). The trail of a standing wheel is not known: its side force
    /// can come from the drive before, from steering, or from springs that settle.
    pub(super) fn known_moment(
        &self,
        wheel: usize,
        corner: &CornerState,
        speed_m_s: f64,
    ) -> KnownMoment {
        let normal = corner.frame.vehicle_from_tyre.column(2).into_owned();
        let inclination = math::asin(corner.pose.spindle.dot(&normal).clamp(-1.0, 1.0));
        let tyre = &self.body.tyres[wheel];
        let lateral = self.state[FORCE + 3 * wheel + 1];
        let load = self.pressing_n(wheel);
        let pressed = load / tyre.vertical_stiffness_n_m.max(1.0);
        let contact = 2.0 * (2.0 * tyre.unloaded_radius_m * pressed).sqrt();
        let sliding = lateral.abs() / (tyre.friction * load).max(1.0);
        let rolls = speed_m_s.abs().min(1.0);
        let whole_trail = contact / 6.0 * rolls;
        let trail = whole_trail * (1.0 - sliding).max(0.0);
        let tipping = -tyre.tread_moment_n_m(load, inclination);
        let turning = -trail * lateral;
        let lifted = 1.0 - tyre.tread_carrying(load, inclination);
        let t = &self.tuning.moments;
        let rolling_error = math::hypot(
            t.trail_error * turning,
            t.friction_error * sliding.min(1.0) * whole_trail * lateral,
        );
        let standing_error = t.standing_trail * (1.0 - rolls) * contact / 6.0 * lateral;
        let errors = [
            (t.tread_error + t.tread_lifted_error * lifted) * tipping,
            math::hypot(rolling_error, standing_error),
        ];
        let mut unknown = self.body.moment_sigma_n_m(wheel, t);
        if corner.matrix_axes.is_some() {
            // The wheel leans by an unknown angle, and its contact point is beside that of the matrix.
            let beside_m = corner.unknown_rad[1] * tyre.unloaded_radius_m;
            unknown[0] = math::hypot(unknown[0], beside_m * load);
        }
        KnownMoment {
            moment_n_m: Vector3::new(tipping, 0.0, turning),
            sigma_n_m: std::array::from_fn(|i| math::hypot(unknown[i], errors[i])),
        }
    }
}
