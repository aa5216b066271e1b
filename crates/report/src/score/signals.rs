//! Errors of each signal, from parts of a log.

use estimator::consistency::{ConsistencyStatistics, WINDOW_STEPS};
use estimator::score::{DelayStatistics, ErrorStatistics, Errors, SquareStatistics};
use sample::{ForceFrame, PerWheel};

use super::{DELAY_MAX, INTERVAL_S, Pairs, Signal, SignalScore, each_plain, each_signal, forces};

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
    errors: ErrorStatistics,
    delay: DelayStatistics,
    squares: SquareStatistics,
    windows: ConsistencyStatistics,
}

impl Signals {
    /// Takes the next part.
    pub fn push(&mut self, pairs: &Pairs) {
        let estimates = pairs.iter().map(|(estimate, _)| estimate);
        self.frames = self.frames.or_else(|| forces::known_frames(estimates));
        let all = &mut self.all;
        let mut place = 0;
        let add = |signal: Signal<'_>| {
            if place == all.len() {
                all.push(Statistics::new(&signal));
            }
            all[place].push(&signal, pairs);
            place += 1;
        };
        match &self.frames {
            Some(frames) => each_signal(frames, add),
            None => each_plain(add),
        }
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
            errors: ErrorStatistics::default(),
            delay: DelayStatistics::new(DELAY_MAX),
            squares: SquareStatistics::default(),
            windows: ConsistencyStatistics::new(1, WINDOW_STEPS),
        }
    }

    fn push(&mut self, signal: &Signal<'_>, pairs: &Pairs) {
        let of_estimate = pairs.iter().map(|(e, _)| (signal.estimate)(e));
        let (values, sigmas): (Vec<f64>, Vec<f64>) = of_estimate.unzip();
        let truths: Vec<f64> = pairs.iter().map(|(_, t)| (signal.truth)(t).0).collect();
        self.errors.push(&values, &truths);
        self.delay.push(&values, &truths);
        for ((value, truth), sigma) in values.iter().zip(&truths).zip(&sigmas) {
            let normalised = (value - truth) / sigma;
            self.squares.push(normalised);
            self.windows.push(&[normalised]);
        }
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
