//! Length of a strut and its rate from a potentiometer: constant acceleration, white jerk, whose
//! density follows the road ([`ProcessNoise`]).

use nalgebra::{Matrix3, Vector3};
use sample::LogTime;

use crate::gaussian::beyond;
use crate::process_noise::ProcessNoise;
use crate::tuning::{StrutLengthTuning, Tuning};

/// The filter.
#[derive(Clone, Debug)]
pub struct LengthFilter {
    tuning: StrutLengthTuning,
    fresh_s: f64,
    state: Vector3<f64>,
    covariance: Matrix3<f64>,
    variance: f64,
    design_m: f64,
    time: Option<LogTime>,
    silent_s: f64,
    rejections: u32,
    jerk: ProcessNoise<1>,
}

impl LengthFilter {
    /// At the design length with a standard deviation of 0.1 m.
    pub fn new(design_m: f64, sigma_m: f64, tuning: &Tuning) -> Self {
        let t = tuning.corners.strut_length;
        Self {
            tuning: t,
            fresh_s: tuning.fresh_s,
            state: Vector3::new(design_m, 0.0, 0.0),
            covariance: Matrix3::from_diagonal(&Vector3::from(t.start_variance)),
            variance: sigma_m * sigma_m,
            design_m,
            time: None,
            silent_s: 0.0,
            rejections: 0,
            jerk: ProcessNoise::new(t.jerk_density, t.jerk_density_bounds, tuning.process_noise),
        }
    }

    /// Propagates the length; without readings it is held.
    pub fn predict(&mut self, dt: f64) {
        self.silent_s += dt;
        if self.silent_s > self.tuning.silence_s {
            if self.time.is_none() {
                self.state = Vector3::new(self.design_m, 0.0, 0.0);
            }
            self.state[1] = 0.0;
            self.state[2] = 0.0;
            self.covariance = Matrix3::from_diagonal(&Vector3::from(self.tuning.start_variance));
            return;
        }
        let f = Matrix3::new(1.0, dt, 0.5 * dt * dt, 0.0, 1.0, dt, 0.0, 0.0, 1.0);
        let q = self.jerk.density();
        let [d2, d3, d4, d5] = [dt * dt, dt.powi(3), dt.powi(4), dt.powi(5)];
        let noise = Matrix3::new(
            d5 / 20.0,
            d4 / 8.0,
            d3 / 6.0,
            d4 / 8.0,
            d3 / 3.0,
            d2 / 2.0,
            d3 / 6.0,
            d2 / 2.0,
            dt,
        );
        self.state = f * self.state;
        self.covariance = f * self.covariance * f.transpose() + noise * q;
    }

    /// Takes a length that was valid at `valid`.
    pub fn update(&mut self, now: LogTime, valid: LogTime, length_m: f64) {
        if !length_m.is_finite() || (length_m - self.design_m).abs() > 1.0 {
            return;
        }
        let age = now.seconds_since(valid).clamp(-0.01, self.fresh_s);
        let h = Vector3::new(1.0, -age, 0.5 * age * age);
        let ph = self.covariance * h;
        let total = h.dot(&ph) + self.variance;
        let innovation = length_m - h.dot(&self.state);
        let t = &self.tuning;
        if beyond(t.gate_sigma, innovation, total) {
            self.rejections += 1;
            if self.rejections < t.rejections_max {
                return;
            }
            self.state = Vector3::new(length_m, 0.0, 0.0);
            let [_, rate, acceleration] = t.start_variance;
            let variance = Vector3::new(t.adopted_variance_m2, rate, acceleration);
            self.covariance = Matrix3::from_diagonal(&variance);
        } else {
            self.jerk.learn([innovation / total.sqrt()]);
            self.state += ph * (innovation / total);
            self.covariance -= ph * ph.transpose() / total;
            self.covariance = (self.covariance + self.covariance.transpose()) * 0.5;
        }
        self.rejections = 0;
        self.silent_s = 0.0;
        self.time = Some(valid);
    }

    /// Length and rate, m and m/s.
    pub fn value(&self) -> [f64; 2] {
        [self.state[0], self.state[1]]
    }

    /// Whether the length at `now` is measured.
    pub fn known(&self, now: LogTime) -> bool {
        self.time
            .is_some_and(|time| now.seconds_since(time) <= self.tuning.silence_s)
    }

    /// Variance of -k l - c l', N^2; `None` while nothing is measured.
    pub fn force_variance(&self, stiffness_n_m: f64, damping_n_s_m: f64) -> Option<f64> {
        let gain = Vector3::new(stiffness_n_m, damping_n_s_m, 0.0);
        (self.time.is_some() && self.silent_s <= self.tuning.silence_s)
            .then(|| (gain.transpose() * self.covariance * gain)[0])
    }
}
