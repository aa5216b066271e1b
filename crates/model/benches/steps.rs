//! What one step of each chassis model costs, on one core. Run with `cargo bench -p atvrec-model`.

use std::hint::black_box;
use std::time::Instant;

use model::chassis::{four_wheel, fourteen_dof};
use model::vehicle::Vehicle;

/// Steps of one measurement.
const STEPS: u32 = 500;

/// Measurements, each shorter than a scheduler's slice, of which the best counts: the machine's
/// other work only adds.
const ROUNDS: usize = 3000;

fn measure(name: &str, mut step: impl FnMut()) {
    let best = (0..ROUNDS)
        .map(|_| {
            let begin = Instant::now();
            for _ in 0..STEPS {
                step();
            }
            begin.elapsed().as_secs_f64() / f64::from(STEPS)
        })
        .fold(f64::INFINITY, f64::min);
    println!("{name:<44} {:>9.1} ns/step", 1e9 * best);
}

fn main() -> Result<(), model::Error> {
    for name in ["prowler-table-2.3", "prowler"] {
        let parameters = four_wheel::Parameters::from_vehicle(&Vehicle::builtin(name)?);
        let mut inputs = four_wheel::Inputs::steered(0.05);
        inputs.drive_n_m = [0.0, 0.0, 5.0, 5.0];
        let start = four_wheel::State::rolling(7.0, &parameters);
        let mut state = start;
        let mut count = 0_u32;
        measure(&format!("four-wheel, RK4, {name}"), || {
            count += 1;
            if count.is_multiple_of(2000) {
                state = start;
            }
            state = four_wheel::step(&parameters, black_box(&state), &inputs, 1e-3);
        });
        let rate = four_wheel::derivative(&parameters, &state, &inputs);
        black_box(rate);
        measure(&format!("four-wheel, rate, {name}"), || {
            black_box(four_wheel::derivative(
                &parameters,
                black_box(&state),
                &inputs,
            ));
        });
    }
    let parameters = fourteen_dof::Parameters::from_vehicle(&Vehicle::builtin("prowler")?)?;
    let start = fourteen_dof::at_rest(&parameters)?.rolling(7.0, &parameters);
    let inputs = fourteen_dof::Inputs::steered(0.05);
    let mut state = start;
    let mut count = 0_u32;
    measure("14-DOF, RK4, prowler", || {
        count += 1;
        if count.is_multiple_of(2000) {
            state = start;
        }
        state = fourteen_dof::step(&parameters, black_box(&state), &inputs, 5e-4);
    });
    Ok(())
}
