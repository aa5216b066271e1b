//! One regression for both wheels of an axle, with a constant for each wheel.

use nalgebra::{DMatrix, DVector};

use super::drive::span_of;
use super::signals::{smooth, spread, stride};
use crate::finding::{Excitation, Finding, Findings, Refusal};
use crate::regression::{Fit, least_squares};

/// Low-pass of all columns.
const CUTOFF_HZ: f64 = 2.0;
/// Load below which a wheel is not used, N.
const LOAD_MIN_N: f64 = 100.0;

/// What is to be found, for refusals.
#[derive(Clone, Copy)]
pub(super) struct Task {
    pub(super) what: &'static str,
    pub(super) advice: &'static str,
    /// Least data, s.
    pub(super) data_min_s: f64,
}

/// Usable rows of both wheels, left ones first.
pub(super) struct Rows<const N: usize> {
    task: Task,
    /// Values of the columns; the last one is the load, N.
    pub(super) values: Vec<[f64; N]>,
    /// Rows of the left wheel.
    left: usize,
    /// Rows in the columns of the wheels.
    places: Vec<usize>,
    dt_s: f64,
}

/// A coefficient that is not the constant of a wheel.
pub(super) struct Named {
    pub(super) name: &'static str,
    pub(super) unit: &'static str,
    /// Root mean square of its excitation and the unit.
    pub(super) excitation: Option<(f64, &'static str)>,
}

impl<const N: usize> Rows<N> {
    /// Smooths the columns, which have names, and keeps the rows that are known and `is_used`. The last column is the
    /// load.
    pub(super) fn usable(
        task: Task,
        dt_s: f64,
        names: [&str; N],
        wheels: [[&[f64]; N]; 2],
        is_used: impl Fn(&[f64; N]) -> bool,
    ) -> Result<Self, Refusal> {
        let step = stride(dt_s, CUTOFF_HZ);
        let (mut values, mut places, mut left) = (Vec::new(), Vec::new(), 0);
        for (side, columns) in wheels.into_iter().enumerate() {
            let expected = columns[0].len();
            let other = names.iter().zip(columns).find(|(_, c)| c.len() != expected);
            if let Some((name, column)) = other {
                return Err(Refusal::Length {
                    what: task.what.to_owned(),
                    name: (*name).to_owned(),
                    found: column.len(),
                    expected,
                });
            }
            let smoothed = columns.map(|column| smooth(column, dt_s, CUTOFF_HZ));
            for row in (0..expected).step_by(step) {
                let all: [f64; N] = std::array::from_fn(|k| smoothed[k][row]);
                let known = all.iter().all(|value| value.is_finite());
                if known && all[N - 1] > LOAD_MIN_N && is_used(&all) {
                    values.push(all);
                    places.push(row);
                }
            }
            if side == 0 {
                left = places.len();
            }
        }
        let found_s = places.len() as f64 * step as f64 * dt_s / 2.0;
        if found_s < task.data_min_s {
            return Err(Refusal::TooShort {
                what: task.what.to_owned(),
                found_s,
                needed_s: task.data_min_s,
                help: task.advice.to_owned(),
            });
        }
        Ok(Self {
            task,
            values,
            left,
            places,
            dt_s,
        })
    }

    /// Refuses rows whose force (column `force`) over the load has a smaller standard deviation than `needed`.
    pub(super) fn excited(&self, force: usize, name: &str, needed: f64) -> Result<(), Refusal> {
        let parts = self.values.iter().map(|row| row[force] / row[N - 1]);
        let found = spread(&parts.collect::<Vec<_>>());
        if found >= needed {
            return Ok(());
        }
        Err(Refusal::NotExcited {
            what: self.task.what.to_owned(),
            quantity: format!("the standard deviation of the {name} over the load"),
            found,
            needed,
            unit: "-".to_owned(),
            help: self.task.advice.to_owned(),
        })
    }

    /// A column.
    pub(super) fn column(&self, k: usize) -> Vec<f64> {
        self.values.iter().map(|row| row[k]).collect()
    }

