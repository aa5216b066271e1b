//! SLCAN adapters; each frame read is a frame that can be written and read again.
#![no_main]

use atvrec_fuzz::whole_and_cut;
use libfuzzer_sys::fuzz_target;
use wire::slcan::{Decoder, Event, encode_frame};

fn decode(pieces: &mut dyn Iterator<Item = &[u8]>) -> (Vec<Event>, wire::slcan::SlcanStatistics) {
    let mut events = Vec::new();
    let mut decoder = Decoder::new();
    for piece in pieces {
        decoder.push(piece, &mut |event| events.push(event));
    }
    (events, decoder.statistics())
}

fuzz_target!(|data: &[u8]| {
    whole_and_cut(data, decode);
    for event in decode(&mut std::iter::once(data)).0 {
        if let Event::Frame(frame) = event {
            let frame = sample::CanFrame {
                hardware_ns: None,
                ..frame
            };
            let text = encode_frame(&frame, None).expect("a frame that was read has a text");
            let again = decode(&mut std::iter::once(text.as_slice())).0;
            assert_eq!(again, [Event::Frame(frame)]);
        }
    }
});
