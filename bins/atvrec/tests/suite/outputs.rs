//! Outputs replace nothing.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use crate::support::{atvrec, names, simulate, stderr, stdout};

fn refused(here: &Path, arguments: &[&str], part: &str) {
    let assert = atvrec(here).args(arguments).assert().code(2);
    let text = stderr(&assert);
    assert!(text.contains(part), "{arguments:?}: {text}");
}

fn works(here: &Path, arguments: &[&str]) -> String {
    stdout(&atvrec(here).args(arguments).assert().success())
}

const TABLE: &str = "t,v\n0,10\n0.01,10\n0.02,10\n";
const MAP: &str = "[time]\ncolumn = \"t\"\nunit = \"s\"\n[column.v]\nfrom = \"v\"\nquantity = \
                   \"speed.forward\"\nunit = \"m/s\"\n";

/// Commands that write a file, each with the option last.
const WRITERS: [(&str, &[&str]); 9] = [
    ("log", &["replay", "drive.mcap", "-o"]),
    (
        "log",
        &["simulate", "--manoeuvre", "circle", "--for", "0.2", "-o"],
    ),
    (
        "log",
        &["import", "csv", "t.csv", "--columns", "map.toml", "-o"],
    ),
    (
        "log",
        &["import", "alog", "t.alog", "--columns", "map.toml", "-o"],
    ),
    ("page", &["report", "drive.mcap", "-o"]),
    (
        "table",
        &["export", "drive.mcap", "-t", "/estimate/motion", "-o"],
    ),
    ("toml", &["import", "vehicle", "params.json", "-o"]),
    ("toml", &["identify", "roll-centre", "prowler", "-o"]),
    ("page", &["identify", "roll-centre", "prowler", "--report"]),
];

const fn name_of(kind: &str) -> &str {
    match kind.as_bytes() {
        b"log" => "old.mcap",
        b"page" => "old.html",
        b"table" => "old.csv",
        _ => "old.toml",
    }
}

fn prepared() -> tempfile::TempDir {
    let directory = tempfile::tempdir().expect("a directory");
    simulate(directory.path(), "drive.mcap", 1);
    for (name, text) in [
        ("t.csv", TABLE),
        ("map.toml", MAP),
        ("t.alog", ""),
        ("params.json", ""),
    ] {
        fs::write(directory.path().join(name), text).expect("written");
    }
    directory
}

#[test]
fn a_file_that_exists_is_replaced_by_force_only() {
    let directory = prepared();
    let here = directory.path();
    for (kind, command) in WRITERS {
        let path = here.join(name_of(kind));
        fs::write(&path, "precious").expect("written");
        refused(
            here,
            &[command, &[name_of(kind)]].concat(),
            "exists already",
        );
        // A link that leads nowhere is a file, too.
        std::os::unix::fs::symlink("nowhere", here.join("link")).expect("linked");
        refused(
            here,
            &[command, &["link"]].concat(),
            if kind == "table" { ".csv" } else { "exists" },
        );
        fs::remove_file(here.join("link")).expect("removed");
        assert_eq!(fs::read(&path).expect("there"), b"precious", "{command:?}");
    }
    for command in [WRITERS[0].1, WRITERS[4].1, WRITERS[5].1, WRITERS[7].1] {
        let kind = WRITERS.iter().find(|w| w.1 == command).expect("a writer").0;
        works(here, &[command, &[name_of(kind), "--force"]].concat());
        assert_ne!(
            fs::read(here.join(name_of(kind))).expect("there"),
            b"precious"
        );
    }
    works(here, &["info", "old.mcap"]);
    assert!(
        !names(here)
            .iter()
            .any(|name| name.contains("partial") || name.contains("active"))
    );
}

