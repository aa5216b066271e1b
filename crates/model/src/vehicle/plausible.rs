//! Values of a vehicle file that are possible but far from usual, with the unit they are probably in.

use sample::{STANDARD_GRAVITY_M_S2, Wheel};

use super::{Axle, Vehicle, Warning};
use crate::suspension::Corner;

/// A value, and a quantity that follows from it.
struct Judged {
    /// Name of the field in its table.
    field: &'static str,
    written: f64,
    unit: &'static str,
    /// What follows from the value, in words.
    quantity: &'static str,
    follows: f64,
    /// The quantity grows with this power of the value.
    power: f64,
    /// Least and largest usual quantity.
    usual: [f64; 2],
    /// Other units, and the number of units of the file in each.
    others: &'static [(&'static str, f64)],
}

const PER_DEGREE: f64 = 180.0 / std::f64::consts::PI;
const PER_MILLIMETRE: f64 = 1e3;
/// 1 lbf/in in N/m.
const PER_INCH: f64 = 175.126_835;

impl Judged {
    /// The warning of a field in a table.
    fn warning(&self, table: &str) -> Option<Warning> {
        let [least, most] = self.usual;
        let is_usual = |quantity: f64| (least..=most).contains(&quantity);
        if is_usual(self.follows) {
            return None;
        }
        let (written, unit) = (self.written, self.unit);
        let middle = (least * most).sqrt();
        let by_unit = |(name, scale): &(&'static str, f64)| {
            let quantity = self.follows * math::powf(*scale, self.power);
            let from_middle = math::ln(quantity / middle).abs();
            is_usual(quantity).then_some((from_middle, *name, written * scale))
        };
        let others = self.others.iter().filter_map(by_unit);
        let other = others.min_by(|(a, ..), (b, ..)| a.total_cmp(b));
        let remedy = other.map_or_else(
            || "check the value and its unit".to_owned(),
            |(_, name, converted)| {
                let digits = if converted < 100.0 { 4 } else { 0 };
                format!("the value is probably in {name}; write {converted:.digits$} {unit}")
            },
        );
        Some(Warning {
            field: format!("{table}.{}", self.field),
            value: self.follows,
            text: format!(
                "{written} {unit} means {} of {:.3}; {least} to {most} is usual; {remedy}",
                self.quantity, self.follows
            ),
        })
    }
}

impl Vehicle {
    /// Values of both axles and of the steering that are far from usual.
    pub(super) fn implausible(&self) -> Vec<Warning> {
        let mut warnings = Vec::new();
        for (table, wheel) in [("front", Wheel::FrontLeft), ("rear", Wheel::RearLeft)] {
            let found = [self.tyre_values(wheel), self.strut_values(wheel)];
            let found = found.into_iter().flatten();
            warnings.extend(found.filter_map(|judged| judged.warning(table)));
        }
        warnings.extend(self.steering_ratio().warning("steering"));
        warnings
    }

    fn tyre_values(&self, wheel: Wheel) -> Vec<Judged> {
        let load_n = self.static_load_n(wheel);
        let Axle { tyre, unsprung, .. } = self.axle(wheel);
        let mut found = vec![
            Judged {
                field: "tyre.vertical_stiffness_n_m",
                written: tyre.vertical_stiffness_n_m,
                unit: "N/m",
                quantity: "a tyre deflection at rest, in parts of the radius,",
                follows: load_n / tyre.vertical_stiffness_n_m / tyre.unloaded_radius_m,
                power: -1.0,
                usual: [0.005, 0.3],
                others: &[("N/mm", PER_MILLIMETRE), ("lbf/in", PER_INCH)],
            },
            Judged {
                field: "tyre.cornering_stiffness_n_rad",
                written: tyre.cornering_stiffness_n_rad,
                unit: "N/rad",
                quantity: "a lateral force per load and radian of slip angle",
                follows: tyre.cornering_stiffness_n_rad / tyre.reference_load_n,
                power: 1.0,
                usual: [1.0, 50.0],
                others: &[("N/deg", PER_DEGREE)],
            },
            Judged {
                field: "tyre.reference_load_n",
                written: tyre.reference_load_n,
                unit: "N",
                quantity: "a part of the load at rest",
                follows: tyre.reference_load_n / load_n,
                power: 1.0,
                usual: [0.2, 6.0],
                others: &[("kg", STANDARD_GRAVITY_M_S2), ("kN", 1e3)],
            },
        ];
        if let Some(unsprung) = unsprung {
            let rim = unsprung.wheel_mass_kg * tyre.unloaded_radius_m.powi(2);
            found.push(Judged {
                field: "unsprung.wheel_spin_inertia_kg_m2",
                written: unsprung.wheel_spin_inertia_kg_m2,
                unit: "kg m^2",
                quantity: "a part of the mass of the wheel times the square of its radius",
                follows: unsprung.wheel_spin_inertia_kg_m2 / rim,
                power: 1.0,
                usual: [0.1, 2.0],
                others: &[("kg cm^2", 1e-4)],
            });
        }
        found
    }

