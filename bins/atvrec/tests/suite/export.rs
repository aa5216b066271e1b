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
    let file = export("/estimate/tyre_forces", "forces.mat");
    assert!(file.starts_with(b"MATLAB 5.0 MAT-file"));
    let (rows, data) = variable_of_mat(&file, "fl_z_n");
    assert_eq!(rows, loads_n.len());
    let found_n = data
        .chunks_exact(8)
        .map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap()));
    assert_eq!(bits(&found_n.collect::<Vec<_>>()), bits(loads_n));
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

/// Rows and data of a variable of a MAT file of level 5.
fn variable_of_mat<'f>(file: &'f [u8], name: &str) -> (usize, &'f [u8]) {
    fn elements(mut bytes: &[u8]) -> Vec<(u32, &[u8])> {
        let mut all = Vec::new();
        while bytes.len() >= 8 {
            let word =
                |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes"));
            let (kind, len) = (word(0), word(4) as usize);
            all.push((kind, &bytes[8..8 + len]));
            bytes = &bytes[8 + len.next_multiple_of(8)..];
        }
        assert!(bytes.is_empty(), "the last element is complete");
        all
    }
    for (kind, matrix) in elements(&file[128..]) {
        assert_eq!(kind, 14, "every element is a matrix");
        let [_, (5, sizes), (1, found), (_, data)] = elements(matrix)[..] else {
            panic!("flags, dimensions, name, data");
        };
        if found == name.as_bytes() {
            let rows = i32::from_le_bytes(sizes[..4].try_into().expect("4 bytes"));
            return (rows as usize, data);
        }
    }
    panic!("no variable {name}");
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