#[test]
fn an_input_is_no_output_by_whatever_name() {
    let directory = prepared();
    let here = directory.path();
    let log = fs::read(here.join("drive.mcap")).expect("there");
    for (link, hard) in [("soft.mcap", false), ("hard.mcap", true)] {
        if hard {
            fs::hard_link(here.join("drive.mcap"), here.join(link)).expect("linked");
        } else {
            std::os::unix::fs::symlink("drive.mcap", here.join(link)).expect("linked");
        }
        for output in [link, "drive.mcap"] {
            refused(
                here,
                &["replay", "drive.mcap", "--force", "-o", output],
                "cannot be its output",
            );
            refused(
                here,
                &["replay", link, "--force", "-o", output],
                "cannot be its output",
            );
        }
    }
    for (name, command) in [
        ("hard.html", &["report", "drive.mcap", "--force", "-o"][..]),
        (
            "hard.csv",
            &["export", "drive.mcap", "-t", "/mark", "--force", "-o"],
        ),
        ("hard.toml", &["calibrate", "zero", "drive.mcap", "-o"]),
        (
            "hard.toml",
            &["calibrate", "zero", "drive.mcap", "--force", "-o"],
        ),
        (
            "hard.toml",
            &["identify", "cornering", "drive.mcap", "--force", "-o"],
        ),
    ] {
        if !here.join(name).exists() {
            fs::hard_link(here.join("drive.mcap"), here.join(name)).expect("linked");
        }
        refused(here, &[command, &[name]].concat(), "cannot be its output");
    }
    let map = ["--columns", "map.toml", "--force", "-o", "map.mcap"];
    fs::hard_link(here.join("map.toml"), here.join("map.mcap")).expect("linked");
    refused(
        here,
        &[&["import", "csv", "t.csv"], &map[..]].concat(),
        "cannot be its output",
    );
    assert_eq!(fs::read(here.join("drive.mcap")).expect("there"), log);
    assert_eq!(
        fs::read_to_string(here.join("map.toml")).expect("there"),
        MAP
    );
}

#[test]
fn a_name_must_fit_what_is_written() {
    let directory = prepared();
    let here = directory.path();
    for (kind, command) in WRITERS {
        let (wrong, fitting) = match kind {
            "log" => ("new.csv", ".mcap"),
            "page" => ("new.mcap", ".html or .htm"),
            "table" => ("new.mcap", ".csv or .parquet"),
            _ => ("new.mcap", ".toml"),
        };
        refused(here, &[command, &[wrong]].concat(), fitting);
        refused(here, &[command, &[wrong, "--force"]].concat(), fitting);
        assert!(!here.join(wrong).exists());
    }
    refused(
        here,
        &["calibrate", "zero", "drive.mcap", "-o", "x.mcap"],
        ".toml",
    );
    refused(
        here,
        &["calibrate", "zero", "drive.mcap", "--report", "x.mcap"],
        ".html",
    );
    let truth = [
        "simulate",
        "-m",
        "circle",
        "-o",
        "x.mcap",
        "--true-calibration",
        "y.mcap",
    ];
    refused(here, &truth, ".toml");
    refused(
        here,
        &["report", "drive.mcap", "-o", "absent/x.html"],
        "the directory absent does not exist",
    );
    refused(here, &["report", "drive.mcap", "-o", "."], "is a directory");
}

#[test]
fn directories_of_files_are_not_replaced() {
    let directory = prepared();
    let here = directory.path();
    works(here, &["man", "pages"]);
    refused(here, &["man", "pages"], "exists already");
    works(here, &["man", "pages", "--force"]);
    fs::create_dir(here.join("ports")).expect("made");
    fs::write(here.join("ports/atvrec.toml"), "# mine").expect("written");
    refused(
        here,
        &["virtual", "-m", "circle", "-d", "ports"],
        "exists already",
    );
    refused(here, &["demo", "-d", "ports"], "exists already");
    assert_eq!(names(&here.join("ports")), ["atvrec.toml"]);
    // A simulation in a directory takes the next free name, as a recording does.
    fs::create_dir(here.join("logs")).expect("made");
    let simulate = ["simulate", "-m", "circle", "--for", "0.2", "-o", "logs"];
    works(here, &simulate);
    let first = names(&here.join("logs"));
    let bytes = fs::read(here.join("logs").join(&first[0])).expect("there");
    works(here, &simulate);
    assert_eq!(names(&here.join("logs")).len(), 2 * first.len());
    assert_eq!(
        fs::read(here.join("logs").join(&first[0])).expect("there"),
        bytes
    );
}

