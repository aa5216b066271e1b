//! What smoothing gains on an independent simulator's truth runs through the thesis's sensors.

use atvrec_estimator::smoother::{LAG_STEPS, Smoother, Step};
use atvrec_estimator::{Calibration, Estimator, Output, Settings};
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::Sample;
use testkit::scoring::{Estimated, deviations, estimate, force_errors, motion_errors, slip_errors};
use testkit::truth::{self, Run};

use crate::RUNS;

/// Rounding of a deviation, as a part of it.
const ROUNDING: f64 = 1e-6;
/// What smoothing may make of an error that never changes, of forces in per cent and of angles in
/// degrees: on a steady circle most of what is left of F_y is the bridges' zeros, and pitch is off
/// by 0.08 from its first seconds to its last.
const LASTING_PERCENT: f64 = 0.05;
const LASTING_DEG: f64 = 0.005;
/// Largest mean square of smoothed forces' normalised errors: as sure of themselves as the causal
/// ones may be.
const NEES_MAX: f64 = 1.7;

fn steps(vehicle: &Vehicle, sensors: &Sensors, samples: &[Sample]) -> Vec<Step> {
    let calibration = Calibration::nominal(&vehicle.name);
    let mut estimator = Estimator::new(vehicle, sensors, &calibration, Settings::default())
        .unwrap()
        .traced();
    let mut steps = Vec::new();
    for sample in samples {
        estimator.advance(sample.log_time, &mut |output| {
            if let Output::Step(step) = output {
                steps.push(*step);
            }
        });
        estimator.push(sample);
    }
    steps
}

fn smoothed(vehicle: &Vehicle, steps: &[Step], lag: usize) -> Estimated {
    let mut smoother = Smoother::new(vehicle, lag);
    let mut estimates = Vec::new();
    for step in steps {
        smoother.push(step.clone(), &mut |estimate| estimates.push(estimate));
    }
    smoother.finish(&mut |estimate| estimates.push(estimate));
    Estimated {
        estimates,
        ..Estimated::default()
    }
}

/// Errors of F_x, F_y, F_z in per cent and of sideslip, roll and pitch in degrees.
fn errors(run: &Run, vehicle: &Vehicle, result: &Estimated) -> [f64; 6] {
    let [x, y, z] = force_errors(run, vehicle, result);
    let [sideslip, roll, pitch] = motion_errors(run, result);
    [x, y, z, sideslip, roll, pitch]
}

#[test]
fn what_came_after_makes_estimates_better() {
    let vehicle = truth::vehicle();
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    for name in RUNS {
        let Some(run) = truth::run(name) else { return };
        let samples = run.samples("thesis-10bit", 1);
        let steps = steps(vehicle, &sensors, samples);
        let filtered = Estimated {
            estimates: steps.iter().map(|step| step.estimate.clone()).collect(),
            ..Estimated::default()
        };
        let smoothed = smoothed(vehicle, &steps, LAG_STEPS);
        let [before, after] = [&filtered, &smoothed].map(|result| errors(run, vehicle, result));
        let [loose, tight] = [&filtered, &smoothed].map(|result| deviations(run, result));
        eprintln!(
            "{name}: Fx, Fy, Fz %, sideslip, roll, pitch deg: filtered {before:.3?}, smoothed \
             {after:.3?}; NEES {:.2?} {:.2?}, inside {:.0} {:.0} %, surprise {:.2?} {:.2?}",
            loose.axes,
            tight.axes,
            100.0 * loose.all.inside,
            100.0 * tight.all.inside,
            loose.surprise,
            tight.surprise,
        );
        assert_narrower(&filtered, &smoothed);
        for (i, (before, after)) in before.iter().zip(after).enumerate() {
            let lasting = if i < 3 { LASTING_PERCENT } else { LASTING_DEG };
            assert!(after <= before + lasting, "{name} {i}: {before} {after}");
        }
        let [before, after] = [&filtered, &smoothed].map(|result| slip_errors(run, result));
        eprintln!("{name}: slip angles, deg: filtered {before:.3?}, smoothed {after:.3?}");
        for (before, after) in before.iter().zip(after) {
            assert!(after <= before + LASTING_DEG, "{name}: {before} {after}");
        }
        for axis in 0..3 {
            assert!(tight.axes[axis] < NEES_MAX, "{name}: {:?}", tight.axes);
        }
    }
}

#[test]
fn the_lag_loses_nothing_against_the_whole_run() {
    let vehicle = truth::vehicle();
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let Some(run) = truth::run("c_sine03") else {
        return;
    };
    let samples = run.samples("thesis-10bit", 1);
    let steps = steps(vehicle, &sensors, samples);
    let [lagged, whole] =
        [LAG_STEPS, usize::MAX].map(|lag| errors(run, vehicle, &smoothed(vehicle, &steps, lag)));
    eprintln!("lag {lagged:.3?}, whole run {whole:.3?}");
    for i in 0..4 {
        assert!(lagged[i] < 1.1 * whole[i], "{lagged:?} {whole:?}");
    }
}

/// A filter that takes its operations down gives the same bits.
#[test]
fn tracing_changes_no_bit() {
    let vehicle = truth::vehicle();
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let calibration = Calibration::nominal(&vehicle.name);
    let samples = truth::excerpt("f_launch_brake").samples("thesis-10bit", 1);
    let samples = &samples[..samples.len() / 3];
    let settings = Settings::default();
    let plain = estimate(vehicle, &sensors, &calibration, settings, samples);
    let traced = steps(vehicle, &sensors, samples);
    assert_eq!(plain.estimates.len(), traced.len());
    for (plain, traced) in plain.estimates.iter().zip(&traced) {
        assert_eq!(format!("{plain:?}"), format!("{:?}", traced.estimate));
    }
    assert!(plain.events.is_empty(), "{:?}", plain.events);
}

/// No deviation of a smoothed estimate is larger than the causal one's.
fn assert_narrower(filtered: &Estimated, smoothed: &Estimated) {
    assert_eq!(filtered.estimates.len(), smoothed.estimates.len());
    for (before, after) in filtered.estimates.iter().zip(&smoothed.estimates) {
        assert_eq!(before.time, after.time);
        for (before, after) in before.measured.0.iter().zip(&after.measured.0) {
            for (before, after) in before.sigma_n.iter().zip(after.sigma_n) {
                assert!(after <= before * (1.0 + ROUNDING), "{before} {after}");
            }
        }
    }
}
