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
//! | alpha | slip angle, delayed by the relaxation length | rad |
//! | alpha_0 | error of the slip angle of a wheel (toe, zero of the steer angle) | rad |
//!
//! G is the inverse of the brush tyre's parabola, n the load exponent and mu the friction of the vehicle file.
//! Roll makes an inclination that is proportional to the lateral force, so that a turn alone does not separate both
//! stiffnesses. Steering with caster at low speed and a side slope do. On rough ground, the normal below each wheel is
//! not known: an error of the inclination makes C_g too small, so that such drives are refused.

use nalgebra::{DMatrix, DVector};

use super::drive::{series, span_of};
use super::signals::{smooth, stride};
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal};
use crate::regression::{Fit, least_squares};

const WHAT: &str = "camber stiffness";
const ADVICE: &str = "drive slow tight turns and fast wide ones to both sides, or along an even side slope in both \
                      directions; the standard deviation falls with the root of the duration";
/// Low-pass of slip angle, force and inclination.
const CUTOFF_HZ: f64 = 2.0;
/// Least data, s.
const DATA_MIN_S: f64 = 5.0;
/// Load below which a wheel is not used, N.
const LOAD_MIN_N: f64 = 100.0;
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

/// Slip angle, force and inclination of one wheel, `NaN` where unknown; columns of one length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Data {
    /// Tangent of the slip angle, delayed by the relaxation length.
    pub slip_tangent: Vec<f64>,
    /// Inclination to the normal of the ground, rad.
    pub inclination_rad: Vec<f64>,
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

