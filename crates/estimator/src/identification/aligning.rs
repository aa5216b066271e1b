//! Pneumatic trail and aligning moment of an axle's tyres (sections 2.3 and 5.3.1 of the thesis).
//!
//! The aligning moment is M_z = -t F_y. The trail t shrinks as the contact patch begins to slide. To first order
//! in the used part of the grip u = |F_y|/(mu F_z),
//!
//! M_z = -n_0 s F_y + n_1 s u F_y + m, s = sqrt(F_z/F_z0)
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | n_0 | pneumatic trail without sliding at the reference load F_z0 | m |
//! | n_1 | loss of the trail at the limit of grip, by the slope at small u | m |
//! | s | growth of the length of the contact patch with the load | - |
//! | m | constant moment of a wheel: the error of the zero of its tie rod | N m |
//!
//! Both n_0 and n_1 are estimated, so that the shape of the loss is that of the data. Rows near the limit of grip
//! are left out, because the loss is not linear there.

use nalgebra::{DMatrix, DVector};

use super::drive::{series, span_of};
use super::signals::{smooth, spread, stride};
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal};
use crate::regression::{Fit, least_squares};

const WHAT: &str = "aligning moment";
const ADVICE: &str =
    "drive slowly changing turns to both sides up to half of the grip, at 5 m/s or faster";
/// Low-pass of forces and moments.
const CUTOFF_HZ: f64 = 2.0;
/// Least data, s.
const DATA_MIN_S: f64 = 5.0;
/// Load below which a wheel is not used, N.
const LOAD_MIN_N: f64 = 100.0;
/// Largest longitudinal force over the load: its lever arm about the contact point is not modelled.
const LONGITUDINAL_MAX: f64 = 0.1;
/// Largest used part of the grip.
const USED_MAX: f64 = 0.6;
/// Standard deviation of the position of the contact point along the wheel, m. It adds to the trail: 5 mm are the
/// pitch of 1 degree at a radius of 0.3 m. On drives of the virtual vehicle the error of the trail is up to 9 mm.
const CONTACT_SIGMA_M: f64 = 0.005;
/// Least standard deviation of the lateral force over the load.
const FORCE_MIN: f64 = 0.08;

/// Force and moment of one wheel, `NaN` where unknown; columns of one length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Data {
    /// Aligning moment about the contact point, left positive, N m.
    pub aligning_n_m: Vec<f64>,
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
    /// Load that the trail is given for, N.
    pub reference_load_n: f64,
    /// Friction coefficient.
    pub friction: f64,
    /// Cornering stiffness of one tyre at the reference load, N/rad.
    pub cornering_n_rad: f64,
    /// Pneumatic trail of the vehicle file's tyre at the reference load, for comparison, m.
    pub file_trail_m: f64,
    /// Seed of the bootstrap.
    pub seed: u64,
}

/// Usable values of both wheels, left ones first.
#[derive(Default)]
struct Rows {
    moment_n_m: Vec<f64>,
    lateral_n: Vec<f64>,
    load_n: Vec<f64>,
    /// Rows of the left wheel.
    left: usize,
    /// Rows in the columns of the wheels.
    places: Vec<usize>,
}

/// Finds the pneumatic trail of an axle's tyres.
///
/// Findings: `pneumatic_trail` (n_0, m), `trail_loss` (n_1, m), `aligning_offset_left` and `aligning_offset_right`
/// (N m). Beside them: the slope of the aligning moment over the slip angle with the cornering stiffness of the file.
///
/// # Errors
/// Columns that differ in length, too little data, forces that do not change, moments that are unknown.
pub fn identify(wheels: &[Data; 2], options: &Options) -> Result<Findings, Refusal> {
    let rows = usable(wheels, options)?;
    let mut fit = fitted(&rows, options)?;
    let mut moved = DVector::zeros(fit.coefficients.len());
    moved[0] = CONTACT_SIGMA_M;
    fit.doubt(&moved);
    Ok(findings(&fit, &rows, options))
}

