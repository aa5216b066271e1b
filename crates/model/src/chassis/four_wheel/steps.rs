//! Steps of one run, and of runs of one model side by side.

use std::marker::PhantomData;

use multiversion::multiversion;

use super::constants::Constants;
use super::contacts::BrushTyres;
use super::dynamics::Held;
use super::model::{brush_rate, derivative};
use super::motion::Motion;
use super::parameters::Shared;
use super::{Inputs, Parameters, STATES, State};
use crate::chassis::form::{Form, Immediate, Relaxing};
use crate::integrate::{LANES, RunningRate, StraightRate, rk4, rk4_lanes, rk4_steps};
use crate::tyre::{Brush, OnSurface};
use crate::values::{Listed, PerWheelValues, Values};

/// Numbers of [`Held`] and the surfaces that the kernels read.
const HELD: usize = 31;

/// Steps of one run, inputs held.
pub(crate) fn stepped(
    parameters: &Parameters,
    state: &State<f64>,
    inputs: &Inputs<f64>,
    step_s: f64,
    steps: usize,
) -> State<f64> {
    let prepared = parameters.prepared();
    match (prepared.shared, &prepared.brushes) {
        (Shared::Relaxing, Some((brush, true))) => {
            relaxing_growing(parameters, brush, state, inputs, step_s, steps)
        }
        (Shared::Immediate, Some((brush, true))) => {
            immediate_growing(parameters, brush, state, inputs, step_s, steps)
        }
        (Shared::Immediate, Some((brush, false))) => {
            immediate_constant(parameters, brush, state, inputs, step_s, steps)
        }
        _ => of_any_kind(parameters, state, inputs, step_s, steps),
    }
}

/// Steps of one run with tyres of any kind and axles of any form.
fn of_any_kind(
    parameters: &Parameters,
    state: &State<f64>,
    inputs: &Inputs<f64>,
    step_s: f64,
    steps: usize,
) -> State<f64> {
    let rate = |x: &_| derivative(parameters, &State::from_array(*x), inputs).to_array();
    let start = state.to_array();
    State::from_array((0..steps).fold(start, |state, _| rk4(&state, step_s, rate)))
}

/// Steps runs of one model side by side, inputs held: the bits of [`stepped`] for each of them.
///
/// Kernels of vector code serve brush tyres, what vehicle files give, without roll steer and with
/// two load passes: those whose stiffness grows with the load to the power of 3/4, relaxing or not,
/// and those that do neither.
pub(crate) fn advance(
    parameters: &Parameters,
    states: &mut [State<f64>; LANES],
    inputs: &[Inputs<f64>; LANES],
    step_s: f64,
    steps: usize,
) {
    let prepared = parameters.prepared();
    match (prepared.shared, &prepared.brushes) {
        (Shared::Relaxing, Some((brush, true))) => {
            relaxing_growing_lanes(parameters, brush, states, inputs, step_s, steps);
        }
        (Shared::Immediate, Some((brush, true))) => {
            immediate_growing_lanes(parameters, brush, states, inputs, step_s, steps);
        }
        (Shared::Immediate, Some((brush, false))) => {
            immediate_constant_lanes(parameters, brush, states, inputs, step_s, steps);
        }
        _ => {
            for (state, inputs) in states.iter_mut().zip(inputs) {
                *state = of_any_kind(parameters, state, inputs, step_s, steps);
            }
        }
    }
}

macro_rules! kernels {
    ($alone:ident, $lanes:ident, $form:ty, $grows:literal) => {
        /// Steps of one run.
        #[multiversion(targets("x86_64+avx+avx2"))]
        fn $alone(
            parameters: &Parameters,
            brush: &Brush<[f64; 4]>,
            state: &State<f64>,
            inputs: &Inputs<f64>,
            step_s: f64,
            steps: usize,
        ) -> State<f64> {
            let rate = (parameters, brush, inputs);
            alone::<$form, $grows>(rate, state, step_s, steps)
        }

        /// Steps of several runs: each vector of the processor holds one number of several runs.
        #[multiversion(targets("x86_64+avx+avx2"))]
        fn $lanes(
            parameters: &Parameters,
            brush: &Brush<[f64; 4]>,
            states: &mut [State<f64>; LANES],
            inputs: &[Inputs<f64>; LANES],
            step_s: f64,
            steps: usize,
        ) {
            let rate = InLanes::<$form, $grows> {
                parameters,
                constants: &parameters.prepared().constants,
                brush: *brush,
                form: PhantomData,
            };
            rk4_lanes(&rate, states, inputs, step_s, steps);
        }
    };
}

kernels!(relaxing_growing, relaxing_growing_lanes, Relaxing, true);
kernels!(immediate_growing, immediate_growing_lanes, Immediate, true);
kernels!(
    immediate_constant,
    immediate_constant_lanes,
    Immediate,
    false
);

/// Steps of one run with brush tyres.
#[inline(always)]
fn alone<F: Form, const GROWS: bool>(
    (parameters, brush, inputs): (&Parameters, &Brush<[f64; 4]>, &Inputs<f64>),
    state: &State<f64>,
    step_s: f64,
    steps: usize,
) -> State<f64> {
    let rate = Alone::<F, GROWS> {
        constants: &parameters.prepared().constants,
        held: Held::of(parameters, inputs),
        tyres: BrushTyres::new(*brush, inputs),
        form: PhantomData,
    };
    rk4_steps(&rate, Motion::of(state), step_s, steps).state()
}

