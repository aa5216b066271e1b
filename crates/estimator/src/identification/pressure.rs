//! Tyre parameters and the inflation pressure (section 2.4.5 of the thesis): values at the nominal pressure from a drive
//! at another one, and the change with the pressure from two drives.
//!
//! With the values v_1 and v_2 of a parameter at dp_1 and dp_2 (see [`model::vehicle::TyrePressure`]), the law
//! v = v_0 (1 + c dp) has
//!
//! c = (v_2 - v_1)/D, v_0 = D/(dp_2 - dp_1), D = v_1 dp_2 - v_2 dp_1
//!
//! and, with independent errors of the two drives, the variance of c is
//! ((dp_2 - dp_1)/D^2)^2 (v_2^2 s_1^2 + v_1^2 s_2^2). The pressures are taken as exact.
//!
//! The force filter needs the vertical stiffness at each pressure: the compression of the tyres tells the lean of the
//! body over the ground, and a wrong lean makes the lateral forces wrong by the same part in each turn.

use model::vehicle::pressure_change;

use super::method::AXLES;
use super::{Identified, Overrides, Recorded};
use crate::finding::{Finding, Findings, Span};
use crate::statistics::interval_95;

/// Names of what a result of `identify tyre` has beside its findings, Pa.
const PRESSURE: &str = "tyre_pressure";
const NOMINAL: &str = "nominal_pressure";
/// Change of the vertical stiffness that the vehicle file has.
const VERTICAL: &str = "vertical_stiffness_change";
/// Note of drives whose vehicle file has no change of the vertical stiffness.
const NO_VERTICAL: &str = "the vehicle file has no vertical_stiffness_change of this tyre: the lateral forces of both \
                           drives are wrong by the difference of the vertical stiffness, and the change of the \
                           cornering stiffness comes out too small; measure the compression of the tyre over its load \
                           at both pressures, enter the change, and replay both logs";
/// Least difference of the relative pressures of two drives.
const CHANGE_MIN: f64 = 0.05;
/// Findings that change with the pressure: name, field of the tyre, and field of its law.
const CHANGING: [(&str, &str, &str); 2] = [
    (
        "cornering_stiffness",
        "cornering_stiffness_n_rad",
        "cornering_stiffness_change",
    ),
    ("friction", "friction", "friction_change"),
];
/// Changes that a vehicle file can have.
const CHANGE_RANGE: [f64; 2] = [-0.9, 1.9];

/// Notes mean and nominal pressure of an axle (0 front) beside the findings of its tyre.
pub(super) fn note(found: &mut Findings, recorded: &Recorded, axle: usize) {
    let nominal = &recorded.nominal;
    let tyre = [&nominal.front.tyre, &nominal.rear.tyre][axle];
    let pressure_pa = recorded.pressures_pa[axle];
    let vertical = tyre
        .pressure
        .as_ref()
        .map(|law| law.vertical_stiffness_change);
    let driven = pressure_pa.is_finite().then_some(pressure_pa);
    let known = [
        (PRESSURE, driven, "Pa"),
        (NOMINAL, tyre.nominal_pressure_pa(), "Pa"),
        (VERTICAL, driven.and(vertical), "-"),
    ];
    for (name, value, unit) in known {
        let value = value.map(|value| (name.to_owned(), value, unit.to_owned()));
        found.beside.extend(value);
    }
}

/// Brings overrides of tyres that were found at the pressures of a drive to the nominal pressures, for which the values
/// of a vehicle file hold.
pub(super) fn to_nominal(overrides: &mut Overrides, recorded: &Recorded) {
    let (nominal, driven) = (&recorded.nominal, &recorded.vehicle);
    let axles = [
        (&nominal.front, &driven.front),
        (&nominal.rear, &driven.rear),
    ];
    for (name, (nominal, driven)) in AXLES.into_iter().zip(axles) {
        let (nominal, driven) = (&nominal.tyre, &driven.tyre);
        for (field, at_nominal, as_driven) in [
            (
                "cornering_stiffness_n_rad",
                nominal.cornering_stiffness_n_rad,
                driven.cornering_stiffness_n_rad,
            ),
            (
                "slip_stiffness_n",
                nominal.slip_stiffness_n,
                driven.slip_stiffness_n,
            ),
            ("friction", nominal.friction, driven.friction),
        ] {
            overrides.scale(&format!("{name}.tyre.{field}"), at_nominal / as_driven);
        }
    }
}

