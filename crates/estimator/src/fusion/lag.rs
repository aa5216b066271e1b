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
pub(super) struct Lag(Option<(LogTime, f64)>);

/// A reading without its lag.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unlagged {
    pub(super) value: f64,
    /// How long before the reading the signal had this value.
    pub(super) delay: Back,
    /// Factor on the variance of a single reading.
    pub(super) noise: f64,
}

impl Lag {
    /// Takes a reading and undoes the lag.
    pub(super) fn invert(&mut self, reading: &Reading, tau_s: f64) -> Unlagged {
        let before = self.0.replace((reading.time, reading.value));
        let count = f64::from(reading.count);
        // A gap of more than five steps is not bridged.
        let near = before.filter(|(time, _)| reading.time.seconds_since(*time) < 5.0 * GRID_S);
        let Some((time, value)) = near else {
            return Unlagged {
                value: reading.value,
                delay: Back::at(tau_s),
                noise: 1.0 / count,
            };
        };
        let gap_s = reading.time.seconds_since(time);
        let kept = math::exp(-gap_s / tau_s);
        Unlagged {
            value: (reading.value - kept * value) / (1.0 - kept),
            delay: Back {
                mean_s: tau_s - gap_s * kept / (1.0 - kept),
                square_s2: 2.0 * tau_s * tau_s
                    - gap_s * (gap_s + 2.0 * tau_s) * kept / (1.0 - kept),
            },
            noise: (1.0 + kept * kept) / ((1.0 - kept) * (1.0 - kept) * count),
        }
    }
}
