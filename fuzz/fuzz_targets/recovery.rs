//! Recovery of logs: never a panic; what comes out is whole, and recovering it changes nothing.
#![no_main]

use std::io::Cursor;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let mut output = Vec::new();
    let Ok(saved) = store::salvage(Cursor::new(data), &[], &mut output) else {
        return;
    };
    mcap::Summary::read(&output)
        .expect("the result is sound")
        .expect("the result is finished");
    let mut again = Vec::new();
    let kept = store::salvage(Cursor::new(&output), &[], &mut again).expect("it is a log");
    assert_eq!(kept, saved);
});
