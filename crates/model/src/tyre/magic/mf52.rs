use super::{Side, Slopes, cosine, sine};
use crate::Scalar;
use crate::tyre::{Contact, Forces};

coefficients! {
    /// Coefficients of pure longitudinal slip.
    Longitudinal52 {
        pcx1 = 1.685, pdx1 = 1.21, pdx2 = -0.037, pdx3 = 0.0,
        pex1 = 0.344, pex2 = 0.095, pex3 = -0.02, pex4 = 0.0,
        pkx1 = 21.51, pkx2 = -0.163, pkx3 = 0.245,
        phx1 = -0.002, phx2 = 0.002, pvx1 = 0.0, pvx2 = 0.0,
    }
}
coefficients! {
    /// Coefficients of pure lateral slip.
    Lateral52 {
        pcy1 = 1.193, pdy1 = -0.99, pdy2 = 0.145, pdy3 = -11.23,
        pey1 = -1.003, pey2 = -0.537, pey3 = -0.083, pey4 = -4.787,
        pky1 = -14.95, pky2 = 2.13, pky3 = -0.028,
        phy1 = 0.003, phy2 = -0.001, phy3 = 0.075,
        pvy1 = 0.045, pvy2 = -0.024, pvy3 = -0.532, pvy4 = 0.039,
    }
}
coefficients! {
    /// Coefficients of combined slip.
    Combined52 {
        rbx1 = 12.35, rbx2 = -10.77, rcx1 = 1.092, rex1 = 0.0, rex2 = 0.0, rhx1 = 0.007,
        rby1 = 6.461, rby2 = 4.196, rby3 = -0.015, rcy1 = 1.081, rey1 = 0.0, rey2 = 0.0,
        rhy1 = 0.009, rhy2 = 0.0,
        rvy1 = 0.053, rvy2 = -0.073, rvy3 = 0.517, rvy4 = 35.44, rvy5 = 1.9, rvy6 = -10.71,
        ssz1 = 0.043, ssz2 = 0.001, ssz3 = 0.731, ssz4 = -0.238,
    }
}
coefficients! {
    /// Coefficients of the aligning moment.
    Aligning52 {
        qbz1 = 8.964, qbz2 = -1.106, qbz3 = -0.842, qbz4 = 0.0, qbz5 = -0.227,
        qbz9 = 18.47, qbz10 = 0.0, qcz1 = 1.18,
        qdz1 = 0.1, qdz2 = -0.001, qdz3 = 0.007, qdz4 = 13.05,
        qdz6 = -0.008, qdz7 = 0.0, qdz8 = -0.296, qdz9 = -0.009,
        qez1 = -1.609, qez2 = -0.359, qez3 = 0.0, qez4 = 0.174, qez5 = -0.896,
        qhz1 = 0.007, qhz2 = -0.002, qhz3 = 0.147, qhz4 = 0.004,
    }
}

/// The Magic Formula 5.2 with its weighting functions for combined slip (Pacejka, Tyre and Vehicle
/// Dynamics, 2nd edition, section 4.3.2). Its axes are ISO 8855's: P_KY1 < 0 makes a positive slip
/// angle give a negative force.
///
/// All scaling factors are 1, and F_y' = F_y - S_Vyk in the aligning moment is taken at the wheel's
/// own camber, as the 2nd edition has it (later ones take it upright).
///
/// The default coefficients are of the size of a passenger car's 205/60 R15; give a property
/// file's own for work that depends on them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MagicFormula52 {
    /// Nominal load F_z0, N.
    pub nominal_load_n: f64,
    /// Unloaded radius R_0, m.
    pub radius_m: f64,
    /// Pure longitudinal slip.
    pub longitudinal: Longitudinal52,
    /// Pure lateral slip.
    pub lateral: Lateral52,
    /// Combined slip.
    pub combined: Combined52,
    /// Aligning moment.
    pub aligning: Aligning52,
}

impl Default for MagicFormula52 {
    fn default() -> Self {
        Self {
            nominal_load_n: 4000.0,
            radius_m: 0.313,
            longitudinal: Longitudinal52::default(),
            lateral: Lateral52::default(),
            combined: Combined52::default(),
            aligning: Aligning52::default(),
        }
    }
}

