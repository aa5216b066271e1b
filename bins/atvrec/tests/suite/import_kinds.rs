//! Kinds of faulty tables and MOOS logs: each gives right values or a clear message.

use std::fs;
use std::path::Path;

use crate::support::{atvrec, stderr, stdout};

/// What an import printed, and its exit code.
struct Imported {
    code: Option<i32>,
    text: String,
}

fn import(here: &Path, kind: &str, map: &str, bytes: &[u8], extra: &[&str]) -> Imported {
    fs::write(here.join(format!("in.{kind}")), bytes).expect("written");
    fs::write(here.join("map.toml"), map).expect("written");
    let assert = atvrec(here)
        .args([
            "import",
            kind,
            &format!("in.{kind}"),
            "--columns",
            "map.toml",
        ])
        .args(["-o", "o.mcap", "--force"])
        .args(extra)
        .assert();
    Imported {
        code: assert.get_output().status.code(),
        text: stdout(&assert) + &stderr(&assert),
    }
}

/// Values of a column of a topic.
fn values(here: &Path, log: &str, topic: &str, column: usize) -> Vec<String> {
    let assert = atvrec(here)
        .args(["export", log, "-t", topic])
        .assert()
        .success();
    let text = stdout(&assert);
    let cell = |line: &str| line.split(',').nth(column).unwrap_or_default().to_owned();
    text.lines().skip(1).map(cell).collect()
}

const SIGNAL: &str = "[time]\ncolumn = \"t\"\n[column.v]\nquantity = \"signal\"\nunit = \"m\"\n";

fn temporary() -> tempfile::TempDir {
    tempfile::tempdir().expect("a directory")
}

#[test]
fn all_rows_arrive_however_the_file_begins() {
    let directory = temporary();
    let here = directory.path();
    let skip = SIGNAL.to_owned() + "[table]\nskip_lines = 3\n";
    let sort = SIGNAL.replace("[column", "sort = true\n[column");
    let headless = "[time]\ncolumn = 1\n[table]\nskip_lines = 2\nheader = false\n\
                    [column.v]\nfrom = 2\nquantity = \"signal\"\n";
    let utf16: Vec<u8> = std::iter::once(0xfeff)
        .chain("t,v\r\n0,1\r\n1,2\r\n2,3\r\n".encode_utf16())
        .flat_map(u16::to_le_bytes)
        .collect();
    let units = SIGNAL.to_owned() + "[table]\nunits_row = true\n";
    for (what, map, bytes) in [
        (
            "blank skipped line",
            skip.as_str(),
            &b"Title,x\n\nNote,y\nt,v\n0,1\n1,2\n2,3\n"[..],
        ),
        (
            "blank skipped line, no header",
            headless,
            b"\nNote\n0,1\n1,2\n2,3\n",
        ),
        (
            "first row is not the earliest",
            &sort,
            b"t,v\n2,3\n0,1\n1,2\n",
        ),
        ("header in a comment", SIGNAL, b"# t,v\n0,1\n1,2\n2,3\n"),
        (
            "header in a later comment",
            SIGNAL,
            b"# made\n#t,v\n0,1\n1,2\n2,3\n",
        ),
        ("UTF-16", SIGNAL, &utf16),
        ("carriage returns only", SIGNAL, b"t,v\r0,1\r1,2\r2,3\r"),
        (
            "units below the header",
            &units,
            b"t,v\ns,m\n0,1\n1,2\n2,3\n",
        ),
        ("no end of the last line", SIGNAL, b"t,v\n0,1\n1,2\n2,3"),
    ] {
        let found = import(here, "csv", map, bytes, &[]);
        assert_eq!(found.code, Some(0), "{what}: {}", found.text);
        assert!(found.text.contains("3 rows"), "{what}: {}", found.text);
        assert!(
            found.text.contains("3 decoded messages"),
            "{what}: {}",
            found.text
        );
        assert_eq!(
            values(here, "o.mcap", "/control/in", 2),
            ["1", "2", "3"],
            "{what}"
        );
        let verified = atvrec(here).args(["replay", "o.mcap", "--verify"]).assert();
        verified.success();
    }
}

