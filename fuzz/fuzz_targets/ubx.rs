//! UBX messages with right checksums: class and number, then the payload, each message behind its length.
#![no_main]

use atvrec_fuzz::{gnss, whole_and_cut};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((cut, mut rest)) = data.split_first() else {
        return;
    };
    let mut stream = vec![*cut];
    while let [class, number, length, tail @ ..] = rest {
        // Up to 765 bytes: ESF-RAW of ten instants has 564.
        let (payload, next) = tail.split_at(tail.len().min(3 * usize::from(*length)));
        wire::ubx::encode_frame([*class, *number], payload, &mut stream);
        rest = next;
    }
    whole_and_cut(&stream, gnss);
});
