//! Delta-coded columns of the raw messages.

use crate::error::MessageError;

/// Differences between neighbours; the first value stands against `first`.
pub(crate) fn deltas(first: i64, values: impl Iterator<Item = i64>) -> Vec<i64> {
    let mut before = first;
    values
        .map(|value| value.wrapping_sub(std::mem::replace(&mut before, value)))
        .collect()
}

/// The inverse of [`deltas`].
pub(crate) fn sums(first: i64, deltas: &[i64]) -> impl Iterator<Item = i64> {
    deltas.iter().scan(first, |value, delta| {
        *value = value.wrapping_add(*delta);
        Some(*value)
    })
}

/// One bit each, first in the lowest bit of the first byte.
pub(crate) fn bits(flags: impl Iterator<Item = bool>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (index, flag) in flags.enumerate() {
        if index % 8 == 0 {
            bytes.push(0);
        }
        if let Some(last) = bytes.last_mut() {
            *last |= u8::from(flag) << (index % 8);
        }
    }
    bytes
}

/// Bit `index` of [`bits`]; a missing byte reads as zeros.
pub(crate) fn bit(bytes: &[u8], index: usize) -> bool {
    bytes
        .get(index / 8)
        .is_some_and(|byte| byte >> (index % 8) & 1 == 1)
}

/// Checks that a column has as many entries as the columns beside it.
pub(crate) fn expect_len(
    column: &'static str,
    expected: usize,
    found: usize,
) -> Result<(), MessageError> {
    if expected == found {
        return Ok(());
    }
    Err(MessageError::Column {
        column,
        expected,
        found,
    })
}
