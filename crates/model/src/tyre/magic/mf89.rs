use super::sine;
use crate::Scalar;
use crate::tyre::{Contact, Forces};

/// Coefficients a_1 to a_13 of one direction of the Magic Formula of 1987/89, for F_z in kN,
/// angles in degrees and slip in percent, as published.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients89(pub [f64; 13]);

/// The Magic Formula of Bakker, Nyborg and Pacejka (SAE 870421, 890087); the "Pacejka 94" of
/// simulators has the same form.
///
/// Lateral, F in kN and angles in degrees: C = 1.3, D = a_1 F^2 + a_2 F,
/// BCD = a_3 sin(a_4 atan(a_5 F)) (1 - a_12 |gamma|), E = a_6 F^2 + a_7 F + a_8, S_h = a_9 gamma,
/// S_v = (a_10 F^2 + a_11 F) gamma. Longitudinal and aligning:
/// BCD = (a_3 F^2 + a_4 F) exp(-a_5 F). The published force is positive for a positive angle; its
/// sign is turned here. Combined slip by the friction ellipse, F_y = F_y0 sqrt(1 - (F_x/D_x)^2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MagicFormula89 {
    /// Side force.
    pub lateral: Coefficients89,
    /// Brake and drive force.
    pub longitudinal: Coefficients89,
    /// Aligning moment.
    pub aligning: Coefficients89,
}

impl Default for MagicFormula89 {
    /// The tyre of SAE 870421, table 2: D = -22.1 F^2 + 1011 F, BCD = 1078 sin(1.82 atan(0.208 F)),
    /// E = -0.354 F + 0.707.
    fn default() -> Self {
        Self {
            lateral: Coefficients89([
                -22.1, 1011.0, 1078.0, 1.82, 0.208, 0.0, -0.354, 0.707, 0.028, 0.0, 14.8, 0.022,
                0.0,
            ]),
            longitudinal: Coefficients89([
                -21.3, 1144.0, 49.6, 226.0, 0.069, -0.006, 0.056, 0.486, 0.0, 0.0, 0.0, 0.0, 0.0,
            ]),
            aligning: Coefficients89([
                -2.72, -2.28, -1.86, -2.73, 0.110, -0.070, 0.643, -4.04, 0.015, -0.066, 0.945,
                0.030, 0.070,
            ]),
        }
    }
}

/// Shape factors C of the three curves.
const LATERAL_SHAPE: f64 = 1.30;
const LONGITUDINAL_SHAPE: f64 = 1.65;
const ALIGNING_SHAPE: f64 = 2.40;

impl MagicFormula89 {
    pub(in crate::tyre) fn forces<T: Scalar>(&self, contact: &Contact<T>) -> Forces<T> {
        let load = contact.load_n / 1000.0;
        let angle = contact.slip_tangent.arctangent() * 1f64.to_degrees();
        let camber = contact.camber_rad * 1f64.to_degrees();
        let tilt = camber.magnitude();
        let (grip, stiff) = (contact.friction_scale, contact.stiffness_scale);

        let Coefficients89(a) = self.lateral;
        let peak = quadratic(load, a[0], a[1]) * grip;
        let slope =
            ((load * a[4]).arctangent() * a[3]).sine() * a[2] * (-tilt * a[11] + 1.0) * stiff;
        let bend = quadratic(load, a[5], a[6]) + a[7];
        let b = slope / (peak * LATERAL_SHAPE);
        let side = sine(b, LATERAL_SHAPE, peak, bend, angle + camber * a[8])
            + quadratic(load, a[9], a[10]) * camber;

        let Coefficients89(x) = self.longitudinal;
        let most = quadratic(load, x[0], x[1]) * grip;
        let slope = quadratic(load, x[2], x[3]) * (-load * x[4]).exponential() * stiff;
        let bend = quadratic(load, x[5], x[6]) + x[7];
        let b = slope / (most * LONGITUDINAL_SHAPE);
        let pull = sine(
            b,
            LONGITUDINAL_SHAPE,
            most,
            bend,
            contact.slip_ratio * 100.0,
        );

        let Coefficients89(z) = self.aligning;
        let peak = quadratic(load, z[0], z[1]) * grip;
        let slope = quadratic(load, z[2], z[3])
            * (-load * z[4]).exponential()
            * stiff
            * (-tilt * z[9] + 1.0);
        let bend = (quadratic(load, z[5], z[6]) + z[7]) / (-tilt * z[12] + 1.0);
        let b = slope / (peak * ALIGNING_SHAPE);
        let turn = sine(b, ALIGNING_SHAPE, peak, bend, angle + camber * z[8])
            + quadratic(load, z[10], z[11]) * camber;

        let part = pull / most;
        let left = (-part * part + 1.0).at_least(0.0);
        let weight = if left > 0.0 { left.sqrt() } else { left };
        Forces {
            longitudinal_n: pull,
            lateral_n: -side * weight,
            aligning_n_m: -turn * weight,
        }
    }
}

fn quadratic<T: Scalar>(load: T, two: f64, one: f64) -> T {
    load * (load * two + one)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tyre::Tyre;

    #[test]
    fn side_force_meets_the_check_value() {
        let tyre = Tyre::MagicFormula89(Box::default());
        let forces = tyre.forces(&Contact::lateral(4000.0, 4.0_f64.to_radians()));
        assert!((forces.lateral_n + 3096.609).abs() < 5.1e-4, "{forces:?}");
    }

    #[test]
    fn the_aligning_moment_turns_the_wheel_into_its_slip_and_braking_costs_side_force() {
        let tyre = Tyre::MagicFormula89(Box::default());
        let free = tyre.forces(&Contact::lateral(4000.0, 0.05));
        assert!(
            free.aligning_n_m > 0.0 && free.aligning_n_m < 200.0,
            "{free:?}"
        );
        let braked = tyre.forces(&Contact::combined(4000.0, 0.05, -0.1));
        assert!(braked.longitudinal_n < -3000.0 && braked.lateral_n > 0.8 * free.lateral_n);
    }
}
