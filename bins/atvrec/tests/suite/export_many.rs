//! Exports of several topics: datasets, wide tables, GPX, ROS 2 bags, MF4.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use sample::LogTime;
use store::{Reader, Values};

use crate::support::{atvrec, names, simulate, stderr, stdout};

const FORCES: &str = "/estimate/tyre_forces";

/// Runs `export` with the arguments and returns its exit code, its output and its errors.
fn export(directory: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let mut command = atvrec(directory);
    let assert = command.arg("export").args(arguments).assert();
    let code = assert.get_output().status.code();
    (code, stdout(&assert), stderr(&assert))
}

/// Paths of all files below a directory, relative to it.
fn files(directory: &Path) -> Vec<PathBuf> {
    let mut all = Vec::new();
    for name in names(directory) {
        let path = directory.join(&name);
        if path.is_dir() {
            all.extend(
                files(&path)
                    .iter()
                    .map(|below| Path::new(&name).join(below)),
            );
        } else {
            all.push(name.into());
        }
    }
    all
}

/// The columns of a Parquet file.
fn columns(path: &Path) -> BTreeMap<String, Vec<Field>> {
    let reader = SerializedFileReader::new(File::open(path).expect("a file")).expect("Parquet");
    let mut all: BTreeMap<String, Vec<Field>> = BTreeMap::new();
    for row in reader.get_row_iter(None).expect("rows") {
        for (name, field) in row.expect("a row").get_column_iter() {
            all.entry(name.clone()).or_default().push(field.clone());
        }
    }
    all
}

/// Numbers of a column; NaN where it is null.
fn numbers(column: &[Field]) -> Vec<f64> {
    let number = |field: &Field| match field {
        Field::Double(value) => *value,
        Field::Null => f64::NAN,
        other => panic!("{other:?}"),
    };
    column.iter().map(number).collect()
}

fn bits(list: &[f64]) -> Vec<u64> {
    list.iter().map(|value| value.to_bits()).collect()
}

#[test]
fn a_dataset_has_all_runs_and_takes_no_run_twice() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let log = simulate(here, "a.mcap", 1);
    simulate(here, "b.mcap", 2);
    simulate(here, "c.mcap", 3);
    let (code, text, errors) = export(here, &["a.mcap", "b.mcap", "--all", "-o", "data"]);
    assert_eq!((code, &*errors), (Some(0), ""), "{errors}");
    assert_eq!(text.lines().count(), 2, "{text}");
    let place = |run: u32| {
        format!("vehicle=Prowler%2C%20road%20tyres/date=2009-04-15/run=simulate-step-steer-{run}")
    };
    let data = here.join("data");
    let forces = |run| {
        let topic = "topic=%2Festimate%2Ftyre_forces/part-0.parquet";
        data.join(place(run)).join(topic)
    };
    assert!(forces(1).is_file() && forces(2).is_file());
    let topics = names(&data.join(place(1)));
    for topic in &topics {
        let without = ["clock", "notice", "scene", "tf"].map(|name| format!("topic=%2F{name}"));
        assert!(
            !without.contains(topic) && !topic.contains("%2Fraw%2F"),
            "{topic}"
        );
    }
    assert!(topics.contains(&"topic=%2Fcan%2Fcan0%2FSteering".to_owned()));
    let table = Reader::open([log]).expect("a log");
    let table = table
        .table(FORCES, LogTime(0), LogTime(u64::MAX))
        .expect("a table");
    let load = table.columns.iter().find(|column| column.name == "fl.z_n");
    let Some(Values::F64(loads_n)) = load.map(|column| &column.values) else {
        panic!("{load:?}");
    };
    let found = columns(&forces(1));
    assert_eq!(bits(&numbers(&found["fl.z_n"])), bits(loads_n));
    assert!(found.contains_key("utc") && found.contains_key("log_time"));

    let before = files(&data);
    let (code, _, errors) = export(here, &["c.mcap", "b.mcap", "--all", "-o", "data"]);
    assert_eq!(code, Some(2));
    assert!(
        errors.contains("contains the run simulate-step-steer-2 already"),
        "{errors}"
    );
    assert!(errors.contains("--force"), "{errors}");
    assert_eq!(files(&data), before, "nothing of the third run is there");
    let kept = fs::metadata(forces(1))
        .expect("there")
        .modified()
        .expect("a time");
    fs::write(data.join(place(2)).join("stale"), "").expect("written");
    let arguments = ["c.mcap", "b.mcap", "--all", "-o", "data", "--force"];
    let (code, _, errors) = export(here, &arguments);
    assert_eq!(code, Some(0), "{errors}");
    assert!(forces(3).is_file());
    assert!(
        !data.join(place(2)).join("stale").exists(),
        "the old run is gone"
    );
    assert_eq!(names(&data), ["vehicle=Prowler%2C%20road%20tyres"]);
    let now = fs::metadata(forces(1))
        .expect("there")
        .modified()
        .expect("a time");
    assert_eq!(now, kept, "the first run is untouched");
}

