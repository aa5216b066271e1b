//! Defects of a file, counted by kind: a large file with many defects needs no more memory than one
//! with a few.

use std::collections::BTreeMap;

/// Defects by kind.
#[derive(Debug, Default)]
pub(super) struct Defects(BTreeMap<String, (u64, u64)>);

impl Defects {
    /// Counts a defect at a place, bytes from the start of the file.
    pub fn note(&mut self, kind: impl Into<String>, place: u64) {
        self.0.entry(kind.into()).or_insert((0, place)).0 += 1;
    }

    /// One sentence for each kind.
    pub fn sentences(self) -> Vec<String> {
        let sentence = |(kind, (count, place)): (String, (u64, u64))| match count {
            1 => format!("{kind} (at byte {place})"),
            _ => format!("{kind} ({count} times, first at byte {place})"),
        };
        self.0.into_iter().map(sentence).collect()
    }
}
