//! Search for the parameters: prediction-error method with priors.

use model::vehicle::Vehicle;
use nalgebra::{DMatrix, DVector};

use super::deviations::{self, Deviations};
use super::{
    AT_REST, DELAY, DELAY_NONE_S, HUBER, PRIOR_ROWS, ROUNDS, SEARCHED, STARTS, STEP_MAX, Theta,
    delays, from_theta, prior_sigma, range,
};
use crate::finding::Refusal;
use crate::planar::{PlanarDoubt, PlanarFilter, PlanarInput, PlanarModel, PlanarNoise};
use crate::tuning::PlanarTuning;

/// A drive to be explained.
pub(super) struct Problem<'d> {
    pub(super) inputs: &'d [PlanarInput],
    pub(super) vehicle: &'d Vehicle,
    pub(super) imu_ahead_m: f64,
    pub(super) noise: PlanarNoise,
    pub(super) prior: Theta,
    /// Whether steer angle and lateral acceleration have no delay.
    pub(super) no_delay: [bool; 2],
}

/// What the filter makes of the drive.
pub(super) struct Run {
    /// Innovations of yaw rate and lateral acceleration in turn, zero where nothing was measured.
    pub(super) residuals: Vec<f64>,
    /// What the filter expected of them.
    pub(super) deviations: Vec<f64>,
    pub(super) offsets: [f64; 3],
}

/// The parameters that explain a drive.
pub(super) struct Fit {
    pub(super) theta: Theta,
    pub(super) prior: Theta,
    pub(super) run: Run,
    pub(super) deviations: Deviations,
    /// Delays of steer angle and lateral acceleration, s, and their standard deviations.
    pub(super) delay_s: [f64; 2],
    pub(super) delay_sigma_s: [f64; 2],
    pub(super) corrected: [bool; 2],
}

