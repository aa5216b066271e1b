//! The classical Runge-Kutta rule for a run of a model, alone or beside others.
//!
//! A rate that is straight-line code over `f64` becomes vector code: over the wheels of a run
//! alone, over the runs where there are several. The operations on each number stay the same, each
//! rounded as ever: a run of a batch has the bits of a run alone, on every processor.

/// Runs that vector code steps side by side.
pub const LANES: usize = 8;

/// A rate of N numbers in a straight line, with H numbers that are held over the steps.
///
/// A trait and no closures: its implementation must be inlined into the function that was compiled
/// for wide registers, which only a named function can be told.
pub(crate) trait StraightRate<const N: usize, const H: usize> {
    /// State of a run.
    type State;
    /// What acts on a run.
    type Inputs;

    /// Numbers of a state.
    fn numbers(state: &Self::State) -> [f64; N];
    /// The state of numbers.
    fn state(numbers: [f64; N]) -> Self::State;
    /// What is held of a run's inputs.
    fn hold(&self, inputs: &Self::Inputs) -> [f64; H];
    /// Rate of the state `x`.
    fn rate(&self, held: &[f64; H], x: &[f64; N]) -> [f64; N];
}

/// Steps of [`rk4`](super::rk4) for runs side by side with inputs held, to the same bits for each
/// run.
#[inline(always)]
pub(crate) fn rk4_lanes<M, const N: usize, const H: usize, const L: usize>(
    model: &M,
    states: &mut [M::State; L],
    inputs: &[M::Inputs; L],
    step_s: f64,
    steps: usize,
) where
    M: StraightRate<N, H>,
{
    // Row j holds number j of each run.
    let mut held = [[0.0; L]; H];
    let mut x = [[0.0; L]; N];
    for lane in 0..L {
        write(&mut held, lane, &model.hold(&inputs[lane]));
        write(&mut x, lane, &M::numbers(&states[lane]));
    }
    let ahead_s = [0.5 * step_s, 0.5 * step_s, step_s, 0.0];
    let weight = [1.0, 2.0, 2.0, 1.0];
    let mut sum = [[0.0; L]; N];
    let mut k = [[0.0; L]; N];
    let mut ahead = x;
    for _ in 0..steps {
        // One copy of the rate for all four stages.
        for stage in 0..4 {
            for lane in 0..L {
                let rate = model.rate(&read(&held, lane), &read(&ahead, lane));
                write(&mut k, lane, &rate);
            }
            let (ahead_s, weight) = (ahead_s[stage], weight[stage]);
            for j in 0..N {
                for lane in 0..L {
                    ahead[j][lane] = x[j][lane] + k[j][lane] * ahead_s;
                    let weighted = k[j][lane] * weight;
                    sum[j][lane] = if stage == 0 {
                        weighted
                    } else {
                        sum[j][lane] + weighted
                    };
                }
            }
        }
        for j in 0..N {
            for lane in 0..L {
                x[j][lane] += sum[j][lane] * (step_s / 6.0);
                ahead[j][lane] = x[j][lane];
            }
        }
    }
    for lane in 0..L {
        states[lane] = M::state(read(&x, lane));
    }
}

/// The numbers of a run.
#[inline(always)]
fn read<const N: usize, const L: usize>(rows: &[[f64; L]; N], lane: usize) -> [f64; N] {
    let mut run = [0.0; N];
    for j in 0..N {
        run[j] = rows[j][lane];
    }
    run
}

/// Sets the numbers of a run.
#[inline(always)]
fn write<const N: usize, const L: usize>(rows: &mut [[f64; L]; N], lane: usize, run: &[f64; N]) {
    for j in 0..N {
        rows[j][lane] = run[j];
    }
}
