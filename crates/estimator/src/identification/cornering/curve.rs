//! Slip angle regressed on force: the fit of one axle.

use nalgebra::{DMatrix, DVector};

use super::{ADVICE, AxleRows, Body, WHAT};
use crate::finding::Refusal;
use crate::regression::{self, Fit, Nonlinear, nonlinear};

/// The data confirm the vehicle file's grip where they give its reciprocal with at most this
/// deviation, parts of it,
const CONFIRMED_SIGMA: f64 = 0.2;
/// and within this of the file's: what differs between an axle's two tyres bends the curve too.
const CONFIRMED_APART: f64 = 0.4;
/// They contradict it where theirs is further away, and this many deviations.
const CONTRADICTED_SIGMAS: f64 = 3.0;
/// Standard deviation of the reciprocal of the file's grip, parts of it, where the data confirm it,
const CONFIRMED_FILE_SIGMA: f64 = 0.1;
/// and elsewhere: tyres without a curve are one deviation away.
const FILE_SIGMA: f64 = 1.0;
/// Standard deviation of the data's grip beside noise, parts of the file's: what the forces of a
/// four-wheeled vehicle leave out bends the curve. A two-wheel model is by definition what fits.
const FOUR_WHEEL_SIGMA: f64 = 0.2;

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
    /// g(F) of a row and its rate of change. `bend` is the grip's reciprocal, 1/N, of the brush
    /// curve, and q, 1/N^2, of the cubic one.
    fn pull(&self, curve: Curve, row: usize, bend: f64) -> [f64; 2] {
        let (force_n, parts) = (self.rows.force_n[row], self.rows.load_parts[row]);
        let rate_n_s = self.rows.force_rate_n_s[row];
        match curve {
            Curve::Brush => {
                let pull = self.body.pull(self.axle, force_n, parts, bend);
                [pull.n, pull.per_force * rate_n_s]
            }
            Curve::Cubic => {
                let pull = self.body.pull(self.axle, force_n, parts, 0.0);
                let square = force_n * force_n * bend;
                let per_force = pull.per_force * (1.0 + 3.0 * square);
                [pull.n * (1.0 + square), per_force * rate_n_s]
            }
        }
    }

    /// Slip less what the coefficients (offset, 1/C, tau/C, bend) make of the force.
    fn residual(&self, curve: Curve, row: usize, c: [f64; 4]) -> f64 {
        let [pull_n, rate_n_s] = self.pull(curve, row, c[3]);
        self.rows.slip[row] - c[0] + c[1] * pull_n + c[2] * rate_n_s
    }
}

/// One axle's fit: offset, 1/C, tau/C and, where it was found, the bend of the curve.
pub(super) struct AxleFit {
    pub(super) curve: Curve,
    /// Bend of the curve.
    bend: f64,
    pub(super) fit: Fit,
    /// What the deviations of the grip, beside noise, move the coefficients by.
    pub(super) moved_by_grip: Vec<DVector<f64>>,
}

impl AxleFit {
    pub(super) fn stiffness_n_rad(&self) -> f64 {
        self.fit.coefficients[1].recip()
    }

    /// Grip of the axle, or Q of the cubic curve F + F^3/Q^2, N.
    pub(super) fn grip_n(&self) -> f64 {
        match self.curve {
            Curve::Brush => self.bend.abs().recip(),
            Curve::Cubic => self.bend.abs().sqrt().recip(),
        }
    }

    /// What the coefficients would move by if the rows were these, of such a body.
    pub(super) fn moved(&self, body: &Body, axle: usize, rows: &AxleRows) -> DVector<f64> {
        let axle = Axle { body, axle, rows };
        let c = &self.fit.coefficients;
        let c = [c[0], c[1], c[2], self.bend];
        let change = (0..rows.slip.len())
            .map(|row| axle.residual(self.curve, row, c) - self.fit.residuals[row]);
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
        let [pull_n, _] = axle.pull(self.curve, 0, self.bend);
        self.fit.coefficients[0] - self.fit.coefficients[1] * pull_n
    }
}

