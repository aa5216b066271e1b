//! Conversions of raw values into physical numbers.

use std::io::{Read, Seek};

use super::block::File;
use crate::can_log::Error;
use crate::can_log::bytes::{u8_at, u16_at, u64_at};

/// Rule of a `CC` block, as far as its result is a number.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) enum Conversion {
    /// The raw value.
    #[default]
    Identity,
    /// `offset + factor · x`.
    Linear { offset: f64, factor: f64 },
    /// `(p1 x² + p2 x + p3) / (p4 x² + p5 x + p6)`.
    Rational([f64; 6]),
    /// Straight lines between the pairs of a table; constant beyond its ends.
    Interpolated(Vec<[f64; 2]>),
    /// The value of the next pair of a table; of two equally near ones the lower.
    Nearest(Vec<[f64; 2]>),
    /// Values of ranges `[from, to, value]`, and the value outside.
    Ranges(Vec<[f64; 3]>, f64),
}

impl Conversion {
    /// Reads a rule. A rule whose result is no number gives the raw value.
    pub fn read<R: Read + Seek>(file: &mut File<'_, R>, place: u64) -> Result<Self, Error> {
        if place == 0 {
            return Ok(Self::Identity);
        }
        let Some(block) = file.block(place, *b"CC")? else {
            return Ok(Self::Identity);
        };
        let count = usize::from(u16_at(&block.data, 6));
        let stored = block.data.get(24..).unwrap_or_default();
        let values = stored.chunks_exact(8).take(count);
        let values: Vec<f64> = values
            .map(|bytes| f64::from_bits(u64_at(bytes, 0)))
            .collect();
        Ok(Self::of(u8_at(&block.data, 0), &values))
    }

    fn of(kind: u8, values: &[f64]) -> Self {
        let pairs = || {
            values
                .chunks_exact(2)
                .map(|pair| [pair[0], pair[1]])
                .collect()
        };
        match (kind, values) {
            (1, &[offset, factor, ..]) => Self::Linear { offset, factor },
            (2, &[p1, p2, p3, p4, p5, p6, ..]) => Self::Rational([p1, p2, p3, p4, p5, p6]),
            (4, &[_, _, ..]) => Self::Interpolated(pairs()),
            (5, &[_, _, ..]) => Self::Nearest(pairs()),
            (6, &[_, ..]) => {
                let ranges = values.chunks_exact(3);
                let default = ranges.remainder().first().copied().unwrap_or(f64::NAN);
                Self::Ranges(ranges.map(|r| [r[0], r[1], r[2]]).collect(), default)
            }
            _ => Self::Identity,
        }
    }

    /// The physical value. `integer`: the raw value is an integer, whose ranges include their end.
    pub fn apply(&self, x: f64, integer: bool) -> f64 {
        match self {
            Self::Identity => x,
            Self::Linear { offset, factor } => factor * x + offset,
            Self::Rational([p1, p2, p3, p4, p5, p6]) => {
                (p1 * x * x + p2 * x + p3) / (p4 * x * x + p5 * x + p6)
            }
            Self::Interpolated(pairs) => interpolated(pairs, x),
            Self::Nearest(pairs) => nearest(pairs, x),
            Self::Ranges(ranges, default) => {
                let inside =
                    |[from, to, _]: &&[f64; 3]| *from <= x && (x < *to || (integer && x <= *to));
                ranges
                    .iter()
                    .find(inside)
                    .map_or(*default, |[_, _, value]| *value)
            }
        }
    }
}

fn interpolated(pairs: &[[f64; 2]], x: f64) -> f64 {
    let above = pairs.partition_point(|[key, _]| *key <= x);
    match (
        above.checked_sub(1).map(|below| pairs[below]),
        pairs.get(above),
    ) {
        (Some([x0, y0]), Some([x1, y1])) => y0 + (y1 - y0) * (x - x0) / (x1 - x0),
        (Some([_, y]), None) | (None, Some(&[_, y])) => y,
        (None, None) => x,
    }
}

fn nearest(pairs: &[[f64; 2]], x: f64) -> f64 {
    let above = pairs.partition_point(|[key, _]| *key <= x);
    match (
        above.checked_sub(1).map(|below| pairs[below]),
        pairs.get(above),
    ) {
        (Some([x0, y0]), Some([x1, y1])) => {
            if x - x0 <= x1 - x {
                y0
            } else {
                *y1
            }
        }
        (Some([_, y]), None) | (None, Some(&[_, y])) => y,
        (None, None) => x,
    }
}
