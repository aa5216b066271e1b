//! Frames of the transport protocol of J1939, twelve bytes each: identifier and data. Each message is as
//! long as was announced, and no parameter group is lost.
#![no_main]

use libfuzzer_sys::fuzz_target;
use sample::{CanFlags, CanFrame};
use wire::j1939::{Transport, trouble_codes};

fuzz_target!(|data: &[u8]| {
    let mut transport = Transport::default();
    for (number, bytes) in (0_u64..).zip(data.chunks_exact(12)) {
        let (id, content) = bytes.split_at(4);
        let id = u32::from_be_bytes(id.try_into().expect("four bytes")) & 0x1FFF_FFFF;
        let flags = CanFlags {
            extended: true,
            ..CanFlags::default()
        };
        let frame = CanFrame::new(id, flags, content).expect("eight bytes");
        if let Some(message) = transport.push(&frame, number * 10_000_000) {
            assert!((9..=1785).contains(&message.data.len()));
            assert!(message.id <= 0x1FFF_FFFF);
            let _ = trouble_codes(&message.data);
        }
    }
});
