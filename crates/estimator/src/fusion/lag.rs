//! First-order lag of a sensor, undone from reading to reading.
//!
//! A lag with the time constant tau gives `y_k = a y_{k-1} + (1 - a) u` with a = exp(-t/tau), where u is the
//! mean of the signal over the time t since the reading before, weighted towards its end. So
//! `u = (y_k - a y_{k-1})/(1 - a)` measures the signal of tau - t a/(1 - a) ago without a state of the lag,
//! with the noise of two readings. The same holds for the means of as many readings in each step.

use sample::LogTime;

use super::forms::Back;
use crate::grid::GRID_S;
use crate::inputs::Reading;

/// The last reading of a channel with a lag.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lag {
    reading: Option<(LogTime, f64)>,
    /// The last two values without the lag, the latest first.
    values: [Option<f64>; 2],
}

/// A reading without its lag.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unlagged {
    pub(super) value: f64,
    /// How long before the reading the signal had this value.
    pub(super) delay: Back,
    /// Factor on the variance of a single reading.
    pub(super) noise: f64,
    /// Second difference of this value and the two before: the signal is no line between two readings. Zero
    /// after a gap.
    pub(super) bend: f64,
}

impl Lag {
    /// Takes a reading and undoes the lag.
    pub(super) fn invert(&mut self, reading: &Reading, tau_s: f64) -> Unlagged {
        let before = self.reading.replace((reading.time, reading.value));
        let count = f64::from(reading.count);
        // A gap of more than five steps is not bridged.
        let near = before.filter(|(time, _)| reading.time.seconds_since(*time) < 5.0 * GRID_S);
        let Some((time, value)) = near else {
            self.values = [None; 2];
            return Unlagged {
                value: reading.value,
                delay: Back::at(tau_s),
                noise: 1.0 / count,
                bend: 0.0,
            };
        };
        let gap_s = reading.time.seconds_since(time);
        let kept = math::exp(-gap_s / tau_s);
        let value = (reading.value - kept * value) / (1.0 - kept);
        let bend = match self.values {
            [Some(one), Some(two)] => value - 2.0 * one + two,
            _ => 0.0,
        };
        self.values = [Some(value), self.values[0]];
        Unlagged {
            value,
            bend,
            delay: Back {
                mean_s: tau_s - gap_s * kept / (1.0 - kept),
                square_s2: 2.0 * tau_s * tau_s
                    - gap_s * (gap_s + 2.0 * tau_s) * kept / (1.0 - kept),
            },
            noise: (1.0 + kept * kept) / ((1.0 - kept) * (1.0 - kept) * count),
        }
    }
}
