//! The frames of the references, `reference.jsonl` or `reference.parquet`.

use std::fs::{self, File};
use std::path::Path;

use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::{Field, Row};
use serde_json::{Map, Value};

/// A stamp of the reference.
#[derive(Clone, Debug, PartialEq)]
pub enum Stamp {
    /// Seconds.
    Seconds(f64),
    /// Sum of the differences, s.
    Sum(f64),
    /// Nanoseconds.
    Nanos(i64),
    /// Date and time, as UNIX time in ns.
    Date(i64),
}

/// Sums the stamps of a log with differences; a reference with `t_cum_s` has the sums.
pub fn sum(frames: &mut [Frame]) {
    let mut sum_s = 0.0;
    for frame in frames {
        if let Stamp::Seconds(seconds) = &mut frame.stamp {
            sum_s += *seconds;
            *seconds = sum_s;
        }
    }
}

/// A frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    pub stamp: Stamp,
    pub channel: Option<String>,
    pub id: Option<u32>,
    pub extended: bool,
    pub remote: bool,
    pub error: bool,
    pub fd: bool,
    pub brs: bool,
    pub esi: bool,
    pub direction: Option<String>,
    pub dlc: Option<u8>,
    pub data: Vec<u8>,
}

/// The frames of a folder.
pub fn read(folder: &Path) -> Vec<Frame> {
    let lines = folder.join("reference.jsonl");
    if lines.exists() {
        let text = fs::read_to_string(lines).expect("the reference");
        let rows = text
            .lines()
            .map(|line| serde_json::from_str(line).expect("JSON"));
        return rows.map(|row: Map<String, Value>| frame(&row)).collect();
    }
    let file = File::open(folder.join("reference.parquet")).expect("the reference");
    let reader = SerializedFileReader::new(file).expect("a Parquet file");
    let rows = reader.get_row_iter(None).expect("rows");
    rows.map(|row| frame(&json(&row.expect("a row")))).collect()
}

fn json(row: &Row) -> Map<String, Value> {
    let columns = row.get_column_iter();
    columns
        .map(|(name, field)| {
            let value = match field {
                Field::Null => Value::Null,
                Field::Bool(value) => (*value).into(),
                Field::Byte(value) => (*value).into(),
                Field::Short(value) => (*value).into(),
                Field::Int(value) => (*value).into(),
                Field::Long(value) => (*value).into(),
                Field::UByte(value) => (*value).into(),
                Field::UShort(value) => (*value).into(),
                Field::UInt(value) => (*value).into(),
                Field::ULong(value) => (*value).into(),
                Field::Double(value) => (*value).into(),
                Field::Str(value) => value.clone().into(),
                other => panic!("{name} is {other:?}"),
            };
            (name.clone(), value)
        })
        .collect()
}

fn frame(row: &Map<String, Value>) -> Frame {
    let flag = |name: &str| row[name].as_bool().expect(name);
    let text = |name: &str| row[name].as_str().map(str::to_owned);
    let hex = row["data"].as_str().expect("data");
    let bytes = (0..hex.len()).step_by(2);
    let data: Vec<u8> = bytes
        .map(|at| u8::from_str_radix(&hex[at..at + 2], 16).expect("hexadecimal data"))
        .collect();
    assert_eq!(row["len"], data.len());
    let number = |name: &str| row.get(name).filter(|value| !value.is_null());
    let stamp = match (number("t_ns"), number("t_cum_s"), &row["t_s"]) {
        (Some(ns), _, _) => Stamp::Nanos(ns.as_i64().expect("ns")),
        (_, Some(seconds), _) => Stamp::Sum(seconds.as_f64().expect("seconds")),
        (_, _, Value::String(date)) => Stamp::Date(date_ns(date)),
        (_, _, seconds) => Stamp::Seconds(seconds.as_f64().expect("seconds")),
    };
    Frame {
        stamp,
        channel: match &row["channel"] {
            Value::Null => None,
            Value::String(name) => Some(name.clone()),
            number => Some(number.to_string()),
        },
        id: row["id"].as_u64().map(|id| id as u32),
        extended: flag("extended"),
        remote: flag("remote"),
        error: flag("error"),
        fd: flag("fd"),
        brs: flag("brs"),
        esi: flag("esi"),
        direction: text("direction"),
        dlc: row["dlc"].as_u64().map(|dlc| dlc as u8),
        data,
    }
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
