//! Peaks of the load after landings: of the estimate against the truth.

use sample::{Estimate, ForceFrame, LogTime, PerWheel, Wheel};
use serde_json::{Value, json};

use super::flights::Flights;
use super::{Pair, contact_load_n};

/// Time after a landing in which the peak is looked for, s.
const PEAK_S: f64 = 0.3;

/// Errors of the peak loads after landings, of one output.
#[derive(Clone, Debug, PartialEq)]
pub struct LandingScore {
    /// `estimate`, `lagged` or `smoothed`.
    pub output: &'static str,
    /// Number of landings.
    pub count: usize,
    /// Mean of the relative errors, per cent of the true peak.
    pub mean_percent: f64,
    /// Standard deviation of the relative errors about their mean, per cent; `None` for a single one.
    pub standard_deviation_percent: Option<f64>,
}

/// Landings of one output so far.
#[derive(Default)]
pub(super) struct Landings {
    start: Option<LogTime>,
    frame: Option<ForceFrame>,
    wheels: [WheelLandings; 4],
    count: usize,
    sum: f64,
    squares: f64,
}

/// Landings of one wheel whose peak is looked for.
#[derive(Default)]
struct WheelLandings {
    flights: Flights,
    open: Vec<Landing>,
}

/// A landing with the peaks so far.
struct Landing {
    end_s: f64,
    truth_n: f64,
    estimate_n: f64,
}

impl WheelLandings {
    /// Takes the next loads. Calls `add` with the peaks of truth and estimate.
    fn push(&mut self, at_s: f64, part: f64, loads_n: [f64; 2], mut add: impl FnMut([f64; 2])) {
        if let Some(flight) = self.flights.push(at_s, part)
            && flight.is_lift()
        {
            self.open.push(Landing {
                end_s: at_s + PEAK_S,
                truth_n: f64::NEG_INFINITY,
                estimate_n: f64::NEG_INFINITY,
            });
        }
        let [truth_n, estimate_n] = loads_n;
        self.open.retain_mut(|landing| {
            let is_open = at_s <= landing.end_s + 1e-9;
            if is_open {
                landing.truth_n = landing.truth_n.max(truth_n);
                landing.estimate_n = landing.estimate_n.max(estimate_n);
            } else {
                add([landing.truth_n, landing.estimate_n]);
            }
            is_open
        });
    }
}

impl Landings {
    /// Takes the next part. The loads are in the wheel-carrier frame, or in the contact frame if the log
    /// has no others.
    pub fn push(&mut self, pairs: &[Pair], static_n: &PerWheel<f64>) {
        for (estimate, truth) in pairs {
            let start = *self.start.get_or_insert(truth.time);
            let frame = *self.frame.get_or_insert_with(|| frame_of(estimate, truth));
            let at_s = truth.time.seconds_since(start);
            for wheel in Wheel::ALL {
                let part = contact_load_n(truth, wheel) / static_n[wheel];
                let loads_n = [&**truth, &**estimate].map(|of| of.forces(frame)[wheel].force_n[2]);
                let (count, sum, squares) = (&mut self.count, &mut self.sum, &mut self.squares);
                let landings = &mut self.wheels[wheel.index()];
                landings.push(at_s, part, loads_n, |[truth_n, estimate_n]| {
                    let error = estimate_n / truth_n - 1.0;
                    if error.is_finite() {
                        *count += 1;
                        *sum += error;
                        *squares += error * error;
                    }
                });
            }
        }
    }

    /// The score; `None` without a landing.
    pub fn finish(self, output: &'static str) -> Option<LandingScore> {
        let count = self.count as f64;
        let mean = self.sum / count;
        let variance = (self.squares - count * mean * mean).max(0.0) / (count - 1.0);
        (self.count > 0).then_some(LandingScore {
            output,
            count: self.count,
            mean_percent: 100.0 * mean,
            standard_deviation_percent: (self.count > 1).then(|| 100.0 * variance.sqrt()),
        })
    }
}

/// The frame in which both know the loads.
fn frame_of(estimate: &Estimate, truth: &Estimate) -> ForceFrame {
    let is_known = |of: &Estimate| {
        let forces = &of.forces(ForceFrame::WheelCarrier).0;
        forces.iter().any(|force| force.force_n[2].is_finite())
    };
    if is_known(estimate) && is_known(truth) {
        ForceFrame::WheelCarrier
    } else {
        ForceFrame::Contact
    }
}

impl LandingScore {
    /// As JSON.
    #[must_use]
    pub fn to_json(&self) -> Value {
        json!({
            "output": self.output,
            "count": self.count,
            "mean_percent": self.mean_percent,
            "standard_deviation_percent": self.standard_deviation_percent,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Peaks of a wheel with the loads of `load_n(t)`, truth and estimate, and a static load of 1,000 N.
    fn peaks(load_n: impl Fn(f64) -> [f64; 2]) -> Vec<[f64; 2]> {
        let mut wheel = WheelLandings::default();
        let mut found = Vec::new();
        for k in 0..500 {
            let at_s = f64::from(k) * 0.01;
            let loads_n = load_n(at_s);
            wheel.push(at_s, loads_n[0] / 1e3, loads_n, |peaks| found.push(peaks));
        }
        found
    }

    #[test]
    fn the_peak_is_that_of_the_next_three_tenths_of_a_second() {
        let in_air = |t: f64| (1.0..1.2).contains(&t) || (3.0..3.05).contains(&t);
        let found = peaks(|t| match t {
            t if in_air(t) => [0.0, 0.0],
            // The estimate is late; the peak of 2.0 s is too late to belong to the landing.
            t if (1.245..1.255).contains(&t) => [3000.0, 1500.0],
            t if (1.265..1.275).contains(&t) => [1500.0, 3300.0],
            t if (1.995..2.005).contains(&t) => [9000.0, 9000.0],
            _ => [1000.0, 1000.0],
        });
        // The second time in the air is too short for a lift.
        assert_eq!(found, [[3000.0, 3300.0]]);
    }

    #[test]
    fn mean_and_standard_deviation_of_relative_errors() {
        let mut landings = Landings::default();
        for error in [0.01, 0.03, 0.05_f64] {
            landings.count += 1;
            landings.sum += error;
            landings.squares += error * error;
        }
        let found = landings.finish("lagged").expect("landings");
        assert!((found.mean_percent - 3.0).abs() < 1e-9, "{found:?}");
        let deviation = found.standard_deviation_percent.expect("three landings");
        assert!((deviation - 2.0).abs() < 1e-9, "{found:?}");
        assert!(Landings::default().finish("lagged").is_none());
    }
}
