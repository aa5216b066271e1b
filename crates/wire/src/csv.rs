//! Delimited text: one row a line, columns by name or number.
//!
//! The rows come as they stand in the file. The first line that is neither skipped nor a comment
//! names the columns, unless the columns are given by number. A line has no checksum; one that
//! does not read as configured is counted and dropped whole.

use crate::column::{self, Column};
use crate::frame::Frame;
use crate::text::{Cells, Lines, unquoted};
use crate::{Item, Measurements, Message, Protocol, Statistics, WireError};

pub use crate::text::MAX_LINE;

/// Where a column stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// The name in the header.
    Name(String),
    /// The number, from one.
    Number(usize),
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Name(name) => write!(f, "\"{name}\""),
            Self::Number(number) => write!(f, "{number}"),
        }
    }
}

/// How a file is written.
#[derive(Clone, Debug, PartialEq)]
pub struct Format {
    /// Between two cells; `None` for any run of blanks.
    pub delimiter: Option<char>,
    /// Whether numbers have a decimal comma.
    pub decimal_comma: bool,
    /// What a comment line begins with; empty for none.
    pub comment: String,
    /// Lines before the header that mean nothing.
    pub skip_lines: usize,
    /// Whether a line names the columns.
    pub header: bool,
    /// Cells that stand for no value, beside empty ones and NaN.
    pub missing: Vec<String>,
    /// Columns that are read.
    pub columns: Vec<(Place, Column)>,
}

/// A cell that is no number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadCell {
    /// Position of the column in [`Format::columns`].
    pub column: usize,
    /// The cell; `None` where the row is too short.
    pub text: Option<String>,
}

impl Format {
    /// Whether a decoder can work with this.
    ///
    /// # Errors
    /// [`WireError::Setting`] names the first setting that cannot work.
    pub fn check(&self) -> Result<(), WireError> {
        let wrong = |what, got: String, expected| {
            Err(WireError::Setting {
                what,
                got,
                expected,
            })
        };
        if self.columns.is_empty() {
            return wrong("column", "empty".to_owned(), "at least one column");
        }
        for (place, column) in &self.columns {
            column.check()?;
            match place {
                Place::Number(0) => {
                    return wrong("column number", "0".to_owned(), "numbers from 1");
                }
                Place::Name(name) if !self.header => {
                    return wrong("column", name.clone(), "numbers, as there is no header");
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Whether a line carries nothing.
    #[must_use]
    pub fn is_blank(&self, line: &str) -> bool {
        let line = line.trim();
        line.is_empty() || (!self.comment.is_empty() && line.starts_with(&self.comment))
    }

    /// The cells of a line, without blanks and quotes around them.
    pub fn cells<'l>(&self, line: &'l str) -> Vec<&'l str> {
        Cells::new(line, self.delimiter).map(unquoted).collect()
    }

    /// Position of a column under this header; `None` where the header does not have it.
    #[must_use]
    pub fn position(&self, place: &Place, header: &[&str]) -> Option<usize> {
        match place {
            Place::Number(number) => number.checked_sub(1),
            Place::Name(name) => header.iter().position(|cell| cell == name),
        }
    }

    /// The number in a cell; `Ok(None)` where it stands for no value.
    ///
    /// # Errors
    /// Gives the cell back if it is no number.
    pub fn number<'c>(&self, cell: &'c str) -> Result<Option<f64>, &'c str> {
        if cell.is_empty() || self.missing.iter().any(|missing| missing == cell) {
            return Ok(None);
        }
        let number = if self.decimal_comma {
            cell.replace(',', ".").parse::<f64>()
        } else {
            cell.parse::<f64>()
        };
        match number {
            Ok(number) if number.is_nan() => Ok(None),
            Ok(number) if number.is_finite() => Ok(Some(number)),
            _ => Err(cell),
        }
    }

    /// The values of a row, SI, in the order of the columns.
    ///
    /// # Errors
    /// The first cell that is no number.
    pub fn row(&self, positions: &[usize], cells: &[&str]) -> Result<Vec<Option<f64>>, BadCell> {
        let mut values = Vec::with_capacity(self.columns.len());
        for (index, (position, (_, column))) in positions.iter().zip(&self.columns).enumerate() {
            let bad = |text: Option<&str>| BadCell {
                column: index,
                text: text.map(str::to_owned),
            };
            let cell = cells.get(*position).ok_or_else(|| bad(None))?;
            let number = self.number(cell).map_err(|cell| bad(Some(cell)))?;
            values.push(number.map(|number| column.value(number)));
        }
        Ok(values)
    }
}

/// Incremental decoder of one file or device.
#[derive(Clone, Debug)]
pub struct Decoder {
    lines: Lines<MAX_LINE>,
    format: Format,
    rows: Rows,
}

/// How far the file has come.
#[derive(Clone, Debug)]
struct Rows {
    to_skip: usize,
    positions: Option<Vec<usize>>,
}

