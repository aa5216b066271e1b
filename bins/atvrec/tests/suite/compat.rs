//! A log of an earlier version (`testdata/compat`, written at commit 9361b3a by `simulate -m slow-sine
//! --for 4 --seed 11`) can be used by every later version, and its replay gives the same numbers.

use std::fs;
use std::path::{Path, PathBuf};

use crate::support::{atvrec, stdout};

fn old_log() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/compat/slow-sine-0.mcap")
}

const WHEELS: [&str; 4] = ["fl", "fr", "rl", "rr"];

/// Columns of numbers of a motion, in the order of the first version.
fn motion_columns() -> Vec<String> {
    let body = [
        "velocity_x_m_s",
        "velocity_y_m_s",
        "sideslip_rad",
        "sideslip_sigma_rad",
        "roll_rad",
        "pitch_rad",
        "roll_rate_rad_s",
        "pitch_rate_rad_s",
        "yaw_rate_rad_s",
        "acceleration_m_s2.x",
        "acceleration_m_s2.y",
        "acceleration_m_s2.z",
    ];
    let wheels = ["steer_rad", "slip_angle_rad"]
        .into_iter()
        .flat_map(|name| WHEELS.map(|wheel| format!("{wheel}.{name}")));
    let road = ["bank_rad", "grade_rad"].map(str::to_owned);
    let body = body.map(str::to_owned).into_iter();
    body.chain(wheels).chain(road).collect()
}

/// Columns of numbers of tyre forces, in the order of the first version.
fn force_columns() -> Vec<String> {
    let names = ["x_n", "y_n", "z_n", "x_sigma_n", "y_sigma_n", "z_sigma_n"];
    let each = |wheel| names.map(|name| format!("{wheel}.{name}"));
    WHEELS.into_iter().flat_map(each).collect()
}

/// FNV-1a of the bits of the numbers of some columns, row by row, and how many there are.
fn hash_of_numbers(table: &str, columns: &[String]) -> (u64, usize) {
    let mut rows = table.lines();
    let names: Vec<&str> = rows.next().expect("a line of names").split(',').collect();
    let place = |column: &String| names.iter().position(|name| name == column);
    let places: Vec<usize> = columns
        .iter()
        .map(|column| place(column).unwrap_or_else(|| panic!("no column {column}: {names:?}")))
        .collect();
    let (mut hash, mut count) = (0xcbf2_9ce4_8422_2325_u64, 0);
    for row in rows {
        let cells: Vec<&str> = row.split(',').collect();
        for place in &places {
            let number: f64 = cells[*place].parse().expect("a number");
            count += 1;
            for byte in number.to_bits().to_le_bytes() {
                hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
            }
        }
    }
    (hash, count)
}

fn without_last_column(table: &str, name: &str) -> Vec<String> {
    let rows = table.lines().map(|row| row.rsplit_once(','));
    let rows: Vec<(&str, &str)> = rows.map(|row| row.expect("two columns")).collect();
    assert_eq!(rows[0].1, name);
    rows.into_iter().map(|(row, _)| row.to_owned()).collect()
}

/// All commands work on the log, whose layout is that before contract version 0.
#[test]
fn a_log_of_the_first_version_is_read_by_every_command() {
    let directory = tempfile::tempdir().expect("a directory");
    let log = old_log();
    let log = log.to_str().expect("UTF-8");
    let run = |arguments: &[&str]| atvrec(directory.path()).args(arguments).assert();
    let text = stdout(&run(&["info", log]).success());
    assert!(text.contains("contract  none"), "{text}");
    assert!(text.contains("/raw/can0"), "{text}");
    // Its estimates are those of another force filter.
    let verified = stdout(&run(&["replay", log, "--verify", "-o", "again.mcap"]).code(3));
    assert!(
        verified.contains("VERIFIED IN PART") && verified.contains("bit-identical"),
        "{verified}"
    );
    let text = stdout(&run(&["info", "again.mcap"]).success());
    assert!(text.contains("contract  version 0"), "{text}");
    run(&["report", log, "-o", "drive.html"]).success();

    let score = |log: &str| stdout(&run(&["score", log, "--json"]).success());
    let scores = [log, "again.mcap"]
        .map(|log| -> serde_json::Value { serde_json::from_str(&score(log)).expect("JSON") });
    assert_eq!(scores[0]["seconds"], scores[1]["seconds"]);
    // The first version had truth and estimate in the contact frame alone; the replay adds the estimate
    // with a lag.
    for (score, outputs) in scores.iter().zip([1, 2]) {
        let forces = score["forces"].as_array().map(Vec::len);
        assert_eq!(forces, Some(outputs), "{score:#}");
    }
    let compared = stdout(&run(&["score", log, "--against", "again.mcap", "--json"]).success());
    assert!(compared.contains(r#""identical": false"#), "{compared}");

    for topic in [
        "/strain",
        "/deflection",
        "/wheel_speed",
        "/steer",
        "/imu/imu",
        "/can/can0/Strain_FL",
        "/raw/can0",
        "/truth/friction",
    ] {
        let export = |log: &str| stdout(&run(&["export", log, "-t", topic]).success());
        let (before, after) = (export(log), export("again.mcap"));
        // The first version did not write `/utc_offset`.
        let mut after = without_last_column(&after, "utc_ns");
        if topic == "/raw/can0" {
            // Nor did it know data length codes above 8 of classic frames.
            after = without_last_column(&after.join("\n"), "kind_len8_dlc");
        }
        assert!(before.lines().eq(after), "{topic}");
    }
}

/// A damaged log of the first version is recovered, and the recovered log is read like the whole one.
#[test]
fn a_damaged_log_of_the_first_version_is_recovered() {
    let directory = tempfile::tempdir().expect("a directory");
    let bytes = fs::read(old_log()).expect("a log");
    let cut = directory.path().join("cut.mcap");
    fs::write(cut, &bytes[..bytes.len() * 4 / 5]).expect("written");
    let run = |arguments: &[&str]| atvrec(directory.path()).args(arguments).assert();
    run(&["recover", "cut.mcap"]).code(3);
    let text = stdout(&run(&["info", "cut.mcap"]).success());
    assert!(text.contains("contract  none"), "{text}");
    let verified = stdout(&run(&["replay", "cut.mcap", "--verify"]).code(3));
    assert!(verified.contains("bit-identical"), "{verified}");
    let loads = stdout(&run(&["export", "cut.mcap", "-t", "/truth/contact_forces"]).success());
    let (_, count) = hash_of_numbers(&loads, &["rr.z_n".to_owned()]);
    assert!((200..400).contains(&count), "{count} of 400 instants");
}

/// The numbers of a replay by the present force filter. A change of arithmetic changes them: such a change
/// says so, and prints the accuracy before and after.
#[test]
fn a_replay_of_the_first_versions_log_gives_its_numbers() {
    let directory = tempfile::tempdir().expect("a directory");
    let log = old_log();
    let run = |arguments: &[&str]| atvrec(directory.path()).args(arguments).assert().success();
    run(&["replay", log.to_str().expect("UTF-8"), "-o", "again.mcap"]);
    for (topic, columns, expected) in [
        (
            "/estimate/motion",
            motion_columns(),
            (13_743_655_762_600_020_894, 8_800),
        ),
        (
            "/estimate/contact_forces",
            force_columns(),
            (8_601_622_893_584_541_049, 9_600),
        ),
    ] {
        let table = stdout(&run(&["export", "again.mcap", "-t", topic]));
        assert_eq!(hash_of_numbers(&table, &columns), expected, "{topic}");
    }
}
