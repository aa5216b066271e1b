//! Workshop steps of the second vehicle, with MacPherson struts in front and a live rear axle, on runs of an independent
//! simulator.

use sample::{StrainChannel, Wheel};

use crate::support::{atvrec, stdout};

fn calibration(path: &std::path::Path) -> estimator::Calibration {
    let text = std::fs::read_to_string(path).expect("a calibration");
    estimator::Calibration::from_toml(&text).expect("it parses")
}

/// Zeros of strut tubes, lower arms, tie rods, links and axle tubes, and of the potentiometers.
#[test]
fn the_jackstand_zero_of_struts_and_a_live_axle() {
    const HIDDEN: &str =
        "[hidden]\nbridge_offset_counts = 300.0\npotentiometer_offset_counts = 20.0\n";
    let Some(truth) = testkit::shared("data/truth-second/f6_jack_a.parquet") else {
        return;
    };
    let directory = tempfile::tempdir().expect("a directory");
    let at = |name: &str| directory.path().join(name);
    std::fs::write(at("options.toml"), HIDDEN).expect("written");
    atvrec(directory.path())
        .args([
            "simulate",
            "--output",
            "stands.mcap",
            "--seed",
            "7",
            "--truth",
        ])
        .arg(&truth)
        .args([
            "--vehicle",
            "second-vehicle",
            "--sensors",
            "second-vehicle-16bit",
        ])
        .args([
            "--options",
            "options.toml",
            "--true-calibration",
            "true.toml",
        ])
        .assert()
        .success();
    let assert = atvrec(directory.path())
        .args(["calibrate", "zero", "stands.mcap"])
        .assert()
        .success();
    let told = stdout(&assert);
    println!("{told}");
    assert!(told.contains("RL upper_link offset") && told.contains("FL strut_side_y offset"));
    assert!(!told.contains("sends nothing"), "{told}");
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
            let miss = found.offset_counts.unwrap_or(0.0) - truth.offset_counts.unwrap_or(0.0);
            let sigma = found.offset_sigma_counts.unwrap_or(0.0);
            println!("{wheel} {}: {miss:.1} of {sigma:.1} counts", channel.name());
            assert!(miss.abs() < 20.0, "{wheel} {}: {miss}", channel.name());
        }
    }
}
