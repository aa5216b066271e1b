//! Filters forward and backward, in constant memory.

use estimator::road::Section;
use sample::LogTime;

use super::INTERVAL_S;

/// Shortest part without a gap that is filtered, s.
const PART_MIN_S: f64 = 4.0;
/// Instants that are filtered backward together, and those after them, in which the backward filter
/// settles: 20 s, after which 10^-19 of the state of a filter of second order at 0.5 Hz is left.
const BACKWARD: [usize; 2] = [8192, 2048];

/// Passes pairs of values through the same sections forward and backward. Each part without a gap begins
/// and ends as if its first and its last value had been there for ever.
pub(super) struct TwoWay {
    sections: Vec<Section>,
    /// Gain of constant values: 0 of a high-pass, 1 of a low-pass.
    constant_gain: f64,
    before: Option<LogTime>,
    /// Values of the part so far.
    length: usize,
    /// First values of the part.
    first: [f64; 2],
    /// Memories of the forward filters.
    memory: Vec<[[f64; 2]; 2]>,
    /// Values after the forward filter, with a value that is not filtered.
    forward: Vec<[f64; 3]>,
}

impl TwoWay {
    /// A Butterworth high-pass of second order, and the same again backward.
    pub fn high_pass(hz: f64) -> Self {
        Self::new(vec![Section::new(hz * INTERVAL_S, true)], 0.0)
    }

    /// A Butterworth low-pass of fourth order, and the same again backward.
    pub fn low_pass(hz: f64) -> Self {
        // Twice the damping ratios of the two pairs of poles.
        let dampings = [1.0, 3.0].map(|k| 2.0 * math::sin(k * std::f64::consts::PI / 8.0));
        let section = |damping| Section::with_damping(hz * INTERVAL_S, false, damping);
        Self::new(dampings.map(section).into(), 1.0)
    }

    fn new(sections: Vec<Section>, constant_gain: f64) -> Self {
        Self {
            memory: vec![Default::default(); sections.len()],
            sections,
            constant_gain,
            before: None,
            length: 0,
            first: [0.0; 2],
            forward: Vec::new(),
        }
    }

    /// Takes two values of the next instant and one that is not filtered. Calls `add` with those that are
    /// done. An instant with a value that is not finite is a gap.
    pub fn push(&mut self, time: LogTime, values: [f64; 3], add: &mut impl FnMut([f64; 3])) {
        if !values.iter().all(|value| value.is_finite()) {
            return;
        }
        let gap_s = self.before.map(|before| time.seconds_since(before));
        if gap_s.is_some_and(|gap_s| gap_s > 1.5 * INTERVAL_S) {
            self.finish(add);
        }
        self.before = Some(time);
        let [a, b, kept] = values;
        if self.length == 0 {
            self.first = [a, b];
            self.memory.fill(Default::default());
        }
        self.length += 1;
        let [a, b] = pass(
            &self.sections,
            &mut self.memory,
            [a, b],
            self.first,
            self.constant_gain,
        );
        self.forward.push([a, b, kept]);
        if self.forward.len() == BACKWARD[0] + BACKWARD[1] {
            self.filter_backward(BACKWARD[0], add);
        }
    }

    /// Ends a part.
    pub fn finish(&mut self, add: &mut impl FnMut([f64; 3])) {
        if self.length as f64 * INTERVAL_S >= PART_MIN_S {
            self.filter_backward(self.forward.len(), add);
        }
        self.forward.clear();
        self.length = 0;
    }

    /// Filters all values backward, and takes the first `done` of them.
    fn filter_backward(&mut self, done: usize, add: &mut impl FnMut([f64; 3])) {
        let last = self.forward.last().copied().unwrap_or_default();
        let mut memory = vec![Default::default(); self.sections.len()];
        let mut found = Vec::with_capacity(self.forward.len());
        for [a, b, kept] in self.forward.iter().rev() {
            let [a, b] = pass(
                &self.sections,
                &mut memory,
                [*a, *b],
                [last[0], last[1]],
                self.constant_gain,
            );
            found.push([a, b, *kept]);
        }
        for values in found.into_iter().rev().take(done) {
            add(values);
        }
        self.forward.drain(..done);
    }
}

/// Passes two values, which were `rest` before the start, through the sections.
fn pass(
    sections: &[Section],
    memory: &mut [[[f64; 2]; 2]],
    values: [f64; 2],
    rest: [f64; 2],
    constant_gain: f64,
) -> [f64; 2] {
    let mut out = [values[0] - rest[0], values[1] - rest[1]];
    for (section, memory) in sections.iter().zip(memory) {
        for (value, memory) in out.iter_mut().zip(memory) {
            *value = section.push(memory, *value);
        }
    }
    [
        out[0] + constant_gain * rest[0],
        out[1] + constant_gain * rest[1],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Amplitude of a sine in the middle of 200 s after the filter.
    fn gain(mut filter: TwoWay, hz: f64) -> f64 {
        let mut found = Vec::new();
        let mut time = LogTime(1_000_000_000);
        for k in 0..20_000 {
            let value = math::sin(std::f64::consts::TAU * hz * f64::from(k) * INTERVAL_S);
            filter.push(time, [value, 0.0, 0.0], &mut |values| found.push(values[0]));
            time = time.offset_seconds(INTERVAL_S);
        }
        filter.finish(&mut |values| found.push(values[0]));
        assert_eq!(found.len(), 20_000);
        let middle = &found[5_000..15_000];
        let square: f64 = middle.iter().map(|value| value * value).sum();
        (2.0 * square / middle.len() as f64).sqrt()
    }

    /// |H|^2 of Butterworth filters after the bilinear transform.
    #[test]
    fn gains_are_those_of_butterworth_filters_forward_and_backward() {
        let ratio = |hz: f64, corner: f64| {
            math::tan(std::f64::consts::PI * hz * INTERVAL_S)
                / math::tan(std::f64::consts::PI * corner * INTERVAL_S)
        };
        for hz in [5.0, 15.0, 20.0, 25.0_f64] {
            let expected = 1.0 / (1.0 + ratio(hz, 20.0).powi(8));
            let found = gain(TwoWay::low_pass(20.0), hz);
            assert!((found - expected).abs() < 1e-3, "{hz} {found} {expected}");
        }
        for hz in [0.25, 0.5, 1.0_f64] {
            let expected = 1.0 / (1.0 + ratio(hz, 0.5).powi(-4));
            let found = gain(TwoWay::high_pass(0.5), hz);
            assert!((found - expected).abs() < 1e-3, "{hz} {found} {expected}");
        }
    }

    #[test]
    fn a_constant_passes_a_low_pass_unchanged_over_a_gap() {
        let mut filter = TwoWay::low_pass(20.0);
        let mut found = Vec::new();
        let start = LogTime(1_000_000_000);
        for k in 0..2000 {
            if !(900..910).contains(&k) {
                let time = start.offset_seconds(f64::from(k) * INTERVAL_S);
                filter.push(time, [3.0, -2.0, 1.0], &mut |values| found.push(values));
            }
        }
        filter.finish(&mut |values| found.push(values));
        assert_eq!(found.len(), 1990);
        for [a, b, kept] in found {
            assert!(
                (a - 3.0).abs() < 1e-12 && (b + 2.0).abs() < 1e-12,
                "{a} {b}"
            );
            assert!((kept - 1.0).abs() < 1e-15, "{kept}");
        }
    }
}
