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

#[cfg(test)]
mod tests {
    use super::*;

    /// A signal on a line has no bend, a step has one, and what comes after a gap is compared with nothing
    /// before it.
    #[test]
    fn only_what_leaves_the_line_is_a_bend() {
        let tau_s = 0.008;
        let mut lag = Lag::default();
        let mut through = 0.0;
        let mut bends = Vec::new();
        let times_ms = (0..20).chain(30..34).map(|k| 10 * k);
        for time_ms in times_ms {
            let signal = f64::from(time_ms) + if time_ms >= 100 { 500.0 } else { 0.0 };
            let kept = math::exp(-0.01 / tau_s);
            through = kept * through + (1.0 - kept) * signal;
            let reading = Reading {
                time: LogTime(1_000_000 * u64::try_from(time_ms).unwrap()),
                value: through,
                taken: false,
                count: 1,
                stream: None,
            };
            bends.push(lag.invert(&reading, tau_s).bend.round());
        }
        let mut expected = vec![0.0; 24];
        expected[10..12].copy_from_slice(&[500.0, -500.0]);
        assert_eq!(bends, expected);
    }
}