#[test]
fn a_folder_with_other_data_gets_no_dataset() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    simulate(here, "drive.mcap", 1);
    fs::create_dir(here.join("mine")).expect("created");
    fs::write(here.join("mine/notes.txt"), "mine").expect("written");
    for (output, message) in [
        (
            "mine",
            "contains notes.txt, which is not a part of a dataset",
        ),
        (".", "contains drive.mcap, which is not a part of a dataset"),
        ("drive.mcap", "is a file; use the name of a folder"),
        ("none/data", "the directory none does not exist"),
    ] {
        for force in [None, Some("--force")] {
            let arguments = ["drive.mcap", "--all", "-o", output]
                .into_iter()
                .chain(force);
            let (code, _, errors) = export(here, &arguments.collect::<Vec<_>>());
            assert_eq!(code, Some(2), "{errors}");
            assert!(errors.contains(message), "{errors}");
        }
    }
    assert_eq!(
        files(here),
        ["drive.mcap", "mine/notes.txt"].map(PathBuf::from)
    );
    let (code, _, errors) = export(here, &["mine/notes.txt", "--all", "-o", "data"]);
    assert_eq!(code, Some(1), "{errors}");
    assert!(!here.join("data").exists());
}

/// A message `atvrec.WheelSpeed` with one wheel.
fn wheel_speed(axle: u8, rad_s: f64) -> Vec<u8> {
    let mut wheel = vec![0x08, axle, 0x12, 4];
    wheel.extend(b"left");
    wheel.push(0x19);
    wheel.extend(rad_s.to_le_bytes());
    let length = u8::try_from(wheel.len()).expect("short");
    [vec![0x2a, length], wheel].concat()
}

/// A log with messages of wheel speeds: time in ms, axle and speed of each.
fn wheel_speeds(here: &Path, name: &str, messages: impl Iterator<Item = (u64, u8, f64)>) {
    let drive = Reader::open([simulate(here, "drive.mcap", 1)]).expect("a log");
    let mut channels = drive.channels();
    let channel = channels
        .find(|channel| channel.topic == "/wheel_speed")
        .expect("a channel");
    let file = File::create(here.join(name)).expect("a file");
    let mut writer = mcap::Writer::new(file).expect("a writer");
    let schema = writer.add_schema("atvrec.WheelSpeed", "protobuf", &channel.schema_data);
    let (schema, metadata) = (schema.expect("a schema"), BTreeMap::new());
    let id = writer.add_channel(schema, "/wheel_speed", "protobuf", &metadata);
    let id = id.expect("a channel");
    for (ms, axle, rad_s) in messages {
        let header = MessageHeader {
            channel_id: id,
            sequence: 0,
            log_time: ms * 1_000_000,
            publish_time: ms * 1_000_000,
        };
        let message = wheel_speed(axle, rad_s);
        writer
            .write_to_known_channel(&header, &message)
            .expect("written");
    }
    writer.finish().expect("closed");
}

