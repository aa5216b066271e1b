//! Whether the standard deviations of the handling cover what differs between parts of one drive,
//! between rates of the sensors, and between sources with different delays.

use atvrec_estimator::finding::Refusal;
use atvrec_estimator::identification::handling::{Identified, NAMES, PARAMETERS, identify, values};
use atvrec_estimator::planar::PlanarInput;

use super::cars::{self, Case};
use super::surrogate::drive;
use super::{inputs, vehicle};

/// Largest difference of two results, in their common standard deviations, and root mean square of
/// the differences of all parameters.
const APART_MAX: f64 = 3.0;
const APART_RMS_MAX: f64 = 1.3;

/// Differences of two results over their common standard deviations. Parameters that the drive does not
/// tell are those of the vehicle file in both.
fn apart(what: &str, a: &Identified, b: &Identified) -> Vec<f64> {
    let (x, y) = (values(&a.handling), values(&b.handling));
    let all: Vec<f64> = (0..PARAMETERS)
        .map(|j| (x[j] - y[j]) / math::hypot(a.sigma[j], b.sigma[j]))
        .collect();
    for (name, apart) in NAMES.iter().zip(&all) {
        println!("{what}: {name} {apart:+.2}");
    }
    all
}

fn agree(all: &[f64]) {
    let most = all
        .iter()
        .fold(0.0_f64, |most, apart| most.max(apart.abs()));
    let rms = (all.iter().map(|apart| apart * apart).sum::<f64>() / all.len() as f64).sqrt();
    println!("apart: most {most:.2}, rms {rms:.2}");
    assert!(
        most < APART_MAX && rms < APART_RMS_MAX,
        "{most} {rms}: {all:?}"
    );
}

fn found(case: &Case, rows: &[PlanarInput]) -> Identified {
    identify(rows, &vehicle(case), 0.0).expect("parameters of a car")
}

fn halves(case: &Case, seconds: f64) -> Vec<f64> {
    let rows = inputs(&drive(&case.car, &case.lap, &case.errors, seconds));
    let (first, second) = rows.split_at(rows.len() / 2);
    apart(case.name, &found(case, first), &found(case, second))
}

#[test]
fn the_halves_of_a_drive_agree_within_their_deviations() {
    agree(&halves(&cars::SPORT, 240.0));
}

#[test]
#[ignore = "a campaign of minutes: `make campaigns`"]
fn the_halves_of_five_drives_agree_within_their_deviations() {
    let all: Vec<f64> = cars::ALL
        .iter()
        .flat_map(|case| halves(case, 400.0))
        .collect();
    agree(&all);
}

/// The rows of sensors of 50 Hz: speed and steer angle are held, the others come with every second row.
fn at_50_hz(rows: &[PlanarInput]) -> Vec<PlanarInput> {
    let slow = |(index, row): (usize, &PlanarInput)| PlanarInput {
        speed_m_s: rows[index / 2 * 2].speed_m_s,
        steer_rad: rows[index / 2 * 2].steer_rad,
        yaw_rate_rad_s: row.yaw_rate_rad_s.filter(|_| index % 2 == 0),
        lateral_m_s2: row.lateral_m_s2.filter(|_| index % 2 == 0),
        ..*row
    };
    rows.iter().enumerate().map(slow).collect()
}

#[test]
fn half_the_rate_gives_the_same_handling_and_the_true_duration() {
    let case = &cars::SPORT;
    let rows = inputs(&drive(&case.car, &case.lap, &case.errors, 120.0));
    let (fast, slow) = (found(case, &rows), found(case, &at_50_hz(&rows)));
    agree(&apart("50 Hz", &fast, &slow));
    assert!(
        (fast.used_s - slow.used_s).abs() < 1.0,
        "{} {}",
        fast.used_s,
        slow.used_s
    );
    assert!(fast.used_s > 100.0, "{}", fast.used_s);
}

/// The rows with a steer angle that arrives late by so many rows.
fn with_late_steer(rows: &[PlanarInput], late: i32) -> Vec<PlanarInput> {
    let last = rows.len() as i32 - 1;
    let steer = |row: i32| rows[(row - late).clamp(0, last) as usize].steer_rad;
    let late = |(row, input): (i32, &PlanarInput)| PlanarInput {
        steer_rad: steer(row),
        ..*input
    };
    (0..).zip(rows).map(late).collect()
}

#[test]
fn a_small_delay_is_corrected_and_a_large_one_refused() {
    let case = &cars::SPORT;
    let rows = inputs(&drive(&case.car, &case.lap, &case.errors, 100.0));
    let [plain, late] = [0, 4].map(|late| found(case, &with_late_steer(&rows, late)));
    let seen_s = late.delay_s[0] - plain.delay_s[0];
    println!("delay: {:?}, {:?}", plain.delay_s, late.delay_s);
    assert!((seen_s - 0.04).abs() < 0.012, "{seen_s}");
    agree(&apart("40 ms late", &plain, &late));
    for late in [-30, 30] {
        let refused = identify(&with_late_steer(&rows, late), &vehicle(case), 0.0);
        let Err(Refusal::Value { name, value, .. }) = refused else {
            panic!("{late}: {refused:?}");
        };
        assert!(name.contains("delay of the steer angle"), "{name}");
        assert!(
            (value - f64::from(late) * 0.01).abs() <= 0.05,
            "{late}: {value}"
        );
    }
}
