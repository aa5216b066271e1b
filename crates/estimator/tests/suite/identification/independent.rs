//! The independent simulator's runs, whose parameters stand in its params.json.

use atvrec_estimator::identification::{Drive, cornering, roll_centre, roll_pitch, tyre};
use sample::{PerWheel, Wheel};
use testkit::truth::{self, RATE_HZ, Run};

/// Rows of the truth files that make one of the drive's.
const STRIDE: usize = 2;

fn drive(run: &Run) -> Drive {
    let rows: Vec<usize> = (0..run.rows).step_by(STRIDE).collect();
    let each =
        |of: &dyn Fn(usize) -> f64| -> Vec<f64> { rows.iter().map(|&row| of(row)).collect() };
    let column = |name: &str| each(&|row| run.column(name)[row]);
    // Horizontal parts of the body's vectors.
    let across = |names: [&str; 3]| {
        each(&|row| {
            let [_, y, z] = run.vector(names, row);
            let (sin, cos) = math::sin_cos(run.column("roll")[row]);
            y * cos - z * sin
        })
    };
    let velocity = ["vx_body", "vy_body", "vz_body"];
    let forward = column("vx_body");
    let left = across(velocity);
    Drive {
        dt_s: STRIDE as f64 / RATE_HZ,
        speed_m_s: forward
            .iter()
            .zip(&left)
            .map(|(x, y)| math::hypot(*x, *y))
            .collect(),
        sideslip_rad: forward
            .iter()
            .zip(&left)
            .map(|(x, y)| math::atan2(*y, *x))
            .collect(),
        yaw_rate_rad_s: column("r"),
        lateral_m_s2: across(["ax_body", "ay_body", "az_body"]),
        longitudinal_m_s2: column("ax_body"),
        steer_rad: each(&|row| 0.5 * (run.column("FL_steer")[row] + run.column("FR_steer")[row])),
        roll_rad: column("roll"),
        pitch_rad: column("pitch"),
        loads_n: PerWheel::from_fn(|wheel: Wheel| column(&format!("{}_Fz", wheel.abbreviation()))),
    }
}

/// Static cornering stiffness of the axles in params.json.
const CORNERING: [f64; 2] = [11_920.5, 17_483.0];

#[test]
fn cornering_stiffness_of_the_independent_simulators_sine() {
    let Some(run) = truth::run("c_sine03") else {
        return;
    };
    let drive = drive(run);
    let mut options = cornering::Options::default();
    for limit in [2.5, 3.5] {
        options.lateral_max_m_s2 = limit;
        let found = cornering::identify(
            &drive,
            &cornering::Body::of(&roll_centre::of_linkage(truth::vehicle())),
            &options,
        )
        .expect("a sine");
        for (name, truth) in ["cornering_stiffness_front", "cornering_stiffness_rear"]
            .into_iter()
            .zip(CORNERING)
        {
            let [value, sigma] = found.value(name);
            println!(
                "{limit}: {name} {value:.0} +- {sigma:.0} of {truth}; {:?}",
                found.beside
            );
            assert!((value / truth - 1.0).abs() < 0.06, "{name} {value}");
        }
    }
}

#[test]
fn roll_stiffness_of_the_independent_simulators_sine() {
    let Some(run) = truth::run("c_sine03") else {
        return;
    };
    let drive = drive(run);
    let body = roll_pitch::Body::of(&roll_centre::of_linkage(truth::vehicle()));
    let found =
        roll_pitch::identify(&drive, &body, &roll_pitch::Options::default()).expect("rolls");
    // Spring rates at the wheels of params.json, in series with its tyres.
    let truth: f64 = [(10_725.0, 1.143_f64), (11_098.0, 1.092)]
        .map(|(rate, track)| 0.5 * track.powi(2) / (1.0 / rate + 1.0 / 120_000.0))
        .iter()
        .sum();
    println!(
        "{:?} of {truth}; {:?}",
        found.value("roll_stiffness"),
        found.beside
    );
    for finding in &found.findings {
        println!("{} {} +- {}", finding.name, finding.value, finding.sigma);
    }
    let [value, _] = found.value("roll_stiffness");
    assert!((value / truth - 1.0).abs() < 0.05, "{value} of {truth}");
}

#[test]
fn the_independent_simulators_tyre_is_fitted_best_by_its_own_kind_of_curve() {
    let Some(source) = truth::run("b_circle") else {
        return;
    };
    let every =
        |name: &str| -> Vec<f64> { source.column(name).iter().copied().step_by(20).collect() };
    let mut data = tyre::Data {
        dt_s: 0.1,
        ..Default::default()
    };
    for wheel in ["FL", "FR"] {
        data.load_n.extend(every(&format!("{wheel}_Fz")));
        data.slip_angle_rad.extend(every(&format!("{wheel}_alpha")));
        data.lateral_n.extend(every(&format!("{wheel}_Fy")));
    }
    let mut best = (f64::INFINITY, "");
    for kind in tyre::Kind::ALL {
        match tyre::fit(&data, kind, 1328.54, [0.75, 0.9], 1) {
            Ok((found, _)) => {
                let rms = found.beside[0].1;
                let [stiffness, _] = found.value("cornering_stiffness");
                println!(
                    "{}: rms {rms:.1} N, C {stiffness:.0} of 5960, mu {:?}",
                    kind.name(),
                    found.value("friction")
                );
                if rms < best.0 {
                    best = (rms, kind.name());
                }
            }
            Err(refusal) => println!("{}: {refusal}", kind.name()),
        }
    }
    println!("{best:?}");
    assert!(best.0 < 40.0, "{best:?}");
}