/// The third axle appears after the rows that are in memory at a time.
#[test]
fn a_column_that_appears_late_is_in_all_rows() {
    const ROWS: u64 = 5_000;
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let messages = (0..=ROWS).map(|row| (1_000 + row, if row == ROWS { 3 } else { 1 }, row as f64));
    wheel_speeds(here, "trailer.mcap", messages);
    let (code, _, errors) = export(here, &["trailer.mcap", "--all", "-o", "data"]);
    assert_eq!(code, Some(0), "{errors}");
    let place = "vehicle=__HIVE_DEFAULT_PARTITION__/date=1970-01-01/run=trailer";
    let folder = here.join("data").join(place);
    let found = columns(&folder.join("topic=%2Fwheel_speed/part-0.parquet"));
    let late = numbers(&found["axle3_left.angular_speed_rad_s"]);
    assert_eq!(late.len() as u64, ROWS + 1);
    assert!(late[..late.len() - 1].iter().all(|value| value.is_nan()));
    assert_eq!(late.last(), Some(&5_000.0));
    let first = numbers(&found["fl.angular_speed_rad_s"]);
    assert_eq!(first[4_999], 4_999.0);
}

/// The table is made in stretches of a minute; values on both sides of their ends are used.
#[test]
fn a_wide_table_has_no_gap_between_its_stretches() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    // The end of a stretch is between two messages.
    const INTERVAL_MS: u64 = 70;
    let messages = (0..=2_000).map(|row| (5_000 + INTERVAL_MS * row, 1, row as f64));
    wheel_speeds(here, "long.mcap", messages);
    let arguments = [
        "long.mcap",
        "--wide",
        "--method",
        "linear",
        "-o",
        "long.parquet",
    ];
    let (code, _, errors) = export(here, &arguments);
    assert_eq!(code, Some(0), "{errors}");
    let found = columns(&here.join("long.parquet"));
    let speeds = numbers(&found["/wheel_speed.fl.angular_speed_rad_s"]);
    assert_eq!(speeds.len(), 14_001);
    for (row, speed) in speeds.iter().enumerate() {
        // Rows are 10 ms apart. A value near 2,000 is rounded to 2e-13.
        let expected = row as f64 * 10.0 / INTERVAL_MS as f64;
        assert!((speed - expected).abs() < 1e-9, "row {row}: {speed}");
    }
    let (code, _, errors) = export(here, &["long.mcap", "--raw", "candump", "--all", "-o", "x"]);
    assert_eq!(code, Some(2), "{errors}");
}

/// A log without protobuf messages has no tables.
#[test]
fn a_log_of_another_program_without_tables_gives_no_dataset() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let file = File::create(here.join("json.mcap")).expect("a file");
    let mut writer = mcap::Writer::new(file).expect("a writer");
    let id = writer.add_channel(0, "/text", "json", &BTreeMap::new());
    let header = MessageHeader {
        channel_id: id.expect("a channel"),
        sequence: 0,
        log_time: 1,
        publish_time: 1,
    };
    writer
        .write_to_known_channel(&header, b"{}")
        .expect("written");
    writer.finish().expect("closed");
    drop(writer);
    let (code, _, errors) = export(here, &["json.mcap", "--all", "-o", "data"]);
    assert_eq!(code, Some(1), "{errors}");
    assert!(errors.contains("the topic /text is left out"), "{errors}");
    assert!(
        errors.contains("json.mcap has no topic that is a table"),
        "{errors}"
    );
    assert_eq!(names(here), ["json.mcap"]);
}

