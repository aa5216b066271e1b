//! Latencies of messages that are not known: what they do to the state, and what the drive says of them.
//!
//! A reading whose message has the latency error tau shows the signal of tau earlier than its time says:
//! y = h x + d tau + v, with d = -dy/dt. The filter by itself knows nothing of tau. Its state and its innovations
//! then depend on the tau of all messages (B. Friedland, "Treatment of bias in recursive filtering", IEEE Trans.
//! Automatic Control 14 (1969) 359-367, eqs. 30 to 37, with a dynamic part that the bias does not enter):
//!
//! | equation | what |
//! |---|---|
//! | V ← F V | effect of the latencies on the state, over a step |
//! | s = h V + d | effect on an innovation |
//! | V ← V - K s | after the reading, with the filter's gain K |
//! | tau ← tau + M s' (y - s tau)/(S/w + s M s') | latencies by the innovation y of variance S |
//! | x ← x + V tau, tau ← 0 | after each step: the stamps of the next readings are shifted by tau |
//! | P + V M V' | covariance with the latencies |
//!
//! M is the covariance of the latencies: all of them together, so that a part that all readings have in common
//! keeps its prior. Differences from the source: the innovations count with the weight w, because the errors of
//! the model are not white; the variance of a reading contains d² (M_ii + jitter²), so that gates and weights
//! know of latencies that are not found yet; M has a random walk.

use super::covariance::Covariance;
use super::forms::{MeasuredForm, measured_states};
use super::joint::{Joint, RowsView, TOGETHER};
use super::layout::{BEFORE, FORCE, LENGTH, RATE, SIZE, SPEED, State};
use super::transition::Transition;
use super::{Fusion, StepInput, StepModel};
use crate::trace::Operation;
use crate::tuning::LatencyTuning;

/// Rate at which a reading changes with its age.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ageing {
    /// Message of the reading.
    stream: usize,
    /// Change of the reading for 1 s more of age, in its unit.
    per_s: f64,
}

/// Of each row.
pub(super) type AgeingRows = [Option<Ageing>; TOGETHER];

/// Messages whose latencies are not known.
#[derive(Clone, Debug, Default)]
pub(super) struct Latencies {
    tuning: LatencyTuning,
    streams: Vec<Stream>,
    /// Covariance of the latencies, s², row by row.
    covariance: Vec<f64>,
}

#[derive(Clone, Debug)]
struct Stream {
    prior_sigma_s: f64,
    /// What was learnt beyond the configured latency, s.
    learnt_s: f64,
    /// What the readings of this step add, s.
    news_s: f64,
    /// Effect of 1 s of latency on the state.
    effect: Box<State>,
}

impl Latencies {
    /// With the standard deviation of each message's latency, s.
    pub(super) fn new(sigmas_s: &[f64], tuning: LatencyTuning) -> Self {
        let count = sigmas_s.len();
        let mut covariance = vec![0.0; count * count];
        for (i, sigma_s) in sigmas_s.iter().enumerate() {
            covariance[i * count + i] = sigma_s * sigma_s;
        }
        let stream = |sigma_s: &f64| Stream {
            prior_sigma_s: *sigma_s,
            learnt_s: 0.0,
            news_s: 0.0,
            effect: Box::new([0.0; SIZE]),
        };
        Self {
            tuning,
            streams: sigmas_s.iter().map(stream).collect(),
            covariance,
        }
    }

    /// What was learnt of a message's latency beyond the configured one, and its standard deviation, s.
    pub(super) fn of(&self, stream: usize) -> Option<(f64, f64)> {
        let known = self.streams.get(stream)?;
        let variance = self.covariance[stream * self.streams.len() + stream];
        Some((known.learnt_s, variance.max(0.0).sqrt()))
    }

    /// Variance of a reading by the latency of its message.
    pub(super) fn variance(&self, ageing: Option<Ageing>) -> f64 {
        let Some(Ageing { stream, per_s }) = ageing else {
            return 0.0;
        };
        let variance_s2 = self.covariance[stream * self.streams.len() + stream];
        per_s * per_s * (variance_s2 + self.tuning.jitter_s * self.tuning.jitter_s)
    }

