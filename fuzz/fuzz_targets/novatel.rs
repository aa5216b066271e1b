//! NovAtel logs with right checksums, binary and ASCII.
#![no_main]

use atvrec_fuzz::{gnss, novatel_ascii, novatel_binary, whole_and_cut};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((form, data)) = data.split_first() else {
        return;
    };
    let mut stream = vec![*form];
    match form % 3 {
        0 => stream.extend(novatel_binary(data, false)),
        1 => stream.extend(novatel_binary(data, true)),
        _ => stream.extend(novatel_ascii(data)),
    }
    if form % 3 < 2 {
        let seen = gnss(&mut std::iter::once(&stream[1..]));
        assert_eq!(seen.statistics.messages, 1, "the checksum is right");
    }
    whole_and_cut(&stream, gnss);
});
