//! The files of a run as its parts.

use std::fs::Metadata;

use super::{LogFile, Missing};
use crate::session::RUN_METADATA;
use crate::{Error, Result};

/// Refuses a file that is given twice, also by a link.
pub(super) fn refuse_twice(files: &[LogFile]) -> Result<()> {
    let found: Vec<Option<Metadata>> = files.iter().map(|f| f.path.metadata().ok()).collect();
    for (second, metadata) in found.iter().enumerate() {
        let first = found[..second].iter().position(|earlier| {
            earlier
                .as_ref()
                .zip(metadata.as_ref())
                .is_some_and(|(a, b)| is_same(a, b))
        });
        if let Some(first) = first {
            return Err(Error::SameFile {
                first: files[first].path.clone(),
                second: files[second].path.clone(),
            });
        }
    }
    Ok(())
}

#[cfg(unix)]
fn is_same(a: &Metadata, b: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

#[cfg(not(unix))]
fn is_same(_: &Metadata, _: &Metadata) -> bool {
    false
}

/// Number of a file in its run.
pub(super) fn number(file: &LogFile) -> Option<u32> {
    file.index
        .metadata
        .get(RUN_METADATA)?
        .get("part")?
        .parse()
        .ok()
}

/// Parts that are missing before the last one that is there. `numbers` rise.
pub(super) fn missing(numbers: impl IntoIterator<Item = u32>) -> Vec<Missing> {
    let (mut next, mut missing) = (0, Vec::new());
    for number in numbers {
        if number > next {
            missing.push(Missing::Parts {
                first: next,
                last: number - 1,
            });
        }
        next = number.saturating_add(1).max(next);
    }
    missing
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holes_are_found_and_named_in_few_words() {
        let text = |numbers: &[u32]| -> Vec<String> {
            let missing = missing(numbers.iter().copied());
            missing.iter().map(ToString::to_string).collect()
        };
        assert!(text(&[0, 1, 2]).is_empty());
        assert_eq!(text(&[0, 2]), ["part 1 is missing"]);
        assert_eq!(text(&[1]), ["part 0 is missing"]);
        assert_eq!(
            text(&[2, 2, u32::MAX]),
            [
                "parts 0 to 1 are missing",
                "parts 3 to 4294967294 are missing"
            ]
        );
    }
}
