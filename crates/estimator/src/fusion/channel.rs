//! Monitor of one strain channel.

use crate::tuning::ChannelTuning;

/// A change of a channel's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// None.
    None,
    /// It is not used any more.
    Faulty,
    /// It is used again.
    Recovered,
}

/// Monitor of one channel.
#[derive(Clone, Copy, Debug)]
pub struct ChannelHealth {
    outside: f64,
    mean: f64,
    /// Factor on the variance of the model's tolerance.
    tolerance: f64,
    /// Variance of the last innovation, after the channels before it were taken.
    variance: f64,
    faulty: bool,
    /// Readings within the gate since the last one outside.
    calm: u32,
    /// Whether it left its gate by a leap, and has not returned: a fault that has begun, no mistake of the
    /// configuration.
    leapt: bool,
}

impl Default for ChannelHealth {
    fn default() -> Self {
        Self {
            outside: 0.0,
            mean: 0.0,
            tolerance: 1.0,
            variance: 0.0,
            faulty: false,
            calm: 0,
            leapt: false,
        }
    }
}

impl ChannelHealth {
    /// Variance of the model's error on a channel with `tolerance_n`: the adapted part of it, and
    /// the mean of innovations within its bound.
    pub fn model_variance(&self, tolerance_n: f64, tuning: &ChannelTuning) -> f64 {
        let mean = (tuning.mean_factor * self.mean)
            .abs()
            .min(tuning.mean_bound * tolerance_n);
        self.tolerance * tolerance_n.powi(2) + mean.powi(2)
    }

    /// Stores the variance of an innovation after the channels before it were taken.
    pub fn expect(&mut self, variance: f64) {
        self.variance = variance;
    }

    /// Whether it was found faulty.
    pub const fn is_faulty(&self) -> bool {
        self.faulty
    }

    /// Whether a fault has begun by a leap of its readings and lasts.
    pub const fn has_leapt(&self) -> bool {
        self.leapt
    }

    /// Whether the channel is used: it is not faulty and was not outside its gate for several readings.
    pub fn is_used(&self, tuning: &ChannelTuning) -> bool {
        !self.faulty && self.outside < tuning.alone
    }

    /// Updates the mean and the tolerance factor by the innovation of a used reading; the factor by
    /// the model's share in the variance.
    pub fn learn(&mut self, innovation: f64, tolerance_n: f64, tuning: &ChannelTuning) {
        self.mean += tuning.mean_learning * (innovation - self.mean);
        let after = self.variance;
        let share = (self.tolerance * tolerance_n.powi(2) / after).min(1.0);
        let surplus =
            (innovation * innovation / after).min(tuning.gate_sigma * tuning.gate_sigma) - 1.0;
        let [least, most] = tuning.tolerance_bounds;
        let step = tuning.tolerance_learning * share * surplus;
        if step.is_finite() {
            self.tolerance = (self.tolerance * (1.0 + step)).clamp(least, most);
        }
    }

    /// Judges an innovation by its normalised square, before any reading of the step was taken. What the
    /// road does to several channels at once is no evidence. A channel is not found faulty unless `may_blame`, or its
    /// readings leap after they agreed for long: a wrong configuration contradicts them from the beginning.
    pub fn judge(
        &mut self,
        square: f64,
        is_evidence: bool,
        may_blame: bool,
        tuning: &ChannelTuning,
    ) -> Change {
        let gate = tuning.gate_sigma;
        let outside = square.is_nan() || square > gate * gate;
        if outside && !is_evidence {
            return Change::None;
        }
        let far = square > tuning.leap_sigma * tuning.leap_sigma;
        self.leapt |= far && self.calm >= tuning.leap_calm;
        self.calm = if outside {
            0
        } else {
            self.calm.saturating_add(1)
        };
        self.leapt &= self.calm < tuning.leap_calm;
        self.outside += tuning.learning * (f64::from(outside) - self.outside);
        if !self.faulty && self.outside > tuning.faulty && (may_blame || self.leapt) {
            self.faulty = true;
            Change::Faulty
        } else if self.faulty && self.outside < tuning.good {
            (self.faulty, self.leapt) = (false, false);
            Change::Recovered
        } else {
            Change::None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Tuning;

    /// A channel that agreed for a second and leaps is found while the configuration is still weighed; one that is
    /// outside from the beginning is not, and neither is one that leaves the gate step by step.
    #[test]
    fn a_leap_is_no_mistake_of_the_configuration() {
        let tuning = Tuning::default().fusion.channels;
        let found = |squares: &[f64]| {
            let mut health = ChannelHealth::default();
            let mut judge = |square: &f64| health.judge(*square, true, false, &tuning);
            squares.iter().any(|square| judge(square) == Change::Faulty)
        };
        let (calm, far) = ([1.0; 100], [400.0; 100]);
        assert!(found(&[calm, far].concat()));
        assert!(!found(&[far, far].concat()));
        let slowly: Vec<f64> = (0..200).map(|k| f64::from(k * k) / 50.0).collect();
        assert!(!found(&[&calm[..], &slowly].concat()));
    }

    /// Innovations that keep one sign make a channel weigh less, but never so little that it can no longer
    /// correct the state.
    #[test]
    fn a_channel_that_disagrees_for_long_keeps_a_bounded_variance() {
        let tuning = Tuning::default().fusion.channels;
        let mut health = ChannelHealth::default();
        let fresh = health.model_variance(2.0, &tuning);
        for _ in 0..1000 {
            health.expect(100.0 * 100.0);
            health.learn(-300.0, 2.0, &tuning);
        }
        let late = health.model_variance(2.0, &tuning);
        assert!(late > 2.0 * fresh, "{late} against {fresh} N^2");
        let most = (tuning.tolerance_bounds[1] + tuning.mean_bound.powi(2)) * 2.0 * 2.0;
        assert!(late <= most, "{late} N^2");
    }
}
