use super::{Side, Slopes, cosine, sine};
use crate::Scalar;
use crate::tyre::{Contact, Forces};

coefficients! {
    /// Coefficients of the Magic Formula 6.1 for F_x, F_y and M_z without turn slip. Scaling factors
    /// and inflation pressure are contained.
    Coefficients61 {
        pcx1 = 0.0, pdx1 = 0.0, pdx2 = 0.0, pdx3 = 0.0,
        pex1 = 0.0, pex2 = 0.0, pex3 = 0.0, pex4 = 0.0,
        pkx1 = 0.0, pkx2 = 0.0, pkx3 = 0.0,
        phx1 = 0.0, phx2 = 0.0, pvx1 = 0.0, pvx2 = 0.0,
        rbx1 = 0.0, rbx2 = 0.0, rbx3 = 0.0, rcx1 = 0.0, rex1 = 0.0, rex2 = 0.0, rhx1 = 0.0,
        pcy1 = 0.0, pdy1 = 0.0, pdy2 = 0.0, pdy3 = 0.0,
        pey1 = 0.0, pey2 = 0.0, pey3 = 0.0, pey4 = 0.0, pey5 = 0.0,
        pky1 = 0.0, pky2 = 0.0, pky3 = 0.0, pky4 = 2.0, pky5 = 0.0, pky6 = 0.0, pky7 = 0.0,
        phy1 = 0.0, phy2 = 0.0, pvy1 = 0.0, pvy2 = 0.0, pvy3 = 0.0, pvy4 = 0.0,
        rby1 = 0.0, rby2 = 0.0, rby3 = 0.0, rby4 = 0.0, rcy1 = 0.0, rey1 = 0.0, rey2 = 0.0,
        rhy1 = 0.0, rhy2 = 0.0,
        rvy1 = 0.0, rvy2 = 0.0, rvy3 = 0.0, rvy4 = 0.0, rvy5 = 0.0, rvy6 = 0.0,
        qbz1 = 0.0, qbz2 = 0.0, qbz3 = 0.0, qbz4 = 0.0, qbz5 = 0.0, qbz6 = 0.0, qbz9 = 0.0, qbz10 = 0.0,
        qcz1 = 0.0, qdz1 = 0.0, qdz2 = 0.0, qdz3 = 0.0, qdz4 = 0.0, qdz6 = 0.0, qdz7 = 0.0,
        qdz8 = 0.0, qdz9 = 0.0, qdz10 = 0.0, qdz11 = 0.0,
        qez1 = 0.0, qez2 = 0.0, qez3 = 0.0, qez4 = 0.0, qez5 = 0.0,
        qhz1 = 0.0, qhz2 = 0.0, qhz3 = 0.0, qhz4 = 0.0,
        ssz1 = 0.0, ssz2 = 0.0, ssz3 = 0.0, ssz4 = 0.0,
    }
}

/// The Magic Formula 6.1 without turn slip (Pacejka, Tyre and Vehicle Dynamics, 3rd edition, 2012,
/// equations 4.E1 to 4.E78). Its axes are ISO 8855's: P_KY1 < 0 makes a positive slip angle give a
/// negative force.
///
/// | symbol | meaning | unit |
/// |---|---|---|
/// | df_z | (F_z - F_z0')/F_z0' | - |
/// | alpha* | tangent of the slip angle (4.E3) | - |
/// | gamma* | sine of the camber angle (4.E4) | - |
/// | kappa | longitudinal slip | - |
/// | lambda_mu | [`Contact::friction_scale`] | - |
/// | lambda_K | [`Contact::stiffness_scale`] | - |
///
/// Differences from the source: the small numbers epsilon are zero, since the load is above zero; the
/// aligning moment's B_t and D_t have the terms of the property files (Q_BZ4, and Q_DZ3 without the
/// absolute value, as in the 2nd edition).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MagicFormula61 {
    /// Nominal load F_z0', N.
    pub nominal_load_n: f64,
    /// Unloaded radius R_0, m.
    pub radius_m: f64,
    /// Coefficients.
    pub coefficients: Coefficients61,
}

/// A_mu of the degressive friction factor lambda_mu' (4.E8).
const DEGRESSIVE: f64 = 10.0;

/// lambda_mu' of a friction factor (4.E8).
pub(in crate::tyre) fn degressive<T: Scalar>(scale: T) -> T {
    scale * DEGRESSIVE / (scale * (DEGRESSIVE - 1.0) + 1.0)
}

