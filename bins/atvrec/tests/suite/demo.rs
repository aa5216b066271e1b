//! `atvrec demo`, and the line that `record` shows on a terminal.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serialport::{SerialPort, TTYPort};
use store::Reader;

use crate::record::{Virtual, logs};
use crate::support::{atvrec, stdout};

/// A manoeuvre that is computed faster than the rough trail.
const QUICK: &str = "slow-sine";

#[test]
fn the_demonstration_shows_its_live_page_and_ends_with_accuracy_verdict_and_report() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let mut child = Command::new(env!("CARGO_BIN_EXE_atvrec"))
        .args(["--quiet", "demo", "--for", "6", "-d", "demo"])
        .args(["--manoeuvre", QUICK])
        .current_dir(here)
        .stdout(Stdio::piped())
        .spawn()
        .expect("started");
    let mut lines = Vec::new();
    for line in BufReader::new(child.stdout.take().expect("a pipe")).lines() {
        let line = line.expect("text");
        if let Some(address) = line.trim().strip_prefix("live page: http://") {
            // The vehicle drives at this time.
            let address = address.trim_end_matches('/');
            let mut page = TcpStream::connect(address).expect("a connection");
            let request = format!("GET / HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n");
            page.write_all(request.as_bytes()).expect("sent");
            let mut answer = String::new();
            page.read_to_string(&mut answer).expect("an answer");
            assert!(answer.contains("<html"), "{answer}");
        }
        lines.push(line);
    }
    let status = child.wait().expect("ended");
    let text = lines.join("\n");
    let has = |part: &str| lines.iter().any(|line| line.contains(part));
    assert!(has("live page: http://127.0.0.1:"), "{text}");
    let [accuracy, verdict, report] = &lines[lines.len() - 3..] else {
        panic!("{text}");
    };
    assert!(
        accuracy.starts_with("accuracy: root mean square errors of F_x"),
        "{text}"
    );
    assert!(verdict.starts_with("verdict: "), "{text}");
    // A stalled machine can lose so much that a sensor is excluded; it says that it stalled.
    if has("the machine stalled") {
        println!("{verdict}");
    } else {
        assert!(verdict.starts_with("verdict: good"), "{text}");
        assert!(status.success(), "{text}");
    }
    let report = report.strip_prefix("report: ").expect("a path");
    assert!(std::fs::metadata(report).is_ok(), "{report}");
    let reader = Reader::open(logs(&here.join("demo/logs"))).expect("a log");
    let truth = reader.truth().filter(Result::is_ok).count();
    assert!(truth > 100, "{truth} values of the truth");
}

#[test]
fn the_option_no_live_leaves_out_the_page_of_the_demonstration() {
    let directory = tempfile::tempdir().expect("a directory");
    let assert = atvrec(directory.path())
        .args(["--quiet", "demo", "--for", "1", "--no-live", "-d", "demo"])
        .args(["--manoeuvre", QUICK])
        .assert();
    let text = stdout(&assert);
    assert!(!text.contains("live page"), "{text}");
    assert!(text.contains("verdict: "), "{text}");
}

#[test]
fn record_shows_one_running_line_on_a_terminal() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let _vehicle = Virtual::start(here);
    let (mut master, slave) = TTYPort::pair().expect("a pseudo-terminal");
    let terminal = File::options()
        .write(true)
        .open(slave.name().expect("a name"))
        .expect("a terminal");
    let mut child = Command::new(env!("CARGO_BIN_EXE_atvrec"))
        .args(["record", "--config", "ports/atvrec.toml", "--for", "5"])
        .env("TERM", "xterm")
        .current_dir(here)
        .stdout(Stdio::null())
        .stderr(terminal)
        .spawn()
        .expect("started");
    master
        .set_timeout(Duration::from_millis(100))
        .expect("a timeout");
    let mut text = String::new();
    let mut bytes = [0; 4096];
    let deadline = Instant::now() + Duration::from_secs(60);
    while child.try_wait().expect("a state").is_none() && Instant::now() < deadline {
        if let Ok(count) = master.read(&mut bytes) {
            text += &String::from_utf8_lossy(&bytes[..count]);
        }
    }
    drop(slave);
    // The line is written again and again in its place.
    let lines = text.split('\r').filter(|part| part.contains("recording "));
    let lines: Vec<&str> = lines.filter(|part| part.contains(" | ")).collect();
    assert!(lines.len() >= 3, "{text:?}");
    let shown = lines[lines.len() - 1];
    assert!(shown.contains("F_z") && shown.contains("LTR"), "{shown}");
}
