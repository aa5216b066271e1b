//! The passenger car's story: text files in, sideslip out, scored against a reference.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use crate::support::{atvrec, stdout};

const GRAVITY_M_S2: f64 = 9.806_65;
const MASS_KG: f64 = 1450.0;
const AXLES_M: [f64; 2] = [1.15, 1.45];
const STEERING_RATIO: f64 = 15.0;

const MAP: &str = r#"
[time]
column = "t"
[column.vx]
quantity = "speed.forward"
unit = "km/h"
[column.steer]
quantity = "steer"
unit = "deg"
[column.yaw]
quantity = "rate.z"
unit = "deg/s"
[column.ay]
quantity = "acceleration.y"
unit = "m/s^2"
[column.beta]
quantity = "truth.sideslip"
unit = "deg"
"#;

/// A vehicle file with what the papers of a car tell.
fn vehicle() -> String {
    format!(
        "name = \"car\"\n[body]\nmass_kg = {MASS_KG}\nfront_axle_to_cg_m = {}\n\
         cg_to_rear_axle_m = {}\n[steering]\nratio = {STEERING_RATIO}\n",
        AXLES_M[0], AXLES_M[1]
    )
}

/// Lateral force by the Magic Formula, its friction and stiffness falling with load.
fn tyre_n(slip: f64, load_n: f64, stiffness: f64) -> f64 {
    let reference = MASS_KG * GRAVITY_M_S2 / 4.0;
    let friction = 1.15 * (1.0 - 0.08 * (load_n / reference - 1.0));
    let cornering =
        stiffness * reference * 1.6 * math::sin(2.0 * math::atan(load_n / (1.6 * reference)));
    let peak = friction * load_n.max(1.0);
    let bx = cornering / (1.35 * peak) * math::tan(slip);
    peak * math::sin(1.35 * math::atan(bx + 0.6 * (bx - math::atan(bx))))
}

/// White noise from -1 to 1, times the square root of 3: the standard deviation is 1.
fn white(random: &mut math::Random) -> f64 {
    3.0_f64.sqrt() * (2.0 * random.unit() - 1.0)
}

/// A drive of a car with four tyres, roll, load transfer, relaxation and banked road: none of
/// which the filter's model has. Offsets and noise on all sensors.
fn drive(seconds: f64) -> String {
    const DT_S: f64 = 0.002;
    let [a, b] = AXLES_M;
    let (track, height, inertia) = (1.53, 0.55, 2400.0);
    let (mut v, mut lateral, mut rate, mut roll, mut roll_rate) = (20.0, 0.0, 0.0, 0.0, 0.0);
    let (mut side, mut force) = (0.0, [0.0; 4]);
    let mut random = math::Random::from_state(0x9E37_79B9_7F4A_7C15);
    let mut noise = || white(&mut random);
    let mut text = "# a drive on a track\nt,vx,steer,yaw,ay,beta\n".to_owned();
    for step in 0..(seconds / DT_S) as usize {
        let t = step as f64 * DT_S;
        let aim: f64 = 21.0 + 7.0 * math::sin(0.11 * t);
        let push: f64 = (1.5 * (aim - v)).clamp(-5.0, 3.0);
        let want = 8.5 * math::sin(0.31 * t) * (0.5 + 0.5 * math::cos(0.043 * t).abs())
            + 1.2 * math::sin(2.9 * t);
        let steer = want / (v * v) * (a + b + 0.0028 * v * v);
        let loads: [f64; 4] = std::array::from_fn(|i| {
            let arm = if i < 2 { b } else { a };
            let still = 0.5 * MASS_KG * GRAVITY_M_S2 * arm / (a + b);
            let ahead = if i < 2 { -0.5 } else { 0.5 } * MASS_KG * push * height / (a + b);
            let share = if i < 2 { 0.55 } else { 0.45 };
            let over = share * MASS_KG * side * height / track;
            (still + ahead + if i % 2 == 0 { -over } else { over }).max(0.0)
        });
        for i in 0..4 {
            let (x, y) = (
                if i < 2 { a } else { -b },
                if i % 2 == 0 { 0.5 } else { -0.5 } * track,
            );
            let along = v - rate * y;
            let own = if i < 2 {
                steer - 2e-7 * (force[0] + force[1])
            } else {
                -0.02 * roll
            };
            let slip = own - math::atan((lateral + rate * x) / along);
            let aimed = tyre_n(slip, loads[i], if i < 2 { 17.0 } else { 22.0 });
            force[i] += DT_S * along / 0.5 * (aimed - force[i]);
        }
        let (front, rear) = (force[0] + force[1], force[2] + force[3]);
        side = (front * math::cos(steer) + rear) / MASS_KG;
        let turn = (a * front * math::cos(steer) - b * rear) / inertia;
        let bank = 0.02 * math::sin(0.07 * t);
        let tip =
            MASS_KG * 0.45 * (side + GRAVITY_M_S2 * roll) - 95_000.0 * roll - 6_000.0 * roll_rate;
        v += DT_S * (push + rate * lateral);
        lateral += DT_S * (side - rate * v - GRAVITY_M_S2 * bank);
        rate += DT_S * turn;
        roll_rate += DT_S * tip / 600.0;
        roll += DT_S * roll_rate;
        if step % 5 == 0 {
            let sensed = side + GRAVITY_M_S2 * math::sin(roll) + 0.12 + 0.2 * noise();
            let _ = writeln!(
                text,
                "{t:.2},{:.3},{:.4},{:.4},{sensed:.4},{:.5}",
                3.6 * (v * 1.003 + 0.03 * noise()),
                STEERING_RATIO * (steer.to_degrees() - 0.25 + 0.02 * noise()),
                rate.to_degrees() + 0.2 + 0.15 * noise(),
                math::atan2(lateral, v).to_degrees(),
            );
        }
    }
    text
}

