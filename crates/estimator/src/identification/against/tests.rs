use math::Random;

use super::*;
use crate::identification::tyre::{self, Data, Kind};

/// Slalom of a Fiala tyre, whose parabola is computed here by itself.
fn drive(stiffness_n_rad: f64, friction: f64, seed: u64) -> Data {
    let mut random = Random::new(seed);
    let mut data = Data {
        dt_s: 0.1,
        ..Data::default()
    };
    for row in 0..600 {
        let t = 0.1 * f64::from(row);
        let load_n = 1300.0 + 300.0 * math::sin(0.7 * t);
        let slip_angle = 0.35 * math::sin(0.7 * t) * math::sin(0.05 * t);
        let at_load = stiffness_n_rad * math::powf(load_n / 1300.0, 0.75);
        let grip_n = friction * load_n;
        let z = (at_load * math::tan(slip_angle) / (3.0 * grip_n)).clamp(-1.0, 1.0);
        let force_n = -grip_n * (3.0 * z - 3.0 * z * z.abs() + z.powi(3));
        data.load_n.push(load_n);
        data.slip_angle_rad.push(slip_angle);
        data.lateral_n.push(force_n + 20.0 * random.normal());
    }
    data
}

fn fitted(data: &Data, seed: u64) -> Vec<Findings> {
    let (found, _) = tyre::fit(data, Kind::Fiala, 1300.0, [0.75, 0.87], seed).expect("a tyre");
    vec![found]
}

#[test]
fn equal_tyres_seldom_differ_and_a_softer_one_does() {
    let (mut wrong, mut inside) = (0, 0);
    for seed in 1..=40 {
        let a = fitted(&drive(3000.0, 0.87, seed), seed);
        let b = fitted(&drive(3000.0, 0.87, 1000 + seed), seed);
        let found = differences(&a, &b).expect("two sets").remove(0);
        wrong += u32::from(
            found
                .notes
                .iter()
                .any(|note| note.contains("the tyres differ")),
        );
        let finding = found
            .get("cornering_stiffness_difference")
            .expect("a difference");
        let [low, high] = finding.interval.expect("an interval");
        inside += u32::from(low < 0.0 && 0.0 < high);
    }
    println!("{wrong} of 40 differ, {inside} of 40 intervals contain 0");
    // 5 % of 40 are 2; more than 6 have a probability of 0.3 %.
    assert!(wrong <= 6, "{wrong} of 40 equal pairs differ");
    assert!(inside >= 34, "{inside} of 40 intervals contain zero");
    let soft = fitted(&drive(2600.0, 0.87, 3), 1);
    let hard = fitted(&drive(3000.0, 0.87, 4), 1);
    let found = differences(&soft, &hard).expect("two sets").remove(0);
    let [difference, sigma] = found.value("cornering_stiffness_difference");
    assert!(
        (difference + 400.0).abs() < 3.0 * sigma && sigma < 150.0,
        "{difference} {sigma}"
    );
    let notes = found.notes.join("\n");
    assert!(
        notes.contains("cornering_stiffness: the sets differ")
            && notes.contains("friction: no difference is found")
            && notes.contains("all parameters together: the tyres differ"),
        "{notes}"
    );
    assert!(found.get("slip_angle_offset_difference").is_none());
}

#[test]
fn a_file_of_the_command_is_read_and_another_one_is_refused() {
    let set = fitted(&drive(3000.0, 0.87, 1), 1);
    let text = crate::identification::Overrides::default()
        .file("tyre", "car", &[], &set)
        .expect("a text");
    let again = results(&text).expect("the file");
    let found = differences(&set, &again).expect("two sets").remove(0);
    let [difference, _] = found.value("cornering_stiffness_difference");
    assert!(difference.abs() < 1e-6, "{difference}");
    let other = text.replace("identify tyre", "identify slip");
    let said = results(&other).expect_err("another command").to_string();
    assert!(said.contains("`atvrec identify tyre -o`"), "{said}");
    let mut named = set.clone();
    named[0].what = "rear linear".to_owned();
    let said = differences(&set, &named)
        .expect_err("nothing shared")
        .to_string();
    assert!(
        said.contains("rear linear") && said.contains("the same --model"),
        "{said}"
    );
}
