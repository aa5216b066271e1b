//! `atvrec identify` as a user runs it, on logs whose truth is known.

use std::path::Path;

use serde_json::Value;

use crate::support::atvrec;

fn simulate(directory: &Path, name: &str, arguments: &[&str]) {
    atvrec(directory)
        .args(["simulate", "-o", name])
        .args(arguments)
        .assert()
        .success();
}

fn json(directory: &Path, arguments: &[&str]) -> Value {
    let output = atvrec(directory)
        .arg("identify")
        .args(arguments)
        .arg("--json")
        .output()
        .expect("the program runs");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    serde_json::from_slice(&output.stdout).expect("JSON")
}

fn value(found: &Value, name: &str) -> f64 {
    let results = found["results"].as_array().expect("results");
    let findings = results
        .iter()
        .flat_map(|r| r["findings"].as_array().expect("findings"));
    let finding = findings.clone().find(|f| f["name"] == name);
    finding
        .and_then(|f| f["value"].as_f64())
        .unwrap_or(f64::NAN)
}

#[test]
fn a_slow_sine_gives_cornering_stiffness_and_its_file_goes_into_the_configuration() {
    let place = tempfile::tempdir().unwrap();
    let here = place.path();
    simulate(here, "sine.mcap", &["--manoeuvre", "slow-sine"]);
    let arguments = [
        "cornering",
        "sine.mcap",
        "-o",
        "found.toml",
        "--report",
        "page.html",
    ];
    let found = json(here, &arguments);
    let [front, rear] =
        ["front", "rear"].map(|axle| value(&found, &format!("cornering_stiffness_{axle}")));
    // The vehicle file's tyres under their loads at rest: 5975 and 17075 N/rad.
    assert!((front / 5975.0 - 1.0).abs() < 0.1, "{front}");
    assert!((rear / 17075.0 - 1.0).abs() < 0.1, "{rear}");
    let page = std::fs::read_to_string(here.join("page.html")).unwrap();
    assert!(page.contains("cornering_stiffness_front") && page.contains("slip angle"));
    let text = "[vehicle]\nfile = \"prowler\"\noverrides = [\"found.toml\"]\n";
    std::fs::write(here.join("atvrec.toml"), text).unwrap();
    atvrec(here)
        .args(["check", "--no-devices"])
        .assert()
        .success();
    let other = "[vehicle]\nfile = \"prowler-table-2.3\"\noverrides = [\"found.toml\"]\n";
    std::fs::write(here.join("atvrec.toml"), other).unwrap();
    let refused = atvrec(here)
        .args(["check", "--no-devices"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&refused.stderr).into_owned()
        + &String::from_utf8_lossy(&refused.stdout);
    assert!(
        !refused.status.success() && said.contains("found for"),
        "{said}"
    );
}

#[test]
fn the_wrong_manoeuvre_and_the_wrong_vehicle_are_refused_by_name() {
    let place = tempfile::tempdir().unwrap();
    let here = place.path();
    simulate(here, "brake.mcap", &["--manoeuvre", "launch-brake"]);
    let refused = |arguments: &[&str]| {
        let output = atvrec(here)
            .arg("identify")
            .args(arguments)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let said = refused(&["understeer", "brake.mcap"]);
    assert!(
        said.contains("understeer gradient") && said.contains("circle"),
        "{said}"
    );
    let said = refused(&["friction", "brake.mcap"]);
    assert!(said.contains("friction"), "{said}");
    let said = refused(&["roll-pitch", "brake.mcap", "--vehicle", "prowler-table-2.3"]);
    assert!(said.contains("the log is of vehicle"), "{said}");
    let said = refused(&["cornering", "brake.mcap", "-o", "kept.toml"]);
    assert!(
        said.contains("cornering stiffness") && !here.join("kept.toml").exists(),
        "{said}"
    );
}

#[test]
fn roll_centres_come_from_the_vehicle_file() {
    let place = tempfile::tempdir().unwrap();
    let found = json(place.path(), &["roll-centre", "prowler"]);
    let height_m = value(&found, "roll_centre_height_front");
    assert!((0.05..0.3).contains(&height_m), "{height_m}");
}
