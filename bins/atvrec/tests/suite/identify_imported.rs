//! `identify` on a log that another program wrote: a simulated drive whose sensors are all on one CAN bus.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use sample::LogTime;
use serde_json::Value;
use store::{Reader, Values};

use crate::support::{atvrec, stderr};

/// Messages of the devices that the virtual vehicle has on serial ports: topic, identifier, name in the DBC
/// file, and for each signal its column in the topic, its unit and its role.
type Device = (
    &'static str,
    u32,
    &'static str,
    &'static [(&'static str, &'static str, &'static str)],
);
const DEVICES: [Device; 3] = [
    (
        "/imu/imu",
        0x400,
        "Imu",
        &[
            ("specific_force_m_s2.x", "m/s^2", "acceleration.x"),
            ("specific_force_m_s2.y", "m/s^2", "acceleration.y"),
            ("specific_force_m_s2.z", "m/s^2", "acceleration.z"),
            ("angular_rate_rad_s.x", "rad/s", "rate.x"),
            ("angular_rate_rad_s.y", "rad/s", "rate.y"),
            ("angular_rate_rad_s.z", "rad/s", "rate.z"),
        ],
    ),
    (
        "/gnss/novatel/velocity",
        0x401,
        "Velocity",
        &[
            ("velocity_m_s.east", "m/s", "gnss.velocity_east"),
            ("velocity_m_s.north", "m/s", "gnss.velocity_north"),
            ("velocity_m_s.up", "m/s", "gnss.velocity_up"),
        ],
    ),
    (
        "/gnss/septentrio/attitude",
        0x402,
        "Attitude",
        &[
            ("yaw_rad", "rad", "gnss.yaw"),
            ("pitch_rad", "rad", "gnss.pitch"),
            ("roll_rad", "rad", "gnss.roll"),
        ],
    ),
];

/// Writes `drive.log` (as `candump -L` of the bus), `bus.dbc` and `bus.toml` of the simulated log `drive.mcap`.
fn put_on_one_bus(here: &Path) {
    atvrec(here)
        .args(["export", "drive.mcap", "--raw", "candump", "-o", "can0.log"])
        .assert()
        .success();
    let reader = Reader::open([here.join("drive.mcap")]).expect("a log");
    let text = fs::read_to_string(here.join("can0.log")).expect("frames");
    let stamp = |line: &str| line[1..18].to_owned();
    let mut lines: Vec<(String, String)> = text
        .lines()
        .map(|line| (stamp(line), line.to_owned()))
        .collect();
    let attached = reader.attachments().expect("files");
    let dbc = attached.iter().find(|file| file.name == "prowler.dbc");
    let mut dbc = String::from_utf8(dbc.expect("the DBC file").data.clone()).expect("text");
    let mut floats = String::new();
    let mut config = "[source.can0]\nkind = \"can\"\ninterface = \"can0\"\ndbc = [\"bus.dbc\"]\n\
                      [source.can0.roles]\n"
        .to_owned();
    for (topic, id, name, signals) in DEVICES {
        let table = reader.table(topic, LogTime(0), LogTime(u64::MAX));
        let table = table.expect("a table");
        let columns = signals.iter().map(|(column, ..)| {
            let found = table.columns.iter().find(|found| found.name == *column);
            match &found.expect(column).values {
                Values::F64(values) => values,
                _ => panic!("{column} has no numbers"),
            }
        });
        let columns: Vec<&Vec<f64>> = columns.collect();
        for (row, time_ns) in table.publish_time_ns.iter().enumerate() {
            let stamp = format!(
                "{}.{:06}",
                time_ns / 1_000_000_000,
                time_ns % 1_000_000_000 / 1000
            );
            let mut line = format!("({stamp}) can0 {id:03X}##0");
            for column in &columns {
                for byte in column[row].to_le_bytes() {
                    let _ = write!(line, "{byte:02X}");
                }
            }
            lines.push((stamp, line));
        }
        let _ = write!(dbc, "\nBO_ {id} {name}: {} Recorder\n", 8 * signals.len());
        for (at, (_, unit, role)) in signals.iter().enumerate() {
            let bit = 64 * at;
            let _ = writeln!(
                dbc,
                " SG_ s{at} : {bit}|64@1- (1,0) [0|0] \"{unit}\" Recorder"
            );
            let _ = writeln!(floats, "SIG_VALTYPE_ {id} s{at} : 2;");
            let _ = writeln!(config, "{role} = \"{name}.s{at}\"");
        }
    }
    lines.sort_by(|(one, _), (other, _)| one.cmp(other));
    let lines: Vec<String> = lines.into_iter().map(|(_, line)| line + "\n").collect();
    config += "[vehicle]\nfile = \"prowler\"\nsensors = \"thesis-10bit\"\n";
    for (name, text) in [
        ("drive.log", lines.concat()),
        ("bus.dbc", dbc + "\n" + &floats),
        ("bus.toml", config),
    ] {
        fs::write(here.join(name), text).expect("written");
    }
}

