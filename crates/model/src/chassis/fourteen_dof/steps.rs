//! Steps of one run, and of runs of one model side by side.

use multiversion::multiversion;

use super::dynamics::{BrushTyres, Constants, Held, solve};
use super::model::{all_relax, brushes, derivative};
use super::{Inputs, Parameters, STATES, State};
use crate::chassis::form::Relaxing;
use crate::integrate::{LANES, StraightRate, rk4, rk4_lanes};
use crate::tyre::{Brush, OnSurface};

/// Numbers of [`Held`] and the surfaces.
const HELD: usize = 39;

/// Steps of one run, inputs held.
pub(crate) fn stepped(
    parameters: &Parameters,
    state: &State<f64>,
    inputs: &Inputs<f64>,
    step_s: f64,
    steps: usize,
) -> State<f64> {
    let mut next = *state;
    let inputs = std::array::from_ref(inputs);
    let states = std::array::from_mut(&mut next);
    run(parameters, states, inputs, step_s, steps, relaxing_growing);
    next
}

/// Steps runs of one model side by side, inputs held: the bits of [`stepped`] for each of them.
///
/// A kernel of vector code serves relaxing brush tyres whose stiffness grows with the load to the
/// power of 3/4, what vehicle files with struts give.
pub(crate) fn advance(
    parameters: &Parameters,
    states: &mut [State<f64>; LANES],
    inputs: &[Inputs<f64>; LANES],
    step_s: f64,
    steps: usize,
) {
    let kernel = relaxing_growing_lanes;
    run(parameters, states, inputs, step_s, steps, kernel);
}

/// Steps runs by the kernel if it serves the parameters, otherwise one by one.
fn run<const L: usize>(
    parameters: &Parameters,
    states: &mut [State<f64>; L],
    inputs: &[Inputs<f64>; L],
    step_s: f64,
    steps: usize,
    relaxing_growing: Kernel<L>,
) {
    if let (Some(true), Some((corners, true))) = (all_relax(parameters), brushes(parameters)) {
        relaxing_growing(parameters, &corners, states, inputs, step_s, steps);
        return;
    }
    for (state, inputs) in states.iter_mut().zip(inputs) {
        let rate = |x: &_| derivative(parameters, &State::from_array(*x), inputs).to_array();
        for _ in 0..steps {
            *state = State::from_array(rk4(&state.to_array(), step_s, rate));
        }
    }
}

type Kernel<const L: usize> =
    fn(&Parameters, &[Brush; 4], &mut [State<f64>; L], &[Inputs<f64>; L], f64, usize);

macro_rules! kernel {
    ($name:ident, $runs:expr) => {
        #[multiversion(targets("x86_64+avx+avx2"))]
        fn $name(
            parameters: &Parameters,
            corners: &[Brush; 4],
            states: &mut [State<f64>; $runs],
            inputs: &[Inputs<f64>; $runs],
            step_s: f64,
            steps: usize,
        ) {
            let constants = Constants::of(parameters);
            let rate = BrushRate {
                parameters,
                constants: &constants,
                corners,
            };
            rk4_lanes(&rate, states, inputs, step_s, steps);
        }
    };
}

kernel!(relaxing_growing, 1);
kernel!(relaxing_growing_lanes, LANES);

/// The rate with relaxing brush tyres whose stiffness grows with the load.
struct BrushRate<'a> {
    parameters: &'a Parameters,
    constants: &'a Constants,
    corners: &'a [Brush; 4],
}

impl StraightRate<STATES, HELD> for BrushRate<'_> {
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
        let tyres = BrushTyres::<f64, true>::new(self.corners, inputs);
        pack(&held, &tyres.surfaces)
    }

    #[inline(always)]
    fn rate(&self, held: &[f64; HELD], x: &[f64; STATES]) -> [f64; STATES] {
        let (held, surfaces) = unpack(held);
        let tyres = BrushTyres::<f64, true> {
            corners: self.corners,
            surfaces,
        };
        let (parameters, constants) = (self.parameters, self.constants);
        let state = State::from_array(*x);
        let solution = solve::<f64, Relaxing>(parameters, constants, &tyres, &state, &held);
        solution.rate.to_array()
    }
}

#[inline(always)]
fn pack(held: &Held<f64>, surfaces: &[OnSurface<f64>; 4]) -> [f64; HELD] {
    let mut row = [0.0; HELD];
    row[..3].copy_from_slice(&held.gravity);
    let lists = [
        held.sin,
        held.cos,
        held.drive,
        held.brake,
        held.road,
        held.road_rate,
    ];
    row[3..27].copy_from_slice(lists.as_flattened());
    for (i, surface) in surfaces.iter().enumerate() {
        row[27 + i] = surface.stiffness;
        row[31 + i] = surface.slope;
        row[35 + i] = surface.slide;
    }
    row
}

/// What [`pack`] packed.
#[inline(always)]
fn unpack(row: &[f64; HELD]) -> (Held<f64>, [OnSurface<f64>; 4]) {
    let four = |first: usize| [row[first], row[first + 1], row[first + 2], row[first + 3]];
    let held = Held {
        sin: four(3),
        cos: four(7),
        drive: four(11),
        brake: four(15),
        road: four(19),
        road_rate: four(23),
        gravity: [row[0], row[1], row[2]],
    };
    let surface = |i: usize| OnSurface {
        stiffness: row[27 + i],
        slope: row[31 + i],
        slide: row[35 + i],
    };
    (held, [surface(0), surface(1), surface(2), surface(3)])
}
