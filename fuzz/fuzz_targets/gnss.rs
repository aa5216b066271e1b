//! A receiver's port: anything at all.
#![no_main]

use atvrec_fuzz::{gnss, whole_and_cut};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| whole_and_cut(data, gnss));
