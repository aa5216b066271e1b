//! What the 14-degree-of-freedom model is asked for.

use nalgebra::{SMatrix, SVector};

use super::dynamics::{AnyTyres, BrushTyres, Constants, Held, Solution, centre, frame, solve};
use super::vector::dot;
use super::{Inputs, Parameters, STATES, State};
use crate::Scalar;
use crate::chassis::form::Mixed;
use crate::chassis::slopes::{self, Sloped};
use crate::scalar::each;
use crate::tyre::Brush;

/// What the model tells besides the rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outputs<T> {
    /// Rate of the state.
    pub rate: State<T>,
    /// Normal loads, N; zero where the wheel is in the air.
    pub load_n: [T; 4],
    /// How far each tyre is pressed in, m; negative is its clearance above ground.
    pub deflection_m: [T; 4],
    /// Longitudinal tyre forces, contact frame, N.
    pub longitudinal_n: [T; 4],
    /// Lateral tyre forces, contact frame, N.
    pub lateral_n: [T; 4],
    /// Slip angles, rad.
    pub slip_angle_rad: [T; 4],
    /// Longitudinal slips.
    pub slip_ratio: [T; 4],
    /// Strut lengths, m.
    pub strut_length_m: [T; 4],
    /// Force along each strut, N, pushing its ends apart.
    pub strut_force_n: [T; 4],
    /// Specific force at the sprung part's centre of gravity, body axes, m/s^2.
    pub specific_force_m_s2: [T; 3],
}

/// Brush tyres of all corners and whether their stiffnesses grow with the load, where all have
/// such tyres.
pub(super) fn brushes(parameters: &Parameters) -> Option<([Brush; 4], bool)> {
    let [a, b, c, d] = [0, 1, 2, 3].map(|i: usize| Brush::of(&parameters.corners[i].tyre));
    let all = [a?, b?, c?, d?];
    let grows = all[0].1;
    let alike = all.iter().all(|(_, own)| *own == grows);
    alike.then(|| (all.map(|(brush, _)| brush), grows))
}

/// Whether all corners' tyres relax; `None` where they differ.
pub(super) fn all_relax(parameters: &Parameters) -> Option<bool> {
    let relaxes = each(|i| parameters.corners[i].relaxation_length_m > 0.0);
    relaxes
        .iter()
        .all(|own| *own == relaxes[0])
        .then_some(relaxes[0])
}

impl<'a, T: Scalar, const GROWS: bool> BrushTyres<'a, T, GROWS> {
    #[inline(always)]
    pub(super) fn new(corners: &'a [Brush; 4], inputs: &Inputs<T>) -> Self {
        let surfaces =
            each(|i| corners[i].on_surface(inputs.friction_scale[i], inputs.stiffness_scale[i]));
        Self { corners, surfaces }
    }
}

/// All of one instant, with tyres of any kind.
fn instant<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    inputs: &Inputs<T>,
) -> Solution<T> {
    let constants = Constants::of(parameters);
    let held = Held::of(parameters, inputs);
    match brushes(parameters) {
        Some((corners, true)) => {
            let tyres = BrushTyres::<T, true>::new(&corners, inputs);
            solve::<T, Mixed>(parameters, &constants, &tyres, state, &held)
        }
        Some((corners, false)) => {
            let tyres = BrushTyres::<T, false>::new(&corners, inputs);
            solve::<T, Mixed>(parameters, &constants, &tyres, state, &held)
        }
        None => {
            let tyres = AnyTyres { parameters, inputs };
            solve::<T, Mixed>(parameters, &constants, &tyres, state, &held)
        }
    }
}

/// Rate of the state.
pub fn derivative<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    inputs: &Inputs<T>,
) -> State<T> {
    instant(parameters, state, inputs).rate
}

/// Rate of the state with loads, forces, slips and strut lengths.
pub fn outputs<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    inputs: &Inputs<T>,
) -> Outputs<T> {
    let Solution {
        rate,
        wheels,
        struts,
        specific_force,
    } = instant(parameters, state, inputs);
    Outputs {
        rate,
        load_n: each(|i| wheels[i].load),
        deflection_m: each(|i| wheels[i].deflection),
        longitudinal_n: each(|i| wheels[i].contact[0]),
        lateral_n: each(|i| wheels[i].contact[1]),
        slip_angle_rad: each(|i| wheels[i].slips[0].arctangent()),
        slip_ratio: each(|i| wheels[i].slips[1]),
        strut_length_m: each(|i| struts[i][0]),
        strut_force_n: each(|i| struts[i][1]),
        specific_force_m_s2: specific_force,
    }
}

/// Numbers whose signs tell contact, wheel by wheel: how far the tyres are pressed in, how far the
/// struts are past their droop stops, and past their bump stops, m.
#[must_use]
pub fn guards(parameters: &Parameters, state: &State<f64>, inputs: &Inputs<f64>) -> [f64; 12] {
    let held = Held::of(parameters, inputs);
    let up = frame(state, &held).axes[2];
    let mut guards = [0.0; 12];
    for (i, corner) in parameters.corners.iter().enumerate() {
        let centre = centre(parameters, state, &held, i);
        let lean = up[1] * held.cos[i] - up[0] * held.sin[i];
        let height = state.position_m[2] + dot(up, centre) - inputs.road_m[i];
        let length = corner.strut.length_m(state.jounce_m[i]);
        guards[i] = corner.unloaded_radius_m - height / (1.0 - lean * lean).sqrt();
        guards[4 + i] = length - corner.strut.strut.droop_stop_length_m;
        guards[8 + i] = corner.strut.strut.bump_stop_length_m - length;
    }
    guards
}

/// Exact Jacobian of the rate by the state, by dual numbers.
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
        road_m: lift(inputs.road_m),
        road_rate_m_s: lift(inputs.road_rate_m_s),
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
