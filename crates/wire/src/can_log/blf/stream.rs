//! The stream of objects, given in parts.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use super::PADDING;
use super::object::{Kind, decode};
use crate::can_log::bytes::{u16_at, u32_at};
use crate::can_log::defects::Defects;
use crate::can_log::{Record, Sink, position_of};

/// First bytes of an object.
pub(super) const SIGNATURE: &[u8; 4] = b"LOBJ";
/// Length of the first header of an object, bytes.
pub(super) const OBJECT_HEADER: usize = 16;
/// Bytes of a frame's object that a decoder needs: two headers of at most 40 bytes, 44 bytes of
/// fields and 64 bytes of data, and room for longer headers.
const FRAME_BYTES: usize = 256;
/// A larger size of a frame's object is wrong, bytes.
const FRAME_SIZE_MAX: usize = 64 * 1024;

/// Cuts the stream into objects and gives their frames to a sink. Holds at most the last part and
/// [`FRAME_BYTES`].
pub(super) struct Objects {
    buffer: Vec<u8>,
    /// Bytes of the present object that are still to come and are not needed.
    skip: u64,
    /// Bytes since the last object that belong to none.
    gap: u64,
    /// The bytes of the gap are already counted as a defect.
    gap_counted: bool,
    /// Place of the present container, bytes from the start of the file.
    pub file_position: u64,
    pub frames: u64,
    /// Numbers of the channels, in the order of their first frames.
    pub channels: Vec<u16>,
    pub left_out: BTreeMap<String, u64>,
    pub defects: Defects,
}

impl Objects {
    pub fn new(defects: Defects) -> Self {
        Self {
            buffer: Vec::new(),
            skip: 0,
            gap: 0,
            gap_counted: false,
            file_position: 0,
            frames: 0,
            channels: Vec::new(),
            left_out: BTreeMap::new(),
            defects,
        }
    }

    pub fn note(&mut self, kind: impl Into<String>, place: u64) {
        self.defects.note(kind, place);
    }

    pub fn leave_out(&mut self, kind: String) {
        *self.left_out.entry(kind).or_default() += 1;
    }

    /// Takes the next part of the stream.
    pub fn push(&mut self, part: &[u8], sink: &mut Sink<'_>) -> ControlFlow<()> {
        let mut buffer = std::mem::take(&mut self.buffer);
        buffer.extend_from_slice(part);
        let mut used = 0;
        while let Some(step) = self.step(&buffer[used..], sink)? {
            used += step;
        }
        buffer.drain(..used);
        self.buffer = buffer;
        ControlFlow::Continue(())
    }

    /// The stream goes on behind bytes that are lost: the present object is lost too.
    pub fn interrupt(&mut self) {
        if self.skip > 0 || self.buffer.starts_with(SIGNATURE) {
            let kind = match u32_at(&self.buffer, 12) {
                0 => String::from("an object is cut"),
                kind => format!("an object of type {kind} is cut"),
            };
            self.defects.note(kind, self.file_position);
        }
        self.buffer.clear();
        self.skip = 0;
        self.gap_counted = true;
    }

    /// The stream ends.
    pub fn end(&mut self) {
        self.gap += self.buffer.len() as u64;
        if self.skip > 0 || self.buffer.starts_with(SIGNATURE) {
            self.interrupt();
        } else if self.gap > PADDING && !self.gap_counted {
            self.count_gap();
        }
    }

    fn count_gap(&mut self) {
        let kind = "bytes between objects are no objects";
        self.defects.note(kind, self.file_position);
    }

    /// Takes an object or what is before the next. Returns the number of bytes; `None`: more bytes are
    /// needed.
    fn step(&mut self, bytes: &[u8], sink: &mut Sink<'_>) -> ControlFlow<(), Option<usize>> {
        if self.skip > 0 {
            let skipped = self.skip.min(bytes.len() as u64);
            self.skip -= skipped;
            return ControlFlow::Continue((skipped > 0).then_some(skipped as usize));
        }
        if !bytes.starts_with(SIGNATURE) {
            let mut windows = bytes.windows(SIGNATURE.len());
            let found = windows.position(|window| window == SIGNATURE);
            let len = found.unwrap_or((bytes.len() + 1).saturating_sub(SIGNATURE.len()));
            self.gap += len as u64;
            return ControlFlow::Continue((len > 0).then_some(len));
        }
        if bytes.len() < OBJECT_HEADER {
            return ControlFlow::Continue(None);
        }
        if self.gap > PADDING && !self.gap_counted {
            self.count_gap();
        }
        self.gap = 0;
        self.gap_counted = false;
        let header_len = usize::from(u16_at(bytes, 4));
        let size = u32_at(bytes, 8) as usize;
        let kind = Kind::of(u32_at(bytes, 12));
        let [needed, largest] = match kind {
            Kind::Other(_) => [OBJECT_HEADER, usize::MAX],
            _ => [FRAME_BYTES, FRAME_SIZE_MAX],
        };
        if header_len < OBJECT_HEADER || header_len > size || size > largest {
            let text = "the size of an object is impossible";
            self.defects.note(text, self.file_position);
            self.gap_counted = true;
            return ControlFlow::Continue(Some(SIGNATURE.len()));
        }
        let needed = size.min(needed);
        if bytes.len() < needed {
            return ControlFlow::Continue(None);
        }
        self.object(&bytes[..needed], kind, header_len, sink)?;
        self.skip = (size - needed) as u64;
        ControlFlow::Continue(Some(needed))
    }

    fn object(
        &mut self,
        bytes: &[u8],
        kind: Kind,
        header_len: usize,
        sink: &mut Sink<'_>,
    ) -> ControlFlow<()> {
        if let Kind::Other(number) = kind {
            self.leave_out(format!("objects of type {number}"));
            return ControlFlow::Continue(());
        }
        match decode(bytes, kind, header_len) {
            Some((channel, mut entry)) => {
                self.frames += 1;
                entry.channel = position_of(&mut self.channels, &channel);
                sink(Record::Frame(entry))
            }
            None => {
                let text = "an object of a frame is too short or has no valid stamp";
                self.defects.note(text, self.file_position);
                ControlFlow::Continue(())
            }
        }
    }
}