impl Problem<'_> {
    /// Searches with the delays, and then without those that are small.
    pub(super) fn fit(mut self) -> Result<Fit, Refusal> {
        let mut theta = self.best_start();
        for (of, iterations) in ROUNDS {
            let doubt = of(&PlanarTuning::default());
            let held = self.run(&theta, doubt).deviations;
            theta = self.descend(theta, &held, doubt, iterations);
        }
        let delay_s = [theta[DELAY], theta[DELAY + 1]];
        delays::refuse_large(delay_s)?;
        let (of, iterations) = ROUNDS[ROUNDS.len() - 1];
        let doubt = of(&PlanarTuning::default());
        let held = self.run(&theta, doubt).deviations;
        let (residual, slopes) = self.slopes(&theta, &held, doubt);
        let found = deviations::of(&theta, &residual, &slopes, self.inputs);
        self.no_delay = delay_s.map(|delay_s| delay_s.abs() <= DELAY_NONE_S);
        for (which, none) in self.no_delay.into_iter().enumerate() {
            if none {
                theta[DELAY + which] = 0.0;
            }
        }
        theta = self.descend(theta, &held, doubt, iterations);
        let (residual, slopes) = self.slopes(&theta, &held, doubt);
        Ok(Fit {
            theta,
            prior: self.prior,
            run: self.run(&theta, doubt),
            deviations: deviations::of(&theta, &residual, &slopes, self.inputs),
            delay_s,
            delay_sigma_s: [found.sigma[DELAY], found.sigma[DELAY + 1]],
            corrected: self.no_delay.map(|none| !none),
        })
    }

    fn run(&self, theta: &Theta, doubt: PlanarDoubt) -> Run {
        let model = PlanarModel::new(
            self.vehicle,
            from_theta(theta),
            self.imu_ahead_m,
            &PlanarTuning::default(),
        );
        let mut filter = PlanarFilter::new(model, self.noise, doubt, false);
        let mut run = Run {
            residuals: Vec::with_capacity(2 * self.inputs.len()),
            deviations: Vec::with_capacity(2 * self.inputs.len()),
            offsets: [0.0; 3],
        };
        let mut before_s = f64::NEG_INFINITY;
        let inputs = delays::shifted(self.inputs, [theta[DELAY], theta[DELAY + 1]]);
        for input in inputs.iter() {
            let dt_s = input.time_s - before_s;
            before_s = input.time_s;
            let state = filter.step(dt_s, input);
            for innovation in state.innovations {
                let known = innovation.value.is_finite() && innovation.sigma > 0.0;
                run.residuals
                    .push(if known { innovation.value } else { 0.0 });
                run.deviations
                    .push(if known { innovation.sigma } else { 1.0 });
            }
        }
        run.offsets = filter.offsets();
        run
    }

    /// Residuals of the fit: innovations over held deviations, and the distance from the prior.
    fn residuals(&self, theta: &Theta, held: &[f64], doubt: PlanarDoubt) -> DVector<f64> {
        let run = self.run(theta, doubt);
        let data = run.residuals.iter().zip(held).map(|(r, s)| tame(r / s));
        let prior =
            (0..SEARCHED).map(|j| PRIOR_ROWS.sqrt() * (theta[j] - self.prior[j]) / prior_sigma(j));
        DVector::from_vec(data.chain(prior).collect())
    }

    /// The best of a few delays and stiffnesses: from far away the fit can end in a spin.
    fn best_start(&self) -> Theta {
        let (doubt, _) = ROUNDS[0];
        let doubt = doubt(&PlanarTuning::default());
        let held = self.run(&self.prior, doubt).deviations;
        let cost = |theta: &Theta| self.residuals(theta, &held, doubt).norm_squared();
        let mut best = (f64::INFINITY, self.prior);
        for front in STARTS {
            for rear in STARTS {
                let mut theta = self.prior;
                theta[0] += math::ln(front);
                theta[1] += math::ln(rear);
                let cost = cost(&theta);
                if cost < best.0 {
                    best = (cost, theta);
                }
            }
        }
        delays::coarse(best.1, |theta| {
            let run = self.run(theta, doubt);
            run.residuals
                .iter()
                .zip(&held)
                .map(|(r, s)| tame(r / s).powi(2))
                .sum()
        })
    }

    /// Residuals and their derivatives. Derivatives are forward differences: each costs a drive.
    fn slopes(
        &self,
        theta: &Theta,
        held: &[f64],
        doubt: PlanarDoubt,
    ) -> (DVector<f64>, DMatrix<f64>) {
        let residual = self.residuals(theta, held, doubt);
        let mut slopes = DMatrix::zeros(residual.len(), SEARCHED);
        for j in 0..SEARCHED {
            if j >= DELAY && self.no_delay[j - DELAY] {
                let row = residual.len() - SEARCHED + j;
                slopes[(row, j)] = PRIOR_ROWS.sqrt() / prior_sigma(j);
                continue;
            }
            let step = 1e-4 * prior_sigma(j);
            let mut moved = *theta;
            moved[j] += step;
            let column = (self.residuals(&moved, held, doubt) - &residual) / step;
            slopes.set_column(j, &column);
        }
        (residual, slopes)
    }

    /// Levenberg's and Marquardt's descent within the physical range.
    fn descend(
        &self,
        mut theta: Theta,
        held: &[f64],
        doubt: PlanarDoubt,
        iterations: usize,
    ) -> Theta {
        let mut damping = 1e-3;
        for _ in 0..iterations {
            let (residual, slopes) = self.slopes(&theta, held, doubt);
            let mut cost = residual.norm_squared();
            let information = slopes.transpose() * &slopes;
            let pull = slopes.transpose() * &residual;
            let before = cost;
            while damping < 1e6 {
                let mut damped = information.clone();
                for j in 0..SEARCHED {
                    damped[(j, j)] *= 1.0 + damping;
                }
                let Some(step) = damped.cholesky().map(|c| c.solve(&pull)) else {
                    damping *= 10.0;
                    continue;
                };
                let longest = (0..SEARCHED)
                    .map(|j| (step[j] / prior_sigma(j)).abs())
                    .fold(STEP_MAX, f64::max);
                let next: Theta = std::array::from_fn(|j| {
                    range::clamp(j, theta[j] - step[j] * STEP_MAX / longest)
                });
                let next_cost = self.residuals(&next, held, doubt).norm_squared();
                if next_cost < cost {
                    (theta, cost) = (next, next_cost);
                    damping = (damping * 0.2).max(1e-9);
                    break;
                }
                damping *= 5.0;
            }
            if before - cost < AT_REST * before {
                break;
            }
        }
        theta
    }
}

/// An innovation whose square grows as Huber's cost does.
fn tame(x: f64) -> f64 {
    let size = x.abs();
    if size <= HUBER {
        x
    } else {
        x.signum() * (2.0 * HUBER * size - HUBER * HUBER).sqrt()
    }
}
