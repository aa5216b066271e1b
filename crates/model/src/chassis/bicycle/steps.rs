//! Steps of the linear bicycle: of one run, and of runs side by side.

use multiversion::multiversion;

use super::StateSpace;
use crate::Error;
use crate::checks::FINITE;
use crate::integrate::{LANES, StraightRate, rk4, rk4_lanes};

/// Refuses (beta, r) that is not finite, by name.
#[inline]
pub(crate) fn check_state([sideslip_rad, yaw_rate_rad_s]: &[f64; 2]) -> Result<(), Error> {
    FINITE.require("state.sideslip_rad", sideslip_rad, "rad")?;
    FINITE.require("state.yaw_rate_rad_s", yaw_rate_rad_s, "rad/s")
}

/// Refuses a steer angle that is not finite, by name.
#[inline]
pub(crate) fn check_steer(steer_rad: &f64) -> Result<(), Error> {
    FINITE.require("inputs.steer_rad", steer_rad, "rad")
}

/// Steps from (beta, r), rad and rad/s, with the steer angle held, rad.
pub(crate) fn stepped(
    system: &StateSpace,
    state: &[f64; 2],
    steer_rad: &f64,
    step_s: f64,
    steps: usize,
) -> [f64; 2] {
    let held = system.hold(steer_rad);
    (0..steps).fold(*state, |state, _| {
        rk4(&state, step_s, |x| system.rate(&held, x))
    })
}

/// Steps runs side by side with their steer angles held: the bits of [`stepped`] for each of them.
#[multiversion(targets("x86_64+avx+avx2"))]
pub(crate) fn advance(
    system: &StateSpace,
    states: &mut [[f64; 2]; LANES],
    steer_rad: &[f64; LANES],
    step_s: f64,
    steps: usize,
) {
    rk4_lanes(system, states, steer_rad, step_s, steps);
}

/// Held is B delta.
impl StraightRate<2, 2> for StateSpace {
    type State = [f64; 2];
    type Inputs = f64;

    #[inline(always)]
    fn numbers(state: &[f64; 2]) -> [f64; 2] {
        *state
    }

    #[inline(always)]
    fn state(numbers: [f64; 2]) -> [f64; 2] {
        numbers
    }

    #[inline(always)]
    fn hold(&self, steer_rad: &f64) -> [f64; 2] {
        [self.b[0] * steer_rad, self.b[1] * steer_rad]
    }

    #[inline(always)]
    fn rate(&self, held: &[f64; 2], x: &[f64; 2]) -> [f64; 2] {
        let a = &self.a;
        [
            a[(0, 0)] * x[0] + a[(0, 1)] * x[1] + held[0],
            a[(1, 0)] * x[0] + a[(1, 1)] * x[1] + held[1],
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chassis::bicycle::Bicycle;
    use crate::simulation::Model;
    use crate::vehicle::Vehicle;

    #[test]
    fn runs_side_by_side_have_the_bits_of_single_ones_and_settle_at_the_gains() {
        let vehicle = Vehicle::builtin("prowler").unwrap();
        let bicycle = Bicycle::from_vehicle(&vehicle);
        let (speed_m_s, step_s, steps) = (6.0, 1e-2, 500);
        let system = bicycle.system(speed_m_s).unwrap();
        let steer_rad: [f64; LANES] = std::array::from_fn(|run| 0.01 * (run as f64 - 3.0));
        let mut states = [[0.0; 2]; LANES];
        advance(&system, &mut states, &steer_rad, step_s, steps);
        let gains = bicycle.steady_gains(speed_m_s).unwrap();
        for (state, steer) in states.iter().zip(steer_rad) {
            let mut single = [0.0; 2];
            for _ in 0..steps {
                single = system.step(&single, &steer, step_s).unwrap();
            }
            assert_eq!(*state, single);
            let settled = [gains.sideslip, gains.yaw_rate_1_s].map(|gain| gain * steer);
            for (state, settled) in state.iter().zip(settled) {
                assert!((state - settled).abs() < 1e-12, "{state} {settled}");
            }
        }
    }
}
