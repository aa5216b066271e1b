/// What one step towards an event did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Advance<const N: usize, const E: usize> {
    /// State reached; just past the event where there was one.
    pub state: [f64; N],
    /// Time taken, s: the whole step, or up to the event.
    pub taken_s: f64,
    /// Whether each guard rose (true) or fell (false); none where its sign stayed.
    pub changes: [Option<bool>; E],
}

/// Time to which an event is located, s.
const RESOLUTION_S: f64 = 1e-10;

/// Takes one step, or the part of it up to the first change of sign of a guard, which bisection
/// locates to 1e-10 s. Going on from there keeps kinks of the rate on the boundaries of steps, so
/// that the integrator keeps its order across them.
///
/// A guard that is zero counts as positive. Two changes of one guard inside of one step cancel:
/// choose the step shorter than what should not be missed.
pub fn step_to_event<const N: usize, const E: usize>(
    start: &[f64; N],
    step_s: f64,
    step: impl Fn(&[f64; N], f64) -> [f64; N],
    guards: impl Fn(&[f64; N]) -> [f64; E],
) -> Advance<N, E> {
    let before = guards(start).map(|guard| guard >= 0.0);
    let changes = |state: &[f64; N]| -> [Option<bool>; E] {
        let now = guards(state).map(|guard| guard >= 0.0);
        std::array::from_fn(|k| (now[k] != before[k]).then_some(now[k]))
    };
    let mut state = step(start, step_s);
    let mut found = changes(&state);
    let (mut clear, mut past) = (0.0, step_s);
    while past - clear > RESOLUTION_S && found.iter().any(Option::is_some) {
        let middle = 0.5 * (clear + past);
        let tried = step(start, middle);
        let there = changes(&tried);
        if there.iter().any(Option::is_some) {
            (past, state, found) = (middle, tried, there);
        } else {
            clear = middle;
        }
    }
    Advance {
        state,
        taken_s: past,
        changes: found,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrate::rk4;

    #[test]
    fn a_falling_ball_meets_the_ground_when_it_should() {
        let fall = |x: &[f64; 2], h: f64| rk4(x, h, |x| [x[1], -9.81]);
        let mut state = [2.0, 0.0];
        let mut time = 0.0;
        loop {
            let advance = step_to_event(&state, 0.01, fall, |x| [x[0], x[1] + 100.0]);
            time += advance.taken_s;
            state = advance.state;
            if advance.changes != [None; 2] {
                assert_eq!(advance.changes, [Some(false), None]);
                break;
            }
        }
        assert!((time - (4.0_f64 / 9.81).sqrt()).abs() < 1e-9, "{time}");
        assert!(state[0] <= 0.0 && state[0] > -1e-8);
    }
}