fn usable(wheels: &[Data; 2], options: &Options) -> Result<Rows, Refusal> {
    let step = stride(options.dt_s, CUTOFF_HZ);
    let mut rows = Rows::default();
    for (side, wheel) in wheels.iter().enumerate() {
        let expected = wheel.lateral_n.len();
        for (name, column) in [
            ("aligning moment", &wheel.aligning_n_m),
            ("longitudinal force", &wheel.longitudinal_n),
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
        if wheel.aligning_n_m.iter().all(|moment| !moment.is_finite()) {
            return Err(Refusal::Missing {
                what: WHAT.to_owned(),
                channel: "moment of a tyre".to_owned(),
                help: "it needs strain on all members of a linkage with hard-points, tie rod included, and the \
                       fusion filter"
                    .to_owned(),
            });
        }
        let [moment, along, across, load] = [
            &wheel.aligning_n_m,
            &wheel.longitudinal_n,
            &wheel.lateral_n,
            &wheel.load_n,
        ]
        .map(|column| smooth(column, options.dt_s, CUTOFF_HZ));
        for row in (0..expected).step_by(step) {
            let known = (moment[row] + along[row] + across[row]).is_finite();
            let within = across[row].abs() < USED_MAX * options.friction * load[row]
                && along[row].abs() < LONGITUDINAL_MAX * load[row];
            if known && load[row] > LOAD_MIN_N && within {
                rows.moment_n_m.push(moment[row]);
                rows.lateral_n.push(across[row]);
                rows.load_n.push(load[row]);
                rows.places.push(row);
            }
        }
        if side == 0 {
            rows.left = rows.places.len();
        }
    }
    excited(&rows, step as f64 * options.dt_s)?;
    Ok(rows)
}

fn excited(rows: &Rows, step_s: f64) -> Result<(), Refusal> {
    let found_s = rows.places.len() as f64 * step_s / 2.0;
    if found_s < DATA_MIN_S {
        return Err(Refusal::TooShort {
            what: WHAT.to_owned(),
            found_s,
            needed_s: DATA_MIN_S,
            help: ADVICE.to_owned(),
        });
    }
    let pairs = rows.lateral_n.iter().zip(&rows.load_n);
    let found = spread(&pairs.map(|(force, load)| force / load).collect::<Vec<_>>());
    if found < FORCE_MIN {
        return Err(Refusal::NotExcited {
            what: WHAT.to_owned(),
            quantity: "the standard deviation of the lateral force over the load".to_owned(),
            found,
            needed: FORCE_MIN,
            unit: "-".to_owned(),
            help: ADVICE.to_owned(),
        });
    }
    Ok(())
}

fn fitted(rows: &Rows, options: &Options) -> Result<Fit, Refusal> {
    let size = rows.places.len();
    let both = rows.left > 0 && rows.left < size;
    let design = DMatrix::from_fn(size, if both { 4 } else { 3 }, |row, column| {
        let (force_n, load_n) = (rows.lateral_n[row], rows.load_n[row]);
        let longer = (load_n / options.reference_load_n).sqrt();
        match column {
            0 => -longer * force_n,
            1 => longer * force_n * force_n.abs() / (options.friction * load_n),
            2 => f64::from(!both || row < rows.left),
            _ => f64::from(row >= rows.left),
        }
    });
    least_squares(&design, &DVector::from_column_slice(&rows.moment_n_m))
        .map_err(|refusal| refusal.of(WHAT).advise(ADVICE))
}

fn findings(fit: &Fit, rows: &Rows, options: &Options) -> Findings {
    let size = fit.coefficients.len();
    let intervals = fit.intervals(options.seed, <[f64]>::to_vec);
    let mut places = rows.places.clone();
    places.sort_unstable();
    let span = span_of(&places, options.dt_s, stride(options.dt_s, CUTOFF_HZ));
    let sides: &[&str] = match (size == 4, rows.left > 0) {
        (true, _) => &["aligning_offset_left", "aligning_offset_right"],
        (false, true) => &["aligning_offset_left"],
        (false, false) => &["aligning_offset_right"],
    };
    let names = ["pneumatic_trail", "trail_loss"];
    let found = names
        .iter()
        .chain(sides)
        .enumerate()
        .map(|(j, name)| Finding {
            name: (*name).to_owned(),
            value: fit.coefficients[j],
            unit: if j < 2 { "m" } else { "N m" }.to_owned(),
            sigma: fit.sigma(j),
            interval: intervals.as_ref().map(|intervals| intervals[j]),
            condition: fit.condition,
            excitation: (j < 2).then(|| Excitation {
                rms: fit.excitation[j],
                unit: "N".to_owned(),
            }),
            whiteness: Some(fit.whiteness),
            span,
        });
    let expected: Vec<f64> = (rows.moment_n_m.iter().zip(&fit.residuals))
        .map(|(moment, residual)| moment - residual)
        .collect();
    let trail_m = fit.coefficients[0];
    Findings {
        what: WHAT.to_owned(),
        findings: found.collect(),
        covariance: (0..size)
            .map(|i| (0..size).map(|j| fit.covariance[(i, j)]).collect())
            .collect(),
        beside: vec![
            (
                "aligning stiffness, with the cornering stiffness of the file".to_owned(),
                trail_m * options.cornering_n_rad,
                "N m/rad".to_owned(),
            ),
            (
                "pneumatic trail of the vehicle file".to_owned(),
                options.file_trail_m,
                "m".to_owned(),
            ),
        ],
        figures: vec![Figure {
            title: "Aligning moment against the lateral force".to_owned(),
            x_label: "lateral force (N)".to_owned(),
            y_label: "aligning moment (N m)".to_owned(),
            series: vec![
                series(
                    "measured",
                    false,
                    rows.lateral_n.clone(),
                    rows.moment_n_m.clone(),
                ),
                series("model", false, rows.lateral_n.clone(), expected),
            ],
        }],
        ..Findings::default()
    }
}

#[cfg(test)]
mod tests;
