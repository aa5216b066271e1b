//! MOOS logs with the built-in map's kinds of variables.
#![no_main]

use atvrec_fuzz::{Seen, whole_and_cut};
use libfuzzer_sys::fuzz_target;
use wire::alog::{Decoder, Format, Part, Variable};
use wire::column::{Column, Quantity};

fn variable(name: &str, quantity: &str, part: Part, group: usize) -> Variable {
    Variable {
        name: name.to_owned(),
        source: String::new(),
        part,
        group,
        column: Column {
            name: quantity.to_owned(),
            quantity: Quantity::from_name(quantity).expect("a quantity"),
            unit: String::new(),
            factor: 1.0,
            scale: 1.0,
            offset: 0.0,
            latency_s: 0.0,
            held_rows: 1,
        },
    }
}

fuzz_target!(|data: &[u8]| {
    let format = Format {
        variables: vec![
            variable("X", "rate.x", Part::Whole, 0),
            variable("Y", "rate.y", Part::Whole, 0),
            variable("A", "gnss.roll", Part::Element(1), 1),
            variable("A", "gnss.pitch", Part::Element(2), 1),
            variable("K", "steer", Part::Key("S".to_owned()), 2),
        ],
        together_ns: 1_000_000,
    };
    let first = Decoder::new(format).expect("a format");
    whole_and_cut(data, |pieces| {
        let mut seen = Seen::default();
        let mut decoder = first.clone();
        for piece in pieces {
            decoder.push(piece, |item| seen.see(&item));
        }
        decoder.finish(|item| seen.see(&item));
        seen.statistics = decoder.statistics();
        seen
    });
});
