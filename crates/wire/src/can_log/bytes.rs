//! Little-endian numbers at places of a byte slice, zero-filled beyond its end.

/// The bytes from `place` on; zeros beyond the end of the slice.
pub(super) fn array<const N: usize>(bytes: &[u8], place: usize) -> [u8; N] {
    let mut array = [0; N];
    let rest = bytes.get(place..).unwrap_or_default();
    let len = rest.len().min(N);
    array[..len].copy_from_slice(&rest[..len]);
    array
}

pub(super) fn u8_at(bytes: &[u8], place: usize) -> u8 {
    bytes.get(place).copied().unwrap_or_default()
}

pub(super) fn u16_at(bytes: &[u8], place: usize) -> u16 {
    u16::from_le_bytes(array(bytes, place))
}

pub(super) fn u32_at(bytes: &[u8], place: usize) -> u32 {
    u32::from_le_bytes(array(bytes, place))
}

pub(super) fn u64_at(bytes: &[u8], place: usize) -> u64 {
    u64::from_le_bytes(array(bytes, place))
}
