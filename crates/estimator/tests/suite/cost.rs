//! What a step costs: no allocation; `--nocapture` prints its time.

#![allow(clippy::disallowed_types, reason = "it measures time")]
use std::time::Instant;

use atvrec_estimator::{Calibration, Estimator, Method, Output, Settings};
use model::sensors::Sensors;
use sample::Sample;
use testkit::{allocations, truth};

/// How often the run is made: the quickest tells what a step takes where nothing else runs.
const ROUNDS: usize = 21;

#[test]
fn a_step_allocates_nothing() {
    let vehicle = truth::vehicle();
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let samples = truth::excerpt("c_sine03").samples("thesis-10bit", 1);
    let calibration = Calibration::nominal(&vehicle.name);
    // By turns, so that both see the same machine.
    let mut took_us = [Vec::new(), Vec::new()];
    for _ in 0..ROUNDS {
        for (method, took_us) in [Method::Fusion, Method::Thesis]
            .into_iter()
            .zip(&mut took_us)
        {
            let settings = Settings {
                method,
                ..Settings::default()
            };
            let estimator = Estimator::new(vehicle, &sensors, &calibration, settings).unwrap();
            took_us.push(microseconds_a_step(estimator, samples));
        }
    }
    let [fusion, thesis] = took_us.map(|mut all| {
        all.sort_by(f64::total_cmp);
        [all[0], all[ROUNDS / 2]]
    });
    eprintln!(
        "microseconds a step: {:.1} in the quickest of {ROUNDS} rounds, {:.1} in the median; {:.1} and \
         {:.1} with statics in the place of the filter of forces",
        fusion[0], fusion[1], thesis[0], thesis[1]
    );
}

/// Time of one step over a run's samples, of which none but the first may allocate.
fn microseconds_a_step(mut estimator: Estimator, samples: &[Sample]) -> f64 {
    let mut steps = 0_u32;
    let mut before = 0;
    let start = Instant::now();
    for sample in samples {
        estimator.advance(sample.log_time, &mut |output| {
            steps += u32::from(matches!(output, Output::Estimate(_)));
        });
        if steps < 100 {
            before = allocations();
        }
        estimator.push(sample);
    }
    let took = start.elapsed();
    assert!(steps > 1000);
    assert_eq!(allocations(), before);
    1e6 * took.as_secs_f64() / f64::from(steps)
}
