//! The accuracy that the documents state, on the excerpts of truth runs that every clone of the
//! project has. Each test prints file, sensors file, error and limit. `truth.rs` tests the whole runs.

use atvrec_estimator::{Calibration, Input, Settings};
use model::sensors::Sensors;
use sample::{EventKind, Wheel};
use testkit::report;
use testkit::scoring::{
    Estimated, carrier_errors, carrier_squares, estimate, force_errors, motion_errors,
};
use testkit::sensing;
use testkit::truth::{self, Run};

use crate::RUNS;

/// Seed of the sensors' noise, one of those for scoring.
const SEED: u64 = 1;

/// Largest RMSE of sideslip above 3 m/s, of roll and of pitch, degrees.
const MOTION_MAX_DEG: [f64; 3] = [0.2, 0.2, 0.2];
/// When the front right wheel's load falls below 2 % of its static load in `b_circle`, s.
const LIFT_S: f64 = 51.935;
/// How long before the lift a warning must come, s.
const WARNING_S: f64 = 0.8;
/// When the front axle comes onto the slippery ground in `d_sine_mu`, and the latest report of it, s.
const SURFACE_S: f64 = 24.0;
const SURFACE_WITHIN_S: f64 = 1.0;

fn estimated(run: &'static Run, sensors: &str) -> Estimated {
    estimated_with(run, sensors, Settings::default())
}

fn estimated_with(run: &'static Run, sensors: &str, settings: Settings) -> Estimated {
    let vehicle = truth::vehicle();
    let samples = run.samples(sensors, SEED);
    let calibration = Calibration::nominal(&vehicle.name);
    let sensors = Sensors::builtin(sensors).unwrap();
    estimate(vehicle, &sensors, &calibration, settings, samples)
}

/// Compares three errors with their limits, and prints them.
fn compare(what: &str, names: [&str; 3], unit: &str, found: [f64; 3], most: [f64; 3]) {
    let texts: [String; 3] =
        std::array::from_fn(|i| format!("{} {:.3} (at most {})", names[i], found[i], most[i]));
    report(&format!("{what}: {} {unit}", texts.join(", ")));
    for (error, most) in found.into_iter().zip(most) {
        assert!(error <= most, "{what}: {found:?} {unit}, at most {most:?}");
    }
}

/// Holds the errors of the forces (F_x, F_y, F_z, per cent, worst tyre) below `force_max` on each run.
fn judge(sensors: &str, force_max: [f64; 3], lift_within_s: f64) {
    for name in RUNS {
        let run = truth::excerpt(name);
        let result = estimated(run, sensors);
        let what = format!("testdata/truth/{name}.parquet, {sensors}");
        let force = force_errors(run, truth::vehicle(), &result);
        compare(&what, ["F_x", "F_y", "F_z"], "%", force, force_max);
        let motion = motion_errors(run, &result);
        let names = ["sideslip", "roll", "pitch"];
        compare(&what, names, "deg", motion, MOTION_MAX_DEG);
        judge_events(&what, run, &result, lift_within_s);
    }
}

/// The lift is declared and warned of in time, the change of surface is reported, and nothing else.
fn judge_events(what: &str, run: &Run, result: &Estimated, lift_within_s: f64) {
    let (mut lift, mut warning, mut surface) = (None, None, None);
    for event in &result.events {
        let time_s = run.start_s() + event.time.seconds_since(sensing::START);
        let first = match event.kind {
            EventKind::Lift(Wheel::FrontRight) => &mut lift,
            EventKind::LiftWarning(Wheel::FrontRight, _) => &mut warning,
            EventKind::SurfaceChange(_, ratio) if ratio < 1.0 => &mut surface,
            _ => panic!("{what}: false alarm {event:?}"),
        };
        first.get_or_insert(time_s);
    }
    match (run.name.as_str(), lift, warning, surface) {
        ("b_circle", Some(lift_s), Some(warning_s), None) => {
            let (late_s, lead_s) = (lift_s - LIFT_S, LIFT_S - warning_s);
            report(&format!(
                "{what}: lift of FR declared {late_s:+.2} s after it (within {lift_within_s}), warning \
                 {lead_s:.2} s before (at least {WARNING_S})"
            ));
            assert!(
                late_s.abs() <= lift_within_s && lead_s >= WARNING_S,
                "{what}"
            );
        }
        ("d_sine_mu", None, None, Some(surface_s)) => {
            let late_s = surface_s - SURFACE_S;
            report(&format!(
                "{what}: change of surface reported after {late_s:.2} s (at most {SURFACE_WITHIN_S})"
            ));
            assert!((0.0..=SURFACE_WITHIN_S).contains(&late_s), "{what}");
        }
        ("c_sine03" | "f_launch_brake", None, None, None) => {}
        events => panic!("{what}: lift, warning and change of surface {events:?}"),
    }
}

