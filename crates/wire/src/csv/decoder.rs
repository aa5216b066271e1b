//! Incremental decoder of a table.

use super::{Format, Held, Line, MAX_LINE, Reader};
use crate::column::{self, Column};
use crate::frame::Frame;
use crate::text::Lines;
use crate::{Item, Measurements, Message, Protocol, Statistics, WireError};

/// Incremental decoder of one file or device.
#[derive(Clone, Debug)]
pub struct Decoder {
    lines: Lines<MAX_LINE>,
    skipped: Skipped,
    rows: Rows,
}

/// The lines as rows.
#[derive(Clone, Debug)]
struct Rows {
    reader: Reader,
    held: Held,
}

/// The lines at the beginning that mean nothing. Blank lines count, so they are counted here: the
/// framer drops them.
#[derive(Clone, Debug)]
struct Skipped {
    left: usize,
    bytes: u64,
    /// The last byte was a carriage return, which ends a line with or without a line feed after it.
    after_return: bool,
}

impl Skipped {
    /// The bytes after the lines that are to be skipped.
    fn rest<'b>(&mut self, bytes: &'b [u8]) -> &'b [u8] {
        let mut at = 0;
        while at < bytes.len() && (self.left > 0 || self.after_return) {
            let byte = bytes[at];
            let ended = std::mem::take(&mut self.after_return);
            match byte {
                b'\n' if ended => {}
                b'\n' => self.left -= 1,
                _ if self.left == 0 => break,
                b'\r' => {
                    self.left -= 1;
                    self.after_return = true;
                }
                _ => {}
            }
            at += 1;
        }
        self.bytes += at as u64;
        &bytes[at..]
    }
}

impl Decoder {
    /// A decoder for this format.
    ///
    /// # Errors
    /// As [`Format::check`].
    pub fn new(format: Format) -> Result<Self, WireError> {
        format.check()?;
        Ok(Self {
            lines: Lines::new(),
            skipped: Skipped {
                left: format.skip_lines,
                bytes: 0,
                after_return: false,
            },
            rows: Rows {
                reader: Reader::new(format, Vec::new()).after_skipped(),
                held: Held::default(),
            },
        })
    }

    /// Takes bytes and hands on what each line that they complete measured.
    pub fn push(&mut self, bytes: &[u8], mut sink: impl FnMut(Item<'_>)) {
        let rest = self.skipped.rest(bytes);
        let (rows, before) = (&mut self.rows, self.skipped.bytes);
        self.lines.push(rest, |frame, statistics| {
            take_line(&frame, before, rows, statistics, &mut sink);
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
    before: u64,
    rows: &mut Rows,
    statistics: &mut Statistics,
    sink: &mut impl FnMut(Item<'_>),
) {
    let Ok(line) = std::str::from_utf8(frame.bytes) else {
        statistics.malformed += 1;
        return;
    };
    let mut values = match rows.reader.take(line) {
        Ok(Line::Row(values)) => values,
        Ok(Line::Nothing | Line::Header) => return,
        Err(_) => {
            statistics.malformed += 1;
            return;
        }
    };
    let format = rows.reader.format();
    rows.held.leave_out(format, &mut values);
    let present: Vec<(&Column, f64)> = (format.columns.iter())
        .zip(values)
        .filter_map(|((_, column), value)| Some((column, value?)))
        .collect();
    for (latency_s, measurement) in column::measurements(&present) {
        sink(Item {
            protocol: Protocol::Csv,
            name: "row",
            device_time: None,
            latency_s: Some(latency_s),
            measurements: Measurements::one(measurement),
            message: Message::Row,
            raw: frame.bytes,
            range: frame.range.start + before..frame.range.end + before,
        });
    }
}