impl MagicFormula52 {
    /// Names of the coefficients, in lower case.
    pub(in crate::tyre) fn names() -> impl Iterator<Item = &'static str> {
        let groups = [
            Longitudinal52::NAMES,
            Lateral52::NAMES,
            Combined52::NAMES,
            Aligning52::NAMES,
        ];
        groups.into_iter().flatten().copied()
    }

    /// The coefficient of a name in lower case, as property files have it (`pcx1`, `qhz4`); also
    /// `fnomin`, N, and `unloaded_radius`, m. `None` where there is none of that name.
    pub fn coefficient_mut(&mut self, name: &str) -> Option<&mut f64> {
        match name {
            "fnomin" => return Some(&mut self.nominal_load_n),
            "unloaded_radius" => return Some(&mut self.radius_m),
            _ => {}
        }
        self.longitudinal
            .named(name)
            .or_else(|| self.lateral.named(name))
            .or_else(|| self.combined.named(name))
            .or_else(|| self.aligning.named(name))
    }
}

impl MagicFormula52 {
    pub(in crate::tyre) fn slopes(&self, contact: &Contact<f64>) -> Slopes {
        let excess = (contact.load_n - self.nominal_load_n) / self.nominal_load_n;
        let side = self.side(contact, excess, 0.0);
        let c = &self.lateral;
        let lift = contact.load_n * (excess * c.pvy4 + c.pvy3);
        Slopes {
            slip: self.pull(contact, excess).1,
            cornering: -side.stiffness,
            camber: -(side.stiffness * c.phy3 + lift),
            friction: side.friction.abs(),
        }
    }

    pub(in crate::tyre) fn forces<T: Scalar>(&self, contact: &Contact<T>) -> Forces<T> {
        let load = contact.load_n;
        let excess = (load - self.nominal_load_n) / self.nominal_load_n;
        let angle = contact.slip_tangent.arctangent();
        let (pull, pull_stiffness) = self.pull(contact, excess);
        let side = self.side(contact, excess, angle);
        let longitudinal_n = self.pull_weight(contact, excess, angle) * pull;
        let extra = self.brake_side_force(contact, excess, angle, side.friction);
        let weighted = self.side_weight(contact, excess, angle) * side.force;
        let lateral_n = weighted + extra;
        let aligning_n_m = self.aligning(
            contact,
            excess,
            &side,
            pull_stiffness,
            [longitudinal_n, weighted, lateral_n],
        );
        Forces {
            longitudinal_n,
            lateral_n,
            aligning_n_m,
        }
    }

    /// F_x0 and K_x.
    fn pull<T: Scalar>(&self, contact: &Contact<T>, excess: T) -> (T, T) {
        let c = &self.longitudinal;
        let load = contact.load_n;
        let slip = contact.slip_ratio + excess * c.phx2 + c.phx1;
        let camber = contact.camber_rad;
        let friction =
            (excess * c.pdx2 + c.pdx1) * (-camber * camber * c.pdx3 + 1.0) * contact.friction_scale;
        let peak = load * friction;
        let bend = (excess * (excess * c.pex3 + c.pex2) + c.pex1) * (1.0 - c.pex4 * slip.sign());
        let stiffness = load
            * (excess * c.pkx2 + c.pkx1)
            * (excess * c.pkx3).exponential()
            * contact.stiffness_scale;
        let b = stiffness / (peak * c.pcx1);
        let lift = load * (excess * c.pvx2 + c.pvx1) * contact.friction_scale;
        (sine(b, c.pcx1, peak, bend, slip) + lift, stiffness)
    }

    fn side<T: Scalar>(&self, contact: &Contact<T>, excess: T, angle: T) -> Side<T> {
        let c = &self.lateral;
        let (load, camber) = (contact.load_n, contact.camber_rad);
        let friction =
            (excess * c.pdy2 + c.pdy1) * (-camber * camber * c.pdy3 + 1.0) * contact.friction_scale;
        let peak = load * friction;
        let stiffness = ((load / (c.pky2 * self.nominal_load_n)).arctangent() * 2.0).sine()
            * (c.pky1 * self.nominal_load_n)
            * (-camber.magnitude() * c.pky3 + 1.0)
            * contact.stiffness_scale;
        let shift = excess * c.phy2 + camber * c.phy3 + c.phy1;
        let slip = angle + shift;
        let bend = (excess * c.pey2 + c.pey1) * (-(camber * c.pey4 + c.pey3) * slip.sign() + 1.0);
        let lift = load
            * (excess * c.pvy2 + c.pvy1 + (excess * c.pvy4 + c.pvy3) * camber)
            * contact.friction_scale;
        let b = stiffness / (peak * c.pcy1);
        Side {
            force: sine(b, c.pcy1, peak, bend, slip) + lift,
            friction,
            stiffness,
            by_cy: b * c.pcy1,
            shift,
            lift,
        }
    }

