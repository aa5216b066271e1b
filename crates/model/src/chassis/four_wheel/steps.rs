//! Steps of one run, and of runs of one model side by side.

use std::marker::PhantomData;

use multiversion::multiversion;

use super::contacts::BrushTyres;
use super::dynamics::{Constants, Held};
use super::model::{Shared, brush_rate, brushes, derivative, shared_form};
use super::{Inputs, Parameters, STATES, State};
use crate::chassis::form::{Form, Immediate, Relaxing};
use crate::integrate::{LANES, StraightRate, rk4, rk4_lanes};
use crate::tyre::{Brush, OnSurface};

/// Numbers of [`Held`] and the surfaces that the kernels read.
const HELD: usize = 31;

/// One step of the classical fourth-order Runge-Kutta rule, inputs held. Allocates nothing.
#[must_use]
pub fn step(
    parameters: &Parameters,
    state: &State<f64>,
    inputs: &Inputs<f64>,
    step_s: f64,
) -> State<f64> {
    let mut next = *state;
    let kernels = [relaxing_growing, immediate_constant];
    let inputs = std::array::from_ref(inputs);
    let states = std::array::from_mut(&mut next);
    run(parameters, states, inputs, step_s, 1, kernels);
    next
}

/// Steps runs of one model side by side, inputs held: the bits of [`step`] for each of them.
///
/// Kernels of vector code serve brush tyres, what vehicle files give, without roll steer and with
/// two load passes: relaxing ones whose stiffness grows with the load to the power of 3/4, and ones
/// that do neither.
pub fn advance(
    parameters: &Parameters,
    states: &mut [State<f64>; LANES],
    inputs: &[Inputs<f64>; LANES],
    step_s: f64,
    steps: usize,
) {
    let kernels = [relaxing_growing_lanes, immediate_constant_lanes];
    run(parameters, states, inputs, step_s, steps, kernels);
}

/// Steps runs by the kernel that serves the parameters, or one by one where none does.
fn run<const L: usize>(
    parameters: &Parameters,
    states: &mut [State<f64>; L],
    inputs: &[Inputs<f64>; L],
    step_s: f64,
    steps: usize,
    [relaxing_growing, immediate_constant]: [Kernel<L>; 2],
) {
    match (shared_form(parameters), brushes(parameters)) {
        (Shared::Relaxing, Some((axles, true))) => {
            relaxing_growing(parameters, axles, states, inputs, step_s, steps);
        }
        (Shared::Immediate, Some((axles, false))) => {
            immediate_constant(parameters, axles, states, inputs, step_s, steps);
        }
        _ => {
            for (state, inputs) in states.iter_mut().zip(inputs) {
                let rate =
                    |x: &_| derivative(parameters, &State::from_array(*x), inputs).to_array();
                for _ in 0..steps {
                    *state = State::from_array(rk4(&state.to_array(), step_s, rate));
                }
            }
        }
    }
}

type Kernel<const L: usize> =
    fn(&Parameters, [Brush; 2], &mut [State<f64>; L], &[Inputs<f64>; L], f64, usize);

macro_rules! kernel {
    ($name:ident, $form:ty, $grows:literal, $runs:expr) => {
        #[multiversion(targets("x86_64+avx+avx2"))]
        fn $name(
            parameters: &Parameters,
            axles: [Brush; 2],
            states: &mut [State<f64>; $runs],
            inputs: &[Inputs<f64>; $runs],
            step_s: f64,
            steps: usize,
        ) {
            let constants = Constants::of(parameters);
            let rate = BrushRate::<$form, $grows> {
                parameters,
                constants: &constants,
                axles,
                form: PhantomData,
            };
            rk4_lanes(&rate, states, inputs, step_s, steps);
        }
    };
}

kernel!(relaxing_growing, Relaxing, true, 1);
kernel!(immediate_constant, Immediate, false, 1);
kernel!(relaxing_growing_lanes, Relaxing, true, LANES);
kernel!(immediate_constant_lanes, Immediate, false, LANES);

/// The rate with brush tyres.
struct BrushRate<'a, F, const GROWS: bool> {
    parameters: &'a Parameters,
    constants: &'a Constants,
    axles: [Brush; 2],
    form: PhantomData<F>,
}

impl<F: Form, const GROWS: bool> StraightRate<STATES, HELD> for BrushRate<'_, F, GROWS> {
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
        pack(&held, BrushTyres::new(self.axles, inputs).surfaces())
    }

    #[inline(always)]
    fn rate(&self, held: &[f64; HELD], x: &[f64; STATES]) -> [f64; STATES] {
        let (held, surfaces) = unpack(held);
        let tyres = BrushTyres::on(self.axles, surfaces);
        let state = State::from_array(*x);
        brush_rate::<f64, F, GROWS>(self.constants, &held, &tyres, &state).to_array()
    }
}

#[inline(always)]
fn pack(held: &Held<f64>, surfaces: &[OnSurface<f64>; 4]) -> [f64; HELD] {
    let mut row = [0.0; HELD];
    let road = held.road;
    row[..3].copy_from_slice(&road);
    let lists = [held.sin, held.cos, held.drive, held.brake];
    row[3..19].copy_from_slice(lists.as_flattened());
    for (i, surface) in surfaces.iter().enumerate() {
        row[19 + i] = surface.stiffness;
        row[23 + i] = surface.slope;
        row[27 + i] = surface.slide;
    }
    row
}

/// What [`pack`] packed; the steer angles themselves are left out, as only roll steer asks for them.
#[inline(always)]
fn unpack(row: &[f64; HELD]) -> (Held<f64>, [OnSurface<f64>; 4]) {
    let four = |first: usize| [row[first], row[first + 1], row[first + 2], row[first + 3]];
    let held = Held {
        steer: [0.0; 4],
        sin: four(3),
        cos: four(7),
        drive: four(11),
        brake: four(15),
        road: [row[0], row[1], row[2]],
    };
    let surface = |i: usize| OnSurface {
        stiffness: row[19 + i],
        slope: row[23 + i],
        slide: row[27 + i],
    };
    (held, [surface(0), surface(1), surface(2), surface(3)])
}
