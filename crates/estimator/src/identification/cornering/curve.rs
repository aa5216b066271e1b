//! Slip angle regressed on force: the fit of one axle.

use nalgebra::{DMatrix, DVector};

use super::{ADVICE, AxleRows, Body, WHAT};
use crate::finding::Refusal;
use crate::regression::{self, Fit, Nonlinear, nonlinear};

/// The vehicle file's grip is believed until the data's lies this many deviations away,
const GRIP_SIGMAS: f64 = 3.0;
/// and its reciprocal by this part: what differs between an axle's two tyres bends the curve too.
const GRIP_APART: f64 = 0.4;

/// How slip grows with force, beyond proportion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Curve {
    Brush,
    Cubic,
}

impl Curve {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Brush => "brush",
            Self::Cubic => "cubic",
        }
    }
}

/// An axle whose rows are fitted.
#[derive(Clone, Copy)]
struct Axle<'a> {
    body: &'a Body,
    axle: usize,
    rows: &'a AxleRows,
}

impl Axle<'_> {
    /// g(F) of a row and its rate of change, with the grip's reciprocal, 1/N.
    fn pull(&self, curve: Curve, row: usize, grip_inverse: f64) -> [f64; 2] {
        let (force_n, parts) = (self.rows.force_n[row], self.rows.load_parts[row]);
        let rate_n_s = self.rows.force_rate_n_s[row];
        match curve {
            Curve::Brush => {
                let pull = self.body.pull(self.axle, force_n, parts, grip_inverse);
                [pull.n, pull.per_force * rate_n_s]
            }
            Curve::Cubic => {
                let pull = self.body.pull(self.axle, force_n, parts, 0.0);
                let square = (force_n * grip_inverse).powi(2);
                let per_force = pull.per_force * (1.0 + 3.0 * square);
                [pull.n * (1.0 + square), per_force * rate_n_s]
            }
        }
    }
}

/// One axle's fit: offset, 1/C, tau/C and, where it was found, the grip's reciprocal.
pub(super) struct AxleFit {
    pub(super) curve: Curve,
    /// Reciprocal of the grip, 1/N.
    pub(super) grip_inverse: f64,
    pub(super) fit: Fit,
}

impl AxleFit {
    pub(super) fn stiffness_n_rad(&self) -> f64 {
        self.fit.coefficients[1].recip()
    }

    /// What the coefficients would move by if the rows were these, of a body with this grip.
    pub(super) fn moved(&self, body: &Body, axle: usize, rows: &AxleRows) -> DVector<f64> {
        let grip_inverse = match self.fit.coefficients.get(3) {
            Some(found) => *found,
            None => body.grip_n[axle].recip(),
        };
        let axle = Axle { body, axle, rows };
        let c = &self.fit.coefficients;
        let change = (0..rows.slip.len()).map(|row| {
            let [pull_n, rate_n_s] = axle.pull(self.curve, row, grip_inverse);
            rows.slip[row] - c[0] + c[1] * pull_n + c[2] * rate_n_s - self.fit.residuals[row]
        });
        self.fit.leverage.transpose() * DVector::from_iterator(rows.slip.len(), change)
    }

    /// Tangent of the slip angle that belongs to a force under the loads at rest.
    pub(super) fn slip(&self, body: &Body, axle: usize, force_n: f64) -> f64 {
        let rows = AxleRows {
            force_n: vec![force_n],
            force_rate_n_s: vec![0.0],
            load_parts: vec![[1.0; 2]],
            ..AxleRows::default()
        };
        let axle = Axle {
            body,
            axle,
            rows: &rows,
        };
        let [pull_n, _] = axle.pull(self.curve, 0, self.grip_inverse);
        self.fit.coefficients[0] - self.fit.coefficients[1] * pull_n
    }
}

/// Fits one axle, under the vehicle file's grip where the data do not contradict it.
pub(super) fn fit(body: &Body, axle: usize, rows: &AxleRows) -> Result<AxleFit, Refusal> {
    let grip_n = body.grip_n[axle];
    let axle = &Axle { body, axle, rows };
    let told = |refusal: Refusal| refusal.of(WHAT).advise(ADVICE);
    let given = grip_n.recip();
    let believed = fit_given(axle, given).map_err(told)?;
    let mut best = AxleFit {
        curve: Curve::Brush,
        grip_inverse: given,
        fit: believed,
    };
    let start = best.fit.coefficients.clone();
    if start[1] > 0.0
        && let Ok(free) = fit_free(axle, Curve::Brush, &start)
        && (free.coefficients[3].abs() - given).abs()
            > (GRIP_SIGMAS * free.sigma(3)).max(GRIP_APART * given)
    {
        best = AxleFit {
            curve: Curve::Brush,
            grip_inverse: free.coefficients[3],
            fit: free,
        };
        if let Ok(cubic) = fit_free(axle, Curve::Cubic, &start)
            && cubic.residual_rms() < best.fit.residual_rms()
        {
            best = AxleFit {
                curve: Curve::Cubic,
                grip_inverse: cubic.coefficients[3],
                fit: cubic,
            };
        }
    }
    if best.fit.coefficients[1] > 0.0 {
        return Ok(best);
    }
    Err(Refusal::Value {
        what: WHAT.to_owned(),
        name: "slip angle over force".to_owned(),
        value: -best.fit.coefficients[1],
        expected: "a slip angle that falls as the force grows; look at the signs of steer angle, \
                   sideslip and acceleration"
            .to_owned(),
    })
}

/// Offset, 1/C and tau/C under a grip that is given.
fn fit_given(axle: &Axle<'_>, grip_inverse: f64) -> Result<Fit, Refusal> {
    let rows = axle.rows;
    let design = DMatrix::from_fn(rows.slip.len(), 3, |i, j| match j {
        0 => 1.0,
        _ => -axle.pull(Curve::Brush, i, grip_inverse)[j - 1],
    });
    regression::least_squares(&design, &DVector::from_column_slice(&rows.slip))
}

/// Offset, 1/C, tau/C and the grip's reciprocal.
fn fit_free(axle: &Axle<'_>, curve: Curve, start: &[f64]) -> Result<Fit, Refusal> {
    let rows = axle.rows;
    let most = rows
        .force_n
        .iter()
        .fold(1.0_f64, |most, f| most.max(f.abs()));
    let problem = Nonlinear {
        start: vec![start[0], start[1], start[2], 0.5 / most],
        scale: vec![1e-3, start[1], start[1] * 0.1, 0.1 / most],
        iterations: 60,
    };
    nonlinear(&problem, |c| {
        (0..rows.slip.len())
            .map(|row| {
                let [pull_n, rate_n_s] = axle.pull(curve, row, c[3]);
                rows.slip[row] - c[0] + c[1] * pull_n + c[2] * rate_n_s
            })
            .collect()
    })
}
