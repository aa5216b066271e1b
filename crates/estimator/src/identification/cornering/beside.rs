//! What other methods make of the same drive.

use nalgebra::{DMatrix, DVector};

use super::{AxleRows, Body, Options};
use crate::finding::{Findings, Refusal};
use crate::identification::Drive;
use crate::identification::signals::{mean, spread};
use crate::regression::{self, Fit};

/// Slip angles below this are left out of equation 2.31's ratios, rad.
const RATIO_SLIP_MIN_RAD: f64 = 0.009;

/// Puts the other methods' values beside what was found.
pub(super) fn beside(
    found: &mut Findings,
    drive: &Drive,
    body: &Body,
    options: &Options,
    axles: &[AxleRows; 2],
    rows: &[usize],
) {
    let mut add = |name: &str, value: f64, unit: &str| {
        found.beside.push((name.to_owned(), value, unit.to_owned()));
    };
    let [front, rear] = equation_2_31(drive, body, rows);
    add("equation_2_31_front", front, "N/rad");
    add("equation_2_31_rear", rear, "N/rad");
    for (axle, name) in axles.iter().zip(["front", "rear"]) {
        let [by_force, by_total] = linear_methods(axle, options);
        add(&format!("force_on_slip_{name}"), by_force, "N/rad");
        add(&format!("total_least_squares_{name}"), by_total, "N/rad");
        let last = recursive(axle).last().copied().unwrap_or(f64::NAN);
        add(&format!("recursive_{name}"), last, "N/rad");
    }
}

/// Equation 2.31 of the thesis with its missing sign: the mean over the rows of force over slip
/// angle, front and rear, N/rad, both from m V r, the slip angles by small angles. Rows whose slip
/// angle is below half a degree are left out.
#[must_use]
pub fn equation_2_31(drive: &Drive, body: &Body, rows: &[usize]) -> [f64; 2] {
    let (a, b) = (body.front_axle_to_cg_m, body.cg_to_rear_axle_m);
    let (mut front, mut rear) = (Vec::new(), Vec::new());
    for &row in rows {
        let (speed, rate) = (drive.speed_m_s[row], drive.yaw_rate_rad_s[row]);
        let slip_front = drive.sideslip_rad[row] + a * rate / speed - drive.steer_rad[row];
        let slip_rear = drive.sideslip_rad[row] - b * rate / speed;
        let load = -body.mass_kg * speed * rate / (b / a + 1.0);
        if slip_rear.abs() > RATIO_SLIP_MIN_RAD {
            rear.push(load / slip_rear);
        }
        if slip_front.abs() > RATIO_SLIP_MIN_RAD {
            front.push(b / a * load / slip_front);
        }
    }
    [mean(front), mean(rear)]
}

/// Least squares of force on slip angle, and total least squares, both linear with an offset.
fn linear_methods(axle: &AxleRows, options: &Options) -> [f64; 2] {
    let n = axle.slip.len();
    let design = DMatrix::from_fn(n, 2, |i, j| if j == 0 { 1.0 } else { -axle.slip[i] });
    let response = DVector::from_column_slice(&axle.force_n);
    let slope = |fit: Result<Fit, Refusal>| fit.map_or(f64::NAN, |fit| fit.coefficients[1]);
    let errors = DMatrix::from_diagonal(&DVector::from_vec(vec![
        0.0,
        options.slip_sigma_rad.powi(2),
        options.force_sigma_n.powi(2),
    ]));
    [
        slope(regression::least_squares(&design, &response)),
        slope(regression::total(&design, &response, &errors)),
    ]
}

/// Recursive least squares of slip angle on force with an offset: the stiffness after each row,
/// N/rad. Rows are forgotten over `MEMORY` rows; a row whose force lies near the mean of those
/// before teaches nothing of the slope, and is left out so that the memory does not fade on a
/// straight.
#[must_use]
pub(super) fn recursive(axle: &AxleRows) -> Vec<f64> {
    const MEMORY: f64 = 200.0;
    /// Least distance from the mean force, part of the force's standard deviation.
    const GATE: f64 = 0.5;
    let spread_n = spread(&axle.force_n);
    let forget = 1.0 - 1.0 / MEMORY;
    // Weighted sums: 1, F, F^2, alpha, F alpha.
    let mut sums = [0.0_f64; 5];
    let mut stiffness = f64::NAN;
    let rows = axle.force_n.iter().zip(&axle.slip);
    rows.map(|(&force, &slip)| {
        let middle = if sums[0] > 0.0 {
            sums[1] / sums[0]
        } else {
            0.0
        };
        if (force - middle).abs() >= GATE * spread_n {
            let row = [1.0, force, force * force, slip, force * slip];
            for (sum, value) in sums.iter_mut().zip(row) {
                *sum = *sum * forget + value;
            }
            let [n, f, ff, s, fs] = sums;
            let moved = ff - f * f / n;
            if n > 10.0 && moved > n * (GATE * spread_n).powi(2) {
                stiffness = -moved / (fs - f * s / n);
            }
        }
        stiffness
    })
    .collect()
}
