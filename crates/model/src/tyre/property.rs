//! A tyre from a property file: a Magic Formula with overturning moment, rolling resistance, the side
//! of the vehicle for which it was measured, and its range of loads.

use super::magic::{Coefficients61, Slopes, coefficients, degressive};
use super::tir::{Edition, Side, Tir};
use super::{Contact, Forces, MagicFormula52, MagicFormula61};
use crate::{Scalar, vehicle};

coefficients! {
    /// Coefficients of overturning moment and rolling resistance.
    Moments {
        qsx1 = 0.0, qsx2 = 0.0, qsx3 = 0.0, qsx4 = 0.0, qsx5 = 0.0, qsx6 = 0.0, qsx7 = 0.0, qsx8 = 0.0,
        qsx9 = 0.0, qsx10 = 0.0, qsx11 = 0.0,
        qsy1 = 0.0, qsy2 = 0.0, qsy3 = 0.0, qsy4 = 0.0, qsy5 = 0.0, qsy6 = 0.0, qsy7 = 1.0, qsy8 = 0.0,
    }
}

/// Magic Formula of a property file.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Formula {
    Mf52(MagicFormula52),
    Mf61(MagicFormula61),
}

/// A tyre from a property file.
///
/// Loads outside of the file's range FZMIN to FZMAX: the formula is evaluated at the limit, and its forces
/// and aligning moment are scaled by the ratio of the loads, so that the friction coefficient is that at the
/// limit and an unloaded tyre has no force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PropertyTyre {
    formula: Formula,
    moments: Moments,
    /// F_z0 without scaling factor, N.
    nominal_load_n: f64,
    radius_m: f64,
    /// V_0 of rolling resistance, m/s.
    reference_speed_m_s: f64,
    load_range_n: [f64; 2],
    side: Side,
}

/// What a property file gives for the fields of `[front.tyre]` that the vehicle file leaves out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Derived {
    pub cornering_stiffness_n_rad: f64,
    pub slip_stiffness_n: f64,
    pub load_exponent: f64,
    pub friction: f64,
    pub rolling_resistance: f64,
    pub camber_stiffness_n_rad: f64,
    pub relaxation_length_m: f64,
}

/// A property file with factors of a vehicle file.
struct Scaled<'t> {
    tir: &'t Tir,
    /// Factors from the vehicle file.
    resistance: f64,
    friction: f64,
    slip_stiffness: f64,
    cornering_stiffness: f64,
}