    /// Spring, damper and preload at the wheel; none where the file has no strut or no masses.
    fn strut_values(&self, wheel: Wheel) -> Vec<Judged> {
        let axle = self.axle(wheel);
        let (Some(strut), Some(unsprung)) = (&axle.strut, &axle.unsprung) else {
            return Vec::new();
        };
        let by_points = Corner::of(self, wheel)
            .and_then(|corner| corner.jounce_point(0.0, axle.tyre.unloaded_radius_m));
        let Some(ratio) = by_points.map_or(strut.motion_ratio, |point| Some(point.motion_ratio))
        else {
            return Vec::new();
        };
        let carried_n =
            self.static_load_n(wheel) - unsprung.total_mass_kg() * STANDARD_GRAVITY_M_S2;
        let mass_kg = carried_n / STANDARD_GRAVITY_M_S2;
        let rate_n_m = strut.stiffness_n_m * ratio * ratio;
        let preload_n = strut.stiffness_n_m * (strut.free_length_m - strut.design_length_m);
        let critical_n_s_m = 2.0 * (rate_n_m * mass_kg).sqrt();
        vec![
            Judged {
                field: "strut.stiffness_n_m",
                written: strut.stiffness_n_m,
                unit: "N/m",
                quantity: "a natural frequency of the body on this spring, in Hz,",
                follows: (rate_n_m / mass_kg).sqrt() / std::f64::consts::TAU,
                power: 0.5,
                usual: [0.5, 6.0],
                others: &[("N/mm", PER_MILLIMETRE), ("lbf/in", PER_INCH)],
            },
            Judged {
                field: "strut.damping_n_s_m",
                written: strut.damping_n_s_m,
                unit: "N s/m",
                quantity: "a damping ratio of the body",
                follows: strut.damping_n_s_m * ratio * ratio / critical_n_s_m,
                power: 1.0,
                usual: [0.03, 3.0],
                others: &[("N s/mm", PER_MILLIMETRE)],
            },
            Judged {
                field: "strut.free_length_m",
                written: strut.free_length_m,
                unit: "m",
                quantity: "a force of the spring in the design position, in parts of what it carries at rest,",
                follows: preload_n * ratio / carried_n,
                power: 1.0,
                usual: [0.5, 1.7],
                others: &[],
            },
        ]
    }

    fn steering_ratio(&self) -> Judged {
        Judged {
            field: "ratio",
            written: self.steering.ratio,
            unit: "",
            quantity: "an angle of the steering wheel over the angle of the road wheels",
            follows: self.steering.ratio,
            power: 1.0,
            usual: [1.0, 40.0],
            others: &[],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The warnings of the Prowler with one value replaced.
    fn warnings(from: &str, to: &str) -> Vec<(String, String)> {
        let text = Vehicle::builtin_text("prowler").unwrap();
        assert!(text.contains(from), "{from}");
        let vehicle = Vehicle::from_toml(&text.replacen(from, to, 1), "odd.toml").unwrap();
        let warnings = vehicle.warnings().into_iter();
        warnings.map(|found| (found.field, found.text)).collect()
    }

    #[test]
    fn a_wrong_unit_is_named_with_the_value_in_the_right_one() {
        for (from, to, field, remedy) in [
            (
                "stiffness_n_m = 65000.0",
                "stiffness_n_m = 65.0",
                "front.strut.stiffness_n_m",
                "probably in N/mm; write 65000 N/m",
            ),
            (
                "stiffness_n_m = 65000.0",
                "stiffness_n_m = 371.2",
                "front.strut.stiffness_n_m",
                "probably in lbf/in; write 65007",
            ),
            (
                "vertical_stiffness_n_m = 120000.0",
                "vertical_stiffness_n_m = 120.0",
                "front.tyre.vertical_stiffness_n_m",
                "probably in N/mm; write 120000 N/m",
            ),
            (
                "cornering_stiffness_n_rad = 2987.5",
                "cornering_stiffness_n_rad = 52.1",
                "front.tyre.cornering_stiffness_n_rad",
                "probably in N/deg; write 2985 N/rad",
            ),
            (
                "damping_n_s_m = 3500.0",
                "damping_n_s_m = 3.5",
                "front.strut.damping_n_s_m",
                "probably in N s/mm; write 3500 N s/m",
            ),
            (
                "reference_load_n = 1327.0",
                "reference_load_n = 135.3",
                "front.tyre.reference_load_n",
                "probably in kg; write 1327 N",
            ),
            (
                "wheel_spin_inertia_kg_m2 = 0.741",
                "wheel_spin_inertia_kg_m2 = 7410.0",
                "front.unsprung.wheel_spin_inertia_kg_m2",
                "probably in kg cm^2; write 0.7410 kg m^2",
            ),
            (
                "free_length_m = 0.394975",
                "free_length_m = 0.36",
                "front.strut.free_length_m",
                "check the value",
            ),
            (
                "ratio = 9.16",
                "ratio = 0.109",
                "steering.ratio",
                "check the value",
            ),
        ] {
            let found = warnings(from, to);
            assert!(
                (found.iter()).any(|(name, text)| *name == field && text.contains(remedy)),
                "{to}: {found:?}"
            );
        }
    }
}
