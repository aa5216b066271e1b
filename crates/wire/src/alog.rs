//! MOOS `.alog` files: one variable a line, `time variable source value`.
//!
//! The form is pLogger's of MOOS (`CMOOSLogger::DoAsyncLog`): lines that begin with `%` are
//! remarks, `%% LOGSTART` gives the UNIX time of time zero, columns are parted by blanks, and the
//! value, which may hold blanks, runs to the end of the line. A value is a number or a text; a text
//! may hold numbers as `[3x1]{1,2,3}` or as `KEY=1,OTHER=2`. An empty value and `nan` are no value.
//! A second `LOGSTART` begins a second run, whose times start again.
//!
//! Variables that one act of measuring writes stand on lines of their own, at the same time or
//! nearly so. They make one row: it is complete when every column has its value, and as good as it
//! gets when a column comes again or a line of a later time, whatever it holds, is read.

use sample::NANOS_PER_SECOND;

use crate::column::{self, Column};
use crate::frame::Frame;
use crate::text::{Cells, Lines, MAX_LINE, nanos, number};
use crate::{Item, Measurements, Message, Protocol, Statistics, WireError};

/// Number in a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// The number.
    Number(f64),
    /// An empty value or `nan`.
    Missing,
    /// A text without the number.
    Other,
}

/// Which number of a value is meant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Part {
    /// The value is a number.
    Whole,
    /// The number at this position, from one, of a list.
    Element(usize),
    /// The number behind `KEY=`.
    Key(String),
}

/// A variable and what it holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Name, as in the file.
    pub name: String,
    /// Application that writes it; empty for any.
    pub source: String,
    /// Which number is meant.
    pub part: Part,
    /// Row that it belongs to: variables of one group are measured together.
    pub group: usize,
    /// What it holds.
    pub column: Column,
}

/// How a file is read.
#[derive(Clone, Debug, PartialEq)]
pub struct Format {
    /// Variables that are read; others are left alone.
    pub variables: Vec<Variable>,
    /// Lines of one row are no further apart than this, ns.
    pub together_ns: u64,
}

/// One line that is not a remark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line<'l> {
    /// Time since the log's start, ns.
    pub time_ns: i128,
    /// Variable.
    pub variable: &'l str,
    /// Application.
    pub source: &'l str,
    /// Value.
    pub value: &'l str,
}

/// Whether a line is blank or a remark.
#[must_use]
pub fn is_remark(line: &str) -> bool {
    let line = line.trim_start();
    line.is_empty() || line.starts_with('%')
}

/// UNIX time of time zero, if the line is `%% LOGSTART`.
#[must_use]
pub fn log_start(line: &str) -> Option<f64> {
    let rest = line.trim_start_matches(['%', ' ', '\t']);
    number(rest.strip_prefix("LOGSTART")?.trim())
}

impl<'l> Line<'l> {
    /// The columns of a line; `None` if it is none of a log.
    #[must_use]
    pub fn parse(line: &'l str) -> Option<Self> {
        let mut cells = Cells::new(line, None);
        Some(Self {
            time_ns: nanos(cells.next()?, NANOS_PER_SECOND as u64)?,
            variable: cells.next()?,
            source: cells.next()?,
            value: cells.rest(),
        })
    }
}

impl Part {
    /// The number that is meant.
    #[must_use]
    pub fn number(&self, value: &str) -> Value {
        let found = match self {
            Self::Whole => Some(value.trim().trim_matches('"')),
            Self::Element(position) => {
                let inner = value.rsplit_once('{').map_or(value, |(_, inner)| inner);
                let inner = inner.trim_end_matches(['}', ' ']).trim_matches('"');
                let separators = [',', ';', ' ', '\t'];
                let mut numbers = inner.split(separators).filter(|part| !part.is_empty());
                let index = position.checked_sub(1);
                index.and_then(|index| numbers.nth(index))
            }
            Self::Key(key) => value.trim_matches('"').split([',', ';']).find_map(|pair| {
                let (name, number) = pair.split_once('=')?;
                (name.trim() == key).then_some(number.trim())
            }),
        };
        let is_missing = value.trim().trim_matches('"').trim().is_empty()
            || found.is_some_and(|text| {
                text.is_empty() || text.parse().is_ok_and(|number: f64| number.is_nan())
            });
        match found.and_then(number) {
            _ if is_missing => Value::Missing,
            Some(number) => Value::Number(number),
            None => Value::Other,
        }
    }
}

