//! Simulation: trajectories, batches of them on all cores, and events of lifting wheels.

use rayon::prelude::*;

use sample::Wheel;

use crate::Error;
use crate::chassis::{bicycle, four_wheel, fourteen_dof};
use crate::error::require;
use crate::integrate::{LANES, step_to_event};

/// A chassis model that steps.
pub trait Model: Sync {
    /// Its state.
    type State: Copy + Send + Sync;
    /// Its inputs.
    type Inputs: Copy + Send + Sync;

    /// Refuses numbers that are not finite or out of range, by name.
    ///
    /// # Errors
    /// [`Error::Argument`] with the first of them.
    fn check_state(state: &Self::State) -> Result<(), Error>;

    /// The same of inputs.
    ///
    /// # Errors
    /// [`Error::Argument`] with the first of them.
    fn check_inputs(inputs: &Self::Inputs) -> Result<(), Error>;

    /// One step of the classical fourth-order Runge-Kutta rule with inputs held. Allocates nothing.
    ///
    /// # Errors
    /// [`Error::Argument`] where a number of the state or the inputs is not finite or out of range,
    /// or the step is not above zero.
    #[inline]
    fn step(
        &self,
        state: &Self::State,
        inputs: &Self::Inputs,
        step_s: f64,
    ) -> Result<Self::State, Error> {
        check_step(step_s)?;
        Self::check_state(state)?;
        Self::check_inputs(inputs)?;
        Ok(self.steps(state, inputs, step_s, 1))
    }

    /// Steps with inputs held, of numbers that were checked before.
    fn steps(
        &self,
        state: &Self::State,
        inputs: &Self::Inputs,
        step_s: f64,
        steps: usize,
    ) -> Self::State;

    /// The same of runs side by side, each to the bits of [`Model::steps`].
    fn advance(
        &self,
        states: &mut [Self::State; LANES],
        inputs: &[Self::Inputs; LANES],
        step_s: f64,
        steps: usize,
    );
}

fn check_step(step_s: f64) -> Result<(), Error> {
    require(step_s > 0.0, "step_s", step_s, "s", "greater than 0")
}

macro_rules! chassis_model {
    ($chassis:ident::$model:ident, $state:ty, $inputs:ty, $check_state:path, $check_inputs:path) => {
        impl Model for $chassis::$model {
            type State = $state;
            type Inputs = $inputs;

            #[inline]
            fn check_state(state: &Self::State) -> Result<(), Error> {
                $check_state(state)
            }

            #[inline]
            fn check_inputs(inputs: &Self::Inputs) -> Result<(), Error> {
                $check_inputs(inputs)
            }

            #[inline]
            fn steps(
                &self,
                state: &Self::State,
                inputs: &Self::Inputs,
                step_s: f64,
                steps: usize,
            ) -> Self::State {
                $chassis::stepped(self, state, inputs, step_s, steps)
            }

            fn advance(
                &self,
                states: &mut [Self::State; LANES],
                inputs: &[Self::Inputs; LANES],
                step_s: f64,
                steps: usize,
            ) {
                $chassis::advance(self, states, inputs, step_s, steps);
            }
        }
    };
}

// The linear bicycle at one speed: (beta, r) in rad and rad/s, steered by an angle in rad.
chassis_model!(
    bicycle::StateSpace,
    [f64; 2],
    f64,
    bicycle::check_state,
    bicycle::check_steer
);
chassis_model!(
    four_wheel::Parameters,
    four_wheel::State<f64>,
    four_wheel::Inputs<f64>,
    four_wheel::State::check,
    four_wheel::Inputs::check
);
chassis_model!(
    fourteen_dof::Parameters,
    fourteen_dof::State<f64>,
    fourteen_dof::Inputs<f64>,
    fourteen_dof::State::check,
    fourteen_dof::Inputs::check
);

/// One trajectory of a batch.
#[derive(Clone, Copy, Debug)]
pub struct Rollout<'a, M: Model> {
    /// The model with its parameters.
    pub model: &'a M,
    /// Where it starts.
    pub start: M::State,
    /// Inputs, one for each step; the last is held on.
    pub inputs: &'a [M::Inputs],
}

/// Time grid of a simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Step, s.
    pub step_s: f64,
    /// Number of steps.
    pub steps: usize,
    /// Every how many steps a state is kept; the start is kept too.
    pub every: usize,
}

impl Grid {
    /// States kept of one trajectory, the start included.
    #[must_use]
    pub fn kept(&self) -> usize {
        self.steps / self.every.max(1) + 1
    }

