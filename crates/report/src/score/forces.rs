//! Errors of the tyre forces and of their standard deviations, by frame.

use estimator::consistency::{Consistency, ConsistencyStatistics, WINDOW_STEPS};
use estimator::score::{Distribution, RelativeErrorStatistics, SquareStatistics};
use sample::{Estimate, ForceFrame, PerWheel, Wheel};
use serde_json::{Value, json};

use super::stops::{Masks, NEAR};
use super::two_way::TwoWay;
use super::{PART_PAIRS, Pair, TILE_PAIRS};

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
    /// Samples near stops and touchdowns, and the others; `None` for simple methods and after a low-pass.
    pub near: Option<NearScore>,
}

/// Tyre forces near what makes them change within a step, and elsewhere. Each wheel's samples are near the stops
/// and touchdowns of this wheel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearScore {
    /// Near a strut on its stop, or a touchdown.
    pub stops: PartScore,
    /// All others.
    pub elsewhere: PartScore,
    /// Near the instant at which the vehicle comes to a standstill, by the same samples.
    pub standstills: PartScore,
}

/// Tyre forces of a part of the samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartScore {
    /// Samples of all wheels.
    pub count: usize,
    /// 100 RMSE / max(peak of the truth in all samples, static wheel load) of F_x, F_y, F_z, largest of all wheels.
    pub worst_percent: [Option<f64>; 3],
    /// Mean of ((estimate - truth)/sigma)^2 of F_x, F_y, F_z over all wheels.
    pub nees: [Option<f64>; 3],
}

/// Tyre forces after a Butterworth low-pass of fourth order, forward and backward, which estimate and
/// truth pass alike.
#[derive(Clone, Debug, PartialEq)]
pub struct LowPassedScore {
    /// Corner of the low-pass, Hz.
    pub hz: f64,
    /// Tyre forces of each output, by frame, without standard deviations.
    pub forces: Vec<ForceScore>,
}

/// Frames in which an output is compared: of the truth, and of the estimate.
pub(super) type Frames = [[ForceFrame; 2]; 2];

/// The frames in which an output is compared: of the truth, and of the estimate. The first is the one
/// that the output is given in: the wheel-carrier frame, or the contact frame in logs of earlier
/// versions. Its estimate is compared with the truth of the other frame, too, unless it is given in
/// both.
pub(super) fn frames<'a>(estimates: impl Iterator<Item = &'a Estimate>) -> Frames {
    use ForceFrame::{Contact, WheelCarrier};
    known_frames(estimates).unwrap_or([[Contact, Contact], [WheelCarrier, Contact]])
}

/// The same; `None` where the estimates have no force.
pub(super) fn known_frames<'a>(estimates: impl Iterator<Item = &'a Estimate>) -> Option<Frames> {
    use ForceFrame::{Contact, WheelCarrier};
    let mut is_given = [false; 2];
    for estimate in estimates {
        for (given, frame) in is_given.iter_mut().zip([WheelCarrier, Contact]) {
            let forces = estimate.forces(frame).0.iter();
            *given |= forces.clone().any(|force| force.force_n[2].is_finite());
        }
    }
    match is_given {
        [true, true] => Some([[WheelCarrier, WheelCarrier], [Contact, Contact]]),
        [true, false] => Some([[WheelCarrier, WheelCarrier], [Contact, WheelCarrier]]),
        [false, true] => Some([[Contact, Contact], [WheelCarrier, Contact]]),
        [false, false] => None,
    }
}

/// Errors of an output so far, in each frame of which the truth tells the forces.
#[derive(Default)]
pub(super) struct Forces(Option<[InFrame; 2]>);

impl Forces {
    /// Takes the next instants, at most [`TILE_PAIRS`]; `frames` as [`known_frames`] gives them. `masks`: the
    /// samples near stops, if they are scored apart.
    pub fn push(&mut self, tile: &[Pair], frames: Option<&Frames>, masks: Option<&Masks>) {
        if self.0.is_none() {
            self.0 = frames.map(|frames| frames.map(InFrame::new));
        }
        for frame in self.0.iter_mut().flatten() {
            frame.push(tile, masks);
        }
    }

    /// Ends a part, of at most some thousands of instants.
    pub fn end_part(&mut self) {
        for frame in self.0.iter_mut().flatten() {
            frame.end_part();
        }
    }

    /// The scores; none where nothing was compared.
    pub fn finish(self, output: &'static str, loads: &PerWheel<f64>) -> Vec<ForceScore> {
        let frames = self.0.into_iter().flatten();
        frames
            .filter_map(|frame| frame.finish(output, loads))
            .collect()
    }
}

/// Errors in one frame: of F_x, F_y, F_z and of the moments, by wheel.
struct InFrame {
    truth: ForceFrame,
    estimate: ForceFrame,
    errors: [[RelativeErrorStatistics; 4]; 3],
    moments: [[RelativeErrorStatistics; 4]; 2],
    squares: [SquareStatistics; 3],
    distributions: [Distribution; 3],
    windows: ConsistencyStatistics,
    /// Normalised errors of the part: of F_x of the four wheels, of F_y and of F_z.
    normalised: [Vec<f64>; 12],
    /// Samples that are near something.
    near: Option<[Near; NEAR]>,
}

