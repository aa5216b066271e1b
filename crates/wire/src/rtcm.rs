//! Frames of RTCM 3, which correction services and receivers send among other messages (RTCM 10403,
//! chapter 4). They are framed, so that their bytes are not taken for other messages, and not decoded.

use std::sync::LazyLock;

use crc::{Algorithm, Crc, Table};

use crate::frame::Scan;

/// CRC-24Q.
static ALGORITHM: Algorithm<u32> = Algorithm {
    width: 24,
    poly: 0x86_4CFB,
    init: 0,
    refin: false,
    refout: false,
    xorout: 0,
    check: 0xCD_E703,
    residue: 0,
};
static CRC: LazyLock<Crc<u32, Table<1>>> = LazyLock::new(|| Crc::<u32, Table<1>>::new(&ALGORITHM));

/// Scans bytes that begin with `D3`.
pub(crate) fn scan(bytes: &[u8]) -> Scan<()> {
    let Some([_, high, low]) = bytes.first_chunk() else {
        return Scan::Need(3);
    };
    if high & 0xFC != 0 {
        return Scan::Skip(1);
    }
    let content = 3 + usize::from(u16::from_be_bytes([*high, *low]));
    let len = content + 3;
    if bytes.len() < len {
        return Scan::Need(len);
    }
    let saved = u32::from_be_bytes([0, bytes[content], bytes[content + 1], bytes[content + 2]]);
    if CRC.checksum(&bytes[..content]) == saved {
        Scan::Frame { len, kind: () }
    } else {
        // Of other binary data, not a damaged frame.
        Scan::Skip(1)
    }
}
