//! Channels: where a value is in a record.

use std::io::{Read, Seek};
use std::sync::Arc;

use super::block::{Block, File};
use super::conversion::{Conversion, Physical};
use super::text;
use crate::can_log::Error;
use crate::can_log::bytes::{u8_at, u32_at};

/// Kind of a channel (`cn_type`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A value in the record.
    Fixed,
    /// An offset in the record, to a value of its own length.
    VariableLength,
    /// The master of the group.
    Master,
    /// The number of the record, as value or as master.
    Virtual,
    VirtualMaster,
    Other,
}

/// One channel.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    pub name: String,
    /// Name of the channel that this one is a part of.
    pub parent: Option<String>,
    pub kind: Kind,
    /// The master counts time.
    pub is_time: bool,
    data_type: u8,
    bit_offset: u32,
    byte_offset: u32,
    pub bit_count: u32,
    invalid_bit: Option<u32>,
    all_invalid: bool,
    /// Block with the values of their own length.
    pub data: u64,
    pub conversion: Arc<Conversion>,
    pub unit: Option<String>,
    /// Other channels are parts or elements of this one.
    pub has_parts: bool,
}

/// A raw value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Raw<'a> {
    Unsigned(u64),
    Signed(i64),
    Float(f64),
    Bytes(&'a [u8]),
}

/// A record, without the number of its group.
#[derive(Clone, Copy, Debug)]
pub(super) struct Record<'a> {
    pub bytes: &'a [u8],
    /// Start of the invalidation bits, bytes.
    pub invalidation: usize,
    /// Number of the record in its group.
    pub index: u64,
}

impl Channel {
    pub fn read<R: Read + Seek>(
        file: &mut File<'_, R>,
        block: &Block,
        parent: Option<&str>,
    ) -> Result<Self, Error> {
        let data = &block.data;
        let flags = u32_at(data, 12);
        let mut unit = file.text(block.link(6))?;
        if unit.is_none() && block.link(4) != 0 {
            let conversion = file.block(block.link(4), *b"CC")?;
            unit = file.text(conversion.map_or(0, |conversion| conversion.link(1)))?;
        }
        Ok(Self {
            name: file.text(block.link(2))?.unwrap_or_default(),
            parent: parent.map(str::to_owned),
            kind: match u8_at(data, 0) {
                0 => Kind::Fixed,
                1 => Kind::VariableLength,
                2 => Kind::Master,
                3 => Kind::VirtualMaster,
                // A value of at most a stated length; another channel has its length.
                5 => Kind::Fixed,
                6 => Kind::Virtual,
                _ => Kind::Other,
            },
            is_time: u8_at(data, 1) == 1,
            data_type: u8_at(data, 2),
            bit_offset: u32::from(u8_at(data, 3)),
            byte_offset: u32_at(data, 4),
            bit_count: u32_at(data, 8),
            all_invalid: flags & 1 != 0,
            invalid_bit: (flags & 2 != 0).then(|| u32_at(data, 16)),
            data: block.link(5),
            conversion: Arc::new(Conversion::read(file, block.link(4))?),
            unit: unit
                .map(|unit| unit.trim().to_owned())
                .filter(|unit| !unit.is_empty()),
            has_parts: false,
        })
    }

    /// An element of an array: the channel at other bytes and with an index in its name.
    pub fn element(&self, index: &str, bytes: u32) -> Self {
        Self {
            name: format!("{}{index}", self.name),
            parent: Some(self.name.clone()),
            byte_offset: self.byte_offset.saturating_add(bytes),
            has_parts: false,
            ..self.clone()
        }
    }

    /// Whether the channel is the axis of its group.
    pub const fn is_master(&self) -> bool {
        matches!(self.kind, Kind::Master | Kind::VirtualMaster)
    }

    /// Whether the record's value is valid.
    pub fn is_valid(&self, record: Record<'_>) -> bool {
        let marked = self.invalid_bit.is_some_and(|bit| {
            let byte = record.invalidation + (bit / 8) as usize;
            u8_at(record.bytes, byte) & 1 << (bit % 8) != 0
        });
        !marked && !self.all_invalid
    }