/// Errors of samples that are near something.
#[derive(Default)]
struct Near {
    errors: [[RelativeErrorStatistics; 4]; 3],
    squares: [SquareStatistics; 3],
}

impl InFrame {
    fn new([truth, estimate]: [ForceFrame; 2]) -> Self {
        Self {
            truth,
            estimate,
            errors: Default::default(),
            moments: Default::default(),
            squares: Default::default(),
            distributions: [(); 3].map(|()| Distribution::exact_up_to(4 * PART_PAIRS)),
            windows: ConsistencyStatistics::new(12, WINDOW_STEPS),
            normalised: Default::default(),
            near: None,
        }
    }

    /// Takes the next instants.
    fn push(&mut self, tile: &[Pair], masks: Option<&Masks>) {
        if masks.is_some() {
            self.near.get_or_insert_default();
        }
        let [mut estimates, mut truths] = [[0.0; TILE_PAIRS]; 2];
        let count = tile.len();
        for axis in 0..3 {
            for wheel in Wheel::ALL {
                let normalised = &mut self.normalised[4 * axis + wheel.index()];
                for (place, (estimate, truth)) in tile.iter().enumerate() {
                    let own = &estimate.forces(self.estimate)[wheel];
                    estimates[place] = own.force_n[axis];
                    truths[place] = truth.forces(self.truth)[wheel].force_n[axis];
                    normalised.push((estimates[place] - truths[place]) / own.sigma_n[axis]);
                }
                self.errors[axis][wheel.index()].push(&estimates[..count], &truths[..count]);
                let normalised = &normalised[normalised.len() - count..];
                let near = self.near.iter_mut().flatten();
                for (near, masks) in near.zip(masks.into_iter().flatten()) {
                    for place in places(masks[wheel.index()]) {
                        let errors = &mut near.errors[axis][wheel.index()];
                        errors.push(&[estimates[place]], &[truths[place]]);
                        near.squares[axis].push(normalised[place]);
                    }
                }
            }
        }
        for (moments, axis) in self.moments.iter_mut().zip(MOMENT_AXES) {
            for wheel in Wheel::ALL {
                for (place, (estimate, truth)) in tile.iter().enumerate() {
                    estimates[place] = estimate.forces(self.estimate)[wheel].moment_n_m[axis];
                    truths[place] = truth.forces(self.truth)[wheel].moment_n_m[axis];
                }
                moments[wheel.index()].push(&estimates[..count], &truths[..count]);
            }
        }
    }

    /// Takes the normalised errors of the part.
    fn end_part(&mut self) {
        for (signal, normalised) in self.normalised.iter().enumerate() {
            let axis = signal / 4;
            let (squares, distribution) = (&mut self.squares[axis], &mut self.distributions[axis]);
            for z in normalised.iter().filter(|z| (*z * *z).is_finite()) {
                squares.push(*z);
                distribution.push(z * z);
            }
        }
        for k in 0..self.normalised[0].len() {
            self.windows
                .push(&self.normalised.each_ref().map(|all| all[k]));
        }
        self.normalised.iter_mut().for_each(Vec::clear);
    }

    fn finish(self, output: &'static str, loads: &PerWheel<f64>) -> Option<ForceScore> {
        let worst_percent = worst_percent(&self.errors, loads);
        if worst_percent.iter().all(Option::is_none) {
            return None;
        }
        Some(ForceScore {
            output,
            frame: self.truth,
            estimate_frame: self.estimate,
            worst_percent,
            worst_moment_percent: self
                .moments
                .each_ref()
                .map(|axis| worst(axis, &PerWheel([MOMENT_FLOOR_N_M; 4]))),
            near: (self.near.as_ref())
                .map(|near| NearScore::of(&self.errors, &self.squares, near, loads)),
            nees: self.squares.map(|axis| axis.mean()),
            nees_median: self.distributions.map(|axis| axis.median()),
            windows: self.windows.finish(),
        })
    }
}

/// The places of the bits that are set.
fn places(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = (mask != 0).then(|| mask.trailing_zeros() as usize);
        mask &= mask.wrapping_sub(1);
        place
    })
}

/// The largest normalised error of all wheels.
fn worst(wheels: &[RelativeErrorStatistics; 4], floors: &PerWheel<f64>) -> Option<f64> {
    let percent = |wheel: Wheel| wheels[wheel.index()].normalised_percent(floors[wheel]);
    Wheel::ALL.into_iter().map(percent).fold(None, larger)
}

fn worst_percent(
    errors: &[[RelativeErrorStatistics; 4]; 3],
    loads: &PerWheel<f64>,
) -> [Option<f64>; 3] {
    errors.each_ref().map(|axis| worst(axis, loads))
}

