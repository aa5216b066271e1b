//! Calibration as a user runs it: on logs of the virtual vehicle whose truth is known, with faults
//! that must be named, and on logs that must be refused.

use std::os::unix::process::ExitStatusExt;
use std::path::Path;

use sample::{StrainChannel, Wheel};

use crate::support::{atvrec, stderr, stdout};

const OPTIONS: &str = r#"
[hidden]
bridge_offset_counts = 40.0
potentiometer_offset_counts = 20.0
"#;

const FAULTS: &str = r#"
[[faults.channel]]
wheel = "front_right"
channel = "lower_front"
kind = { drifting = { counts_per_s = 0.5 } }

[[faults.channel]]
wheel = "front_left"
channel = "upper_front"
kind = "dead"

[[faults.channel]]
wheel = "front_right"
channel = "upper_rear"
kind = "dead"

[[faults.channel]]
wheel = "rear_left"
channel = "lower_rear"
kind = "inverted"

[[faults.channel]]
wheel = "rear_right"
channel = "lower_front"
kind = "bending_wired"

[[faults.channel]]
wheel = "rear_right"
kind = "inverted"
"#;

fn simulate(directory: &Path, manoeuvre: &str, options: &str, output: &str) {
    std::fs::write(directory.join("options.toml"), options).expect("written");
    atvrec(directory)
        .args([
            "simulate",
            "--manoeuvre",
            manoeuvre,
            "--options",
            "options.toml",
        ])
        .args([
            "--seed",
            "7",
            "--output",
            output,
            "--true-calibration",
            "true.toml",
            "--force",
        ])
        .assert()
        .success();
}

fn calibration(path: &Path) -> estimator::Calibration {
    let text = std::fs::read_to_string(path).expect("a calibration");
    estimator::Calibration::from_toml(&text).expect("it parses")
}

#[test]
fn the_jackstand_zero_finds_offsets_and_names_every_fault() {
    let directory = tempfile::tempdir().expect("a directory");
    let at = |name: &str| directory.path().join(name);
    simulate(
        directory.path(),
        "jackstand",
        &format!("{OPTIONS}{FAULTS}"),
        "stands.mcap",
    );
    let assert = atvrec(directory.path())
        .args(["calibrate", "zero", "stands.mcap", "--report", "zero.html"])
        .assert()
        .success();
    let told = stdout(&assert);
    for fault in [
        "FR lower_front drifts",
        "FL upper_front is dead",
        "FR upper_rear is dead",
        "RL lower_rear is wired the other way round",
        "RR lower_front reads bending",
        "RR deflection is wired the other way round",
    ] {
        assert!(told.contains(fault), "{fault}: {told}");
    }
    assert_eq!(told.matches("note:").count(), 6, "{told}");
    let (found, truth) = (
        calibration(&at("calibration.toml")),
        calibration(&at("true.toml")),
    );
    for wheel in Wheel::ALL {
        for channel in StrainChannel::ALL {
            let pair = (
                found.corner[&wheel].strain.get(&channel),
                truth.corner[&wheel].strain.get(&channel),
            );
            let (Some(found), Some(truth)) = pair else {
                continue;
            };
            let faulty = found.dead
                || found.gain_per_count.is_some()
                || found.offset_sigma_counts > Some(10.0);
            if !faulty {
                let miss = found.offset_counts.expect("found") - truth.offset_counts.expect("true");
                assert!(miss.abs() < 0.5, "{wheel} {}: {miss}", channel.name());
            }
        }
    }
    let page = std::fs::read_to_string(at("zero.html")).expect("a page");
    assert!(page.contains("FR lower_front drifts") && page.contains("uPlot"));
}

