//! Check that a file is unchanged.

use std::path::Path;

use mcap::records::op;

use super::{Index, Missing, Reader, ScanOptions};
use crate::scan::{self, MAGIC, Scanner};
use crate::{Error, Result};

/// Bytes whose checksum is computed together.
const BLOCK: u64 = 1 << 20;
/// Bytes of the checksum in the record at the end of the data section.
const CHECKSUM: u64 = 4;
/// A checksum that the writer omitted.
const NONE: &[u8] = &[0; CHECKSUM as usize];

impl Reader {
    /// Reads through the files that were opened by their summary alone, and compares their checksums. The
    /// checksums of the data section and of the summary cover every byte of a closed file. If one of the two is
    /// wrong or absent, the checksums of each chunk and of the attachments tell what is damaged.
    ///
    /// # Errors
    /// If a file can no longer be read.
    pub fn changed(&self) -> Result<Vec<Missing>> {
        let mut changed = Vec::new();
        for file in &self.files {
            if file.index.ending.is_none() && !is_confirmed(&file.path)? {
                let found = Index::scan(&file.path, &ScanOptions::default())?;
                changed.extend(found.missing);
            }
        }
        Ok(changed)
    }
}

/// Whether the checksums of the data section and of the summary confirm a file.
fn is_confirmed(path: &Path) -> Result<bool> {
    let mut scanner = Scanner::open(path)?;
    let mut confirm = || {
        let Some((summary_start, _)) = scan::summary(&mut scanner, scan::max_chunk())? else {
            return Ok(false);
        };
        let end = summary_start.saturating_sub(scan::PREFIX + CHECKSUM);
        let record = scanner.read_at(end, scan::PREFIX + CHECKSUM)?;
        let Some((op::DATA_END, stated, _)) = scan::split_record(&record) else {
            return Ok(false);
        };
        let (mut checksum, mut block) = (crc32fast::Hasher::new(), Vec::new());
        for offset in (0..end).step_by(BLOCK as usize) {
            scanner.read_into(offset, BLOCK.min(end - offset), &mut block)?;
            checksum.update(&block);
        }
        let of_summary = scanner
            .length()
            .saturating_sub(MAGIC.len() as u64 + CHECKSUM);
        let of_summary = scanner.read_at(of_summary, CHECKSUM)?;
        // Zero states no checksum.
        let are_stated = [stated, &of_summary].iter().all(|sum| *sum != NONE);
        Ok(are_stated && checksum.finalize().to_le_bytes() == stated)
    };
    confirm().map_err(Error::file("read", path))
}
