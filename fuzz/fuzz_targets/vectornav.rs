//! The port of a VectorNav unit: anything at all, an output whose checksum is made right, and text with a
//! right checksum.
#![no_main]

use atvrec_fuzz::{vectornav, whole_and_cut};
use crc::{CRC_16_XMODEM, Crc, Table};
use libfuzzer_sys::fuzz_target;

static CRC: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_XMODEM);

fuzz_target!(|data: &[u8]| {
    whole_and_cut(data, vectornav);
    let Some((cut, content)) = data.split_first() else {
        return;
    };
    let mut output = vec![*cut, 0xFA];
    output.extend(content);
    output.extend(CRC.checksum(content).to_be_bytes());
    whole_and_cut(&output, vectornav);
    let mut text = vec![*cut];
    for line in String::from_utf8_lossy(content).lines() {
        wire::vectornav::encode_text(&format!("VN{line}"), &mut text);
    }
    whole_and_cut(&text, vectornav);
});
