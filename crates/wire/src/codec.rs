//! One walk over a message's fields serves all four directions: binary and ASCII, in and out.

use crate::text::Cells;

/// Names of an enumeration's values, as the ASCII form writes them.
pub(crate) type Names = &'static [(u32, &'static str)];

/// Septentrio's mark of a float that must not be used.
const DO_NOT_USE: f64 = -2e10;

/// Reads a message's fields into place, or writes them from there. `None` ends the walk: the
/// message is too short or a field is no number.
pub(crate) trait Codec {
    fn u8(&mut self, value: &mut u8) -> Option<()>;
    fn u16(&mut self, value: &mut u16) -> Option<()>;
    fn u32(&mut self, value: &mut u32) -> Option<()>;
    /// Written with `decimals` digits in the ASCII form.
    fn f32(&mut self, value: &mut f32, decimals: usize) -> Option<()>;
    /// Written with `decimals` digits in the ASCII form.
    fn f64(&mut self, value: &mut f64, decimals: usize) -> Option<()>;
    /// A byte that the ASCII form writes in hexadecimal.
    fn hex(&mut self, value: &mut u8) -> Option<()>;
    /// Four bytes that the ASCII form writes in hexadecimal.
    fn hex32(&mut self, value: &mut u32) -> Option<()>;
    /// Four bytes in binary, a name in ASCII. A name that is not in the list reads as `u32::MAX`.
    fn named(&mut self, value: &mut u32, names: Names) -> Option<()>;
    /// Four bytes in binary, one character in ASCII.
    fn letter(&mut self, value: &mut u32) -> Option<()>;
    /// Four characters in binary, quoted in ASCII.
    fn station(&mut self, value: &mut [u8; 4]) -> Option<()>;

    fn optional_f32(&mut self, value: &mut Option<f32>) -> Option<()> {
        let mut raw = value.unwrap_or(DO_NOT_USE as f32);
        self.f32(&mut raw, 6)?;
        *value = (raw != DO_NOT_USE as f32 && raw.is_finite()).then_some(raw);
        Some(())
    }

    fn optional_f64(&mut self, value: &mut Option<f64>) -> Option<()> {
        let mut raw = value.unwrap_or(DO_NOT_USE);
        self.f64(&mut raw, 6)?;
        *value = (raw != DO_NOT_USE && raw.is_finite()).then_some(raw);
        Some(())
    }

    fn optional_u8(&mut self, value: &mut Option<u8>) -> Option<()> {
        let mut raw = value.unwrap_or(u8::MAX);
        self.u8(&mut raw)?;
        *value = (raw != u8::MAX).then_some(raw);
        Some(())
    }

    fn optional_u16(&mut self, value: &mut Option<u16>) -> Option<()> {
        let mut raw = value.unwrap_or(u16::MAX);
        self.u16(&mut raw)?;
        *value = (raw != u16::MAX).then_some(raw);
        Some(())
    }

    fn optional_u32(&mut self, value: &mut Option<u32>) -> Option<()> {
        let mut raw = value.unwrap_or(u32::MAX);
        self.u32(&mut raw)?;
        *value = (raw != u32::MAX).then_some(raw);
        Some(())
    }
}

/// Little-endian fields, read.
pub(crate) struct BinaryReader<'a>(pub &'a [u8]);

impl BinaryReader<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*first)
    }
}

impl Codec for BinaryReader<'_> {
    fn u8(&mut self, value: &mut u8) -> Option<()> {
        [*value] = self.take()?;
        Some(())
    }

    fn u16(&mut self, value: &mut u16) -> Option<()> {
        *value = u16::from_le_bytes(self.take()?);
        Some(())
    }

    fn u32(&mut self, value: &mut u32) -> Option<()> {
        *value = u32::from_le_bytes(self.take()?);
        Some(())
    }

    fn f32(&mut self, value: &mut f32, _decimals: usize) -> Option<()> {
        *value = f32::from_le_bytes(self.take()?);
        Some(())
    }

    fn f64(&mut self, value: &mut f64, _decimals: usize) -> Option<()> {
        *value = f64::from_le_bytes(self.take()?);
        Some(())
    }

    fn hex(&mut self, value: &mut u8) -> Option<()> {
        self.u8(value)
    }

    fn hex32(&mut self, value: &mut u32) -> Option<()> {
        self.u32(value)
    }

    fn named(&mut self, value: &mut u32, _names: Names) -> Option<()> {
        self.u32(value)
    }

    fn letter(&mut self, value: &mut u32) -> Option<()> {
        self.u32(value)
    }

    fn station(&mut self, value: &mut [u8; 4]) -> Option<()> {
        *value = self.take()?;
        Some(())
    }
}

/// Little-endian fields, written.
pub(crate) struct BinaryWriter<'a>(pub &'a mut Vec<u8>);

impl BinaryWriter<'_> {
    fn put(&mut self, bytes: &[u8]) -> Option<()> {
        self.0.extend_from_slice(bytes);
        Some(())
    }
}

