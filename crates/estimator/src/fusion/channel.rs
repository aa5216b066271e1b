//! Whether one channel can be believed.

use crate::tuning::ChannelTuning;

/// A change of a channel's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// None.
    None,
    /// It is excluded from now on.
    Faulty,
    /// It is used again.
    Recovered,
}

/// Memory of one channel.
#[derive(Clone, Copy, Debug)]
pub struct ChannelHealth {
    outside: f64,
    mean: f64,
    /// Factor on the variance of the model's tolerance.
    tolerance: f64,
    /// Variance of the last innovation, after the channels that were taken in before it, and before
    /// any was.
    variance: [f64; 2],
    faulty: bool,
}

impl Default for ChannelHealth {
    fn default() -> Self {
        Self {
            outside: 0.0,
            mean: 0.0,
            tolerance: 1.0,
            variance: [0.0; 2],
            faulty: false,
        }
    }
}

impl ChannelHealth {
    /// Variance of the model's error, of which a workshop's `tolerance_n` is known: as much of it as
    /// the innovations call for, and what their mean does.
    pub fn model_variance(&self, tolerance_n: f64, tuning: &ChannelTuning) -> f64 {
        self.tolerance * tolerance_n.powi(2) + (tuning.mean_factor * self.mean).powi(2)
    }

    /// Normalised square of an innovation before any reading of its step is taken in, by the
    /// variance of the last step's; none of a channel that is not believed, or has stood alone.
    pub fn predicted_square(&self, innovation: f64, tuning: &ChannelTuning) -> Option<f64> {
        let [_, before] = self.variance;
        (!self.faulty && self.outside < tuning.alone && before > 0.0)
            .then(|| innovation * innovation / before)
    }

    /// Notes the variance of an innovation, after the channels that were taken in before it, and
    /// before any was: what several contradict together, all of them foretell the less.
    pub fn expect(&mut self, variance: [f64; 2]) {
        self.variance = variance;
    }

    /// Takes an innovation of a reading that is used into the mean, and into the tolerance by the
    /// part that this has in the variance that was noted.
    pub fn learn(&mut self, innovation: f64, tolerance_n: f64, tuning: &ChannelTuning) {
        self.mean += tuning.mean_learning * (innovation - self.mean);
        let [after, _] = self.variance;
        let share = (self.tolerance * tolerance_n.powi(2) / after).min(1.0);
        let surplus =
            (innovation * innovation / after).min(tuning.gate_sigma * tuning.gate_sigma) - 1.0;
        let [least, most] = tuning.tolerance_bounds;
        let step = tuning.tolerance_learning * share * surplus;
        if step.is_finite() {
            self.tolerance = (self.tolerance * (1.0 + step)).clamp(least, most);
        }
    }

    /// Judges an innovation by its normalised square: whether to use it, and what changed. Where
    /// the gate is `open` only that of a channel that is faulty or has stood alone is left out.
    pub fn judge(&mut self, square: f64, open: bool, tuning: &ChannelTuning) -> (bool, Change) {
        let alone = self.outside >= tuning.alone;
        let gate = tuning.gate_sigma;
        let outside = square.is_nan() || square > gate * gate;
        self.outside += tuning.learning * (f64::from(outside) - self.outside);
        let change = if !self.faulty && self.outside > tuning.faulty {
            self.faulty = true;
            Change::Faulty
        } else if self.faulty && self.outside < tuning.good {
            self.faulty = false;
            Change::Recovered
        } else {
            Change::None
        };
        ((!outside || open && !alone) && !self.faulty, change)
    }
}