#[test]
fn a_last_row_that_was_cut_is_left_out() {
    let directory = temporary();
    let here = directory.path();
    for last in ["2", "2,12", "2,12.", "2,", "2,-"] {
        let text = format!("t,v\n0,121.5\n1,122.5\n{last}");
        let found = import(here, "csv", SIGNAL, text.as_bytes(), &[]);
        assert_eq!(found.code, Some(0), "{last}: {}", found.text);
        if last != "2," {
            assert!(
                found.text.contains("the last row was cut"),
                "{last}: {}",
                found.text
            );
        }
        assert_eq!(
            values(here, "o.mcap", "/control/in", 2),
            ["121.5", "122.5"],
            "{last}"
        );
    }
    let found = import(here, "csv", SIGNAL, b"t,v\n0,121.5\n1,122.5\n2\n\n", &[]);
    assert_eq!(found.code, Some(0), "{}", found.text);
    let left_out = "it is the last row, and is left out";
    assert!(found.text.contains(left_out), "{}", found.text);
    let found = import(here, "csv", SIGNAL, b"t,v\n0,121.5\n1\n2,123.5\n", &[]);
    assert_eq!(found.code, Some(2), "{}", found.text);
    assert!(
        found.text.contains("in.csv:3: the row ends before"),
        "{}",
        found.text
    );
}

#[test]
fn what_cannot_be_right_is_refused() {
    let directory = temporary();
    let here = directory.path();
    let two = |a: &str, b: &str| {
        let column = |name: &str, quantity: &str| {
            let unit = if quantity.ends_with("speed") {
                "m/s"
            } else {
                "deg"
            };
            format!("[column.{name}]\nquantity = \"{quantity}\"\nunit = \"{unit}\"\n")
        };
        format!(
            "[time]\ncolumn = \"t\"\n{}{}",
            column("v", a),
            column("w", b)
        )
    };
    let seconds = SIGNAL.to_owned();
    let packed: String = (0..100)
        .map(|s| format!("{},1\n", 123_000 + s / 60 * 100 + s % 60))
        .collect();
    let packed = format!("t,v\n{packed}");
    for (what, map, text, message) in [
        (
            "a name twice",
            SIGNAL,
            "t,v,v\n0,1,5\n",
            "positions 2 and 3",
        ),
        (
            "the time twice",
            SIGNAL,
            "t,v,t\n0,1,5\n",
            "positions 1 and 3",
        ),
        (
            "half a pair",
            &two("gnss.speed", "steer"),
            "t,v,w\n0,1,5\n",
            "needs gnss.course",
        ),
        (
            "half a place",
            &two("gnss.latitude", "steer"),
            "t,v,w\n0,1,5\n",
            "needs gnss.longitude",
        ),
        (
            "a quantity twice",
            &two("steer", "steer"),
            "t,v,w\n0,1,5\n",
            "has the quantity steer already",
        ),
        ("HHMMSS", &seconds, &packed, "unit = \"HHMMSS\""),
        (
            "HH:MM:SS",
            &seconds,
            "t,v\n12:00:00,1\n",
            "unit = \"HH:MM:SS\"",
        ),
        (
            "a spreadsheet",
            &seconds,
            "PK\u{3}\u{4}",
            "save the table as CSV",
        ),
    ] {
        let found = import(here, "csv", map, text.as_bytes(), &[]);
        assert_eq!(found.code, Some(2), "{what}: {}", found.text);
        assert!(found.text.contains(message), "{what}: {}", found.text);
        assert!(!here.join("o.mcap").exists(), "{what}");
    }
    let other = "[source.in]\nkind = \"slcan\"\ndevice = \"/dev/null\"\ndbc = []\n";
    fs::write(here.join("c.toml"), other).expect("written");
    let found = import(here, "csv", SIGNAL, b"t,v\n0,1\n", &["-c", "c.toml"]);
    assert_eq!(found.code, Some(2), "{}", found.text);
    assert!(
        found.text.contains("source.in must be of kind csv"),
        "{}",
        found.text
    );
}