#[test]
fn devices_stay_devices() {
    let directory = prepared();
    let here = directory.path();
    let export = ["export", "drive.mcap", "-t", "/estimate/motion", "-o"];
    let table = works(here, &[&export[..], &["/dev/stdout"]].concat());
    assert!(table.starts_with("log_time_ns,"), "{table}");
    works(here, &[&export[..], &["/dev/null"]].concat());
    works(here, &["report", "drive.mcap", "-o", "/dev/null"]);
    let full = atvrec(here).args(export).arg("/dev/full").assert().code(1);
    assert!(stderr(&full).contains("/dev/full"), "{}", stderr(&full));
    refused(
        here,
        &["replay", "drive.mcap", "-o", "/dev/null"],
        "is a device",
    );
    refused(
        here,
        &["replay", "drive.mcap", "--force", "-o", "/dev/null"],
        "is a device",
    );
    assert!(!Path::new("/dev/null").is_file());
}

#[test]
fn a_full_disk_is_an_error_and_leaves_nothing() {
    let directory = prepared();
    let here = directory.path();
    let before = names(here);
    for command in [
        "export drive.mcap -t /estimate/motion -o x.csv",
        "export drive.mcap -t /estimate/motion -o x.parquet",
        "report drive.mcap -o x.html",
        "replay drive.mcap -o x.mcap",
    ] {
        let program = env!("CARGO_BIN_EXE_atvrec");
        let script = format!("trap '' XFSZ; ulimit -f 8; exec {program} {command}");
        let output = Command::new("bash")
            .args(["-c", &script])
            .current_dir(here)
            .output()
            .expect("bash runs");
        assert_eq!(output.status.code(), Some(1), "{command}");
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(
            text.contains("x.") && text.contains("too large"),
            "{command}: {text}"
        );
        assert_eq!(names(here), before, "{command}");
    }
}

#[test]
fn a_killed_command_leaves_nothing_that_looks_whole() {
    let directory = prepared();
    let here = directory.path();
    let mut replay = Command::new(env!("CARGO_BIN_EXE_atvrec"))
        .args([
            "-q",
            "replay",
            "drive.mcap",
            "--rate",
            "0.5",
            "-o",
            "again.mcap",
        ])
        .current_dir(here)
        .spawn()
        .expect("it starts");
    let active = here.join("again.mcap.active");
    let begin = Instant::now();
    // The configuration is in the log then.
    while !fs::metadata(&active).is_ok_and(|data| data.len() > 10_000) {
        assert!(
            begin.elapsed() < Duration::from_secs(20),
            "no log was begun"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
    replay.kill().expect("killed");
    replay.wait().expect("ended");
    assert!(!here.join("again.mcap").exists());
    let left = fs::read(&active).expect("there");
    let again = ["replay", "drive.mcap", "-o", "again.mcap"];
    refused(here, &again, "atvrec recover again.mcap.active");
    // It is no output of its own replay, even by force.
    let own = ["replay", "again.mcap.active", "--force", "-o", "again.mcap"];
    refused(here, &own, "cannot be its output");
    assert_eq!(fs::read(&active).expect("there"), left);
    works(here, &[&again[..], &["--force"]].concat());
    works(here, &["replay", "again.mcap", "--verify"]);
    assert!(!active.exists());
    // A partial file of another kind is left alone.
    fs::write(here.join("x.csv.partial-1"), "half").expect("written");
    works(
        here,
        &[
            "export",
            "drive.mcap",
            "-t",
            "/estimate/motion",
            "-o",
            "x.csv",
        ],
    );
    assert_eq!(
        fs::read(here.join("x.csv.partial-1")).expect("there"),
        b"half"
    );
}
