//! Logs that were made to exhaust memory.

/// An unfinished log with one chunk that inflates to `size` zeros, from run-length blocks of zstd (RFC
/// 8878, section 3.1.1.2.2).
#[must_use]
pub fn log_of_zeros(size: u64) -> Vec<u8> {
    let compressed = zstd_of_zeros(size);
    let mut body = vec![0; 16];
    body.extend(size.to_le_bytes());
    body.extend(1_u32.to_le_bytes());
    body.extend(4_u32.to_le_bytes());
    body.extend(b"zstd");
    body.extend((compressed.len() as u64).to_le_bytes());
    body.extend(compressed);
    let mut file = b"\x89MCAP0\r\n".to_vec();
    // Header: profile and library are empty.
    file.extend([1, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    file.push(6);
    file.extend((body.len() as u64).to_le_bytes());
    file.extend(body);
    file
}

fn zstd_of_zeros(size: u64) -> Vec<u8> {
    const BLOCK: u64 = 1 << 17;
    let mut frame = 0xFD2F_B528_u32.to_le_bytes().to_vec();
    frame.push(0b1110_0000);
    frame.extend(size.to_le_bytes());
    let blocks = size.div_ceil(BLOCK);
    for block in 0..blocks {
        let bytes = (size - block * BLOCK).min(BLOCK) as u32;
        let header = bytes << 3 | 1 << 1 | u32::from(block + 1 == blocks);
        frame.extend(&header.to_le_bytes()[..3]);
        frame.push(0);
    }
    frame
}
