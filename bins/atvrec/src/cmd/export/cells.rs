//! Cells of a table by the names of its columns, and texts of times.

use engine::session::utc_compact;
use store::{Column, Table, Values};

/// Nanoseconds of a second.
const SECOND_NS: i64 = 1_000_000_000;

/// A column of numbers with a fraction; absent cells and columns are NaN.
pub struct Numbers<'t>(&'t [f64]);

impl<'t> Numbers<'t> {
    /// The column with this name.
    pub fn new(table: &'t Table, name: &str) -> Self {
        match column(table, name).map(|column| &column.values) {
            Some(Values::F64(list)) => Self(list),
            _ => Self(&[]),
        }
    }

    /// The number in a row.
    pub fn at(&self, row: usize) -> f64 {
        self.0.get(row).copied().unwrap_or(f64::NAN)
    }
}

/// The integer in a row of a column; `None` if it is absent.
pub fn integer(table: &Table, name: &str, row: usize) -> Option<u32> {
    let column = column(table, name)?;
    let is_present = column.present.as_ref().is_none_or(|present| present[row]);
    match &column.values {
        Values::U32(list) => list.get(row).copied().filter(|_| is_present),
        Values::I32(list) => {
            (list.get(row).filter(|_| is_present)).and_then(|value| u32::try_from(*value).ok())
        }
        _ => None,
    }
}

fn column<'t>(table: &'t Table, name: &str) -> Option<&'t Column> {
    table.columns.iter().find(|column| column.name == name)
}

/// A time in ns since 1970 to the microsecond, as 2026-11-27T20:45:00.25Z.
pub fn time(ns: i64) -> String {
    let us = ns.max(0).cast_unsigned() / 1_000;
    let compact = utc_compact(us / 1_000_000);
    let mut text = String::new();
    for (place, c) in compact.trim_end_matches('Z').chars().enumerate() {
        match place {
            4 | 6 => text.push('-'),
            11 | 13 => text.push(':'),
            _ => {}
        }
        text.push(c);
    }
    let fraction = us % 1_000_000;
    if fraction > 0 {
        let digits = format!(".{fraction:06}");
        text.push_str(digits.trim_end_matches('0'));
    }
    text + "Z"
}

/// Seconds and nanoseconds of a time in ns since 1970.
pub fn seconds(ns: i64) -> (i64, u32) {
    let part = ns.rem_euclid(SECOND_NS);
    // Below 1e9.
    (
        ns.div_euclid(SECOND_NS),
        u32::try_from(part).unwrap_or_default(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_those_of_iso_8601() {
        let ns = 1_795_812_300_250_000_999;
        assert_eq!(time(ns), "2026-11-27T20:45:00.25Z");
        assert_eq!(time(ns - 250_000_999), "2026-11-27T20:45:00Z");
        assert_eq!(seconds(ns), (1_795_812_300, 250_000_999));
        assert_eq!(seconds(-1), (-1, 999_999_999));
    }
}
