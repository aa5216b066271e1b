//! MOOS `.alog` files: one variable a line, `time variable source value`.
//!
//! The form is pLogger's of MOOS (`CMOOSLogger::DoAsyncLog`): lines that begin with `%` are
//! remarks, `%% LOGSTART` gives the UNIX time of time zero, columns are parted by blanks, and the
//! value, which may hold blanks, runs to the end of the line. A value is a number or a text; a text
//! may hold numbers as `[3x1]{1,2,3}` or as `KEY=1,OTHER=2`.
//!
//! Variables that one act of measuring writes stand on lines of their own, at the same time or
//! nearly so. They make one row: it is complete when every column has its value, and as good as it
//! gets when a column comes again or a line of a later time, whatever it holds, is read.

use crate::column::{self, Column};
use crate::frame::Frame;
use crate::text::{Cells, Lines, MAX_LINE, number};
use crate::{Item, Measurements, Message, Protocol, Statistics, WireError};

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
    /// Lines of one row are no further apart than this, s.
    pub together_s: f64,
}

/// One line that is not a remark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line<'l> {
    /// Seconds since the log's start.
    pub time_s: f64,
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
            time_s: number(cells.next()?)?,
            variable: cells.next()?,
            source: cells.next()?,
            value: cells.rest(),
        })
    }
}

impl Part {
    /// The number that is meant; `None` where the value does not hold it.
    #[must_use]
    pub fn number(&self, value: &str) -> Option<f64> {
        let text = match self {
            Self::Whole => value.trim().trim_matches('"'),
            Self::Element(position) => {
                let inner = value.rsplit_once('{').map_or(value, |(_, inner)| inner);
                let inner = inner.trim_end_matches(['}', ' ']).trim_matches('"');
                let separators = [',', ';', ' ', '\t'];
                let mut numbers = inner.split(separators).filter(|part| !part.is_empty());
                numbers.nth(position.checked_sub(1)?)?
            }
            Self::Key(key) => value.trim_matches('"').split([',', ';']).find_map(|pair| {
                let (name, number) = pair.split_once('=')?;
                (name.trim() == key).then_some(number.trim())
            })?,
        };
        number(text)
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

    /// The variables that a line holds, with their values in SI; a value that is none is `None`.
    pub fn values<'f>(
        &'f self,
        line: &Line<'_>,
    ) -> impl Iterator<Item = (usize, &'f Variable, Option<f64>)> {
        let (name, source, value) = (
            line.variable.to_owned(),
            line.source.to_owned(),
            line.value.to_owned(),
        );
        self.variables
            .iter()
            .enumerate()
            .filter(move |(_, v)| v.name == name && (v.source.is_empty() || v.source == source))
            .map(move |(index, v)| (index, v, v.part.number(&value).map(|n| v.column.value(n))))
    }
}

/// Incremental decoder of one file.
#[derive(Clone, Debug)]
pub struct Decoder {
    lines: Lines<MAX_LINE>,
    format: Format,
    rows: Vec<Row>,
}

/// What one group has so far.
#[derive(Clone, Debug, Default)]
struct Row {
    size: usize,
    began_s: f64,
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
        })
    }

    /// Takes bytes and hands on what each row that they complete measured.
    pub fn push(&mut self, bytes: &[u8], mut sink: impl FnMut(Item<'_>)) {
        let (format, rows) = (&self.format, &mut self.rows);
        self.lines.push(bytes, |frame, statistics| {
            take_line(&frame, format, rows, statistics, &mut sink);
        });
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
    statistics: &mut Statistics,
    sink: &mut impl FnMut(Item<'_>),
) {
    let text = String::from_utf8_lossy(frame.bytes);
    if is_remark(&text) {
        return;
    }
    let Some(line) = Line::parse(&text) else {
        statistics.malformed += 1;
        return;
    };
    for row in rows.iter_mut() {
        let moved_on = (line.time_s - row.began_s).abs() > format.together_s;
        if !row.values.is_empty() && moved_on {
            emit(frame, format, row, line.time_s, sink);
        }
    }
    let mut known = false;
    for (index, variable, value) in format.values(&line) {
        known = true;
        let Some(value) = value else {
            statistics.malformed += 1;
            continue;
        };
        let row = &mut rows[variable.group];
        if row.values.iter().any(|(held, _)| *held == index) {
            emit(frame, format, row, line.time_s, sink);
        }
        if row.values.is_empty() {
            row.began_s = line.time_s;
        }
        row.values.push((index, value));
        if row.values.len() == row.size {
            emit(frame, format, row, line.time_s, sink);
        }
    }
    if !known {
        statistics.unknown += 1;
    }
}

/// Hands a row on and empties it. `now_s` is the time of the line that ended it.
fn emit(
    frame: &Frame<'_, ()>,
    format: &Format,
    row: &mut Row,
    now_s: f64,
    sink: &mut impl FnMut(Item<'_>),
) {
    let late_s = (now_s - row.began_s).max(0.0);
    let values: Vec<(&Column, f64)> = row
        .values
        .drain(..)
        .map(|(index, value)| (&format.variables[index].column, value))
        .collect();
    for (delay_s, measurement) in column::measurements(&values) {
        sink(Item {
            protocol: Protocol::Alog,
            name: "row",
            device_time: None,
            latency_s: Some(delay_s + late_s),
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
                delay_s: 0.0,
            },
        }
    }

    fn decode(variables: Vec<Variable>, text: &str) -> (Vec<(f64, Measurement)>, Statistics) {
        let format = Format {
            variables,
            together_s: 0.001,
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
        assert_eq!(Part::Element(3).number(vector), Some(-3.0));
        assert_eq!(Part::Element(4).number(vector), None);
        assert_eq!(Part::Element(0).number(vector), None);
        let pairs = "NAME=car, SPD=4.5,HDG=90";
        assert_eq!(Part::Key("SPD".to_owned()).number(pairs), Some(4.5));
        assert_eq!(Part::Key("PD".to_owned()).number(pairs), None);
        assert_eq!(Part::Whole.number("nan"), None);
    }

    #[test]
    fn the_start_of_the_log() {
        assert_eq!(
            log_start("%% LOGSTART     1258500000.25"),
            Some(1_258_500_000.25)
        );
        assert_eq!(log_start("%% LOG FILE: x"), None);
        let line = Line::parse("12.5   zCourse   gNovatel:a  90.0  ").expect("a line");
        assert_eq!((line.time_s, line.value), (12.5, "90.0"));
        assert!(Line::parse("12.5 zCourse").is_none());
        assert!(Line::parse("x zCourse a 1").is_none());
    }
}
