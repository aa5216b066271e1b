//! Errors of the tyre forces and of their standard deviations, by frame.

use estimator::consistency::{Consistency, WINDOW_STEPS, consistency};
use estimator::score::{self, median};
use sample::{Estimate, ForceFrame, PerWheel, TyreForce, Wheel};
use serde_json::{Value, json};

use super::Pairs;

/// Least peak of a moment by which its error is divided, N m.
pub(super) const MOMENT_FLOOR_N_M: f64 = 50.0;
/// The moments that are scored: about x and z.
const MOMENT_AXES: [usize; 2] = [0, 2];

/// Tyre forces of an output of the estimator against the truth of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ForceScore {
    /// Output of the estimator (`estimate`, `lagged`, `smoothed`), or a simple method.
    pub output: &'static str,
    /// Frame of the truth.
    pub frame: ForceFrame,
    /// Frame of the estimate.
    pub estimate_frame: ForceFrame,
    /// 100 RMSE / max(peak of the truth, static wheel load) of F_x, F_y, F_z, largest of all wheels.
    pub worst_percent: [Option<f64>; 3],
    /// 100 RMSE / max(peak of the truth, 50 N m) of M_x and M_z, largest of all wheels.
    pub worst_moment_percent: [Option<f64>; 2],
    /// Mean of ((estimate - truth)/sigma)^2 of F_x, F_y, F_z over all wheels.
    pub nees: [Option<f64>; 3],
    /// Median of the same.
    pub nees_median: [Option<f64>; 3],
    /// Windows of all twelve forces together.
    pub windows: Option<Consistency>,
}

/// The frames in which an output is compared: of the truth, and of the estimate. The first is the one
/// that the output is given in: the wheel-carrier frame, or the contact frame in logs of earlier
/// versions. Its estimate is compared with the truth of the other frame, too, unless it is given in
/// both.
pub(super) fn frames<'a>(estimates: impl Iterator<Item = &'a Estimate>) -> [[ForceFrame; 2]; 2] {
    use ForceFrame::{Contact, WheelCarrier};
    let mut is_given = [false; 2];
    for estimate in estimates {
        for (given, frame) in is_given.iter_mut().zip([WheelCarrier, Contact]) {
            let forces = estimate.forces(frame).0.iter();
            *given |= forces.clone().any(|force| force.force_n[2].is_finite());
        }
    }
    match is_given {
        [true, true] => [[WheelCarrier, WheelCarrier], [Contact, Contact]],
        [true, false] => [[WheelCarrier, WheelCarrier], [Contact, WheelCarrier]],
        _ => [[Contact, Contact], [WheelCarrier, Contact]],
    }
}

/// Scores an output in each frame of which the truth tells the forces.
pub(super) fn find(pairs: &Pairs, output: &'static str, loads: &PerWheel<f64>) -> Vec<ForceScore> {
    let frames = frames(pairs.iter().map(|(estimate, _)| estimate));
    frames
        .into_iter()
        .filter_map(|[truth, estimate]| in_frame(pairs, output, loads, truth, estimate))
        .collect()
}

fn in_frame(
    pairs: &Pairs,
    output: &'static str,
    loads: &PerWheel<f64>,
    frame: ForceFrame,
    estimate_frame: ForceFrame,
) -> Option<ForceScore> {
    // A value of all instants: of the estimate, and of the truth.
    let series = |wheel: Wheel, pick: &dyn Fn(&TyreForce) -> f64| -> [Vec<f64>; 2] {
        let both = pairs.iter().map(|(estimate, truth)| {
            let own = pick(&estimate.forces(estimate_frame)[wheel]);
            (own, pick(&truth.forces(frame)[wheel]))
        });
        let (estimates, truths) = both.unzip();
        [estimates, truths]
    };
    let mut normalised = Vec::new();
    let (mut worst_percent, mut nees, mut nees_median) = ([None; 3], [None; 3], [None; 3]);
    for axis in 0..3 {
        let mut squares = Vec::new();
        for wheel in Wheel::ALL {
            let [estimates, truths] = series(wheel, &|force| force.force_n[axis]);
            let [sigmas, _] = series(wheel, &|force| force.sigma_n[axis]);
            let percent = score::normalised_error_percent(&estimates, &truths, loads[wheel]);
            worst_percent[axis] = larger(worst_percent[axis], percent);
            let errors = estimates.iter().zip(&truths).zip(&sigmas);
            let z: Vec<f64> = errors.map(|((e, t), s)| (e - t) / s).collect();
            squares.extend(z.iter().map(|z| z * z).filter(|square| square.is_finite()));
            normalised.push(z);
        }
        if !squares.is_empty() {
            nees[axis] = Some(squares.iter().sum::<f64>() / squares.len() as f64);
            nees_median[axis] = median(&mut squares);
        }
    }
    if worst_percent.iter().all(Option::is_none) {
        return None;
    }
    let worst_moment_percent = MOMENT_AXES.map(|axis| {
        let of_wheel = |wheel| {
            let [estimates, truths] = series(wheel, &|force| force.moment_n_m[axis]);
            score::normalised_error_percent(&estimates, &truths, MOMENT_FLOOR_N_M)
        };
        Wheel::ALL.into_iter().map(of_wheel).fold(None, larger)
    });
    Some(ForceScore {
        output,
        frame,
        estimate_frame,
        worst_percent,
        worst_moment_percent,
        nees,
        nees_median,
        windows: consistency(&normalised, WINDOW_STEPS),
    })
}

fn larger(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.max(b)),
        (one, other) => one.or(other),
    }
}

impl ForceScore {
    /// As JSON, by the keys of `docs/score.md`.
    #[must_use]
    pub fn to_json(&self) -> Value {
        json!({
            "output": self.output,
            "frame": self.frame.name(),
            "estimate_frame": self.estimate_frame.name(),
            "worst_percent": self.worst_percent,
            "worst_moment_percent": self.worst_moment_percent,
            "nees": self.nees,
            "nees_median": self.nees_median,
            "windows": self.windows.as_ref().map(super::consistency_json),
        })
    }
}