#[test]
fn a_wide_table_has_a_row_for_each_time_and_empty_gaps() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    simulate(here, "drive.mcap", 1);
    let arguments = [
        "drive.mcap",
        "--wide",
        "--rate",
        "20",
        "-t",
        "/steer",
        "-t",
        FORCES,
    ];
    let (code, text, errors) = export(here, &arguments);
    assert_eq!(code, Some(0), "{errors}");
    let mut lines = text.lines();
    let heads: Vec<&str> = lines.next().expect("headings").split(',').collect();
    assert_eq!(heads[0], "time_ns");
    let load = heads
        .iter()
        .position(|name| *name == "/estimate/tyre_forces.fl.z_n");
    let load = load.unwrap_or_else(|| panic!("{heads:?}"));
    assert!(heads.contains(&"/steer.steering_wheel_rad"));
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert!((39..=41).contains(&rows.len()), "{} rows", rows.len());
    let times: Vec<i64> = rows
        .iter()
        .map(|row| row[0].parse().expect("a time"))
        .collect();
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] == 50_000_000));
    assert!(times[0] % 50_000_000 == 0);
    let loads = rows.iter().filter(|row| !row[load].is_empty());
    assert!(loads.count() > 30);
    // With a shorter gap than the interval of the estimates, only times of estimates have a value.
    let more = ["--max-gap", "0.001", "--rate", "1000"];
    let (code, text, errors) = export(here, &[&arguments[..2], &more, &arguments[6..]].concat());
    assert_eq!(code, Some(0), "{errors}");
    let empty = text
        .lines()
        .skip(1)
        .filter(|line| line.split(',').nth(5) == Some(""));
    assert!(empty.count() > 1_500);
    let all = [
        "drive.mcap",
        "--wide",
        "--method",
        "linear",
        "-o",
        "all.parquet",
    ];
    let (code, text, errors) = export(here, &all);
    assert_eq!(code, Some(0), "{errors}");
    assert!(
        text.contains("at 100 Hz") && text.contains("method linear"),
        "{text}"
    );
}

#[test]
fn wrong_options_of_tables_are_refused() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    simulate(here, "drive.mcap", 1);
    let before = names(here);
    for (arguments, expected, message) in [
        (&["-o", "x.csv"][..], 2, "give --topic TOPIC"),
        (
            &["-t", "/steer", "-t", FORCES, "-o", "x.csv"],
            2,
            "contains one topic",
        ),
        (
            &["--wide", "-o", "x.mat"],
            2,
            "--wide writes a .csv or .parquet file",
        ),
        (
            &["--wide", "--rate", "0"],
            2,
            "it must be a number from 0.001",
        ),
        (
            &["--wide", "--max-gap", "nan"],
            2,
            "it must be a number from",
        ),
        (
            &["--wide", "--method", "cubic"],
            2,
            "use previous, linear or nearest",
        ),
        (&["--rate", "10", "-t", "/steer"], 2, "--wide"),
        (&["--wide", "-t", "/steerr"], 1, "did you mean /steer?"),
        (
            &["-t", "/steer", "-o", "x.gpx"],
            1,
            "/steer has no positions of a receiver",
        ),
        (
            &["-t", "/nothing", "-o", "x.mf4"],
            1,
            "the log has no topic /nothing",
        ),
        (&["--all"], 2, "--output"),
        (&["--ros2"], 2, "--output"),
        (
            &["--all", "-t", "/steer", "-o", "data"],
            2,
            "cannot be used with",
        ),
    ] {
        let (code, _, errors) = export(here, &[&["drive.mcap"], arguments].concat());
        assert_eq!(code, Some(expected), "{arguments:?}: {errors}");
        assert!(errors.contains(message), "{arguments:?}: {errors}");
    }
    assert_eq!(names(here), before);
}