impl MagicFormula61 {
    pub(in crate::tyre) fn slopes(&self, contact: &Contact<f64>) -> Slopes {
        let excess = (contact.load_n - self.nominal_load_n) / self.nominal_load_n;
        let side = self.side(contact, excess, 0.0);
        let c = &self.coefficients;
        Slopes {
            slip: self.pull(contact, excess, 0.0).1,
            cornering: -side.stiffness,
            camber: -contact.load_n * (excess * c.pky7 + c.pky6),
            friction: side.friction.abs(),
        }
    }

    pub(in crate::tyre) fn forces<T: Scalar>(&self, contact: &Contact<T>) -> Forces<T> {
        let excess = (contact.load_n - self.nominal_load_n) / self.nominal_load_n;
        let camber = contact.camber_rad.sine();
        let (pull, pull_stiffness) = self.pull(contact, excess, camber);
        let side = self.side(contact, excess, camber);
        let weight = self.side_weight(contact, excess, camber);
        let longitudinal_n = self.pull_weight(contact, excess, camber) * pull;
        let lateral_n = weight * side.force + self.brake_side_force(contact, excess, camber, &side);
        let upright = self.side(contact, excess, T::from(0.0)).force;
        let aligning_n_m = self.aligning(
            contact,
            [excess, camber],
            &side,
            pull_stiffness,
            [longitudinal_n, weight * upright, lateral_n],
        );
        Forces {
            longitudinal_n,
            lateral_n,
            aligning_n_m,
        }
    }

    /// F_x0 and K_xk (4.E9 to 4.E18).
    fn pull<T: Scalar>(&self, contact: &Contact<T>, excess: T, camber: T) -> (T, T) {
        let c = &self.coefficients;
        let load = contact.load_n;
        let slip = contact.slip_ratio + excess * c.phx2 + c.phx1;
        let friction =
            (excess * c.pdx2 + c.pdx1) * (-camber * camber * c.pdx3 + 1.0) * contact.friction_scale;
        let peak = load * friction;
        let bend = ((excess * (excess * c.pex3 + c.pex2) + c.pex1) * (1.0 - c.pex4 * slip.sign()))
            .at_most(1.0);
        let stiffness = load
            * (excess * c.pkx2 + c.pkx1)
            * (excess * c.pkx3).exponential()
            * contact.stiffness_scale;
        let b = stiffness / (peak * c.pcx1);
        let lift = load * (excess * c.pvx2 + c.pvx1) * degressive(contact.friction_scale);
        (sine(b, c.pcx1, peak, bend, slip) + lift, stiffness)
    }