impl Scaled<'_> {
    /// Scaling factor of a name; 1 without it.
    fn factor(&self, name: &str) -> f64 {
        let own = match name {
            "LMUX" | "LMUY" => self.friction,
            "LKX" => self.slip_stiffness,
            "LKY" => self.cornering_stiffness,
            "LMY" => self.resistance,
            _ => 1.0,
        };
        own * self.tir.number_or(name, 1.0)
    }

    /// Product of scaling factors and factors of the inflation pressure of a coefficient.
    fn of(&self, name: &str) -> f64 {
        match self.tir.edition() {
            Edition::Mf52 => self.shared(name) * self.mf52(name),
            Edition::Mf61 => self.shared(name) * self.mf61(name) * self.pressure(name),
        }
    }

    /// Factors that both editions have.
    fn shared(&self, name: &str) -> f64 {
        let l = |name: &str| self.factor(name);
        match name {
            "PCX1" => l("LCX"),
            "PDX1" | "PDX2" => l("LMUX"),
            "PEX1" | "PEX2" | "PEX3" => l("LEX"),
            "PKX1" | "PKX2" => l("LKX"),
            "PHX1" | "PHX2" => l("LHX"),
            "PCY1" => l("LCY"),
            "PDY1" | "PDY2" => l("LMUY"),
            "PEY1" | "PEY2" => l("LEY"),
            "PKY1" => l("LKY"),
            "PHY1" | "PHY2" => l("LHY"),
            "RBX1" | "RBX3" => l("LXAL"),
            "RBY1" | "RBY4" => l("LYKA"),
            "RVY1" | "RVY2" | "RVY3" => l("LVYKA"),
            "QBZ1" | "QBZ2" | "QBZ3" | "QBZ9" => l("LKY") / l("LMUY"),
            "QDZ1" | "QDZ2" => l("LTR"),
            "QDZ6" | "QDZ7" => l("LRES") * l("LMUY"),
            "SSZ1" | "SSZ2" | "SSZ3" | "SSZ4" => l("LS"),
            "QSX1" => l("LVMX") * l("LMX"),
            "QSX2" | "QSX3" | "QSX4" | "QSX10" => l("LMX"),
            "QSY1" | "QSY2" | "QSY3" | "QSY4" | "QSY5" | "QSY6" => l("LMY"),
            _ => 1.0,
        }
    }

    /// The camber's own factors are those of Magic Formula 5.2 alone.
    fn mf52(&self, name: &str) -> f64 {
        let l = |name: &str| self.factor(name);
        match name {
            "PDX3" => l("LGAX").powi(2),
            "PVX1" | "PVX2" => l("LVX") * l("LMUX"),
            "PDY3" => l("LGAY").powi(2),
            "PKY3" | "PEY4" | "PHY3" => l("LGAY"),
            "PVY1" | "PVY2" => l("LVY") * l("LMUY"),
            "PVY3" | "PVY4" => l("LVY") * l("LMUY") * l("LGAY"),
            "QHZ3" | "QHZ4" | "QBZ4" | "QBZ5" | "QDZ3" | "QEZ5" => l("LGAZ"),
            "QDZ4" => l("LGAZ").powi(2),
            "QDZ8" | "QDZ9" => l("LGAZ") * l("LMUY"),
            _ => 1.0,
        }
    }

    fn mf61(&self, name: &str) -> f64 {
        let l = |name: &str| self.factor(name);
        match name {
            "PVX1" | "PVX2" => l("LVX") * degressive(l("LMUX")),
            "PVY1" | "PVY2" => l("LVY") * degressive(l("LMUY")),
            "PVY3" | "PVY4" => l("LKYC") * degressive(l("LMUY")),
            "PKY6" | "PKY7" => l("LKYC"),
            "QDZ8" | "QDZ9" | "QDZ10" | "QDZ11" => l("LKZC") * l("LMUY"),
            _ => 1.0,
        }
    }

    /// Factor of the inflation pressure (4.E13, 4.E15, 4.E23, 4.E25, 4.E30, 4.E42, 4.E47, 4.E69, 4.E70).
    fn pressure(&self, name: &str) -> f64 {
        let p = |name: &str| self.tir.number_or(name, 0.0);
        let dpi = self.tir.pressure_change();
        let square = |first: &str, second: &str| 1.0 + p(first) * dpi + p(second) * dpi * dpi;
        match name {
            "PDX1" | "PDX2" => square("PPX3", "PPX4"),
            "PKX1" | "PKX2" => square("PPX1", "PPX2"),
            "PDY1" | "PDY2" => square("PPY3", "PPY4"),
            "PKY1" => 1.0 + p("PPY1") * dpi,
            "PKY2" | "PKY5" => 1.0 + p("PPY2") * dpi,
            "PKY6" | "PKY7" => 1.0 + p("PPY5") * dpi,
            "QDZ1" | "QDZ2" => 1.0 - p("PPZ1") * dpi,
            "QDZ8" | "QDZ9" => 1.0 + p("PPZ2") * dpi,
            "QSX2" => 1.0 + p("PPMX1") * dpi,
            "QSY1" | "QSY2" | "QSY3" | "QSY4" | "QSY5" | "QSY6" => math::powf(1.0 + dpi, p("QSY8")),
            _ => 1.0,
        }
    }
}

/// Value of a coefficient that a file leaves out.
fn default_of(name: &str) -> f64 {
    match name {
        "PKY4" => 2.0,
        "QSY7" => 1.0,
        _ => 0.0,
    }
}

impl PropertyTyre {
    /// The tyre of a property file as it was measured.
    pub(crate) fn measured(tir: &Tir) -> Self {
        Self::scaled(&Scaled {
            tir,
            resistance: 1.0,
            friction: 1.0,
            slip_stiffness: 1.0,
            cornering_stiffness: 1.0,
        })
    }