#[test]
fn what_does_not_fit_is_refused_and_the_file_stays_as_it_was() {
    let directory = tempfile::tempdir().expect("a directory");
    simulate(directory.path(), "weighed", OPTIONS, "scales.mcap");
    let file = directory.path().join("calibration.toml");
    let earlier = "vehicle = \"Prowler, road tyres\"\n[steer]\noffset_rad = 0.25\n";
    let refused = |step: &str, before: &str, reason: &str| {
        std::fs::write(&file, before).expect("written");
        let assert = atvrec(directory.path())
            .args(["calibrate", step, "scales.mcap"])
            .assert()
            .failure();
        let told = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
        assert!(told.contains(reason), "{step}: {told}");
        assert_eq!(std::fs::read_to_string(&file).expect("there"), before);
    };
    refused("zero", earlier, "put the vehicle on stands");
    refused("imu", earlier, "by 180 degrees");
    refused("gnss", earlier, "turns");
    refused("wheel-radius", earlier, "drive straight");
    refused("steer", earlier, "number of readings");
    refused("load-rig", earlier, "rig FL");
    refused("weight", "vehicle = \"another\"\n", "another");
    std::fs::write(&file, earlier).expect("written");
    atvrec(directory.path())
        .args(["calibrate", "weight", "scales.mcap", "--json"])
        .assert()
        .success();
    let found = calibration(&file);
    assert!((found.steer.offset_rad - 0.25).abs() < 1e-12, "kept");
    let spring = found.corner[&Wheel::RearLeft].spring.expect("a spring");
    assert!(
        (spring.rate_n_m / 65_000.0 - 1.0).abs() < 0.03,
        "{spring:?}"
    );
}

#[test]
fn a_log_without_a_channel_is_refused_by_its_name() {
    let directory = tempfile::tempdir().expect("a directory");
    for (port, steps) in [
        (
            "imu",
            ["imu", "gnss", "wheel-radius"].map(|step| (step, "inertial unit")),
        ),
        (
            "can0",
            [
                ("zero", "spring deflection"),
                ("wheel-radius", "wheel speed"),
                ("weight", "deflection"),
            ],
        ),
    ] {
        let fault = format!("[[faults.unplugged]]\nport = \"{port}\"\nfrom_s = 0.0\nto_s = 99.0\n");
        simulate(directory.path(), "weighed", &fault, "less.mcap");
        for (step, channel) in steps {
            let assert = atvrec(directory.path())
                .args(["calibrate", step, "less.mcap"])
                .assert()
                .failure();
            let told = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
            assert!(told.contains(&format!("no {channel}")), "{step}: {told}");
            assert!(!directory.path().join("calibration.toml").exists());
        }
    }
}

/// `calibrate hub` refused every log, because the readings of the hub accelerometers were not read from it.
#[test]
fn hub_accelerometers_are_calibrated_and_one_that_is_turned_is_named() {
    let directory = tempfile::tempdir().expect("a directory");
    let drive = |manoeuvre: &str, options: &str, output: &str| {
        std::fs::write(directory.path().join("options.toml"), options).expect("written");
        let simulate = ["-q", "simulate", "-m", manoeuvre, "--output", output];
        let sensors = ["--sensors", "thesis-10bit-hub", "--options", "options.toml"];
        let mut command = atvrec(directory.path());
        command.args(simulate).args(sensors).assert().success();
    };
    let calibrate = |rest: &str| {
        let logs = ["calibrate", "hub", rest, "brake.mcap"];
        atvrec(directory.path()).args(logs).assert()
    };
    drive("turned", "", "rest.mcap");
    drive("launch-brake", "", "brake.mcap");
    let told = stdout(&calibrate("rest.mcap").success());
    assert!(told.contains("wrote calibration.toml"), "{told}");

    let turned = "[[faults.hub]]\nwheel = \"rear_right\"\nturned_rad = [1.5708, 0.0, 0.0]\n";
    drive("turned", turned, "wrong.mcap");
    let told = stderr(&calibrate("wrong.mcap").failure());
    assert!(told.contains("hub RR: mean of y at rest"), "{told}");
}

