//! Steps of one run, and of runs of one model side by side.

use std::marker::PhantomData;

use multiversion::multiversion;

use super::contacts::BrushTyres;
use super::dynamics::{Constants, Held};
use super::model::{Shared, brush_rate, brushes, derivative, shared_form};
use super::{Inputs, Parameters, STATES, State};
use crate::chassis::form::{Form, Immediate, Relaxing};
use crate::integrate::{LANES, Running, RunningRate, StraightRate, rk4, rk4_lanes, rk4_steps};
use crate::tyre::{Brush, OnSurface};
use crate::values::{Listed, PerWheelValues, Together, Values};

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
    let mut next = *state;
    let kernels = [relaxing_growing, immediate_constant];
    let inputs = std::array::from_ref(inputs);
    let states = std::array::from_mut(&mut next);
    run(parameters, states, inputs, step_s, steps, kernels);
    next
}

/// Steps runs of one model side by side, inputs held: the bits of [`stepped`] for each of them.
///
/// Kernels of vector code serve brush tyres, what vehicle files give, without roll steer and with
/// two load passes: relaxing ones whose stiffness grows with the load to the power of 3/4, and ones
/// that do neither.
pub(crate) fn advance(
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
        (Shared::Relaxing, Some((brush, true))) => {
            relaxing_growing(parameters, brush, states, inputs, step_s, steps);
        }
        (Shared::Immediate, Some((brush, false))) => {
            immediate_constant(parameters, brush, states, inputs, step_s, steps);
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
    fn(&Parameters, Brush<[f64; 4]>, &mut [State<f64>; L], &[Inputs<f64>; L], f64, usize);

macro_rules! kernels {
    ($alone:ident, $lanes:ident, $form:ty, $grows:literal) => {
        /// Of one run the four wheels make vectors.
        #[multiversion(targets("x86_64+avx+avx2"))]
        fn $alone(
            parameters: &Parameters,
            brush: Brush<[f64; 4]>,
            [state]: &mut [State<f64>; 1],
            [inputs]: &[Inputs<f64>; 1],
            step_s: f64,
            steps: usize,
        ) {
            let rate = Alone::<$form, $grows> {
                constants: &Constants::of(parameters),
                held: Held::of(parameters, inputs),
                tyres: BrushTyres::new(brush, inputs),
                form: PhantomData,
            };
            *state = rk4_steps(&rate, Wheelwise::of(state), step_s, steps).state();
        }

        /// Of several runs the runs make vectors.
        #[multiversion(targets("x86_64+avx+avx2"))]
        fn $lanes(
            parameters: &Parameters,
            brush: Brush<[f64; 4]>,
            states: &mut [State<f64>; LANES],
            inputs: &[Inputs<f64>; LANES],
            step_s: f64,
            steps: usize,
        ) {
            let rate = InLanes::<$form, $grows> {
                parameters,
                constants: &Constants::of(parameters),
                brush,
                form: PhantomData,
            };
            rk4_lanes(&rate, states, inputs, step_s, steps);
        }
    };
}

kernels!(relaxing_growing, relaxing_growing_lanes, Relaxing, true);
kernels!(
    immediate_constant,
    immediate_constant_lanes,
    Immediate,
    false
);

/// A state, or a rate, with vectors over the wheels.
#[derive(Clone, Copy)]
struct Wheelwise {
    /// Slip tangents, slip ratios and spins.
    wheels: [Together; 3],
    /// The other numbers, in order of the fields.
    body: [f64; 7],
}

impl Wheelwise {
    #[inline(always)]
    fn of(state: &State<f64>) -> Self {
        Self {
            wheels: [
                Together::of(state.slip_tangent),
                Together::of(state.slip_ratio),
                Together::of(state.wheel_speed_rad_s),
            ],
            body: [
                state.longitudinal_m_s,
                state.lateral_m_s,
                state.yaw_rate_rad_s,
                state.roll_rad,
                state.roll_rate_rad_s,
                state.pitch_rad,
                state.pitch_rate_rad_s,
            ],
        }
    }

    #[inline(always)]
    fn state(&self) -> State<f64> {
        let [u, v, r, roll, roll_rate, pitch, pitch_rate] = self.body;
        State {
            longitudinal_m_s: u,
            lateral_m_s: v,
            yaw_rate_rad_s: r,
            roll_rad: roll,
            roll_rate_rad_s: roll_rate,
            pitch_rad: pitch,
            pitch_rate_rad_s: pitch_rate,
            slip_tangent: self.wheels[0].list(),
            slip_ratio: self.wheels[1].list(),
            wheel_speed_rad_s: self.wheels[2].list(),
        }
    }
}

impl Running for Wheelwise {
    #[inline(always)]
    fn plus(&self, rate: &Self, by: f64) -> Self {
        let mut sum = *self;
        for (sum, rate) in sum.wheels.iter_mut().zip(rate.wheels) {
            *sum = *sum + rate.scaled(by);
        }
        for (sum, rate) in sum.body.iter_mut().zip(rate.body) {
            *sum += rate * by;
        }
        sum
    }
}

/// The rate of one run with brush tyres.
struct Alone<'a, F, const GROWS: bool> {
    constants: &'a Constants,
    held: Held<Together>,
    tyres: BrushTyres<Together>,
    form: PhantomData<F>,
}

impl<F: Form, const GROWS: bool> RunningRate for Alone<'_, F, GROWS> {
    type State = Wheelwise;

    #[inline(always)]
    fn rate(&self, state: &Wheelwise) -> Wheelwise {
        let (constants, held, tyres) = (self.constants, &self.held, &self.tyres);
        let rate = brush_rate::<_, F, GROWS>(constants, held, tyres, &state.state());
        Wheelwise::of(&rate)
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
        let state = State::from_array(*x);
        brush_rate::<_, F, GROWS>(self.constants, &held, &tyres, &state).to_array()
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
        steer: [0.0; 4],
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