fn score(directory: &Path, log: &str, more: &[&str]) -> serde_json::Value {
    let assert = atvrec(directory)
        .args(["score", log, "--from", "100", "--json"])
        .args(more)
        .assert()
        .success();
    serde_json::from_str(&stdout(&assert)).expect("JSON")
}

fn sideslip(score: &serde_json::Value, key: &str) -> f64 {
    let rows = score["signals"].as_array().expect("a list");
    let row = rows.iter().find(|row| row["signal"] == "sideslip");
    row.and_then(|row| row[key].as_f64())
        .expect("a number")
        .to_degrees()
}

#[test]
fn sideslip_of_a_car_whose_handling_the_first_half_of_the_drive_told() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    for (name, text) in [
        ("drive.csv", drive(200.0)),
        ("map.toml", MAP.to_owned()),
        ("car.toml", vehicle()),
    ] {
        fs::write(here.join(name), text).expect("written");
    }
    atvrec(here)
        .args(["import", "csv", "drive.csv", "--columns", "map.toml"])
        .args(["--vehicle", "car.toml", "-o", "drive.mcap"])
        .assert()
        .success();
    atvrec(here)
        .args(["replay", "drive.mcap", "--verify"])
        .assert()
        .success();
    let assert = atvrec(here)
        .args(["identify", "handling", "drive.mcap", "--until", "100"])
        .args(["-o", "identified", "--json"])
        .assert()
        .success();
    let found: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
    let offset = found["steer_offset_rad"].as_f64().expect("a number");
    assert!((offset.to_degrees() + 0.25).abs() < 0.12, "{found:#}");
    atvrec(here)
        .args(["replay", "drive.mcap", "-c", "identified/atvrec.toml"])
        .args(["--smooth", "-o", "again.mcap"])
        .assert()
        .success();
    let before = score(here, "drive.mcap", &[]);
    let after = score(here, "again.mcap", &[]);
    let smoothed = score(here, "again.mcap", &["--smoothed"]);
    let rmse = sideslip(&after, "rmse");
    assert!(
        rmse < 0.3,
        "{rmse} degrees; before: {}",
        sideslip(&before, "rmse")
    );
    assert!(sideslip(&after, "percentile_95") < 0.6);
    assert!(rmse < 0.7 * sideslip(&before, "rmse"));
    // What is left of a drive as short is the offsets' error, which the smoother shares.
    let of_smoothed = sideslip(&smoothed, "rmse");
    assert!(of_smoothed < 1.05 * rmse, "{of_smoothed} {rmse}");
    // Run against run: the two logs differ, and a log does not differ from itself.
    let assert = atvrec(here)
        .args(["score", "again.mcap", "--against", "drive.mcap", "--json"])
        .assert()
        .success();
    let against: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
    assert_eq!(against["identical"], false);
    assert!(against["common"].as_u64() > Some(19_000));
    let assert = atvrec(here)
        .args(["score", "again.mcap", "--against", "again.mcap", "--json"])
        .assert()
        .success();
    let same: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
    assert_eq!(same["identical"], true);
}

#[test]
fn a_drive_that_tells_nothing_is_refused() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let mut text = "t,vx,steer,yaw,ay,beta\n".to_owned();
    for row in 0..8000 {
        let _ = writeln!(
            text,
            "{:.2},72,0.1,{},0.01,0",
            f64::from(row) * 0.01,
            row % 2
        );
    }
    fs::write(here.join("drive.csv"), text).expect("written");
    fs::write(here.join("map.toml"), MAP).expect("written");
    fs::write(here.join("car.toml"), vehicle()).expect("written");
    atvrec(here)
        .args(["import", "csv", "drive.csv", "--columns", "map.toml"])
        .args(["--vehicle", "car.toml", "-o", "drive.mcap"])
        .assert()
        .success();
    let assert = atvrec(here)
        .args(["identify", "handling", "drive.mcap"])
        .assert()
        .code(1);
    let told = crate::support::stderr(&assert);
    assert!(told.contains("peak of the lateral acceleration"), "{told}");
}
