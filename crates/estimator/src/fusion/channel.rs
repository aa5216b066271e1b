//! Whether one channel can be believed.

/// Innovations beyond the gate within the memory after which a channel is called faulty.
const SUSPECT: f64 = 0.5;
/// Part of them below which it is used again.
const TRUSTED: f64 = 0.05;
/// Weight of one innovation in the memory: about half a second at 100 Hz to be excluded.
const LEARN: f64 = 1.0 / 50.0;
/// Weight of one innovation in their mean, about a second, and how many times the mean counts as
/// error of the model: what keeps to one side is no noise.
const MEAN_LEARN: f64 = 0.01;
const MEAN_FACTOR: f64 = 2.0;
/// Square of the normalised innovation that counts as one too many.
const GATE: f64 = 25.0;

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
#[derive(Clone, Copy, Debug, Default)]
pub struct ChannelHealth {
    outside: f64,
    mean: f64,
    faulty: bool,
}

impl ChannelHealth {
    /// Variance that the innovations' mean calls for.
    pub fn model_variance(&self) -> f64 {
        (MEAN_FACTOR * self.mean).powi(2)
    }

    /// Takes an innovation of a reading that is used into the mean.
    pub fn learn(&mut self, innovation: f64) {
        self.mean += MEAN_LEARN * (innovation - self.mean);
    }

    /// Judges an innovation by its normalised square: whether to use it, and what changed. Where
    /// the gate is `open` only a faulty channel's is left out.
    pub fn judge(&mut self, square: f64, open: bool) -> (bool, Change) {
        let outside = square.is_nan() || square > GATE;
        self.outside += LEARN * (f64::from(outside) - self.outside);
        let change = if !self.faulty && self.outside > SUSPECT {
            self.faulty = true;
            Change::Faulty
        } else if self.faulty && self.outside < TRUSTED {
            self.faulty = false;
            Change::Recovered
        } else {
            Change::None
        };
        ((!outside || open) && !self.faulty, change)
    }
}
