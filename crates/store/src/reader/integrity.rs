//! Check that a file is unchanged.

use super::{Index, Missing, Reader, ScanOptions};
use crate::Result;

impl Reader {
    /// Reads through the files that were opened by their summary alone, and compares all checksums: of
    /// each chunk, of the attachments, of the data section and of the summary. They cover every byte of a
    /// closed file. Errors of other files are in [`super::Info::missing`].
    ///
    /// # Errors
    /// If a file can no longer be read.
    pub fn changed(&self) -> Result<Vec<Missing>> {
        let mut changed = Vec::new();
        for file in &self.files {
            if file.index.ending.is_none() {
                let found = Index::scan(&file.path, &ScanOptions::default())?;
                changed.extend(found.missing);
            }
        }
        Ok(changed)
    }
}
