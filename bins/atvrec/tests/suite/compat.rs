//! A log of an earlier version (`testdata/compat`, written at commit 9361b3a by `simulate -m slow-sine
//! --for 4 --seed 11`) can be used by every later version, and its replay gives the same numbers.

use std::fs;
use std::path::{Path, PathBuf};

use crate::support::{atvrec, stdout};

fn old_log() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/compat/slow-sine-0.mcap")
}

/// FNV-1a of the bits of all numbers of a table, row by row. Names of columns, stamps and words do
/// not count.
fn hash_of_numbers(table: &str) -> (u64, usize) {
    let mut rows = table.lines();
    let names: Vec<&str> = rows.next().expect("a line of names").split(',').collect();
    let (mut hash, mut count) = (0xcbf2_9ce4_8422_2325_u64, 0);
    for row in rows {
        for (name, cell) in names.iter().zip(row.split(',')) {
            let Ok(number) = cell.parse::<f64>() else {
                continue;
            };
            if name.ends_with("_ns") {
                continue;
            }
            count += 1;
            for byte in number.to_bits().to_le_bytes() {
                hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
            }
        }
    }
    (hash, count)
}

#[test]
fn a_log_of_the_first_version_is_read_by_every_command() {
    let directory = tempfile::tempdir().expect("a directory");
    let log = old_log();
    let log = log.to_str().expect("UTF-8");
    let run = |arguments: &[&str]| atvrec(directory.path()).args(arguments).assert().success();
    assert!(stdout(&run(&["info", log])).contains("/estimate/tyre_forces"));
    assert!(stdout(&run(&["replay", log, "--verify"])).contains("bit-identical"));
    run(&["report", log, "-o", "drive.html"]);
    run(&["export", log, "-t", "/imu/imu", "-o", "imu.csv"]);
    run(&["score", log]);
}

/// The numbers of a replay by commit 9361b3a. A change of arithmetic changes them: such a change says
/// so, and prints the accuracy before and after.
#[test]
fn a_replay_of_the_first_versions_log_gives_its_numbers() {
    let directory = tempfile::tempdir().expect("a directory");
    let log = old_log();
    let run = |arguments: &[&str]| atvrec(directory.path()).args(arguments).assert().success();
    run(&["replay", log.to_str().expect("UTF-8"), "-o", "again.mcap"]);
    for (topic, expected) in [
        ("/estimate/motion", (0x6106_f77e_3f65_9095, 8_800)),
        ("/estimate/tyre_forces", (0x2b49_8488_2001_6757, 9_600)),
    ] {
        run(&[
            "export",
            "again.mcap",
            "-t",
            topic,
            "-o",
            "table.csv",
            "--force",
        ]);
        let table = fs::read_to_string(directory.path().join("table.csv")).expect("a table");
        assert_eq!(hash_of_numbers(&table), expected, "{topic}");
    }
}