#[test]
fn ten_bit_sensors() {
    judge("thesis-10bit", [1.3, 1.0, 0.45], 1.2);
}

#[test]
fn sixteen_bit_full_bridges() {
    judge("full-bridge-16bit", [0.2, 0.2, 0.35], 1.2);
}

#[test]
fn bending_bridges() {
    judge("full-bridge-16bit-bending", [0.15, 0.15, 0.2], 0.15);
}

/// Largest errors F_x, F_y, F_z on rough ground in the wheel-carrier frame, per cent: causal, and with a lag of
/// 20 ms. The excerpts are the roughest parts of the runs.
const ROUGH_MAX: [(&str, &str, [[f64; 3]; 2]); 6] = [
    (
        "r2_iso_e_a",
        "thesis-10bit",
        [[4.2, 5.2, 10.5], [2.9, 3.7, 3.4]],
    ),
    (
        "r6_jump",
        "thesis-10bit",
        [[4.0, 4.3, 9.0], [3.1, 3.4, 2.5]],
    ),
    (
        "r8_trail_a",
        "thesis-10bit",
        [[3.9, 5.2, 13.8], [2.8, 3.7, 4.2]],
    ),
    (
        "r2_iso_e_a",
        "full-bridge-16bit-bending",
        [[1.2, 2.9, 5.6], [0.9, 1.7, 1.9]],
    ),
    (
        "r6_jump",
        "full-bridge-16bit-bending",
        [[2.6, 3.5, 4.0], [2.1, 2.5, 2.4]],
    ),
    (
        "r8_trail_a",
        "full-bridge-16bit-bending",
        [[2.1, 2.9, 6.4], [1.3, 1.8, 1.8]],
    ),
];

/// The same without potentiometers at 10 bit, with the lag, and the largest mean square of the errors over their
/// standard deviations. The excerpt of the jumps begins before the roughness of the road is learnt.
const UNPOSED_MAX: [(&str, [f64; 3], f64); 2] = [
    ("r2_iso_e_a", [4.5, 7.0, 12.5], 1.5),
    ("r6_jump", [7.0, 16.0, 20.0], 12.0),
];

/// Mean square of the errors over their standard deviations.
const ROUGH_SQUARES: std::ops::Range<f64> = 0.1..2.0;

#[test]
fn rough_ground_is_no_worse_than_stated() {
    for (name, sensors, most) in ROUGH_MAX {
        let run = truth::excerpt(name);
        let result = estimated(run, sensors);
        let all = [("causal", &result.estimates), ("lagged", &result.lagged)];
        for ((lag, estimates), most) in all.into_iter().zip(most) {
            let what = format!("testdata/truth/{name}.parquet, {sensors}, {lag}");
            let force = carrier_errors(run, truth::vehicle(), estimates);
            compare(&what, ["F_x", "F_y", "F_z"], "%", force, most);
            let squares = carrier_squares(run, estimates);
            report(&format!("{what}: mean of (error/sigma)² {squares:.2?}"));
            // The causal load rises before a landing.
            let bounds = if lag == "lagged" {
                ROUGH_SQUARES
            } else {
                0.1..4.0
            };
            for square in squares {
                assert!(bounds.contains(&square), "{what}: {squares:?}");
            }
        }
        let faults = result.events.iter().filter(|event| {
            matches!(
                event.kind,
                EventKind::SensorFault(_) | EventKind::FilterReset
            )
        });
        assert_eq!(faults.count(), 0, "{name} {sensors}: {:?}", result.events);
    }
}

/// Without potentiometers, the standard deviations hold on rough ground once its roughness is learnt, and the
/// filter does not diverge on a jump.
#[test]
fn rough_ground_without_potentiometers_is_survived() {
    for (name, most, square_max) in UNPOSED_MAX {
        let run = truth::excerpt(name);
        let settings = Settings {
            ignore: vec![Input::Deflection],
            ..Settings::default()
        };
        let result = estimated_with(run, "thesis-10bit", settings);
        let what = format!("testdata/truth/{name}.parquet without potentiometers");
        let force = carrier_errors(run, truth::vehicle(), &result.lagged);
        let squares = carrier_squares(run, &result.lagged);
        report(&format!("{what}: mean of (error/sigma)² {squares:.2?}"));
        compare(&what, ["F_x", "F_y", "F_z"], "%", force, most);
        assert!(
            squares.into_iter().all(|square| square < square_max),
            "{squares:?}"
        );
    }
}
