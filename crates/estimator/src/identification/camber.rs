//! Camber stiffness of an axle's tyres (sections 5.2.6 and 5.3.1 of the thesis).
//!
//! A brush tyre that also has a camber thrust makes the lateral force F_y = -f(C s tan alpha) - C_g gamma, with its
//! curve f. The slip angle has more noise than the force, so that the slip is regressed on the force:
//!
//! tan alpha = -(1/C) G/s - (C_g/C) G' gamma/s + alpha_0
//!
//! G = 3 mu F_z (1 - (1 - u)^(1/3)) sign(F_y), G' = (1 - u)^(-2/3), u = |F_y|/(mu F_z), s = (F_z/F_z0)^n
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | C_g | camber stiffness of one tyre | N/rad |
//! | gamma | inclination of the wheel to the normal of the ground, top to the right positive | rad |
//! | C | cornering stiffness of one tyre at the reference load F_z0 | N/rad |
//! | alpha | slip angle of the velocity of the contact point, delayed by the relaxation length | rad |
//! | alpha_0 | error of the slip angle of a wheel (toe, zero of the steer angle) | rad |
//!
//! G is the inverse of the brush tyre's parabola, n the load exponent and mu the friction of the vehicle file.
//! Roll makes an inclination that is proportional to the lateral force, so that a turn alone does not separate both
//! stiffnesses. Steering with caster at low speed and a side slope do. On rough ground, the normal below each wheel is
//! not known: an error of the inclination makes C_g too small, so that such drives are refused.

use nalgebra::DMatrix;

use super::both_wheels::{self, Named, Task, linear_force_n};
use super::drive::series;
use crate::finding::{Figure, Findings, Refusal};
use crate::regression::Fit;

const TASK: Task = Task {
    what: "camber stiffness",
    advice: "drive slow tight turns and fast wide ones to both sides, or along an even side slope in both \
             directions; the standard deviation falls with the root of the duration",
    data_min_s: 5.0,
};
/// Largest longitudinal force over the load: combined slip is not modelled.
const LONGITUDINAL_MAX: f64 = 0.2;
/// Largest used part of the grip: near the limit, the shape of the curve counts more than its slope.
const USED_MAX: f64 = 0.6;
/// Least root mean square of the inclination that neither force nor offsets explain, rad.
const INCLINATION_MIN_RAD: f64 = 0.004;
/// Largest standard deviation of the vertical acceleration, m/s^2: 0.1 on even ground, 0.9 on class D with bumps.
const VERTICAL_MAX_M_S2: f64 = 0.3;
/// Relative standard deviation of the friction, and standard deviation of the load exponent of the vehicle file.
const DOUBT: [f64; 2] = [0.1, 0.15];

/// Relaxation length with its standard deviation added, over that of the vehicle file.
pub(super) const LONGER: f64 = 1.5;

/// Slip angle, force and inclination of one wheel, `NaN` where unknown; columns of one length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Data {
    /// Tangent of the slip angle, delayed by the relaxation length.
    pub slip_tangent: Vec<f64>,
    /// The same with a relaxation length that is longer by its standard deviation, and for the velocity of the wheel centre
    /// in the place of that of the contact point. The differences are standard deviations of the slip.
    pub moved_slip_tangent: [Vec<f64>; 2],
    /// Inclination to the normal of the ground, rad.
    pub inclination_rad: Vec<f64>,
    /// Force along the wheel, N.
    pub longitudinal_n: Vec<f64>,
    /// Force across it, N.
    pub lateral_n: Vec<f64>,
    /// Load, N.
    pub load_n: Vec<f64>,
}

impl Data {
    fn columns(&self) -> [&[f64]; 5] {
        self.columns_with(&self.slip_tangent)
    }

