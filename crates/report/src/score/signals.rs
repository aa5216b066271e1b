//! Errors of each signal, from parts of a log.

use estimator::consistency::{ConsistencyStatistics, WINDOW_STEPS};
use estimator::score::{DelayStatistics, ErrorStatistics, Errors, SquareStatistics};
use sample::{ForceFrame, PerWheel};

use super::{
    DELAY_MAX, INTERVAL_S, Pair, Pairs, Signal, SignalScore, TILE_PAIRS, each_plain, each_signal,
    forces,
};

/// Errors of all signals so far.
#[derive(Default)]
pub(super) struct Signals {
    all: Vec<Statistics>,
    /// The compared frames, from the first part on in which a force is known.
    frames: Option<[[ForceFrame; 2]; 2]>,
}

struct Statistics {
    /// The score without its numbers.
    score: SignalScore,
    /// Values of the part: estimates and truths.
    part: [Vec<f64>; 2],
    errors: ErrorStatistics,
    delay: DelayStatistics,
    squares: SquareStatistics,
    windows: ConsistencyStatistics,
}

impl Signals {
    /// Takes the next part.
    pub fn push(&mut self, pairs: &Pairs) {
        let estimates = pairs.iter().map(|(estimate, _)| &**estimate);
        self.frames = self.frames.or_else(|| forces::known_frames(estimates));
        let all = &mut self.all;
        for tile in pairs.chunks(TILE_PAIRS) {
            let mut place = 0;
            let add = |signal: Signal<'_>| {
                if place == all.len() {
                    all.push(Statistics::new(&signal));
                }
                all[place].push(&signal, tile);
                place += 1;
            };
            match &self.frames {
                Some(frames) => each_signal(frames, add),
                None => each_plain(add),
            }
        }
        all.iter_mut().for_each(Statistics::end_part);
    }

    /// The scores of the signals that both sides know.
    pub fn finish(self, loads: &PerWheel<f64>) -> Vec<SignalScore> {
        let all = self.all.into_iter();
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

    fn push(&mut self, signal: &Signal<'_>, tile: &[Pair]) {
        let [values, truths] = &mut self.part;
        let before = values.len();
        for (estimate, truth) in tile {
            let (value, sigma) = (signal.estimate)(estimate);
            let (truth, _) = (signal.truth)(truth);
            values.push(value);
            truths.push(truth);
            let normalised = (value - truth) / sigma;
            self.squares.push(normalised);
            self.windows.push(&[normalised]);
        }
        self.errors.push(&values[before..], &truths[before..]);
    }

    fn end_part(&mut self) {
        let [values, truths] = &mut self.part;
        self.delay.push(values, truths);
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
