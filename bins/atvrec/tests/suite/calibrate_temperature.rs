//! `atvrec calibrate temperature` with the role of a CAN signal.

use std::fs;
use std::path::Path;

use crate::support::{atvrec, stderr, stdout};

/// A log of a vehicle at rest whose steering wheel turns, decoded with a DBC file in which the same bits are also
/// the temperature of the bridges of one corner.
fn heated(here: &Path, manoeuvre: &str) {
    atvrec(here)
        .args([
            "--quiet",
            "simulate",
            "--manoeuvre",
            manoeuvre,
            "--output",
            "own.mcap",
        ])
        .assert()
        .success();
    let project = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../crates/engine/assets/prowler.dbc"
    );
    let steer = " SG_ hand_wheel_angle";
    let bridge =
        " SG_ bridge : 0|32@1- (0.001,20) [-1000|1000] \"degC\" Recorder\n SG_ hand_wheel_angle";
    let dbc = fs::read_to_string(project)
        .expect("a DBC file")
        .replacen(steer, bridge, 1);
    fs::write(here.join("own.dbc"), dbc).expect("written");
    let reader = store::Reader::open([here.join("own.mcap")]).expect("a log");
    let attachments = reader.attachments().expect("attachments");
    let own = attachments
        .iter()
        .find(|attachment| attachment.name == "atvrec.toml");
    let text = String::from_utf8(own.expect("a configuration").data.clone()).expect("text");
    let text = text.replace("[source.can0]\n", "[source.can0]\ndbc = [\"own.dbc\"]\n");
    let roles = "[source.can0.roles]\nbridge_temperature.FL = \"Steering.bridge\"\n\n[vehicle]";
    fs::write(here.join("own.toml"), text.replace("[vehicle]", roles)).expect("written");
    atvrec(here)
        .args([
            "--quiet",
            "replay",
            "own.mcap",
            "--config",
            "own.toml",
            "-o",
            "heated.mcap",
        ])
        .assert()
        .success();
}

#[test]
fn a_drift_is_found_from_the_signal_of_the_role_and_written_into_the_file() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    heated(here, "turn-plates");
    let calibrate = ["calibrate", "temperature"];
    let found = stdout(
        &atvrec(here)
            .args(calibrate)
            .arg("heated.mcap")
            .assert()
            .success(),
    );
    assert!(found.contains("FL lower_front zero drift"), "{found}");
    assert!(found.contains("note: RL: no drift found"), "{found}");
    let file = fs::read_to_string(here.join("calibration.toml")).expect("a file");
    assert!(
        file.contains("[corner.front_left.strain.lower_front.temperature]"),
        "{file}"
    );
    assert!(!file.contains("corner.rear_left"), "{file}");
    // A log without the role.
    let none = stderr(
        &atvrec(here)
            .args(calibrate)
            .arg("own.mcap")
            .assert()
            .code(1),
    );
    assert!(
        none.contains("no bridge temperature (role bridge_temperature.FL"),
        "{none}"
    );
    // A file with a drift that no bridge has.
    let wrong = file
        .replace("reference_c", "gain_per_k = 0.1\nreference_c")
        .replace("gain_per_k = 0.0\n", "");
    fs::write(here.join("calibration.toml"), wrong).expect("written");
    let refused = stderr(
        &atvrec(here)
            .args(calibrate)
            .arg("heated.mcap")
            .assert()
            .code(1),
    );
    assert!(refused.contains("gain_per_k = 0.1"), "{refused}");
}