    fn columns_with<'d>(&'d self, slip_tangent: &'d [f64]) -> [&'d [f64]; 5] {
        [
            slip_tangent,
            &self.inclination_rad,
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
    /// Load that the cornering stiffness is given for, N.
    pub reference_load_n: f64,
    /// Exponent of the cornering stiffness over the load.
    pub load_exponent: f64,
    /// Friction coefficient.
    pub friction: f64,
    /// Camber stiffness of the vehicle file, for comparison, N/rad.
    pub file_stiffness_n_rad: f64,
    /// Standard deviation of the vertical acceleration of the drive, m/s^2; NaN if it is unknown.
    pub vertical_m_s2: f64,
    /// Seed of the bootstrap.
    pub seed: u64,
}

/// Tangent of the slip angle, inclination, force along the wheel and across it, and load.
type Rows = both_wheels::Rows<5>;

/// Finds the camber stiffness of an axle's tyres.
///
/// Findings: `camber_stiffness` (one tyre, N/rad), `cornering_stiffness` (one tyre at the reference load, N/rad),
/// `slip_angle_offset_left` and `slip_angle_offset_right` (rad).
///
/// # Errors
/// Columns that differ in length, too little data, rough ground, inclinations that follow the force.
pub fn identify(wheels: &[Data; 2], options: &Options) -> Result<Findings, Refusal> {
    if options.vertical_m_s2 > VERTICAL_MAX_M_S2 {
        return Err(Refusal::Value {
            what: TASK.what.to_owned(),
            name: "standard deviation of the vertical acceleration".to_owned(),
            value: options.vertical_m_s2,
            expected: format!(
                "at most {VERTICAL_MAX_M_S2} m/s^2: on rough ground the inclination of a wheel to the ground is not \
                 known; drive on even ground, or select an even part with --from and --to"
            ),
        });
    }
    let rows = usable(wheels.each_ref().map(Data::columns), options)?;
    let mut fit = fitted(&rows, options)?;
    let found = fit.excitation[1];
    if found < INCLINATION_MIN_RAD {
        return Err(Refusal::NotExcited {
            what: TASK.what.to_owned(),
            quantity: "the inclination that does not follow the lateral force (rms)".to_owned(),
            found,
            needed: INCLINATION_MIN_RAD,
            unit: "rad".to_owned(),
            help: TASK.advice.to_owned(),
        });
    }
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
    let slips = [0, 1].map(|k| {
        let moved = wheels.each_ref();
        let columns = moved.map(|wheel| wheel.columns_with(&wheel.moved_slip_tangent[k]));
        fitted(&usable(columns, options)?, options)
    });
    Rows::doubt(&mut fit, slips)?;
    Ok(findings(&fit, &rows, options))
}

fn usable(wheels: [[&[f64]; 5]; 2], options: &Options) -> Result<Rows, Refusal> {
    let names = [
        "slip angle",
        "inclination",
        "longitudinal force",
        "lateral force",
        "load",
    ];
    Rows::usable(TASK, options.dt_s, names, wheels, |row| {
        let [_, _, along_n, across_n, load_n] = *row;
        across_n.abs() < USED_MAX * options.friction * load_n
            && along_n.abs() < LONGITUDINAL_MAX * load_n
    })
}

fn fitted(rows: &Rows, options: &Options) -> Result<Fit, Refusal> {
    let reference = [options.reference_load_n, options.load_exponent];
    rows.fit(0, |&[_, inclination_rad, _, force_n, load_n]| {
        let rest = 1.0 - force_n.abs() / (options.friction * load_n);
        let at_load = math::powf(load_n / options.reference_load_n, options.load_exponent);
        [
            -linear_force_n([force_n, load_n], options.friction, reference),
            -inclination_rad * math::powf(rest, -2.0 / 3.0) / at_load,
        ]
    })
}

/// Camber and cornering stiffness, and the offsets, of the coefficients of the regression.
fn parameters(coefficients: &[f64]) -> Vec<f64> {
    let mut values = coefficients.to_vec();
    values[0] = coefficients[1] / coefficients[0];
    values[1] = coefficients[0].recip();
    values
}

fn findings(fit: &Fit, rows: &Rows, options: &Options) -> Findings {
    let values = parameters(&fit.coefficients);
    let size = values.len();
    let [camber, cornering] = [values[0], values[1]];
    let jacobian = DMatrix::from_fn(size, size, |i, j| match (i, j) {
        (0, 0) => -camber * cornering,
        (0, 1) => cornering,
        (1, 0) => -cornering * cornering,
        (1, _) => 0.0,
        _ => f64::from(i == j),
    });
    let named = [
        ("camber_stiffness", (fit.excitation[1], "rad")),
        ("cornering_stiffness", (fit.excitation[0], "N")),
    ]
    .map(|(name, excitation)| Named {
        name,
        unit: "N/rad",
        excitation: Some(excitation),
    });
    let constants = (["slip_angle_offset_left", "slip_angle_offset_right"], "rad");
    let covariance = fit.propagated(&jacobian);
    Findings {
        beside: vec![(
            "camber stiffness of the vehicle file".to_owned(),
            options.file_stiffness_n_rad,
            "N/rad".to_owned(),
        )],
        figures: vec![figure(fit, rows, [camber, cornering])],
        ..rows.findings(fit, options.seed, named, constants, parameters, &covariance)
    }
}

/// What the slip leaves of the force, against the inclination.
fn figure(fit: &Fit, rows: &Rows, [camber, cornering]: [f64; 2]) -> Figure {
    let inclinations = || rows.column(1);
    let thrust_n = (rows.values.iter().zip(&fit.residuals))
        .map(|(row, residual)| -camber * row[1] - cornering * residual)
        .collect();
    let line_n = inclinations()
        .iter()
        .map(|inclination| -camber * inclination)
        .collect();
    Figure {
        title: "Lateral force without that of the slip, against the inclination".to_owned(),
        x_label: "inclination (rad)".to_owned(),
        y_label: "force (N)".to_owned(),
        series: vec![
            series("measured", false, inclinations(), thrust_n),
            series("camber thrust", true, inclinations(), line_n),
        ],
    }
}

#[cfg(test)]
mod tests;
