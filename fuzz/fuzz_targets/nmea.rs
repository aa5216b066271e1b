//! NMEA sentences with right checksums, one a line of the input.
#![no_main]

use atvrec_fuzz::{gnss, whole_and_cut};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((cut, text)) = data.split_first() else {
        return;
    };
    let mut stream = vec![*cut];
    for sentence in String::from_utf8_lossy(text).lines() {
        wire::nmea::encode_sentence(sentence, &mut stream);
    }
    whole_and_cut(&stream, gnss);
});
