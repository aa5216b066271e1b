//! `atvrec check --with`: a configuration against a log.

use std::fs;
use std::path::Path;

use crate::support::{atvrec, stderr, stdout};

/// A drive with turns and braking, and the configuration of its log as files.
fn recorded(directory: &Path) {
    atvrec(directory)
        .args([
            "--quiet",
            "simulate",
            "--manoeuvre",
            "mixed-driving",
            "--for",
            "60",
        ])
        .args(["--output", "minute.mcap"])
        .assert()
        .success();
    let reader = store::Reader::open([directory.join("minute.mcap")]).expect("a log");
    for attachment in reader.attachments().expect("attachments") {
        if attachment.name == "atvrec.toml" {
            fs::write(directory.join("atvrec.toml"), &attachment.data).expect("written");
        }
    }
}

#[test]
fn a_configuration_that_fits_and_one_with_mistakes_are_told_apart() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    recorded(here);
    let check = ["check", "--with", "minute.mcap"];
    let good = stdout(&atvrec(here).args(check).assert().success());
    assert!(good.contains("\n0 misfits, 0 not decided, "), "{good}");

    // Roles of a configuration with a wrong sign, and of a message that does not arrive.
    let text = fs::read_to_string(here.join("atvrec.toml")).expect("a configuration");
    let roles = "\n[source.can0.roles]\nsteer = \"-Steering.hand_wheel_angle\"\n\
                 wheel_speed.FL = \"WheelSpeed.FR\"\nwheel_speed.FR = \"WheelSpeed.FL\"\n\
                 hitch_force.x = \"Hitch.force_x\"\n\n[vehicle]";
    fs::write(here.join("atvrec.toml"), text.replace("\n[vehicle]", roles)).expect("written");
    let wrong = stdout(&atvrec(here).args(check).assert().code(1));
    for line in [
        "does not fit: steering-wheel angle\n",
        "likely cause: the sign is reversed",
        "does not fit: wheel speeds, order of the wheels\n",
        "likely cause: the channels of FL and FR are exchanged",
        "does not fit: source can0, message Hitch\n",
        "\n3 misfits, ",
    ] {
        assert!(wrong.contains(line), "{line} is absent from\n{wrong}");
    }
    let json = stdout(&atvrec(here).args(check).arg("--json").assert().code(1));
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(json["misfits"].as_array().expect("a list").len(), 3);
    assert!(json["misfits"][0]["help"].is_string());
}

#[test]
fn a_log_of_other_sources_and_a_configuration_without_a_vehicle_are_refused() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    recorded(here);
    let source = "[source.other]\nkind = \"crossbow440\"\ndevice = \"/dev/absent\"\n";
    let check = ["check", "--with", "minute.mcap"];
    fs::write(here.join("atvrec.toml"), source).expect("written");
    let none = stderr(&atvrec(here).args(check).assert().code(2));
    assert!(none.contains("the configuration has no vehicle"), "{none}");
    let vehicle = format!("{source}[vehicle]\nfile = \"prowler\"\n");
    fs::write(here.join("atvrec.toml"), vehicle).expect("written");
    let other = stderr(&atvrec(here).args(check).assert().code(2));
    assert!(other.contains("novatel"), "{other}");
}
