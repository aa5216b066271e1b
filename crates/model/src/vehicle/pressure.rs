//! How tyres change with their inflation pressure.

use sample::{PerWheel, Wheel};
use serde::{Deserialize, Serialize};

use super::{Tyre, Vehicle};
use crate::tyre::{PropertyTyre, Tir};

/// Change of a tyre with its inflation pressure, about a nominal pressure: a value x of the tyre is
///
/// x(p) = x_0 (1 + c dp), dp = (p - p_0)/p_0
///
/// | symbol | name | unit |
/// |---|---|---|
/// | x_0 | value of `[front.tyre]` | that of x |
/// | c | change | 1 |
/// | p, p_0 | pressure and nominal pressure | Pa |
///
/// Source: the linear pressure terms of the Magic Formula 6.1, I. J. M. Besselink, A. J. C. Schmeitz and H. B. Pacejka,
/// An improved Magic Formula/Swift tyre model that can handle inflation pressure changes, Vehicle System Dynamics 48
/// (2010), supplement 1: p_Fz1, p_py1, p_px1 and p_py3. Differences: the friction has one coefficient for both directions,
/// and the squares p_px2, p_px4 and p_py4 and the change p_py2 of the load of greatest stiffness are left out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TyrePressure {
    /// Nominal inflation pressure p_0 above that of the air, for which the other values of the tyre hold, Pa.
    pub nominal_pa: f64,
    /// Relative change of the vertical stiffness for a relative change of the pressure (PFZ1 of the Magic Formula 6.1).
    #[serde(default)]
    pub vertical_stiffness_change: f64,
    /// Relative change of the cornering stiffness for a relative change of the pressure (PPY1).
    #[serde(default)]
    pub cornering_stiffness_change: f64,
    /// Relative change of the longitudinal slip stiffness for a relative change of the pressure (PPX1).
    #[serde(default)]
    pub slip_stiffness_change: f64,
    /// Relative change of the friction coefficient for a relative change of the pressure (PPY3).
    #[serde(default)]
    pub friction_change: f64,
}

/// Relative changes of the pressure within which the linear law is used; beyond them, the tyre is that at the limit.
/// With the ranges of the changes in a vehicle file, each value stays above zero.
const RELATIVE: [f64; 2] = [-0.5, 1.0];

/// Relative change dp of a pressure, Pa, from the nominal one, within the limits of the law: -0.5 to 1.
#[must_use]
pub fn pressure_change(pressure_pa: f64, nominal_pa: f64) -> f64 {
    let [least, most] = RELATIVE;
    ((pressure_pa - nominal_pa) / nominal_pa).clamp(least, most)
}

impl Tyre {
    /// Nominal inflation pressure, Pa: that of the table `pressure`, or NOMPRES of a property file of the Magic Formula
    /// 6.1. `None` for a tyre that does not depend on its pressure.
    #[must_use]
    pub fn nominal_pressure_pa(&self) -> Option<f64> {
        let own = self.pressure.map(|pressure| pressure.nominal_pa);
        own.or_else(|| self.tir.as_ref()?.nominal_pressure_pa())
    }

    /// The tyre at an inflation pressure, Pa. The result has no table `pressure`, so that the law is used once. A
    /// pressure that is not finite, and a tyre without a nominal pressure, change nothing.
    #[must_use]
    pub fn at_pressure(&self, pressure_pa: f64) -> Self {
        let mut tyre = self.clone();
        let Some(nominal_pa) = self
            .nominal_pressure_pa()
            .filter(|_| pressure_pa.is_finite())
        else {
            return tyre;
        };
        let change = pressure_change(pressure_pa, nominal_pa);
        if let Some(law) = tyre.pressure.take() {
            tyre.vertical_stiffness_n_m *= 1.0 + law.vertical_stiffness_change * change;
            tyre.cornering_stiffness_n_rad *= 1.0 + law.cornering_stiffness_change * change;
            tyre.slip_stiffness_n *= 1.0 + law.slip_stiffness_change * change;
            tyre.friction *= 1.0 + law.friction_change * change;
        } else if let Some(tir) = &self.tir {
            let inflated = tir.inflated(nominal_pa * (1.0 + change));
            let [old, new] = [tir, &inflated].map(Tir::vertical_stiffness_n_m);
            if let (Some(old), Some(new)) = (old, new) {
                tyre.vertical_stiffness_n_m *= new / old;
            }
            let [old, new] = [tir, &inflated].map(|tir| PropertyTyre::measured(tir).derived(tir));
            tyre.cornering_stiffness_n_rad *=
                new.cornering_stiffness_n_rad / old.cornering_stiffness_n_rad;
            tyre.slip_stiffness_n *= new.slip_stiffness_n / old.slip_stiffness_n;
            tyre.friction *= new.friction / old.friction;
            if old.rolling_resistance > 0.0 {
                tyre.rolling_resistance *= new.rolling_resistance / old.rolling_resistance;
            }
            tyre.tir = Some(inflated);
        }
        tyre
    }
}

