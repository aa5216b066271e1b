//! What `check` and `record` say of devices that send what is not expected. The device is a
//! pseudo-terminal.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use acq::VirtualPort;
use serde_json::Value;
use wire::nmea::encode_sentence;

use crate::support::{atvrec, stderr, stdout};

/// A device that repeats some bytes, twenty times a second. Of longer ones it sends a part each time.
pub struct Device {
    stop: Arc<AtomicBool>,
    sender: Option<JoinHandle<()>>,
    pub path: String,
}

/// Most bytes that a device sends at once: less than a pseudo-terminal stores.
const PART_BYTES: usize = 1_024;

impl Device {
    pub fn new(message: Vec<u8>) -> Self {
        let mut port = VirtualPort::new().expect("a pseudo-terminal");
        let path = port.path().display().to_string();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let sender = std::thread::spawn(move || {
            let mut parts = message.chunks(PART_BYTES).cycle();
            while !stopped.load(Ordering::Relaxed) {
                let mut buffer = [0; 256];
                // Commands of the recorder mean nothing to this device.
                let _ = port.read(&mut buffer);
                let _ = port.write(parts.next().unwrap_or_default());
                std::thread::sleep(Duration::from_millis(50));
            }
        });
        Self {
            stop,
            sender: Some(sender),
            path,
        }
    }

    fn configure(&self, directory: &Path, kind: &str) {
        let text = format!(
            "[source.x]\nkind = \"{kind}\"\ndevice = \"{}\"\n[storage]\ndirectory = \"logs\"\n",
            self.path
        );
        std::fs::write(directory.join("atvrec.toml"), text).expect("written");
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(sender) = self.sender.take() {
            let _ = sender.join();
        }
    }
}

/// What `check` prints about a device, as JSON and text, and its exit code.
fn check(message: &[u8], kind: &str) -> (Value, String, Option<i32>) {
    let directory = tempfile::tempdir().expect("a directory");
    let device = Device::new(message.to_vec());
    device.configure(directory.path(), kind);
    let run = |arguments: &[&str]| atvrec(directory.path()).args(arguments).assert();
    let json = run(&["check", "--listen-s", "0.7", "--json"]);
    let json: Value = serde_json::from_str(&stdout(&json)).expect("JSON");
    let text = run(&["check", "--listen-s", "0.7"]);
    let code = text.get_output().status.code();
    (json["devices"][0].clone(), stdout(&text), code)
}

fn sentences(texts: &[&str]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for text in texts {
        encode_sentence(text, &mut bytes);
    }
    bytes
}

const RMC: &str = "GPRMC,120000.00,A,3235.0,N,08529.0,W,10.0,90.0,010124,,,A";
const GSV: &str = "GPGSV,1,1,01,10,63,137,17";