    /// The raw value. `None`: the record is too short, or the type is not one of a value.
    pub fn raw<'a>(&self, record: Record<'a>) -> Option<Raw<'a>> {
        if matches!(self.kind, Kind::Virtual | Kind::VirtualMaster) {
            return Some(Raw::Unsigned(record.index));
        }
        let start = self.byte_offset as usize;
        let bits = u64::from(self.bit_offset) + u64::from(self.bit_count);
        let len = usize::try_from(bits.div_ceil(8)).ok()?;
        let bytes = record.bytes.get(start..start.checked_add(len)?)?;
        let big_endian = matches!(self.data_type, 1 | 3 | 5);
        match self.data_type {
            _ if self.kind == Kind::VariableLength => {
                Some(Raw::Unsigned(self.number(bytes, false)?))
            }
            0 | 1 => Some(Raw::Unsigned(self.number(bytes, big_endian)?)),
            2 | 3 => {
                let unused = 64 - self.bit_count.clamp(1, 64);
                let number = self.number(bytes, big_endian)?;
                Some(Raw::Signed((number << unused) as i64 >> unused))
            }
            4 | 5 => {
                let number = self.number(bytes, big_endian)?;
                match self.bit_count {
                    32 => Some(Raw::Float(f64::from(f32::from_bits(number as u32)))),
                    64 => Some(Raw::Float(f64::from_bits(number))),
                    _ => None,
                }
            }
            _ => Some(Raw::Bytes(bytes)),
        }
    }

    fn number(&self, bytes: &[u8], big_endian: bool) -> Option<u64> {
        if bytes.len() > 9 || self.bit_count > 64 {
            return None;
        }
        let push = |number: u128, byte: &u8| number << 8 | u128::from(*byte);
        let number = if big_endian {
            bytes.iter().fold(0, push)
        } else {
            bytes.iter().rev().fold(0, push)
        };
        let mask = (1_u128 << self.bit_count) - 1;
        Some((number >> self.bit_offset & mask) as u64)
    }

    /// The physical value as a number; `None` if it has none.
    pub fn value(&self, record: Record<'_>) -> Option<f64> {
        match self.raw(record)? {
            Raw::Unsigned(raw) => Some(self.conversion.number(raw as f64, true)),
            Raw::Signed(raw) => Some(self.conversion.number(raw as f64, true)),
            Raw::Float(raw) => Some(self.conversion.number(raw, false)),
            Raw::Bytes(_) => None,
        }
    }

    /// The physical value of a raw one.
    pub fn physical(&self, raw: Raw<'_>) -> Physical {
        match raw {
            Raw::Unsigned(raw) => self.conversion.apply(raw as f64, true),
            Raw::Signed(raw) => self.conversion.apply(raw as f64, true),
            Raw::Float(raw) => self.conversion.apply(raw, false),
            Raw::Bytes(bytes) => text::decode(self.data_type, bytes),
        }
    }

    /// The value as a time, ns; exact where the record counts whole nanoseconds.
    pub fn time_ns(&self, record: Record<'_>) -> Option<i64> {
        let seconds = self.value(record)?;
        let count = match self.raw(record)? {
            Raw::Unsigned(count) => i64::try_from(count).ok(),
            Raw::Signed(count) => Some(count),
            Raw::Float(_) | Raw::Bytes(_) => None,
        };
        if let (Conversion::Linear { offset, factor }, Some(count)) = (&*self.conversion, count) {
            let unit_ns = (factor * 1e9).round();
            let whole = (factor * 1e9 - unit_ns).abs() < 1e-9 * unit_ns;
            if *offset == 0.0 && whole && unit_ns <= 1e12 {
                return count.checked_mul(unit_ns as i64);
            }
        }
        let ns = (seconds * 1e9).round();
        // The limit is the range of a 64-bit integer.
        (ns.abs() < 9.2e18).then_some(ns as i64)
    }
}
