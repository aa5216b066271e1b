//! Friction between tyre and ground, from measured force and slip.
//!
//! Far below its grip a tyre's force hangs on its stiffness alone: such a drive bounds the friction
//! from below and tells no more, which is said instead of a guess. What counts is the slip angle as a
//! part of the one from which Fiala's tyre slides, z = C |alpha|/(3 mu F_z): where z stays below
//! 0.35 (three quarters of the grip), a tenth of a degree of sideslip's error bends the curve as much
//! as a third of the friction does.

use super::tyre::{Data, Kind, UTILISATION_MIN, fit, percentile_99, utilisation};
use crate::finding::{Findings, Refusal};

const WHAT: &str = "friction";
/// Least part of the sliding slip angle that the tyres must have seen.
const SLIDING_MIN: f64 = 0.35;

/// Finds the friction coefficient of an axle's tyres with Fiala's tyre; `reference_load_n` is the
/// load that its stiffness is given for, `load_exponent` what the vehicle file says.
///
/// Findings: `friction` (-). Beside: the greatest part of its load that the tyre used (99th
/// percentile), which friction is not below.
///
/// # Errors
/// As for the tyre; a drive that never comes near the limit.
pub fn identify(
    data: &Data,
    reference_load_n: f64,
    load_exponent: f64,
    seed: u64,
) -> Result<Findings, Refusal> {
    let used = utilisation(data);
    let (mut found, _) = fit(
        data,
        Kind::Fiala,
        reference_load_n,
        [load_exponent, 1.0],
        seed,
    )
    .map_err(|refusal| refusal.of(WHAT))?;
    let help = format!(
        "friction is {used:.2} at least; drive nearer to the limit, such as a circle whose speed \
         rises until the vehicle slides"
    );
    let refuse = |quantity: &str, found, needed| Refusal::NotExcited {
        what: WHAT.to_owned(),
        quantity: quantity.to_owned(),
        found,
        needed,
        unit: "-".to_owned(),
        help: help.clone(),
    };
    let [friction, _] = found.value("friction");
    if friction.is_nan() {
        let quantity = "the part of their load that the tyres used (99th percentile of |F_y|/F_z)";
        return Err(refuse(quantity, used, UTILISATION_MIN));
    }
    let sliding = sliding_part(data, &found, reference_load_n, load_exponent);
    if !(friction > 0.0 && sliding >= SLIDING_MIN) {
        let quantity = "the part of the sliding slip angle that the tyres saw (99th percentile)";
        return Err(refuse(quantity, sliding, SLIDING_MIN));
    }
    WHAT.clone_into(&mut found.what);
    found.findings.retain(|finding| finding.name == "friction");
    found.covariance.clear();
    found
        .beside
        .push(("used_part_of_load".to_owned(), used, "-".to_owned()));
    Ok(found)
}

/// 99th percentile of C |alpha|/(3 mu F_z).
fn sliding_part(data: &Data, found: &Findings, reference_load_n: f64, exponent: f64) -> f64 {
    let value = |name: &str| found.value(name)[0];
    let power = match value("load_exponent") {
        told if told.is_finite() => told,
        _ => exponent,
    };
    let rows = data.slip_angle_rad.iter().zip(&data.load_n);
    let parts = rows.filter(|(_, load)| **load > 50.0).map(|(slip, load)| {
        let stiffness = value("cornering_stiffness") * math::powf(load / reference_load_n, power);
        stiffness * (slip - value("slip_angle_offset")).abs() / (3.0 * value("friction") * load)
    });
    percentile_99(parts.filter(|part| part.is_finite()).collect())
}
