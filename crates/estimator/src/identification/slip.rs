//! Longitudinal stiffness of an axle's tyres, from the slip and the force of both wheels while the vehicle speeds up
//! and brakes (section 5.3.2 of the thesis).
//!
//! The slip has more noise than the force: a wheel speed of half a per cent is as much as a tenth of the slip of a
//! hard start. A regression of the force on the slip would find a stiffness that is too small. So the slip is
//! regressed on the force:
//!
//! kappa = G/C + kappa_0 + (b - 1/3) d, d = (F_z - F_z0)/(c_z R_0)
//!
//! G = 3 mu F_z (1 - (1 - |F_x|/(mu F_z))^(1/3)) sign(F_x) (F_z0/F_z)^n
//!
//! is the force that a linear tyre would have at the same slip, by the inverse of Fiala's parabola. C is the
//! stiffness of one tyre at the reference load F_z0, n the load exponent, mu the friction of the vehicle file. An
//! error of the rolling radius of a wheel is its constant kappa_0. The rolling radius falls by the part b of the
//! deflection of the tyre (vertical stiffness c_z, unloaded radius R_0); the slip supposes a third.
//!
//! Load transfer makes d proportional to the force of an axle, so that its own data hardly separate b from C. A wheel
//! without drive that is unloaded while the vehicle speeds up shows b. The tyres of both axles are of one kind: b is
//! the mean of both axles by their variances. At low speed, an error of the velocity is a large slip, so that the data
//! begin at 3 m/s.

use nalgebra::DMatrix;

use super::both_wheels::{self, Named, Task, linear_force_n};
use super::drive::series;
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
/// Part of the deflection by which the slip supposes the rolling radius to fall (`model::vehicle`).
const SUPPOSED_PART: f64 = 1.0 / 3.0;
/// Standard deviation of the difference of this part between the tyres of both axles.
const PART_SIGMA: f64 = 0.1;

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
    /// Unloaded radius, m.
    pub radius_m: f64,
    /// Vertical stiffness, N/m.
    pub vertical_stiffness_n_m: f64,
    /// Seed of the bootstrap.
    pub seed: u64,
}

/// Slip, force along the wheel and across it, and load.
type Rows = both_wheels::Rows<4>;

/// Finds the longitudinal stiffness of the tyres of both axles, front first.
///
/// Findings: `slip_stiffness` (one tyre at the reference load, N per unit slip), `slip_offset_left` and
/// `slip_offset_right`. Beside: the part b with its standard deviation.
///
/// # Errors
/// For each axle: columns that differ in length, too little data, forces that do not change.
pub fn identify(wheels: [&[Data; 2]; 2], options: [&Options; 2]) -> [Result<Findings, Refusal>; 2] {
    let alone = [0, 1].map(|axle| Alone::of(wheels[axle], options[axle]));
    let known = alone.each_ref().map(|one| one.as_ref().ok());
    let part = mean_part(known.into_iter().flatten().map(|one| one.part));
    alone.map(|one| one?.with(part))
}

/// An axle by its own data.
struct Alone<'o> {
    rows: Rows,
    options: &'o Options,
    /// The part b less [`SUPPOSED_PART`], and its standard deviation.
    part: [f64; 2],
}

impl<'o> Alone<'o> {
    fn of(wheels: &[Data; 2], options: &'o Options) -> Result<Self, Refusal> {
        let names = ["slip", "longitudinal force", "lateral force", "load"];
        let wheels = wheels.each_ref().map(Data::columns);
        let rows = Rows::usable(TASK, options.dt_s, names, wheels, |row| {
            let [_, along_n, across_n, load_n] = *row;
            along_n.abs() / (options.friction * load_n) < USED_MAX
                && across_n.abs() < LATERAL_MAX * load_n
        })?;
        rows.excited(1, "longitudinal force", FORCE_MIN)?;
        let fit = rows.fit(0, |&[_, force_n, _, load_n]| {
            [
                options.linear_n(force_n, load_n),
                options.deflection(load_n),
            ]
        })?;
        Ok(Self {
            rows,
            options,
            part: [fit.coefficients[1], fit.sigma(1)],
        })
    }

    /// The findings with the part b of both axles.
    fn with(mut self, part: [f64; 2]) -> Result<Findings, Refusal> {
        self.suppose(part[0]);
        let mut fit = fitted(&self.rows, self.options)?;
        let options = self.options;
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
        Rows::doubt(
            &mut fit,
            moved.iter().map(|other| fitted(&self.rows, other)),
        )?;
        self.suppose(part[1]);
        Rows::doubt(&mut fit, [fitted(&self.rows, options)])?;
        self.suppose(-part[1]);
        Ok(findings(&fit, &self.rows, options, part))
    }

    /// Adds to the part of the deflection that the slip supposes.
    fn suppose(&mut self, more: f64) {
        for row in &mut self.rows.values {
            row[0] -= more * self.options.deflection(row[3]);
        }
    }
}

impl Options {
    /// Force of a linear tyre at the slip of a force, N.
    fn linear_n(&self, force_n: f64, load_n: f64) -> f64 {
        let reference = [self.reference_load_n, self.load_exponent];
        linear_force_n([force_n, load_n], self.friction, reference)
    }

    /// Deflection beyond that of the reference load over the radius.
    fn deflection(&self, load_n: f64) -> f64 {
        (load_n - self.reference_load_n) / (self.vertical_stiffness_n_m * self.radius_m)
    }
}

/// Mean of the parts of the axles by their variances, and its standard deviation.
fn mean_part(axles: impl Iterator<Item = [f64; 2]>) -> [f64; 2] {
    let (mut weights, mut sum) = (0.0, 0.0);
    for [part, sigma] in axles {
        let weight = (sigma * sigma + PART_SIGMA * PART_SIGMA).recip();
        weights += weight;
        sum += weight * part;
    }
    [sum / weights, weights.recip().sqrt()]
}

fn fitted(rows: &Rows, options: &Options) -> Result<Fit, Refusal> {
    rows.fit(0, |&[_, force_n, _, load_n]| {
        [options.linear_n(force_n, load_n)]
    })
}

fn findings(fit: &Fit, rows: &Rows, options: &Options, part: [f64; 2]) -> Findings {
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
    let named = [Named {
        name: "slip_stiffness",
        unit: "N",
        excitation: Some((fit.excitation[0], "N")),
    }];
    let constants = (["slip_offset_left", "slip_offset_right"], "-");
    let covariance = fit.propagated(&jacobian);
    let ratio: Vec<f64> = rows.values.iter().map(|row| row[1] / row[3]).collect();
    let expected = (rows.values.iter().zip(&fit.residuals))
        .map(|(row, residual)| row[0] - residual)
        .collect();
    let beside = [
        (
            "fall of the rolling radius over the deflection",
            SUPPOSED_PART + part[0],
        ),
        ("its standard deviation", part[1]),
    ];
    Findings {
        beside: (beside.into_iter())
            .map(|(name, value)| (name.to_owned(), value, "-".to_owned()))
            .collect(),
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
