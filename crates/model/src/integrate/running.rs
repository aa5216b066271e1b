//! The classical Runge-Kutta rule for a run alone whose state stays in registers.

/// A state of a run, or its rate, as vectors and numbers.
pub(crate) trait Running: Copy {
    /// This state and `by` times a rate.
    fn plus(&self, rate: &Self, by: f64) -> Self;
}

/// A rate in a straight line; a trait for the reason of [`StraightRate`](super::StraightRate).
pub(crate) trait RunningRate {
    /// What changes.
    type State: Running;

    /// Rate of a state.
    fn rate(&self, state: &Self::State) -> Self::State;
}

/// Steps of [`rk4`](super::rk4), to the same bits.
#[inline(always)]
pub(crate) fn rk4_steps<M: RunningRate>(
    model: &M,
    mut x: M::State,
    step_s: f64,
    steps: usize,
) -> M::State {
    let ahead_s = [0.5 * step_s, 0.5 * step_s, step_s];
    let weight = [2.0, 2.0, 1.0];
    for _ in 0..steps {
        let mut k = model.rate(&x);
        let mut sum = k;
        // One copy of the rate for all later stages.
        for stage in 0..3 {
            k = model.rate(&x.plus(&k, ahead_s[stage]));
            sum = sum.plus(&k, weight[stage]);
        }
        x = x.plus(&sum, step_s / 6.0);
    }
    x
}