#[test]
fn clocks_are_units() {
    let directory = temporary();
    let here = directory.path();
    let of = |unit: &str, more: &str| {
        SIGNAL.replace("[column", &format!("unit = \"{unit}\"\n{more}[column"))
    };
    // 2015-03-20T12:00:00Z
    let noon = 1_426_852_800_u64;
    for (map, cells, begins) in [
        (
            of("ISO 8601", ""),
            ["2015-03-20T12:00:00Z", "2015-03-20T12:00:01.5Z"],
            noon,
        ),
        (
            of("Excel days", ""),
            ["42083.5", "42083.500017361111"],
            noon,
        ),
        (
            of("HH:MM:SS", "start_unix_s = 1426809600\n"),
            ["12:00:00", "12:00:01.5"],
            noon,
        ),
        (
            of("HHMMSS", "start_unix_s = 1426809600\n"),
            ["120000", "120001.5"],
            noon,
        ),
        (of("ms", "start_unix_s = 1426852800\n"), ["0", "1500"], noon),
    ] {
        let text = format!("t,v\n{},1\n{},2\n", cells[0], cells[1]);
        let found = import(here, "csv", &map, text.as_bytes(), &[]);
        assert_eq!(found.code, Some(0), "{map}: {}", found.text);
        let times: Vec<u64> = values(here, "o.mcap", "/control/in", 0)
            .iter()
            .map(|time| time.parse().expect("a time"))
            .collect();
        assert_eq!(times[0], begins * 1_000_000_000, "{map}");
        let apart_ns = times[1] - times[0];
        assert!(apart_ns.abs_diff(1_500_000_000) < 1000, "{map}: {apart_ns}");
    }
    let gps = of("s", "week = \"w\"\n");
    let found = import(
        here,
        "csv",
        &gps,
        b"t,w,v\n475216,1836,1\n475217.5,1836,2\n",
        &[],
    );
    assert_eq!(found.code, Some(0), "{}", found.text);
    let first = &values(here, "o.mcap", "/control/in", 0)[0];
    assert_eq!(*first, format!("{noon}000000000"));
}

#[test]
fn moos_logs_with_gaps_of_values_and_several_runs() {
    let directory = temporary();
    let here = directory.path();
    let map = "[column.v]\nfrom = \"V\"\nquantity = \"signal\"\nunit = \"m\"\n";
    let head = "%% LOGSTART 1041380348.61\n";
    for (last, what) in [
        ("0.3 V app 12", "within the number"),
        ("0.3 V ap", "before the value"),
    ] {
        let text = format!("{head}0.1 V app 121.5\n0.2 V app 122.5\n{last}");
        let found = import(here, "alog", map, text.as_bytes(), &[]);
        assert_eq!(found.code, Some(0), "{what}: {}", found.text);
        assert!(
            found.text.contains("in.alog:4: the last line has no end"),
            "{}",
            found.text
        );
        assert_eq!(
            values(here, "o.mcap", "/control/in", 2),
            ["121.5", "122.5"],
            "{what}"
        );
    }
    let text = format!("{head}0.1 V app nan\n0.2 V app \n0.3 V app 3\n");
    let found = import(here, "alog", map, text.as_bytes(), &[]);
    assert_eq!(found.code, Some(0), "{}", found.text);
    assert_eq!(values(here, "o.mcap", "/control/in", 2), ["3"]);

    let text = format!("{head}0.1 V app 1\n0.2 V app 2\n%% LOGSTART 1041390000\n0.1 V app 3\n");
    let found = import(here, "alog", map, text.as_bytes(), &[]);
    assert_eq!(found.code, Some(0), "{}", found.text);
    assert_eq!(values(here, "o-1.mcap", "/control/in", 2), ["1", "2"]);
    assert_eq!(values(here, "o-2.mcap", "/control/in", 2), ["3"]);
    assert_eq!(
        values(here, "o-2.mcap", "/control/in", 0),
        ["1041390000100000000"]
    );
}

#[test]
fn the_built_in_map_knows_the_vehicle_dynamics_drives() {
    let directory = temporary();
    let here = directory.path();
    let mut text = "%% LOGSTART 1041380348.61\n".to_owned();
    let ecef = [("X", "441196.9"), ("Y", "-5360761.0"), ("Z", "3416388.1")];
    for (axis, value) in ecef {
        text += &format!("0.1 zECEF_{axis} gSeptentrio {value}\n");
    }
    for axis in ["X", "Y", "Z"] {
        text += &format!("0.1 zECEF_V{axis} gSeptentrio 1.0\n");
    }
    for name in [
        "zAccelX", "zAccelY", "zAccelZ", "zGyroX", "zGyroY", "zGyroZ",
    ] {
        text += &format!("0.2 {name} gXbow400 -9.8\n");
    }
    text += "0.3 SteerAngle gG35_2_can 90\n0.3 zYaw gSeptentrio 90.0\n";
    for wheel in ["FL", "FR", "RL", "RR"] {
        text += &format!("0.3 Wheel_Speed{wheel} gG35_2_can 60\n");
    }
    fs::write(here.join("in.alog"), text).expect("written");
    atvrec(here)
        .args(["import", "alog", "in.alog", "-o", "o.mcap"])
        .assert()
        .success();
    let velocity: Vec<f64> = (3..6)
        .map(|column| {
            values(here, "o.mcap", "/gnss/in/velocity", column)[0]
                .parse()
                .expect("a number")
        })
        .collect();
    // Rotated by hand at 32.5° north, 85.3° west.
    let expected = [1.0786, 0.9418, 0.0];
    let size = velocity.iter().map(|v| v * v).sum::<f64>();
    assert!((size - 3.0).abs() < 1e-9, "{velocity:?}");
    assert!((velocity[0] - expected[0]).abs() < 1e-3, "{velocity:?}");
    for topic in [
        "/imu/in",
        "/steer",
        "/wheel_speed",
        "/gnss/in/attitude",
        "/gnss/in/position",
    ] {
        let assert = atvrec(here).args(["info", "o.mcap"]).assert().success();
        assert!(
            stdout(&assert).contains(topic),
            "{topic}: {}",
            stdout(&assert)
        );
    }
}

