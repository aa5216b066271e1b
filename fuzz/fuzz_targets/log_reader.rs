//! Logs: everything that can be read is read.
#![no_main]

use atvrec_fuzz::{as_file, read_all};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| read_all(&as_file("log", data)));
