//! The frames of a reference file, and their comparison with what a reader gives.

use std::fs::File;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use atvrec_wire::can_log::{Direction, Entry, Error, Record, Sink, Summary};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use serde_json::{Map, Value, json};

/// The references state times as 64-bit floating-point seconds: a stamp differs from them by at most
/// one ns plus half a unit in the last place of the time.
const STAMP_NS: f64 = 1.0;

/// The folders of a format, in order; empty if the data is missing.
pub fn folders(format: &str) -> Vec<PathBuf> {
    let Some(folder) = testkit::shared(&format!("data/can-logs/{format}")) else {
        return Vec::new();
    };
    let entries = std::fs::read_dir(folder).expect("the folder can be read");
    let mut folders: Vec<_> = entries.map(|e| e.expect("an entry").path()).collect();
    folders.sort();
    assert!(!folders.is_empty(), "{format} has no files");
    folders
}

/// The rows of a folder's reference.
pub fn rows(folder: &Path) -> Vec<Map<String, Value>> {
    let lines = folder.join("reference.jsonl");
    if lines.exists() {
        let text = std::fs::read_to_string(lines).expect("the reference can be read");
        let rows = text.lines().map(serde_json::from_str);
        return rows.map(|row| row.expect("a JSON line")).collect();
    }
    let file = File::open(folder.join("reference.parquet")).expect("a reference");
    let reader = SerializedFileReader::new(file).expect("a Parquet file");
    let rows = reader.get_row_iter(None).expect("rows");
    rows.map(|row| {
        let row = row.expect("a row");
        let columns = row.get_column_iter();
        columns
            .map(|(name, field)| (name.clone(), value(field)))
            .collect()
    })
    .collect()
}

fn value(field: &Field) -> Value {
    match field {
        Field::Null => Value::Null,
        Field::Bool(value) => json!(value),
        Field::Int(value) => json!(value),
        Field::Long(value) => json!(value),
        Field::Double(value) => json!(value),
        Field::Str(value) => json!(value),
        other => panic!("a column has the unexpected type of {other:?}"),
    }
}

/// Reads a log with a reader that gives its frames to a sink.
pub fn entries(
    read: impl FnOnce(&mut Sink<'_>) -> Result<Summary, Error>,
) -> Result<(Vec<Entry>, Summary), Error> {
    let mut entries = Vec::new();
    let summary = read(&mut |record| {
        if let Record::Frame(entry) = record {
            entries.push(entry);
        }
        ControlFlow::Continue(())
    })?;
    assert_eq!(summary.frames, entries.len() as u64);
    Ok((entries, summary))
}

/// Compares all fields of all frames.
///
/// # Panics
/// At the first difference.
pub fn assert_rows(
    name: &str,
    (entries, summary): (&[Entry], &Summary),
    rows: &[Map<String, Value>],
) {
    for (number, (entry, row)) in entries.iter().zip(rows).enumerate() {
        assert_row(&format!("{name}, frame {number}"), entry, summary, row);
    }
    assert_eq!(entries.len(), rows.len(), "{name}: number of frames");
}

fn assert_row(place: &str, entry: &Entry, summary: &Summary, row: &Map<String, Value>) {
    let exact = row.get("t_ns").and_then(Value::as_i64);
    let seconds = row["t_s"].as_f64().expect("a time");
    let ulp_ns = 1e9 * seconds.abs() * f64::EPSILON;
    match exact {
        Some(stamp) => assert_eq!(entry.stamp_ns, stamp, "{place}: t_ns"),
        None => assert!(
            (entry.stamp_ns as f64 - seconds * 1e9).abs() <= STAMP_NS + ulp_ns,
            "{place}: {} ns, expected {seconds} s",
            entry.stamp_ns
        ),
    }
    let channel = match &row["channel"] {
        Value::Null => None,
        Value::String(name) => Some(name.clone()),
        number => Some(number.to_string()),
    };
    let found = entry
        .channel
        .map(|at| summary.channels[usize::from(at)].clone());
    assert_eq!(found, channel, "{place}: channel");
    let direction = entry
        .direction
        .map_or(Value::Null, |direction| match direction {
            Direction::Received => json!("rx"),
            Direction::Sent => json!("tx"),
            Direction::SendRequest => json!("txrq"),
        });
    let (frame, flags) = (&entry.frame, entry.frame.flags);
    let data: String = frame.bytes().iter().map(|b| format!("{b:02x}")).collect();
    for (field, got) in [
        ("extended", json!(flags.extended)),
        ("remote", json!(flags.remote)),
        ("error", json!(flags.error)),
        ("fd", json!(flags.fd)),
        ("brs", json!(flags.bit_rate_switch)),
        ("esi", json!(flags.error_state)),
        ("direction", direction),
        ("dlc", json!(entry.dlc)),
        ("len", json!(frame.bytes().len())),
        ("data", json!(data)),
    ] {
        assert_eq!(got, row[field], "{place}: {field}");
    }
    // An error frame may have no identifier.
    let id = row["id"].as_u64().unwrap_or(0);
    assert_eq!(u64::from(frame.id), id, "{place}: id");
    assert_eq!(frame.kernel_ns, None, "{place}: kernel_ns");
}

/// A file of the logs; `None` if the data is missing.
pub fn file(name: &str) -> Option<Vec<u8>> {
    let path = testkit::shared(&format!("data/can-logs/{name}"))?;
    Some(std::fs::read(path).expect("the file can be read"))
}

/// A reader of bytes in memory.
pub fn cursor(bytes: &[u8]) -> std::io::Cursor<&[u8]> {
    std::io::Cursor::new(bytes)
}
