//! Tyres made of two stiffnesses and a friction coefficient.

use super::{Contact, Forces, Stiffness, brush_over_linear, friction_ellipse};
use crate::{Scalar, vehicle};

/// How force grows with slip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// F = C s without limit (equations 2.3, 2.4 and 2.28, the last with its sign put right).
    Linear,
    /// Fiala's parabola, combined slip as MSC Adams and Project Chrono have it: each direction on
    /// its own, the friction falling with comprehensive slip, the sum kept inside of the friction
    /// circle.
    Fiala,
    /// Fiala's parabola along the resulting slip: equal to [`Law::Fiala`] in pure lateral slip,
    /// opposed to the slip velocity in combined slip.
    Brush,
    /// F = mu F_z (1 - exp(-C s/(mu F_z))) along the resulting slip. The thesis names this and
    /// Fiala's as one model; they differ.
    Exponential,
    /// Dugoff.
    Dugoff,
}

/// A tyre given by stiffnesses and friction.
///
/// | symbol | field | unit |
/// |---|---|---|
/// | C_alpha | `cornering` | N/rad |
/// | C_kappa | `slip` | N |
/// | mu, mu_min | `friction`, `sliding_friction` | - |
/// | C_gamma | `camber_stiffness_n_rad` | N/rad |
/// | 2 a | `contact_length_m` | m |
#[derive(Clone, Debug, PartialEq)]
pub struct Physical {
    /// Force law.
    pub law: Law,
    /// Cornering stiffness.
    pub cornering: Stiffness,
    /// Longitudinal slip stiffness.
    pub slip: Stiffness,
    /// Friction coefficient mu.
    pub friction: f64,
    /// Friction coefficient at full sliding, for [`Law::Fiala`].
    pub sliding_friction: f64,
    /// Camber stiffness: a thrust -C_gamma gamma is added inside of the friction circle.
    pub camber_stiffness_n_rad: f64,
    /// Length that scales the aligning moment, m (Adams' tyre width).
    pub contact_length_m: f64,
}

impl Physical {
    /// A tyre with the stiffnesses and friction of a vehicle file. The contact
    /// length is zero, so there is no aligning moment: cornering stiffnesses that were identified
    /// on a vehicle, as those of figure 2.23, already hold the pneumatic trail's effect.
    #[must_use]
    pub fn from_vehicle(tyre: &vehicle::Tyre, law: Law) -> Self {
        let power = |at_reference| {
            if tyre.load_exponent == 0.0 {
                Stiffness::Constant(at_reference)
            } else {
                Stiffness::Power {
                    at_reference,
                    reference_load_n: tyre.reference_load_n,
                    exponent: tyre.load_exponent,
                }
            }
        };
        Self {
            law,
            cornering: power(tyre.cornering_stiffness_n_rad),
            slip: power(tyre.slip_stiffness_n),
            friction: tyre.friction,
            sliding_friction: tyre.friction,
            camber_stiffness_n_rad: tyre.camber_stiffness_n_rad,
            contact_length_m: 0.0,
        }
    }

