//! Delimited text: one row a line, columns by name or number.
//!
//! The rows come as they stand in the file. The first line that is neither skipped nor a comment
//! names the columns, unless the columns are given by number. If that line does not have the names,
//! but the comment before it has them, the comment is the header and the line is a row: some programs
//! write the header as a comment. A line has no checksum; one that does not read as configured is
//! counted and dropped whole.
//!
//! [`Reader`] holds these rules. The decoder and an importer use the same reader, so that they agree.

mod decoder;
mod held;
mod reader;

use crate::WireError;
use crate::column::Column;
use crate::text::{Cells, unquoted};

pub use decoder::Decoder;
pub use held::Held;
pub use reader::{Line, LineError, Reader};

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
    /// Lines before the header that mean nothing, blank ones included.
    pub skip_lines: usize,
    /// Whether a line names the columns.
    pub header: bool,
    /// Whether the line after the header has the units.
    pub units_row: bool,
    /// Cells that stand for no value, beside empty ones and NaN.
    pub missing: Vec<String>,
    /// Columns that are read.
    pub columns: Vec<(Place, Column)>,
}

/// A cell without the number that was expected.
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

    /// Position of a column under this header.
    ///
    /// # Errors
    /// The header does not have the name, or has it more than once.
    pub fn position(&self, place: &Place, header: &[&str]) -> Result<usize, LineError> {
        let absent = || LineError::Absent(place.clone());
        match place {
            Place::Number(number) => number.checked_sub(1).ok_or_else(absent),
            Place::Name(name) => {
                let mut found = header.iter().enumerate().filter(|(_, cell)| *cell == name);
                let (first, _) = found.next().ok_or_else(absent)?;
                match found.next() {
                    None => Ok(first),
                    Some((second, _)) => {
                        Err(LineError::Twice(place.clone(), [first + 1, second + 1]))
                    }
                }
            }
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
}

#[cfg(test)]
mod tests {
    use sample::Measurement;

    use super::*;
    use crate::Statistics;
    use crate::column::Quantity;

    fn format(columns: &[(&str, &str, &str)]) -> Format {
        Format {
            delimiter: Some(','),
            decimal_comma: false,
            comment: "#".to_owned(),
            skip_lines: 0,
            header: true,
            units_row: false,
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
                        latency_s: 0.0,
                        held_rows: 1,
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

    const SPEED: &[(&str, &str, &str)] = &[("v", "speed.forward", "m/s")];

    fn speeds(format: Format, text: &str) -> Vec<f64> {
        let whole = decode(format.clone(), text.as_bytes(), 1 << 20).0;
        for cut in [1, 2, 5] {
            assert_eq!(decode(format.clone(), text.as_bytes(), cut).0, whole);
        }
        let speed = |m| match m {
            Measurement::GroundSpeed(speed) => speed.forward_m_s,
            other => panic!("{other:?}"),
        };
        whole.into_iter().map(speed).collect()
    }

    #[test]
    fn blank_lines_among_the_skipped_ones_count() {
        let mut format = format(SPEED);
        format.skip_lines = 3;
        for end in ["\n", "\r\n", "\r"] {
            let text = ["Title,x", "", "Note,y", "t,v", "0,10", "1,11", ""].join(end);
            assert_eq!(speeds(format.clone(), &text), [10.0, 11.0], "{end:?}");
        }
    }

    #[test]
    fn a_header_may_be_a_comment() {
        let text = "# made by hand\n# t,v\n0,3\n1,4\n";
        assert_eq!(speeds(format(SPEED), text), [3.0, 4.0]);
        let both = "# t,v\nt,v\n0,3\n";
        assert_eq!(speeds(format(SPEED), both), [3.0]);
    }

    #[test]
    fn a_row_of_units_is_no_row_and_must_agree() {
        let mut format = format(SPEED);
        format.units_row = true;
        assert_eq!(speeds(format.clone(), "t,v\ns,[m/s]\n0,3\n"), [3.0]);
        let mut reader = Reader::new(format, Vec::new());
        assert_eq!(reader.take("t,v"), Ok(Line::Header));
        let error = LineError::Unit(0, "km/h".to_owned());
        assert_eq!(reader.take("s,(km/h)"), Err(error));
    }

    #[test]
    fn names_must_occur_once_and_numbers_are_no_header() {
        let mut reader = Reader::new(format(SPEED), Vec::new()).strict();
        let place = Place::Name("v".to_owned());
        assert_eq!(reader.take("t,v,v"), Err(LineError::Twice(place, [2, 3])));
        let mut by_number = format(SPEED);
        by_number.columns[0].0 = Place::Number(2);
        let mut reader = Reader::new(by_number, Vec::new()).strict();
        assert_eq!(reader.take("0,10"), Err(LineError::Numbers));
    }

    #[test]
    fn held_values_are_handed_on_once() {
        let mut format = format(SPEED);
        format.columns[0].1.held_rows = 4;
        let held: String = [1, 1, 1, 1, 2, 2, 2, 2, 2, 3, 3, 3]
            .map(|v| format!("0,{v}\n"))
            .concat();
        assert_eq!(
            speeds(format.clone(), &format!("t,v\n{held}")),
            [1.0, 2.0, 2.0, 3.0]
        );
        // A standing vehicle still has a speed.
        let standing = "0,0\n".repeat(12);
        assert_eq!(speeds(format, &format!("t,v\n{standing}")), [0.0; 3]);
    }

    /// Measurements that an importer finds line by line.
    fn by_reader(format: &Format, text: &str) -> usize {
        let mut reader = Reader::new(format.clone(), Vec::new());
        let mut held = Held::default();
        let mut count = 0;
        for line in text
            .split_inclusive('\n')
            .filter(|line| line.ends_with('\n'))
        {
            if let Ok(Line::Row(mut values)) = reader.take(line) {
                held.leave_out(format, &mut values);
                let columns = format.columns.iter().map(|(_, column)| column);
                let present = columns.zip(values).filter_map(|(c, v)| Some((c, v?)));
                count += crate::column::measurements(&present.collect::<Vec<_>>()).len();
            }
        }
        count
    }

    #[test]
    fn decoder_and_reader_agree_on_any_text() {
        const LETTERS: &[u8] = b"\n\n,,01 .-#ab\"x";
        let mut state = 1_u64;
        let mut next = |count: usize| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) as usize % count
        };
        let mut rows = 0;
        for _ in 0..20_000 {
            let mut format = format(&[("a", "steer", "rad"), ("b", "rate.z", "rad/s")]);
            format.skip_lines = next(3);
            format.units_row = next(4) == 0;
            format.columns[0].1.held_rows = 1 + next(3) as u32;
            if next(2) == 0 {
                format.header = false;
                format.columns[0].0 = Place::Number(1);
                format.columns[1].0 = Place::Number(2);
            }
            let mut text: String = (0..next(60))
                .map(|_| char::from(LETTERS[next(LETTERS.len())]))
                .collect();
            if next(2) == 0 {
                let headers = ["a,b\n", "# a,b\n", "b,x,a\n"];
                text.insert_str(0, headers[next(headers.len())]);
            }
            let expected = by_reader(&format, &text);
            let cut = 1 + next(20);
            assert_eq!(
                decode(format, text.as_bytes(), cut).0.len(),
                expected,
                "{text:?}"
            );
            rows += expected;
        }
        assert!(rows > 1000, "{rows}");
    }
}
