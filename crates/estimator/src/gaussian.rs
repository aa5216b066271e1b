//! A value with its variance, and the gate test.

/// A normally distributed value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// Mean.
    pub mean: f64,
    /// Variance, in the square of the mean's unit.
    pub variance: f64,
}

impl Gaussian {
    /// A value with this mean and variance.
    #[must_use]
    pub fn new(mean: f64, variance: f64) -> Self {
        Self { mean, variance }
    }
}

/// Whether an innovation is within a gate of `gate_sigma` standard deviations: y² ≤ g² S. An
/// innovation or a variance that is not a number is not within.
#[must_use]
pub fn within(gate_sigma: f64, innovation: f64, variance: f64) -> bool {
    innovation * innovation <= gate_sigma * gate_sigma * variance
}

/// Whether an innovation is beyond a gate of `gate_sigma` standard deviations: y² > g² S. An
/// innovation or a variance that is not a number is not beyond.
#[must_use]
pub fn beyond(gate_sigma: f64, innovation: f64, variance: f64) -> bool {
    innovation * innovation > gate_sigma * gate_sigma * variance
}
