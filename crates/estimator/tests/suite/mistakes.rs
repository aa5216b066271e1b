//! Mistakes of the configuration.

use std::fmt::Write as _;

use atvrec_estimator::{Calibration, Estimator, Output, Settings};
use model::sensors::Sensors;
use model::vehicle::{Payload, Vehicle};
use nalgebra::{Rotation3, Vector3};
use sample::{Counts, EventKind, Measurement, Sample, Wheel};
use testkit::truth::Run;
use testkit::{drive, scoring, sensing, truth};

#[derive(Clone, Debug)]
enum Mistake {
    None,
    Zeros,
    Exchanged(usize, [usize; 2]),
    Corners([usize; 2]),
    Gain(usize, usize, f64),
    Tilt([f64; 3]),
    Moved([f64; 3]),
    Scale(f64),
    Payload,
}

fn scaled(counts: &mut Option<Counts>, middle: f64, factor: f64) {
    if let Some(Counts::Converter(n)) = counts {
        *n = (middle + factor * (f64::from(*n) - middle)).round() as i32;
    }
}

fn spoil(samples: &mut [Sample], sensors: &Sensors, mistake: &Mistake) {
    let middle = f64::powi(2.0, i32::from(sensors.strain.adc_bits) - 1);
    for sample in samples {
        match (&mut sample.measurement, mistake) {
            (Measurement::Corner(c), Mistake::Exchanged(wheel, [a, b]))
                if c.wheel.index() == *wheel =>
            {
                c.strain_counts.swap(*a, *b);
            }
            (Measurement::Corner(c), Mistake::Corners([a, b])) => {
                let at = c.wheel.index();
                if at == *a {
                    c.wheel = Wheel::ALL[*b];
                } else if at == *b {
                    c.wheel = Wheel::ALL[*a];
                }
            }
            (Measurement::Corner(c), Mistake::Gain(wheel, i, factor))
                if c.wheel.index() == *wheel =>
            {
                scaled(&mut c.strain_counts[*i], middle, *factor);
            }
            (Measurement::Imu(imu), Mistake::Tilt([x, y, z])) => {
                let turn = Rotation3::from_euler_angles(*x, *y, *z);
                imu.specific_force_m_s2 = (turn * Vector3::from(imu.specific_force_m_s2)).into();
                imu.angular_rate_rad_s = (turn * Vector3::from(imu.angular_rate_rad_s)).into();
            }
            (Measurement::Imu(imu), Mistake::Scale(factor)) => {
                imu.specific_force_m_s2 = imu.specific_force_m_s2.map(|x| x * factor);
            }
            _ => {}
        }
    }
}

fn watched(
    vehicle: &Vehicle,
    run: &Run,
    real: &Vehicle,
    name: &str,
    seed: u64,
    mistake: &Mistake,
) -> String {
    let sensors = Sensors::builtin(name).unwrap();
    let mut made = sensors.clone();
    match mistake {
        Mistake::Zeros => made.strain.zero_error_counts = 20.0,
        Mistake::Payload => {
            // The centre of gravity moves, the inertial unit does not.
            let (a, b) = (&vehicle.body, &real.body);
            made.imu.position_m[0] += b.front_axle_to_cg_m - a.front_axle_to_cg_m;
            made.imu.position_m[1] -= b.cg_y_m - a.cg_y_m;
            made.imu.position_m[2] -= b.cg_height_m - a.cg_height_m;
        }
        Mistake::Moved(by) => {
            for (axis, by) in by.iter().enumerate() {
                made.imu.position_m[axis] += by;
            }
        }
        _ => {}
    }
    let mut samples = sensing::samples(run, real, &made, seed);
    spoil(&mut samples, &sensors, mistake);
    let calibration = Calibration::nominal(&vehicle.name);
    let mut estimator =
        Estimator::new(vehicle, &sensors, &calibration, Settings::default()).unwrap();
    let mut text = String::new();
    let mut next = 10.0;
    let mut result = scoring::Estimated::default();
    for sample in &samples {
        let now = sample.log_time.seconds_since(sensing::START);
        estimator.advance(sample.log_time, &mut |output| match output {
            Output::Event(event)
                if matches!(
                    event.kind,
                    EventKind::Mistake(_) | EventKind::SensorFault(_) | EventKind::FilterReset
                ) =>
            {
                let _ = write!(
                    text,
                    "\n     {now:.1} s: {} [{}]",
                    event.text,
                    event.kind.name()
                );
            }
            Output::Estimate(estimate) => result.estimates.push(estimate),
            Output::Lagged(estimate) => result.lagged.push(estimate),
            _ => {}
        });
        estimator.push(sample);
        if now > next {
            next += 10.0;
            let mistakes = estimator.mistakes().unwrap();
            if let Some(b) = mistakes.judged().first().filter(|b| b.ratio > 4.0) {
                let _ = write!(text, " | {:.0} {:?} {:.0}", now, b.hypothesis, b.ratio);
            }
        }
    }
    if std::env::var_os("TOP").is_some() {
        for b in estimator.mistakes().unwrap().judged().iter().take(6) {
            let few = |v: &[f64]| {
                v.iter()
                    .take(4)
                    .map(|x| format!("{x:.3}"))
                    .collect::<Vec<_>>()
                    .join(",")
            };
            let _ = write!(
                text,
                "\n        {:?} {:.1} [{}] ± [{}]",
                b.hypothesis,
                b.ratio,
                few(&b.value),
                few(&b.sigma)
            );
        }
    }
    let report = estimator.mistake_report().unwrap();
    let found = report
        .found
        .first()
        .map_or(3.0, |(f, _)| f.time.seconds_since(sensing::START));
    let late = |estimates: &[sample::Estimate]| {
        let kept = estimates
            .iter()
            .filter(|e| e.time.seconds_since(sensing::START) > found + 3.0);
        kept.cloned().collect::<Vec<_>>()
    };
    let kept = late(&result.lagged);
    if !kept.is_empty() && run.columns.contains_key("FL_steer") {
        let e = scoring::carrier_errors(run, vehicle, &kept);
        let z = scoring::carrier_squares(run, &kept);
        let _ = write!(
            text,
            "\n     errors {:.1} {:.1} {:.1} %, NEES {:.1} {:.1} {:.1}",
            e[0], e[1], e[2], z[0], z[1], z[2]
        );
    }
    text
}