/// Fits one axle, its grip from the data and from the vehicle file.
pub(super) fn fit(body: &Body, axle: usize, rows: &AxleRows) -> Result<AxleFit, Refusal> {
    let file = body.grip_n[axle].recip();
    let axle = &Axle { body, axle, rows };
    let given = fit_given(axle, file).map_err(|refusal| refusal.of(WHAT).advise(ADVICE))?;
    let best = match fit_free(axle, Curve::Brush, &given.coefficients) {
        Ok(free) => {
            let apart = (free.coefficients[3] - file).abs();
            let near = apart <= CONFIRMED_APART * file;
            if near && free.sigma(3) <= CONFIRMED_SIGMA * file {
                under_file(axle, given, file, CONFIRMED_FILE_SIGMA)
            } else if !near && apart > CONTRADICTED_SIGMAS * free.sigma(3) {
                cubic_if_nearer(axle, with_file(axle, free, file))
            } else {
                with_file(axle, free, file)
            }
        }
        Err(_) => under_file(axle, given, file, FILE_SIGMA),
    };
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

/// The data's fit and the vehicle file's grip, each by its variance: with the gain
/// k = V e/(e^T V e + s^2) of the file's value, c + k (file - c_3) has the leverage l - l_3 k^T.
/// What the forces leave out moves the data's coefficients along d = V e/(e^T V e).
fn with_file(axle: &Axle<'_>, free: Fit, file: f64) -> AxleFit {
    let file_sigma = FILE_SIGMA * file;
    let own_sigma = match axle.rows.two_wheel {
        true => 0.0,
        false => FOUR_WHEEL_SIGMA * file,
    };
    let variance = free.covariance[(3, 3)].max(f64::MIN_POSITIVE);
    let along: DVector<f64> = free.covariance.column(3) / variance;
    let own = variance + own_sigma.powi(2);
    let gain = &along * (own / (own + file_sigma.powi(2)));
    let shift = file - free.coefficients[3];
    let pairs = free.coefficients.iter().zip(&gain);
    let coefficients: Vec<f64> = pairs.map(|(c, k)| c + k * shift).collect();
    let less = |rows: &DMatrix<f64>| rows - rows.column(3) * gain.transpose();
    let last = DVector::from_vec(vec![0.0, 0.0, 0.0, 1.0]);
    let keep = DMatrix::identity(4, 4) - &gain * last.transpose();
    let c = std::array::from_fn(|i| coefficients[i]);
    let residuals = (0..axle.rows.slip.len()).map(|row| axle.residual(Curve::Brush, row, c));
    AxleFit {
        curve: Curve::Brush,
        bend: c[3],
        moved_by_grip: vec![&gain * file_sigma, (along - &gain) * own_sigma],
        fit: Fit {
            residuals: residuals.collect(),
            influence: less(&free.influence),
            leverage: less(&free.leverage),
            covariance: &keep * &free.covariance * keep.transpose(),
            covariance_white: &keep * &free.covariance_white * keep.transpose(),
            coefficients,
            ..free
        },
    }
}

/// The cubic curve's fit, if it leaves less.
fn cubic_if_nearer(axle: &Axle<'_>, brush: AxleFit) -> AxleFit {
    match fit_free(axle, Curve::Cubic, &brush.fit.coefficients) {
        Ok(cubic) if cubic.residual_rms() < brush.fit.residual_rms() => AxleFit {
            curve: Curve::Cubic,
            bend: cubic.coefficients[3],
            moved_by_grip: Vec::new(),
            fit: cubic,
        },
        _ => brush,
    }
}

/// The fit under the vehicle file's grip, whose reciprocal has this deviation, parts of it.
fn under_file(axle: &Axle<'_>, fit: Fit, file: f64, sigma: f64) -> AxleFit {
    /// Part by which the grip's reciprocal is moved to see what that does.
    const PART: f64 = 0.1;
    let mut found = AxleFit {
        curve: Curve::Brush,
        bend: file * (1.0 + PART),
        moved_by_grip: Vec::new(),
        fit,
    };
    let moved = found.moved(axle.body, axle.axle, axle.rows) * (sigma / PART);
    found.moved_by_grip.push(moved);
    found.bend = file;
    found
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

/// Offset, 1/C, tau/C and the bend of the curve.
fn fit_free(axle: &Axle<'_>, curve: Curve, start: &[f64]) -> Result<Fit, Refusal> {
    let rows = axle.rows;
    let most_n = rows
        .force_n
        .iter()
        .fold(1.0_f64, |most, f| most.max(f.abs()));
    let bend = match curve {
        Curve::Brush => 0.1 / most_n,
        Curve::Cubic => 0.1 / (most_n * most_n),
    };
    let problem = Nonlinear {
        start: vec![start[0], start[1], start[2], bend],
        scale: vec![1e-3, start[1].abs(), start[1].abs() * 0.1, bend],
        iterations: 60,
    };
    nonlinear(&problem, |c| {
        let c = [c[0], c[1], c[2], c[3]];
        (0..rows.slip.len())
            .map(|row| axle.residual(curve, row, c))
            .collect()
    })
}
