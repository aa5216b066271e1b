//! Frames of a CAN bus, by kind and column.

use sample::{Arrival, CanFlags, CanFrame, FrameData, Payload, SourceId};

use super::Packing;
use super::kinds::Kinds;
use crate::column::{self, bit, bits, deltas, expect_len, sums};
use crate::error::MessageError;
use crate::proto::atvrec as pb;

/// zstd level of the frames' data: higher levels do not compress better.
const DATA_LEVEL: i32 = 1;

/// Encodes the batches of buses and keeps its compressor and kinds between them.
pub(super) struct Packer {
    packing: Packing,
    zstd: Option<zstd::bulk::Compressor<'static>>,
    kinds: Kinds,
}

impl Packer {
    pub(super) fn new(packing: Packing) -> Self {
        Self {
            packing,
            zstd: None,
            kinds: Kinds::default(),
        }
    }

    /// The batch of a bus.
    pub(super) fn encode(
        &mut self,
        stamps: pb::ArrivalStamps,
        arrivals: &[&Arrival],
    ) -> pb::RawCan {
        let mut message = pb::RawCan {
            frames: Vec::with_capacity(arrivals.len()),
            ..pb::RawCan::default()
        };
        let mut frames: Vec<(&CanFrame, i64)> = Vec::with_capacity(arrivals.len());
        for arrival in arrivals {
            if let Payload::Can(list) = &arrival.payload {
                message.frames.push(list.len() as u32);
                frames.extend(list.iter().map(|frame| (frame, arrival.realtime_ns)));
            }
        }
        if message.frames.iter().all(|count| *count == 1) {
            message.frames.clear();
        }
        self.kinds.begin();
        message.kind = frames
            .iter()
            .map(|(frame, _)| self.kinds.of(frame))
            .collect();
        let kinds = || self.kinds.in_batch();
        message.kind_id = kinds().map(|kind| kind.0).collect();
        message.kind_flags = kinds().map(|kind| kind.1).collect();
        message.kind_length = kinds().map(|kind| kind.2).collect();
        if kinds().any(|kind| kind.3 != 0) {
            message.kind_len8_dlc = kinds().map(|kind| kind.3).collect();
        }
        add_stamps(&mut message, &frames);
        message.data_zstd = self.pack(&transpose(&message, &frames));
        message.stamps = Some(stamps);
        message
    }

    fn pack(&mut self, data: &[u8]) -> Vec<u8> {
        if self.packing == Packing::Fast {
            return stored(data);
        }
        if self.zstd.is_none() {
            self.zstd = zstd::bulk::Compressor::new(DATA_LEVEL).ok();
        }
        // Compression into memory cannot fail. The reader would report an empty field.
        let packed = self.zstd.as_mut().map(|zstd| zstd.compress(data));
        packed.and_then(Result::ok).unwrap_or_default()
    }
}

/// A zstd frame with uncompressed data (RFC 8878, sections 3.1.1.1 and 3.1.1.2).
fn stored(data: &[u8]) -> Vec<u8> {
    const MAGIC: [u8; 4] = 0xFD2F_B528_u32.to_le_bytes();
    /// One segment with a length of 8 bytes; no checksum, no dictionary.
    const DESCRIPTOR: u8 = 0b1110_0000;
    const BLOCK_MAX: usize = 1 << 17;
    let mut frame = Vec::with_capacity(data.len() + 32);
    frame.extend(MAGIC);
    frame.push(DESCRIPTOR);
    frame.extend((data.len() as u64).to_le_bytes());
    let last = data.len().div_ceil(BLOCK_MAX).max(1) - 1;
    for block in 0..=last {
        let start = block * BLOCK_MAX;
        let bytes = &data[start..data.len().min(start + BLOCK_MAX)];
        let header = (bytes.len() as u32) << 3 | u32::from(block == last);
        frame.extend(&header.to_le_bytes()[..3]);
        frame.extend(bytes);
    }
    frame
}

/// Adds the kernel's and the adapter's stamps.
fn add_stamps(message: &mut pb::RawCan, frames: &[(&CanFrame, i64)]) {
    let mut delays: Vec<i64> = Vec::with_capacity(frames.len());
    let delay =
        |(frame, realtime): &(&CanFrame, i64)| Some(realtime.wrapping_sub(frame.kernel_ns?));
    delays.extend(frames.iter().filter_map(delay));
    message.kernel_none = delays.is_empty();
    if !message.kernel_none && delays.len() < frames.len() {
        message.kernel_present = bits(frames.iter().map(|(frame, _)| frame.kernel_ns.is_some()));
    }
    message.kernel_delay_ns = column::encode(&delays);
    let hardware = deltas(0, frames.iter().filter_map(|(frame, _)| frame.hardware_ns));
    if !hardware.is_empty() {
        message.hardware_present =
            bits(frames.iter().map(|(frame, _)| frame.hardware_ns.is_some()));
    }
    message.hardware_delta_ns = column::encode(&hardware);
}

fn unpack(data: &[u8], length: usize) -> Result<Vec<u8>, MessageError> {
    let unpacked = zstd::bulk::decompress(data, length).map_err(MessageError::Data)?;
    expect_len("data", length, unpacked.len())?;
    Ok(unpacked)
}

