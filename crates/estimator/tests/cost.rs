//! What a step costs: no allocation; `--nocapture` prints its time.

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

use estimator::{Calibration, Estimator, Output, Settings};
use model::sensors::Sensors;
use run::Run;

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
    let mut took_us: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let mut estimator =
                Estimator::new(&vehicle, &sensors, &calibration, Settings::default()).unwrap();
            let mut steps = 0_u32;
            let mut before = 0;
            let start = Instant::now();
            for sample in &samples {
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
        })
        .collect();
    took_us.sort_by(f64::total_cmp);
    eprintln!(
        "microseconds a step: {:.1} in the quickest of {ROUNDS} rounds, {:.1} in the median",
        took_us[0],
        took_us[ROUNDS / 2]
    );
}
