//! Forces of a vehicle without linkages and without sensors on its suspension, against truth runs.

use std::sync::Arc;

use atvrec_estimator::{Calibration, Input, Settings};
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{ControlSample, ForceSource, Measurement, PerWheel, Sample, Signal, Wheel};
use testkit::report;
use testkit::scoring::{
    Estimated, carrier_errors, carrier_squares, deviations, estimate, force_errors, rms, row,
};
use testkit::truth::{self, Run};

use crate::RUNS;

/// First judged row.
const SETTLED: usize = 600;

/// The vehicle of the truth runs as its file would be without a measured suspension.
fn plain() -> Vehicle {
    let mut vehicle = truth::vehicle().clone();
    for axle in [&mut vehicle.front, &mut vehicle.rear] {
        (axle.wishbone, axle.strut) = (None, None);
    }
    vehicle
}

fn estimated(run: &Run, vehicle: &Vehicle, samples: &[Sample]) -> Estimated {
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let calibration = Calibration::nominal(&vehicle.name);
    let result = estimate(
        vehicle,
        &sensors,
        &calibration,
        Settings::default(),
        samples,
    );
    let last = &result.estimates.last().unwrap().carrier[Wheel::FrontLeft];
    assert_eq!(last.source, ForceSource::Inertial, "{}", run.name);
    result
}

/// What a car's network has: accelerations along and across, yaw rate, steering wheel and wheel speeds.
fn of_a_car(samples: &[Sample]) -> Vec<Sample> {
    let kept = samples.iter().filter_map(|sample| {
        let mut sample = sample.clone();
        match &mut sample.measurement {
            Measurement::Imu(imu) => {
                imu.specific_force_m_s2[2] = f64::NAN;
                (imu.angular_rate_rad_s[0], imu.angular_rate_rad_s[1]) = (f64::NAN, f64::NAN);
            }
            Measurement::Steer(_) | Measurement::WheelSpeed(_) => {}
            _ => return None,
        }
        Some(sample)
    });
    kept.collect()
}

/// Lateral forces in vehicle axes, N: the front and the rear axle.
fn axles(forces: &PerWheel<[f64; 3]>, steer_rad: [f64; 4]) -> [f64; 2] {
    let across = |wheel: Wheel| {
        let (sine, cosine) = math::sin_cos(steer_rad[wheel.index()]);
        forces[wheel][0] * sine + forces[wheel][1] * cosine
    };
    [Wheel::ALL[0], Wheel::ALL[2]].map(|left| {
        let right = Wheel::ALL[left.index() + 1];
        across(left) + across(right)
    })
}

/// 100 RMS / max(peak, static load) of the sum of the lateral forces and of the worst axle.
fn lateral_errors(run: &Run, vehicle: &Vehicle, result: &Estimated) -> [f64; 2] {
    let truth = |row: usize| {
        let at =
            |wheel: Wheel, name: &str| run.column(&format!("{}_{name}", wheel.abbreviation()))[row];
        let forces = PerWheel::from_fn(|wheel| ["Fx", "Fy", "Fz"].map(|name| at(wheel, name)));
        axles(&forces, Wheel::ALL.map(|wheel| at(wheel, "steer")))
    };
    let rows: Vec<[f64; 2]> = (0..run.rows).map(truth).collect();
    let weight: Vec<f64> = Wheel::ALL
        .map(|wheel| vehicle.static_load_n(wheel))
        .to_vec();
    let statics = [weight[0] + weight[1], weight[2] + weight[3]];
    let error = |of: &dyn Fn([f64; 2]) -> f64, static_n: f64| {
        let peak = rows
            .iter()
            .map(|axles| of(*axles).abs())
            .fold(static_n, f64::max);
        let judged = result
            .estimates
            .iter()
            .filter(|estimate| (SETTLED..run.rows).contains(&row(estimate)));
        let errors = judged.map(|estimate| {
            let forces = PerWheel::from_fn(|wheel| estimate.measured[wheel].force_n);
            of(axles(&forces, estimate.motion.steer_rad.0)) - of(rows[row(estimate)])
        });
        100.0 / peak * rms(errors)
    };
    let sum = error(&|[front, rear]| front + rear, statics[0] + statics[1]);
    let front = error(&|[front, _]| front, statics[0]);
    let rear = error(&|[_, rear]| rear, statics[1]);
    [sum, front.max(rear)]
}