/// Usable values of both wheels, left ones first.
#[derive(Default)]
struct Rows {
    slip: Vec<f64>,
    inclination_rad: Vec<f64>,
    lateral_n: Vec<f64>,
    load_n: Vec<f64>,
    /// Rows of the left wheel.
    left: usize,
    /// Rows in the columns of the wheels.
    places: Vec<usize>,
}

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
            what: WHAT.to_owned(),
            name: "standard deviation of the vertical acceleration".to_owned(),
            value: options.vertical_m_s2,
            expected: format!(
                "at most {VERTICAL_MAX_M_S2} m/s^2: on rough ground the inclination of a wheel to the ground is not \
                 known; drive on even ground, or select an even part with --from and --to"
            ),
        });
    }
    let rows = usable(wheels, options)?;
    let mut fit = fitted(&rows, options)?;
    let found = fit.excitation[1];
    if found < INCLINATION_MIN_RAD {
        return Err(Refusal::NotExcited {
            what: WHAT.to_owned(),
            quantity: "the inclination that does not follow the lateral force (rms)".to_owned(),
            found,
            needed: INCLINATION_MIN_RAD,
            unit: "rad".to_owned(),
            help: ADVICE.to_owned(),
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
    ]
    .map(|other| fitted(&rows, &other).map(|other| difference(&other, &fit)));
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
    let mut rows = Rows::default();
    for (side, wheel) in wheels.iter().enumerate() {
        let expected = wheel.slip_tangent.len();
        for (name, column) in [
            ("inclination", &wheel.inclination_rad),
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
        let [slip, inclination, along, across, load] = [
            &wheel.slip_tangent,
            &wheel.inclination_rad,
            &wheel.longitudinal_n,
            &wheel.lateral_n,
            &wheel.load_n,
        ]
        .map(|column| smooth(column, options.dt_s, CUTOFF_HZ));
        for row in (0..expected).step_by(step) {
            let known = (slip[row] + inclination[row] + along[row] + across[row]).is_finite();
            let within = across[row].abs() < USED_MAX * options.friction * load[row]
                && along[row].abs() < LONGITUDINAL_MAX * load[row];
            if known && load[row] > LOAD_MIN_N && within {
                rows.slip.push(slip[row]);
                rows.inclination_rad.push(inclination[row]);
                rows.lateral_n.push(across[row]);
                rows.load_n.push(load[row]);
                rows.places.push(row);
            }
        }
        if side == 0 {
            rows.left = rows.places.len();
        }
    }
    let found_s = rows.places.len() as f64 * step as f64 * options.dt_s / 2.0;
    if found_s < DATA_MIN_S {
        return Err(Refusal::TooShort {
            what: WHAT.to_owned(),
            found_s,
            needed_s: DATA_MIN_S,
            help: ADVICE.to_owned(),
        });
    }
    Ok(rows)
}

fn fitted(rows: &Rows, options: &Options) -> Result<Fit, Refusal> {
    let size = rows.places.len();
    let both = rows.left > 0 && rows.left < size;
    let design = DMatrix::from_fn(size, if both { 4 } else { 3 }, |row, column| {
        let (force_n, load_n) = (rows.lateral_n[row], rows.load_n[row]);
        let grip_n = options.friction * load_n;
        let rest = 1.0 - (force_n.abs() / grip_n).min(1.0 - 1e-9);
        let at_load = math::powf(load_n / options.reference_load_n, options.load_exponent);
        match column {
            0 => {
                let linear_n = 3.0 * grip_n * (1.0 - math::powf(rest, 1.0 / 3.0));
                -linear_n * force_n.signum() / at_load
            }
            1 => -rows.inclination_rad[row] * math::powf(rest, -2.0 / 3.0) / at_load,
            2 => f64::from(!both || row < rows.left),
            _ => f64::from(row >= rows.left),
        }
    });
    least_squares(&design, &DVector::from_column_slice(&rows.slip))
        .map_err(|refusal| refusal.of(WHAT).advise(ADVICE))
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
    let intervals = fit.intervals(options.seed, parameters);
    let mut places = rows.places.clone();
    places.sort_unstable();
    let span = span_of(&places, options.dt_s, stride(options.dt_s, CUTOFF_HZ));
    let size = values.len();
    let sides: &[&str] = match (size == 4, rows.left > 0) {
        (true, _) => &["slip_angle_offset_left", "slip_angle_offset_right"],
        (false, true) => &["slip_angle_offset_left"],
        (false, false) => &["slip_angle_offset_right"],
    };
    let [camber, cornering] = [values[0], values[1]];
    let jacobian = DMatrix::from_fn(size, size, |i, j| match (i, j) {
        (0, 0) => -camber * cornering,
        (0, 1) => cornering,
        (1, 0) => -cornering * cornering,
        (1, _) => 0.0,
        _ => f64::from(i == j),
    });
    let covariance = fit.propagated(&jacobian);
    let names = ["camber_stiffness", "cornering_stiffness"];
    let found = names
        .iter()
        .chain(sides)
        .enumerate()
        .map(|(j, name)| Finding {
            name: (*name).to_owned(),
            value: values[j],
            unit: if j < 2 { "N/rad" } else { "rad" }.to_owned(),
            sigma: covariance[(j, j)].max(0.0).sqrt(),
            interval: intervals.as_ref().map(|intervals| intervals[j]),
            condition: fit.condition,
            excitation: match j {
                0 => Some((fit.excitation[1], "rad")),
                1 => Some((fit.excitation[0], "N")),
                _ => None,
            }
            .map(|(rms, unit)| Excitation {
                rms,
                unit: unit.to_owned(),
            }),
            whiteness: Some(fit.whiteness),
            span,
        });
    Findings {
        what: WHAT.to_owned(),
        findings: found.collect(),
        covariance: (0..size)
            .map(|i| (0..size).map(|j| covariance[(i, j)]).collect())
            .collect(),
        beside: vec![(
            "camber stiffness of the vehicle file".to_owned(),
            options.file_stiffness_n_rad,
            "N/rad".to_owned(),
        )],
        figures: vec![figure(fit, rows, [camber, cornering])],
        ..Findings::default()
    }
}

/// What the slip leaves of the force, against the inclination.
fn figure(fit: &Fit, rows: &Rows, [camber, cornering]: [f64; 2]) -> Figure {
    let inclinations = || rows.inclination_rad.clone();
    let thrust_n = (rows.inclination_rad.iter().zip(&fit.residuals))
        .map(|(inclination, residual)| -camber * inclination - cornering * residual)
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
