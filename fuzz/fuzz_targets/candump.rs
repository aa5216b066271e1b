//! Lines of candump's logs; each line read is a line that can be written and read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use wire::candump::{format_frame, parse_frame, parse_line};

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    for line in text.lines() {
        let _ = parse_line(line);
        if let Ok(frame) = parse_frame(line) {
            let again = parse_frame(&format_frame(&frame)).expect("its own text");
            assert_eq!(again, frame);
        }
    }
});