#[test]
fn check_names_messages_rates_and_values() {
    let (device, text, code) = check(&sentences(&[RMC, GSV]), "gnss");
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(device["state"], "answers");
    let messages = device["messages"].as_array().expect("a list");
    let named = |name: &str| {
        let found = messages.iter().find(|message| message["name"] == name);
        found.unwrap_or_else(|| panic!("{messages:?}"))
    };
    assert_eq!(named("RMC")["decoded"], true);
    assert_eq!(named("GSV")["decoded"], false);
    let rate_hz = named("RMC")["rate_hz"].as_f64().expect("a rate");
    assert!((10.0..25.0).contains(&rate_hz), "{rate_hz}");
    for part in [
        "messages: RMC",
        "not decoded: GSV",
        "velocity east = 5.14444 m/s",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

/// Devices that are recognised and not decoded, or not by a source of this kind.
#[test]
fn check_names_what_it_does_not_understand() {
    let mip = [0x75, 0x65, 0x80, 0x04, 0x04, 0x12, 0x00, 0x00];
    let (a, b) = mip.iter().fold((0_u8, 0_u8), |(a, b), byte| {
        let a = a.wrapping_add(*byte);
        (a, b.wrapping_add(a))
    });
    let mip = [&mip[..], &[a, b]].concat();
    let mut ubx = Vec::new();
    wire::ubx::encode_frame([0x01, 0x35], &[0; 8], &mut ubx);
    for (bytes, kind, parts) in [
        (
            mip,
            "gnss",
            [
                "none understood; they look like MicroStrain MIP",
                "SensorConnect",
            ],
        ),
        (
            sentences(&[RMC]),
            "crossbow440",
            [
                "none understood; they look like NMEA 0183",
                "set kind = \"gnss\"",
            ],
        ),
        (
            sentences(&[GSV]),
            "gnss",
            [
                "of NMEA 0183, but no message that is decoded (GSV",
                "GGA and RMC",
            ],
        ),
        (
            ubx,
            "gnss",
            [
                "of u-blox UBX, but no message that is decoded (NAV-SAT",
                "NAV-PVT",
            ],
        ),
        (
            [0xF8, 0x80, 0x00, 0xF8].repeat(20),
            "gnss",
            ["at another baud rate", "set the baud rate"],
        ),
    ] {
        let (device, text, code) = check(&bytes, kind);
        assert_eq!(code, Some(1), "{text}");
        assert_eq!(device["state"], "not understood");
        for part in parts {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
}

fn newest_log(directory: &Path) -> PathBuf {
    let entries = std::fs::read_dir(directory.join("logs")).expect("logs");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    let logs = paths.filter(|path| path.extension().is_some_and(|e| e == "mcap"));
    logs.max().expect("a log")
}

#[test]
fn a_recording_that_understood_nothing_says_so_in_its_last_line() {
    let directory = tempfile::tempdir().expect("a directory");
    let device = Device::new(sentences(&[GSV]));
    device.configure(directory.path(), "gnss");
    let record = || {
        // The messages that are not decoded are in /health, once a second.
        let run = atvrec(directory.path())
            .args(["record", "--for", "3"])
            .assert();
        let code = run.get_output().status.code();
        let text = stdout(&run);
        (
            code,
            text.lines().last().unwrap_or_default().to_owned(),
            text,
        )
    };
    let (code, last, text) = record();
    assert_eq!(code, Some(3), "{text}");
    assert!(
        last.starts_with("x: ") && last.contains("no message that is decoded"),
        "{text}"
    );
    drop(device);
    let device = Device::new(sentences(&[RMC, GSV]));
    device.configure(directory.path(), "gnss");
    let (code, _, text) = record();
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("x: not decoded: GSV"), "{text}");
    let newest = newest_log(directory.path());
    let info = atvrec(directory.path())
        .arg("info")
        .arg(&newest)
        .assert()
        .success();
    assert!(stdout(&info).contains("x: GSV"), "{}", stdout(&info));
}

#[test]
fn a_configuration_without_a_source_is_an_error() {
    let directory = tempfile::tempdir().expect("a directory");
    std::fs::write(directory.path().join("atvrec.toml"), "[storage]\n").expect("written");
    for command in [&["check"][..], &["record", "--for", "1"]] {
        let run = atvrec(directory.path()).args(command).assert().code(2);
        assert!(stderr(&run).contains("has no source"), "{}", stderr(&run));
    }
}

/// Errors name the option, the nearest topic and the end of the log, and an empty file is no log.
#[test]
fn hints_fit_the_error() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    crate::support::simulate(here, "drive.mcap", 1);
    std::fs::write(here.join("empty.mcap"), "").expect("written");
    for (command, code, parts) in [
        (
            &["export", "drive.mcap", "-t", "/estimate/motoin"][..],
            1,
            ["did you mean /estimate/motion?", ""],
        ),
        (
            &["export", "drive.mcap", "-t", "/steer", "--from", "500"],
            2,
            ["--from 500 s is after the end of the log", "at 1.9"],
        ),
        (
            &["replay", "drive.mcap", "--vehicle", "nosuch"],
            2,
            ["--vehicle: nosuch is neither a file", ""],
        ),
        (
            &["replay", "drive.mcap", "--method", "nosuch"],
            2,
            ["--method: \"nosuch\"", "thesis, fusion"],
        ),
        (&["info", "empty.mcap"], 1, ["is empty: it is no log", ""]),
        (&["report", "empty.mcap"], 1, ["is empty: it is no log", ""]),
    ] {
        let run = atvrec(here).args(command).assert().code(code);
        let text = stderr(&run);
        for part in parts {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
}

#[test]
fn a_log_of_one_instant_has_no_rate() {
    let directory = tempfile::tempdir().expect("a directory");
    let mut log = store::LogWriter::new(
        Vec::new(),
        store::Session::default(),
        store::Options::default(),
        0,
    )
    .expect("a vector takes all");
    log.record(&store::Record::Mark {
        time: sample::LogTime(1_000_000_000),
        text: "here".to_owned(),
    });
    let bytes = log
        .finish(&std::collections::BTreeMap::new())
        .expect("a vector takes all");
    std::fs::write(directory.path().join("moment.mcap"), bytes).expect("written");
    let text = stdout(
        &atvrec(directory.path())
            .args(["info", "moment.mcap"])
            .assert()
            .success(),
    );
    let row = text
        .lines()
        .find(|line| line.starts_with("/mark"))
        .expect("a topic");
    let cells: Vec<&str> = row.split_whitespace().collect();
    assert_eq!(cells, ["/mark", "1", "-", "atvrec.Mark"], "{text}");
}

#[test]
fn info_shows_trouble_codes() {
    let directory = tempfile::tempdir().expect("a directory");
    // DM1 of the controller 11: SPN 1208, FMI 3, ten occurrences.
    let device = Device::new(b"T18FECA0B804FFB804030AFFFF\r".to_vec());
    device.configure(directory.path(), "slcan");
    atvrec(directory.path())
        .args(["record", "--for", "1"])
        .assert()
        .success();
    let info = atvrec(directory.path())
        .args(["info", "--json"])
        .arg(newest_log(directory.path()))
        .assert()
        .success();
    let info: Value = serde_json::from_str(&stdout(&info)).expect("JSON");
    let codes = &info["trouble_codes"];
    assert_eq!(codes.as_array().map(Vec::len), Some(1), "{info}");
    assert_eq!(codes[0]["source_address"], 11);
    assert_eq!(codes[0]["spn"], 1208);
    assert_eq!(codes[0]["fmi"], 3);
    assert_eq!(codes[0]["occurrences"], 10);
}