    /// Force and aligning moment under a load above zero.
    #[inline]
    pub(super) fn forces<T: Scalar>(&self, contact: &Contact<T>) -> Forces<T> {
        let load = contact.load_n;
        let grip = load * contact.friction_scale * self.friction;
        // Linear force that the slip would give: along x, and along -y.
        let cornering = self.cornering.at(load);
        let slip = self.slip.beside(load, &self.cornering, cornering);
        let x = slip * contact.stiffness_scale * contact.slip_ratio;
        let y = cornering * contact.stiffness_scale * contact.slip_tangent;
        let (force, trail) = match self.law {
            Law::Linear => {
                let angle = contact.slip_tangent.arctangent();
                let stiffness = self.cornering.at(load) * contact.stiffness_scale;
                (
                    [x, -stiffness * angle],
                    T::from(self.contact_length_m / 6.0),
                )
            }
            Law::Fiala => self.fiala(contact, grip, x, y),
            Law::Brush => self.brush(grip, x, y),
            Law::Exponential => {
                let angle = contact.slip_tangent.arctangent();
                let lateral = self.cornering.at(load) * contact.stiffness_scale * angle;
                let scale = along(grip, x, lateral, |part| -(-part).exponential_less_one());
                ([x * scale, -lateral * scale], T::from(0.0))
            }
            Law::Dugoff => (dugoff(grip, contact.slip_ratio, x, y), T::from(0.0)),
        };
        let [longitudinal_n, mut lateral_n] = force;
        let aligning_n_m = -trail * lateral_n;
        if self.camber_stiffness_n_rad != 0.0 {
            lateral_n -= contact.camber_rad * self.camber_stiffness_n_rad;
            let [longitudinal_n, lateral_n] =
                friction_ellipse(longitudinal_n, lateral_n, [grip, grip]);
            return Forces {
                longitudinal_n,
                lateral_n,
                aligning_n_m,
            };
        }
        Forces {
            longitudinal_n,
            lateral_n,
            aligning_n_m,
        }
    }

    /// H = 1 - |G|/(3 mu F_z), F = mu F_z (1 - H^3) G/|G| with G = (C_kappa kappa, -C_alpha tan a).
    #[inline]
    fn brush<T: Scalar>(&self, grip: T, x: T, y: T) -> ([T; 2], T) {
        let square = x * x + y * y;
        if square <= grip * grip * 1e-24 {
            return ([x, -y], T::from(self.contact_length_m / 3.0));
        }
        let pull = square.sqrt();
        let part = pull / grip * (1.0 / 3.0);
        if part >= 1.0 {
            let scale = grip / pull;
            return ([x * scale, -y * scale], T::from(0.0));
        }
        let scale = brush_over_linear(part);
        if self.contact_length_m == 0.0 {
            return ([x * scale, -y * scale], T::from(0.0));
        }
        let h = -part + 1.0;
        // M_z of Adams: mu F_z w (1 - H) H^3 along the slip; as a trail, w (1-H) H^3/(1-H^3).
        let trail = h * h * h / (part * part - part * 3.0 + 3.0) * self.contact_length_m;
        ([x * scale, -y * scale], trail)
    }

    /// Fiala as in MSC Adams and Project Chrono:
    /// S = sqrt(kappa^2 + tan^2 a), U = mu - (mu - mu_min) min(S, 1);
    /// F_x = C_k kappa up to kappa* = U F_z/(2 C_k), then U F_z - (U F_z)^2/(4 |kappa| C_k);
    /// F_y = -U F_z (1 - H^3) sgn a with H = 1 - C_a |tan a|/(3 U F_z), sliding at H <= 0.
    #[inline]
    fn fiala<T: Scalar>(&self, contact: &Contact<T>, grip: T, x: T, y: T) -> ([T; 2], T) {
        let (slope, slip) = (contact.slip_tangent, contact.slip_ratio);
        let loss = 1.0 - self.sliding_friction / self.friction;
        let grip = if loss == 0.0 {
            grip
        } else {
            let comprehensive = (slip * slip + slope * slope).at_least(1e-300).sqrt();
            grip * (-comprehensive.at_most(1.0) * loss + 1.0)
        };
        let pull = x.magnitude();
        let longitudinal = if pull * 2.0 <= grip {
            x
        } else {
            (grip - grip * grip / (pull * 4.0)) * x.sign()
        };
        let (lateral, trail) = {
            let ([_, lateral], trail) = self.brush(grip, T::from(0.0), y);
            (lateral, trail)
        };
        (friction_ellipse(longitudinal, lateral, [grip, grip]), trail)
    }
}

/// Factor by which a law shortens the linear force G: mu F_z law(|G|/(mu F_z))/|G|.
#[inline]
fn along<T: Scalar>(grip: T, x: T, y: T, law: impl Fn(T) -> T) -> T {
    let square = (x * x + y * y) / (grip * grip);
    if square < 1e-20 {
        return T::from(1.0);
    }
    let part = square.sqrt();
    law(part) / part
}