    /// F_y0 (4.E19 to 4.E30).
    fn side<T: Scalar>(&self, contact: &Contact<T>, excess: T, camber: T) -> Side<T> {
        let c = &self.coefficients;
        let load = contact.load_n;
        let square = camber * camber;
        let friction =
            (excess * c.pdy2 + c.pdy1) * (-square * c.pdy3 + 1.0) * contact.friction_scale;
        let peak = load * friction;
        let stiffness = ((load / self.nominal_load_n / (square * c.pky5 + c.pky2)).arctangent()
            * c.pky4)
            .sine()
            * (c.pky1 * self.nominal_load_n)
            * (-camber.magnitude() * c.pky3 + 1.0)
            * contact.stiffness_scale;
        let low = degressive(contact.friction_scale);
        let camber_lift = load * (excess * c.pvy4 + c.pvy3) * camber * low;
        let lift = load * (excess * c.pvy2 + c.pvy1) * low + camber_lift;
        let camber_stiffness = load * (excess * c.pky7 + c.pky6);
        let shift =
            excess * c.phy2 + c.phy1 + (camber_stiffness * camber - camber_lift) / stiffness;
        let slip = contact.slip_tangent + shift;
        let bend = ((excess * c.pey2 + c.pey1)
            * (square * c.pey5 - (camber * c.pey4 + c.pey3) * slip.sign() + 1.0))
            .at_most(1.0);
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

    /// G_xa (4.E51 to 4.E57).
    fn pull_weight<T: Scalar>(&self, contact: &Contact<T>, excess: T, camber: T) -> T {
        let c = &self.coefficients;
        let b = (contact.slip_ratio * c.rbx2).arctangent().cosine()
            * (camber * camber * c.rbx3 + c.rbx1);
        let e = (excess * c.rex2 + c.rex1).at_most(1.0);
        let (one, shift) = (T::from(1.0), T::from(c.rhx1));
        cosine(b, c.rcx1, one, e, contact.slip_tangent + shift) / cosine(b, c.rcx1, one, e, shift)
    }

    /// G_yk (4.E59 to 4.E65).
    fn side_weight<T: Scalar>(&self, contact: &Contact<T>, excess: T, camber: T) -> T {
        let c = &self.coefficients;
        let b = ((contact.slip_tangent - c.rby3) * c.rby2)
            .arctangent()
            .cosine()
            * (camber * camber * c.rby4 + c.rby1);
        let e = (excess * c.rey2 + c.rey1).at_most(1.0);
        let one = T::from(1.0);
        let shift = excess * c.rhy2 + c.rhy1;
        cosine(b, c.rcy1, one, e, contact.slip_ratio + shift) / cosine(b, c.rcy1, one, e, shift)
    }

    /// S_Vyk: side force from braking or driving (4.E66, 4.E67).
    fn brake_side_force<T: Scalar>(
        &self,
        contact: &Contact<T>,
        excess: T,
        camber: T,
        side: &Side<T>,
    ) -> T {
        let c = &self.coefficients;
        let size = side.friction
            * contact.load_n
            * (excess * c.rvy2 + camber * c.rvy3 + c.rvy1)
            * (contact.slip_tangent * c.rvy4).arctangent().cosine();
        size * ((contact.slip_ratio * c.rvy6).arctangent() * c.rvy5).sine()
    }

    /// M_z = -t F_y' + M_zr + s F_x (4.E33 to 4.E47, 4.E71 to 4.E78). The forces are F_x, F_y' of the
    /// upright wheel, and F_y.
    fn aligning<T: Scalar>(
        &self,
        contact: &Contact<T>,
        [excess, camber]: [T; 2],
        side: &Side<T>,
        pull_stiffness: T,
        [longitudinal, weighted, lateral]: [T; 3],
    ) -> T {
        let c = &self.coefficients;
        let load = contact.load_n;
        let scale = contact.stiffness_scale / contact.friction_scale;
        let ratio = pull_stiffness / side.stiffness * contact.slip_ratio;
        let equivalent = |slip: T| {
            let square = slip * slip + ratio * ratio;
            if square < 1e-20 {
                slip
            } else {
                square.sqrt() * slip.sign()
            }
        };
        let cos = contact.slip_tangent.arctangent().cosine();
        let own_slip =
            contact.slip_tangent + excess * c.qhz2 + (excess * c.qhz4 + c.qhz3) * camber + c.qhz1;
        let b = (excess * (excess * c.qbz3 + c.qbz2) + c.qbz1)
            * (camber * c.qbz4 + camber.magnitude() * c.qbz5 + camber * camber * c.qbz6 + 1.0)
            * scale;
        let d = load
            * (excess * c.qdz2 + c.qdz1)
            * (camber * (camber * c.qdz4 + c.qdz3) + 1.0)
            * (self.radius_m / self.nominal_load_n);
        let turn = (b * own_slip * c.qcz1).arctangent() * std::f64::consts::FRAC_2_PI;
        let e = ((excess * (excess * c.qez3 + c.qez2) + c.qez1)
            * ((camber * c.qez5 + c.qez4) * turn + 1.0))
            .at_most(1.0);
        let trail = cosine(b, c.qcz1, d, e, equivalent(own_slip)) * cos;
        let br = scale * c.qbz9 + side.by_cy * c.qbz10;
        let dr = load
            * (excess * c.qdz7
                + c.qdz6
                + (excess * c.qdz9 + c.qdz8 + (excess * c.qdz11 + c.qdz10) * camber.magnitude())
                    * camber)
            * self.radius_m
            * contact.friction_scale;
        let residual_slip =
            equivalent(contact.slip_tangent + side.shift + side.lift / side.stiffness);
        let residual = dr * (br * residual_slip).arctangent().cosine() * cos;
        let arm = (lateral * (c.ssz2 / self.nominal_load_n)
            + (excess * c.ssz4 + c.ssz3) * camber
            + c.ssz1)
            * self.radius_m;
        -trail * weighted + residual + arm * longitudinal
    }
}