/// The system kills a program that writes past its limit of a file's size: here in the middle of the new
/// file, whatever the machine's speed.
#[test]
fn a_kill_in_the_middle_of_writing_leaves_the_earlier_file_whole() {
    const LIMITED: &str = "ulimit -f 1; exec \"$0\" calibrate steer plates.mcap";
    let directory = tempfile::tempdir().expect("a directory");
    simulate(directory.path(), "turn-plates", "", "plates.mcap");
    let path = directory.path().join("calibration.toml");
    let steer = ["calibrate", "steer", "plates.mcap"];
    atvrec(directory.path()).args(steer).assert().success();
    let whole = std::fs::read_to_string(&path).expect("written");
    let earlier = format!("# earlier\n{whole}");
    std::fs::write(&path, &earlier).expect("written");
    let killed = std::process::Command::new("sh")
        .args(["-c", LIMITED, env!("CARGO_BIN_EXE_atvrec")])
        .current_dir(directory.path())
        .output()
        .expect("it runs");
    assert!(killed.status.signal().is_some(), "{:?}", killed.status);
    let begun = directory
        .path()
        .read_dir()
        .expect("listed")
        .find_map(|entry| {
            let path = entry.expect("an entry").path();
            let is_new = path.to_string_lossy().contains(".toml.partial-");
            is_new.then(|| std::fs::read_to_string(path).expect("text"))
        });
    let begun = begun.expect("a file that was begun");
    assert!(!begun.is_empty() && begun.len() < earlier.len(), "{begun}");
    assert_eq!(std::fs::read_to_string(&path).expect("there"), earlier);
    atvrec(directory.path()).args(steer).assert().success();
    assert_eq!(std::fs::read_to_string(&path).expect("there"), whole);
}

const WIRING: &str = r#"
[hidden]
bridge_offset_counts = 40.0
bridge_gain_fraction = 0.03

[[faults.channel]]
wheel = "front_left"
channel = "upper_front"
kind = { swapped_with = { channel = "upper_rear" } }

[[faults.channel]]
wheel = "front_left"
channel = "upper_rear"
kind = { swapped_with = { channel = "upper_front" } }

[[faults.channel]]
wheel = "front_right"
channel = "lower_rear"
kind = "inverted"

[[faults.channel]]
wheel = "rear_left"
channel = "lower_front"
kind = "bending_wired"

[[faults.channel]]
wheel = "rear_right"
channel = "upper_rear"
kind = "dead"
"#;

#[test]
fn the_load_rig_finds_gains_and_names_every_wrong_wire() {
    let directory = tempfile::tempdir().expect("a directory");
    let at = |name: &str| directory.path().join(name);
    simulate(directory.path(), "load-rig", WIRING, "rig.mcap");
    let assert = atvrec(directory.path())
        .args(["calibrate", "load-rig", "rig.mcap"])
        .assert()
        .success();
    let told = stdout(&assert);
    for fault in [
        "FL upper_front reads upper_rear",
        "FL upper_rear reads upper_front",
        "FR lower_rear is wired the other way round",
        "RL lower_front leaves its range under load",
        "RR upper_rear gives no reading within its range",
    ] {
        assert!(told.contains(fault), "{fault}: {told}");
    }
    assert_eq!(told.matches("note:").count(), 5, "{told}");
    let (found, truth) = (
        calibration(&at("calibration.toml")),
        calibration(&at("true.toml")),
    );
    for wheel in Wheel::ALL {
        for (channel, found) in &found.corner[&wheel].strain {
            if found.dead {
                continue;
            }
            let gain = found.gain_per_count.expect("found");
            let true_gain = truth.corner[&wheel].strain[channel].gain_per_count;
            let miss = gain.abs() / true_gain.expect("true") - 1.0;
            assert!(miss.abs() < 0.01, "{wheel} {}: {miss}", channel.name());
        }
    }
}

const MOUNTING: &str = r#"
[hidden]
velocity_antenna_m = 0.1
velocity_latency_s = 0.02
attitude_latency_s = 0.02
attitude_offset_rad = 0.02
"#;