/// The rate of one run with brush tyres.
struct Alone<'a, F, const GROWS: bool> {
    constants: &'a Constants,
    held: Held<Listed<f64>>,
    tyres: BrushTyres<Listed<f64>>,
    form: PhantomData<F>,
}

impl<F: Form, const GROWS: bool> RunningRate for Alone<'_, F, GROWS> {
    type State = Motion<Listed<f64>>;

    #[inline(always)]
    fn rate(&self, at: &Self::State) -> Self::State {
        brush_rate::<_, F, GROWS>(self.constants, &self.held, &self.tyres, at)
    }
}

/// The rate of each of several runs with brush tyres.
struct InLanes<'a, F, const GROWS: bool> {
    parameters: &'a Parameters,
    constants: &'a Constants,
    brush: Brush<[f64; 4]>,
    form: PhantomData<F>,
}

impl<F: Form, const GROWS: bool> StraightRate<STATES, HELD> for InLanes<'_, F, GROWS> {
    type State = State<f64>;
    type Inputs = Inputs<f64>;

    #[inline(always)]
    fn numbers(state: &State<f64>) -> [f64; STATES] {
        state.to_array()
    }

    #[inline(always)]
    fn state(numbers: [f64; STATES]) -> State<f64> {
        State::from_array(numbers)
    }

    #[inline(always)]
    fn hold(&self, inputs: &Inputs<f64>) -> [f64; HELD] {
        let held = Held::of(self.parameters, inputs);
        pack(&held, BrushTyres::new(self.brush, inputs).surface())
    }

    #[inline(always)]
    fn rate(&self, held: &[f64; HELD], x: &[f64; STATES]) -> [f64; STATES] {
        let (held, surface) = unpack(held);
        let tyres = BrushTyres::on(self.brush, surface);
        let at = Motion::of(&State::from_array(*x));
        let rate = brush_rate::<_, F, GROWS>(self.constants, &held, &tyres, &at);
        rate.state().to_array()
    }
}

#[inline(always)]
fn pack(held: &Held<Listed<f64>>, surface: &OnSurface<Listed<f64>>) -> [f64; HELD] {
    let mut row = [0.0; HELD];
    let lists = [
        held.sin,
        held.cos,
        held.drive,
        held.brake,
        surface.stiffness,
        surface.slope,
        surface.slide,
    ];
    for (k, list) in lists.into_iter().enumerate() {
        row[4 * k..4 * k + 4].copy_from_slice(&list.list());
    }
    row[28..].copy_from_slice(&held.road);
    row
}

/// What [`pack`] packed; the steer angles themselves are left out, as only roll steer asks for them.
#[inline(always)]
fn unpack(row: &[f64; HELD]) -> (Held<Listed<f64>>, OnSurface<Listed<f64>>) {
    let four = |k: usize| [row[k], row[k + 1], row[k + 2], row[k + 3]];
    let values = |k: usize| Listed::of(four(4 * k));
    let held = Held {
        steer: Listed::constant(0.0),
        sin: values(0),
        cos: values(1),
        drive: values(2),
        brake: values(3),
        road: [row[28], row[29], row[30]],
    };
    let surface = OnSurface {
        stiffness: values(4),
        slope: values(5),
        slide: values(6),
    };
    (held, surface)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::Vehicle;

    /// What the processor at hand runs comes to the bits that one without vectors gets.
    #[test]
    fn vectors_of_the_processor_change_no_bit() {
        let shipped = |name| Vehicle::builtin(name).unwrap();
        let mut at_once = shipped("prowler");
        for axle in [&mut at_once.front, &mut at_once.rear] {
            axle.tyre.relaxation_length_m = 0.0;
        }
        let mut tried = 0;
        for vehicle in [shipped("prowler"), shipped("prowler-table-2.3"), at_once] {
            let parameters = Parameters::from_vehicle(&vehicle);
            let prepared = parameters.prepared();
            let (brush, grows) = prepared.brushes.as_ref().unwrap();
            let mut inputs = Inputs::steered(0.12);
            inputs.drive_n_m = [0.0, 0.0, 30.0, 40.0];
            inputs.bank_rad = 0.03;
            let start = State::rolling(9.0, &parameters);
            let rate = (&parameters, brush, &inputs);
            let (found, expected) = match (prepared.shared, grows) {
                (Shared::Relaxing, true) => (
                    relaxing_growing(&parameters, brush, &start, &inputs, 1e-3, 2000),
                    alone::<Relaxing, true>(rate, &start, 1e-3, 2000),
                ),
                (Shared::Immediate, true) => (
                    immediate_growing(&parameters, brush, &start, &inputs, 1e-3, 2000),
                    alone::<Immediate, true>(rate, &start, 1e-3, 2000),
                ),
                (Shared::Immediate, false) => (
                    immediate_constant(&parameters, brush, &start, &inputs, 1e-3, 2000),
                    alone::<Immediate, false>(rate, &start, 1e-3, 2000),
                ),
                other => panic!("{} has no kernel: {other:?}", vehicle.name),
            };
            tried |= 1 << (2 * u32::from(*grows) + u32::from(prepared.shared == Shared::Relaxing));
            assert!(found.roll_rad.abs() > 1e-3, "{} turns", vehicle.name);
            assert_eq!(
                found.to_array().map(f64::to_bits),
                expected.to_array().map(f64::to_bits),
                "{}",
                vehicle.name
            );
        }
        assert_eq!(tried, 0b1101);
    }
}
