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

use nalgebra::DMatrix;

use super::both_wheels::{self, Named, Task, linear_force_n};
use super::drive::series;
use super::signals::mean;
use crate::finding::{Figure, Findings, Refusal};
use crate::regression::Fit;

const TASK: Task = Task {
    what: "longitudinal stiffness",
    advice: "speed up from a standstill with much throttle, then brake hard, straight ahead",
    data_min_s: 3.0,
};
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

impl Data {
    fn columns(&self) -> [&[f64]; 4] {
        [
            &self.slip,
            &self.longitudinal_n,
            &self.lateral_n,
            &self.load_n,
        ]
    }
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

/// Slip, force along the wheel and across it, and load.
type Rows = both_wheels::Rows<4>;

/// Finds the longitudinal stiffness of an axle's tyres.
///
/// Findings: `slip_stiffness` (one tyre at the reference load, N per unit slip), `slip_by_load` (e),
/// `slip_offset_left` and `slip_offset_right`.
///
/// # Errors
/// Columns that differ in length, too little data, forces that do not change.
pub fn identify(wheels: &[Data; 2], options: &Options) -> Result<Findings, Refusal> {
    let names = ["slip", "longitudinal force", "lateral force", "load"];
    let wheels = wheels.each_ref().map(Data::columns);
    let rows = Rows::usable(TASK, options.dt_s, names, wheels, |row| {
        let [_, along_n, across_n, load_n] = *row;
        along_n.abs() / (options.friction * load_n) < USED_MAX
            && across_n.abs() < LATERAL_MAX * load_n
    })?;
    rows.excited(1, "longitudinal force", FORCE_MIN)?;
    let mut fit = fitted(&rows, options)?;
    let moved = [
        Options {
            friction: options.friction * (1.0 + DOUBT[0]),
            ..*options
        },
        Options {
            load_exponent: options.load_exponent + DOUBT[1],
            ..*options
        },
    ];
    Rows::doubt(&mut fit, moved.iter().map(|other| fitted(&rows, other)))?;
    Ok(findings(&fit, &rows, options))
}

fn fitted(rows: &Rows, options: &Options) -> Result<Fit, Refusal> {
    let mean_n = mean(rows.values.iter().map(|row| row[3]));
    let reference = [options.reference_load_n, options.load_exponent];
    rows.fit(0, |&[_, force_n, _, load_n]| {
        let linear_n = linear_force_n([force_n, load_n], options.friction, reference);
        [linear_n, load_n / mean_n - 1.0]
    })
}

fn findings(fit: &Fit, rows: &Rows, options: &Options) -> Findings {
    let parameters = |coefficients: &[f64]| {
        let mut values = coefficients.to_vec();
        values[0] = values[0].recip();
        values
    };
    let stiffness_n = fit.coefficients[0].recip();
    let size = fit.coefficients.len();
    let jacobian = DMatrix::from_fn(size, size, |i, j| match (i, j) {
        (0, 0) => -stiffness_n * stiffness_n,
        _ => f64::from(i == j),
    });
    let named = [
        Named {
            name: "slip_stiffness",
            unit: "N",
            excitation: Some((fit.excitation[0], "N")),
        },
        Named {
            name: "slip_by_load",
            unit: "-",
            excitation: None,
        },
    ];
    let constants = (["slip_offset_left", "slip_offset_right"], "-");
    let covariance = fit.propagated(&jacobian);
    let ratio: Vec<f64> = rows.values.iter().map(|row| row[1] / row[3]).collect();
    let expected = (rows.values.iter().zip(&fit.residuals))
        .map(|(row, residual)| row[0] - residual)
        .collect();
    Findings {
        figures: vec![Figure {
            title: "Longitudinal force against slip".to_owned(),
            x_label: "slip (-)".to_owned(),
            y_label: "longitudinal force over load (-)".to_owned(),
            series: vec![
                series("measured", false, rows.column(0), ratio.clone()),
                series("model", false, expected, ratio),
            ],
        }],
        ..rows.findings(fit, options.seed, named, constants, parameters, &covariance)
    }
}

#[cfg(test)]
mod tests;