/// X = C_k k/(1+k), Y = C_a tan a/(1+k), l = mu F_z/(2 sqrt(X^2+Y^2)), f = l (2-l) where l < 1;
/// (F_x, F_y) = (X, -Y) f. Written so that a locked wheel (k = -1) needs no division by zero.
#[inline]
fn dugoff<T: Scalar>(grip: T, slip: T, x: T, y: T) -> [T; 2] {
    let stretch = (slip + 1.0).at_least(0.0);
    let pull_square = x * x + y * y;
    let knee = grip * stretch * 0.5;
    if pull_square <= knee * knee {
        if stretch <= 0.0 {
            return [T::from(0.0); 2];
        }
        return [x / stretch, -y / stretch];
    }
    let pull = pull_square.sqrt();
    let lambda = knee / pull;
    let scale = grip * 0.5 * (-lambda + 2.0) / pull;
    [x * scale, -y * scale]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tyre::Tyre;

    fn tyre(law: Law, cornering: f64) -> Tyre {
        Tyre::Physical(Physical {
            law,
            cornering: Stiffness::Constant(cornering),
            slip: Stiffness::Constant(12_000.0),
            friction: 0.87,
            sliding_friction: 0.87,
            camber_stiffness_n_rad: 0.0,
            contact_length_m: 0.1,
        })
    }

    /// The notes' table of -F_y in N at mu = 0.87, printed to 1e-3 N.
    #[test]
    fn lateral_force_meets_the_check_values_to_their_printed_digits() {
        let cases = [
            (
                1327.0,
                2987.5,
                Law::Fiala,
                [101.215, 242.144, 450.719, 781.708, 1130.161],
            ),
            (
                1327.0,
                2987.5,
                Law::Brush,
                [101.215, 242.144, 450.719, 781.708, 1130.161],
            ),
            (
                1327.0,
                2987.5,
                Law::Exponential,
                [99.712, 233.368, 419.563, 686.649, 964.904],
            ),
            (
                1327.0,
                2987.5,
                Law::Dugoff,
                [104.326, 261.372, 526.777, 848.049, 1021.567],
            ),
            (
                1831.0,
                8538.0,
                Law::Fiala,
                [279.939, 636.303, 1081.017, 1524.829, 1592.970],
            ),
            (
                1831.0,
                8538.0,
                Law::Brush,
                [279.939, 636.303, 1081.017, 1524.829, 1592.970],
            ),
            (
                1831.0,
                8538.0,
                Law::Exponential,
                [271.813, 595.098, 967.881, 1347.682, 1555.200],
            ),
            (
                1831.0,
                8538.0,
                Law::Dugoff,
                [298.154, 746.978, 1171.584, 1388.828, 1504.421],
            ),
        ];
        for (load, cornering, law, expected) in cases {
            for (angle_deg, expected) in [2.0, 5.0, 10.0, 20.0, 40.0_f64].into_iter().zip(expected)
            {
                let forces =
                    tyre(law, cornering).forces(&Contact::lateral(load, angle_deg.to_radians()));
                assert!(
                    (-forces.lateral_n - expected).abs() < 5.1e-4,
                    "{law:?} {load} {angle_deg}: {} against {expected}",
                    -forces.lateral_n
                );
                let mirrored =
                    tyre(law, cornering).forces(&Contact::lateral(load, -angle_deg.to_radians()));
                assert_eq!(mirrored.lateral_n, -forces.lateral_n);
            }
        }
    }

    #[test]
    fn dugoff_combined_meets_its_check_value() {
        let contact = Contact::combined(1831.0, 5.0_f64.to_radians(), 0.05);
        let forces = tyre(Law::Dugoff, 8538.0).forces(&contact);
        assert!((forces.longitudinal_n - 562.194).abs() < 5e-4, "{forces:?}");
        assert!((forces.lateral_n + 699.911).abs() < 5e-4, "{forces:?}");
    }
}
