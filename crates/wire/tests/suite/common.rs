//! What the decoders' tests share: reference data, noise and cuts.

use proptest::prelude::*;

/// A reference file's bytes; `None` if it is missing.
pub fn read(name: &str) -> Option<Vec<u8>> {
    let path = testkit::shared(&format!("data/{name}"))?;
    Some(std::fs::read(path).expect("readable"))
}

/// A reference file's text.
pub fn read_text(name: &str) -> Option<String> {
    read(name).map(|bytes| String::from_utf8(bytes).expect("reference text is UTF-8"))
}

/// A file of one JSON value a line.
pub fn read_json_lines(name: &str) -> Option<Vec<serde_json::Value>> {
    let text = read_text(name)?;
    Some(
        text.lines()
            .filter(|line| !line.trim().is_empty())
            .map(|line| serde_json::from_str(line).expect("a line is one JSON value"))
            .collect(),
    )
}

/// Noise that contains pieces of `header` more often than chance would have it.
pub fn noise(header: &'static [u8]) -> impl Strategy<Value = Vec<u8>> {
    let piece = prop_oneof![
        prop::collection::vec(any::<u8>(), 0..20),
        (1..=header.len()).prop_map(move |n| header[..n].to_vec()),
    ];
    prop::collection::vec(piece, 0..4).prop_map(|pieces| pieces.concat())
}

/// The bytes in pieces of the given sizes, over and over.
pub fn cut<'a>(bytes: &'a [u8], sizes: &'a [usize]) -> impl Iterator<Item = &'a [u8]> {
    let mut rest = bytes;
    let mut sizes = sizes.iter().cycle();
    std::iter::from_fn(move || {
        let size = (*sizes.next()?).min(rest.len());
        if size == 0 {
            return None;
        }
        let (first, tail) = rest.split_at(size);
        rest = tail;
        Some(first)
    })
}