    fn check(&self) -> Result<(), Error> {
        check_step(self.step_s)?;
        require(
            self.every > 0,
            "every",
            self.every as f64,
            "steps",
            "1 or more",
        )
    }
}

/// Runs up to [`LANES`] trajectories of one model side by side.
///
/// `inputs_at` gives the inputs of a run (counted from zero) at a step; they are held from step
/// `held_from` on. `keep` sees every run's start as number 0 and then every `grid.every`-th state.
pub fn side_by_side<M: Model>(
    model: &M,
    starts: &[M::State],
    grid: &Grid,
    held_from: usize,
    inputs_at: impl Fn(usize, usize) -> M::Inputs,
    mut keep: impl FnMut(usize, usize, &M::State),
) {
    let Some(last) = starts.len().checked_sub(1) else {
        return;
    };
    // Lanes without a run repeat the last one.
    let mut states: [M::State; LANES] = std::array::from_fn(|lane| starts[lane.min(last)]);
    let mut tell = |states: &[M::State; LANES], number| {
        for (run, state) in states.iter().enumerate().take(last + 1) {
            keep(run, number, state);
        }
    };
    tell(&states, 0);
    let mut done = 0;
    while done < grid.steps {
        let inputs: [M::Inputs; LANES] =
            std::array::from_fn(|lane| inputs_at(lane.min(last), done));
        let next_kept = (done / grid.every + 1) * grid.every;
        let stretch = if done < held_from {
            1
        } else {
            next_kept.min(grid.steps) - done
        };
        if last == 0 {
            states[0] = model.steps(&states[0], &inputs[0], grid.step_s, stretch);
        } else {
            model.advance(&mut states, &inputs, grid.step_s, stretch);
        }
        done += stretch;
        if done == next_kept {
            tell(&states, done / grid.every);
        }
    }
}

/// Runs trajectories on all cores, those that share a model side by side; the result is the same on
/// any number of cores, and that of [`Model::steps`]. Row i of the answer, [`Grid::kept`] states
/// long, is trajectory i.
///
/// # Errors
/// Where the grid is not positive, a trajectory has no inputs, or a number is not finite or out of
/// range.
pub fn rollouts<M: Model>(batch: &[Rollout<'_, M>], grid: &Grid) -> Result<Vec<M::State>, Error> {
    grid.check()?;
    for rollout in batch {
        let count = rollout.inputs.len();
        require(count > 0, "number of inputs", count as f64, "", "1 or more")?;
        M::check_state(&rollout.start)?;
        rollout.inputs.iter().try_for_each(M::check_inputs)?;
    }
    let Some(first) = batch.first() else {
        return Ok(Vec::new());
    };
    let kept = grid.kept();
    let mut all = vec![first.start; kept * batch.len()];
    all.par_chunks_mut(kept * LANES)
        .zip(batch.par_chunks(LANES))
        .for_each(|(rows, group)| {
            let alike = group
                .iter()
                .all(|rollout| std::ptr::eq(rollout.model, group[0].model));
            let size = if alike { LANES } else { 1 };
            for (rows, group) in rows.chunks_mut(kept * size).zip(group.chunks(size)) {
                run_group(group, grid, rows);
            }
        });
    Ok(all)
}

/// Runs trajectories of one model side by side into `rows`, [`Grid::kept`] states for each.
fn run_group<M: Model>(group: &[Rollout<'_, M>], grid: &Grid, rows: &mut [M::State]) {
    let kept = grid.kept();
    let starts: [M::State; LANES] =
        std::array::from_fn(|lane| group[lane.min(group.len() - 1)].start);
    let held_from = group.iter().map(|rollout| rollout.inputs.len() - 1).max();
    side_by_side(
        group[0].model,
        &starts[..group.len()],
        grid,
        held_from.unwrap_or(0),
        |run, step| {
            let inputs = group[run].inputs;
            inputs[step.min(inputs.len() - 1)]
        },
        |run, number, state| rows[run * kept + number] = *state,
    );
}

/// What happened to a wheel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContactChange {
    /// The tyre left the ground.
    LiftOff,
    /// The tyre met the ground again.
    TouchDown,
    /// The strut met its droop stop.
    DroopStop,
    /// The strut left its droop stop.
    DroopFree,
    /// The strut met its bump stop.
    BumpStop,
    /// The strut left its bump stop.
    BumpFree,
}

/// A change of contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactEvent {
    /// When, s from the start.
    pub time_s: f64,
    /// Which wheel.
    pub wheel: Wheel,
    /// What.
    pub change: ContactChange,
}

