//! Whether the deviations of the forces hold on a run.

use atvrec_estimator::consistency::{Consistency, WINDOW_STEPS, consistency};
use sample::Wheel;

use super::judge::{Result, row};
use super::run::Run;

/// Whether the deviations of all forces hold, after the first 3 s.
pub struct Squares {
    /// Mean squares of the normalised errors of F_x, F_y, F_z.
    pub axes: [f64; 3],
    /// All twelve forces, window by window.
    pub all: Consistency,
    /// Mean of z^2/2 + ln sigma of F_x, F_y, F_z: the less, the better.
    pub surprise: [f64; 3],
}

pub fn deviations(run: &Run, result: &Result) -> Squares {
    let mut signals = Vec::new();
    let mut axes = [0.0; 3];
    let mut surprise = [0.0; 3];
    for axis in 0..3 {
        for wheel in Wheel::ALL {
            let name = ["Fx", "Fy", "Fz"][axis];
            let truth = run.column(&format!("{}_{name}", wheel.abbreviation()));
            let mut series = Vec::new();
            let mut logs = 0.0;
            for estimate in &result.estimates {
                let row = row(estimate);
                if row > 600 && row < truth.len() {
                    let force = &estimate.measured[wheel];
                    let sigma = force.sigma_n[axis];
                    series.push((force.force_n[axis] - truth[row]) / sigma);
                    logs += math::ln(sigma);
                }
            }
            let count = series.len() as f64;
            let square = series.iter().map(|z| z * z).sum::<f64>() / count;
            axes[axis] += square / 4.0;
            surprise[axis] += (0.5 * square + logs / count) / 4.0;
            signals.push(series);
        }
    }
    Squares {
        axes,
        all: consistency(&signals, WINDOW_STEPS).unwrap(),
        surprise,
    }
}
