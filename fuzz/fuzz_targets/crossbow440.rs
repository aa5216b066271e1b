//! Crossbow 440 packets: raw bytes, and packets with a right checksum.
#![no_main]

use atvrec_fuzz::{Seen, whole_and_cut};
use libfuzzer_sys::fuzz_target;
use wire::crossbow440::{Decoder, PacketRate, encode_packet};

fn decode(pieces: &mut dyn Iterator<Item = &[u8]>) -> Seen {
    let mut seen = Seen::default();
    let mut decoder = Decoder::new(PacketRate::default());
    for piece in pieces {
        decoder.push(piece, |item| seen.see(&item));
    }
    decoder.finish(|item| seen.see(&item));
    seen.statistics = decoder.statistics();
    seen
}

fuzz_target!(|data: &[u8]| {
    whole_and_cut(data, decode);
    if let Some((kind, payload)) = data.split_first_chunk::<2>()
        && payload.len() < 256
    {
        let packet = encode_packet(*kind, payload);
        decode(&mut std::iter::once(packet.as_slice()));
    }
});
