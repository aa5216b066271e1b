//! What the fuzz targets share: the property that cuts do not matter, and seals (checksums,
//! headers) that let the fuzzer reach what stands behind them.

use std::fmt::Debug;
use std::io::Cursor;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::LazyLock;

use crc::{Algorithm, CRC_16_XMODEM, CRC_32_ISO_HDLC, Crc, Table};
use wire::can_log::{self, Format, Record, Summary};
use wire::{Item, Statistics};

/// Decodes `data` behind its first byte in one piece and in pieces of that many bytes: what comes
/// out must be the same.
pub fn whole_and_cut<T: PartialEq + Debug>(
    data: &[u8],
    decode: impl Fn(&mut dyn Iterator<Item = &[u8]>) -> T,
) {
    let Some((size, bytes)) = data.split_first() else {
        return;
    };
    let whole = decode(&mut std::iter::once(bytes));
    let pieces = decode(&mut bytes.chunks(usize::from(*size).max(1)));
    assert_eq!(whole, pieces, "cut every {size} bytes");
}

/// What a decoder made of a stream, in a form that can be compared (a NaN equals itself here).
#[derive(Debug, Default, PartialEq)]
pub struct Seen {
    /// Counts.
    pub statistics: Statistics,
    /// Items handed on.
    pub items: u64,
    /// A hash of where they stood and what they were.
    pub places: u64,
}

impl Seen {
    /// Takes an item into account, and checks that it says where it stood.
    pub fn see(&mut self, item: &Item<'_>) {
        assert_eq!(
            item.range.end - item.range.start,
            item.raw.len() as u64,
            "{item:?}"
        );
        self.items += 1;
        for number in [item.range.start, item.range.end, item.protocol as u64] {
            self.places = self.places.wrapping_mul(0x0100_0000_01b3) ^ number;
        }
    }
}

/// A receiver's decoder over a stream.
pub fn gnss(pieces: &mut dyn Iterator<Item = &[u8]>) -> Seen {
    receiver(wire::gnss::Decoder::new(), pieces)
}

/// The decoder of a VectorNav unit over a stream.
pub fn vectornav(pieces: &mut dyn Iterator<Item = &[u8]>) -> Seen {
    receiver(wire::gnss::Decoder::vectornav(), pieces)
}

fn receiver(mut decoder: wire::gnss::Decoder, pieces: &mut dyn Iterator<Item = &[u8]>) -> Seen {
    let mut seen = Seen::default();
    for piece in pieces {
        decoder.push(piece, |item| seen.see(&item));
    }
    decoder.finish(|item| seen.see(&item));
    seen.statistics = decoder.statistics();
    seen
}

/// NovAtel's CRC: the usual reflected one, from zero and not inverted.
fn novatel_crc(bytes: &[u8]) -> u32 {
    static ALGORITHM: Algorithm<u32> = Algorithm {
        init: 0,
        xorout: 0,
        ..CRC_32_ISO_HDLC
    };
    static CRC: LazyLock<Crc<u32, Table<1>>> =
        LazyLock::new(|| Crc::<u32, Table<1>>::new(&ALGORITHM));
    CRC.checksum(bytes)
}

/// A NovAtel log with a right checksum: identifier from the first two bytes, the rest is its body.
#[must_use]
pub fn novatel_binary(data: &[u8], short: bool) -> Vec<u8> {
    let (id, body) = data.split_at(data.len().min(2));
    let body = &body[..body.len().min(if short { 255 } else { 4096 })];
    let id = [
        id.first().copied().unwrap_or(42),
        id.get(1).copied().unwrap_or(0),
    ];
    let (week, milliseconds) = (1527_u16.to_le_bytes(), 320_400_000_u32.to_le_bytes());
    let mut bytes = vec![0xAA, 0x44, if short { 0x13 } else { 0x12 }];
    if short {
        bytes.push(body.len() as u8);
        bytes.extend(id);
        bytes.extend(week);
        bytes.extend(milliseconds);
    } else {
        bytes.push(28);
        bytes.extend(id);
        bytes.extend([0, 0x20]);
        bytes.extend((body.len() as u16).to_le_bytes());
        bytes.extend([0, 0, 0, 180]);
        bytes.extend(week);
        bytes.extend(milliseconds);
        bytes.extend([0; 8]);
    }
    bytes.extend(body);
    bytes.extend(novatel_crc(&bytes).to_le_bytes());
    bytes
}

