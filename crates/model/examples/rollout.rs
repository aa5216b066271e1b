//! Steps a batch of each chassis model through a steer step and prints the last states, bit for
//! bit, and the time that a step took, of all cores that rayon may use:
//! `rollout [RUNS] [STEPS] [ROUNDS]`.
//!
//! The Python tests compare the states with those of the Python package, the benchmark the times.

#![allow(
    clippy::disallowed_types,
    clippy::disallowed_methods,
    reason = "it measures time and takes arguments"
)]

use std::time::Instant;

use atvrec_model::chassis::{bicycle::Bicycle, four_wheel, fourteen_dof};
use atvrec_model::simulation::{Grid, Model, Rollout, rollouts};
use atvrec_model::vehicle::Vehicle;

const STEP_S: f64 = 0.001;

/// Last states of a batch, and the shortest time of a step in some rounds, ns.
fn run<M: Model>(
    model: &M,
    start: M::State,
    inputs: impl Fn(f64) -> M::Inputs,
    [runs, steps, rounds]: [usize; 3],
    step_s: f64,
) -> Result<(Vec<M::State>, f64), atvrec_model::Error> {
    let inputs: Vec<[M::Inputs; 1]> = (0..runs)
        .map(|run| [inputs(0.1 * (run as f64) / (runs as f64))])
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
        steps,
        every: steps,
    };
    let (mut kept, mut best_ns) = (Vec::new(), f64::INFINITY);
    for _ in 0..rounds {
        let begin = Instant::now();
        kept = rollouts(&batch, &grid)?;
        let step_ns = begin.elapsed().as_secs_f64() * 1e9 / (runs * steps) as f64;
        best_ns = best_ns.min(step_ns);
    }
    let last = kept.chunks(grid.kept()).map(|states| states[1]);
    Ok((last.take(16).collect(), best_ns))
}

fn bits<const N: usize>(state: [f64; N]) -> Vec<String> {
    state
        .map(|value| format!("{:016x}", value.to_bits()))
        .into()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default: usize| match arguments.next() {
        Some(text) => text.parse::<usize>(),
        None => Ok(default),
    };
    let size = [number(4)?, number(1_000)?, number(1)?];
    let vehicle = Vehicle::builtin("prowler")?;
    let parameters = four_wheel::Parameters::from_vehicle(&vehicle);
    let start = four_wheel::State::rolling(6.0, &parameters);
    let (four, step_ns) = run(
        &parameters,
        start,
        four_wheel::Inputs::steered,
        size,
        STEP_S,
    )?;
    let parameters = fourteen_dof::Parameters::from_vehicle(&vehicle)?;
    let start = fourteen_dof::at_rest(&parameters)?.rolling(6.0, &parameters);
    let inputs = fourteen_dof::Inputs::steered;
    let (fourteen, fourteen_ns) = run(&parameters, start, inputs, size, 0.5 * STEP_S)?;
    let bicycle = Bicycle::from_vehicle(&vehicle).system(6.0)?;
    let (_, bicycle_ns) = run(&bicycle, [0.0; 2], |steer| steer, size, STEP_S)?;
    let text = serde_json::json!({
        "step_s": STEP_S,
        "step_ns": step_ns,
        "bicycle_step_ns": bicycle_ns,
        "states": four.iter().map(|state| bits(state.to_array())).collect::<Vec<_>>(),
        "fourteen_dof_step_ns": fourteen_ns,
        "fourteen_dof": fourteen.iter().map(|state| bits(state.to_array())).collect::<Vec<_>>(),
    });
    println!("{text}");
    Ok(())
}