#[test]
#[ignore = "trial"]
fn trial() {
    let vehicle = truth::vehicle();
    let mut heavy = vehicle.clone();
    heavy.payload = vec![Payload {
        name: "sack".to_owned(),
        mass_kg: 80.0,
        position_m: [-0.8, 0.3, 0.9],
        inertia_kg_m2: [0.0; 3],
    }];
    let loaded = heavy.loaded(&["sack"]).unwrap();
    let which = std::env::var("TRIAL").unwrap_or_default();
    let mistakes = match which.as_str() {
        "none" => vec![Mistake::None],
        "few" => vec![
            Mistake::Corners([0, 1]),
            Mistake::Exchanged(1, [2, 3]),
            Mistake::Tilt([0.0, 0.05, 0.0]),
            Mistake::Tilt([0.05, 0.0, 0.0]),
            Mistake::Tilt([0.0, 0.0, 0.05]),
            Mistake::Tilt([0.0, 0.0, std::f64::consts::FRAC_PI_2]),
            Mistake::Moved([0.3, 0.0, 0.0]),
            Mistake::Scale(1.0 / 9.81),
        ],
        _ => vec![
            Mistake::None,
            Mistake::Zeros,
            Mistake::Exchanged(0, [0, 1]),
            Mistake::Exchanged(2, [1, 4]),
            Mistake::Exchanged(1, [2, 3]),
            Mistake::Corners([0, 1]),
            Mistake::Gain(0, 2, -1.0),
            Mistake::Gain(1, 4, -1.0),
            Mistake::Gain(2, 0, 0.5),
            Mistake::Gain(3, 3, 1.4),
            Mistake::Gain(0, 1, 0.0),
            Mistake::Tilt([0.0, 0.05, 0.0]),
            Mistake::Tilt([0.0, 0.0, std::f64::consts::FRAC_PI_2]),
            Mistake::Moved([0.3, 0.0, 0.0]),
            Mistake::Scale(1.0 / 9.81),
        ],
    };
    let runs: Vec<&Run> = match which.as_str() {
        "none" => ["b_circle", "c_sine03", "d_sine_mu", "f_launch_brake"]
            .into_iter()
            .filter_map(truth::run)
            .chain(
                [
                    "r1_iso_c_a",
                    "r2_iso_e_a",
                    "r3_rocks_a",
                    "r4_washboard",
                    "r5_crossaxle_a",
                    "r6_jump",
                    "r8_trail_a",
                ]
                .into_iter()
                .filter_map(truth::rough_run),
            )
            .filter(|run| !std::env::var("RUN").is_ok_and(|r| !run.name.contains(&r)))
            .collect(),
        _ => vec![
            truth::run("c_sine03").unwrap(),
            truth::rough_run("r1_iso_c_a").unwrap(),
        ],
    };
    for sensors in ["thesis-10bit", "full-bridge-16bit-bending"] {
        for run in &runs {
            for mistake in &mistakes {
                let text = watched(vehicle, run, vehicle, sensors, 11, mistake);
                eprintln!("{sensors} {} {mistake:?}{text}", run.name);
            }
        }
    }
    if std::env::var_os("RUN").is_some() {
        return;
    }
    for (real, mistake) in [
        (vehicle, Mistake::None),
        (&loaded.vehicle, Mistake::Payload),
        (vehicle, Mistake::Zeros),
        (vehicle, Mistake::Exchanged(0, [0, 1])),
    ] {
        let run = drive::virtual_drive(real, sim::Manoeuvre::MixedDriving, 60.0);
        for sensors in ["thesis-10bit", "full-bridge-16bit-bending"] {
            let text = watched(vehicle, &run, real, sensors, 11, &mistake);
            eprintln!("{sensors} mixed {mistake:?}{text}");
        }
    }
}
