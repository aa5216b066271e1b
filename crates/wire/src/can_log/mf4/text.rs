//! Texts and other values that are no number.

use std::fmt::Write;

use super::conversion::Physical;
use crate::can_log::bytes::{u32_at, u64_at};

/// Reads bytes by the data type of their channel: a text up to its first zero, a complex number as
/// `(1+2j)`, other bytes as hexadecimal digits.
pub(super) fn decode(data_type: u8, bytes: &[u8]) -> Physical {
    Physical::Text(match data_type {
        6 => to_zero(bytes)
            .iter()
            .map(|byte| char::from(*byte))
            .collect(),
        7 => String::from_utf8_lossy(to_zero(bytes)).into_owned(),
        8 => wide(bytes, u16::from_le_bytes),
        9 => wide(bytes, u16::from_be_bytes),
        15 | 16 => match complex(bytes, data_type == 16) {
            Some(text) => text,
            None => return Physical::Unknown,
        },
        _ => hexadecimal(bytes),
    })
}

fn to_zero(bytes: &[u8]) -> &[u8] {
    let end = bytes.iter().position(|byte| *byte == 0);
    &bytes[..end.unwrap_or(bytes.len())]
}

fn wide(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
    let units: Vec<u16> = units.take_while(|unit| *unit != 0).collect();
    String::from_utf16_lossy(&units)
}

fn complex(bytes: &[u8], big_endian: bool) -> Option<String> {
    let half = bytes.len() / 2;
    let part = |bytes: &[u8]| {
        let mut bytes = bytes.to_vec();
        if big_endian {
            bytes.reverse();
        }
        match bytes.len() {
            4 => Some(f64::from(f32::from_bits(u32_at(&bytes, 0)))),
            8 => Some(f64::from_bits(u64_at(&bytes, 0))),
            _ => None,
        }
    };
    let (real, imaginary) = (part(&bytes[..half])?, part(&bytes[half..])?);
    Some(format!("({real}{imaginary:+}j)"))
}

fn hexadecimal(bytes: &[u8]) -> String {
    let mut text = String::new();
    for byte in bytes {
        // Writing into a String cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    text
}
