//! Exposure of the units by `systemd-analyze security`, without a running systemd.

use std::path::Path;
use std::process::Command;

/// Highest exposure of the recorder and of the units that end at once, and of the live process.
const RECORDER_MAX: f64 = 1.5;
const LIVE_MAX: f64 = 2.0;

#[test]
fn the_units_expose_little() {
    let packaging = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packaging");
    for (unit, most) in [
        ("atvrec.service", RECORDER_MAX),
        ("atvrec-clock.service", RECORDER_MAX),
        ("atvrec-can@.service", RECORDER_MAX),
        ("atvrec-live.service", LIVE_MAX),
    ] {
        let analysed = Command::new("systemd-analyze")
            .args(["security", "--offline=yes", "--no-pager"])
            .arg(packaging.join(unit))
            .output();
        let Ok(output) = analysed else {
            println!("systemd-analyze is not installed: the exposure of {unit} is not tested");
            return;
        };
        let text = String::from_utf8_lossy(&output.stdout);
        let score = text
            .lines()
            .find_map(|line| {
                line.split_once("Overall exposure level for")?
                    .1
                    .split_once(": ")
            })
            .and_then(|(_, score)| score.split_whitespace().next()?.parse::<f64>().ok());
        let Some(score) = score else {
            println!("this systemd-analyze cannot analyse files: {text}");
            return;
        };
        assert!(score <= most, "{unit}: exposure {score}\n{text}");
    }
}
