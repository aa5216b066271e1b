//! Errors of each signal, from parts of a log.

use estimator::consistency::{ConsistencyStatistics, WINDOW_STEPS};
use estimator::score::{DelayStatistics, ErrorStatistics, Errors, SquareStatistics};
use sample::{Estimate, PerWheel};

use super::forces::{self, Frames};
use super::{
    DELAY_MAX, INTERVAL_S, Pair, Signal, SignalScore, TILE_PAIRS, each_plain, each_signal,
};

/// Errors of all signals so far.
#[derive(Default)]
pub(super) struct Signals(Vec<Statistics>);

struct Statistics {
    /// The score without its numbers.
    score: SignalScore,
    /// Of the part: estimates, truths, and the finite errors divided by their standard deviations.
    part: [Vec<f64>; 3],
    errors: ErrorStatistics,
    delay: DelayStatistics,
    squares: SquareStatistics,
    windows: ConsistencyStatistics,
}

impl Signals {
    /// Takes the next instants; `frames` as [`forces::known_frames`] gives them.
    pub fn push(&mut self, tile: &[Pair], frames: Option<&Frames>) {
        let all = &mut self.0;
        let estimates: Vec<&Estimate> = tile.iter().map(|(estimate, _)| &**estimate).collect();
        let truths: Vec<&Estimate> = tile.iter().map(|(_, truth)| &***truth).collect();
        let mut found = [[[0.0; TILE_PAIRS]; 2]; 2];
        let mut place = 0;
        let add = |signal: Signal<'_>| {
            if place == all.len() {
                all.push(Statistics::new(&signal));
            }
            let [own, of_truth] = &mut found;
            signal.estimate.of_each(&estimates, own);
            signal.truth.of_each(&truths, of_truth);
            all[place].push(tile.len(), &found);
            place += 1;
        };
        match frames {
            Some(frames) => each_signal(frames, add),
            None => each_plain(add),
        }
    }

    /// Ends a part, of at most some minutes.
    pub fn end_part(&mut self) {
        self.0.iter_mut().for_each(Statistics::end_part);
    }

    /// The scores of the signals that both sides know.
    pub fn finish(self, loads: &PerWheel<f64>) -> Vec<SignalScore> {
        let all = self.0.into_iter();
        all.filter_map(|signal| signal.finish(loads)).collect()
    }
}

impl Statistics {
    fn new(signal: &Signal<'_>) -> Self {
        Self {
            score: SignalScore {
                signal: signal.name,
                wheel: signal.wheel,
                unit: signal.unit,
                frame: signal.frame,
                errors: Errors::default(),
                normalised_percent: None,
                delay_s: None,
                nees: None,
                nees_inside: None,
            },
            part: Default::default(),
            errors: ErrorStatistics::default(),
            delay: DelayStatistics::new(DELAY_MAX),
            squares: SquareStatistics::default(),
            windows: ConsistencyStatistics::new(1, WINDOW_STEPS),
        }
    }

    /// Takes the first `count` values of estimate and truth, each with standard deviations.
    fn push(&mut self, count: usize, found: &[[[f64; TILE_PAIRS]; 2]; 2]) {
        let [[own, sigmas], [of_truth, _]] = found;
        let [values, truths, normalised] = &mut self.part;
        values.extend_from_slice(&own[..count]);
        truths.extend_from_slice(&of_truth[..count]);
        // Most signals have no standard deviation.
        let errors = own.iter().zip(of_truth).zip(sigmas).take(count);
        let errors = errors.map(|((own, truth), sigma)| (own - truth) / sigma);
        normalised.extend(errors.filter(|z| z.is_finite()));
    }

    fn end_part(&mut self) {
        let [values, truths, normalised] = &mut self.part;
        self.errors.push(values, truths);
        self.delay.push(values, truths);
        for z in normalised.drain(..) {
            self.squares.push(z);
            self.windows.push(&[z]);
        }
        values.clear();
        truths.clear();
    }

    fn finish(self, loads: &PerWheel<f64>) -> Option<SignalScore> {
        let floor = match (self.score.unit, self.score.wheel) {
            ("N", Some(wheel)) => Some(loads[wheel]),
            ("N m", _) => Some(forces::MOMENT_FLOOR_N_M),
            _ => None,
        };
        Some(SignalScore {
            errors: self.errors.errors()?,
            normalised_percent: floor.and_then(|floor| self.errors.normalised_percent(floor)),
            delay_s: self.delay.delay().map(|delay| delay * INTERVAL_S),
            nees: self.squares.mean(),
            nees_inside: self.windows.finish().map(|found| found.inside),
            ..self.score
        })
    }
}
