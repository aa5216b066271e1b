//! Steps the four-wheel model through a steer step and prints the last state, bit for bit, and the
//! time a step took: `rollout [RUNS] [STEPS]`.
//!
//! The Python tests compare the states with those of the Python package, the benchmark the times.

use std::time::Instant;

use model::chassis::four_wheel::{Inputs, Parameters, State, step};
use model::vehicle::Vehicle;

const STEP_S: f64 = 0.001;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default: usize| match arguments.next() {
        Some(text) => text.parse::<usize>(),
        None => Ok(default),
    };
    let (runs, steps) = (number(4)?, number(1_000)?);
    let parameters = Parameters::from_vehicle(&Vehicle::builtin("prowler")?);
    let mut states: Vec<State<f64>> = (0..runs)
        .map(|_| State::rolling(6.0, &parameters))
        .collect();
    let inputs: Vec<Inputs<f64>> = (0..runs)
        .map(|run| Inputs::steered(0.1 * (run as f64) / (runs as f64)))
        .collect();
    let start = Instant::now();
    for (state, inputs) in states.iter_mut().zip(&inputs) {
        for _ in 0..steps {
            *state = step(&parameters, state, inputs, STEP_S);
        }
    }
    let step_ns = start.elapsed().as_secs_f64() * 1e9 / (runs * steps) as f64;
    let rows: Vec<Vec<String>> = states
        .iter()
        .take(16)
        .map(|state| {
            let bits = state
                .to_array()
                .map(|value| format!("{:016x}", value.to_bits()));
            bits.to_vec()
        })
        .collect();
    let text = serde_json::json!({ "step_ns": step_ns, "step_s": STEP_S, "states": rows });
    println!("{text}");
    Ok(())
}