/// Runs the 14-degree-of-freedom model for a duration with inputs of time, locating each change of
/// contact by bisection and going on from it. `observe` sees time and state after every step.
///
/// # Errors
/// [`Error::Argument`] where the start, the inputs, the step or the duration are not finite or out
/// of range.
pub fn with_events(
    parameters: &fourteen_dof::Parameters,
    start: &fourteen_dof::State<f64>,
    duration_s: f64,
    step_s: f64,
    inputs: impl Fn(f64) -> fourteen_dof::Inputs<f64>,
    mut observe: impl FnMut(f64, &fourteen_dof::State<f64>),
) -> Result<(fourteen_dof::State<f64>, Vec<ContactEvent>), Error> {
    type State = fourteen_dof::State<f64>;
    start.check()?;
    check_step(step_s)?;
    require(
        duration_s >= 0.0,
        "duration_s",
        duration_s,
        "s",
        "0 or greater",
    )?;
    let (mut time, mut state) = (0.0, *start);
    let mut events = Vec::new();
    while duration_s - time > 1e-9 {
        let held = inputs(time);
        held.check()?;
        let advance = step_to_event(
            &state.to_array(),
            step_s.min(duration_s - time),
            |x, h| {
                let state = State::from_array(*x);
                fourteen_dof::stepped(parameters, &state, &held, h, 1).to_array()
            },
            |x| fourteen_dof::guards(parameters, &State::from_array(*x), &held),
        );
        time += advance.taken_s;
        state = State::from_array(advance.state);
        for (guard, rose) in advance.changes.into_iter().enumerate() {
            let Some(rose) = rose else { continue };
            events.push(ContactEvent {
                time_s: time,
                wheel: Wheel::ALL[guard % 4],
                change: change(guard / 4, rose),
            });
        }
        observe(time, &state);
    }
    Ok((state, events))
}