    /// Variance of a state by all latencies.
    pub(super) fn state_variance(&self, index: usize) -> f64 {
        let count = self.streams.len();
        let mut sum = 0.0;
        for (i, one) in self.streams.iter().enumerate() {
            for (j, other) in self.streams.iter().enumerate() {
                sum += one.effect[index] * self.covariance[i * count + j] * other.effect[index];
            }
        }
        sum.max(0.0)
    }

    /// The filter starts again: its state does not depend on the latencies.
    pub(super) fn forget_effects(&mut self) {
        for stream in &mut self.streams {
            *stream.effect = [0.0; SIZE];
            stream.news_s = 0.0;
        }
    }

    /// A state becomes independent of all others.
    pub(super) fn forget_effect(&mut self, index: usize) {
        for stream in &mut self.streams {
            stream.effect[index] = 0.0;
        }
    }

    /// Effects and covariance over a step.
    pub(super) fn propagate(&mut self, transition: &Transition, dt: f64) {
        let count = self.streams.len();
        let walk_s2 = self.tuning.walk_s_sqrt_s * self.tuning.walk_s_sqrt_s * dt;
        for (i, stream) in self.streams.iter_mut().enumerate() {
            *stream.effect = transition.apply(&stream.effect);
            let variance = &mut self.covariance[i * count + i];
            if *variance < stream.prior_sigma_s * stream.prior_sigma_s {
                *variance += walk_s2;
            }
        }
    }

    /// Takes the rows that the filter has taken, with their gains.
    pub(super) fn take(
        &mut self,
        rows: &RowsView<'_>,
        joint: &Joint,
        covariance: &Covariance,
        ageing: &AgeingRows,
    ) {
        let count = self.streams.len();
        if count == 0 {
            return;
        }
        let mut moved: Vec<[f64; TOGETHER]> = self
            .streams
            .iter()
            .map(|stream| rows.times(&stream.effect[..]))
            .collect();
        let mut effects = vec![0.0; count];
        for (m, taken) in joint.taken[..rows.count].iter().enumerate() {
            let Some(taken) = taken else { continue };
            for (i, effect) in effects.iter_mut().enumerate() {
                *effect = moved[i][m];
            }
            if let Some(Ageing { stream, per_s }) = ageing[m] {
                effects[stream] += per_s;
            }
            if !effects.iter().all(|effect| effect.is_finite()) {
                continue;
            }
            let own = 1.0 - joint.between[m][m] / taken.total;
            let part = math::powf(own.max(0.0), self.tuning.own_power);
            self.learn(&effects, taken.innovation, taken.total / part.max(1e-6));
            let column = covariance.projected(m);
            for (i, stream) in self.streams.iter_mut().enumerate() {
                let gain = effects[i] / taken.total;
                for (x, p) in stream.effect.iter_mut().zip(column) {
                    *x -= gain * p;
                }
                for (k, later) in moved[i].iter_mut().enumerate().skip(m + 1) {
                    *later -= gain * joint.between[m][k];
                }
            }
        }
    }

    /// Latencies by one innovation of variance `total`.
    fn learn(&mut self, effects: &[f64], innovation: f64, total: f64) {
        let count = self.streams.len();
        let of: Vec<f64> = (0..count)
            .map(|i| {
                let row = &self.covariance[i * count..(i + 1) * count];
                row.iter().zip(effects).map(|(m, s)| m * s).sum()
            })
            .collect();
        let by_latency: f64 = of.iter().zip(effects).map(|(m, s)| m * s).sum();
        let expected: f64 = (self.streams.iter().zip(effects))
            .map(|(stream, s)| stream.news_s * s)
            .sum();
        let variance = total / self.tuning.independent + by_latency;
        for i in 0..count {
            self.streams[i].news_s += of[i] / variance * (innovation - expected);
            for j in 0..count {
                self.covariance[i * count + j] -= of[i] * of[j] / variance;
            }
        }
    }

