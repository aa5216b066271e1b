//! Numbers of text logs.

use crate::candump::nibble;

/// Words of a line between blanks.
pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> + Clone {
    line.split(u8::is_ascii_whitespace)
        .filter(|word| !word.is_empty())
}

/// A decimal number times ten to the power of `exponent`, rounded: seconds are nanoseconds with the
/// exponent 9. `None` if the text is no number or too large.
pub(super) fn decimal(text: &[u8], exponent: u32) -> Option<i64> {
    let (negative, digits) = match text {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        digits => (false, digits),
    };
    let (mut value, mut places, mut point) = (0_i64, 0, false);
    let mut seen = false;
    for digit in digits {
        match digit {
            b'0'..=b'9' => {
                seen = true;
                let number = i64::from(digit - b'0');
                if !point || places < exponent {
                    value = value.checked_mul(10)?.checked_add(number)?;
                    places += u32::from(point);
                } else if places == exponent {
                    value = value.checked_add(i64::from(number >= 5))?;
                    places += 1;
                }
            }
            b'.' if !point => point = true,
            _ => return None,
        }
    }
    let missing = exponent - places.min(exponent);
    let value = value.checked_mul(10_i64.checked_pow(missing)?)?;
    seen.then_some(if negative { -value } else { value })
}

/// A number without sign in base 10.
pub(super) fn unsigned(text: &[u8]) -> Option<u32> {
    number(text, 10)
}

/// A number without sign in base 16.
pub(super) fn hexadecimal(text: &[u8]) -> Option<u32> {
    number(text, 16)
}

/// A number without sign in a base up to 16.
pub(super) fn number(text: &[u8], base: u32) -> Option<u32> {
    let mut value = 0_u32;
    for digit in text {
        let digit = u32::from(nibble(*digit)?);
        (digit < base).then_some(())?;
        value = value.checked_mul(base)?.checked_add(digit)?;
    }
    (!text.is_empty()).then_some(value)
}

/// Number of bytes of a data length code (ISO 11898-1:2015, table 5).
pub(super) const fn length_of(code: u8, fd: bool) -> u8 {
    match (code, fd) {
        (0..=8, _) => code,
        (_, false) => 8,
        (9, _) => 12,
        (10, _) => 16,
        (11, _) => 20,
        (12, _) => 24,
        (13, _) => 32,
        (14, _) => 48,
        _ => 64,
    }
}

/// Data length code of a number of bytes: the smallest one with room for them.
pub(super) const fn code_of(length: u8) -> u8 {
    match length {
        0..=8 => length,
        9..=12 => 9,
        13..=16 => 10,
        17..=20 => 11,
        21..=24 => 12,
        25..=32 => 13,
        33..=48 => 14,
        _ => 15,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimal_numbers_are_exact() {
        assert_eq!(
            decimal(b"1672776524.573555", 9),
            Some(1_672_776_524_573_555_000)
        );
        assert_eq!(decimal(b"22186.6", 6), Some(22_186_600_000));
        assert_eq!(decimal(b"-0.5", 9), Some(-500_000_000));
        assert_eq!(decimal(b"1.23456789051", 9), Some(1_234_567_891));
        assert_eq!(decimal(b"17", 0), Some(17));
        for wrong in ["", ".", "-", "1.2.3", "1e3", "99999999999.0", "1 2"] {
            assert_eq!(decimal(wrong.as_bytes(), 9), None, "{wrong}");
        }
    }

    #[test]
    fn lengths_and_codes_agree() {
        for code in 0..=15 {
            assert_eq!(code_of(length_of(code, true)), code);
        }
        assert_eq!(length_of(11, false), 8);
    }
}