/// The data column by column, kind by kind.
fn transpose(message: &pb::RawCan, frames: &[(&CanFrame, i64)]) -> Vec<u8> {
    // Counting sort of the frames by kind.
    let mut end = vec![0_usize; message.kind_id.len() + 1];
    for kind in &message.kind {
        end[*kind as usize + 1] += 1;
    }
    for kind in 1..end.len() {
        end[kind] += end[kind - 1];
    }
    let mut rows: Vec<&[u8]> = vec![&[]; frames.len()];
    for (kind, (frame, _)) in message.kind.iter().zip(frames) {
        let place = &mut end[*kind as usize];
        rows[*place] = frame.bytes();
        *place += 1;
    }
    let mut data = Vec::with_capacity(rows.iter().map(|row| row.len()).sum());
    let mut start = 0;
    for end in &end[..message.kind_id.len()] {
        let rows = &rows[start..*end];
        start = *end;
        if let [row] = rows {
            data.extend_from_slice(row);
            continue;
        }
        let width = rows.first().map_or(0, |row| row.len());
        for column in 0..width {
            let mut before = 0_u8;
            data.extend(rows.iter().map(|row| {
                let value = row[column];
                value.wrapping_sub(std::mem::replace(&mut before, value))
            }));
        }
    }
    data
}

/// Frames of each arrival, with delays in place of kernel stamps.
pub(super) fn decode(
    source: SourceId,
    message: &pb::RawCan,
) -> Result<Vec<(SourceId, Payload)>, MessageError> {
    let mut frames = frames_of(message)?.into_iter();
    let arrivals = message.stamps.as_ref().map_or(0, |s| s.sequence_gap.len());
    if message.frames.is_empty() {
        expect_len("kind", arrivals, frames.len())?;
        return Ok(frames
            .map(|frame| (source, Payload::Can(vec![frame])))
            .collect());
    }
    let total: u64 = message.frames.iter().map(|count| u64::from(*count)).sum();
    expect_len("kind", total as usize, frames.len())?;
    let payloads = message.frames.iter().map(|count| {
        let frames = frames.by_ref().take(*count as usize).collect();
        (source, Payload::Can(frames))
    });
    Ok(payloads.collect())
}

fn frames_of(message: &pb::RawCan) -> Result<Vec<CanFrame>, MessageError> {
    let kinds = message.kind_id.len();
    expect_len("kind_flags", kinds, message.kind_flags.len())?;
    expect_len("kind_length", kinds, message.kind_length.len())?;
    let mut count = vec![0_usize; kinds];
    for kind in &message.kind {
        *count.get_mut(*kind as usize).ok_or(MessageError::Range {
            field: "kind",
            value: (*kind).into(),
        })? += 1;
    }
    if !message.kind_len8_dlc.is_empty() {
        expect_len("kind_len8_dlc", kinds, message.kind_len8_dlc.len())?;
    }
    // Start of each kind's block in the data, and width of its rows.
    let mut start = Vec::with_capacity(kinds);
    let mut total = 0_usize;
    for (kind, frames) in count.iter().enumerate() {
        start.push(total);
        total += frames * usize::from(row_width(message, kind)?);
    }
    // zstd compresses by at most about 2^17 in one block: a larger length is wrong.
    if total / (1 << 18) > message.data_zstd.len() {
        return Err(MessageError::Absent("data"));
    }
    let packed = unpack(&message.data_zstd, total)?;

    let total = message.kind.len();
    let kernel_at = |index: usize| {
        !message.kernel_none
            && (message.kernel_present.is_empty() || bit(&message.kernel_present, index))
    };
    let hardware_at = |index: usize| bit(&message.hardware_present, index);
    let mut kernel = column::decode(
        "kernel_delay_ns",
        message.kernel_delay_ns.as_ref(),
        (0..total).filter(|index| kernel_at(*index)).count(),
    )?
    .into_iter();
    let hardware = column::decode(
        "hardware_delta_ns",
        message.hardware_delta_ns.as_ref(),
        (0..total).filter(|index| hardware_at(*index)).count(),
    )?;
    let mut hardware = sums(0, hardware);
    let mut seen = vec![0_usize; kinds];
    let mut before: Vec<FrameData> = (0..kinds)
        .map(|kind| Ok(FrameData::zeros(row_width(message, kind)?)))
        .collect::<Result<_, MessageError>>()?;
    let mut frames = Vec::with_capacity(total);
    for (index, kind) in message.kind.iter().enumerate() {
        let kind = *kind as usize;
        let data = &mut before[kind];
        let width = usize::from(row_width(message, kind)?);
        for (column, byte) in data[..width].iter_mut().enumerate() {
            let difference = packed[start[kind] + column * count[kind] + seen[kind]];
            *byte = byte.wrapping_add(difference);
        }
        seen[kind] += 1;
        frames.push(CanFrame {
            id: message.kind_id[kind],
            flags: CanFlags::from_bits(message.kind_flags[kind]),
            len: message.kind_length[kind],
            data: data.clone(),
            len8_dlc: message.kind_len8_dlc.get(kind).copied().unwrap_or(0),
            kernel_ns: if kernel_at(index) {
                kernel.next()
            } else {
                None
            },
            hardware_ns: if hardware_at(index) {
                hardware.next()
            } else {
                None
            },
        });
    }
    Ok(frames)
}

fn row_width(message: &pb::RawCan, kind: usize) -> Result<u8, MessageError> {
    let length = message.kind_length[kind];
    if length > 64 {
        return Err(MessageError::Range {
            field: "kind_length",
            value: length.into(),
        });
    }
    let remote = CanFlags::from_bits(message.kind_flags[kind]).remote;
    Ok(if remote { 0 } else { length })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_stored_as_it_is_is_a_zstd_frame() {
        for length in [0_u64, 1, 1 << 17, (1 << 17) + 1, 300_000] {
            let data: Vec<u8> = (0..length).map(|n| ((n * n) >> 3) as u8).collect();
            assert_eq!(unpack(&stored(&data), data.len()).expect("a frame"), data);
        }
    }
}
