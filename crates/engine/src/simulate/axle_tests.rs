//! Pneumatic trail and camber stiffness from logs of the virtual vehicle.

use estimator::identification::{Identified, Method};
use model::vehicle::Vehicle;

use super::drives::{identified, of_prowler};
use crate::virtual_drive::Drive;
use crate::{FileSource, VirtualDrive};

/// Camber stiffness of the tyres of the drives, N/rad.
const CAMBER_N_RAD: f64 = 1200.0;
/// Trail of the virtual vehicle with 14 degrees of freedom: a sixth of 2 sqrt(2 R_0 d), with the deflection d of its tyres
/// under a quarter of its weight (6317 N), on both axles, m.
const TRAIL_M: f64 = 0.0305;
const AXLES: [&str; 2] = ["front", "rear"];

fn found(manoeuvre: &str, method: &Method, camber_n_rad: f64, seed: u64) -> Identified {
    let text = Vehicle::builtin_text("prowler").expect("built in");
    let line = "rolling_resistance = 0.02";
    assert_eq!(text.matches(line).count(), 2);
    let cambered = format!("{line}\ncamber_stiffness_n_rad = {camber_n_rad:?}");
    let without = text
        .lines()
        .filter(|text| !text.starts_with("camber_stiffness_n_rad"));
    let without: Vec<&str> = without.collect();
    let simulated = VirtualDrive::new(&Drive {
        vehicle: FileSource::Text(without.join("\n").replace(line, &cambered)),
        seed,
        ..of_prowler(manoeuvre, "thesis-10bit")
    })
    .expect("a drive");
    let config = simulated.config().expect("a configuration");
    identified(simulated, &config, method)
}

/// The trail of both axles is within 10 % of the truth.
fn assert_trail(manoeuvre: &str, seed: u64) {
    let found = found(manoeuvre, &Method::Aligning, 0.0, seed);
    let trails: Vec<[f64; 2]> = (found.results.iter())
        .map(|result| result.value("pneumatic_trail"))
        .collect();
    println!("{manoeuvre}, seed {seed}: {trails:.4?}");
    assert_eq!(trails.len(), 2);
    for [trail_m, _] in trails {
        assert!(
            (trail_m / TRAIL_M - 1.0).abs() < 0.1,
            "{manoeuvre} {seed}: {trail_m}"
        );
    }
}

/// The interval of the camber stiffness of both axles contains the truth.
fn assert_camber(manoeuvre: &str, seed: u64) {
    let found = found(manoeuvre, &Method::Camber, CAMBER_N_RAD, seed);
    assert_eq!(found.results.len(), 2, "{manoeuvre} {seed}");
    for (axle, result) in AXLES.into_iter().zip(&found.results) {
        let finding = result.get("camber_stiffness").expect("a camber stiffness");
        let [least, most] = finding.interval.expect("an interval");
        let told = format!(
            "{manoeuvre}, seed {seed}, {axle}: {:.0}, sigma {:.0}, {least:.0} to {most:.0} N/rad",
            finding.value, finding.sigma
        );
        println!("{told}");
        assert!(result.what.starts_with(axle), "{}", result.what);
        assert!(least < CAMBER_N_RAD && CAMBER_N_RAD < most, "{told}");
        // An interval that contains everything says nothing.
        assert!(finding.sigma < 2.0 * CAMBER_N_RAD, "{told}");
    }
}

#[test]
fn a_sine_gives_the_trail_of_both_axles() {
    assert_trail("slow-sine", 11);
}

#[test]
fn sines_give_an_interval_of_the_camber_stiffness_that_contains_it() {
    assert_camber("slow-sine", 11);
    assert_camber("fast-sine", 11);
}

#[test]
#[ignore = "the seeds that are scored: `make campaigns`"]
fn campaign_of_scored_seeds() {
    for seed in 1..=4 {
        for manoeuvre in ["slow-sine", "mixed-driving"] {
            assert_trail(manoeuvre, seed);
        }
        for manoeuvre in ["slow-sine", "fast-sine", "mixed-driving", "hillside"] {
            assert_camber(manoeuvre, seed);
        }
    }
}