    /// The tyre of a property file with friction, slip stiffnesses and rolling resistance of a vehicle
    /// file, which scale the formula.
    pub(super) fn from_vehicle(tir: &Tir, tyre: &vehicle::Tyre) -> Self {
        let own = Self::measured(tir).derived(tir);
        let resists = own.rolling_resistance > 0.0;
        Self::scaled(&Scaled {
            tir,
            resistance: match resists {
                true => tyre.rolling_resistance / own.rolling_resistance,
                false => 1.0,
            },
            friction: tyre.friction / own.friction,
            slip_stiffness: tyre.slip_stiffness_n / own.slip_stiffness_n,
            cornering_stiffness: tyre.cornering_stiffness_n_rad / own.cornering_stiffness_n_rad,
        })
    }

    fn scaled(scaled: &Scaled<'_>) -> Self {
        let tir = scaled.tir;
        let nominal_load_n = tir.number_or("FNOMIN", f64::NAN);
        let scaled_load_n = nominal_load_n * scaled.factor("LFZO");
        let radius_m = tir.number_or("UNLOADED_RADIUS", f64::NAN);
        let formula = match tir.edition() {
            Edition::Mf52 => {
                let mut formula = MagicFormula52 {
                    nominal_load_n: scaled_load_n,
                    radius_m,
                    ..MagicFormula52::default()
                };
                for name in MagicFormula52::names() {
                    let upper = name.to_uppercase();
                    if let Some(value) = formula.coefficient_mut(name) {
                        *value = tir.number_or(&upper, 0.0) * scaled.of(&upper);
                    }
                }
                Formula::Mf52(formula)
            }
            Edition::Mf61 => {
                let mut formula = MagicFormula61 {
                    nominal_load_n: scaled_load_n,
                    radius_m,
                    coefficients: Coefficients61::default(),
                };
                for name in Coefficients61::NAMES {
                    let upper = name.to_uppercase();
                    if let Some(value) = formula.coefficients.named(name) {
                        *value = tir.number_or(&upper, default_of(&upper)) * scaled.of(&upper);
                    }
                }
                Formula::Mf61(formula)
            }
        };
        let mut moments = Moments::default();
        for name in Moments::NAMES {
            let upper = name.to_uppercase();
            let extra = tir.edition() == Edition::Mf52 && Tir::is_of_mf61_alone(&upper);
            if let Some(value) = moments.named(name).filter(|_| !extra) {
                *value = tir.number_or(&upper, default_of(&upper)) * scaled.of(&upper);
            }
        }
        Self {
            formula,
            moments,
            nominal_load_n,
            radius_m,
            reference_speed_m_s: tir.number_or("LONGVL", 1.0),
            load_range_n: [
                tir.number_or("FZMIN", 0.0).max(1e-3),
                tir.number_or("FZMAX", f64::INFINITY),
            ],
            side: tir.side(),
        }
    }

    /// Force and aligning moment on a wheel of one side of the vehicle.
    #[inline]
    pub(super) fn forces<T: Scalar>(&self, left: bool, contact: &Contact<T>) -> Forces<T> {
        let load = contact.load_n.at_least(self.load_range_n[0]);
        let within = Contact {
            load_n: load.at_most(self.load_range_n[1]),
            ..*contact
        };
        let share = contact.load_n / within.load_n;
        let mirror = self.side.mirror(left);
        let within = Contact {
            slip_tangent: within.slip_tangent * mirror,
            camber_rad: within.camber_rad * mirror,
            ..within
        };
        let forces = match &self.formula {
            Formula::Mf52(formula) => formula.forces(&within),
            Formula::Mf61(formula) => formula.forces(&within),
        };
        Forces {
            longitudinal_n: forces.longitudinal_n * share,
            lateral_n: forces.lateral_n * share * mirror,
            aligning_n_m: forces.aligning_n_m * share * mirror,
        }
    }

    /// Whether it was measured on the left side; true also where sides do not differ.
    pub(super) fn is_of_left(&self) -> bool {
        self.side != Side::Right
    }

    /// Whether the file has coefficients of rolling resistance.
    pub(super) fn has_resistance(&self) -> bool {
        let m = &self.moments;
        [m.qsy1, m.qsy2, m.qsy3, m.qsy4, m.qsy5, m.qsy6]
            .iter()
            .any(|value| *value != 0.0)
    }

    /// Whether the file has coefficients of the overturning moment.
    pub(super) fn has_overturning(&self) -> bool {
        let m = &self.moments;
        [m.qsx1, m.qsx2, m.qsx3, m.qsx4, m.qsx10]
            .iter()
            .any(|value| *value != 0.0)
    }

