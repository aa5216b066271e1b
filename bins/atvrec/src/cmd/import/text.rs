//! Text of an imported file, whatever its encoding and line ends.

use std::io::Read;
use std::path::Path;

use anyhow::Context;

use crate::exit::UsageError;

/// Largest text that is imported, bytes; an import keeps the text in memory.
const INPUT_MAX: u64 = 1 << 30;
/// Bytes at the beginning of a file from which UTF-16 without a byte order mark is recognised.
const LOOKED_AT: usize = 2000;
/// Beginnings of files that are no text, with what they are and what helps.
const NO_TEXT: [(&[u8], &str, &str); 6] = [
    (
        b"PK\x03\x04",
        "a spreadsheet or a ZIP archive",
        "save the table as CSV",
    ),
    (
        b"\xd0\xcf\x11\xe0",
        "a spreadsheet",
        "save the table as CSV",
    ),
    (b"\x1f\x8b", "a gzip file", "decompress it with gunzip"),
    (b"MDF     ", "an MDF file", "use `atvrec import mf4`"),
    (b"\xff\xfe\x00\x00", "UTF-32 text", "save it as UTF-8"),
    (b"\x00\x00\xfe\xff", "UTF-32 text", "save it as UTF-8"),
];

/// Reads a text file of at most [`INPUT_MAX`] bytes: UTF-8, UTF-16 or Latin-1. Lines end with a line
/// feed, with or without a carriage return before it.
///
/// # Errors
/// The file cannot be read, is too large or is no text.
pub fn read(path: &Path) -> anyhow::Result<String> {
    let mut bytes = Vec::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(INPUT_MAX + 1).read_to_end(&mut bytes))
        .with_context(|| format!("cannot read {}", path.display()))?;
    if bytes.len() as u64 > INPUT_MAX {
        return Err(UsageError(format!(
            "{} has more than {INPUT_MAX} bytes; split it into files of one drive each",
            path.display()
        ))
        .into());
    }
    decode(bytes).map_err(|text| UsageError(format!("{} {text}", path.display())).into())
}

fn decode(bytes: Vec<u8>) -> Result<String, String> {
    let kind = NO_TEXT.iter().find(|(begin, ..)| bytes.starts_with(begin));
    if let Some((_, what, help)) = kind {
        return Err(format!("is {what}, not delimited text; {help}"));
    }
    let text = match utf16_order(&bytes) {
        Some(from_bytes) => {
            let units = bytes
                .chunks_exact(2)
                .map(|pair| from_bytes([pair[0], pair[1]]));
            char::decode_utf16(units)
                .collect::<Result<String, _>>()
                .map_err(|error| format!("is not valid UTF-16 ({error}); save it as UTF-8"))?
        }
        // Files of other programs are often in Latin-1, in which each byte is a code point.
        None => String::from_utf8(bytes)
            .unwrap_or_else(|error| error.as_bytes().iter().map(|b| char::from(*b)).collect()),
    };
    // A byte order mark does not belong to the name of the first column. A file whose space was
    // reserved before it was written can end with null bytes.
    let text = text.trim_start_matches('\u{feff}').trim_end_matches('\0');
    Ok(with_line_feeds(text))
}

/// The byte order of UTF-16 text, from its mark or from the null bytes of Latin letters.
fn utf16_order(bytes: &[u8]) -> Option<fn([u8; 2]) -> u16> {
    match bytes {
        [0xff, 0xfe, ..] => return Some(u16::from_le_bytes),
        [0xfe, 0xff, ..] => return Some(u16::from_be_bytes),
        _ => {}
    }
    let begin = &bytes[..bytes.len().min(LOOKED_AT)];
    let mut nulls = [0; 2];
    for pair in begin.chunks_exact(2) {
        for (count, byte) in nulls.iter_mut().zip(pair) {
            *count += usize::from(*byte == 0);
        }
    }
    match nulls {
        [0, high] if high > begin.len() / 4 => Some(u16::from_le_bytes),
        [high, 0] if high > begin.len() / 4 => Some(u16::from_be_bytes),
        _ => None,
    }
}

/// The text with a line feed in place of each carriage return that ends a line alone.
fn with_line_feeds(text: &str) -> String {
    let mut characters = text.chars().peekable();
    let mut lines = String::with_capacity(text.len());
    while let Some(character) = characters.next() {
        let ends_alone = character == '\r' && !matches!(characters.peek(), Some('\r' | '\n'));
        lines.push(if ends_alone { '\n' } else { character });
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encodings_and_line_ends() {
        let text = "t,v°\n0,1\n";
        let utf16 = |order: fn(u16) -> [u8; 2], mark: bool| {
            let marked = text.encode_utf16();
            let mark = mark.then_some(0xfeff);
            mark.into_iter()
                .chain(marked)
                .flat_map(order)
                .collect::<Vec<u8>>()
        };
        let latin1: Vec<u8> = text.chars().map(|c| c as u8).collect();
        for bytes in [
            text.as_bytes().to_vec(),
            [b"\xef\xbb\xbf", text.as_bytes()].concat(),
            latin1,
            utf16(u16::to_le_bytes, true),
            utf16(u16::to_be_bytes, true),
            utf16(u16::to_le_bytes, false),
            utf16(u16::to_be_bytes, false),
            text.replace('\n', "\r").into_bytes(),
            [text.as_bytes(), &[0; 100]].concat(),
        ] {
            assert_eq!(decode(bytes.clone()).as_deref(), Ok(text), "{bytes:?}");
        }
        let windows = "t,v\r\n0,1\r\n";
        assert_eq!(decode(windows.into()).as_deref(), Ok(windows));
        let error = decode(b"PK\x03\x04rest".to_vec()).expect_err("a spreadsheet");
        assert!(error.contains("save the table as CSV"), "{error}");
    }
}
