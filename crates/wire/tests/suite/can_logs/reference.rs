//! The frames of a reference file, and their comparison with what a reader gives.

use std::fs::File;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use atvrec_wire::can_log::{Direction, Entry, Error, Record, Sink, Stamps, Summary};
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
    let mut sum_s = 0.0;
    for (number, (entry, row)) in entries.iter().zip(rows).enumerate() {
        let place = format!("{name}, frame {number}");
        sum_s += row["t_s"].as_f64().unwrap_or(0.0);
        let sum_s = (summary.stamps == Stamps::Differences).then_some(sum_s);
        assert_stamp(&place, entry.stamp_ns, sum_s, row);
        assert_row(&place, entry, summary, row);
    }
    assert_eq!(entries.len(), rows.len(), "{name}: number of frames");
}

/// Compares a stamp. `sum_s`: sum of the differences up to the frame, if the file has differences.
fn assert_stamp(place: &str, stamp_ns: i64, sum_s: Option<f64>, row: &Map<String, Value>) {
    if let Some(exact) = row.get("t_ns").and_then(Value::as_i64) {
        return assert_eq!(stamp_ns, exact, "{place}: t_ns");
    }
    if let Some(date) = row["t_s"].as_str() {
        return assert_eq!(stamp_ns, date_ns(date), "{place}: t_s");
    }
    let of_sum = row.get("t_cum_s").and_then(Value::as_f64);
    let seconds = of_sum.or(sum_s).or(row["t_s"].as_f64()).expect("a time");
    let ulp_ns = 1e9 * seconds.abs() * f64::EPSILON;
    assert!(
        (stamp_ns as f64 - seconds * 1e9).abs() <= STAMP_NS + ulp_ns,
        "{place}: {stamp_ns} ns, expected {seconds} s"
    );
}

/// UNIX time of `2017-09-30T15:06:13.191`, ns.
pub fn date_ns(text: &str) -> i64 {
    let number = |range: std::ops::Range<usize>| -> i64 { text[range].parse().expect("a number") };
    let (year, month, day) = (number(0..4), number(5..7), number(8..10));
    let day_s = atvrec_wire::gps_time::unix_s_of_date(year as u16, month as u8, day as u8);
    let seconds: f64 = text[17..].parse().expect("seconds");
    let minutes = 60 * number(11..13) + number(14..16);
    let of_minute_ns = (seconds * 1e9).round() as i64;
    (day_s.expect("a date") + 60 * minutes) * 1_000_000_000 + of_minute_ns
}

fn assert_row(place: &str, entry: &Entry, summary: &Summary, row: &Map<String, Value>) {
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
    // The identifier of an error frame is its class, which the reference may lack.
    match row["id"].as_u64() {
        Some(id) => assert_eq!(u64::from(frame.id), id, "{place}: id"),
        None => assert!(flags.error, "{place}: id"),
    }
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
