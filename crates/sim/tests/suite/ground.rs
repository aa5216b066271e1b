//! The wheels of truth files on their ground, and the two frames of their forces.

use std::path::{Path, PathBuf};

use atvrec_sim::Motion;
use sample::{ForceFrame, Wheel};
use testkit::truth::{Run, excerpt_path};

use crate::support;

/// Largest difference between a force resolved here and by the simulator, N or N m, beside the rounding
/// of the simulator's columns to 32 bits.
const DIFFERENCE_MAX: f64 = 1e-3;
/// The same of an excerpt, whose directions are rounded to 1e-4, N.
const EXCERPT_MAX_N: f64 = 0.5;

/// Largest difference between two vectors, in units of the rounding to 32 bits beyond `free`.
fn beyond(found: [f64; 3], told: [f64; 3], free: f64) -> f64 {
    let size = told.iter().map(|part| part * part).sum::<f64>().sqrt();
    let parts = found.into_iter().zip(told);
    let largest = parts.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    largest / (free + size * f64::from(f32::EPSILON))
}

/// The truth files of a folder of the shared data, if they are there. Those at 1 kHz have no contact
/// forces.
fn files(folder: &str) -> Vec<PathBuf> {
    let Some(folder) = testkit::shared(&format!("data/{folder}")) else {
        return Vec::new();
    };
    let all = std::fs::read_dir(folder).expect("a folder");
    let paths = all.map(|entry| entry.expect("an entry").path());
    paths
        .filter(|path| path.extension().is_some_and(|end| end == "parquet"))
        .filter(|path| !path.to_string_lossy().contains("1khz"))
        .collect()
}

/// Largest difference between the contact forces of a file and those that the ground gives, parts of
/// what is allowed.
fn contact_difference(path: &Path, free_n: f64) -> f64 {
    let motion = Motion::open(path).expect("a truth file");
    let mut worst: f64 = 0.0;
    for wheel in motion.states().iter().flat_map(|state| &state.wheels.0) {
        let ground = wheel.ground.expect("the wheel's ground");
        let found = ground.force_n(ForceFrame::Contact);
        worst = worst.max(beyond(found, wheel.force_n, free_n));
    }
    worst
}

#[test]
fn chassis_forces_resolve_to_the_contact_frame() {
    for path in files("truth-rough").iter().chain(&files("truth-second")) {
        let worst = contact_difference(path, DIFFERENCE_MAX);
        assert!(worst < 1.0, "{}: {worst}", path.display());
    }
    for name in ["r2_iso_e_a", "r6_jump", "r8_trail_a"] {
        let worst = contact_difference(&excerpt_path(name), EXCERPT_MAX_N);
        assert!(worst < 1.0, "{name}: {worst}");
    }
}

/// The second vehicle's simulator tells force and moment in the wheel-carrier frame, too.
#[test]
fn chassis_forces_resolve_to_the_wheel_carrier_frame() {
    for path in files("truth-second") {
        let motion = Motion::open(&path).expect("a truth file");
        let run = Run::read(&path);
        let (mut force, mut moment): (f64, f64) = (0.0, 0.0);
        for (row, state) in motion.states().iter().enumerate() {
            for wheel in Wheel::ALL {
                let ground = state.wheels[wheel].ground.expect("the wheel's ground");
                let told = |stem: &str| {
                    ["x", "y", "z"].map(|axis| run.column(&format!("{wheel}_{stem}_{axis}"))[row])
                };
                let carrier = ForceFrame::WheelCarrier;
                let found = ground.force_n(carrier);
                force = force.max(beyond(found, told("Fcar"), DIFFERENCE_MAX));
                let found = ground.moment_n_m(carrier).expect("a moment");
                moment = moment.max(beyond(found, told("Mcar"), DIFFERENCE_MAX));
            }
        }
        assert!(force < 1.0, "{}: {force}", path.display());
        assert!(moment < 1.0, "{}: {moment}", path.display());
    }
}

/// Largest angle between the spindle of a flat run's columns and that of the linkage, rad.
const SPINDLE_MAX_RAD: f64 = 2e-3;

/// On flat ground the normal is the vertical. A run without steer and camber has its spindles from the
/// linkage.
#[test]
fn a_flat_run_has_the_vertical_as_its_normal() {
    let Some(path) = testkit::shared("data/truth/c_sine03.parquet") else {
        return;
    };
    let told = Motion::open(&path).expect("a truth file");
    let mut stripped = told.states()[2000..2400].to_vec();
    for wheel in stripped.iter_mut().flat_map(|state| &mut state.wheels.0) {
        wheel.ground = None;
    }
    let mut found = Motion::new("stripped", stripped).expect("a motion");
    found.complete(&support::vehicle()).expect("a linkage");
    let mut worst: f64 = 0.0;
    for (told, found) in told.states()[2000..2400].iter().zip(found.states()) {
        for wheel in Wheel::ALL {
            let [told_on, found_on] =
                [told, found].map(|state| state.wheels[wheel].ground.expect("ground"));
            let up: [f64; 3] = told.up_body().into();
            assert_eq!(told_on.normal_body, up);
            let spindles = told_on.spindle_body.into_iter().zip(found_on.spindle_body);
            worst = spindles.map(|(a, b)| (a - b).abs()).fold(worst, f64::max);
            let loads = told_on.force_body_n.into_iter().zip(found_on.force_body_n);
            for (a, b) in loads {
                assert!((a - b).abs() < 5.0, "{wheel}: {a} {b} N");
            }
        }
    }
    eprintln!("spindles: {worst:.2e} rad");
    assert!(worst < SPINDLE_MAX_RAD, "{worst} rad");
}
