use std::net::TcpListener;
use std::path::Path;

use sample::LogTime;
use store::Reader;

use crate::outside::Recorder;
use crate::support::{atvrec, simulate, stderr};

/// A source whose device does not exist: the recorder runs and waits for it.
const CONFIG: &str = "[source.imu]\nkind = \"crossbow440\"\ndevice = \"absent\"\n";

fn live_fails(directory: &Path, arguments: &[&str]) -> String {
    let assert = atvrec(directory)
        .args(["live", "--socket", "absent"])
        .args(arguments)
        .timeout(std::time::Duration::from_secs(20))
        .assert()
        .failure();
    stderr(&assert)
}

#[test]
fn the_live_process_says_why_it_cannot_listen() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let error = live_fails(here, &["--listen", "0.0.0.0:0"]);
    assert!(error.contains("needs a token"), "{error}");
    assert!(error.contains("openssl rand"), "{error}");

    let used = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = used.local_addr().expect("an address").to_string();
    let error = live_fails(here, &["--listen", &address]);
    assert!(
        error.contains(&format!("cannot listen on {address}")),
        "{error}"
    );
    assert!(error.contains("live.address"), "{error}");

    std::fs::write(here.join("token"), "short\n").expect("written");
    let error = live_fails(here, &["--token-file", "token"]);
    assert!(error.contains("at least 16"), "{error}");
    assert!(
        !error.contains("short"),
        "the token is in no message: {error}"
    );
    let error = live_fails(here, &["--token-file", "absent"]);
    assert!(
        error.contains("cannot read the token file absent"),
        "{error}"
    );
}

#[test]
fn an_output_that_is_down_is_reported_and_the_recorder_records() {
    let directory = tempfile::tempdir().expect("a directory");
    let config = format!("{CONFIG}[output.can]\ninterface = \"absent0\"\n");
    let recorder = Recorder::start(directory.path(), &config);
    recorder.wait_for("output.can cannot send");
    let assert = recorder.ask(&["status", "--json"]).assert().success();
    let status: serde_json::Value =
        serde_json::from_slice(&assert.get_output().stdout).expect("JSON");
    assert_eq!(status["writing"], "recording");
    assert_eq!(status["output_can"]["open"], false);
    assert_ne!(status["output_can"]["problem"], "");
    let long = "x".repeat(100_000);
    let error = stderr(&recorder.ask(&["mark", &long]).assert().failure());
    assert!(
        error.contains("100000 characters; use at most 1000"),
        "{error}"
    );
    // Its source sent nothing.
    assert_eq!(recorder.stop(), Some(3));
}

/// Topics and columns of a layout's paths, such as `/estimate/tyre_forces.wheels[0].z_n`.
fn column_of(path: &str, between: char) -> (String, String) {
    let topic_end = path
        .match_indices('/')
        .nth(if between == '/' { 2 } else { 1 });
    let from = topic_end.map_or(0, |(at, _)| at + usize::from(between == '.'));
    let at = path[from..]
        .find(between)
        .map_or(path.len(), |at| from + at);
    let (topic, rest) = path.split_at(at);
    let mut column = rest.trim_start_matches(between).replace(between, ".");
    for (n, wheel) in ["fl", "fr", "rl", "rr"].into_iter().enumerate() {
        column = column.replace(&format!("wheels[{n}]"), wheel);
    }
    (topic.to_owned(), column)
}

#[test]
fn every_topic_and_field_of_the_layouts_is_in_a_log() {
    let directory = tempfile::tempdir().expect("a directory");
    let log = simulate(directory.path(), "drive.mcap", 1);
    let layouts = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../packaging/layouts");
    let read = |name: &str| std::fs::read_to_string(layouts.join(name)).expect("a layout");
    let mut wanted = Vec::new();
    for text in read("foxglove.json")
        .split('"')
        .filter(|text| text.starts_with('/'))
    {
        wanted.push(column_of(text, '.'));
    }
    let xml = read("plotjuggler.xml");
    let curves = xml.split("<curve name=\"").skip(1);
    wanted.extend(curves.map(|rest| column_of(rest.split('"').next().expect("a name"), '/')));
    for line in read("rerun.py")
        .lines()
        .filter(|line| line.starts_with("    (\"/"))
    {
        let mut texts = line.split('"').skip(1).step_by(2);
        let (topic, column) = (texts.next(), texts.next());
        wanted.push((
            topic.expect("a topic").to_owned(),
            column.expect("a column").to_owned(),
        ));
    }
    assert!(wanted.len() > 30, "{wanted:?}");
    let reader = Reader::open([log]).expect("a log");
    for (topic, column) in wanted {
        // A drive without events has no such topic.
        if topic == "/estimate/events" {
            continue;
        }
        let table = reader.table(&topic, LogTime(0), LogTime(u64::MAX));
        let table = table.unwrap_or_else(|error| panic!("{error}"));
        let is_there = column.is_empty() || table.columns.iter().any(|c| c.name == column);
        assert!(
            is_there && !table.log_time_ns.is_empty(),
            "{topic} {column}"
        );
    }
}