fn identify(here: &Path, what: &str, log: &str) -> Value {
    let assert = atvrec(here)
        .args(["identify", what, log, "--json"])
        .assert()
        .success();
    serde_json::from_slice(&assert.get_output().stdout).expect("JSON")
}

/// Value and standard deviation of the cornering stiffnesses.
fn stiffness(found: &Value) -> [(f64, f64); 2] {
    let findings = found["results"]
        .as_array()
        .expect("results")
        .iter()
        .flat_map(|result| result["findings"].as_array().expect("findings"));
    let findings: Vec<&Value> = findings.collect();
    ["cornering_stiffness_front", "cornering_stiffness_rear"].map(|name| {
        let finding = findings.iter().find(|finding| finding["name"] == name);
        let finding = finding.expect(name);
        let number = |key: &str| finding[key].as_f64().expect("a number");
        (number("value"), number("sigma"))
    })
}

#[test]
fn identification_of_an_imported_drive_gives_the_numbers_of_the_original() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let run = |arguments: &[&str]| {
        atvrec(here).args(arguments).assert().success();
    };
    let seed = ["--seed", "11", "-o", "drive.mcap"];
    run(&[&["simulate", "-m", "slow-sine"], &seed[..]].concat());
    put_on_one_bus(here);
    let configured = ["import", "candump", "drive.log", "-c", "bus.toml", "-o"];
    run(&[&configured[..], &["first.mcap"]].concat());
    // The raw frames go out, come in without a configuration, and get one in a replay.
    run(&["export", "first.mcap", "--raw", "candump", "-o", "out.log"]);
    run(&["import", "candump", "out.log", "-o", "raw.mcap"]);
    run(&["replay", "raw.mcap", "-c", "bus.toml", "-o", "again.mcap"]);
    for what in ["cornering", "tyre", "roll-pitch"] {
        let [first, again] = ["first.mcap", "again.mcap"].map(|log| identify(here, what, log));
        assert_eq!(first, again, "{what}");
    }
    // The simulated vehicle has a second receiver, so that the numbers agree within their uncertainty.
    let [simulated, imported] =
        ["drive.mcap", "again.mcap"].map(|log| stiffness(&identify(here, "cornering", log)));
    for ((value, sigma), (other, other_sigma)) in simulated.into_iter().zip(imported) {
        let apart = (value - other).abs() / math::hypot(sigma, other_sigma);
        assert!(apart < 2.0, "{value} +- {sigma}, {other} +- {other_sigma}");
    }
    // Without estimates, the message says how to get them.
    let refused = atvrec(here)
        .args(["identify", "cornering", "raw.mcap"])
        .assert()
        .code(1);
    let told = stderr(&refused);
    assert!(
        told.contains("nothing was estimated") && told.contains("atvrec replay --config FILE -o"),
        "{told}"
    );
}