impl Vehicle {
    /// Whether a tyre of the vehicle depends on its inflation pressure.
    #[must_use]
    pub fn depends_on_pressure(&self) -> bool {
        let mut axles = [&self.front, &self.rear].into_iter();
        axles.any(|axle| axle.tyre.nominal_pressure_pa().is_some())
    }

    /// The vehicle with the tyres of each axle at the mean inflation pressure of its two wheels, Pa. Pressures that are
    /// not finite are unknown; an axle without a known pressure keeps the tyre of its file.
    #[must_use]
    pub fn at_pressures(&self, pressures_pa: &PerWheel<f64>) -> Self {
        let mut vehicle = self.clone();
        let [front_pa, rear_pa] = pressures_of_axles(pressures_pa);
        vehicle.front.tyre = self.front.tyre.at_pressure(front_pa);
        vehicle.rear.tyre = self.rear.tyre.at_pressure(rear_pa);
        vehicle
    }
}

/// Mean of the known pressures of each axle's wheels, front and rear, Pa; `NaN` without one.
#[must_use]
pub fn pressures_of_axles(pressures_pa: &PerWheel<f64>) -> [f64; 2] {
    [true, false].map(|front| {
        let wheels = Wheel::ALL.into_iter();
        let of_axle = wheels.filter(|wheel| wheel.is_front() == front);
        let known = of_axle
            .map(|wheel| pressures_pa[wheel])
            .filter(|pressure| pressure.is_finite());
        let (sum, count) = known.fold((0.0, 0.0), |(sum, count), p| (sum + p, count + 1.0));
        sum / count
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIR: &str = include_str!("../tyre/property/mf61.tir");

    fn text(tyre: &str) -> String {
        let own = Vehicle::builtin_text("prowler").unwrap();
        own.replacen(
            "[front.tyre]",
            &format!("[front.tyre.pressure]\n{tyre}\n[front.tyre]"),
            1,
        )
    }

    const LAW: &str = "nominal_pa = 50e3\nvertical_stiffness_change = 0.7\n\
                       cornering_stiffness_change = -0.4\nfriction_change = -0.1";

    /// 20 % below the nominal pressure: the factors by hand.
    #[test]
    fn values_change_by_the_law_on_the_axle_that_has_one() {
        let plain = Vehicle::builtin("prowler").unwrap();
        let vehicle = Vehicle::from_toml(&text(LAW), "car.toml").unwrap();
        assert!(vehicle.depends_on_pressure() && !plain.depends_on_pressure());
        let inflated = vehicle.at_pressures(&PerWheel([39e3, 41e3, 40e3, 40e3]));
        let (tyre, own) = (&inflated.front.tyre, &plain.front.tyre);
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
        assert!(near(
            tyre.vertical_stiffness_n_m,
            0.86 * own.vertical_stiffness_n_m
        ));
        assert!(near(
            tyre.cornering_stiffness_n_rad,
            1.08 * own.cornering_stiffness_n_rad
        ));
        assert!(near(tyre.friction, 1.02 * own.friction));
        assert_eq!(tyre.slip_stiffness_n, own.slip_stiffness_n);
        assert_eq!(inflated.rear, plain.rear);
        // The law is used once.
        assert_eq!(inflated.at_pressures(&PerWheel([30e3; 4])), inflated);
    }

    #[test]
    fn nominal_and_unknown_pressures_change_no_bit() {
        let plain = Vehicle::builtin("prowler").unwrap();
        let vehicle = Vehicle::from_toml(&text(LAW), "car.toml").unwrap();
        assert_eq!(vehicle.at_pressures(&PerWheel([f64::NAN; 4])), vehicle);
        assert_eq!(vehicle.at_pressures(&PerWheel([50e3; 4])), plain);
        assert_eq!(plain.at_pressures(&PerWheel([30e3; 4])), plain);
        // One sensor of an axle is sufficient.
        let one = PerWheel([f64::NAN, 40e3, 40e3, 40e3]);
        assert_eq!(
            vehicle.at_pressures(&one),
            vehicle.at_pressures(&PerWheel([40e3; 4]))
        );
        // A flat tyre has the values at half of the nominal pressure.
        let flat = vehicle.at_pressures(&PerWheel([0.0; 4]));
        assert_eq!(flat, vehicle.at_pressures(&PerWheel([25e3; 4])));
    }

    /// The formula at another INFLPRES, as if the property file had it.
    #[test]
    fn a_property_file_changes_by_its_own_terms() {
        let read = |tir: &str| {
            let own = Vehicle::builtin_text("prowler").unwrap();
            let start = own.find("[front.tyre]").unwrap();
            let end = start + own[start..].find("\n[").unwrap();
            let named = format!(
                "{}[front.tyre]\ntir = \"a.tir\"\n{}",
                &own[..start],
                &own[end..]
            );
            let whole = Vehicle::with_tyre_files(&named, "car.toml", |_| Ok(tir.to_owned()));
            Vehicle::from_toml(&whole.unwrap(), "car.toml").unwrap()
        };
        let other = TIR.replace("INFLPRES                 = 250000.0", "INFLPRES = 180000.0");
        assert_ne!(other, TIR);
        let (inflated, expected) = (
            read(TIR).at_pressures(&PerWheel([180e3; 4])).front.tyre,
            read(&other).front.tyre,
        );
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
        assert!(near(
            inflated.vertical_stiffness_n_m,
            expected.vertical_stiffness_n_m
        ));
        assert!(near(
            inflated.cornering_stiffness_n_rad,
            expected.cornering_stiffness_n_rad
        ));
        assert!(near(inflated.friction, expected.friction));
        let force = |tyre: &Tyre| {
            let contact = crate::tyre::Contact::lateral(4200.0, 0.06);
            crate::tyre::Tyre::from_vehicle(tyre)
                .forces_on(true, &contact)
                .lateral_n
        };
        assert!(near(force(&inflated), force(&expected)));
        assert!(!near(force(&inflated), force(&read(TIR).front.tyre)));
    }

    #[test]
    fn mistakes_are_named() {
        let wrong = |law: &str| {
            let error = Vehicle::from_toml(&text(law), "car.toml").unwrap_err();
            error.to_string()
        };
        let error = wrong("cornering_stiffness_change = 0.2");
        assert!(
            error.contains("front.tyre.pressure.nominal_pa: is missing"),
            "{error}"
        );
        // In bar.
        let error = wrong("nominal_pa = 0.5");
        assert!(error.contains("front.tyre.pressure.nominal_pa"), "{error}");
        assert!(error.contains("0.5") && error.contains("1000"), "{error}");
        let error = wrong("nominal_pa = 50e3\ncornering_stiffness_change = 40.0");
        assert!(error.contains("between -0.9 and 1.9"), "{error}");
        let own = Vehicle::builtin_text("prowler").unwrap();
        let named = own.replacen(
            "[front.tyre]",
            "[front.tyre.pressure]\nnominal_pa = 5e4\n[front.tyre]\ntir = \"a.tir\"",
            1,
        );
        let whole = Vehicle::with_tyre_files(&named, "car.toml", |_| Ok(TIR.to_owned())).unwrap();
        let error = Vehicle::from_toml(&whole, "car.toml")
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("front.tyre.pressure") && error.contains("NOMPRES"),
            "{error}"
        );
    }
}
