//! Columns of different rates at common times.

mod grid;
mod interpolate;

use std::fmt;
use std::str::FromStr;

pub use grid::{Grid, GridError};

use crate::{Column, Values};
use interpolate::Places;

/// A gap is longer than this multiple of the median interval between the values of a column. Two values
/// in a row may be lost without a gap.
const GAP_INTERVALS: i64 = 3;
/// Longest interval between two values without a gap if the interval is not given, ns. It is above the
/// interval of the slowest periodic topics, which have one message each second.
const LONGEST_GAP_NS: i64 = 5_000_000_000;

/// How a value at a time is computed from the values of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The last value at the time or before it.
    Previous,
    /// Linear interpolation between the last value before the time and the first value after it. An angle
    /// takes the shorter way around the circle. An integer is rounded. Text, truth values, and names of
    /// values are those of [`Method::Previous`].
    Linear,
    /// The nearest value; the earlier one of two values at the same distance.
    Nearest,
}

impl Method {
    /// All methods.
    pub const ALL: [Self; 3] = [Self::Previous, Self::Linear, Self::Nearest];

    /// Its name on the command line and in Python.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Previous => "previous",
            Self::Linear => "linear",
            Self::Nearest => "nearest",
        }
    }

    /// The method for the values of a column: no value is between two texts, truth values or names.
    #[must_use]
    pub fn for_column(self, column: &Column) -> Self {
        let is_number = match &column.values {
            Values::Text(_) | Values::Bytes(_) | Values::Bool(_) | Values::List { .. } => false,
            Values::I32(_) => column.names.is_empty(),
            Values::F64(_) | Values::I64(_) | Values::U32(_) | Values::U64(_) => true,
        };
        match self {
            Self::Linear if !is_number => Self::Previous,
            method => method,
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The name of a method is none of [`Method::ALL`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("method {found:?} is unknown; use previous, linear or nearest")]
pub struct MethodError {
    /// The name.
    pub found: String,
}

impl FromStr for Method {
    type Err = MethodError;

    fn from_str(text: &str) -> Result<Self, MethodError> {
        let found = || MethodError {
            found: text.to_owned(),
        };
        let known = Self::ALL.into_iter().find(|method| method.name() == text);
        known.ok_or_else(found)
    }
}

/// A column at other times.
///
/// Rows without a value (NaN, or absent by [`Column::present`]) are ignored, so that each column of a
/// topic has its own times. `times_ns` are those of its rows, in any order; of rows with the same time, the
/// last one counts. `targets_ns` rise.
///
/// **Gaps.** A gap is an interval of more than `max_gap_ns` between two consecutive values of the column. A
/// value of [`Method::Previous`] is used for at most `max_gap_ns` after its time, a value of
/// [`Method::Nearest`] for at most half of it before and after its time, and [`Method::Linear`] gives no
/// value inside of a gap. No method gives a value before the first value of the column, except
/// [`Method::Nearest`] within half of `max_gap_ns`; the same holds for [`Method::Linear`] after the last
/// value. [`max_gap_ns`] gives the usual limit.
///
/// The result has the type of the column. A target without a value is NaN in a column of floating-point
/// numbers, and absent by [`Column::present`] in any other column. Lists have no values at other times: all
/// rows are absent.
#[must_use]
pub fn align(
    times_ns: &[i64],
    column: &Column,
    targets_ns: &[i64],
    method: Method,
    max_gap_ns: i64,
) -> Column {
    let method = method.for_column(column);
    let rows = value_rows(times_ns, column);
    let places = Places::new(times_ns, &rows, targets_ns, method, max_gap_ns.max(0));
    let (values, is_float) = interpolate::values(column, &places);
    Column {
        name: column.name.clone(),
        unit: column.unit.clone(),
        names: column.names.clone(),
        values,
        present: (!is_float).then(|| places.present()),
    }
}

/// The longest interval between two values of a column that is no gap, ns: three times the median of
/// `intervals_ns` ([`intervals_ns`]), at most 5 s; 5 s without an interval. The order of the intervals
/// changes.
#[must_use]
pub fn max_gap_ns(intervals_ns: &mut [i64]) -> i64 {
    let middle = intervals_ns.len() / 2;
    if intervals_ns.is_empty() {
        return LONGEST_GAP_NS;
    }
    let median = *intervals_ns.select_nth_unstable(middle).1;
    median.saturating_mul(GAP_INTERVALS).min(LONGEST_GAP_NS)
}

/// Intervals between consecutive values of a column, ns; values with the same time are one. The arguments
/// are those of [`align`].
#[must_use]
pub fn intervals_ns(times_ns: &[i64], column: &Column) -> Vec<i64> {
    let rows = value_rows(times_ns, column);
    let pairs = rows.windows(2);
    let intervals = pairs.map(|pair| times_ns[pair[1]].saturating_sub(times_ns[pair[0]]));
    intervals.collect()
}

/// Rows with a value in the order of time, one for each time.
fn value_rows(times_ns: &[i64], column: &Column) -> Vec<usize> {
    let has_value = |row: &usize| match (&column.values, &column.present) {
        (Values::List { .. }, _) => false,
        (Values::F64(list), _) => !list[*row].is_nan(),
        (_, Some(present)) => present[*row],
        (_, None) => true,
    };
    let mut rows: Vec<usize> = (0..times_ns.len().min(column.values.len()))
        .filter(has_value)
        .collect();
    if !rows.is_sorted_by_key(|row| times_ns[*row]) {
        rows.sort_by_key(|row| times_ns[*row]);
    }
    // Of equal times, the last remains.
    rows.dedup_by(|later, earlier| {
        let is_same = times_ns[*later] == times_ns[*earlier];
        if is_same {
            *earlier = *later;
        }
        is_same
    });
    rows
}

#[cfg(test)]
mod tests;
