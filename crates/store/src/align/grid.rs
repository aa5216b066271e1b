//! Times at a rate.

/// Nanoseconds of a second.
const SECOND_NS: i64 = 1_000_000_000;
/// Rates of a grid, Hz.
const RATES_HZ: std::ops::RangeInclusive<f64> = 0.001..=1e6;

/// The rate of a grid is outside of 0.001 to 1,000,000 Hz.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("a rate of {rate_hz} Hz is not possible; use a rate between 0.001 and 1000000 Hz")]
pub struct GridError {
    /// The rate.
    pub rate_hz: f64,
}

/// Times at a constant rate. The first is a whole second, so that the times of two logs are the same at
/// rates that are whole numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    zero_ns: i64,
    rate_hz: f64,
}

impl Grid {
    /// A grid for times from `start_ns` on.
    ///
    /// # Errors
    /// If the rate is outside of 0.001 to 1,000,000 Hz.
    pub fn new(start_ns: i64, rate_hz: f64) -> Result<Self, GridError> {
        if !RATES_HZ.contains(&rate_hz) {
            return Err(GridError { rate_hz });
        }
        Ok(Self {
            zero_ns: start_ns - start_ns.rem_euclid(SECOND_NS),
            rate_hz,
        })
    }

    /// Times from `start_ns` on, before `end_ns`, rounded to nanoseconds.
    pub fn times_ns(&self, start_ns: i64, end_ns: i64) -> Vec<i64> {
        let since_s = start_ns.saturating_sub(self.zero_ns) as f64 / SECOND_NS as f64;
        // One earlier, because the product is rounded.
        let first = (since_s * self.rate_hz).floor() as i64 - 1;
        let times = (first.max(0)..).map(|number| self.time_ns(number));
        times
            .skip_while(|ns| *ns < start_ns)
            .take_while(|ns| *ns < end_ns)
            .collect()
    }

    fn time_ns(&self, number: i64) -> i64 {
        // Exact below 104 days: 2^53 ns.
        let since_ns = number as f64 * SECOND_NS as f64 / self.rate_hz;
        self.zero_ns.saturating_add(since_ns.round() as i64)
    }
}
