//! Runs of one model side by side, as those of the [four-wheel model](crate::chassis::four_wheel):
//! vector code with the bits of single steps.

use std::marker::PhantomData;

use multiversion::multiversion;

use super::dynamics::{BrushTyres, Constants, Held, solve};
use super::model::{all_relax, brushes, step};
use super::{Inputs, Parameters, STATES, State};
use crate::chassis::form::{Form, Relaxing};
use crate::integrate::{LANES, LaneRates, Lanes, rk4_lanes};
use crate::tyre::{Brush, OnSurface};

/// Numbers of [`Held`] and the surfaces.
const HELD: usize = 39;

/// Steps runs of one model side by side, inputs held: the bits of [`step`] for each of them.
///
/// Vector code serves relaxing brush tyres whose stiffness grows with the load to the power of 3/4,
/// what vehicle files with struts give; others are stepped one by one.
pub fn advance(
    parameters: &Parameters,
    states: &mut [State<f64>; LANES],
    inputs: &[Inputs<f64>; LANES],
    step_s: f64,
    steps: usize,
) {
    if let (Some(true), Some((corners, true))) = (all_relax(parameters), brushes(parameters)) {
        let mut x = [[0.0; LANES]; STATES];
        for (lane, state) in states.iter().enumerate() {
            for (row, value) in x.iter_mut().zip(state.to_array()) {
                row[lane] = value;
            }
        }
        relaxing_growing(parameters, &corners, &mut x, inputs, step_s, steps);
        for (lane, state) in states.iter_mut().enumerate() {
            *state = State::from_array(std::array::from_fn(|j| x[j][lane]));
        }
    } else {
        for (state, inputs) in states.iter_mut().zip(inputs) {
            for _ in 0..steps {
                *state = step(parameters, state, inputs, step_s);
            }
        }
    }
}

#[multiversion(targets("x86_64+avx+avx2"))]
fn relaxing_growing(
    parameters: &Parameters,
    corners: &[Brush; 4],
    x: &mut Lanes<STATES>,
    inputs: &[Inputs<f64>; LANES],
    step_s: f64,
    steps: usize,
) {
    run::<Relaxing, true>(parameters, corners, x, inputs, step_s, steps);
}

#[inline(always)]
fn run<F: Form, const GROWS: bool>(
    parameters: &Parameters,
    corners: &[Brush; 4],
    x: &mut Lanes<STATES>,
    inputs: &[Inputs<f64>; LANES],
    step_s: f64,
    steps: usize,
) {
    let mut rates = Rates::<F, GROWS> {
        parameters,
        corners,
        constants: Constants::of(parameters),
        held: [[0.0; LANES]; HELD],
        form: PhantomData,
    };
    for (lane, inputs) in inputs.iter().enumerate() {
        let held = Held::of(parameters, inputs);
        let row = pack(
            &held,
            &BrushTyres::<f64, GROWS>::new(corners, inputs).surfaces,
        );
        for j in 0..HELD {
            rates.held[j][lane] = row[j];
        }
    }
    for _ in 0..steps {
        rk4_lanes(x, step_s, &rates);
    }
}

struct Rates<'a, F, const GROWS: bool> {
    parameters: &'a Parameters,
    corners: &'a [Brush; 4],
    constants: Constants,
    held: Lanes<HELD>,
    form: PhantomData<F>,
}

impl<F: Form, const GROWS: bool> LaneRates<STATES> for Rates<'_, F, GROWS> {
    #[inline(always)]
    fn rates(&self, x: &Lanes<STATES>, rate: &mut Lanes<STATES>) {
        for lane in 0..LANES {
            let (inputs, surfaces) = unpack(&std::array::from_fn(|j| self.held[j][lane]));
            let state = State::from_array(std::array::from_fn(|j| x[j][lane]));
            let tyres = BrushTyres::<f64, GROWS> {
                corners: self.corners,
                surfaces,
            };
            let (parameters, constants) = (self.parameters, &self.constants);
            let solution = solve::<f64, F>(parameters, constants, &tyres, &state, &inputs);
            let new = solution.rate.to_array();
            for j in 0..STATES {
                rate[j][lane] = new[j];
            }
        }
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
