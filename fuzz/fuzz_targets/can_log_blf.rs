//! BLF logs.
#![no_main]

use libfuzzer_sys::fuzz_target;
use wire::can_log::Format;

fuzz_target!(|data: &[u8]| atvrec_fuzz::can_log(Format::Blf, data));
