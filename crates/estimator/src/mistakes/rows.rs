//! Errors of the rows and of the parameters before the drive.

use super::evidence::Setup;
use super::layout::{
    BIAS, FIRST_MOMENT, GAIN, HEIGHT, LEVER, MASS, OFFSET, PRELOAD, RATE, SCALE, SHAPE, TILT,
};
use super::linear;
use crate::fusion::relations::{ACCEL_ROW, ROWS, RelationWindow, STRUT_ROW, TURN_ROW, UNKNOWNS};
use crate::statics::AXIAL;
use crate::tuning::MistakeTuning;

/// Covariance of the rows with the unknowns integrated out.
pub(super) fn covariance_of_rows(
    window: &RelationWindow,
    setup: &Setup,
    t: &MistakeTuning,
) -> [f64; ROWS * ROWS] {
    let tilted_n_m = tilted_moments(window, setup);
    let mut sum = [0.0; ROWS * ROWS];
    let unknown: [f64; UNKNOWNS] =
        std::array::from_fn(|k| unknown_sigma(window, setup, k, &tilted_n_m, t));
    for i in 0..ROWS {
        let scaled: [f64; UNKNOWNS] =
            std::array::from_fn(|k| window.gains[i][k] * unknown[k] * unknown[k]);
        for j in 0..=i {
            sum[i * ROWS + j] = linear::dot(&scaled, &window.gains[j]);
        }
        sum[i * ROWS + i] += row_variance(window, i, setup, &tilted_n_m, t);
    }
    sum
}

/// Moment of each load about the wheel's centre by a ground's normal that is not known, N m.
pub(super) fn tilted_moments(window: &RelationWindow, setup: &Setup) -> [f64; 4] {
    std::array::from_fn(|wheel| {
        let load_n = window.loads.force_n[3 * wheel + 2].max(0.0);
        window.tilt_rad * load_n * setup.radius_m[wheel]
    })
}

/// The errors of the rows where all parameters are exact.
pub(super) fn exact(tuning: &MistakeTuning, setup: &Setup) -> MistakeTuning {
    let mut t = *tuning;
    let counts_n = setup.count_n.iter().map(|count| count.abs());
    let resolution = counts_n.fold(0.0, f64::max) / setup.load_n;
    let part = math::hypot(t.exact_part, t.exact_counts * resolution);
    for sigma in [
        &mut t.member_sigma,
        &mut t.strut_sigma,
        &mut t.accel_sigma_m_s2,
        &mut t.turn_sigma_rad_s2,
    ] {
        *sigma *= part;
    }
    t
}

/// Variance of what changes in a row from window to window.
fn row_variance(
    window: &RelationWindow,
    row: usize,
    setup: &Setup,
    tilted_n_m: &[f64; 4],
    t: &MistakeTuning,
) -> f64 {
    if !window.has(row) {
        // So large that the row has no weight.
        return 1e18;
    }
    let load = setup.load_n;
    let squares = |own: f64, part: f64, density: f64| own * own + part * part * density.max(0.0);
    match row {
        0..STRUT_ROW => squares(
            t.member_sigma * load,
            t.road_member,
            window.roads[row / AXIAL.len()],
        ),
        STRUT_ROW..ACCEL_ROW => {
            let wheel = row - STRUT_ROW;
            let mass = window.loads.strut_mass_kg[wheel];
            squares(t.strut_sigma * load, t.road_member, window.roads[wheel]) / (mass * mass)
        }
        ACCEL_ROW..TURN_ROW => {
            squares(setup.mass_kg * t.accel_sigma_m_s2, t.road_body, window.road)
        }
        _ => {
            let axis = row - TURN_ROW;
            let moments: f64 = tilted_n_m.iter().map(|moment| moment * moment).sum();
            let tilted = t.tilt_turn * setup.inverse[(axis, axis)];
            squares(t.turn_sigma_rad_s2, t.road_turn, window.road) + tilted * tilted * moments
        }
    }
}

/// Standard deviation of an unknown before the readings.
pub(super) fn unknown_sigma(
    window: &RelationWindow,
    setup: &Setup,
    unknown: usize,
    tilted_n_m: &[f64; 4],
    t: &MistakeTuning,
) -> f64 {
    let load = setup.load_n;
    let lever = load * setup.radius_m.iter().sum::<f64>() / 4.0;
    match unknown {
        0..12 => t.force_sigma[unknown % 3] * load,
        12..20 => math::hypot(t.moment_sigma * lever, tilted_n_m[(unknown - 12) / 2]),
        20..24 => load * t.strut_error + t.damping_error * window.damper_n[unknown - 20].abs(),
        24..26 => t.torque_sigma[0] * lever,
        _ => t.torque_sigma[1] * lever,
    }
}

/// Standard deviation of a parameter that is no mistake.
pub(super) fn tolerance(at: usize, setup: &Setup, t: &MistakeTuning) -> f64 {
    match at {
        OFFSET..GAIN => setup.offset_sigma_n[at],
        GAIN..SHAPE => t.gain_tolerance,
        SHAPE..PRELOAD => {
            let [member, axis] = [(at - SHAPE) / 3, (at - SHAPE) % 3];
            let stated = setup.stated.shape.as_ref();
            let exact = t.care_exact * t.shape_tolerance;
            stated.map_or(t.shape_tolerance, |shape| {
                shape.members[member][axis].max(exact)
            })
        }
        PRELOAD..RATE => {
            let usual = t.preload_tolerance * setup.load_n;
            let stated = setup.stated.preload_n;
            stated.map_or(usual, |sigma_n| {
                sigma_n[at - PRELOAD].max(t.care_exact * usual)
            })
        }
        RATE..MASS => t.rate_tolerance,
        MASS => t.mass_tolerance * setup.mass_kg,
        FIRST_MOMENT..HEIGHT => t.cg_tolerance_m * setup.mass_kg,
        HEIGHT => t.height_tolerance_m * setup.mass_kg,
        BIAS..TILT => setup.bias_sigma_m_s2,
        TILT..LEVER => t.tilt_tolerance_rad,
        LEVER..SCALE => t.lever_tolerance_m,
        _ => t.scale_tolerance,
    }
}
