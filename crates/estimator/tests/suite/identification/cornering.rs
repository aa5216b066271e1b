use atvrec_estimator::finding::{Findings, Refusal};
use atvrec_estimator::identification::cornering::{Body, Options, identify, of_vehicle};
use model::vehicle::Vehicle;

use super::rides::{self, Noise};
use crate::coverage;

fn body(vehicle: &Vehicle) -> Body {
    Body::of(vehicle)
}

/// Cornering stiffness of both tyres of each axle under their load at rest.
fn truth(vehicle: &Vehicle) -> [f64; 2] {
    let (a, b) = (
        vehicle.body.front_axle_to_cg_m,
        vehicle.body.cg_to_rear_axle_m,
    );
    let weight = vehicle.body.mass_kg * sample::STANDARD_GRAVITY_M_S2;
    [(&vehicle.front.tyre, b), (&vehicle.rear.tyre, a)].map(|(tyre, arm)| {
        let load = 0.5 * weight * arm / (a + b);
        2.0 * tyre.cornering_stiffness_n_rad
            * math::powf(load / tyre.reference_load_n, tyre.load_exponent)
    })
}

const NAMES: [&str; 2] = ["cornering_stiffness_front", "cornering_stiffness_rear"];

#[test]
fn both_stiffnesses_are_within_two_per_cent_under_two_degrees_of_steer_offset() {
    let vehicle = rides::vehicle();
    let clean = rides::sine(&vehicle, 0.14, 0.3, 62.0);
    let truth = truth(&vehicle);
    let offset = 2.0_f64.to_radians();
    for seed in 0..10 {
        let drive = rides::as_measured(&clean, offset, seed);
        let found = identify(&drive, &body(&vehicle), &Options::default()).expect("excited");
        for (name, truth) in NAMES.iter().zip(truth) {
            let [value, sigma] = found.value(name);
            println!("{name} {value:.0} +- {sigma:.0} of {truth:.0}");
            assert!(
                (value / truth - 1.0).abs() < 0.02,
                "seed {seed}: {name} {value} {truth}"
            );
        }
        let [found_offset, _] = found.value("steer_offset");
        assert!(
            (found_offset - offset).abs() < 0.1_f64.to_radians(),
            "{found_offset}"
        );
    }
}

#[test]
fn the_naive_methods_fail_as_the_notes_say() {
    let vehicle = rides::vehicle();
    let clean = rides::sine(&vehicle, 0.14, 0.3, 62.0);
    let drive = rides::as_measured(&clean, 2.0_f64.to_radians(), 1);
    let found = identify(&drive, &body(&vehicle), &Options::default()).expect("excited");
    let by_ratio = found
        .beside
        .iter()
        .find(|b| b.0 == "equation_2_31_front")
        .expect("beside")
        .1;
    assert!(
        (by_ratio / truth(&vehicle)[0] - 1.0).abs() > 0.1,
        "{by_ratio}"
    );
}

fn coverage(seeds: u64) {
    let vehicle = rides::vehicle();
    let clean = rides::sine(&vehicle, 0.09, 0.3, 32.0);
    let offset = 2.0_f64.to_radians();
    let truth = truth(&vehicle);
    let find = |seed| {
        let drive = rides::as_measured(&clean, offset, 500 + seed);
        identify(&drive, &body(&vehicle), &Options::default()).expect("excited")
    };
    let truths = [
        (NAMES[0], truth[0]),
        (NAMES[1], truth[1]),
        ("steer_offset", offset),
    ];
    coverage::covers(0..seeds, &truths, find);
}

#[test]
fn intervals_hold_the_truth() {
    coverage(30);
}

#[test]
#[ignore = "200 seeds: `make campaigns`"]
fn intervals_of_200_drives_hold_the_truth() {
    coverage(200);
}

#[test]
fn a_straight_line_a_short_drive_and_an_absent_signal_are_refused_by_name() {
    let vehicle = rides::vehicle();
    let refusal =
        |drive| identify(&drive, &body(&vehicle), &Options::default()).expect_err("refuses");
    let mut straight = rides::drive(&vehicle, 20.0, |_| 8.0, |_| 0.0);
    Noise::new(1).spoil(&mut straight.sideslip_rad, 0.002, 0.5);
    assert!(matches!(refusal(straight), Refusal::NotExcited { .. }));
    let short = rides::drive(&vehicle, 4.0, |_| 8.0, |t| 0.1 * math::sin(2.0 * t));
    assert!(matches!(refusal(short), Refusal::TooShort { .. }));
    let mut blind = rides::sine(&vehicle, 0.14, 0.3, 62.0);
    blind.sideslip_rad.clear();
    let text = refusal(blind).to_string();
    assert!(
        text.contains("there is no sideslip") && text.contains("GNSS"),
        "{text}"
    );
}

/// The file's tyres have a curve, and the drive's have none. The noise is that of a sideslip angle
/// and of a steer angle, independent from row to row.
#[test]
fn linear_tyres_are_found_as_such_under_noise_of_both_angles() {
    const SEEDS: u64 = 15;
    const TRUTH: [f64; 2] = [5975.0, 17_076.0];
    let vehicle = rides::vehicle();
    for amplitude_rad in [0.05, 0.14] {
        let clean = rides::two_wheel_sine(&vehicle, TRUTH, amplitude_rad, 40.0);
        let found: Vec<_> = (0..SEEDS)
            .map(|seed| {
                let mut drive = clean.clone();
                let mut noise = Noise::new(11 + seed);
                noise.spoil(&mut drive.sideslip_rad, 0.5_f64.to_radians(), 0.0);
                noise.spoil(&mut drive.steer_rad, 0.3_f64.to_radians(), 0.0);
                of_vehicle(&drive, &vehicle, &Options::default()).expect("excited")
            })
            .collect();
        for (name, truth) in NAMES.iter().zip(TRUTH) {
            let median = |of: &dyn Fn([f64; 2]) -> f64| {
                let mut values: Vec<f64> = found.iter().map(|one| of(one.value(name))).collect();
                values.sort_by(f64::total_cmp);
                values[values.len() / 2]
            };
            let (value, sigma) = (median(&|v| v[0]), median(&|v| v[1]));
            let square = |one: &Findings| {
                let [value, sigma] = one.value(name);
                ((value - truth) / sigma).powi(2)
            };
            let rms = (found.iter().map(square).sum::<f64>() / SEEDS as f64).sqrt();
            println!("{amplitude_rad} rad: {name} {value:.0} +- {sigma:.0}, errors of {rms:.2}");
            assert!((value - truth).abs() < sigma, "{name} {value} of {truth}");
            assert!((0.6..1.4).contains(&rms), "{name}: {rms} deviations");
        }
    }
}
