//! What the four-wheel model is asked for.

use nalgebra::{SMatrix, SVector};

use super::constants::Constants;
use super::contacts::{AnyContacts, BrushTyres};
use super::dynamics::{Held, Solution, Wheels, rate, solve, wheels};
use super::motion::Motion;
use super::{Inputs, Parameters, STATES, State};
use crate::Scalar;
use crate::chassis::form::{Form, Mixed};
use crate::chassis::slopes::{self, Sloped};
use crate::values::{Listed, PerWheelValues};

/// What the model tells besides the derivative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outputs<T> {
    /// Rate of the state.
    pub rate: State<T>,
    /// Normal loads, N.
    pub load_n: [T; 4],
    /// Longitudinal tyre forces, wheel frame, N.
    pub longitudinal_n: [T; 4],
    /// Lateral tyre forces, wheel frame, N.
    pub lateral_n: [T; 4],
    /// Aligning moments, N m.
    pub aligning_n_m: [T; 4],
    /// Slip angles of the tyres, rad (relaxed where they relax).
    pub slip_angle_rad: [T; 4],
    /// Longitudinal slips of the tyres (relaxed where they relax).
    pub slip_ratio: [T; 4],
    /// Acceleration u' - v r of the centre of gravity, body axes, m/s^2.
    pub longitudinal_m_s2: T,
    /// Acceleration v' + u r of the centre of gravity, body axes, m/s^2.
    pub lateral_m_s2: T,
}

/// Rate of the state with brush tyres.
#[inline(always)]
pub(super) fn brush_rate<V: PerWheelValues, F: Form, const GROWS: bool>(
    constants: &Constants,
    held: &Held<V>,
    tyres: &BrushTyres<V>,
    at: &Motion<V>,
) -> Motion<V> {
    let wheels = wheels::<V, F>(constants, at, held);
    let contacts = tyres.at::<GROWS>(constants, &wheels);
    let solution = solve::<V, F>(constants, at, held, &contacts);
    rate::<V, F>(constants, at, held, &wheels, &solution)
}

/// All of one instant.
struct Instant<T: Scalar> {
    wheels: Wheels<Listed<T>>,
    solution: Solution<Listed<T>>,
    rate: Motion<Listed<T>>,
}

/// All of one instant, with tyres of any kind and axles of any form.
fn instant<T: Scalar>(parameters: &Parameters, state: &State<T>, inputs: &Inputs<T>) -> Instant<T> {
    let prepared = parameters.prepared();
    let constants = &prepared.constants;
    let at = Motion::<Listed<T>>::of(state);
    let held = Held::of(parameters, inputs);
    let wheels = wheels::<_, Mixed>(constants, &at, &held);
    let solution = match prepared.brushes {
        Some((brush, true)) => {
            let contacts = BrushTyres::new(brush, inputs).at::<true>(constants, &wheels);
            solve::<_, Mixed>(constants, &at, &held, &contacts)
        }
        Some((brush, false)) => {
            let contacts = BrushTyres::new(brush, inputs).at::<false>(constants, &wheels);
            solve::<_, Mixed>(constants, &at, &held, &contacts)
        }
        None => {
            let contacts = AnyContacts::new(parameters, constants, inputs, &wheels);
            solve::<_, Mixed>(constants, &at, &held, &contacts)
        }
    };
    let rate = rate::<_, Mixed>(constants, &at, &held, &wheels, &solution);
    Instant {
        wheels,
        solution,
        rate,
    }
}

/// Rate of the state.
pub fn derivative<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    inputs: &Inputs<T>,
) -> State<T> {
    instant(parameters, state, inputs).rate.state()
}

/// Rate of the state with loads, forces, slips and accelerations.
pub fn outputs<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    inputs: &Inputs<T>,
) -> Outputs<T> {
    let Instant {
        wheels,
        solution,
        rate,
    } = instant(parameters, state, inputs);
    let rate = rate.state();
    let [longitudinal, lateral, aligning] = solution.forces.wheel;
    Outputs {
        rate,
        load_n: solution.load.list(),
        longitudinal_n: longitudinal.list(),
        lateral_n: lateral.list(),
        aligning_n_m: aligning.list(),
        slip_angle_rad: wheels.tangent.list().map(|tangent| tangent.arctangent()),
        slip_ratio: wheels.ratio.list(),
        longitudinal_m_s2: rate.longitudinal_m_s - state.lateral_m_s * state.yaw_rate_rad_s,
        lateral_m_s2: rate.lateral_m_s + state.longitudinal_m_s * state.yaw_rate_rad_s,
    }
}

/// Tyre forces (F_x, F_y, F_z) of each wheel, wheel frame, N.
pub fn tyre_forces<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    inputs: &Inputs<T>,
) -> [[T; 3]; 4] {
    let solution = instant(parameters, state, inputs).solution;
    let [x, y, _] = solution.forces.wheel.map(Listed::list);
    let load = solution.load.list();
    std::array::from_fn(|i| [x[i], y[i], load[i]])
}

/// Exact Jacobian of the rate by the state, by dual numbers: row i, column j is
/// d(rate_i)/d(state_j).
#[must_use]
pub fn jacobian(
    parameters: &Parameters,
    state: &State<f64>,
    inputs: &Inputs<f64>,
) -> SMatrix<f64, STATES, STATES> {
    let lift = |values: [f64; 4]| values.map(Sloped::from);
    let inputs = Inputs {
        steer_rad: lift(inputs.steer_rad),
        drive_n_m: lift(inputs.drive_n_m),
        brake_n_m: lift(inputs.brake_n_m),
        bank_rad: inputs.bank_rad.into(),
        grade_rad: inputs.grade_rad.into(),
        friction_scale: lift(inputs.friction_scale),
        stiffness_scale: lift(inputs.stiffness_scale),
    };
    let rate = |x: SVector<_, STATES>| {
        derivative(parameters, &State::from_vector(&x), &inputs).to_vector()
    };
    slopes::jacobian(rate, &state.to_vector()).1
}