    /// G_xa.
    fn pull_weight<T: Scalar>(&self, contact: &Contact<T>, excess: T, angle: T) -> T {
        let c = &self.combined;
        let b = (contact.slip_ratio * c.rbx2).arctangent().cosine() * c.rbx1;
        let e = excess * c.rex2 + c.rex1;
        let one = T::from(1.0);
        let shift = T::from(c.rhx1);
        cosine(b, c.rcx1, one, e, angle + shift) / cosine(b, c.rcx1, one, e, shift)
    }

    /// G_yk.
    fn side_weight<T: Scalar>(&self, contact: &Contact<T>, excess: T, angle: T) -> T {
        let c = &self.combined;
        let b = ((angle - c.rby3) * c.rby2).arctangent().cosine() * c.rby1;
        let e = excess * c.rey2 + c.rey1;
        let one = T::from(1.0);
        let shift = excess * c.rhy2 + c.rhy1;
        cosine(b, c.rcy1, one, e, contact.slip_ratio + shift) / cosine(b, c.rcy1, one, e, shift)
    }

    /// S_Vyk: side force from braking or driving.
    fn brake_side_force<T: Scalar>(
        &self,
        contact: &Contact<T>,
        excess: T,
        angle: T,
        friction: T,
    ) -> T {
        let c = &self.combined;
        let size = friction
            * contact.load_n
            * (excess * c.rvy2 + contact.camber_rad * c.rvy3 + c.rvy1)
            * (angle * c.rvy4).arctangent().cosine();
        size * ((contact.slip_ratio * c.rvy6).arctangent() * c.rvy5).sine()
    }