/// Guards of [`fourteen_dof::guards`] come in three groups of four.
fn change(group: usize, rose: bool) -> ContactChange {
    match (group, rose) {
        (0, true) => ContactChange::TouchDown,
        (0, false) => ContactChange::LiftOff,
        (1, true) => ContactChange::DroopStop,
        (1, false) => ContactChange::DroopFree,
        (_, true) => ContactChange::BumpStop,
        (_, false) => ContactChange::BumpFree,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrate::{Tolerance, adaptive};
    use crate::vehicle::Vehicle;

    fn prowler() -> fourteen_dof::Parameters {
        fourteen_dof::Parameters::from_vehicle(&Vehicle::builtin("prowler").unwrap()).unwrap()
    }

    #[test]
    fn a_batch_gives_the_bits_of_single_runs() {
        let vehicle = Vehicle::builtin("prowler").unwrap();
        let models: Vec<_> = (0..20)
            .map(|k| {
                let mut p = four_wheel::Parameters::from_vehicle(&vehicle);
                p.mass_kg *= 1.0 + 0.01 * f64::from(k);
                p.prepare();
                p
            })
            .collect();
        let inputs = [
            four_wheel::Inputs::steered(0.05),
            four_wheel::Inputs::steered(0.1),
        ];
        let batch: Vec<_> = models
            .iter()
            .map(|model| Rollout {
                model,
                start: four_wheel::State::rolling(6.0, model),
                inputs: &inputs,
            })
            .collect();
        let grid = Grid {
            step_s: 1e-3,
            steps: 50,
            every: 10,
        };
        let kept = rollouts(&batch, &grid).unwrap();
        assert_eq!(kept.len(), 20 * 6);
        for (row, rollout) in kept.chunks(6).zip(&batch) {
            let mut state = rollout.start;
            for index in 0..50 {
                state = (rollout.model.step(&state, &inputs[index.min(1)], 1e-3)).unwrap();
            }
            assert_eq!(row[5], state);
        }
    }

    /// Runs of one model with inputs of their own, over every vehicle: the vector kernels.
    fn side_by_side_is_alone<M: Model<State: PartialEq + std::fmt::Debug>>(
        model: &M,
        start: impl Fn(f64) -> M::State,
        inputs: impl Fn(f64) -> M::Inputs,
    ) {
        let lists: Vec<[M::Inputs; 3]> = (0..13)
            .map(|run| std::array::from_fn(|k| inputs(f64::from(run) - 6.0 + 0.1 * k as f64)))
            .collect();
        let batch: Vec<_> = lists
            .iter()
            .enumerate()
            .map(|(run, inputs)| Rollout {
                model,
                start: start(1.0 + run as f64),
                inputs: if run % 2 == 0 { inputs } else { &inputs[..1] },
            })
            .collect();
        let grid = Grid {
            step_s: 1e-3,
            steps: 60,
            every: 7,
        };
        let kept = rollouts(&batch, &grid).unwrap();
        for (row, rollout) in kept.chunks(grid.kept()).zip(&batch) {
            let mut state = rollout.start;
            assert_eq!(row[0], state);
            for step in 0..60 {
                let inputs = &rollout.inputs[step.min(rollout.inputs.len() - 1)];
                state = model.step(&state, inputs, 1e-3).unwrap();
                if (step + 1) % 7 == 0 {
                    assert_eq!(row[(step + 1) / 7], state);
                }
            }
        }
    }

    #[test]
    fn vector_kernels_give_the_bits_of_single_steps_for_every_vehicle() {
        for name in Vehicle::builtin_names() {
            let vehicle = Vehicle::builtin(name).unwrap();
            let p = four_wheel::Parameters::from_vehicle(&vehicle);
            let inputs = |k: f64| {
                let mut inputs = four_wheel::Inputs::steered(0.05 * k);
                inputs.brake_n_m = [10.0 * k.abs(); 4];
                inputs.bank_rad = 0.02 * k;
                inputs.friction_scale = [1.0 - 0.1 * k.abs(); 4];
                inputs
            };
            side_by_side_is_alone(&p, |v| four_wheel::State::rolling(v, &p), inputs);
            let mut odd = p.clone();
            odd.front.roll_steer = 0.1;
            odd.prepare();
            side_by_side_is_alone(&odd, |v| four_wheel::State::rolling(v, &odd), inputs);
            let Ok(p) = fourteen_dof::Parameters::from_vehicle(&vehicle) else {
                continue;
            };
            let rest = fourteen_dof::at_rest(&p).unwrap();
            side_by_side_is_alone(
                &p,
                |v| {
                    let mut state = rest.rolling(v, &p);
                    state.position_m[2] += 0.02 * (v - 4.0);
                    state
                },
                |k| {
                    let mut inputs = fourteen_dof::Inputs::steered(0.05 * k);
                    inputs.brake_n_m = [10.0 * k.abs(); 4];
                    inputs.grade_rad = 0.02 * k;
                    inputs
                },
            );
        }
    }

    #[test]
    fn a_dropped_vehicle_touches_down_and_a_hard_turn_lifts_a_wheel() {
        let p = prowler();
        let mut start = fourteen_dof::at_rest(&p).unwrap();
        let rest = fourteen_dof::outputs(&p, &start, &fourteen_dof::Inputs::coasting());
        let press = rest.deflection_m[0].max(rest.deflection_m[2]);
        start.position_m[2] += press + 0.05;
        let still = |_| fourteen_dof::Inputs::coasting();
        let (_, events) = with_events(&p, &start, 0.5, 1e-3, still, |_, _| {}).unwrap();
        let landed = events
            .iter()
            .filter(|event| event.change == ContactChange::TouchDown)
            .count();
        assert!(landed >= 4, "{events:?}");

        let fast = fourteen_dof::at_rest(&p).unwrap().rolling(12.0, &p);
        let turn = |_| {
            let mut inputs = fourteen_dof::Inputs::steered(0.35);
            inputs.friction_scale = [1.4; 4];
            inputs
        };
        let (_, events) = with_events(&p, &fast, 1.0, 1e-3, turn, |_, _| {}).unwrap();
        let lifted = events
            .iter()
            .find(|event| event.change == ContactChange::LiftOff)
            .unwrap();
        assert!(lifted.wheel.is_left(), "{events:?}");
        let (_, finer) = with_events(&p, &fast, 1.0, 2.5e-4, turn, |_, _| {}).unwrap();
        let again = finer
            .iter()
            .find(|event| event.change == ContactChange::LiftOff)
            .unwrap();
        assert!(
            (again.time_s - lifted.time_s).abs() < 1e-5,
            "{lifted:?} {again:?}"
        );
    }

    #[test]
    fn bad_numbers_are_named_with_value_and_unit() {
        let p = prowler();
        let start = fourteen_dof::at_rest(&p).unwrap();
        let still = fourteen_dof::Inputs::coasting();
        let grid = Grid {
            step_s: 1e-3,
            steps: 2,
            every: 1,
        };
        let refusal = |start, inputs| {
            let rollout = Rollout {
                model: &p,
                start,
                inputs: &[still, inputs],
            };
            rollouts(&[rollout], &grid).unwrap_err().to_string()
        };
        let mut lost = start;
        lost.velocity_m_s[1] = f64::NAN;
        let said = refusal(lost, still);
        assert_eq!(said, "state.velocity_m_s = NaN m/s: must be finite");
        let mut pushing = still;
        pushing.brake_n_m[2] = -5.0;
        let said = refusal(start, pushing);
        assert_eq!(said, "inputs.brake_n_m = -5 N m: must be 0 or greater");
        assert!(with_events(&p, &lost, 0.1, 1e-3, |_| still, |_, _| {}).is_err());
        let late = |time_s: f64| if time_s < 0.05 { still } else { pushing };
        assert!(with_events(&p, &start, 0.1, 1e-3, late, |_, _| {}).is_err());
        single_steps_say_what_is_wrong(&p, &start, &still);

        let p = four_wheel::Parameters::from_vehicle(&Vehicle::builtin("prowler").unwrap());
        let mut state = four_wheel::State::rolling(5.0, &p);
        state.yaw_rate_rad_s = f64::INFINITY;
        let mut inputs = four_wheel::Inputs::coasting();
        let said = p.step(&state, &inputs, 1e-3).unwrap_err().to_string();
        assert_eq!(said, "state.yaw_rate_rad_s = inf rad/s: must be finite");
        state.yaw_rate_rad_s = 0.0;
        single_steps_say_what_is_wrong(&p, &state, &inputs);
        inputs.friction_scale[3] = -1.0;
        let said = p.step(&state, &inputs, 1e-3).unwrap_err().to_string();
        assert_eq!(said, "inputs.friction_scale = -1 : must be 0 or greater");
        let bicycle = bicycle::Bicycle::from_vehicle(&Vehicle::builtin("prowler").unwrap());
        let system = bicycle.system(5.0).unwrap();
        let said = system.step(&[0.0, f64::NAN], &0.0, 1e-3).unwrap_err();
        assert_eq!(
            said.to_string(),
            "state.yaw_rate_rad_s = NaN rad/s: must be finite"
        );
        single_steps_say_what_is_wrong(&system, &[0.0; 2], &0.0);
    }

    /// Of good numbers a step is refused by its length only.
    fn single_steps_say_what_is_wrong<M: Model<State: std::fmt::Debug>>(
        model: &M,
        state: &M::State,
        inputs: &M::Inputs,
    ) {
        for step_s in [0.0, -1e-3, f64::NAN, f64::INFINITY] {
            let said = model.step(state, inputs, step_s).unwrap_err().to_string();
            let expected = format!("step_s = {step_s} s: must be greater than 0");
            assert_eq!(said, expected);
        }
        assert!(model.step(state, inputs, 1e-3).is_ok());
    }

    #[test]
    fn adaptive_and_fixed_steps_meet() {
        let p = prowler();
        let start = fourteen_dof::at_rest(&p).unwrap().rolling(6.0, &p);
        let inputs = fourteen_dof::Inputs::steered(0.05);
        let limits = Tolerance::default();
        let rate = |_: f64, x: &[f64; fourteen_dof::STATES]| {
            let state = fourteen_dof::State::from_array(*x);
            fourteen_dof::derivative(&p, &state, &inputs).to_array()
        };
        let free = adaptive(&start.to_array(), 0.0, 0.5, &limits, rate, |_, _| {}).unwrap();
        let mut fixed = start;
        for _ in 0..5000 {
            fixed = p.step(&fixed, &inputs, 1e-4).unwrap();
        }
        for (a, b) in free.into_iter().zip(fixed.to_array()) {
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
    }

    #[test]
    fn a_grid_without_a_step_is_refused() {
        let p = prowler();
        let batch = [Rollout {
            model: &p,
            start: fourteen_dof::State::zero(),
            inputs: &[],
        }];
        let grid = Grid {
            step_s: 1e-3,
            steps: 1,
            every: 1,
        };
        assert!(rollouts(&batch, &grid).is_err());
        assert!(
            rollouts(
                &batch,
                &Grid {
                    step_s: 0.0,
                    ..grid
                }
            )
            .is_err()
        );
    }
}
