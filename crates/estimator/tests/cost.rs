//! What a step costs: no allocation; `--nocapture` prints its time on the processor.

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

/// Time that this thread has had a processor for, s: what other processes take does not count. Linux
/// only; zero elsewhere.
fn processor_s() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanos: Option<f64> = text.split(' ').next().and_then(|part| part.parse().ok());
    nanos.unwrap_or(0.0) * 1e-9
}

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
    let mut estimator =
        Estimator::new(&vehicle, &sensors, &calibration, Settings::default()).unwrap();
    let mut steps = 0_u32;
    let mut before = 0;
    let start_s = processor_s();
    for sample in &samples {
        estimator.advance(sample.log_time, &mut |output| {
            steps += u32::from(matches!(output, Output::Estimate(_)));
        });
        if steps < 100 {
            before = ALLOCATIONS.load(Ordering::Relaxed);
        }
        estimator.push(sample);
    }
    let allocations = ALLOCATIONS.load(Ordering::Relaxed) - before;
    let took_s = processor_s() - start_s;
    eprintln!(
        "{steps} steps, {:.1} us each",
        1e6 * took_s / f64::from(steps)
    );
    assert!(steps > 1000);
    assert_eq!(allocations, 0);
}
