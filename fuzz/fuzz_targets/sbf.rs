//! Septentrio blocks with right checksums; two in a row, since attitudes remember their covariance.
#![no_main]

use atvrec_fuzz::{gnss, sbf, whole_and_cut};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((cut, data)) = data.split_first() else {
        return;
    };
    let (first, second) = data.split_at(data.len() / 2);
    let mut stream = vec![*cut];
    stream.extend(sbf(first));
    stream.extend(sbf(second));
    let seen = gnss(&mut std::iter::once(&stream[1..]));
    assert_eq!(seen.statistics.messages, 2, "the checksums are right");
    whole_and_cut(&stream, gnss);
});