impl NearScore {
    fn of(
        all: &[[RelativeErrorStatistics; 4]; 3],
        squares: &[SquareStatistics; 3],
        near: &[Near; NEAR],
        loads: &PerWheel<f64>,
    ) -> Self {
        let each = |part: &Near,
                    of: fn(
            &RelativeErrorStatistics,
            &RelativeErrorStatistics,
        ) -> RelativeErrorStatistics| {
            std::array::from_fn(|axis| {
                std::array::from_fn(|wheel| of(&all[axis][wheel], &part.errors[axis][wheel]))
            })
        };
        let part = |part: &Near| {
            PartScore::of(
                &each(part, RelativeErrorStatistics::part),
                &part.squares,
                loads,
            )
        };
        let [stops, standstills] = near;
        let others: [SquareStatistics; 3] =
            std::array::from_fn(|axis| squares[axis].without(&stops.squares[axis]));
        Self {
            stops: part(stops),
            elsewhere: PartScore::of(
                &each(stops, RelativeErrorStatistics::without),
                &others,
                loads,
            ),
            standstills: part(standstills),
        }
    }
}

impl PartScore {
    fn of(
        errors: &[[RelativeErrorStatistics; 4]; 3],
        squares: &[SquareStatistics; 3],
        loads: &PerWheel<f64>,
    ) -> Self {
        let loads_compared = errors[2].iter().map(RelativeErrorStatistics::count);
        Self {
            count: loads_compared.sum(),
            worst_percent: worst_percent(errors, loads),
            nees: squares.map(|axis| axis.mean()),
        }
    }

    fn to_json(self) -> Value {
        json!({
            "count": self.count,
            "worst_percent": self.worst_percent,
            "nees": self.nees,
        })
    }
}

/// Errors of the forces of an output after a low-pass, which estimate and truth pass alike.
pub(super) struct LowPassed {
    hz: f64,
    frames: Option<[LowPassedInFrame; 2]>,
}

/// The same in one frame: by axis and wheel.
struct LowPassedInFrame {
    truth: ForceFrame,
    estimate: ForceFrame,
    forces: [[(TwoWay, RelativeErrorStatistics); 4]; 3],
}

impl LowPassed {
    pub const fn new(hz: f64) -> Self {
        Self { hz, frames: None }
    }

    /// Takes the next part.
    pub fn push(&mut self, pairs: &[Pair], frames: Option<&Frames>) {
        if self.frames.is_none() {
            let force = || {
                (
                    TwoWay::low_pass(self.hz),
                    RelativeErrorStatistics::default(),
                )
            };
            self.frames = frames.map(|frames| {
                frames.map(|[truth, estimate]| LowPassedInFrame {
                    truth,
                    estimate,
                    forces: [(); 3].map(|()| [(); 4].map(|()| force())),
                })
            });
        }
        for frame in self.frames.iter_mut().flatten() {
            for (estimate, truth) in pairs {
                frame.push(estimate, truth);
            }
        }
    }

    /// The scores; none where nothing was compared.
    pub fn finish(self, output: &'static str, loads: &PerWheel<f64>) -> Vec<ForceScore> {
        let frames = self.frames.into_iter().flatten();
        frames
            .filter_map(|frame| frame.finish(output, loads))
            .collect()
    }
}

impl LowPassedInFrame {
    fn push(&mut self, estimate: &Estimate, truth: &Estimate) {
        for (axis, wheels) in self.forces.iter_mut().enumerate() {
            for (wheel, (filter, errors)) in Wheel::ALL.into_iter().zip(wheels) {
                let own_n = estimate.forces(self.estimate)[wheel].force_n[axis];
                let true_n = truth.forces(self.truth)[wheel].force_n[axis];
                filter.push(truth.time, [own_n, true_n, 0.0], &mut |[
                    own_n,
                    true_n,
                    _,
                ]| {
                    errors.push(&[own_n], &[true_n]);
                });
            }
        }
    }

    fn finish(self, output: &'static str, loads: &PerWheel<f64>) -> Option<ForceScore> {
        let worst_percent = self.forces.map(|wheels| {
            let percents = Wheel::ALL.into_iter().zip(wheels);
            let percents = percents.map(|(wheel, (mut filter, mut errors))| {
                filter.finish(&mut |[own_n, true_n, _]| errors.push(&[own_n], &[true_n]));
                errors.normalised_percent(loads[wheel])
            });
            percents.fold(None, larger)
        });
        let is_known = worst_percent.iter().any(Option::is_some);
        is_known.then_some(ForceScore {
            output,
            frame: self.truth,
            estimate_frame: self.estimate,
            worst_percent,
            worst_moment_percent: [None; 2],
            nees: [None; 3],
            nees_median: [None; 3],
            windows: None,
            near: None,
        })
    }
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
            "near_stops": self.near.map(|near| near.stops.to_json()),
            "elsewhere": self.near.map(|near| near.elsewhere.to_json()),
            "near_standstills": self.near.map(|near| near.standstills.to_json()),
        })
    }
}

impl LowPassedScore {
    /// As JSON, by the keys of `docs/score.md`.
    #[must_use]
    pub fn to_json(&self) -> Value {
        json!({
            "hz": self.hz,
            "forces": self.forces.iter().map(ForceScore::to_json).collect::<Vec<_>>(),
        })
    }
}