impl Decoder {
    /// A decoder for this format.
    ///
    /// # Errors
    /// As [`Format::check`].
    pub fn new(format: Format) -> Result<Self, WireError> {
        format.check()?;
        let positions = (!format.header).then(|| {
            let places = format.columns.iter().map(|(place, _)| place);
            places.filter_map(|p| format.position(p, &[])).collect()
        });
        Ok(Self {
            lines: Lines::new(),
            rows: Rows {
                to_skip: format.skip_lines,
                positions,
            },
            format,
        })
    }

    /// Takes bytes and hands on what each line that they complete measured.
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
    rows: &mut Rows,
    statistics: &mut Statistics,
    sink: &mut impl FnMut(Item<'_>),
) {
    let Ok(line) = std::str::from_utf8(frame.bytes) else {
        statistics.malformed += 1;
        return;
    };
    if rows.to_skip > 0 {
        rows.to_skip -= 1;
        return;
    }
    if format.is_blank(line) {
        return;
    }
    let cells = format.cells(line);
    let Some(positions) = &rows.positions else {
        let places = format.columns.iter().map(|(place, _)| place);
        rows.positions = places.map(|p| format.position(p, &cells)).collect();
        if rows.positions.is_none() {
            statistics.malformed += 1;
        }
        return;
    };
    let Ok(values) = format.row(positions, &cells) else {
        statistics.malformed += 1;
        return;
    };
    let present: Vec<(&Column, f64)> = format
        .columns
        .iter()
        .zip(values)
        .filter_map(|((_, column), value)| Some((column, value?)))
        .collect();
    for (delay_s, measurement) in column::measurements(&present) {
        sink(Item {
            protocol: Protocol::Csv,
            name: "row",
            device_time: None,
            latency_s: Some(delay_s),
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

    fn format(columns: &[(&str, &str, &str)]) -> Format {
        Format {
            delimiter: Some(','),
            decimal_comma: false,
            comment: "#".to_owned(),
            skip_lines: 0,
            header: true,
            missing: vec!["-".to_owned()],
            columns: columns
                .iter()
                .map(|(place, quantity, unit)| {
                    let quantity = Quantity::from_name(quantity).expect("known");
                    let column = Column {
                        name: quantity.name(),
                        quantity,
                        unit: (*unit).to_owned(),
                        factor: quantity.dimension().factor(unit).expect("known"),
                        scale: 1.0,
                        offset: 0.0,
                        delay_s: 0.0,
                    };
                    (Place::Name((*place).to_owned()), column)
                })
                .collect(),
        }
    }

    fn decode(format: Format, bytes: &[u8], cut: usize) -> (Vec<Measurement>, Statistics) {
        let mut decoder = Decoder::new(format).expect("a working format");
        let mut all = Vec::new();
        for piece in bytes.chunks(cut) {
            decoder.push(piece, |item| all.extend(item.measurements));
        }
        (all, decoder.statistics())
    }

    const TEXT: &[u8] = b"# a drive\n\"t [s]\",vx,\"delta, road\"\n0,10,1\n0.1,-,2\n0.2,x,3\n0.3\n";

    #[test]
    fn rows_are_the_same_however_they_are_cut() {
        let columns = [
            ("vx", "speed.forward", "m/s"),
            ("delta, road", "steer", "rad"),
        ];
        let (whole, statistics) = decode(format(&columns), TEXT, 1 << 20);
        assert_eq!(whole.len(), 3, "{whole:?}");
        assert_eq!(statistics.malformed, 2, "the word and the short row");
        for cut in [1, 7, 13] {
            assert_eq!(decode(format(&columns), TEXT, cut).0, whole);
        }
    }

    #[test]
    fn a_header_without_the_column_gives_nothing() {
        let (all, statistics) = decode(format(&[("vy", "speed.forward", "m/s")]), TEXT, 100);
        assert!(all.is_empty());
        assert!(statistics.malformed > 0);
    }

    #[test]
    fn numbers_with_a_decimal_comma() {
        let mut format = format(&[("vx", "speed.forward", "km/h")]);
        format.delimiter = Some(';');
        format.decimal_comma = true;
        let (all, _) = decode(format, b"t;vx\n0;36,0\n", 100);
        let expected = sample::GroundSpeedSample {
            forward_m_s: 10.0,
            leftward_m_s: None,
        };
        assert_eq!(all, [Measurement::GroundSpeed(expected)]);
    }

    #[test]
    fn columns_by_number_need_no_header() {
        let mut format = format(&[("vx", "speed.forward", "m/s")]);
        assert!(
            Format {
                header: false,
                ..format.clone()
            }
            .check()
            .is_err()
        );
        format.header = false;
        format.delimiter = None;
        format.columns[0].0 = Place::Number(2);
        let (all, _) = decode(format, b"0  5.5 7\n", 100);
        assert_eq!(all.len(), 1);
    }
}