impl Format {
    /// Whether a decoder can work with this.
    ///
    /// # Errors
    /// [`WireError::Setting`] names the first setting that cannot work.
    pub fn check(&self) -> Result<(), WireError> {
        if self.variables.is_empty() {
            return Err(WireError::Setting {
                what: "column",
                got: "empty".to_owned(),
                expected: "at least one variable",
            });
        }
        for variable in &self.variables {
            variable.column.check()?;
        }
        Ok(())
    }

    /// The variables that a line holds, with their values in SI.
    pub fn values<'f>(
        &'f self,
        line: &Line<'_>,
    ) -> impl Iterator<Item = (usize, &'f Variable, Value)> {
        let (name, source, value) = (
            line.variable.to_owned(),
            line.source.to_owned(),
            line.value.to_owned(),
        );
        self.variables
            .iter()
            .enumerate()
            .filter(move |(_, v)| v.name == name && (v.source.is_empty() || v.source == source))
            .map(move |(index, v)| {
                let found = match v.part.number(&value) {
                    Value::Number(number) => Value::Number(v.column.value(number)),
                    other => other,
                };
                (index, v, found)
            })
    }
}

/// Incremental decoder of one file. [`Decoder::finish`] hands on what waits for further lines.
#[derive(Clone, Debug)]
pub struct Decoder {
    lines: Lines<MAX_LINE>,
    format: Format,
    rows: Vec<Row>,
    /// Time of the last line, ns.
    last_ns: i128,
}

/// What one group has so far.
#[derive(Clone, Debug, Default)]
struct Row {
    size: usize,
    began_ns: i128,
    values: Vec<(usize, f64)>,
}

impl Decoder {
    /// A decoder for this format.
    ///
    /// # Errors
    /// As [`Format::check`].
    pub fn new(format: Format) -> Result<Self, WireError> {
        format.check()?;
        let groups = format.variables.iter().map(|v| v.group + 1).max();
        let mut rows = vec![Row::default(); groups.unwrap_or(0)];
        for variable in &format.variables {
            rows[variable.group].size += 1;
        }
        Ok(Self {
            lines: Lines::new(),
            format,
            rows,
            last_ns: 0,
        })
    }

