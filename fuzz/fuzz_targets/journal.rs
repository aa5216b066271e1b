//! Journals beside a log that was cut: entries as they are, and entries with a right checksum.
#![no_main]

use std::io::Cursor;

use atvrec_fuzz::journal_entry;
use libfuzzer_sys::fuzz_target;

/// A log that was cut behind its magic.
const LOG: &[u8] = b"\x89MCAP0\r\n";

fuzz_target!(|data: &[u8]| {
    let (first, second) = data.split_at(data.len() / 2);
    let sealed = [journal_entry(first), journal_entry(second)].concat();
    for journals in [[data, &[]], [&sealed, &[]], [&sealed, data]] {
        let mut output = Vec::new();
        store::salvage(Cursor::new(LOG), &journals, &mut output).expect("recovery never fails");
        mcap::Summary::read(&output).expect("the result is sound");
    }
});