/// A car that starts, drives and turns: time, speed, yaw rate, lateral acceleration, steer angle.
fn drive(mut row: impl FnMut(usize, [f64; 5]) -> String) -> String {
    let mut text = "t,v,r,ay,steer\n".to_owned();
    for index in 0..4000 {
        let t = index as f64 * 0.01;
        let speed = (2.0 * (t - 2.0)).clamp(0.0, 12.0);
        let steer = if speed > 0.0 {
            0.06 * (0.9 * t).sin()
        } else {
            0.0
        };
        let rate = speed * steer / 2.6;
        text += &row(index, [t, speed, rate, speed * rate, steer]);
    }
    text
}

fn plain(_: usize, [t, v, r, ay, steer]: [f64; 5]) -> String {
    format!("{t:.2},{v:.4},{r:.5},{ay:.4},{steer:.5}\n")
}

const DRIVE: &str = "\
[time]\ncolumn = \"t\"
[column.v]\nquantity = \"speed.forward\"\nunit = \"m/s\"
[column.r]\nquantity = \"rate.z\"\nunit = \"rad/s\"
[column.ay]\nquantity = \"acceleration.y\"\nunit = \"m/s^2\"
[column.steer]\nquantity = \"steer\"\nunit = \"rad\"
";
const CAR: &str = "name = \"car\"\n[body]\nmass_kg = 1500\nfront_axle_to_cg_m = 1.2\n\
                   cg_to_rear_axle_m = 1.4\n";

#[test]
fn units_that_cannot_be_right_are_named_before_anything_is_written() {
    let directory = temporary();
    let here = directory.path();
    fs::write(here.join("car.toml"), CAR).expect("written");
    let vehicle = ["--vehicle", "car.toml"];
    let right = drive(plain);
    let found = import(here, "csv", DRIVE, right.as_bytes(), &vehicle);
    assert_eq!(found.code, Some(0), "{}", found.text);
    assert!(!found.text.contains("times what"), "{}", found.text);
    fs::remove_file(here.join("o.mcap")).expect("removed");
    for (column, factor, question) in [
        (3, 1.0 / 9.80665, "is it in g?"),
        (3, 9.80665, "is it in m/s^2, not in g?"),
        (2, 57.295_779_5, "is the yaw rate in deg/s?"),
        (1, 3.6, "is the speed in km/h?"),
    ] {
        let text = drive(|index, mut values| {
            values[column] *= factor;
            plain(index, values)
        });
        let found = import(here, "csv", DRIVE, text.as_bytes(), &vehicle);
        assert_eq!(found.code, Some(2), "{question}: {}", found.text);
        assert!(found.text.contains(question), "{question}: {}", found.text);
        assert!(!here.join("o.mcap").exists());
    }
    let text = drive(|index, mut values| {
        values[3] /= 9.80665;
        plain(index, values)
    });
    let accepted = [&vehicle[..], &["--accept-units"]].concat();
    let found = import(here, "csv", DRIVE, text.as_bytes(), &accepted);
    assert_eq!(found.code, Some(0), "{}", found.text);
    assert!(found.text.contains("is it in g?"), "{}", found.text);
}

#[test]
fn held_values_and_overflows_are_recognised() {
    let directory = temporary();
    let here = directory.path();
    // The speed comes at 10 Hz and is held in rows of 100 Hz.
    let mut held = String::new();
    let text = drive(|index, mut values| {
        if index % 10 == 0 {
            held = format!("{:.4}", values[1] + 0.01 * (index as f64 * 0.1).sin());
        }
        values[1] = held.parse().expect("a number");
        plain(index, values)
    });
    let found = import(here, "csv", DRIVE, text.as_bytes(), &[]);
    assert_eq!(found.code, Some(0), "{}", found.text);
    assert!(
        found
            .text
            .contains("column \"v\" has a new value every 10 rows"),
        "{}",
        found.text
    );
    assert_eq!(values(here, "o.mcap", "/ground_speed/in", 2).len(), 400);
    assert_eq!(values(here, "o.mcap", "/imu/in", 2).len(), 4000);
    atvrec(here)
        .args(["replay", "o.mcap", "--verify"])
        .assert()
        .success();

    let text: String = (0..500)
        .map(|i| format!("{i},{:.1}\n", 0.1 * f64::from(i * 3 % 256)))
        .collect();
    let found = import(here, "csv", SIGNAL, format!("t,v\n{text}").as_bytes(), &[]);
    assert!(
        found.text.contains("in.csv:88: column \"v\" jumps by 256"),
        "{}",
        found.text
    );
}

