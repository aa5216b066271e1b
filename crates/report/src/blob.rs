//! Numbers of the figures as bytes that the page decodes.
//!
//! A series is rounded to steps, and each number is stored as the difference to the one before it: a
//! zigzag number plus one in groups of seven bits, zero for a number that is not finite. Times are
//! microseconds, stored as differences of differences. All bytes are deflated and in base 64.

use std::collections::HashMap;
use std::fmt;
use std::hash::{DefaultHasher, Hash, Hasher};

use base64::display::Base64Display;
use base64::engine::general_purpose::STANDARD;
use miniz_oxide::deflate::core::{
    CompressorOxide, TDEFLFlush, compress_to_output, create_comp_flags_from_zip_params,
};
use serde_json::{Value, json};

/// Steps between the least and the greatest value of a series, in a short and in a long drive.
const STEPS_FINE: f64 = 65_535.0;
const STEPS_COARSE: f64 = 4_095.0;
/// The same of envelopes, and of the bands of long drives: a figure has fewer pixels.
const STEPS_ENVELOPE: f64 = 1_023.0;
/// Level of the compressor.
const LEVEL: i32 = 6;

/// Position of a series.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Id(usize);

impl Id {
    /// For the page.
    pub fn json(self) -> Value {
        json!(self.0)
    }
}

/// All series.
#[derive(Default)]
pub struct Blob {
    packer: Packer,
    heads: Vec<Value>,
    known: HashMap<u64, Id>,
    /// The drive is long: the steps are coarse.
    pub is_long: bool,
}

impl Blob {
    /// Adds numbers; `None` without a finite one.
    pub fn add(&mut self, values: &[f32]) -> Option<Id> {
        self.add_in_steps(
            values,
            if self.is_long {
                STEPS_COARSE
            } else {
                STEPS_FINE
            },
        )
    }

    /// Adds standard deviations; `None` without a finite one.
    pub fn add_sigma(&mut self, values: &[f32]) -> Option<Id> {
        if self.is_long {
            self.add_envelope(values)
        } else {
            self.add(values)
        }
    }

    /// Adds one side of an envelope; `None` without a finite value.
    pub fn add_envelope(&mut self, values: &[f32]) -> Option<Id> {
        self.add_in_steps(values, STEPS_ENVELOPE)
    }

    fn add_in_steps(&mut self, values: &[f32], steps: f64) -> Option<Id> {
        let finite = || values.iter().filter(|value| value.is_finite());
        let least = finite().copied().min_by(f32::total_cmp)?;
        let greatest = finite().copied().max_by(f32::total_cmp)?;
        let key = key(0, values.iter().map(|value| u64::from(value.to_bits())));
        if let Some(known) = self.known.get(&key) {
            return Some(*known);
        }
        let (least, span) = (f64::from(least), f64::from(greatest) - f64::from(least));
        let step = if span > 0.0 { span / steps } else { 1.0 };
        let offset = self.packer.taken;
        let mut before = 0;
        for value in values {
            if !value.is_finite() {
                self.packer.push(0);
                continue;
            }
            let rounded = ((f64::from(*value) - least) / step).round() as i64;
            self.packer.push(zigzag(rounded - before) + 1);
            before = rounded;
        }
        let head = json!({"o": offset, "n": values.len(), "l": least, "s": step});
        Some(self.insert(key, head))
    }

    /// Adds times in s, which rise.
    pub fn add_times(&mut self, times: &[f64]) -> Id {
        let key = key(1, times.iter().map(|time| time.to_bits()));
        if let Some(known) = self.known.get(&key) {
            return *known;
        }
        let offset = self.packer.taken;
        let (mut before, mut step) = (0, 0);
        for time in times {
            let micros = (time * 1e6).round() as i64;
            self.packer.push(zigzag(micros - before - step));
            step = micros - before;
            before = micros;
        }
        let head = json!({"o": offset, "n": times.len(), "t": 1});
        self.insert(key, head)
    }

    fn insert(&mut self, key: u64, head: Value) -> Id {
        let id = Id(self.heads.len());
        self.heads.push(head);
        self.known.insert(key, id);
        id
    }

    /// Heads of all series, for the page.
    pub fn heads(&mut self) -> Value {
        Value::Array(std::mem::take(&mut self.heads))
    }

    /// All bytes, deflated.
    pub fn packed(self) -> Packed {
        self.packer.finish()
    }
}

/// Deflated bytes in parts, shown in base 64.
#[derive(Clone, Debug, Default)]
pub struct Packed(Vec<Vec<u8>>);

/// Bytes of a part: a multiple of three, so that no part but the last ends with padding. Small parts use the
/// memory of samples that were freed.
const PART: usize = 3 << 14;

impl Packed {
    fn extend(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            if self.0.last().is_none_or(|last| last.len() == PART) {
                self.0.push(Vec::with_capacity(PART));
            }
            let Some(last) = self.0.last_mut() else {
                return;
            };
            let (now, later) = bytes.split_at(bytes.len().min(PART - last.len()));
            last.extend_from_slice(now);
            bytes = later;
        }
    }
}

impl fmt::Display for Packed {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = self.0.iter();
        parts.try_for_each(|part| Base64Display::new(part, &STANDARD).fmt(out))
    }
}

/// Bytes that are taken before the compressor gets them.
const TOGETHER: usize = 1 << 16;