    /// M_z = -t F_y' + M_zr + s F_x with equivalent slip angles.
    fn aligning<T: Scalar>(
        &self,
        contact: &Contact<T>,
        excess: T,
        side: &Side<T>,
        pull_stiffness: T,
        [longitudinal, weighted, lateral]: [T; 3],
    ) -> T {
        let c = &self.aligning;
        let (load, camber) = (contact.load_n, contact.camber_rad);
        let angle = contact.slip_tangent.arctangent();
        let ratio = pull_stiffness / side.stiffness * contact.slip_ratio;
        let equivalent = |slip: T| {
            let slope = slip.tangent();
            let square = slope * slope + ratio * ratio;
            if square < 1e-20 {
                slip
            } else {
                square.sqrt().arctangent() * slip.sign()
            }
        };
        let own_slip = angle + excess * c.qhz2 + (excess * c.qhz4 + c.qhz3) * camber + c.qhz1;
        let trail_slip = equivalent(own_slip);
        let residual_slip = equivalent(angle + side.shift + side.lift / side.stiffness);
        let cos = angle.cosine();
        let b = (excess * (excess * c.qbz3 + c.qbz2) + c.qbz1)
            * (camber * c.qbz4 + camber.magnitude() * c.qbz5 + 1.0);
        let d = load
            * (excess * c.qdz2 + c.qdz1)
            * (camber * (camber * c.qdz4 + c.qdz3) + 1.0)
            * (self.radius_m / self.nominal_load_n);
        // The curvature keeps to the slip angle: only the cosine takes the equivalent one.
        let turn = (b * own_slip * c.qcz1).arctangent() * std::f64::consts::FRAC_2_PI;
        let e = (excess * (excess * c.qez3 + c.qez2) + c.qez1)
            * ((camber * c.qez5 + c.qez4) * turn + 1.0);
        let trail = cosine(b, c.qcz1, d, e, trail_slip) * cos;
        let br = side.by_cy * c.qbz10 + c.qbz9;
        let dr = load
            * (excess * c.qdz7 + c.qdz6 + (excess * c.qdz9 + c.qdz8) * camber)
            * self.radius_m
            * contact.friction_scale;
        let residual = dr * (br * residual_slip).arctangent().cosine() * cos;
        let s = &self.combined;
        let arm = (lateral * (s.ssz2 / self.nominal_load_n)
            + (excess * s.ssz4 + s.ssz3) * camber
            + s.ssz1)
            * self.radius_m;
        -trail * weighted + residual + arm * longitudinal
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tyre::Tyre;

    /// The default tyre without plysteer and conicity.
    fn symmetric() -> MagicFormula52 {
        let mut tyre = MagicFormula52::default();
        let (x, y, c, z) = (
            &mut tyre.longitudinal,
            &mut tyre.lateral,
            &mut tyre.combined,
            &mut tyre.aligning,
        );
        (x.phx1, x.phx2) = (0.0, 0.0);
        (y.phy1, y.phy2, y.pvy1, y.pvy2, y.pey3) = (0.0, 0.0, 0.0, 0.0, 0.0);
        (c.rhx1, c.rhy1, c.rby3, c.rvy1, c.rvy2, c.ssz1) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        (z.qhz1, z.qhz2, z.qdz6) = (0.0, 0.0, 0.0);
        tyre
    }

    /// Computed by an independent program (Python, written after the published equations and
    /// compared line by line with a public implementation) from the default coefficients.
    #[test]
    fn forces_and_moment_meet_an_independent_calculation() {
        let cases: [([f64; 4], [f64; 3]); 5] = [
            (
                [4000.0, 0.07, 0.0, 0.0],
                [-116.575376, -2697.83303, 49.519811],
            ),
            (
                [2000.0, -0.12, 0.0, 0.03],
                [-58.598727, 2013.897672, -20.958879],
            ),
            (
                [6000.0, 0.05, -0.08, 0.0],
                [-5818.331265, -2422.46666, -70.431763],
            ),
            (
                [3000.0, -0.15, 0.1, -0.04],
                [1991.597476, 2730.278528, 3.037548],
            ),
            (
                [5000.0, 0.2, -0.5, 0.05],
                [-4173.232007, -1478.07232, -114.18212],
            ),
        ];
        let tyre = Tyre::MagicFormula52(Box::default());
        for ([load, angle, slip, camber_rad], expected) in cases {
            let forces = tyre.forces(&Contact {
                camber_rad,
                ..Contact::combined(load, angle, slip)
            });
            let found = [forces.longitudinal_n, forces.lateral_n, forces.aligning_n_m];
            for (value, expected) in found.into_iter().zip(expected) {
                assert!(
                    (value - expected).abs() < 1e-5,
                    "{load} {angle} {slip} {camber_rad}: {found:?}"
                );
            }
        }
    }

    #[test]
    fn every_coefficient_has_its_name() {
        let mut tyre = MagicFormula52::default();
        for name in [
            "pcx1",
            "pdy3",
            "rvy6",
            "ssz4",
            "qhz4",
            "fnomin",
            "unloaded_radius",
        ] {
            *tyre.coefficient_mut(name).unwrap() = 7.5;
        }
        assert_eq!((tyre.aligning.qhz4, tyre.nominal_load_n), (7.5, 7.5));
        assert!(tyre.coefficient_mut("pky9").is_none());
    }

    #[test]
    fn slopes_and_peaks_are_what_the_coefficients_say() {
        let mf = symmetric();
        let tyre = Tyre::MagicFormula52(Box::new(mf));
        let slope = tyre.forces(&Contact::lateral(4000.0, 1e-6)).lateral_n / 1e-6;
        let expected =
            mf.lateral.pky1 * 4000.0 * math::sin(2.0 * math::atan(1.0_f64 / mf.lateral.pky2));
        assert!((slope / expected - 1.0).abs() < 1e-6, "{slope} {expected}");
        let slope = tyre
            .forces(&Contact::combined(4000.0_f64, 0.0, 1e-6))
            .longitudinal_n
            / 1e-6;
        assert!((slope / (21.51 * 4000.0) - 1.0).abs() < 1e-6, "{slope}");
        let peak = (0..2000)
            .map(|k| {
                -tyre
                    .forces(&Contact::lateral(4000.0, 1e-3 * f64::from(k)))
                    .lateral_n
            })
            .fold(0.0, f64::max);
        assert!((peak - 0.99 * 4000.0).abs() < 1.0, "{peak}");
    }

    #[test]
    fn each_slip_takes_from_the_other_force_and_the_trail_shrinks_with_slip() {
        let tyre = Tyre::MagicFormula52(Box::new(symmetric()));
        let side = |kappa: f64| {
            -tyre
                .forces(&Contact::combined(4000.0, 0.06, kappa))
                .lateral_n
        };
        assert!(side(0.0) > side(0.05) && side(0.05) > side(0.2));
        assert!((side(0.1) - side(-0.1)).abs() < 1e-9);
        let pull = |angle: f64| {
            tyre.forces(&Contact::combined(4000.0, angle, 0.05))
                .longitudinal_n
        };
        assert!(pull(0.0) > pull(0.1) && pull(0.1) > pull(0.3));
        let trail = |angle: f64| {
            let forces = tyre.forces(&Contact::lateral(4000.0, angle));
            -forces.aligning_n_m / forces.lateral_n
        };
        assert!(
            trail(0.005) > 0.02 && trail(0.005) > trail(0.1),
            "{}",
            trail(0.005)
        );
    }
}
