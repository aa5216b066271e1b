//! Needed columns that a truth file may leave out, because other columns give the same values.

use nalgebra::Vector3;

use super::Columns;
use crate::TruthState;
use crate::linkage::slope;

/// Position, whose derivative is the velocity.
const POSITION: [&str; 3] = ["X[m]", "Y[m]", "Z[m]"];

/// Needed columns that are absent and cannot be derived. Where a file has a part of what a column is
/// derived from, the rest of that part is named instead.
pub(super) fn missing(columns: &Columns, needed: impl Iterator<Item = String>) -> Vec<String> {
    let has = |name: &str| columns.contains_key(name);
    let mut missing: Vec<String> = Vec::new();
    for name in needed.filter(|name| !has(name)) {
        for name in substitutes(&name, has).unwrap_or_else(|| vec![name]) {
            if !missing.contains(&name) {
                missing.push(name);
            }
        }
    }
    missing
}

/// What is absent of the columns that an absent column is derived from; `None` where it cannot be
/// derived.
fn substitutes(name: &str, has: impl Fn(&str) -> bool) -> Option<Vec<String>> {
    if matches!(name, "vx_body[m/s]" | "vy_body[m/s]" | "vz_body[m/s]") {
        let absent = POSITION.iter().filter(|name| !has(name));
        let absent: Vec<String> = absent.map(|&name| name.to_owned()).collect();
        return (absent.len() < POSITION.len()).then_some(absent);
    }
    let (wheel, of_wheel) = name.split_once('_')?;
    if !matches!(of_wheel, "Fx[N]" | "Fy[N]" | "Fz[N]") {
        return None;
    }
    let has = |name: &str| has(&format!("{wheel}_{name}"));
    let force = |stem: &str| ["x", "y", "z"].map(|axis| format!("{stem}_{axis}[N]"));
    let forces = ["Fchassis", "Fcar"].map(force);
    let whole = forces.iter().any(|axes| axes.iter().all(|name| has(name)));
    let begun = forces.iter().find(|axes| axes.iter().any(|name| has(name)));
    let mut absent: Vec<String> = match begun {
        None => return None,
        Some(_) if whole => Vec::new(),
        Some(axes) => axes.iter().filter(|name| !has(name)).cloned().collect(),
    };
    if !has("steer[rad]") {
        absent.push("steer[rad]".to_owned());
    }
    if !has("incl_body[rad]") && !has("camber[rad]") {
        absent.push("incl_body[rad]".to_owned());
    }
    Some(
        absent
            .iter()
            .map(|name| format!("{wheel}_{name}"))
            .collect(),
    )
}

/// Velocities that are missing: the derivative of the position, in body axes.
pub(super) fn velocities(states: &mut [TruthState]) {
    for row in 0..states.len() {
        if states[row].velocity_body_m_s.iter().all(|v| v.is_finite()) {
            continue;
        }
        let earth: [f64; 3] =
            std::array::from_fn(|axis| slope(states, row, |s| s.position_m[axis]));
        let body = states[row].earth_from_body().inverse() * Vector3::from(earth);
        for (velocity, derived) in states[row].velocity_body_m_s.iter_mut().zip(&body) {
            if velocity.is_nan() {
                *velocity = *derived;
            }
        }
    }
}
