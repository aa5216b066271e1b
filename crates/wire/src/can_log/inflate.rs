//! Data compressed by zlib, inflated part by part.

use miniz_oxide::inflate::stream::{InflateState, inflate};
use miniz_oxide::{DataFormat, MZError, MZFlush, MZStatus};

/// Longest input of one call of [`Inflate::push`], bytes. Deflate makes at most 1032 bytes of one
/// (RFC 1951: 258 bytes of two bits), so that a call gives at most 8.3 MiB.
pub(super) const PART: usize = 8 * 1024;

/// What a part of the data has led to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Progress {
    /// The data goes on.
    More,
    /// The data is complete; the number of bytes of the part that belonged to it.
    End(usize),
    /// The data is not zlib data from here on, or its checksum is wrong.
    Damaged,
}

/// One zlib stream.
pub(super) struct Inflate(Box<InflateState>);

impl Inflate {
    pub fn new() -> Self {
        Self(InflateState::new_boxed(DataFormat::Zlib))
    }

    /// Inflates a part and appends what comes out to `output`.
    pub fn push(&mut self, part: &[u8], output: &mut Vec<u8>) -> Progress {
        let mut window = [0; 16 * 1024];
        let mut consumed = 0;
        loop {
            let result = inflate(&mut self.0, &part[consumed..], &mut window, MZFlush::None);
            consumed += result.bytes_consumed;
            output.extend_from_slice(&window[..result.bytes_written]);
            match result.status {
                Ok(MZStatus::StreamEnd) => return Progress::End(consumed),
                Ok(_) if result.bytes_written > 0 || result.bytes_consumed > 0 => {}
                Ok(_) | Err(MZError::Buf) => return Progress::More,
                Err(_) => return Progress::Damaged,
            }
        }
    }
}
