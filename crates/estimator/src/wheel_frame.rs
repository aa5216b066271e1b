//! From the contact frame, in which the forces are estimated, to the wheel-carrier frame, in which they
//! are reported.
//!
//! The members of a linkage measure the force in vehicle axes. The normal of the ground only names its
//! parts in the contact frame, so that an unknown normal makes those uncertain and the parts in the
//! wheel-carrier frame not.

use nalgebra::{Matrix3, Vector3};
use sample::{TyreForce, WheelAxes};

use crate::corners::CornerState;
use crate::gaussian::Gaussian;

/// Moment of the ground on a tyre about the contact point, contact frame, N m.
pub type ContactMoment = [Gaussian; 3];

/// Axes of one wheel at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct WheelFrame {
    carrier_from_contact: Matrix3<f64>,
    /// Contact point from the wheel centre, wheel-carrier frame, m.
    arm_m: Vector3<f64>,
    /// Standard deviation of the ground's normal about x and y, rad.
    tilt_sigma_rad: f64,
    /// Variances that the unknown normal adds to the forces in the contact frame, N^2.
    added_n2: [f64; 3],
    moment: Option<ContactMoment>,
}

impl WheelFrame {
    /// Axes of a wheel. `own` is its force in the contact frame, `reported` the same with the unknown
    /// normal in its standard deviations.
    pub fn new(
        corner: &CornerState,
        own: &TyreForce,
        reported: &TyreForce,
        tilt_sigma_rad: f64,
        moment: Option<ContactMoment>,
    ) -> Self {
        let axes = WheelAxes::carrier(corner.pose.spindle.into());
        let carrier_from_body = Matrix3::from_fn(|row, column| axes.rows()[row][column]);
        let arm = corner.frame.contact_m - corner.pose.wheel_centre_m;
        Self {
            carrier_from_contact: carrier_from_body * corner.frame.vehicle_from_tyre,
            arm_m: carrier_from_body * arm,
            tilt_sigma_rad,
            added_n2: std::array::from_fn(|i| {
                reported.sigma_n[i] * reported.sigma_n[i] - own.sigma_n[i] * own.sigma_n[i]
            }),
            moment,
        }
    }

    /// A force as it is reported in the contact frame, in the wheel-carrier frame, with the moment about
    /// the wheel centre M = T m + a × F (T: carrier from contact, a: contact point from wheel centre).
    /// The errors of the three parts are taken as independent.
    #[must_use]
    pub fn carrier(&self, reported: &TyreForce) -> TyreForce {
        let is_known = reported.force_n.map(f64::is_finite);
        let part = |i: usize, value: f64| if is_known[i] { value } else { 0.0 };
        let turn = &self.carrier_from_contact;
        let force = turn * Vector3::from_fn(|i, _| part(i, reported.force_n[i]));
        let variance = Vector3::from_fn(|i, _| {
            let own_n2 = reported.sigma_n[i] * reported.sigma_n[i] - self.added_n2[i];
            part(i, own_n2.max(0.0))
        });
        let variance = squared(turn) * variance;
        let known = |values: Vector3<f64>| -> [f64; 3] {
            std::array::from_fn(|i| if is_known[i] { values[i] } else { f64::NAN })
        };
        let (moment, moment_variance) = match &self.moment {
            Some(own) if is_known == [true; 3] => self.about_centre(own, force, variance),
            _ => (Vector3::repeat(f64::NAN), Vector3::repeat(f64::NAN)),
        };
        TyreForce {
            force_n: known(force),
            sigma_n: known(variance.map(f64::sqrt)),
            moment_n_m: moment.into(),
            moment_sigma_n_m: moment_variance.map(f64::sqrt).into(),
            source: reported.source,
        }
    }

    /// Moment about the wheel centre and its variances. A ground that is tilted by an unknown angle has
    /// its contact point elsewhere, |a| times the angle along x and y.
    fn about_centre(
        &self,
        own: &ContactMoment,
        force: Vector3<f64>,
        variance: Vector3<f64>,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let turn = &self.carrier_from_contact;
        let lever = self.arm_m.cross_matrix();
        let mean = turn * Vector3::from_fn(|i, _| own[i].mean) + lever * force;
        let shift_m = self.arm_m.norm() * self.tilt_sigma_rad;
        let shifted = Vector3::new(force.z, force.z, math::hypot(force.x, force.y)) * shift_m;
        let variance = squared(turn) * Vector3::from_fn(|i, _| own[i].variance)
            + squared(&lever) * variance
            + shifted.component_mul(&shifted);
        (mean, variance)
    }
}

/// The squares of a matrix's elements: they take variances of independent values over.
fn squared(matrix: &Matrix3<f64>) -> Matrix3<f64> {
    matrix.component_mul(matrix)
}

#[cfg(test)]
mod tests {
    use sample::ForceSource;

    use super::*;

    /// A wheel that leans by 0.1 rad, its contact point 0.3 m below the centre.
    fn leaning(moment: Option<ContactMoment>) -> WheelFrame {
        let (sin, cos) = math::sin_cos(0.1);
        WheelFrame {
            carrier_from_contact: Matrix3::new(1.0, 0.0, 0.0, 0.0, cos, sin, 0.0, -sin, cos),
            arm_m: Vector3::new(0.0, 0.0, -0.3),
            tilt_sigma_rad: 0.01,
            added_n2: [0.0, 3.0 * 3.0, 0.0],
            moment,
        }
    }

    #[test]
    fn a_force_is_turned_and_its_moment_taken_about_the_centre() {
        let moment = [1.0, 2.0, 3.0].map(|mean| Gaussian::new(mean, 4.0));
        let force = TyreForce {
            force_n: [10.0, 100.0, 1000.0],
            sigma_n: [1.0, 5.0, 2.0],
            source: ForceSource::Fusion,
            ..TyreForce::default()
        };
        let found = leaning(Some(moment)).carrier(&force);
        let (sin, cos) = math::sin_cos(0.1);
        let expected = [10.0, cos * 100.0 + sin * 1000.0, cos * 1000.0 - sin * 100.0];
        for (found, expected) in found.force_n.into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
        // Without the frame the lateral force is sure to 4 N.
        let lateral = (16.0 * cos * cos + 4.0 * sin * sin).sqrt();
        assert!((found.sigma_n[1] - lateral).abs() < 1e-9, "{found:?}");
        assert!((found.moment_n_m[0] - (1.0 + 0.3 * expected[1])).abs() < 1e-9);
        assert!(found.moment_sigma_n_m[0] > 0.3 * 0.01 * 990.0, "{found:?}");
    }

    #[test]
    fn a_load_alone_stays_alone() {
        let force = TyreForce {
            force_n: [f64::NAN, f64::NAN, 1000.0],
            sigma_n: [f64::NAN, f64::NAN, 5.0],
            source: ForceSource::Deflection,
            ..TyreForce::default()
        };
        let found = leaning(None).carrier(&force);
        assert!(found.force_n[0].is_nan() && found.sigma_n[1].is_nan());
        assert!((found.force_n[2] - 995.0).abs() < 0.1, "{found:?}");
        assert!(found.moment_n_m.iter().all(|m| m.is_nan()));
    }
}