impl Codec for BinaryWriter<'_> {
    fn u8(&mut self, value: &mut u8) -> Option<()> {
        self.put(&[*value])
    }

    fn u16(&mut self, value: &mut u16) -> Option<()> {
        self.put(&value.to_le_bytes())
    }

    fn u32(&mut self, value: &mut u32) -> Option<()> {
        self.put(&value.to_le_bytes())
    }

    fn f32(&mut self, value: &mut f32, _decimals: usize) -> Option<()> {
        self.put(&value.to_le_bytes())
    }

    fn f64(&mut self, value: &mut f64, _decimals: usize) -> Option<()> {
        self.put(&value.to_le_bytes())
    }

    fn hex(&mut self, value: &mut u8) -> Option<()> {
        self.u8(value)
    }

    fn hex32(&mut self, value: &mut u32) -> Option<()> {
        self.u32(value)
    }

    fn named(&mut self, value: &mut u32, _names: Names) -> Option<()> {
        self.u32(value)
    }

    fn letter(&mut self, value: &mut u32) -> Option<()> {
        self.u32(value)
    }

    fn station(&mut self, value: &mut [u8; 4]) -> Option<()> {
        self.put(value)
    }
}

/// Comma-separated fields, read; a comma between quotes belongs to its field.
pub(crate) struct AsciiReader<'a>(Cells<'a>);

impl<'a> AsciiReader<'a> {
    pub fn new(text: &'a str) -> Self {
        Self(Cells::new(text, Some(',')))
    }

    pub fn text(&mut self) -> Option<&'a str> {
        self.0.next()
    }

    pub fn number<T: std::str::FromStr>(&mut self) -> Option<T> {
        self.text()?.parse().ok()
    }
}

impl Codec for AsciiReader<'_> {
    fn u8(&mut self, value: &mut u8) -> Option<()> {
        *value = self.number()?;
        Some(())
    }

    fn u16(&mut self, value: &mut u16) -> Option<()> {
        *value = self.number()?;
        Some(())
    }

    fn u32(&mut self, value: &mut u32) -> Option<()> {
        *value = self.number()?;
        Some(())
    }

    fn f32(&mut self, value: &mut f32, _decimals: usize) -> Option<()> {
        *value = self.number()?;
        Some(())
    }

    fn f64(&mut self, value: &mut f64, _decimals: usize) -> Option<()> {
        *value = self.number()?;
        Some(())
    }

    fn hex(&mut self, value: &mut u8) -> Option<()> {
        *value = u8::from_str_radix(self.text()?, 16).ok()?;
        Some(())
    }

    fn hex32(&mut self, value: &mut u32) -> Option<()> {
        *value = u32::from_str_radix(self.text()?, 16).ok()?;
        Some(())
    }

    fn named(&mut self, value: &mut u32, names: Names) -> Option<()> {
        let text = self.text()?;
        let known = names.iter().find(|(_, name)| *name == text);
        *value = known.map_or(u32::MAX, |(number, _)| *number);
        Some(())
    }

    fn letter(&mut self, value: &mut u32) -> Option<()> {
        *value = self.text()?.chars().next()?.into();
        Some(())
    }

    fn station(&mut self, value: &mut [u8; 4]) -> Option<()> {
        let text = self.text()?.trim_matches('"').as_bytes();
        *value = [0; 4];
        value[..text.len().min(4)].copy_from_slice(&text[..text.len().min(4)]);
        Some(())
    }
}

/// Comma-separated fields, written; each with a comma before it but the first.
pub(crate) struct AsciiWriter<'a> {
    pub out: &'a mut String,
    pub first: bool,
}

impl AsciiWriter<'_> {
    fn put(&mut self, text: std::fmt::Arguments<'_>) -> Option<()> {
        use std::fmt::Write;
        if !std::mem::take(&mut self.first) {
            self.out.push(',');
        }
        self.out.write_fmt(text).ok()
    }
}

impl Codec for AsciiWriter<'_> {
    fn u8(&mut self, value: &mut u8) -> Option<()> {
        self.put(format_args!("{value}"))
    }

    fn u16(&mut self, value: &mut u16) -> Option<()> {
        self.put(format_args!("{value}"))
    }

    fn u32(&mut self, value: &mut u32) -> Option<()> {
        self.put(format_args!("{value}"))
    }

    fn f32(&mut self, value: &mut f32, decimals: usize) -> Option<()> {
        self.put(format_args!("{value:.decimals$}"))
    }

    fn f64(&mut self, value: &mut f64, decimals: usize) -> Option<()> {
        self.put(format_args!("{value:.decimals$}"))
    }

    fn hex(&mut self, value: &mut u8) -> Option<()> {
        self.put(format_args!("{value:02x}"))
    }

    fn hex32(&mut self, value: &mut u32) -> Option<()> {
        self.put(format_args!("{value:08x}"))
    }

    fn named(&mut self, value: &mut u32, names: Names) -> Option<()> {
        match names.iter().find(|(number, _)| number == value) {
            Some((_, name)) => self.put(format_args!("{name}")),
            None => self.put(format_args!("{value}")),
        }
    }

    fn letter(&mut self, value: &mut u32) -> Option<()> {
        let letter = char::from_u32(*value).filter(char::is_ascii_alphanumeric);
        self.put(format_args!("{}", letter.unwrap_or('?')))
    }

    fn station(&mut self, value: &mut [u8; 4]) -> Option<()> {
        let text: String = value
            .iter()
            .take_while(|b| **b != 0)
            .map(|b| char::from(*b))
            .filter(char::is_ascii_alphanumeric)
            .collect();
        self.put(format_args!("\"{text}\""))
    }
}