#[test]
fn a_track_has_the_points_of_each_receiver() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let log = simulate(here, "drive.mcap", 1);
    let (code, text, errors) = export(here, &["drive.mcap", "-o", "track.gpx"]);
    assert_eq!(code, Some(0), "{errors}");
    assert!(text.contains("2 tracks"), "{text}");
    let gpx = fs::read_to_string(here.join("track.gpx")).expect("a file");
    let counts = Reader::open([log]).expect("a log").info().channels;
    let points = counts["/gnss/novatel/position"].1 + counts["/gnss/septentrio/position"].1;
    assert_eq!(gpx.matches("<trkpt ").count() as u64, points);
    assert_eq!(gpx.matches("<trkseg>").count(), 2);
    let one = [
        "drive.mcap",
        "-t",
        "/gnss/novatel/position",
        "-o",
        "one.gpx",
    ];
    let (code, text, _) = export(here, &one);
    assert!(code == Some(0) && text.contains("1 tracks"), "{text}");
    atvrec(here)
        .args(["import", "candump", "can.log", "-o", "can.mcap"])
        .assert()
        .code(1);
    fs::write(here.join("can.log"), "(1700000000.0) can0 123#00\n").expect("written");
    atvrec(here)
        .args(["import", "candump", "can.log", "-o", "can.mcap"])
        .assert()
        .success();
    let (code, _, errors) = export(here, &["can.mcap", "-o", "none.gpx"]);
    assert_eq!(code, Some(1));
    assert!(errors.contains("no positions of a receiver"), "{errors}");
    let (code, _, errors) = export(here, &["can.mcap", "--ros2", "-o", "bag"]);
    assert_eq!(code, Some(1));
    assert!(errors.contains("no topic for a ROS 2 bag"), "{errors}");
    assert!(!here.join("none.gpx").exists() && !here.join("bag").exists());
}

#[test]
fn a_bag_is_a_file_or_a_folder_that_is_not_replaced() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    simulate(here, "drive.mcap", 1);
    let (code, _, errors) = export(here, &["drive.mcap", "--ros2", "-o", "bag"]);
    assert_eq!(code, Some(0), "{errors}");
    assert_eq!(names(&here.join("bag")), ["bag_0.mcap", "metadata.yaml"]);
    let bag = fs::read(here.join("bag/bag_0.mcap")).expect("a bag");
    let (code, _, errors) = export(here, &["drive.mcap", "--ros2", "-o", "bag"]);
    assert_eq!(code, Some(2));
    assert!(errors.contains("bag exists already"), "{errors}");
    fs::remove_file(here.join("bag/bag_0.mcap")).expect("removed");
    let (code, _, errors) = export(here, &["drive.mcap", "--ros2", "-o", "bag", "--force"]);
    assert_eq!(code, Some(0), "{errors}");
    assert_eq!(fs::read(here.join("bag/bag_0.mcap")).expect("a bag"), bag);
    fs::create_dir(here.join("mine")).expect("created");
    let (code, _, errors) = export(here, &["drive.mcap", "--ros2", "-o", "mine", "--force"]);
    assert_eq!(code, Some(2));
    assert!(
        errors.contains("is not a folder of a ROS 2 bag"),
        "{errors}"
    );
    let (code, _, errors) = export(
        here,
        &["drive.mcap", "--ros2", "-o", "drive.mcap", "--force"],
    );
    assert_eq!(code, Some(2));
    assert!(errors.contains("is the input"), "{errors}");
    let (code, _, errors) = export(here, &["drive.mcap", "--ros2", "-o", "file.mcap"]);
    assert_eq!(code, Some(0), "{errors}");
    assert_eq!(fs::read(here.join("file.mcap")).expect("a bag"), bag);
    assert_eq!(names(here), ["bag", "drive.mcap", "file.mcap", "mine"]);
}

#[test]
fn an_mf4_file_has_a_group_for_each_topic() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    simulate(here, "drive.mcap", 1);
    let two = ["drive.mcap", "-t", "/steer", "-t", FORCES, "-o", "two.mf4"];
    let (code, text, errors) = export(here, &two);
    assert_eq!(code, Some(0), "{errors}");
    assert!(text.contains("2 channel groups"), "{text}");
    let file = fs::read(here.join("two.mf4")).expect("a file");
    assert!(file.starts_with(b"MDF     4.10    "));
    let blocks = |kind: &[u8]| file.windows(4).filter(|bytes| *bytes == kind).count();
    assert_eq!(
        (blocks(b"##DG"), blocks(b"##CG"), blocks(b"##HD")),
        (2, 2, 1)
    );
    let (code, text, errors) = export(here, &["drive.mcap", "-o", "all.mf4"]);
    assert_eq!(code, Some(0), "{errors}");
    assert!(text.contains("channel groups"), "{text}");
    assert!(
        errors.contains("with texts, bytes or lists are not in the MF4 file"),
        "{errors}"
    );
}
