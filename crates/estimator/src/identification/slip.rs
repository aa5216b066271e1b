//! Longitudinal stiffness of an axle's tyres, from the slip and the force of both wheels while the vehicle speeds up
//! and brakes (section 5.3.2 of the thesis).
//!
//! The slip has more noise than the force: a wheel speed of half a per cent is as much as a tenth of the slip of a
//! hard start. A regression of the force on the slip would find a stiffness that is too small. So the slip is
//! regressed on the force:
//!
//! kappa = G/C + kappa_0 + e (F_z/F_zm - 1)
//!
//! G = 3 mu F_z (1 - (1 - |F_x|/(mu F_z))^(1/3)) sign(F_x) (F_z0/F_z)^n
//!
//! is the force that a linear tyre would have at the same slip, by the inverse of Fiala's parabola. C is the
//! stiffness of one tyre at the reference load F_z0, n the load exponent, mu the friction of the vehicle file. An
//! error of the rolling radius of a wheel is its constant kappa_0. The rolling radius also changes with the load, by
//! another part of the deflection than the third that the slip supposes: e is that error for the mean load F_zm.

use nalgebra::{DMatrix, DVector};

use super::drive::{series, span_of};
use super::signals::{mean, smooth, spread, stride};
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal};
use crate::regression::{Fit, least_squares};

const WHAT: &str = "longitudinal stiffness";
const ADVICE: &str =
    "speed up from a standstill with much throttle, then brake hard, straight ahead";
/// Low-pass of slip and force.
const CUTOFF_HZ: f64 = 2.0;
/// Least data, s.
const DATA_MIN_S: f64 = 3.0;
/// Load below which a wheel is not used, N.
const LOAD_MIN_N: f64 = 100.0;
/// Largest lateral force over the load: combined slip is not modelled.
const LATERAL_MAX: f64 = 0.2;
/// Largest force over mu F_z: near the grip, the shape of the curve counts more than its slope.
const USED_MAX: f64 = 0.7;
/// Least standard deviation of the force over the load.
const FORCE_MIN: f64 = 0.05;
/// Relative standard deviations of the friction and of the load exponent of the vehicle file.
const DOUBT: [f64; 2] = [0.1, 0.15];

/// Force and slip of one wheel, `NaN` where unknown; columns of one length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Data {
    /// Longitudinal slip.
    pub slip: Vec<f64>,
    /// Force along the wheel, N.
    pub longitudinal_n: Vec<f64>,
    /// Force across it, N.
    pub lateral_n: Vec<f64>,
    /// Load, N.
    pub load_n: Vec<f64>,
}

/// What the vehicle file says of the tyres, and how the intervals are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Interval between rows, s.
    pub dt_s: f64,
    /// Load that the stiffness is given for, N.
    pub reference_load_n: f64,
    /// Exponent of the stiffness over the load.
    pub load_exponent: f64,
    /// Friction coefficient.
    pub friction: f64,
    /// Seed of the bootstrap.
    pub seed: u64,
}

/// Usable values of both wheels, left ones first.
struct Rows {
    slip: Vec<f64>,
    force_n: Vec<f64>,
    load_n: Vec<f64>,
    /// Rows of the left wheel.
    left: usize,
    /// Rows in the columns of the wheels.
    places: Vec<usize>,
}

/// Finds the longitudinal stiffness of an axle's tyres.
///
/// Findings: `slip_stiffness` (one tyre at the reference load, N per unit slip), `slip_by_load` (e),
/// `slip_offset_left` and `slip_offset_right`.
///
/// # Errors
/// Columns that differ in length, too little data, forces that do not change.
pub fn identify(wheels: &[Data; 2], options: &Options) -> Result<Findings, Refusal> {
    let rows = usable(wheels, options)?;
    let fit = fitted(&rows, options)?;
    let moved = [
        Options {
            friction: options.friction * (1.0 + DOUBT[0]),
            ..*options
        },
        Options {
            load_exponent: options.load_exponent + DOUBT[1],
            ..*options
        },
    ]
    .map(|other| fitted(&rows, &other).map(|other| difference(&other, &fit)));
    let mut fit = fit;
    for moved in moved {
        fit.doubt(&moved?);
    }
    Ok(findings(&fit, &rows, options))
}

fn difference(other: &Fit, fit: &Fit) -> DVector<f64> {
    let pairs = other.coefficients.iter().zip(&fit.coefficients);
    DVector::from_iterator(fit.coefficients.len(), pairs.map(|(a, b)| a - b))
}

