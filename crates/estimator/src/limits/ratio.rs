//! A ratio between two measured values.

/// Scalar Kalman filter of c in z = c x.
#[derive(Clone, Copy, Debug)]
pub(super) struct RatioFilter {
    value: f64,
    variance: f64,
    /// Largest variance: that of the start.
    most: f64,
}

impl RatioFilter {
    pub fn new(value: f64, sigma: f64) -> Self {
        Self {
            value,
            variance: sigma * sigma,
            most: sigma * sigma,
        }
    }

    /// Takes a pair with the standard deviation of z, after a random walk of c.
    pub fn take(&mut self, x: f64, z: f64, sigma: f64, walk: f64) {
        self.variance = (self.variance + walk * walk).min(self.most);
        let gain = self.variance * x / (self.variance * x * x + sigma * sigma);
        self.value += gain * (z - self.value * x);
        self.variance -= gain * x * self.variance;
    }

    pub fn value(&self) -> f64 {
        self.value
    }

    pub fn sigma(&self) -> f64 {
        self.variance.sqrt()
    }
}