    /// What was learnt in this step shifts the stamps from now on: the state becomes that of the shifted stamps.
    fn fold(&mut self, state: &mut State, trace: &mut crate::trace::Trace<SIZE>) {
        for stream in &mut self.streams {
            let news_s = std::mem::take(&mut stream.news_s);
            let most_s = self.tuning.bound_sigma * stream.prior_sigma_s;
            let before_s = stream.learnt_s;
            stream.learnt_s = (before_s + news_s).clamp(-most_s, most_s);
            let by_s = stream.learnt_s - before_s;
            for (index, (x, effect)) in state.iter_mut().zip(stream.effect.iter()).enumerate() {
                let by = effect * by_s;
                if by != 0.0 {
                    *x += by;
                    trace.note(|| Operation::Shift { index, by });
                }
            }
        }
    }
}

impl MeasuredForm {
    /// Value in a state, without the row's own state.
    pub(super) fn value(&self, wheel: usize, state: &State) -> f64 {
        let terms = measured_states(wheel).into_iter().zip(self.gains);
        terms.map(|(i, gain)| gain * state[i]).sum::<f64>() + self.constant
    }
}

impl Fusion {
    /// Messages whose latencies are not known, with their standard deviations, s.
    pub(crate) fn learn_latencies(&mut self, sigmas_s: &[f64], tuning: LatencyTuning) {
        self.latencies = Latencies::new(sigmas_s, tuning);
    }

    /// What was learnt of a message's latency beyond the configured one, and its standard deviation, s.
    pub(crate) fn latency(&self, stream: usize) -> Option<(f64, f64)> {
        self.latencies.of(stream)
    }

    /// How a reading of a message changes with its age. `value` is the predicted reading at an age that is larger by
    /// its argument, s.
    pub(super) fn ageing(&self, stream: Option<u8>, value: impl Fn(f64) -> f64) -> Option<Ageing> {
        let stream = usize::from(stream?);
        self.latencies.streams.get(stream)?;
        // A central difference over a millisecond.
        let over_s = 1e-3;
        let per_s = (value(0.5 * over_s) - value(-0.5 * over_s)) / over_s;
        Some(Ageing { stream, per_s })
    }

    /// How the readings of the inertial unit change with their age: accelerometers times the mass, N/s, and gyros,
    /// rad/s², each in the order of the axes.
    pub(super) fn inertial_ageing(
        &self,
        input: &StepInput<'_>,
        model: &StepModel,
    ) -> [[Option<Ageing>; 3]; 2] {
        let known = input.imu_stream.map(usize::from);
        let Some(stream) = known.filter(|at| *at < self.latencies.streams.len()) else {
            return [[None; 3]; 2];
        };
        let of = |per_s: f64| Some(Ageing { stream, per_s });
        let state = &self.state;
        let mut rate = [0.0; super::layout::BALANCED];
        for (k, rate) in rate[FORCE..RATE].iter_mut().enumerate() {
            *rate = (state[FORCE + k] - state[BEFORE + k]) / input.dt;
        }
        for wheel in 0..4 {
            rate[SPEED + wheel] = 1e3 * model.forms[wheel].acceleration_m_s2(wheel, state);
            rate[LENGTH + wheel] = state[SPEED + wheel];
        }
        let force = std::array::from_fn(|axis| {
            let gains = self.accelerometer(input, &model.balance, axis).gains;
            of(-gains
                .iter()
                .zip(rate)
                .map(|(gain, rate)| gain * rate)
                .sum::<f64>())
        });
        let turn = std::array::from_fn(|axis| of(-model.balance.turn[axis].value(state)));
        [force, turn]
    }

