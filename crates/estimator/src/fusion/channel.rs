//! Whether one channel can be believed.

/// Innovations beyond the gate within the memory after which a channel is called faulty.
const SUSPECT: f64 = 0.5;
/// Part of them from which it stands alone: what surprises others, too, begins at once.
const ALONE: f64 = 0.1;
/// Part of them below which it is used again.
const TRUSTED: f64 = 0.05;
/// Weight of one innovation in the memory: about half a second at 100 Hz to be excluded.
const LEARN: f64 = 1.0 / 50.0;
/// Weight of one innovation in their mean, about a second, and how many times the mean counts as
/// error of the model: what keeps to one side is no noise.
const MEAN_LEARN: f64 = 0.01;
const MEAN_FACTOR: f64 = 2.0;
/// How fast the part of the model's tolerance that a channel needs is learnt, and its bounds.
const TOLERANCE_LEARN: f64 = 0.02;
const TOLERANCE_BOUNDS: [f64; 2] = [0.03, 2.0];
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
    pub fn model_variance(&self, tolerance_n: f64) -> f64 {
        self.tolerance * tolerance_n.powi(2) + (MEAN_FACTOR * self.mean).powi(2)
    }

    /// Normalised square of an innovation before any reading of its step is taken in, by the
    /// variance of the last step's; none of a channel that is not believed, or has stood alone.
    pub fn foretold_square(&self, innovation: f64) -> Option<f64> {
        let [_, before] = self.variance;
        (!self.faulty && self.outside < ALONE && before > 0.0)
            .then(|| innovation * innovation / before)
    }

    /// Notes the variance of an innovation, after the channels that were taken in before it, and
    /// before any was: what several contradict together, all of them foretell the less.
    pub fn expect(&mut self, variance: [f64; 2]) {
        self.variance = variance;
    }

    /// Takes an innovation of a reading that is used into the mean, and into the tolerance by the
    /// part that this has in the variance that was noted.
    pub fn learn(&mut self, innovation: f64, tolerance_n: f64) {
        self.mean += MEAN_LEARN * (innovation - self.mean);
        let [after, _] = self.variance;
        let share = (self.tolerance * tolerance_n.powi(2) / after).min(1.0);
        let surplus = (innovation * innovation / after).min(GATE) - 1.0;
        let [least, most] = TOLERANCE_BOUNDS;
        let step = TOLERANCE_LEARN * share * surplus;
        if step.is_finite() {
            self.tolerance = (self.tolerance * (1.0 + step)).clamp(least, most);
        }
    }

    /// Judges an innovation by its normalised square: whether to use it, and what changed. Where
    /// the gate is `open` only that of a channel that is faulty or has stood alone is left out.
    pub fn judge(&mut self, square: f64, open: bool) -> (bool, Change) {
        let alone = self.outside >= ALONE;
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
        ((!outside || open && !alone) && !self.faulty, change)
    }
}