    /// Takes bytes and hands on what each row that they complete measured.
    pub fn push(&mut self, bytes: &[u8], mut sink: impl FnMut(Item<'_>)) {
        let (format, rows, last_ns) = (&self.format, &mut self.rows, &mut self.last_ns);
        self.lines.push(bytes, |frame, statistics| {
            take_line(&frame, format, rows, last_ns, statistics, &mut sink);
        });
    }

    /// The stream is over: hands on the rows that wait for further lines.
    pub fn finish(&mut self, mut sink: impl FnMut(Item<'_>)) {
        let frame = Frame {
            kind: (),
            bytes: &[],
            range: 0..0,
        };
        for row in &mut self.rows {
            emit(&frame, &self.format, row, self.last_ns, &mut sink);
        }
    }

    /// Counts since the start.
    #[must_use]
    pub fn statistics(&self) -> Statistics {
        self.lines.statistics()
    }
}

fn take_line(
    frame: &Frame<'_, ()>,
    format: &Format,
    rows: &mut [Row],
    last_ns: &mut i128,
    statistics: &mut Statistics,
    sink: &mut impl FnMut(Item<'_>),
) {
    let text = String::from_utf8_lossy(frame.bytes);
    if is_remark(&text) {
        if log_start(&text).is_some() {
            for row in rows.iter_mut() {
                emit(frame, format, row, *last_ns, sink);
            }
        }
        return;
    }
    let Some(line) = Line::parse(&text) else {
        statistics.malformed += 1;
        return;
    };
    *last_ns = line.time_ns;
    for row in rows.iter_mut() {
        let apart_ns = (line.time_ns - row.began_ns).unsigned_abs();
        if !row.values.is_empty() && apart_ns > u128::from(format.together_ns) {
            emit(frame, format, row, line.time_ns, sink);
        }
    }
    let mut known = false;
    for (index, variable, value) in format.values(&line) {
        known = true;
        let value = match value {
            Value::Number(value) => value,
            Value::Missing => continue,
            Value::Other => {
                statistics.malformed += 1;
                continue;
            }
        };
        let row = &mut rows[variable.group];
        if row.values.iter().any(|(held, _)| *held == index) {
            emit(frame, format, row, line.time_ns, sink);
        }
        if row.values.is_empty() {
            row.began_ns = line.time_ns;
        }
        row.values.push((index, value));
        if row.values.len() == row.size {
            emit(frame, format, row, line.time_ns, sink);
        }
    }
    if !known {
        statistics.unknown += 1;
    }
}

/// Hands a row on and empties it. `now_ns` is the time of the line that ended it.
fn emit(
    frame: &Frame<'_, ()>,
    format: &Format,
    row: &mut Row,
    now_ns: i128,
    sink: &mut impl FnMut(Item<'_>),
) {
    let late_s = (now_ns - row.began_ns).max(0) as f64 / NANOS_PER_SECOND as f64;
    let values: Vec<(&Column, f64)> = row
        .values
        .drain(..)
        .map(|(index, value)| (&format.variables[index].column, value))
        .collect();
    for (latency_s, measurement) in column::measurements(&values) {
        sink(Item {
            protocol: Protocol::Alog,
            name: "row",
            device_time: None,
            latency_s: Some(latency_s + late_s),
            measurements: Measurements::one(measurement),
            message: Message::Row,
            raw: frame.bytes,
            range: frame.range.clone(),
        });
    }
}

#[cfg(test)]
mod tests {
    use sample::Measurement;

    use super::*;
    use crate::column::Quantity;

    fn variable(name: &str, quantity: &str, part: Part, group: usize) -> Variable {
        let quantity = Quantity::from_name(quantity).expect("known");
        Variable {
            name: name.to_owned(),
            source: String::new(),
            part,
            group,
            column: Column {
                name: quantity.name(),
                quantity,
                unit: String::new(),
                factor: 1.0,
                scale: 1.0,
                offset: 0.0,
                latency_s: 0.0,
                held_rows: 1,
            },
        }
    }

    fn decode(variables: Vec<Variable>, text: &str) -> (Vec<(f64, Measurement)>, Statistics) {
        let format = Format {
            variables,
            together_ns: 1_000_000,
        };
        let mut decoder = Decoder::new(format).expect("a working format");
        let mut all = Vec::new();
        for byte in text.as_bytes() {
            decoder.push(&[*byte], |item| {
                let late_s = item.latency_s.expect("rows say their age");
                all.extend(item.measurements.into_iter().map(|m| (late_s, m)));
            });
        }
        (all, decoder.statistics())
    }

    const HEAD: &str = "%% LOG FILE: a.alog\n%% LOGSTART      1000.5\n\n";

    #[test]
    fn the_lines_of_one_instant_make_one_sample() {
        let imu = || {
            vec![
                variable("zGyroZ_gXbow440", "rate.z", Part::Whole, 0),
                variable("zAccelY_gXbow440", "acceleration.y", Part::Whole, 0),
            ]
        };
        let text = format!(
            "{HEAD}0.100 zGyroZ_gXbow440 gXbow440 0.5 \n\
             0.100 DB_TIME MOOSDB_x 7\n\
             0.100 zAccelY_gXbow440 gXbow440 2.0 \n\
             0.110 zGyroZ_gXbow440 gXbow440 0.6 \n\
             0.120 zGyroZ_gXbow440 gXbow440 0.7 \n\
             0.120 zAccelY_gXbow440 gXbow440 bad \n"
        );
        let (all, statistics) = decode(imu(), &text);
        assert_eq!(all.len(), 2, "{all:?}");
        assert_eq!(all[0].0, 0.0);
        assert!((all[1].0 - 0.010).abs() < 1e-12, "told when time moved on");
        assert_eq!((statistics.malformed, statistics.unknown), (1, 1));
        let Measurement::Imu(imu) = &all[0].1 else {
            panic!("{all:?}");
        };
        assert_eq!(imu.angular_rate_rad_s[2], 0.5);
        assert_eq!(imu.specific_force_m_s2[1], 2.0);
    }

    #[test]
    fn numbers_within_texts() {
        let vector = "[6x1]{1.5,2,-3}";
        assert_eq!(Part::Element(3).number(vector), Value::Number(-3.0));
        assert_eq!(Part::Element(4).number(vector), Value::Other);
        assert_eq!(Part::Element(0).number(vector), Value::Other);
        let pairs = "NAME=car, SPD=4.5,HDG=90";
        assert_eq!(
            Part::Key("SPD".to_owned()).number(pairs),
            Value::Number(4.5)
        );
        assert_eq!(Part::Key("PD".to_owned()).number(pairs), Value::Other);
        assert_eq!(Part::Whole.number("words"), Value::Other);
        for missing in ["nan", "", " ", "\"\"", "NaN"] {
            assert_eq!(Part::Whole.number(missing), Value::Missing, "{missing}");
        }
        assert_eq!(Part::Element(2).number("{1,nan,3}"), Value::Missing);
        assert_eq!(Part::Key("A".to_owned()).number("A=,B=2"), Value::Missing);
    }

    #[test]
    fn the_start_of_the_log() {
        assert_eq!(
            log_start("%% LOGSTART     1258500000.25"),
            Some(1_258_500_000.25)
        );
        assert_eq!(log_start("%% LOG FILE: x"), None);
        let line = Line::parse("12.5   zCourse   gNovatel:a  90.0  ").expect("a line");
        assert_eq!((line.time_ns, line.value), (12_500_000_000, "90.0"));
        assert!(Line::parse("12.5 zCourse").is_none());
        assert!(Line::parse("x zCourse a 1").is_none());
    }

    #[test]
    fn triples_are_joined_by_the_integer_time() {
        let axes: Vec<Variable> = ["x", "y", "z"]
            .map(|axis| variable(&format!("G{axis}"), &format!("rate.{axis}"), Part::Whole, 0))
            .into();
        let mut text = HEAD.to_owned();
        for row in 0..20 {
            // The third axis comes 1 ms later, which is the limit; 0.001 is no binary fraction.
            let time = 4026 + 20 * row;
            for (axis, late) in [("x", 0), ("y", 0), ("z", 1)] {
                let time = time + late;
                text += &format!("{}.{:03} G{axis} a {row}\n", time / 1000, time % 1000);
            }
        }
        let (all, _) = decode(axes, &text);
        assert_eq!(all.len(), 20);
        for (_, measurement) in all {
            let Measurement::Imu(imu) = measurement else {
                panic!("{measurement:?}");
            };
            assert!(imu.angular_rate_rad_s.iter().all(|rate| rate.is_finite()));
        }
    }

    #[test]
    fn missing_values_a_second_run_and_the_end() {
        let imu = vec![
            variable("R", "rate.z", Part::Whole, 0),
            variable("A", "acceleration.y", Part::Whole, 0),
        ];
        let format = Format {
            variables: imu,
            together_ns: 1_000_000,
        };
        let mut decoder = Decoder::new(format).expect("a working format");
        let mut count = 0;
        let text = "%% LOGSTART 10\n0.1 R a nan\n0.1 A a \n0.2 R a 1\n%% LOGSTART 20\n0.2 A a 2\n";
        decoder.push(text.as_bytes(), |_| count += 1);
        assert_eq!(count, 1, "the row of the first run ends with it");
        decoder.finish(|_| count += 1);
        assert_eq!(count, 2);
        assert_eq!(decoder.statistics().malformed, 0);
    }
}
