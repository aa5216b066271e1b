//! Errors of the slip angles.

use sample::Wheel;

use super::judge::{Result, rms, row};
use super::run::Run;

/// RMSE of each wheel's slip angle, degrees, above 3 m/s, after the first 3 s, while it carries load.
pub fn slip_errors(run: &Run, result: &Result) -> [f64; 4] {
    Wheel::ALL.map(|wheel| {
        let name = wheel.abbreviation();
        let (truth, load) = (
            run.column(&format!("{name}_alpha")),
            run.column(&format!("{name}_Fz")),
        );
        let speed = run.column("vx_body");
        rms(result.estimates.iter().filter_map(|estimate| {
            let row = row(estimate);
            let told = row > 600 && *speed.get(row)? > 3.0 && load[row] > 100.0;
            told.then(|| (estimate.motion.slip_angle_rad[wheel] - truth[row]).to_degrees())
        }))
    })
}
