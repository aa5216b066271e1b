//! Counter and checksum of a CAN frame by AUTOSAR E2E profile 1, variant 1A ("E2E Protocol
//! Specification", R22-11, section 6.2).
//!
//! Byte 0 is the CRC-8 with the polynomial of SAE J1850 (0x1D), with start value and final XOR zero,
//! over the data identifier (low byte, high byte) and the bytes 1 to 7. The low half of byte 1 is a
//! counter from 0 to 14.

/// Number of values of the counter; 15 is invalid.
const COUNTER_VALUES: u8 = 15;

const CRC: crc::Crc<u8> = crc::Crc::<u8>::new(&crc::Algorithm {
    width: 8,
    poly: 0x1D,
    init: 0,
    refin: false,
    refout: false,
    xorout: 0,
    check: 0x37,
    residue: 0,
});

/// Writes counter and checksum into a frame.
pub fn protect(data: &mut [u8; 8], data_id: u16, counter: u8) {
    data[1] = (data[1] & 0xF0) | (counter % COUNTER_VALUES);
    data[0] = checksum(data, data_id);
}

/// Counter of a frame; `None` if the checksum is wrong or the counter is invalid.
#[must_use]
pub fn check(data: &[u8; 8], data_id: u16) -> Option<u8> {
    let counter = data[1] & 0x0F;
    (checksum(data, data_id) == data[0] && counter < COUNTER_VALUES).then_some(counter)
}

/// The counter after `counter`.
#[must_use]
pub const fn next_counter(counter: u8) -> u8 {
    (counter + 1) % COUNTER_VALUES
}

fn checksum(data: &[u8; 8], data_id: u16) -> u8 {
    let mut digest = CRC.digest();
    digest.update(&data_id.to_le_bytes());
    digest.update(&data[1..]);
    digest.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames that another implementation (the package autosar-e2e 1.0.0 of PyPI) protected.
    const REFERENCE: [([u8; 8], u16); 3] = [
        ([0xBF, 0x21, 1, 2, 3, 4, 5, 6], 0x1234),
        ([0x91, 0x01, 0, 0, 0, 0, 0, 0], 0x123),
        ([0xCC, 0x00, 0, 0, 0, 0, 0, 0], 0x123),
    ];

    #[test]
    fn frames_are_protected_as_by_another_implementation() {
        for (frame, id) in REFERENCE {
            let mut own = frame;
            own[0] = 0xAA;
            protect(&mut own, id, frame[1] & 0x0F);
            assert_eq!(own, frame);
            assert_eq!(check(&frame, id), Some(frame[1] & 0x0F));
        }
    }

    #[test]
    fn a_flipped_bit_another_identifier_and_counter_15_are_found() {
        let mut frame = [0, 0x20, 1, 2, 3, 4, 5, 6];
        protect(&mut frame, 0x500, 14);
        assert_eq!(check(&frame, 0x500), Some(14));
        assert_eq!(check(&frame, 0x501), None);
        for bit in 0..64 {
            let mut broken = frame;
            broken[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(check(&broken, 0x500), None, "bit {bit}");
        }
        frame[1] |= 0x0F;
        frame[0] = checksum(&frame, 0x500);
        assert_eq!(check(&frame, 0x500), None);
        assert_eq!(next_counter(14), 0);
    }
}
