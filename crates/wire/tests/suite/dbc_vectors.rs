//! DBC decoding against cantools, an independent implementation, on public and real files.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use atvrec_wire::candump;
use atvrec_wire::dbc::{Database, MessageDef};
use sample::{CanFlags, CanFrame};
use serde_json::Value;

/// A folder of the test data; `None` if it is missing.
fn folder(name: &str) -> Option<PathBuf> {
    testkit::shared(&format!("data/{name}"))
}

fn files(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("the folder can be read");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    let mut paths: Vec<_> = paths
        .filter(|path| path.to_string_lossy().ends_with(ending))
        .collect();
    paths.sort();
    assert!(!paths.is_empty(), "no {ending} in {}", folder.display());
    paths
}

fn database(path: &Path) -> Database {
    let text = fs::read(path).expect("the file can be read");
    Database::parse(&text).unwrap_or_else(|error| panic!("{}:\n{error}", path.display()))
}

fn json_lines(path: &Path) -> Vec<Value> {
    let text = fs::read_to_string(path).expect("the file can be read");
    text.lines()
        .map(|line| serde_json::from_str(line).expect("a JSON line"))
        .collect()
}

fn expected(vector: &Value) -> BTreeMap<&str, f64> {
    let signals = vector["sig"].as_object().expect("signals");
    signals
        .iter()
        .map(|(name, value)| (name.as_str(), value.as_f64().expect("a number")))
        .collect()
}

fn decoded<'a>(message: &'a MessageDef, data: &'a [u8]) -> BTreeMap<&'a str, f64> {
    message
        .decode(data)
        .map(|value| (value.signal.name.as_str(), value.physical))
        .collect()
}

/// Part of a value that the reader of the JSON file may be off by: it rounds to one of the two
/// nearest numbers.
const READER_TOLERANCE: f64 = 2.0 * f64::EPSILON;

/// Values equal but for the reader's rounding; not-a-number equals itself.
fn assert_equal(got: &BTreeMap<&str, f64>, expected: &BTreeMap<&str, f64>, what: &str) {
    assert_eq!(
        got.keys().collect::<Vec<_>>(),
        expected.keys().collect::<Vec<_>>(),
        "{what}"
    );
    for (name, value) in expected {
        let difference = (got[name] - value).abs();
        let same = difference <= READER_TOLERANCE * value.abs()
            || got[name] == *value
            || (got[name].is_nan() && value.is_nan());
        assert!(same, "{what}: {name} is {}, expected {value}", got[name]);
    }
}

fn bytes(hex: &str) -> Vec<u8> {
    let frame = candump::parse_frame(&format!("000##0{hex}")).expect("hexadecimal data");
    frame.bytes().to_vec()
}

/// Every vector: the same signals with the same values, and encoding them gives the same values.
fn check_vectors(dbc: &Path) -> (usize, usize) {
    let database = database(dbc);
    let vectors = json_lines(&dbc.with_extension("dbc.vectors.jsonl"));
    let mut values = 0;
    for vector in &vectors {
        let id = u32::try_from(vector["id"].as_u64().expect("an id")).expect("32 bits");
        let extended = vector["ext"].as_bool().expect("a flag");
        let data = bytes(vector["data"].as_str().expect("data"));
        let flags = CanFlags {
            extended,
            fd: data.len() > 8,
            ..CanFlags::default()
        };
        let frame = CanFrame::new(id, flags, &data).expect("a frame");
        let message = database.message_of(&frame).expect("the message");
        let what = format!("{} {vector}", dbc.display());
        assert_eq!(vector["msg"], message.name.as_str(), "{what}");
        let expected = expected(vector);
        let got = decoded(message, frame.bytes());
        assert_equal(&got, &expected, &what);
        values += got.len();

        let pairs: Vec<_> = got.iter().map(|(name, value)| (*name, *value)).collect();
        let encoded = message
            .encode(&pairs)
            .unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_equal(&decoded(message, encoded.bytes()), &expected, &what);
    }
    (vectors.len(), values)
}

#[test]
fn vectors_of_cantools() {
    let mut total = (0, 0);
    for name in ["can-dbc", "can-css"] {
        let Some(folder) = folder(name) else {
            return;
        };
        for vectors in files(&folder, ".dbc.vectors.jsonl") {
            let dbc = vectors.with_extension("").with_extension("");
            let counts = check_vectors(&dbc);
            println!(
                "{}: {} frames, {} values",
                dbc.display(),
                counts.0,
                counts.1
            );
            total = (total.0 + counts.0, total.1 + counts.1);
        }
    }
    println!("{} frames, {} values equal", total.0, total.1);
    assert!(total.1 > 0, "no vectors");
}

#[test]
fn recordings_of_a_real_vehicle() {
    let Some(folder) = folder("can-css") else {
        return;
    };
    let database = database(&folder.join("gnss.dbc"));
    for log in files(&folder, ".candump.log") {
        let name = log
            .to_string_lossy()
            .replace(".candump.log", ".cantools.jsonl");
        let expected_lines = json_lines(Path::new(&name));
        let text = fs::read_to_string(&log).expect("the log can be read");
        let frames = text
            .lines()
            .map(|line| candump::parse_line(line).expect("a line of candump").frame);
        let mut ours =
            frames.filter_map(|frame| database.message_of(&frame).map(|message| (frame, message)));
        for vector in &expected_lines {
            let (frame, message) = ours.next().expect("as many frames as cantools");
            let what = format!("{} {vector}", log.display());
            assert_eq!(vector["id"], frame.id, "{what}");
            assert_eq!(vector["msg"], message.name.as_str(), "{what}");
            assert_equal(&decoded(message, frame.bytes()), &expected(vector), &what);
        }
        assert_eq!(
            ours.count(),
            0,
            "{}: more frames than cantools",
            log.display()
        );
        println!("{}: {} frames equal", log.display(), expected_lines.len());
    }
}

#[test]
fn candump_lines_are_written_as_they_were_read() {
    let Some(folder) = folder("can-css") else {
        return;
    };
    for log in files(&folder, ".candump.log") {
        let text = fs::read_to_string(&log).expect("the log can be read");
        for line in text.lines() {
            let parsed = candump::parse_line(line).expect("a line of candump");
            assert_eq!(candump::format_line(&parsed.interface, &parsed.frame), line);
        }
    }
}

#[test]
fn j1939_messages_match_by_parameter_group() {
    let Some(folder) = folder("can-css") else {
        return;
    };
    let database = database(&folder.join("CSS-Electronics-SAE-J1939-DEMO.dbc"));
    let engine = database.by_name("EEC1").expect("EEC1");
    assert!(engine.j1939);
    // Another priority and another sender than in the file.
    let frame = candump::parse_frame("18F00417#FFFFFF6813FFFFFF").expect("a frame");
    let signals = database.decode(&frame).expect("EEC1").signals;
    assert_eq!(&*signals[0].name, "EngineSpeed");
    assert_eq!(signals[0].value, f64::from(0x1368) * 0.125);
    assert_eq!(&*signals[0].unit, "rpm");
}
