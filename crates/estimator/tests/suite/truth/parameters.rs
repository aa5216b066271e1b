//! What the estimator finds beside motion and forces, against what the run was made with.

use atvrec_estimator::{Calibration, Estimator, Output, Settings};
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{AxleGrip, ImuSample, Measurement, Parameters, Sample};
use testkit::sensing;
use testkit::truth::{self, Run};

use super::{SEED, SURFACE_S, SURFACE_WITHIN_S};
use crate::RUNS;

/// How many deviations a value may be off.
const DEVIATIONS_MAX: f64 = 3.0;
/// The run on which biases are further off, as `docs/estimator.md` says.
const STEADY: &str = "b_circle";

/// The parameters that the estimator finds from the samples.
fn found(vehicle: &Vehicle, sensors: &Sensors, samples: &[Sample]) -> Vec<Parameters> {
    let calibration = Calibration::nominal(&vehicle.name);
    let mut estimator =
        Estimator::new(vehicle, sensors, &calibration, Settings::default()).unwrap();
    let mut found = Vec::new();
    for sample in samples {
        estimator.advance(sample.log_time, &mut |output| {
            if let Output::Parameters(parameters) = output {
                found.push(parameters);
            }
        });
        estimator.push(sample);
    }
    found
}

fn first_inertial(samples: &[Sample]) -> ImuSample {
    let inertial = samples.iter().find_map(|sample| match &sample.measurement {
        Measurement::Imu(imu) => Some(*imu),
        _ => None,
    });
    inertial.unwrap()
}

/// Biases of accelerometers and gyros: what a unit without them reads less, by the same seed.
fn biases(run: &Run, vehicle: &Vehicle, sensors: &Sensors, samples: &[Sample]) -> [[f64; 3]; 2] {
    let mut unbiased = sensors.clone();
    unbiased.imu.accel_bias_m_s2 = 0.0;
    unbiased.imu.gyro_bias_rad_s = 0.0;
    let true_values = first_inertial(&sensing::samples(run, vehicle, &unbiased, SEED));
    let read = first_inertial(samples);
    let less = |read: [f64; 3], value: [f64; 3]| std::array::from_fn(|i| read[i] - value[i]);
    [
        less(read.specific_force_m_s2, true_values.specific_force_m_s2),
        less(read.angular_rate_rad_s, true_values.angular_rate_rad_s),
    ]
}

/// Bias, what is found of it and the deviation of that, of three accelerometers and three gyros.
fn against(biases: [[f64; 3]; 2], found: &Parameters) -> [[f64; 3]; 6] {
    let [accel, gyro] = biases;
    std::array::from_fn(|i| {
        let axis = i % 3;
        if i < 3 {
            let (value, sigma) = (found.accel_bias_m_s2, found.accel_bias_sigma_m_s2);
            [accel[axis], value[axis], sigma[axis]]
        } else {
            let (value, sigma) = (found.gyro_bias_rad_s, found.gyro_bias_sigma_rad_s);
            [gyro[axis], value[axis], sigma[axis]]
        }
    })
}

/// Largest difference of the two measures of the friction in use: a deviation of 30 N of an axle's 3000 N, and the
/// longitudinal force of a steady circle.
const USED_APART: f64 = 0.1;

/// Friction of the ground under a run at the time of `found`; a change counts once it may be known.
fn true_friction(name: &str, found: &Parameters) -> f64 {
    let time_s = found.time.seconds_since(sensing::START);
    if name == "d_sine_mu" && time_s >= SURFACE_S + SURFACE_WITHIN_S {
        0.4
    } else {
        0.9
    }
}

/// No bound is above the friction; utilisation, and a reported coefficient, are right.
fn judge_friction(name: &str, found: &Parameters) {
    let truth = true_friction(name, found);
    for grip in [found.front, found.rear] {
        assert!(grip.friction_min <= truth, "{name} {found:?}");
        if let (Some(friction), Some(sigma)) = (grip.friction, grip.friction_sigma) {
            assert!(
                (friction - truth).abs() <= DEVIATIONS_MAX * sigma,
                "{name} {found:?}"
            );
            // What the tyres use, by lateral forces less two deviations and by all forces less three.
            let used = grip.utilisation * friction;
            assert!(
                (used - grip.friction_min).abs() < USED_APART,
                "{name} {found:?}"
            );
        }
    }
}

#[test]
fn biases_are_found_and_friction_where_it_is_used() {
    let vehicle = truth::vehicle();
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    for name in RUNS {
        let Some(run) = truth::run(name) else { return };
        let samples = run.samples("thesis-10bit", SEED);
        let found = found(vehicle, &sensors, samples);
        for parameters in &found {
            judge_friction(name, parameters);
        }
        let last = found.last().unwrap();
        let biases = biases(run, vehicle, &sensors, samples);
        for [bias, value, sigma] in against(biases, last) {
            let apart = (value - bias) / sigma;
            eprintln!("{name:15} bias {bias:.4}: {value:.4}, {apart:.1} deviations apart");
            assert!(
                name == STEADY || apart.abs() <= DEVIATIONS_MAX,
                "{name} {last:?}"
            );
        }
        for (axle, grip) in [("front", last.front), ("rear", last.rear)] {
            eprintln!("{name:15} {axle} {grip:.2?}");
        }
        let told = |grip: AxleGrip| grip.friction.is_some();
        match name {
            STEADY => assert!(told(last.front), "{last:?}"),
            "d_sine_mu" => {
                assert!(last.front.friction_min > 0.3, "{last:?}");
                assert!(last.front.utilisation > 0.7, "{last:?}");
                assert!(told(last.front), "{last:?}");
            }
            _ => assert!(
                !found.iter().any(|p| told(p.front) || told(p.rear)),
                "{name}"
            ),
        }
    }
}
