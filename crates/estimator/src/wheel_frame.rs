//! The two frames in which the forces of a tyre are given: the wheel-carrier frame, in which the force
//! filter estimates them, and the contact frame.
//!
//! The members of a linkage measure the force in vehicle axes. The normal of the ground only names its
//! parts in the contact frame, so that an unknown normal makes those uncertain and the parts in the
//! wheel-carrier frame not.

use nalgebra::{Matrix3, Vector3};
use sample::{TyreForce, WheelAxes};

use crate::corners::{CornerState, FrameErrors};
use crate::gaussian::Gaussian;

/// Moment of the ground on a tyre about the contact point, wheel-carrier frame, N m.
pub type ContactMoment = [Gaussian; 3];

/// Axes of one wheel at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct WheelFrame {
    carrier_from_contact: Matrix3<f64>,
    /// Contact point from the wheel centre, wheel-carrier frame, m.
    arm_m: Vector3<f64>,
    errors: FrameErrors,
    moment: Option<ContactMoment>,
}

/// One tyre force in both frames.
#[derive(Clone, Copy, Debug)]
pub struct InFrames {
    /// Wheel-carrier frame, with the moment about the wheel centre.
    pub carrier: TyreForce,
    /// Contact frame.
    pub contact: TyreForce,
    /// The same with the unknown normal of the ground in its standard deviations.
    pub reported: TyreForce,
}

impl WheelFrame {
    /// Axes of a wheel.
    pub fn new(corner: &CornerState, errors: FrameErrors, moment: Option<ContactMoment>) -> Self {
        let axes = WheelAxes::carrier(corner.pose.spindle.into());
        let carrier_from_body = Matrix3::from_fn(|row, column| axes.rows()[row][column]);
        let arm = corner.frame.contact_m - corner.pose.wheel_centre_m;
        Self {
            carrier_from_contact: carrier_from_body * corner.frame.vehicle_from_tyre,
            arm_m: carrier_from_body * arm,
            errors,
            moment,
        }
    }

    /// A force that was estimated in the wheel-carrier frame.
    #[must_use]
    pub fn of_carrier(&self, own: &TyreForce) -> InFrames {
        let contact = self
            .errors
            .widen(&turned(&self.carrier_from_contact.transpose(), own));
        InFrames {
            carrier: self.with_moment(&self.errors.turn(own)),
            contact,
            reported: self.errors.tilt(&contact),
        }
    }

    /// A force that was estimated in the contact frame.
    #[must_use]
    pub fn of_contact(&self, own: &TyreForce) -> InFrames {
        let contact = self.errors.widen(own);
        InFrames {
            carrier: self.with_moment(&turned(&self.carrier_from_contact, &contact)),
            contact,
            reported: self.errors.tilt(&contact),
        }
    }

    /// The force with its moment about the wheel centre, M = m + a × F (a: contact point from wheel centre).
    fn with_moment(&self, force: &TyreForce) -> TyreForce {
        let (moment, variance) = match &self.moment {
            Some(own) if force.force_n.iter().all(|n| n.is_finite()) => {
                let variance = Vector3::from(force.sigma_n).map(|sigma| sigma * sigma);
                self.about_centre(own, force.force_n.into(), variance)
            }
            _ => (Vector3::repeat(f64::NAN), Vector3::repeat(f64::NAN)),
        };
        TyreForce {
            moment_n_m: moment.into(),
            moment_sigma_n_m: variance.map(f64::sqrt).into(),
            ..*force
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
        let lever = self.arm_m.cross_matrix();
        let mean = Vector3::from_fn(|i, _| own[i].mean) + lever * force;
        let shift_m = self.arm_m.norm() * self.errors.tilt_rad;
        let shifted = Vector3::new(force.z, force.z, math::hypot(force.x, force.y)) * shift_m;
        let variance = Vector3::from_fn(|i, _| own[i].variance)
            + squared(&lever) * variance
            + shifted.component_mul(&shifted);
        (mean, variance)
    }
}

/// A force in turned axes. The errors of the three parts are taken as independent, and unknown parts stay
/// unknown.
fn turned(turn: &Matrix3<f64>, own: &TyreForce) -> TyreForce {
    let is_known = own.force_n.map(f64::is_finite);
    let part = |i: usize, value: f64| if is_known[i] { value } else { 0.0 };
    let force = turn * Vector3::from_fn(|i, _| part(i, own.force_n[i]));
    let variance = squared(turn) * Vector3::from_fn(|i, _| part(i, own.sigma_n[i].powi(2)));
    let known = |values: Vector3<f64>| -> [f64; 3] {
        std::array::from_fn(|i| if is_known[i] { values[i] } else { f64::NAN })
    };
    TyreForce {
        force_n: known(force),
        sigma_n: known(variance.map(f64::sqrt)),
        source: own.source,
        ..TyreForce::default()
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
            errors: FrameErrors {
                tilt_rad: 0.01,
                ..FrameErrors::default()
            },
            moment,
        }
    }

    #[test]
    fn a_force_is_turned_and_its_moment_taken_about_the_centre() {
        let moment = [1.0, 2.0, 3.0].map(|mean| Gaussian::new(mean, 4.0));
        let force = TyreForce {
            force_n: [10.0, 100.0, 1000.0],
            sigma_n: [1.0, 4.0, 2.0],
            source: ForceSource::Fusion,
            ..TyreForce::default()
        };
        let frame = leaning(Some(moment));
        let found = frame.of_contact(&force);
        let (sin, cos) = math::sin_cos(0.1);
        let expected = [10.0, cos * 100.0 + sin * 1000.0, cos * 1000.0 - sin * 100.0];
        for (found, expected) in found.carrier.force_n.into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
        let lateral = (16.0 * cos * cos + 4.0 * sin * sin).sqrt();
        assert!(
            (found.carrier.sigma_n[1] - lateral).abs() < 1e-9,
            "{found:?}"
        );
        // In the contact frame the lateral force is sure to the tilt of a load of 1000 N as well.
        assert!((found.reported.sigma_n[1] - math::hypot(4.0, 10.0)).abs() < 1e-9);
        assert!((found.carrier.moment_n_m[0] - (1.0 + 0.3 * expected[1])).abs() < 1e-9);
        assert!(
            found.carrier.moment_sigma_n_m[0] > 0.3 * 0.01 * 990.0,
            "{found:?}"
        );
        let back = frame.of_carrier(&found.carrier);
        for (found, expected) in back.contact.force_n.into_iter().zip(force.force_n) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
    }

    #[test]
    fn a_load_alone_stays_alone() {
        let force = TyreForce {
            force_n: [f64::NAN, f64::NAN, 1000.0],
            sigma_n: [f64::NAN, f64::NAN, 5.0],
            source: ForceSource::Deflection,
            ..TyreForce::default()
        };
        let found = leaning(None).of_contact(&force).carrier;
        assert!(found.force_n[0].is_nan() && found.sigma_n[1].is_nan());
        assert!((found.force_n[2] - 995.0).abs() < 0.1, "{found:?}");
        assert!(found.moment_n_m.iter().all(|m| m.is_nan()));
    }
}