    /// Ends the step: the stamps of the next readings are shifted by what was learnt.
    pub(super) fn fold_latencies(&mut self) {
        self.latencies
            .fold(&mut self.state, &mut self.covariance.trace);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::super::joint::Rows;
    use super::*;

    /// States and latencies.
    const ALL: usize = SIZE + 2;
    const GAINS: [[f64; 2]; 3] = [[1.0, -0.1], [0.5, 0.2], [-2.0, 0.3]];
    /// Change of each reading with its age, and its message.
    const AGEING: [Option<(usize, f64)>; 3] = [Some((0, 900.0)), Some((1, -400.0)), None];
    const NOISE: f64 = 0.5;

    fn transition() -> Transition {
        let mut transition = Transition::new();
        transition.mix(FORCE, [(FORCE, 1.0), (RATE, 0.5)]);
        transition.keep[RATE + 5] = 0.9;
        transition
    }

    /// One filter of states and latencies together.
    struct Together {
        state: DVector<f64>,
        covariance: DMatrix<f64>,
    }

    impl Together {
        fn propagate(&mut self) {
            let mut f = DMatrix::identity(ALL, ALL);
            for term in transition().change() {
                f[(term.row, term.column)] += term.value;
            }
            self.state = &f * &self.state;
            self.covariance = &f * &self.covariance * f.transpose();
        }

        fn take(&mut self, m: usize, measured: f64) {
            let mut h = DVector::zeros(ALL);
            h[FORCE] += GAINS[m][0];
            h[RATE] += GAINS[m][1];
            h[SIZE - 3 + m] += 1.0;
            if let Some((stream, per_s)) = AGEING[m] {
                h[SIZE + stream] = per_s;
            }
            let ph = &self.covariance * &h;
            let total = h.dot(&ph) + NOISE;
            let innovation = measured - h.dot(&self.state);
            self.state += &ph * (innovation / total);
            self.covariance -= &ph * ph.transpose() / total;
        }
    }

    /// The filter with the latencies beside it gives what one filter of both gives.
    #[test]
    fn two_stages_are_one_filter() {
        let sigmas_s = [1.4e-3, 0.7e-3];
        let tuning = LatencyTuning {
            independent: 1.0,
            own_power: 0.0,
            walk_s_sqrt_s: 0.0,
            bound_sigma: 1e3,
            ..LatencyTuning::default()
        };
        let mut latencies = Latencies::new(&sigmas_s, tuning);
        let mut covariance = Covariance::default();
        let mut state = [1.0; SIZE];
        covariance.reset(&[4.0; SIZE], &state);
        let mut variance = vec![4.0; SIZE];
        variance.extend(sigmas_s.map(|sigma_s| sigma_s * sigma_s));
        let mut together = Together {
            state: DVector::from_fn(ALL, |i, _| if i < SIZE { 1.0 } else { 0.0 }),
            covariance: DMatrix::from_diagonal(&DVector::from_vec(variance)),
        };
        let mut rows = Rows::new([FORCE, RATE]);
        for (m, gains) in GAINS.into_iter().enumerate() {
            rows.set(m, gains, (SIZE - 3 + m, 1.0));
        }
        let mut ageing = [None; TOGETHER];
        for (to, from) in ageing.iter_mut().zip(AGEING) {
            *to = from.map(|(stream, per_s)| Ageing { stream, per_s });
        }
        // The readings of a later step are earlier by what was learnt, which the single filter does not shift.
        let mut learnt = [0.0; 2];
        for step in 0..5 {
            state = transition().apply(&state);
            covariance.propagate(&transition());
            latencies.propagate(&transition(), 0.01);
            together.propagate();
            let mut joint = covariance.project(&rows, &state);
            for m in 0..3 {
                let measured = [3.0, -1.0, 2.0][m] + f64::from(step);
                let shift = AGEING[m].map_or(0.0, |(stream, per_s)| per_s * learnt[stream]);
                joint.take(m, measured - shift, joint.variance(m) + NOISE);
                together.take(m, measured);
            }
            covariance.apply(&rows, &joint, &mut state);
            latencies.take(&rows.view(), &joint, &covariance, &ageing);
            latencies.fold(&mut state, &mut covariance.trace);
            learnt = [0, 1].map(|stream| latencies.of(stream).unwrap().0);
        }
        for stream in 0..2 {
            let (learnt_s, sigma_s) = latencies.of(stream).unwrap();
            let variance_s2 = together.covariance[(SIZE + stream, SIZE + stream)];
            let expected_s = together.state[SIZE + stream];
            assert!(
                (learnt_s - expected_s).abs() < 1e-9,
                "{learnt_s} {expected_s}"
            );
            assert!(learnt_s.abs() > 1e-6, "{learnt_s}");
            assert!((sigma_s / variance_s2.sqrt() - 1.0).abs() < 1e-9);
        }
        for i in 0..SIZE {
            assert!((state[i] - together.state[i]).abs() < 1e-9, "{i}");
            let variance = covariance.variance(i) + latencies.state_variance(i);
            let expected = together.covariance[(i, i)];
            assert!((variance - expected).abs() < 1e-9 * expected, "{i}");
        }
    }
}
