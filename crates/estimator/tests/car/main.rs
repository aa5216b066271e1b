//! Sideslip of cars of which mass and axle distances are known: handling is identified from the
//! first half of a drive without a reference, then the filter runs over the whole drive, and its
//! second half is judged.

mod cars;
mod random;
mod road;
mod surrogate;

use cars::Case;
use estimator::identification::handling::{Identified, identify};
use estimator::planar::{PlanarDoubt, PlanarFilter, PlanarInput, PlanarModel};
use estimator::score::{self, Errors};
use model::vehicle::Vehicle;
use surrogate::{Row, drive};

/// Time constant of the difference quotient of the speed, s.
const ACCELERATION_TIME_S: f64 = 0.15;
const ROW_S: f64 = 0.01;

/// What is known of the car.
fn vehicle(case: &Case) -> Vehicle {
    let car = &case.car;
    let text = format!(
        "name = \"{}\"\n[body]\nmass_kg = {:?}\nfront_axle_to_cg_m = {:?}\n\
         cg_to_rear_axle_m = {:?}\n",
        case.name, car.mass_kg, car.front_m, car.rear_m
    );
    Vehicle::from_toml(&text, "car.toml").expect("a vehicle file")
}

fn inputs(rows: &[Row]) -> Vec<PlanarInput> {
    let mut smooth = rows[0].speed_m_s;
    let input = |row: &Row| {
        let acceleration_m_s2 = (row.speed_m_s - smooth) / ACCELERATION_TIME_S;
        smooth += ROW_S * acceleration_m_s2;
        PlanarInput {
            time_s: row.time_s,
            speed_m_s: row.speed_m_s,
            acceleration_m_s2,
            steer_rad: row.steer_rad,
            yaw_rate_rad_s: Some(row.yaw_rate_rad_s),
            lateral_m_s2: Some(row.lateral_m_s2),
        }
    };
    rows.iter().map(input).collect()
}

/// What the filter makes of the second half, after the offsets of the first were taken off.
fn judged(vehicle: &Vehicle, found: &Identified, rows: &[Row]) -> Errors {
    let model = PlanarModel::new(vehicle, found.handling, 0.0);
    let mut filter = PlanarFilter::new(model, found.noise, PlanarDoubt::IDENTIFIED, true);
    let mut sideslip_deg = Vec::new();
    for input in inputs(rows) {
        let told = PlanarInput {
            steer_rad: input.steer_rad - found.steer_offset_rad,
            yaw_rate_rad_s: input
                .yaw_rate_rad_s
                .map(|r| r - found.yaw_rate_offset_rad_s),
            lateral_m_s2: input.lateral_m_s2.map(|a| a - found.lateral_offset_m_s2),
            ..input
        };
        let state = filter.step(ROW_S, &told);
        sideslip_deg.push(state.lateral_m_s.atan2(input.speed_m_s).to_degrees());
    }
    assert_eq!(filter.resets(), 0);
    let truth_deg: Vec<f64> = rows.iter().map(|r| r.sideslip_rad.to_degrees()).collect();
    let half = rows.len() / 2;
    score::errors(&sideslip_deg[half..], &truth_deg[half..]).expect("pairs")
}

fn tried(case: &Case, seconds: f64) -> (Identified, Errors) {
    let rows = drive(&case.car, &case.lap, &case.errors, seconds);
    let greatest = |pick: fn(&Row) -> f64| rows.iter().map(pick).fold(0.0, f64::max);
    let vehicle = vehicle(case);
    let found =
        identify(&inputs(&rows[..rows.len() / 2]), &vehicle, 0.0).expect("parameters of a car");
    let errors = judged(&vehicle, &found, &rows);
    println!(
        "{:<8} {:.1} m/s, {:.1} m/s^2, sideslip up to {:.1} deg: rmse {:.3}, 95 % {:.3}, mean {:+.3} deg",
        case.name,
        greatest(|r| r.speed_m_s),
        found.peak_m_s2,
        greatest(|r| r.sideslip_rad.abs()).to_degrees(),
        errors.rmse,
        errors.percentile_95,
        errors.mean
    );
    (found, errors)
}

#[test]
fn mass_and_axle_distances_and_a_drive_give_sideslip() {
    let case = cars::SPORT;
    let (found, errors) = tried(&case, 140.0);
    assert!(errors.rmse < 0.2, "{errors:?} {found:#?}");
    assert!(errors.percentile_95 < 0.4, "{errors:?}");
    let steer = found.steer_offset_rad - case.errors.steer_rad;
    assert!(steer.to_degrees().abs() < 0.1, "{found:#?}");
    let rate = found.yaw_rate_offset_rad_s - case.errors.gyro_rad_s;
    assert!(rate.to_degrees().abs() < 0.2, "{found:#?}");
}

#[test]
#[ignore = "a campaign of minutes: `make campaigns`"]
fn five_cars_over_half_a_drive_of_550_s() {
    let mut worst = [0.0_f64; 2];
    for case in &cars::ALL {
        let (_, errors) = tried(case, 550.0);
        worst = [
            worst[0].max(errors.rmse),
            worst[1].max(errors.percentile_95),
        ];
    }
    assert!(worst[0] < 0.3, "{worst:?}");
    assert!(worst[1] < 0.6, "{worst:?}");
}
