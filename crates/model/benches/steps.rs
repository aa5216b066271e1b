//! What one step of each chassis model costs, on one core, alone and in a batch of 10,000 rollouts.
//! Run with `cargo bench -p atvrec-model`.

#![allow(clippy::disallowed_types, reason = "it measures time")]

use std::hint::black_box;
use std::time::Instant;

use atvrec_model::chassis::{four_wheel, fourteen_dof};
use atvrec_model::simulation::{Grid, Model, Rollout, rollouts};
use atvrec_model::vehicle::Vehicle;

/// Steps of one measurement of a single run.
const STEPS: u32 = 500;

/// Rollouts of a batch, and steps of each.
const BATCH: usize = 10_000;
const BATCH_STEPS: usize = 10;

/// Measurements, of which the best counts: the machine's other work only adds.
const ROUNDS: usize = 3000;
const BATCH_ROUNDS: usize = 60;

fn best_s(rounds: usize, mut work: impl FnMut()) -> f64 {
    (0..rounds)
        .map(|_| {
            let begin = Instant::now();
            work();
            begin.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
}

fn tell(name: &str, step_s: f64) {
    println!("{name:<44} {:>9.1} ns/step", 1e9 * step_s);
}

fn single<M: Model>(name: &str, model: &M, start: M::State, inputs: &M::Inputs, step_s: f64) {
    let mut state = start;
    let mut count = 0_u32;
    let best = best_s(ROUNDS, || {
        for _ in 0..STEPS {
            count += 1;
            if count.is_multiple_of(2000) {
                state = start;
            }
            if let Ok(next) = model.step(black_box(&state), inputs, step_s) {
                state = next;
            }
        }
    });
    tell(name, best / f64::from(STEPS));
}

fn batch<M: Model>(
    name: &str,
    model: &M,
    start: M::State,
    inputs: impl Fn(f64) -> M::Inputs,
    step_s: f64,
) -> Result<(), atvrec_model::Error> {
    let inputs: Vec<[M::Inputs; 1]> = (0..BATCH)
        .map(|run| [inputs(run as f64 / BATCH as f64)])
        .collect();
    let batch: Vec<_> = inputs
        .iter()
        .map(|inputs| Rollout {
            model,
            start,
            inputs,
        })
        .collect();
    let grid = Grid {
        step_s,
        steps: BATCH_STEPS,
        every: BATCH_STEPS,
    };
    black_box(rollouts(&batch, &grid)?);
    let best = best_s(BATCH_ROUNDS, || {
        black_box(rollouts(&batch, &grid)).ok();
    });
    tell(name, best / (BATCH * BATCH_STEPS) as f64);
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build_global()?;
    for name in ["prowler-table-2.3", "prowler"] {
        let parameters = four_wheel::Parameters::from_vehicle(&Vehicle::builtin(name)?);
        let inputs = |part: f64| {
            let mut inputs = four_wheel::Inputs::steered(0.1 * part);
            inputs.drive_n_m = [0.0, 0.0, 5.0, 5.0];
            inputs
        };
        let start = four_wheel::State::rolling(7.0, &parameters);
        let title = format!("four-wheel, RK4, {name}");
        single(&title, &parameters, start, &inputs(0.5), 1e-3);
        batch(&format!("{title}, batch"), &parameters, start, inputs, 1e-3)?;
    }
    let parameters = fourteen_dof::Parameters::from_vehicle(&Vehicle::builtin("prowler")?)?;
    let start = fourteen_dof::at_rest(&parameters)?.rolling(7.0, &parameters);
    let inputs = |part: f64| fourteen_dof::Inputs::steered(0.1 * part);
    let title = "14-DOF, RK4, prowler";
    single(title, &parameters, start, &inputs(0.5), 5e-4);
    batch(&format!("{title}, batch"), &parameters, start, inputs, 5e-4)?;
    Ok(())
}
