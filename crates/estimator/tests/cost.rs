//! What a step costs: no allocation; `--nocapture` prints its time.

#![allow(clippy::disallowed_types, reason = "it measures time")]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's helpers stand outside its functions"
)]

#[path = "truth/run.rs"]
mod run;
#[path = "truth/sensing.rs"]
mod sensing;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use atvrec_estimator::{Calibration, Estimator, Method, Output, Settings};
use model::sensors::Sensors;
use run::Run;
use sample::Sample;

struct Counting;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

// SAFETY: every call goes to the system's allocator as it came.
#[allow(unsafe_code, reason = "an allocator that counts cannot be had without")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's contract is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's contract is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// How often the run is made: the quickest tells what a step takes where nothing else runs.
const ROUNDS: usize = 21;

#[test]
fn a_step_allocates_nothing() {
    if run::directory().is_none() {
        return;
    }
    let vehicle = run::vehicle();
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let run = Run::load("c_sine03");
    let samples = sensing::samples(&run, &vehicle, &sensors, 1);
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
            let estimator = Estimator::new(&vehicle, &sensors, &calibration, settings).unwrap();
            took_us.push(microseconds_a_step(estimator, &samples));
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
            before = ALLOCATIONS.load(Ordering::Relaxed);
        }
        estimator.push(sample);
    }
    let took = start.elapsed();
    assert!(steps > 1000);
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), before);
    1e6 * took.as_secs_f64() / f64::from(steps)
}
