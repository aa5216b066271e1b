use atvrec_estimator::finding::Refusal;
use atvrec_estimator::identification::cornering::{Body, Options, identify};
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
        text.contains("has no sideslip") && text.contains("GNSS"),
        "{text}"
    );
}