#[test]
fn an_import_says_why_nothing_is_estimated() {
    let directory = temporary();
    let here = directory.path();
    fs::write(here.join("car.toml"), CAR).expect("written");
    let text = drive(plain);
    let found = import(here, "csv", DRIVE, text.as_bytes(), &[]);
    assert!(
        found
            .text
            .contains("nothing is estimated: no vehicle was given"),
        "{}",
        found.text
    );
    let without_steer = DRIVE.split("[column.steer]").next().expect("a map");
    let vehicle = ["--vehicle", "car.toml"];
    let found = import(here, "csv", without_steer, text.as_bytes(), &vehicle);
    assert_eq!(found.code, Some(0), "{}", found.text);
    let why = "nothing was estimated for car: the single-track model lacks a steering-wheel angle";
    assert!(found.text.contains(why), "{}", found.text);
    let found = import(here, "csv", DRIVE, text.as_bytes(), &vehicle);
    assert!(
        found.text.contains("of 4004 estimates have a motion"),
        "{}",
        found.text
    );
}

#[test]
fn a_slow_table_states_its_true_duration() {
    let directory = temporary();
    let here = directory.path();
    let text: String = (0..5501)
        .map(|i| format!("{:.2},1\n", f64::from(i) * 0.05))
        .collect();
    let found = import(here, "csv", SIGNAL, format!("t,v\n{text}").as_bytes(), &[]);
    assert!(
        found.text.contains("5501 rows in 275.00 s, 20.0000 Hz"),
        "{}",
        found.text
    );
}

/// Sideslip of the estimates over time, in the columns of `/estimate/motion`.
fn sideslip(here: &Path, log: &str) -> Vec<(u64, f64)> {
    let assert = atvrec(here)
        .args(["export", log, "-t", "/estimate/motion"])
        .assert()
        .success();
    let text = stdout(&assert);
    let mut lines = text.lines();
    let header = lines.next().expect("a header");
    let column = header
        .split(',')
        .position(|name| name.starts_with("sideslip_rad"))
        .expect("sideslip");
    lines
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            let time = cells[0].parse().expect("a time");
            (time, cells[column].parse().expect("a number"))
        })
        .collect()
}

#[test]
fn the_latency_of_a_column_has_an_effect_without_hard_points() {
    const LATE: usize = 15;
    let directory = temporary();
    let here = directory.path();
    fs::write(here.join("car.toml"), CAR).expect("written");
    let vehicle = ["--vehicle", "car.toml"];
    let mut angles = Vec::new();
    let right = drive(|index, values| {
        angles.push(values[4]);
        plain(index, values)
    });
    let late = drive(|index, mut values| {
        values[4] = angles[index.saturating_sub(LATE)];
        plain(index, values)
    });
    let mut all = Vec::new();
    for (text, latency) in [
        (&right, ""),
        (&late, ""),
        (&late, "latency_s = 0.15\n"),
        (&late, "delay_s = 0.15\n"),
    ] {
        let map = format!("{DRIVE}{latency}");
        let found = import(here, "csv", &map, text.as_bytes(), &vehicle);
        assert_eq!(found.code, Some(0), "{latency}: {}", found.text);
        let warned = found
            .text
            .contains("delay_s is the earlier name of latency_s");
        assert_eq!(warned, latency.starts_with("delay_s"), "{}", found.text);
        atvrec(here)
            .args(["replay", "o.mcap", "--verify"])
            .assert()
            .success();
        all.push(sideslip(here, "o.mcap"));
    }
    let error = |log: &[(u64, f64)]| {
        let pairs = all[0].iter().zip(log).skip(800);
        let squares: f64 = pairs.map(|(a, b)| (a.1 - b.1) * (a.1 - b.1)).sum();
        squares.sqrt()
    };
    let (wrong, corrected) = (error(&all[1]), error(&all[2]));
    assert!(corrected < 0.3 * wrong, "{corrected} {wrong}");
    assert_eq!(all[2], all[3]);
}
