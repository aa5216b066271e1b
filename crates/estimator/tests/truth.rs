//! The estimator on an independent simulator's truth runs through the thesis's sensors.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's helpers stand outside its functions"
)]

#[path = "truth/run.rs"]
mod run;
#[path = "truth/sensing.rs"]
mod sensing;

use estimator::{Calibration, Estimator, Input, Method, Output, Settings};
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use run::{RATE_HZ, Run};
use sample::{Estimate, Event, Sample, Wheel};

const RUNS: [&str; 5] = [
    "b_circle",
    "c_sine03",
    "d_sine_mu",
    "f_launch_brake",
    "h_jack",
];

struct Result {
    estimates: Vec<Estimate>,
    events: Vec<Event>,
}

fn estimate(
    vehicle: &Vehicle,
    sensors: &Sensors,
    settings: Settings,
    samples: &[Sample],
) -> Result {
    let calibration = Calibration::nominal(&vehicle.name);
    let mut estimator = Estimator::new(vehicle, sensors, &calibration, settings).unwrap();
    let mut result = Result {
        estimates: Vec::new(),
        events: Vec::new(),
    };
    for sample in samples {
        estimator.advance(sample.log_time, &mut |output| match output {
            Output::Estimate(estimate) => result.estimates.push(estimate),
            Output::Event(event) => result.events.push(event),
        });
        estimator.push(sample);
    }
    result
}

/// The truth row of an estimate.
fn row(estimate: &Estimate) -> usize {
    (estimate.time.seconds_since(sensing::START) * RATE_HZ).round() as usize
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        sum += value * value;
        count += 1.0;
    }
    f64::sqrt(sum / f64::max(count, 1.0))
}

/// RMSE of sideslip, roll and pitch in degrees, above 3 m/s and after the first 3 s.
fn motion_errors(run: &Run, result: &Result) -> [f64; 3] {
    let truth = ["beta", "roll", "pitch"];
    std::array::from_fn(|i| {
        let column = run.column(truth[i]);
        rms(result.estimates.iter().filter_map(|estimate| {
            let row = row(estimate);
            let moving = run.column("vx_body").get(row)? > &3.0 || i > 0;
            let value = [
                estimate.motion.sideslip_rad,
                estimate.motion.roll_rad,
                estimate.motion.pitch_rad,
            ][i];
            (moving && row > 600).then(|| (value - column[row]).to_degrees())
        }))
    })
}

/// 100 RMS / max(peak of the run, static load), worst tyre, after the first 3 s.
fn force_errors(run: &Run, vehicle: &Vehicle, result: &Result) -> [f64; 3] {
    let wheelbase = vehicle.body.front_axle_to_cg_m + vehicle.body.cg_to_rear_axle_m;
    let half_weight = 0.5 * vehicle.body.mass_kg * 9.81 / wheelbase;
    std::array::from_fn(|axis| {
        Wheel::ALL
            .into_iter()
            .map(|wheel| {
                let name = ["Fx", "Fy", "Fz"][axis];
                let truth = run.column(&format!("{}_{name}", wheel.abbreviation()));
                let arm = if wheel.is_front() {
                    vehicle.body.cg_to_rear_axle_m
                } else {
                    vehicle.body.front_axle_to_cg_m
                };
                let peak = truth.iter().fold(half_weight * arm, |m, v| m.max(v.abs()));
                100.0 / peak
                    * rms(result.estimates.iter().filter_map(|estimate| {
                        let row = row(estimate);
                        (row > 600 && row < truth.len())
                            .then(|| estimate.measured[wheel].force_n[axis] - truth[row])
                    }))
            })
            .fold(0.0, f64::max)
    })
}

#[test]
fn error_tables() {
    if run::directory().is_none() {
        return;
    }
    let vehicle = run::vehicle();
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    for name in RUNS {
        let run = Run::load(name);
        let samples = sensing::samples(&run, &vehicle, &sensors, 1);
        for method in [Method::Thesis, Method::Fusion] {
            let settings = Settings {
                method,
                ..Settings::default()
            };
            let result = estimate(&vehicle, &sensors, settings, &samples);
            let motion = motion_errors(&run, &result);
            let force = force_errors(&run, &vehicle, &result);
            eprintln!(
                "{name:15} {method:?}: sideslip {:.3} roll {:.3} pitch {:.3} deg; Fx {:.2} Fy {:.2} Fz {:.2} %; {} events",
                motion[0],
                motion[1],
                motion[2],
                force[0],
                force[1],
                force[2],
                result.events.len()
            );
        }
        for event in &estimate(&vehicle, &sensors, Settings::default(), &samples).events {
            eprintln!(
                "    {:.2} s: {}",
                event.time.seconds_since(sensing::START),
                event.text
            );
        }
        let settings = Settings {
            ignore: vec![Input::GnssVelocity, Input::GnssAttitude],
            ..Settings::default()
        };
        let result = estimate(&vehicle, &sensors, settings, &samples);
        eprintln!(
            "{name:15} without GNSS: {:.3?}",
            motion_errors(&run, &result)
        );
    }
}
