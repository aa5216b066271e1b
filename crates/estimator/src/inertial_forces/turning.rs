//! Moment that turns the vehicle about one axis, from the rate of turn.

use nalgebra::{Matrix2, Vector2};

/// Filter of a rate and its moment: I r' = N_0 + N, N' = white noise; r is
/// measured, and N_0 is the moment of a model.
#[derive(Clone, Copy, Debug)]
pub struct Turning {
    inertia_kg_m2: f64,
    walk_n_m: f64,
    noise_rad_s: f64,
    state: Option<Vector2<f64>>,
    model_n_m: f64,
    covariance: Matrix2<f64>,
}

impl Turning {
    /// A filter without readings: inertia in kg m^2, density of the moment in N m/√s, standard deviation of the
    /// rate in rad/s.
    pub fn new(inertia_kg_m2: f64, walk_n_m: f64, noise_rad_s: f64) -> Self {
        Self {
            inertia_kg_m2,
            walk_n_m,
            noise_rad_s,
            state: None,
            model_n_m: 0.0,
            covariance: Matrix2::zeros(),
        }
    }

    /// Starts anew with the next reading.
    pub fn forget(&mut self) {
        self.state = None;
    }

    /// Angular acceleration at the last instant, rad/s^2; zero before the first.
    pub fn acceleration_rad_s2(&self) -> f64 {
        self.state
            .map_or(0.0, |state| (self.model_n_m + state.y) / self.inertia_kg_m2)
    }

    /// Takes the rate of the next instant, rad/s, and the moment of the model since the instant before, N m. Returns
    /// the whole moment and its standard deviation, N m.
    pub fn step(&mut self, rate_rad_s: f64, model_n_m: f64, dt_s: f64) -> (f64, f64) {
        let noise = self.noise_rad_s.powi(2);
        let state = match self.state {
            None => {
                self.covariance =
                    Matrix2::from_diagonal(&Vector2::new(noise, self.walk_n_m.powi(2)));
                Vector2::new(rate_rad_s, 0.0)
            }
            Some(state) => {
                let transition = Matrix2::new(1.0, dt_s / self.inertia_kg_m2, 0.0, 1.0);
                let known = Vector2::new(model_n_m * dt_s / self.inertia_kg_m2, 0.0);
                let predicted = transition * state + known;
                let mut covariance = transition * self.covariance * transition.transpose();
                covariance[(1, 1)] += self.walk_n_m.powi(2) * dt_s;
                let gain = covariance.column(0) / (covariance[(0, 0)] + noise);
                self.covariance = covariance - gain * covariance.row(0);
                predicted + gain * (rate_rad_s - predicted.x)
            }
        };
        self.state = Some(state);
        self.model_n_m = model_n_m;
        (model_n_m + state.y, self.covariance[(1, 1)].max(0.0).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_that_grows_steadily_has_the_moment_of_its_growth() {
        let mut turning = Turning::new(2000.0, 3000.0, 0.002);
        let mut last = (0.0, 0.0);
        for step in 0..200 {
            last = turning.step(0.01 * f64::from(step) * 0.5, 0.0, 0.01);
        }
        assert!((last.0 - 1000.0).abs() < 0.5, "{last:?}");
        assert!(last.1 > 10.0 && last.1 < 1000.0, "{last:?}");
    }
}