fn usable(wheels: &[Data; 2], options: &Options) -> Result<Rows, Refusal> {
    let step = stride(options.dt_s, CUTOFF_HZ);
    let mut rows = Rows {
        slip: Vec::new(),
        force_n: Vec::new(),
        load_n: Vec::new(),
        left: 0,
        places: Vec::new(),
    };
    for (side, wheel) in wheels.iter().enumerate() {
        let expected = wheel.slip.len();
        for (name, column) in [
            ("longitudinal force", &wheel.longitudinal_n),
            ("lateral force", &wheel.lateral_n),
            ("load", &wheel.load_n),
        ] {
            if column.len() != expected {
                return Err(Refusal::Length {
                    what: WHAT.to_owned(),
                    name: name.to_owned(),
                    found: column.len(),
                    expected,
                });
            }
        }
        let smoothed = |column: &[f64]| smooth(column, options.dt_s, CUTOFF_HZ);
        let [slip, along, across, load] = [
            &wheel.slip,
            &wheel.longitudinal_n,
            &wheel.lateral_n,
            &wheel.load_n,
        ]
        .map(|column| smoothed(column));
        for row in (0..expected).step_by(step) {
            let used = along[row].abs() / (options.friction * load[row]);
            let known = (slip[row] + along[row] + across[row]).is_finite();
            let within = used < USED_MAX && across[row].abs() < LATERAL_MAX * load[row];
            if known && load[row] > LOAD_MIN_N && within {
                rows.slip.push(slip[row]);
                rows.force_n.push(along[row]);
                rows.load_n.push(load[row]);
                rows.places.push(row);
            }
        }
        if side == 0 {
            rows.left = rows.slip.len();
        }
    }
    let found_s = rows.slip.len() as f64 * step as f64 * options.dt_s / 2.0;
    if found_s < DATA_MIN_S {
        return Err(Refusal::TooShort {
            what: WHAT.to_owned(),
            found_s,
            needed_s: DATA_MIN_S,
            help: ADVICE.to_owned(),
        });
    }
    let pairs = rows.force_n.iter().zip(&rows.load_n);
    let found = spread(&pairs.map(|(force, load)| force / load).collect::<Vec<_>>());
    if found < FORCE_MIN {
        return Err(Refusal::NotExcited {
            what: WHAT.to_owned(),
            quantity: "the standard deviation of the longitudinal force over the load".to_owned(),
            found,
            needed: FORCE_MIN,
            unit: "-".to_owned(),
            help: ADVICE.to_owned(),
        });
    }
    Ok(rows)
}

/// Force that a linear tyre at the reference load would have at the slip of this force and load, N.
fn linear_force_n(force_n: f64, load_n: f64, options: &Options) -> f64 {
    let grip_n = options.friction * load_n;
    let part = (force_n.abs() / grip_n).min(1.0);
    let at_load = math::powf(load_n / options.reference_load_n, options.load_exponent);
    3.0 * grip_n * (1.0 - math::powf(1.0 - part, 1.0 / 3.0)) * force_n.signum() / at_load
}

fn fitted(rows: &Rows, options: &Options) -> Result<Fit, Refusal> {
    let size = rows.slip.len();
    let both = rows.left > 0 && rows.left < size;
    let mean_n = mean(rows.load_n.iter().copied());
    let design = DMatrix::from_fn(size, if both { 4 } else { 3 }, |row, column| match column {
        0 => linear_force_n(rows.force_n[row], rows.load_n[row], options),
        1 => rows.load_n[row] / mean_n - 1.0,
        2 => f64::from(!both || row < rows.left),
        _ => f64::from(row >= rows.left),
    });
    least_squares(&design, &DVector::from_column_slice(&rows.slip))
        .map_err(|refusal| refusal.of(WHAT).advise(ADVICE))
}

fn findings(fit: &Fit, rows: &Rows, options: &Options) -> Findings {
    let parameters = |coefficients: &[f64]| {
        let mut values = coefficients.to_vec();
        values[0] = values[0].recip();
        values
    };
    let values = parameters(&fit.coefficients);
    let intervals = fit.intervals(options.seed, parameters);
    let mut places = rows.places.clone();
    places.sort_unstable();
    let span = span_of(&places, options.dt_s, stride(options.dt_s, CUTOFF_HZ));
    let both = rows.left > 0 && rows.left < rows.slip.len();
    let names: &[&str] = match (both, rows.left > 0) {
        (true, _) => &[
            "slip_stiffness",
            "slip_by_load",
            "slip_offset_left",
            "slip_offset_right",
        ],
        (false, true) => &["slip_stiffness", "slip_by_load", "slip_offset_left"],
        (false, false) => &["slip_stiffness", "slip_by_load", "slip_offset_right"],
    };
    let size = values.len();
    let jacobian = DMatrix::from_fn(size, size, |i, j| match (i, j) {
        (0, 0) => -values[0] * values[0],
        _ => f64::from(i == j),
    });
    let covariance = fit.propagated(&jacobian);
    let found = names.iter().enumerate().map(|(j, name)| Finding {
        name: (*name).to_owned(),
        value: values[j],
        unit: if j == 0 { "N" } else { "-" }.to_owned(),
        sigma: covariance[(j, j)].max(0.0).sqrt(),
        interval: intervals.as_ref().map(|intervals| intervals[j]),
        condition: fit.condition,
        excitation: (j == 0).then(|| Excitation {
            rms: fit.excitation[0],
            unit: "N".to_owned(),
        }),
        whiteness: Some(fit.whiteness),
        span,
    });
    let forces = rows.force_n.iter().zip(&rows.load_n);
    let ratio: Vec<f64> = forces.map(|(force, load)| force / load).collect();
    let expected: Vec<f64> = (rows.slip.iter().zip(&fit.residuals))
        .map(|(slip, residual)| slip - residual)
        .collect();
    Findings {
        what: WHAT.to_owned(),
        findings: found.collect(),
        covariance: (0..size)
            .map(|i| (0..size).map(|j| covariance[(i, j)]).collect())
            .collect(),
        figures: vec![Figure {
            title: "Longitudinal force against slip".to_owned(),
            x_label: "slip (-)".to_owned(),
            y_label: "longitudinal force over load (-)".to_owned(),
            series: vec![
                series("measured", false, rows.slip.clone(), ratio.clone()),
                series("model", false, expected, ratio),
            ],
        }],
        ..Findings::default()
    }
}

#[cfg(test)]
mod tests;