#[test]
#[ignore = "eight drives of eight minutes: `make campaigns`"]
fn campaign_of_antennas_and_latencies() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    std::fs::write(here.join("options.toml"), MOUNTING).expect("written");
    let mut worst = [0.0_f64; 5];
    for seed in 1..=8 {
        atvrec(here)
            .args(["--quiet", "simulate", "--manoeuvre", "mixed-driving"])
            .args(["--for", "480", "--seed", &seed.to_string()])
            .args(["--options", "options.toml", "--output", "drive.mcap"])
            .args(["--true-calibration", "true.toml", "--force"])
            .assert()
            .success();
        let _ = std::fs::remove_file(here.join("calibration.toml"));
        atvrec(here)
            .args(["calibrate", "gnss", "drive.mcap"])
            .assert()
            .success();
        let [found, truth] = ["calibration.toml", "true.toml"].map(|name| {
            let found = calibration(&here.join(name));
            let antenna_m = found.gnss_velocity.antenna_m.expect("known");
            let latency = [found.gnss_velocity, found.gnss_attitude].map(|g| g.latency_s);
            let [velocity_s, attitude_s] = latency.map(|latency_s| latency_s.expect("known"));
            let [x, y, z] = antenna_m;
            [x, y, z, velocity_s, attitude_s]
        });
        for ((worst, found), truth) in worst.iter_mut().zip(found).zip(truth) {
            *worst = worst.max((found - truth).abs());
        }
        std::fs::remove_file(here.join("drive.mcap")).expect("removed");
    }
    println!("worst of place (m) and latencies (s): {worst:?}");
    assert!(worst[..3].iter().all(|m| *m < 0.03), "{worst:?}");
    assert!(worst[3..].iter().all(|s| *s < 0.002), "{worst:?}");
}

/// The height of the centre of gravity from a table of scales, as overrides that a configuration takes.
#[test]
fn the_height_of_the_centre_of_gravity_comes_from_a_table_of_scales() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    // Rigid tyres and springs held: F = m g/L (b - (h - r) tan theta), h - r = 0.30 m.
    let (wheelbase_m, mass_kg, front_kg, above_m) = (1.4471_f64, 644.0, 270.0, 0.30);
    let stiff = stdout(
        &atvrec(here)
            .args(["vehicle", "show", "prowler"])
            .assert()
            .success(),
    )
    .replace(
        "vertical_stiffness_n_m = 120000.0",
        "vertical_stiffness_n_m = 9e7",
    );
    std::fs::write(here.join("stiff.toml"), stiff).expect("written");
    let mut table = format!(
        "raised,lift_m,front_kg,rear_kg\nnone,0,{front_kg},{}\n",
        mass_kg - front_kg
    );
    for lift_m in [0.3_f64, 0.5] {
        let sine = lift_m / wheelbase_m;
        let slope = sine / (1.0 - sine * sine).sqrt();
        let lighter_kg = mass_kg * above_m * slope / wheelbase_m;
        let front = front_kg - lighter_kg;
        table += &format!("front,{lift_m},{front},{}\n", mass_kg - front);
    }
    std::fs::write(here.join("scales.csv"), table).expect("written");
    let command = [
        "calibrate",
        "cg-height",
        "scales.csv",
        "--vehicle",
        "stiff.toml",
        "--locked",
    ];
    let found = atvrec(here)
        .args(command)
        .args(["--json", "-o", "height.toml", "--report", "height.html"])
        .assert()
        .success();
    let found: serde_json::Value = serde_json::from_str(&stdout(&found)).expect("JSON");
    let text = std::fs::read_to_string(here.join("height.toml")).expect("overrides");
    let overrides: toml::Table = text.parse().expect("TOML");
    let height_m = overrides["overrides"]["body.cg_height_m"]
        .as_float()
        .expect("a number");
    // The centres of the wheels of 9e7 N/m are as high as the unloaded radius of the file.
    assert!(
        (height_m - (0.3175 + above_m)).abs() < 1e-3,
        "{height_m}: {found}"
    );
    assert!(here.join("height.html").exists());
    let again = atvrec(here)
        .args(command)
        .args(["-o", "height.toml"])
        .assert()
        .code(2);
    assert!(
        stderr(&again).contains("exists already"),
        "{}",
        stderr(&again)
    );
    std::fs::write(
        here.join("one.csv"),
        "raised,lift_m,front_kg,rear_kg\nnone,0,270,374\n",
    )
    .expect("written");
    let one = ["calibrate", "cg-height", "one.csv", "--vehicle", "prowler"];
    let one = stderr(&atvrec(here).args(one).assert().failure());
    assert!(one.contains("no reading with a raised axle"), "{one}");
    std::fs::write(
        here.join("odd.csv"),
        "raised,lift_m,front_kg,rear_kg\nleft,0.3,270,374\n",
    )
    .expect("written");
    let odd = ["calibrate", "cg-height", "odd.csv", "--vehicle", "prowler"];
    let odd = stderr(&atvrec(here).args(odd).assert().code(2));
    assert!(odd.contains("must be none, front or rear"), "{odd}");
}

