//! The report of a drive as a page and as numbers.

use std::fs;
use std::path::Path;

use sample::{Event, EventKind, ForceFrame, LogTime, Motion, PerWheel, Severity, TyreForce, Wheel};
use serde_json::Value;
use store::{LogMessage, Options, Record, Session, Stage, Writer};

use crate::support::{atvrec, simulate, stderr, stdout};

/// Log clock of the first message, ns.
const START: LogTime = LogTime(1_700_000_000_000_000_000);

#[test]
fn a_report_shows_the_drive_and_what_was_learnt_in_one_file() {
    let directory = tempfile::tempdir().expect("a directory");
    simulate(directory.path(), "drive.mcap", 1);
    atvrec(directory.path())
        .args(["report", "drive.mcap", "--output", "page.html"])
        .assert()
        .success();
    let page = fs::read_to_string(directory.path().join("page.html")).expect("a page");
    let sections = [
        "wheels",
        "vehicle",
        "speed",
        "sideslip",
        "lateral",
        "vertical",
        "friction-circles",
        "gg",
        "handling",
        "grip",
        "innovations",
        "travel",
        "sources-rates",
        "track",
        "events",
        "learnt",
        "sources",
        "files",
    ];
    for section in sections {
        assert!(
            page.contains(&format!("<h2 id=\"{section}\">")),
            "{section}"
        );
    }
    assert!(page.contains("Limits at the end of the drive: "));
    assert!(page.contains("accelerometer bias, x") && page.contains("stiffness factor, rear"));
    assert!(page.contains("<p id=\"verdict\">Recording complete, no loss; "));
    let (_, body) = page.rsplit_once("<body>").expect("a body");
    let (body, _) = body.split_once("<script").expect("scripts");
    assert!(
        !body.contains("NaN") && !body.contains("inf"),
        "a number that is none"
    );
}

fn mark(at_s: f64, text: &str) -> Record {
    Record::Mark {
        time: START.offset_seconds(at_s),
        text: text.to_owned(),
    }
}

fn event(at_s: f64, kind: EventKind) -> Record {
    Record::Event(Event {
        time: START.offset_seconds(at_s),
        onset: START.offset_seconds(at_s),
        text: format!("{} happened", kind.name()),
        kind,
        probability: None,
        load_transfer_ratio: None,
    })
}

/// Estimates from `from_s` to `to_s` at 100 Hz: 10 m/s, and loads of 1000 N but for 0 N of the front left
/// wheel from 3 s to 3.4 s.
fn estimates(from_s: f64, to_s: f64) -> Vec<Record> {
    let count = ((to_s - from_s) * 100.0).round() as u32;
    let each = |step: u32| {
        let at_s = from_s + f64::from(step) * 0.01;
        let time = START.offset_seconds(at_s);
        let motion = Motion {
            velocity_x_m_s: 10.0,
            ..Motion::default()
        };
        let load_n = |wheel: Wheel| match wheel {
            Wheel::FrontLeft if (2.999..3.399).contains(&at_s) => 0.0,
            _ => 1000.0,
        };
        let forces = PerWheel::from_fn(|wheel| TyreForce {
            force_n: [-30.0, 40.0, load_n(wheel)],
            sigma_n: [5.0; 3],
            ..TyreForce::default()
        });
        [
            Record::Motion {
                time,
                stage: Stage::Estimate,
                motion: Box::new(motion),
            },
            Record::TyreForces {
                time,
                stage: Stage::Estimate,
                frame: ForceFrame::Contact,
                forces: Box::new(forces),
            },
        ]
    };
    (0..count).flat_map(each).collect()
}

fn log(directory: &Path, name: &str, records: impl IntoIterator<Item = Record>) {
    let path = directory.join(name);
    let mut writer =
        Writer::create(&path, Session::default(), Options::default(), 0).expect("a log");
    for record in records {
        writer.record(&record);
    }
    writer.finish().expect("closed");
}

fn numbers(directory: &Path, arguments: &[&str]) -> Value {
    let assert = atvrec(directory)
        .args(["report", "--json"])
        .args(arguments)
        .assert()
        .success();
    serde_json::from_str(&stdout(&assert)).expect("JSON")
}