/// The change of each tyre with its pressure from two sets of `identify tyre`, one result for each tyre and model that
/// both sets have, with the fields of the vehicle file by Fiala's model. Empty if the pressure of no tyre was recorded
/// in both drives. The nominal pressure is that of the vehicle file, else that of the first set.
#[must_use]
pub fn laws(own: &[Findings], other: &[Findings]) -> Identified {
    let mut found = Identified::default();
    for a in own {
        let Some(b) = other.iter().find(|b| b.what == a.what) else {
            continue;
        };
        let [Some(first_pa), Some(other_pa)] = [a, b].map(|set| beside(set, PRESSURE)) else {
            continue;
        };
        let nominal_pa = beside(a, NOMINAL).unwrap_or(first_pa);
        let changes = [first_pa, other_pa].map(|pressure| pressure_change(pressure, nominal_pa));
        let mut result = Findings {
            what: format!("{}: change with the pressure", a.what),
            beside: [
                ("pressure of the first set", first_pa),
                ("pressure of the other set", other_pa),
                ("nominal pressure", nominal_pa),
            ]
            .map(|(name, value)| (name.to_owned(), value, "Pa".to_owned()))
            .to_vec(),
            ..Findings::default()
        };
        if (changes[1] - changes[0]).abs() < CHANGE_MIN {
            result.notes.push(format!(
                "the pressures {:.0} and {:.0} kPa differ by less than {:.0} % of the nominal {:.0} kPa: no change is \
                 found; drive with pressures that differ more",
                1e-3 * first_pa,
                1e-3 * other_pa,
                100.0 * CHANGE_MIN,
                1e-3 * nominal_pa
            ));
        } else {
            laws_of(
                [a, b],
                changes,
                &mut result,
                &mut found.overrides,
                nominal_pa,
            );
            let unknown = |set: &Findings| beside(set, VERTICAL).is_none_or(|change| change == 0.0);
            if unknown(a) || unknown(b) {
                result.notes.push(NO_VERTICAL.to_owned());
            }
        }
        found.results.push(result);
    }
    found
}

/// Adds the changes of one tyre.
fn laws_of(
    sets: [&Findings; 2],
    changes: [f64; 2],
    result: &mut Findings,
    overrides: &mut Overrides,
    nominal_pa: f64,
) {
    let axle = AXLES.into_iter().find(|axle| result.what.starts_with(axle));
    let axle = axle.filter(|_| result.what.contains("(fiala)"));
    for (name, field, change_field) in CHANGING {
        let [Some(a), Some(b)] = sets.map(|set| set.get(name)) else {
            continue;
        };
        let [at_nominal, change, sigma] = law([[a.value, a.sigma], [b.value, b.sigma]], changes);
        if !(at_nominal > 0.0 && sigma.is_finite()) {
            continue;
        }
        result.findings.push(Finding {
            name: change_field.to_owned(),
            value: change,
            unit: "-".to_owned(),
            sigma,
            interval: Some(interval_95(change, sigma)),
            condition: f64::NAN,
            excitation: None,
            whiteness: None,
            span: Span::default(),
        });
        let at = format!("{name} at the nominal pressure");
        result.beside.push((at, at_nominal, a.unit.clone()));
        let [least, most] = CHANGE_RANGE;
        if !(least..=most).contains(&change) {
            result.notes.push(format!(
                "{change_field}: {change:.2} is outside of the {least} to {most} of a vehicle file and is not proposed; \
                 drive with pressures that differ more"
            ));
        } else if let Some(axle) = axle {
            overrides.set(&format!("{axle}.tyre.pressure.nominal_pa"), nominal_pa);
            overrides.set(&format!("{axle}.tyre.pressure.{change_field}"), change);
            overrides.set(&format!("{axle}.tyre.{field}"), at_nominal);
        }
    }
}

/// v_0, c and the standard deviation of c from values with standard deviations at two relative pressures.
fn law([[v1, s1], [v2, s2]]: [[f64; 2]; 2], [dp1, dp2]: [f64; 2]) -> [f64; 3] {
    let denominator = v1 * dp2 - v2 * dp1;
    let apart = dp2 - dp1;
    let sigma = apart.abs() / denominator.powi(2) * math::hypot(v2 * s1, v1 * s2);
    [denominator / apart, (v2 - v1) / denominator, sigma]
}

fn beside(set: &Findings, wanted: &str) -> Option<f64> {
    let found = set.beside.iter().find(|(name, ..)| name == wanted);
    found.map(|(_, value, _)| *value)
}

#[cfg(test)]
mod tests {
    use math::Random;

    use super::*;

    /// The stated standard deviation is that of many repetitions.
    #[test]
    fn the_standard_deviation_of_the_change_is_that_of_repetitions() {
        let (v0, c, changes, sigma) = (8000.0, 0.4, [-0.3, 0.25], [120.0, 90.0]);
        let mut random = Random::new(7);
        let (mut inside, mut sum, mut square) = (0, 0.0, 0.0);
        for _ in 0..2000 {
            let values = [0, 1].map(|k| {
                let value = v0 * (1.0 + c * changes[k]) + sigma[k] * random.normal();
                [value, sigma[k]]
            });
            let [_, found, stated] = law(values, changes);
            inside += u32::from((found - c).abs() < 1.96 * stated);
            sum += found - c;
            square += (found - c).powi(2) / stated.powi(2);
        }
        assert!((sum / 2000.0).abs() < 0.003, "{}", sum / 2000.0);
        assert!(
            (0.9..1.1).contains(&(square / 2000.0)),
            "{}",
            square / 2000.0
        );
        assert!((1860..1940).contains(&inside), "{inside}");
        let [at_nominal, found, _] = law([[7040.0, 1.0], [8800.0, 1.0]], changes);
        assert!((at_nominal - v0).abs() < 1e-9 && (found - c).abs() < 1e-12);
    }
}