/// Deflates numbers as they come: all series of an hour have tens of megabytes before.
struct Packer {
    compressor: Box<CompressorOxide>,
    waiting: Vec<u8>,
    packed: Packed,
    /// Bytes so far.
    taken: usize,
}

impl Default for Packer {
    fn default() -> Self {
        // A raw stream, with the compressor's own strategy.
        let flags = create_comp_flags_from_zip_params(LEVEL, 0, 0);
        Self {
            compressor: Box::new(CompressorOxide::new(flags)),
            waiting: Vec::new(),
            packed: Packed::default(),
            taken: 0,
        }
    }
}

impl Packer {
    fn push(&mut self, number: u64) {
        let before = self.waiting.len();
        varint(&mut self.waiting, number);
        self.taken += self.waiting.len() - before;
        if self.waiting.len() >= TOGETHER {
            self.pack(TDEFLFlush::None);
        }
    }

    fn pack(&mut self, flush: TDEFLFlush) {
        // The compressor takes all bytes, because the sink takes all that it gives.
        compress_to_output(&mut self.compressor, &self.waiting, flush, |bytes| {
            self.packed.extend(bytes);
            true
        });
        self.waiting.clear();
    }

    fn finish(mut self) -> Packed {
        self.pack(TDEFLFlush::Finish);
        self.packed
    }
}

fn key(kind: u64, values: impl Iterator<Item = u64>) -> u64 {
    let mut hasher = DefaultHasher::new();
    kind.hash(&mut hasher);
    for value in values {
        value.hash(&mut hasher);
    }
    hasher.finish()
}

const fn zigzag(value: i64) -> u64 {
    ((value << 1) ^ (value >> 63)).cast_unsigned()
}

fn varint(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        bytes.push((value & 0x7f) as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

#[cfg(test)]
mod tests {
    use base64::Engine;

    use super::*;

    /// Reads a series back as the page does.
    fn read(bytes: &[u8], head: &Value) -> Vec<f64> {
        let number = |name: &str| head[name].as_f64().unwrap();
        let mut at = number("o") as usize;
        let mut next = || {
            let (mut value, mut shift) = (0_u64, 0);
            loop {
                let byte = bytes[at];
                at += 1;
                value |= u64::from(byte & 0x7f) << shift;
                shift += 7;
                if byte < 0x80 {
                    return value;
                }
            }
        };
        let signed = |code: u64| (code >> 1).cast_signed() ^ -(code & 1).cast_signed();
        let (mut sum, mut step) = (0, 0);
        let is_time = head.get("t").is_some();
        let count = number("n") as usize;
        let value = |_| {
            let code = next();
            if is_time {
                step += signed(code);
                sum += step;
                return sum as f64 * 1e-6;
            }
            if code == 0 {
                return f64::NAN;
            }
            sum += signed(code - 1);
            number("l") + sum as f64 * number("s")
        };
        (0..count).map(value).collect()
    }

    #[test]
    fn all_of_a_long_series_comes_back() {
        // Nearly random, so that the packed bytes are many.
        let value = |k: u64| ((k.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) % 7919) as f32;
        let values: Vec<f32> = (0..300_000).map(value).collect();
        let mut blob = Blob::default();
        let id = blob.add(&values).unwrap();
        let heads = blob.heads.clone();
        let packed = blob.packed();
        assert!(packed.0.len() > 1, "several parts");
        // The page decodes all parts together.
        let packed = STANDARD.decode(packed.to_string()).expect("base 64");
        let bytes = miniz_oxide::inflate::decompress_to_vec(&packed).expect("a stream");
        let found = read(&bytes, &heads[id.0]);
        assert_eq!(found.len(), values.len());
        let near = |(found, value): (&f64, &f32)| (found - f64::from(*value)).abs() < 0.1;
        assert!(found.iter().zip(&values).all(near));
    }

    #[test]
    fn series_come_back_within_half_a_step() {
        let values = [1.0, f32::NAN, -3.5, 250.25, 250.25];
        let times = [0.0, 0.01, 0.02, 0.029_999, 86_400.0];
        let mut blob = Blob::default();
        let first = blob.add(&values).unwrap();
        let time = blob.add_times(&times);
        assert_eq!(
            blob.add(&values),
            Some(first),
            "equal series are stored once"
        );
        assert_eq!(blob.add(&[f32::NAN]), None);
        let packed = blob.packer.finish().0.concat();
        let bytes = miniz_oxide::inflate::decompress_to_vec(&packed).expect("a stream");
        let found = read(&bytes, &blob.heads[first.0]);
        for (found, value) in found.iter().zip(values) {
            let same = found.is_nan() && value.is_nan();
            assert!(same || (found - f64::from(value)).abs() < 253.75 / 65_535.0);
        }
        let found = read(&bytes, &blob.heads[time.0]);
        assert!(found.iter().zip(times).all(|(a, b)| (a - b).abs() < 1e-6));
    }

    #[test]
    fn bands_of_a_long_drive_are_coarser_than_their_curves() {
        let values = [0.0, 4.0];
        let step = |is_long: bool, add: fn(&mut Blob, &[f32]) -> Option<Id>| {
            let mut blob = Blob {
                is_long,
                ..Blob::default()
            };
            let id = add(&mut blob, &values).unwrap();
            blob.heads[id.0]["s"].as_f64().unwrap()
        };
        assert_eq!(step(false, Blob::add_sigma), step(false, Blob::add));
        assert!(step(true, Blob::add_sigma) > 3.0 * step(true, Blob::add));
    }
}