    /// Overturning moment M_x, N m, about the contact point (4.E69; 5.2 has its first three terms):
    /// M_x = R_0 F_z {Q_SX1 - Q_SX2 gamma + Q_SX3 f_y + Q_SX4 cos[Q_SX5 atan (Q_SX6 f_z)^2]
    /// sin[Q_SX7 gamma + Q_SX8 atan(Q_SX9 f_y)] + Q_SX10 atan(Q_SX11 f_z) gamma} with f = F/F_z0. The
    /// square of the fourth term is inside of the arc tangent, as in the manual of MF-Tyre 6.2.
    pub(super) fn overturning_n_m<T: Scalar>(
        &self,
        left: bool,
        contact: &Contact<T>,
        lateral_n: T,
    ) -> T {
        let m = &self.moments;
        let mirror = self.side.mirror(left);
        let (camber, load) = (contact.camber_rad * mirror, contact.load_n);
        let side = lateral_n * (mirror / self.nominal_load_n);
        let part = load / self.nominal_load_n;
        let pressed = part * m.qsx6;
        let fourth = ((pressed * pressed).arctangent() * m.qsx5).cosine()
            * (camber * m.qsx7 + (side * m.qsx9).arctangent() * m.qsx8).sine()
            * m.qsx4;
        let last = (part * m.qsx11).arctangent() * camber * m.qsx10;
        let sum = side * m.qsx3 - camber * m.qsx2 + m.qsx1 + fourth + last;
        load * sum * (self.radius_m * mirror)
    }

    /// Size of the rolling resistance moment, N m, positive against the spin: M_y is minus this for a
    /// wheel that rolls forward (4.E70 with F_z0 in place of its first F_z, as Besselink, Schmeitz and
    /// Pacejka 2010 have it, A48; 5.2 has the terms 1 to 4 and Q_SY7 = 1):
    /// R_0 F_z0 {Q_SY1 + Q_SY2 F_x/F_z0 + Q_SY3 |V/V_0| + Q_SY4 (V/V_0)^4 + (Q_SY5 + Q_SY6 F_z/F_z0)
    /// gamma^2} (F_z/F_z0)^Q_SY7 (p/p_0)^Q_SY8.
    pub(super) fn resistance_n_m<T: Scalar>(
        &self,
        contact: &Contact<T>,
        longitudinal_n: T,
        speed_m_s: T,
    ) -> T {
        let m = &self.moments;
        let part = contact.load_n / self.nominal_load_n;
        let speed = speed_m_s.magnitude() / self.reference_speed_m_s;
        let square = speed * speed;
        let camber = contact.camber_rad;
        let sum = longitudinal_n * (m.qsy2 / self.nominal_load_n)
            + m.qsy1
            + speed * m.qsy3
            + square * square * m.qsy4
            + (part * m.qsy6 + m.qsy5) * camber * camber;
        sum * part.power(m.qsy7) * (self.radius_m * self.nominal_load_n)
    }

    /// Stiffnesses, friction and resistance at the nominal load.
    pub(crate) fn derived(&self, tir: &Tir) -> Derived {
        let load = self.nominal_load_n;
        let slopes = self.slopes(load);
        let (low, high) = (self.slopes(0.98 * load), self.slopes(1.02 * load));
        let exponent = math::ln(high.cornering / low.cornering) / math::ln(1.02 / 0.98);
        Derived {
            cornering_stiffness_n_rad: slopes.cornering,
            slip_stiffness_n: slopes.slip,
            load_exponent: exponent.clamp(0.0, 2.0),
            friction: slopes.friction,
            rolling_resistance: self.moments.qsy1.clamp(0.0, 0.5),
            camber_stiffness_n_rad: slopes.camber.max(0.0),
            relaxation_length_m: tir.relaxation_length_m(slopes.cornering).clamp(0.0, 5.0),
        }
    }

    /// Slopes of the forces of a free-rolling upright tyre, and its lateral friction coefficient.
    fn slopes(&self, load_n: f64) -> Slopes {
        let at = Contact::lateral(load_n, 0.0);
        match &self.formula {
            Formula::Mf52(formula) => formula.slopes(&at),
            Formula::Mf61(formula) => formula.slopes(&at),
        }
    }
}

#[cfg(test)]
pub(super) mod tests;
