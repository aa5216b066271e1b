//! The first bytes of any device.
#![no_main]

use libfuzzer_sys::fuzz_target;
use wire::recognise::recognise;

fuzz_target!(|data: &[u8]| {
    if let Some(format) = recognise(data) {
        assert!(!format.name().is_empty() && !format.advice().is_empty());
    }
});
