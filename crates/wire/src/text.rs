//! What the text formats share: lines of a stream, the cells of a line, and numbers.

use crate::Statistics;
use crate::frame::{Frame, Framer, scan_line};

/// Longest line of a table, bytes.
pub const MAX_LINE: usize = 1 << 16;

/// Cuts a stream into lines of at most `MAX` bytes. A longer line counts as skipped bytes.
#[derive(Clone, Debug)]
pub(crate) struct Lines<const MAX: usize> {
    framer: Framer,
    statistics: Statistics,
}

impl<const MAX: usize> Lines<MAX> {
    pub fn new() -> Self {
        Self {
            framer: Framer::new(MAX),
            statistics: Statistics::default(),
        }
    }

    /// Takes bytes and delivers each line that they complete.
    pub fn push(&mut self, bytes: &[u8], deliver: impl FnMut(Frame<'_, ()>, &mut Statistics)) {
        self.framer
            .push(bytes, &mut self.statistics, scan_line::<MAX>, deliver);
    }

    /// Counts since the start. A last line without an end is not complete.
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }
}

/// The cells of a line, without the blanks around them.
#[derive(Clone, Debug)]
pub(crate) struct Cells<'l> {
    rest: Option<&'l str>,
    delimiter: Option<char>,
}

impl<'l> Cells<'l> {
    /// Cells between delimiters outside of double quotes; `None` for any run of blanks.
    pub fn new(line: &'l str, delimiter: Option<char>) -> Self {
        Self {
            rest: Some(line.trim_end_matches(['\r', '\n'])),
            delimiter,
        }
    }

    /// The text after the cells that were taken.
    pub fn rest(&self) -> &'l str {
        self.rest.unwrap_or_default().trim()
    }
}

impl<'l> Iterator for Cells<'l> {
    type Item = &'l str;

    fn next(&mut self) -> Option<&'l str> {
        let rest = self.rest?;
        let Some(delimiter) = self.delimiter else {
            let rest = rest.trim_start();
            let end = rest.find(char::is_whitespace).unwrap_or(rest.len());
            self.rest = Some(&rest[end..]);
            return (end > 0).then(|| &rest[..end]);
        };
        let mut quoted = false;
        let end = rest.find(|character| {
            quoted ^= character == '"';
            character == delimiter && !quoted
        });
        self.rest = end.map(|end| &rest[end + delimiter.len_utf8()..]);
        Some(rest[..end.unwrap_or(rest.len())].trim())
    }
}

/// A cell without the quotes and blanks around it.
pub(crate) fn unquoted(cell: &str) -> &str {
    cell.strip_prefix('"')
        .and_then(|inner| inner.strip_suffix('"'))
        .map_or(cell, str::trim)
}

/// The finite number that a text is.
pub(crate) fn number(text: &str) -> Option<f64> {
    text.parse().ok().filter(|number: &f64| number.is_finite())
}

/// Exact nanoseconds of a decimal number of units of `unit_ns`; `None` if the text is no number. A
/// double cannot hold seconds of UNIX time with a resolution of a microsecond.
#[must_use]
pub fn nanos(text: &str, unit_ns: u64) -> Option<i128> {
    let (sign, digits) = match text.strip_prefix('-') {
        Some(rest) => (-1, rest),
        None => (1, text.strip_prefix('+').unwrap_or(text)),
    };
    let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
    let plain = |text: &str| text.bytes().all(|b| b.is_ascii_digit());
    if whole.is_empty() || !plain(whole) || !plain(part) || whole.len() > 20 {
        let number: f64 = text.parse().ok().filter(|n: &f64| n.abs() < 1e18)?;
        return Some((number * unit_ns as f64).round() as i128);
    }
    let unit = i128::from(unit_ns);
    let kept = &part[..part.len().min(15)];
    let scale = 10_i128.pow(kept.len() as u32);
    let part: i128 = if kept.is_empty() {
        0
    } else {
        kept.parse().ok()?
    };
    let rounded = (part * unit + scale / 2) / scale;
    Some(sign * (whole.parse::<i128>().ok()? * unit + rounded))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_between_delimiters_blanks_and_quotes() {
        let cells = |line, delimiter| Cells::new(line, delimiter).collect::<Vec<_>>();
        assert_eq!(cells("a, b ,,c\r\n", Some(',')), ["a", "b", "", "c"]);
        assert_eq!(cells("\"a,b\",c", Some(',')), ["\"a,b\"", "c"]);
        assert_eq!(cells("", Some(',')), [""]);
        assert_eq!(cells("a;", Some(';')), ["a", ""]);
        assert_eq!(cells(" a \t b\n", None), ["a", "b"]);
        assert_eq!(cells(" ", None), [""; 0]);
        assert_eq!(cells("1·2", Some('·')), ["1", "2"]);
        assert_eq!(unquoted("\" a \""), "a");
        assert_eq!(unquoted("\""), "\"");
    }

    #[test]
    fn the_rest_of_a_line_follows_the_cells_that_were_taken() {
        let mut cells = Cells::new("12.5  speed a value of words \n", None);
        assert_eq!(cells.by_ref().take(3).count(), 3);
        assert_eq!(cells.rest(), "value of words");
        assert_eq!(Cells::new("a", None).rest(), "a");
    }

    #[test]
    fn long_lines_are_skipped_and_the_next_one_is_read() {
        let mut lines = Lines::<8>::new();
        let mut found = Vec::new();
        for byte in b"1234567890123\nab\ncd" {
            lines.push(&[*byte], |frame, _| found.push(frame.bytes.to_vec()));
        }
        assert_eq!(found.last().map(Vec::as_slice), Some(b"ab".as_slice()));
        assert_eq!(lines.statistics().messages, found.len() as u64);
        assert!(lines.statistics().skipped_bytes >= 8);
    }

    #[test]
    fn numbers_are_finite() {
        assert_eq!(number("-1.5e3"), Some(-1500.0));
        for text in ["inf", "nan", "", "1,5", "x"] {
            assert_eq!(number(text), None, "{text}");
        }
    }

    #[test]
    fn times_are_exact() {
        let second = 1_000_000_000;
        assert_eq!(
            nanos("1258500000.123456789", second),
            Some(1_258_500_000_123_456_789)
        );
        assert_eq!(nanos("-0.01", second), Some(-10_000_000));
        assert_eq!(nanos("1.5e-3", second), Some(1_500_000));
        assert_eq!(nanos("150", 1_000_000), Some(150_000_000));
        assert_eq!(nanos("0.0000000005", second), Some(1));
        for wrong in ["", "x", "1.2.3", "nan", "inf", "-"] {
            assert_eq!(nanos(wrong, second), None, "{wrong}");
        }
    }
}
