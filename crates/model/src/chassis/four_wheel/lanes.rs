//! Runs of one model side by side.
//!
//! The rate is straight-line code over `f64`; in a loop over runs it becomes vector code, with the
//! same operations on the same numbers as [`step`](super::step) does, each rounded as ever: a run
//! of a batch has the bits of a run alone, on every processor.

use std::marker::PhantomData;

use multiversion::multiversion;

use super::contacts::BrushTyres;
use super::dynamics::{Constants, Held};
use super::model::{Shared, brush_rate, brushes, shared_form, step};
use super::{Inputs, Parameters, STATES, State};
use crate::chassis::form::{Form, Immediate, Relaxing};
use crate::integrate::{LANES, LaneRates, Lanes, rk4_lanes};
use crate::tyre::{Brush, OnSurface};

/// Numbers of [`Held`] and the surfaces that the kernel reads.
const HELD: usize = 31;

/// Steps runs of one model side by side, inputs held: the bits of [`step`] for each of them.
///
/// Vector code serves brush tyres, what vehicle files give, without roll steer and with two load
/// passes: relaxing ones whose stiffness grows with the load to the power of 3/4, and ones that do
/// neither. Others are stepped one by one.
pub fn advance(
    parameters: &Parameters,
    states: &mut [State<f64>; LANES],
    inputs: &[Inputs<f64>; LANES],
    step_s: f64,
    steps: usize,
) {
    let kernel = match (shared_form(parameters), brushes(parameters)) {
        (Shared::Relaxing, Some((axles, true))) => Some((axles, relaxing_growing as Kernel)),
        (Shared::Immediate, Some((axles, false))) => Some((axles, immediate_constant as Kernel)),
        _ => None,
    };
    if let Some((axles, kernel)) = kernel {
        let mut x = [[0.0; LANES]; STATES];
        for (lane, state) in states.iter().enumerate() {
            for (row, value) in x.iter_mut().zip(state.to_array()) {
                row[lane] = value;
            }
        }
        kernel(parameters, axles, &mut x, inputs, step_s, steps);
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

type Kernel = fn(&Parameters, [Brush; 2], &mut Lanes<STATES>, &[Inputs<f64>; LANES], f64, usize);

macro_rules! kernel {
    ($name:ident, $form:ty, $grows:literal) => {
        #[multiversion(targets("x86_64+avx+avx2"))]
        fn $name(
            parameters: &Parameters,
            axles: [Brush; 2],
            x: &mut Lanes<STATES>,
            inputs: &[Inputs<f64>; LANES],
            step_s: f64,
            steps: usize,
        ) {
            run::<$form, $grows>(parameters, axles, x, inputs, step_s, steps);
        }
    };
}

kernel!(relaxing_growing, Relaxing, true);
kernel!(immediate_constant, Immediate, false);

#[inline(always)]
fn run<F: Form, const GROWS: bool>(
    parameters: &Parameters,
    axles: [Brush; 2],
    x: &mut Lanes<STATES>,
    inputs: &[Inputs<f64>; LANES],
    step_s: f64,
    steps: usize,
) {
    let mut rates = Rates::<F, GROWS> {
        parameters,
        axles,
        constants: Constants::of(parameters),
        held: [[0.0; LANES]; HELD],
        form: PhantomData,
    };
    for (lane, inputs) in inputs.iter().enumerate() {
        let held = Held::of(parameters, inputs);
        let row = pack(&held, BrushTyres::new(axles, inputs).surfaces());
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
    axles: [Brush; 2],
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
            let tyres = BrushTyres::on(self.axles, surfaces);
            let (parameters, constants) = (self.parameters, &self.constants);
            let new = brush_rate::<f64, F, GROWS>(parameters, constants, &inputs, &tyres, &state);
            let new = new.to_array();
            for j in 0..STATES {
                rate[j][lane] = new[j];
            }
        }
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