/// A table of a bench gives the gain of a member and keeps the other values of the calibration file. A table with one
/// load is refused with what to do.
#[test]
fn a_bench_calibrates_one_member_and_keeps_the_others() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let earlier = "vehicle = \"Prowler, road tyres\"\n[corner.front_left.strain.tie_rod]\noffset_counts = 500.5\n";
    std::fs::write(here.join("calibration.toml"), earlier).expect("written");
    let mut table = "# bench 3\nload_n,axial_counts\n".to_owned();
    for load_n in [0.0, 1000.0, 2000.0, 3000.0, 2000.0, 1000.0, 0.0] {
        table += &format!("{load_n},{}\n", 510.0 + load_n / 28.0);
    }
    std::fs::write(here.join("bench.csv"), table).expect("written");
    let command = |name: &str| {
        let shared = [
            "--vehicle",
            "prowler",
            "--sensors",
            "thesis-10bit",
            "--wheel",
            "fl",
        ];
        let mut command = atvrec(here);
        command.args(["calibrate", "member", name]).args(shared);
        command
    };
    let member = ["--member", "upper_front"];
    let found = command("bench.csv")
        .args(member)
        .args(["--json", "--report", "bench.html"])
        .assert()
        .success();
    let found: serde_json::Value = serde_json::from_str(&stdout(&found)).expect("JSON");
    let gain = &found["results"][0]["findings"][0];
    assert_eq!(gain["name"], "upper_front_gain");
    assert!(
        (gain["value"].as_f64().expect("a number") - 28.0).abs() < 1e-6,
        "{gain}"
    );
    let file = std::fs::read_to_string(here.join("calibration.toml")).expect("a calibration");
    let file = estimator::Calibration::from_toml(&file).expect("a calibration");
    let strain = &file.corner[&Wheel::FrontLeft].strain;
    let gain = strain[&StrainChannel::UpperFront].gain_per_count;
    assert!((gain.expect("a gain") - 28.0).abs() < 1e-6);
    assert_eq!(strain[&StrainChannel::TieRod].offset_counts, Some(500.5));
    assert!(here.join("bench.html").exists());
    std::fs::write(
        here.join("one.csv"),
        "load_n,axial_counts\n1000,540\n1000,541\n",
    )
    .expect("written");
    let one = stderr(&command("one.csv").args(member).assert().failure());
    assert!(
        one.contains("number of different loads (load_n) is 1.0000 -, at least 3 - is needed")
            && one.contains("write a row for each step"),
        "{one}"
    );
    std::fs::write(here.join("text.csv"), "load_n,axial_counts\nheavy,540\n").expect("written");
    let text = stderr(&command("text.csv").args(member).assert().code(2));
    assert!(text.contains("text.csv: row 1"), "{text}");
    std::fs::write(here.join("force.csv"), "force,axial_counts\n1,540\n").expect("written");
    let force = stderr(&command("force.csv").args(member).assert().code(2));
    assert!(force.contains("lacks load_n"), "{force}");
    let after = std::fs::read_to_string(here.join("calibration.toml")).expect("a calibration");
    assert_eq!(
        estimator::Calibration::from_toml(&after).expect("the same"),
        file
    );
}
