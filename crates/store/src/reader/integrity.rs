//! Whether a closed file is, byte for byte, what was written.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::{Missing, Reader};
use crate::{Error, Result};

impl Reader {
    /// Compares the checksums of all closed files: of each chunk, of the data section and of the
    /// summary. Every byte stands under one of them. Files that were not closed have no checksum
    /// over the whole; what is wrong with them is in [`super::Info::missing`].
    ///
    /// # Errors
    /// If a file can no longer be read.
    pub fn changed(&self) -> Result<Vec<Missing>> {
        let mut changed = Vec::new();
        for file in &self.files {
            let path = &file.path;
            let unfinished = |missing: &Missing| matches!(missing, Missing::Unfinished { path: of } if of == path);
            if self.info().missing.iter().any(unfinished) {
                continue;
            }
            if let Some(text) = first_change(path).map_err(Error::file("read", path))? {
                changed.push(Missing::Changed {
                    path: path.clone(),
                    text,
                });
            }
        }
        Ok(changed)
    }
}

/// What the first wrong checksum says.
fn first_change(path: &Path) -> std::io::Result<Option<String>> {
    let mut file = File::open(path)?;
    let length = usize::try_from(file.metadata()?.len()).unwrap_or(usize::MAX);
    let options = LinearReaderOptions::default()
        .with_validate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true)
        .with_check_finishes_after_end_magic(true)
        .with_record_length_limit(length);
    let mut reader = LinearReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(length)) => {
                let read = file.read(reader.insert(length))?;
                reader.notify_read(read);
            }
            Ok(LinearReadEvent::Record { .. }) => {}
            Err(error) => return Ok(Some(error.to_string())),
        }
    }
    Ok(None)
}
