//! Logs from others' files.

use std::fs;
use std::path::Path;

use crate::support::{atvrec, stderr, stdout};

fn write(directory: &Path, files: &[(&str, &str)]) {
    for (name, text) in files {
        fs::write(directory.join(name), text).expect("written");
    }
}

const MAP: &str = r#"
[time]
column = "time [ms]"
unit = "ms"
[table]
delimiter = ";"
decimal_comma = true
[column.speed]
from = "v"
quantity = "speed.forward"
unit = "km/h"
[column.oil]
from = 3
quantity = "signal"
unit = "degC"
"#;

#[test]
fn a_table_becomes_a_log_that_verifies() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let mut text = "# made by hand\ntime [ms];v;oil\n".to_owned();
    for row in 0..200 {
        // The oil temperature has a tenth of the rate. One second is missing in the middle.
        let oil = if row % 10 == 0 { "90,5" } else { "" };
        let time = 10 * row + if row >= 100 { 1000 } else { 0 };
        text.push_str(&format!("{time};36,0;{oil}\n"));
    }
    write(here, &[("t.csv", &text), ("map.toml", MAP)]);
    let assert = atvrec(here)
        .args([
            "import",
            "csv",
            "t.csv",
            "--columns",
            "map.toml",
            "-o",
            "t.mcap",
        ])
        .assert()
        .success();
    let told = stdout(&assert);
    assert!(
        told.contains("200 rows") && told.contains("1 gaps"),
        "{told}"
    );
    atvrec(here)
        .args(["replay", "t.mcap", "--verify"])
        .assert()
        .success();
    let assert = atvrec(here)
        .args(["info", "t.mcap", "--json"])
        .assert()
        .success();
    let info = stdout(&assert);
    for topic in ["/ground_speed/t", "/control/t", "/raw/t"] {
        assert!(info.contains(topic), "{info}");
    }
}

#[test]
fn mistakes_in_a_table_are_told_with_row_column_and_value() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let text = "time [ms];v;oil\n0;1,0;1\n10;fast;1\n20;1,0;1\n5;1,0;1\nx;1,0;1\n30;1\n";
    write(here, &[("t.csv", text), ("map.toml", MAP)]);
    let import = |extra: &[&str]| {
        let assert = atvrec(here)
            .args([
                "import",
                "csv",
                "t.csv",
                "--columns",
                "map.toml",
                "-o",
                "t.mcap",
            ])
            .args(extra)
            .assert()
            .code(2);
        stderr(&assert)
    };
    let told = import(&[]);
    for part in [
        "t.csv:3: column \"v\" (speed.forward): \"fast\" is not a number",
        "column \"time [ms]\": \"x\" is not a time",
        "t.csv:7: the row ends before column 3",
        "the time decreases",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    write(here, &[("t.csv", "time;v;oil\n0;1;1\n")]);
    let told = import(&[]);
    assert!(
        told.contains("no column \"time [ms]\"; its columns are: time, v, oil"),
        "{told}"
    );
}

const ALOG: &str = "\
%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%
%% LOG FILE:       drive.alog
%% LOGSTART             1258500000.5
%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%
0.000           DB_TIME              MOOSDB_car 1258500000.5
0.100           zGyroZ_gXbow440      gXbow440   -0.5
0.100           zAccelY_gXbow440     gXbow440   -2.0
0.120           zGyroZ_gXbow440      gXbow440   -0.7
0.110           zGyroZ_gXbow440      gXbow440   -0.6
0.110           zAccelY_gXbow440     gXbow440   -2.1
0.120           zAccelY_gXbow440     gXbow440   -2.2
0.200           zATT_NED             gSeptentrio [3x1]{0.01,0.02,1.5}
0.205           zHorizSpeed          gNovatel   12.0
0.205           zCourse              gNovatel   90.0
0.300           zNote                pApp       words with blanks
0.400           zGyr";

#[test]
fn a_moos_log_becomes_a_log_in_the_order_of_time() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    write(here, &[("drive.alog", ALOG)]);
    let assert = atvrec(here)
        .args(["import", "alog", "drive.alog", "-o", "drive.mcap"])
        .assert()
        .success();
    assert!(
        stdout(&assert).contains("1 lines are not in the order of time"),
        "{}",
        stdout(&assert)
    );
    atvrec(here)
        .args(["replay", "drive.mcap", "--verify"])
        .assert()
        .success();
    let assert = atvrec(here)
        .args(["info", "drive.mcap", "--json"])
        .assert()
        .success();
    let info: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
    let text = info.to_string();
    for topic in ["/imu/drive", "/gnss/drive/attitude", "/gnss/drive/velocity"] {
        assert!(text.contains(topic), "{info:#}");
    }
    // The wrong map names what there is.
    write(
        here,
        &[(
            "map.toml",
            "[column.x]\nfrom = \"zNothing\"\nquantity = \"signal\"\n",
        )],
    );
    let assert = atvrec(here)
        .args([
            "import",
            "alog",
            "drive.alog",
            "--columns",
            "map.toml",
            "-o",
            "x.mcap",
        ])
        .assert()
        .code(2);
    assert!(
        stderr(&assert).contains("zGyroZ_gXbow440"),
        "{}",
        stderr(&assert)
    );
}