/// The text as a NovAtel ASCII log with a right checksum.
#[must_use]
pub fn novatel_ascii(text: &[u8]) -> Vec<u8> {
    let mut bytes = b"#".to_vec();
    bytes.extend(text);
    bytes.extend(format!("*{:08x}\r\n", novatel_crc(text)).as_bytes());
    bytes
}

/// A Septentrio block with a right checksum: number and revision from the first two bytes, the rest
/// is its body, filled up to a multiple of four.
#[must_use]
pub fn sbf(data: &[u8]) -> Vec<u8> {
    static CRC: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_XMODEM);
    let mut rest = data.get(..2).unwrap_or(&[0x27, 0x17]).to_vec();
    let body = data.get(2..).unwrap_or_default();
    rest.extend([0; 2]);
    rest.extend(&body[..body.len().min(4096)]);
    rest.resize(rest.len().next_multiple_of(4), 0);
    let length = rest.len() as u16 + 4;
    rest[2..4].copy_from_slice(&length.to_le_bytes());
    let mut bytes = b"$@".to_vec();
    bytes.extend(CRC.checksum(&rest).to_le_bytes());
    bytes.extend(rest);
    bytes
}

/// A journal's entry with a right length and checksum.
#[must_use]
pub fn journal_entry(body: &[u8]) -> Vec<u8> {
    let mut bytes = b"ATVJ".to_vec();
    bytes.extend((body.len() as u32).to_le_bytes());
    bytes.extend(crc32fast::hash(body).to_le_bytes());
    bytes.extend(body);
    bytes
}

/// Puts bytes where [`store::Reader`] finds them; in memory where the system has such a place.
#[must_use]
pub fn as_file(name: &str, bytes: &[u8]) -> PathBuf {
    static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
        let memory = PathBuf::from("/dev/shm");
        if memory.is_dir() {
            memory
        } else {
            std::env::temp_dir()
        }
    });
    let path = FOLDER.join(format!("atvrec-fuzz-{name}-{}", std::process::id()));
    std::fs::write(&path, bytes).expect("there is room for a fuzzer's input");
    path
}

/// Reads all that a log holds; whatever the bytes, it ends, and what it gives is consistent.
pub fn read_all(path: &std::path::Path) {
    let Ok(reader) = store::Reader::open([path]) else {
        return;
    };
    let _ = reader.info();
    let _ = reader.attachments();
    let _ = reader.changed();
    let mut last = None;
    for arrival in reader.arrivals().flatten() {
        assert!(last < Some(arrival.sequence), "sequences rise");
        last = Some(arrival.sequence);
    }
    for message in reader.messages(store::Selection::default()).flatten() {
        let _ = message.record();
    }
    let _ = reader.estimates().count();
}

/// Reads a log of CAN frames: all of it, and as far as its middle. The frames are possible, and the summary
/// counts them.
pub fn can_log(format: Format, bytes: &[u8]) {
    let (frames, summary) = can_log_until(format, bytes, u64::MAX);
    let (first, _) = can_log_until(format, bytes, frames.len() as u64 / 2 + 1);
    assert_eq!(first[..], frames[..first.len()]);
    let Some(summary) = summary else { return };
    assert_eq!(summary.frames, frames.len() as u64);
    assert!(summary.defects.len() as u64 <= summary.defect_count);
    for entry in &frames {
        assert!(entry.frame.bytes().len() <= 64);
        assert!(entry.frame.id < 1 << 29, "{:x}", entry.frame.id);
        let channel = entry.channel.map_or(0, usize::from);
        assert!(entry.channel.is_none() || channel < summary.channels.len());
    }
}

/// At most this many frames of a log, and its summary if it can be read.
fn can_log_until(
    format: Format,
    bytes: &[u8],
    most: u64,
) -> (Vec<can_log::Entry>, Option<Summary>) {
    let mut frames = Vec::new();
    let read = can_log::read(format, &mut Cursor::new(bytes), &mut |record| {
        if let Record::Frame(entry) = record {
            frames.push(entry);
        }
        match (frames.len() as u64) < most {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        }
    });
    (frames, read.ok())
}