#[test]
fn the_numbers_are_those_of_a_log_with_known_events() {
    let directory = tempfile::tempdir().expect("a directory");
    let mut records = estimates(0.0, 10.0);
    records.extend([
        event(3.0, EventKind::Lift(Wheel::FrontLeft)),
        event(3.4, EventKind::Touchdown(Wheel::FrontLeft)),
        event(5.0, EventKind::SensorFault("FL lower_front".to_owned())),
        event(6.2, EventKind::SensorRecovered("FL lower_front".to_owned())),
        mark(7.0, "gravel"),
    ]);
    log(directory.path(), "known.mcap", records);
    let found = numbers(directory.path(), &["known.mcap"]);
    assert_eq!(found["events"].as_array().map(Vec::len), Some(4));
    assert_eq!(found["events"][0]["kind"], "lift");
    assert_eq!(
        (&found["marks"], &found["estimates"]),
        (&1.into(), &1000.into())
    );
    let near = |value: &Value, expected: f64, tolerance: f64| {
        let found = value.as_f64().expect("a number");
        assert!((found - expected).abs() <= tolerance, "{found} {expected}");
    };
    near(&found["distance_m"], 99.9, 0.01);
    let front_left = &found["wheels"][0];
    assert_eq!(front_left["lifts"], 1);
    near(&front_left["z"]["min"], 0.0, 0.0);
    near(&front_left["z"]["max"], 1000.0, 0.0);
    // 40 of 1000 samples are without load.
    near(&front_left["z"]["rms"], 1000.0 * 0.96_f64.sqrt(), 0.01);
    near(&front_left["z"]["sigma"], 5.0, 0.0);
    near(&front_left["utilisation"], 0.05, 1e-6);
    assert_eq!(found["wheels"][1]["lifts"], 0);
    let verdict = found["verdict"].to_string();
    for text in [
        "1 wheel lift\"",
        "1 sensor fault (FL lower_front for 1.2 s)",
        "recording complete, no loss",
    ] {
        assert!(verdict.contains(text), "{verdict}");
    }
    let kn = numbers(directory.path(), &["known.mcap", "--units", "metric"]);
    near(&kn["wheels"][0]["z"]["max"], 1.0, 1e-9);
    near(&kn["vehicle_values"]["speed_max"]["value"], 36.0, 1e-9);

    let around = numbers(directory.path(), &["known.mcap", "--around", "lift"]);
    near(&around["from_s"], 0.0, 1e-6);
    near(&around["to_s"], 8.0, 1e-6);
    let part = numbers(
        directory.path(),
        &["known.mcap", "--from", "4", "--to", "6"],
    );
    assert_eq!(part["events"].as_array().map(Vec::len), Some(1));
    let absent = atvrec(directory.path())
        .args(["report", "known.mcap", "--around", "filter_reset", "--json"])
        .assert()
        .code(1);
    let told = stderr(&absent);
    assert!(
        told.contains("no mark \"filter_reset\"") && told.contains("sensor_fault"),
        "{told}"
    );
    let smoothed = atvrec(directory.path())
        .args(["report", "known.mcap", "--smoothed", "--json"])
        .assert()
        .code(1);
    assert!(stderr(&smoothed).contains("replay --smooth"));
}

#[test]
fn events_are_listed_and_written_with_the_seconds_around_them() {
    let directory = tempfile::tempdir().expect("a directory");
    let mut records = estimates(0.0, 20.0);
    records.push(event(10.0, EventKind::Lift(Wheel::RearRight)));
    log(directory.path(), "drive.mcap", records);
    let list = atvrec(directory.path())
        .args(["events", "drive.mcap"])
        .assert()
        .success();
    assert!(stdout(&list).contains("10.00  lift"), "{}", stdout(&list));
    atvrec(directory.path())
        .args(["events", "drive.mcap", "--snapshot", "shots"])
        .assert()
        .success();
    let shot = directory.path().join("shots");
    let text = fs::read_to_string(shot.join("event-1-lift.json")).expect("values");
    let values: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(values["event"]["kind"], "lift");
    let found = numbers(&shot, &["event-1-lift.mcap"]);
    assert_eq!(found["events"][0]["kind"], "lift");
    let duration_s = found["duration_s"].as_f64().expect("a number");
    assert!((duration_s - 10.0).abs() < 0.02, "{duration_s}");
}

#[test]
fn two_runs_are_compared_and_the_page_says_what_is_lacking() {
    let directory = tempfile::tempdir().expect("a directory");
    log(directory.path(), "a.mcap", estimates(0.0, 5.0));
    log(directory.path(), "b.mcap", estimates(0.0, 4.0));
    for by in ["time", "distance"] {
        let page = format!("{by}.html");
        atvrec(directory.path())
            .args([
                "report",
                "a.mcap",
                "--against",
                "b.mcap",
                "--by",
                by,
                "-o",
                &page,
            ])
            .assert()
            .success();
        let page = fs::read_to_string(directory.path().join(page)).expect("a page");
        assert!(page.contains("\"n\":\"other run\"") && page.contains("What this log lacks"));
    }
    // A figure of which the log has nothing is listed once.
    let found = numbers(directory.path(), &["a.mcap"]);
    let lacking = found["lacking"].as_array().expect("a list");
    let track = lacking
        .iter()
        .filter(|entry| entry["figure"] == "Track")
        .count();
    assert_eq!(track, 1);
}

#[test]
fn a_log_that_lacks_something_is_reported_as_far_as_it_goes() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    log(here, "empty.mcap", []);
    log(
        here,
        "marks.mcap",
        (0..100_000).map(|n| mark(f64::from(n) * 0.01, "m")),
    );
    let hostile = "<!--<script>alert(1)</script>\u{1b}[31m\u{202e}";
    log(
        here,
        "hostile.mcap",
        [
            mark(0.0, hostile),
            event(1.0, EventKind::SensorFault(hostile.to_owned())),
            Record::Log(LogMessage {
                time: START,
                severity: Severity::Error,
                name: hostile.to_owned(),
                text: hostile.to_owned(),
            }),
        ],
    );
    let day_s = 86_400.0;
    let mut gap = estimates(0.0, 2.0);
    gap.extend(estimates(day_s, day_s + 2.0));
    log(here, "gap.mcap", gap);
    for name in ["empty", "marks", "hostile", "gap"] {
        let (from, to) = (format!("{name}.mcap"), format!("{name}.html"));
        atvrec(here)
            .args(["report", &from, "-o", &to])
            .assert()
            .success();
        let page = fs::read_to_string(here.join(to)).expect("a page");
        assert!(page.contains("What this log lacks"), "{name}");
        assert!(
            !page.contains("<script>alert") && !page.contains('\u{202e}'),
            "{name}"
        );
        assert!(page.len() < 2_000_000, "{name}: {} bytes", page.len());
    }
    let found = numbers(here, &["gap.mcap"]);
    let gaps = found["gaps_s"].as_array().expect("a list");
    assert_eq!(gaps.len(), 1, "{gaps:?}");
    assert_eq!(found["distance_m"].as_f64().map(f64::round), Some(45.0));
    assert_eq!(numbers(here, &["marks.mcap"])["marks"], 100_000);
}
