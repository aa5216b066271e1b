//! Pneumatic trail and aligning moment of an axle's tyres (sections 2.3 and 5.3.1 of the thesis).
//!
//! The aligning moment is M_z = -t F_y. The trail t shrinks as the contact patch begins to slide. To first order
//! in the used part of the grip u = |F_y|/(mu F_z),
//!
//! M_z = -n s (1 - r u) F_y + m, s = sqrt(F_z/F_z0)
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | n | pneumatic trail without sliding at the reference load F_z0 | m |
//! | r | loss of the trail at the limit of grip by the slope at small u, as a part of n | - |
//! | s | growth of the length of the contact patch with the load | - |
//! | m | constant moment of a wheel: the error of the zero of its tie rod | N m |
//!
//! r is not estimated: load and used grip of a wheel change together, so that a small error of the moment that changes
//! with the load would become a large error of n and r. Its standard deviation is part of that of n. Rows near the limit
//! of grip are left out, because the loss is not linear there.

use nalgebra::DVector;

use super::both_wheels::{self, Named, Task};
use super::drive::series;
use crate::finding::{Figure, Findings, Refusal};
use crate::regression::Fit;

const TASK: Task = Task {
    what: "aligning moment",
    advice: "drive slowly changing turns to both sides up to half of the grip, at 5 m/s or faster",
    data_min_s: 5.0,
};
/// Largest longitudinal force over the load: its lever arm about the contact point is not modelled.
const LONGITUDINAL_MAX: f64 = 0.1;
/// Largest used part of the grip.
const USED_MAX: f64 = 0.6;
/// r and its standard deviation: the trail of a brush tyre (Fiala's moment) has 0.67 at small u and 0.79 at u = 0.6, a
/// trail that falls along a straight line to the limit has 1.
const LOSS: [f64; 2] = [0.9, 0.15];
/// Standard deviation of the position of the contact point along the wheel, m. It adds to the trail: 5 mm are the
/// pitch of 1 degree at a radius of 0.3 m.
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

impl Data {
    fn columns(&self) -> [&[f64]; 4] {
        [
            &self.aligning_n_m,
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

/// Moment, force along the wheel and across it, and load.
type Rows = both_wheels::Rows<4>;

/// Finds the pneumatic trail of an axle's tyres.
///
/// Findings: `pneumatic_trail` (n, m), `aligning_offset_left` and `aligning_offset_right` (N m). Beside them: the slope of the aligning moment over the slip angle with the cornering stiffness of the file.
///
/// # Errors
/// Columns that differ in length, too little data, forces that do not change, moments that are unknown.
pub fn identify(wheels: &[Data; 2], options: &Options) -> Result<Findings, Refusal> {
    let is_unknown = |wheel: &Data| wheel.aligning_n_m.iter().all(|moment| !moment.is_finite());
    if wheels.iter().any(is_unknown) {
        return Err(Refusal::Missing {
            what: TASK.what.to_owned(),
            channel: "moment of a tyre".to_owned(),
            help: "it needs strain on all members of a linkage with hard-points, tie rod included, and the \
                   fusion filter"
                .to_owned(),
        });
    }
    let names = [
        "aligning moment",
        "longitudinal force",
        "lateral force",
        "load",
    ];
    let wheels = wheels.each_ref().map(Data::columns);
    let rows = Rows::usable(TASK, options.dt_s, names, wheels, |row| {
        let [_, along_n, across_n, load_n] = *row;
        across_n.abs() < USED_MAX * options.friction * load_n
            && along_n.abs() < LONGITUDINAL_MAX * load_n
    })?;
    rows.excited(2, "lateral force", FORCE_MIN)?;
    let fitted = |loss: f64| {
        rows.fit(0, |&[_, _, force_n, load_n]| {
            let longer = (load_n / options.reference_load_n).sqrt();
            let used = force_n.abs() / (options.friction * load_n);
            [-longer * (1.0 - loss * used) * force_n]
        })
    };
    let [loss, loss_sigma] = LOSS;
    let mut fit = fitted(loss)?;
    Rows::doubt(&mut fit, [fitted(loss + loss_sigma)])?;
    let mut moved = DVector::zeros(fit.coefficients.len());
    moved[0] = CONTACT_SIGMA_M;
    fit.doubt(&moved);
    Ok(findings(&fit, &rows, options))
}

fn findings(fit: &Fit, rows: &Rows, options: &Options) -> Findings {
    let named = [Named {
        name: "pneumatic_trail",
        unit: "m",
        excitation: Some((fit.excitation[0], "N")),
    }];
    let constants = (["aligning_offset_left", "aligning_offset_right"], "N m");
    let expected = (rows.values.iter().zip(&fit.residuals))
        .map(|(row, residual)| row[0] - residual)
        .collect();
    Findings {
        beside: vec![
            (
                "aligning stiffness, with the cornering stiffness of the file".to_owned(),
                fit.coefficients[0] * options.cornering_n_rad,
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
                series("measured", false, rows.column(2), rows.column(0)),
                series("model", false, rows.column(2), expected),
            ],
        }],
        ..rows.findings(
            fit,
            options.seed,
            named,
            constants,
            <[f64]>::to_vec,
            &fit.covariance,
        )
    }
}

#[cfg(test)]
mod tests;
