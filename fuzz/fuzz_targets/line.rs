//! Text devices: the first four bytes choose the format, the rest is what the device says.
#![no_main]

use atvrec_fuzz::{Seen, whole_and_cut};
use libfuzzer_sys::fuzz_target;
use wire::line::{Decoder, Field, Format, Role};

fn format(choice: [u8; 4]) -> Format {
    let [delimiter, count, bits, prefix] = choice;
    let fields = (0..usize::from(count % 4) + 1).map(|index| Field {
        index: index * (1 + usize::from(count >> 6)),
        name: format!("f{index}"),
        scale: 0.1,
        offset: f64::from(count),
        unit: String::new(),
        signed_bits: (bits > 1).then_some(bits),
    });
    Format {
        delimiter: (delimiter > 0).then_some(delimiter),
        prefix: if prefix & 1 == 1 { "A=" } else { "" }.to_owned(),
        fields: fields.collect(),
        role: if prefix & 2 == 2 {
            Role::Control
        } else {
            Role::Steer("f0".to_owned())
        },
        query: Vec::new(),
    }
}

fuzz_target!(|data: &[u8]| {
    let Some((choice, data)) = data.split_first_chunk::<4>() else {
        return;
    };
    let format = format(*choice);
    let Ok(first) = Decoder::new(format) else {
        return;
    };
    whole_and_cut(data, |pieces| {
        let mut seen = Seen::default();
        let mut decoder = first.clone();
        for piece in pieces {
            decoder.push(piece, |item| seen.see(&item));
        }
        seen.statistics = decoder.statistics();
        seen
    });
});
