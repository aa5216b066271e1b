//! Conversions of raw values into physical values.

use std::io::{Read, Seek};

use super::block::{Block, File};
use super::formula::Formula;
use crate::can_log::Error;
use crate::can_log::bytes::{u8_at, u16_at, u64_at};

/// Deepest nesting of rules that refer to rules.
const DEPTH_MAX: u32 = 4;

/// Rule of a `CC` block.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) enum Conversion {
    /// The raw value.
    #[default]
    Identity,
    /// `offset + factor · x`.
    Linear { offset: f64, factor: f64 },
    /// `(p1 x² + p2 x + p3) / (p4 x² + p5 x + p6)`.
    Rational([f64; 6]),
    /// A formula of `x`.
    Algebraic(Formula),
    /// Straight lines between the pairs of a table; constant beyond its ends.
    Interpolated(Vec<[f64; 2]>),
    /// The value of the next pair of a table; of two equally near ones the lower.
    Nearest(Vec<[f64; 2]>),
    /// Values of ranges `[from, to, value]`, and the value outside.
    Ranges(Vec<[f64; 3]>, f64),
    /// Texts or rules of ranges `[from, to]`, and the one outside. The standard forbids ranges that
    /// overlap; a value that is in several gets the one outside.
    Chosen(Vec<([f64; 2], Choice)>, Choice),
    /// A rule that is not known: the value cannot be stated.
    Unknown,
}

/// What a rule refers to.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Choice {
    Text(String),
    Rule(Box<Conversion>),
}

/// A physical value.
#[derive(Clone, Debug, PartialEq)]
pub enum Physical {
    /// A number, in the unit of its column.
    Number(f64),
    /// A text, for example the name of a state.
    Text(String),
    /// The value cannot be read.
    Unknown,
}

impl Conversion {
    /// Reads a rule.
    pub fn read<R: Read + Seek>(file: &mut File<'_, R>, place: u64) -> Result<Self, Error> {
        Self::read_nested(file, place, 0)
    }

    fn read_nested<R: Read + Seek>(
        file: &mut File<'_, R>,
        place: u64,
        depth: u32,
    ) -> Result<Self, Error> {
        if place == 0 {
            return Ok(Self::Identity);
        }
        let Some(block) = file.block(place, *b"CC")? else {
            return Ok(Self::Unknown);
        };
        let count = usize::from(u16_at(&block.data, 6));
        let stored = block.data.get(24..).unwrap_or_default();
        let values = stored.chunks_exact(8).take(count);
        let values: Vec<f64> = values
            .map(|bytes| f64::from_bits(u64_at(bytes, 0)))
            .collect();
        match u8_at(&block.data, 0) {
            3 => {
                let text = file.text(block.link(4))?.unwrap_or_default();
                Ok(Formula::parse(&text).map_or(Self::Unknown, Self::Algebraic))
            }
            kind @ (7 | 8) if depth < DEPTH_MAX => {
                let width = usize::from(kind) - 6;
                Self::read_choices(file, &block, &values, width, depth)
            }
            kind => Ok(Self::of(kind, &values)),
        }
    }

    /// Values (`width` 1) or ranges (`width` 2) with what they refer to.
    fn read_choices<R: Read + Seek>(
        file: &mut File<'_, R>,
        block: &Block,
        values: &[f64],
        width: usize,
        depth: u32,
    ) -> Result<Self, Error> {
        let mut choice = |index: usize| -> Result<Choice, Error> {
            let place = block.link(4 + index);
            let is_rule = place != 0 && file.header(place)?.is_some_and(|h| h.id == *b"CC");
            if is_rule {
                let rule = Self::read_nested(file, place, depth + 1)?;
                return Ok(Choice::Rule(Box::new(rule)));
            }
            Ok(Choice::Text(file.text(place)?.unwrap_or_default()))
        };
        let keys = values.chunks_exact(width);
        let count = keys.len();
        let mut choices = Vec::new();
        for (index, key) in keys.enumerate() {
            choices.push(([key[0], key[width - 1]], choice(index)?));
        }
        Ok(Self::Chosen(choices, choice(count)?))
    }

    fn of(kind: u8, values: &[f64]) -> Self {
        let pairs = || {
            values
                .chunks_exact(2)
                .map(|pair| [pair[0], pair[1]])
                .collect()
        };
        match (kind, values) {
            (0, _) => Self::Identity,
            (1, &[offset, factor, ..]) => Self::Linear { offset, factor },
            (2, &[p1, p2, p3, p4, p5, p6, ..]) => Self::Rational([p1, p2, p3, p4, p5, p6]),
            (4, &[_, _, ..]) => Self::Interpolated(pairs()),
            (5, &[_, _, ..]) => Self::Nearest(pairs()),
            (6, &[_, ..]) => {
                let ranges = values.chunks_exact(3);
                let default = ranges.remainder().first().copied().unwrap_or(f64::NAN);
                Self::Ranges(ranges.map(|r| [r[0], r[1], r[2]]).collect(), default)
            }
            _ => Self::Unknown,
        }
    }

    /// The physical value of a number. `integer`: the raw value is an integer, whose ranges include
    /// their end.
    pub fn apply(&self, x: f64, integer: bool) -> Physical {
        let inside =
            |from: f64, to: f64| from <= x && (x < to || (integer && x <= to) || from == x);
        Physical::Number(match self {
            Self::Identity => x,
            Self::Linear { offset, factor } => factor * x + offset,
            Self::Rational([p1, p2, p3, p4, p5, p6]) => {
                (p1 * x * x + p2 * x + p3) / (p4 * x * x + p5 * x + p6)
            }
            Self::Algebraic(formula) => formula.apply(x),
            Self::Interpolated(pairs) => interpolated(pairs, x),
            Self::Nearest(pairs) => nearest(pairs, x),
            Self::Ranges(ranges, default) => {
                let range = ranges.iter().find(|[from, to, _]| inside(*from, *to));
                range.map_or(*default, |[_, _, value]| *value)
            }
            Self::Chosen(choices, default) => {
                let mut found = choices.iter().filter(|([from, to], _)| inside(*from, *to));
                let choice = match (found.next(), found.next()) {
                    (Some((_, choice)), None) => choice,
                    _ => default,
                };
                return match choice {
                    Choice::Text(text) => Physical::Text(text.clone()),
                    Choice::Rule(rule) => rule.apply(x, integer),
                };
            }
            Self::Unknown => return Physical::Unknown,
        })
    }

    /// The number of a field; a rule that gives texts leaves the raw value.
    pub fn number(&self, x: f64, integer: bool) -> f64 {
        match self.apply(x, integer) {
            Physical::Number(number) => number,
            Physical::Text(_) | Physical::Unknown => x,
        }
    }
}

fn interpolated(pairs: &[[f64; 2]], x: f64) -> f64 {
    let above = pairs.partition_point(|[key, _]| *key <= x);
    let below = above.checked_sub(1).map(|below| pairs[below]);
    match (below, pairs.get(above)) {
        (Some([x0, y0]), Some([x1, y1])) => (y1 - y0) / (x1 - x0) * (x - x0) + y0,
        (Some([_, y]), None) | (None, Some(&[_, y])) => y,
        (None, None) => x,
    }
}

fn nearest(pairs: &[[f64; 2]], x: f64) -> f64 {
    let above = pairs.partition_point(|[key, _]| *key <= x);
    let below = above.checked_sub(1).map(|below| pairs[below]);
    match (below, pairs.get(above)) {
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
