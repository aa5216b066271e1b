use std::fs;

use sample::LogTime;
use store::{Reader, Values};

use crate::support::{atvrec, simulate, stderr, stdout};

#[test]
fn a_topic_becomes_a_table_of_the_same_numbers() {
    let directory = tempfile::tempdir().expect("a directory");
    let log = simulate(directory.path(), "drive.mcap", 1);
    let export = |topic: &str, output: &str| {
        atvrec(directory.path())
            .args(["export", "drive.mcap", "--topic", topic, "-o", output])
            .assert()
            .success();
        fs::read(directory.path().join(output)).expect("a table")
    };
    let bytes = export("/estimate/tyre_forces", "forces.csv");
    let text = String::from_utf8(bytes).expect("text");
    let (heads, rows) = text.split_once('\n').expect("a line of names");
    let at = heads.split(',').position(|name| name == "fl.z_n");
    let at = at.unwrap_or_else(|| panic!("{heads}"));
    let reader = Reader::open(&[log]).expect("a log");
    let all = (LogTime(0), LogTime(u64::MAX));
    let table = reader
        .table("/estimate/tyre_forces", all.0, all.1)
        .expect("columns");
    let load = table.columns.iter().find(|column| column.name == "fl.z_n");
    let Some(Values::F64(loads_n)) = load.map(|column| &column.values) else {
        panic!("{load:?}");
    };
    let told_n: Vec<f64> = rows
        .lines()
        .map(|row| {
            row.split(',')
                .nth(at)
                .expect("a cell")
                .parse()
                .expect("a number")
        })
        .collect();
    let bits = |list: &[f64]| list.iter().map(|n| n.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&told_n), bits(loads_n));
    assert!(export("/health", "health.parquet").starts_with(b"PAR1"));
    let steer = String::from_utf8(export("/can/can0/Steering", "steer.csv")).expect("text");
    assert!(
        steer
            .lines()
            .next()
            .is_some_and(|heads| heads.contains("[deg]")),
        "{steer}"
    );
}

#[test]
fn a_stretch_goes_to_standard_output() {
    let directory = tempfile::tempdir().expect("a directory");
    simulate(directory.path(), "drive.mcap", 1);
    let assert = atvrec(directory.path())
        .args(["export", "drive.mcap", "--topic", "/control/brake"])
        .args(["--from", "0.5", "--to", "1"])
        .assert()
        .success();
    let rows = stdout(&assert).lines().count() - 1;
    assert!(
        (24..=26).contains(&rows),
        "{rows} rows in half a second at 50 Hz"
    );
}

#[test]
fn what_cannot_be_exported_is_told() {
    let directory = tempfile::tempdir().expect("a directory");
    simulate(directory.path(), "drive.mcap", 1);
    let export = |arguments: &[&str]| {
        let mut command = atvrec(directory.path());
        command.arg("export").args(arguments).assert()
    };
    let wrong = export(&["drive.mcap", "--topic", "/imu"]).code(1);
    assert!(stderr(&wrong).contains("/imu/imu"), "the topics are listed");
    let wrong = export(&["drive.mcap", "--topic", "/imu/imu", "-o", "imu.xlsx"]).code(2);
    assert!(stderr(&wrong).contains(".parquet"));
    let stretch = ["--from", "20", "--to", "10"];
    let wrong = export(&[&["drive.mcap", "--topic", "/imu/imu"], &stretch[..]].concat()).code(2);
    assert!(stderr(&wrong).contains("--from 20 is later than --to 10"));
}