    fn has_both(&self) -> bool {
        self.left > 0 && self.left < self.values.len()
    }

    /// Fits the column `response` with some terms of each row and a constant for each wheel.
    pub(super) fn fit<const TERMS: usize>(
        &self,
        response: usize,
        terms: impl Fn(&[f64; N]) -> [f64; TERMS],
    ) -> Result<Fit, Refusal> {
        let both = self.has_both();
        let size = self.values.len();
        let constants = if both { 2 } else { 1 };
        let design = DMatrix::from_fn(size, TERMS + constants, |row, column| {
            match column.checked_sub(TERMS) {
                None => terms(&self.values[row])[column],
                Some(0) => f64::from(!both || row < self.left),
                Some(_) => f64::from(row >= self.left),
            }
        });
        least_squares(&design, &DVector::from_vec(self.column(response)))
            .map_err(|refusal| refusal.of(self.task.what).advise(self.task.advice))
    }

    /// Adds to a fit what other fits, with values of the vehicle file that are moved by their deviations, change.
    pub(super) fn doubt(
        fit: &mut Fit,
        moved: impl IntoIterator<Item = Result<Fit, Refusal>>,
    ) -> Result<(), Refusal> {
        let found = DVector::from_column_slice(&fit.coefficients);
        for other in moved {
            fit.doubt(&(DVector::from_vec(other?.coefficients) - &found));
        }
        Ok(())
    }

    /// The values that `parameters` makes of the coefficients, with the covariance: those with names, then the constants
    /// of the wheels.
    pub(super) fn findings<const TERMS: usize>(
        &self,
        fit: &Fit,
        seed: u64,
        named: [Named; TERMS],
        (constants, unit): ([&'static str; 2], &str),
        parameters: impl Fn(&[f64]) -> Vec<f64>,
        covariance: &DMatrix<f64>,
    ) -> Findings {
        let values = parameters(&fit.coefficients);
        let intervals = fit.intervals(seed, parameters);
        let mut places = self.places.clone();
        places.sort_unstable();
        let span = span_of(&places, self.dt_s, stride(self.dt_s, CUTOFF_HZ));
        let constants = match (self.has_both(), self.left > 0) {
            (true, _) => &constants[..],
            (false, true) => &constants[..1],
            (false, false) => &constants[1..],
        };
        let of_wheel = |name: &&'static str| (*name, unit, None);
        let all = (named.iter())
            .map(|one| (one.name, one.unit, one.excitation))
            .chain(constants.iter().map(of_wheel));
        let found = all
            .enumerate()
            .map(|(j, (name, unit, excitation))| Finding {
                name: name.to_owned(),
                value: values[j],
                unit: unit.to_owned(),
                sigma: covariance[(j, j)].max(0.0).sqrt(),
                interval: intervals.as_ref().map(|intervals| intervals[j]),
                condition: fit.condition,
                excitation: excitation.map(|(rms, unit)| Excitation {
                    rms,
                    unit: unit.to_owned(),
                }),
                whiteness: Some(fit.whiteness),
                span,
            });
        let row = |i| covariance.row(i).iter().copied().collect();
        Findings {
            what: self.task.what.to_owned(),
            findings: found.collect(),
            covariance: (0..values.len()).map(row).collect(),
            ..Findings::default()
        }
    }
}

/// Force that a linear tyre at the reference load would have at the slip of a force and load, N: the inverse of
/// Fiala's parabola.
pub(super) fn linear_force_n(
    [force_n, load_n]: [f64; 2],
    friction: f64,
    [reference_load_n, load_exponent]: [f64; 2],
) -> f64 {
    let grip_n = friction * load_n;
    let part = (force_n.abs() / grip_n).min(1.0);
    let at_load = math::powf(load_n / reference_load_n, load_exponent);
    3.0 * grip_n * (1.0 - math::powf(1.0 - part, 1.0 / 3.0)) * force_n.signum() / at_load
}