fn judge(what: &str, run: &Run, vehicle: &Vehicle, result: &Estimated) -> [f64; 3] {
    let [sum, axle] = lateral_errors(run, vehicle, result);
    let [x, y, z] = force_errors(run, vehicle, result);
    let squares = deviations(run, result).axes;
    let carrier = carrier_errors(run, vehicle, &result.estimates);
    let carrier_squares = carrier_squares(run, &result.estimates);
    report(&format!(
        "{} {what}: sum of F_y {sum:.2} %, axle {axle:.2} %, wheels {x:.2} {y:.2} {z:.2} %, mean of (error/sigma)² {squares:.2?}; \
         wheel-carrier frame {carrier:.2?} %, {carrier_squares:.2?}",
        run.name
    ));
    assert!(
        squares[1] < 3.0 && squares[2] < 2.0,
        "{}: {squares:?}",
        run.name
    );
    // The tilt of the body turns the wheel-carrier frame: forces without it would be further off.
    for (carrier, contact) in carrier.into_iter().zip([x, y, z]) {
        assert!(
            carrier < 1.2 * contact + 0.6,
            "{}: {carrier} {contact}",
            run.name
        );
    }
    [sum, axle, z]
}

/// The forces of a vehicle without strain, deflection and linkages hold on level ground: with all sensors of the
/// motion, and with those of a car's network alone.
#[test]
fn balances_of_the_whole_vehicle_give_the_forces_of_its_wheels() {
    forces_of_seed(11);
}

/// The figures of docs/estimator.md.
#[test]
#[ignore = "figures"]
fn balances_on_the_seeds_of_the_documentation() {
    for seed in 1..=4 {
        forces_of_seed(seed);
    }
}

fn forces_of_seed(seed: u64) {
    let vehicle = plain();
    for name in RUNS {
        let Some(run) = truth::run(name) else { return };
        let samples = run.samples("thesis-10bit", seed);
        for (what, samples) in [
            ("with GNSS", samples.to_vec()),
            ("with the signals of a car", of_a_car(samples)),
        ] {
            let result = estimated(run, &vehicle, &samples);
            let [sum, axle, load] = judge(what, run, &vehicle, &result);
            assert!(sum < 2.5 && axle < 6.0 && load < 6.0, "{name} {what}");
        }
    }
}

/// A vehicle with linkages whose strain channels and potentiometers are absent.
#[test]
fn linkages_without_strain_and_deflection() {
    let vehicle = truth::vehicle();
    for name in RUNS {
        let Some(run) = truth::run(name) else { return };
        let settings = Settings {
            ignore: vec![Input::Strain, Input::Deflection],
            ..Settings::default()
        };
        let sensors = Sensors::builtin("thesis-10bit").unwrap();
        let calibration = Calibration::nominal(&vehicle.name);
        let samples = run.samples("thesis-10bit", 11);
        let result = estimate(vehicle, &sensors, &calibration, settings, samples);
        let [sum, axle, load] = judge("linkages", run, vehicle, &result);
        assert!(sum < 2.0 && axle < 6.0 && load < 6.0, "{name}");
    }
}

/// Recorded torques of the wheels give the longitudinal forces, which the split of the vehicle file gets wrong: all
/// four wheels of the truth run are driven, and its vehicle file has a driven rear axle.
#[test]
fn torques_of_the_wheels_give_the_longitudinal_forces() {
    let Some(run) = truth::run("f_launch_brake") else {
        return;
    };
    let vehicle = plain();
    let without = of_a_car(run.samples("thesis-10bit", 11));
    let with = with_torques(run, &without);
    let [plain, told] = [without, with].map(|samples| {
        let result = estimated(run, &vehicle, &samples);
        force_errors(run, &vehicle, &result)[0]
    });
    report(&format!(
        "F_x without torques {plain:.2} %, with torques {told:.2} %"
    ));
    assert!(told < 6.0 && told < 0.4 * plain, "{plain} {told}");
}

/// Adds the torque of each wheel with each reading of the inertial unit.
fn with_torques(run: &Run, samples: &[Sample]) -> Vec<Sample> {
    let mut all = Vec::new();
    for sample in samples {
        if matches!(sample.measurement, Measurement::Imu(_)) {
            let seconds = sample.valid_time.seconds_since(testkit::sensing::START);
            let row = ((seconds * truth::RATE_HZ).round() as usize).min(run.rows - 1);
            let signal = |kind: &str, wheel: Wheel| Signal {
                name: Arc::from(format!("{kind}_torque_{}", wheel.abbreviation())),
                value: run.column(&format!("{}_T{kind}", wheel.abbreviation()))[row],
                unit: Arc::from("N m"),
            };
            let signals = ["drive", "brake"]
                .into_iter()
                .flat_map(|kind| Wheel::ALL.map(|wheel| signal(kind, wheel)));
            all.push(Sample {
                measurement: Measurement::Control(ControlSample {
                    values: signals.collect(),
                }),
                ..sample.clone()
            });
        }
        all.push(sample.clone());
    }
    all
}
