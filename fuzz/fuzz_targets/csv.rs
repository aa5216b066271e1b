//! Delimited text: the first four bytes choose the format, the rest is the file. The reader of an
//! importer and the decoder agree on the rows.
#![no_main]

use atvrec_fuzz::{Seen, whole_and_cut};
use libfuzzer_sys::fuzz_target;
use wire::column::{self, Column, Quantity};
use wire::csv::{Decoder, Format, Held, Line, Place, Reader};

fn column(quantity: &str, held_rows: u32) -> Column {
    Column {
        name: quantity.to_owned(),
        quantity: Quantity::from_name(quantity).expect("a quantity"),
        unit: String::new(),
        factor: 1.0,
        scale: 0.1,
        offset: 1.0,
        latency_s: 0.0,
        held_rows,
    }
}

fn format([delimiter, flags, skip, held]: [u8; 4]) -> Format {
    let header = flags & 1 == 1;
    let place = |number: usize, name: &str| {
        if header {
            Place::Name(name.to_owned())
        } else {
            Place::Number(number)
        }
    };
    Format {
        delimiter: [Some(','), Some(';'), Some('\t'), None][usize::from(delimiter % 4)],
        decimal_comma: flags & 2 == 2,
        comment: if flags & 4 == 4 { "#" } else { "" }.to_owned(),
        skip_lines: usize::from(skip % 4),
        header,
        units_row: flags & 8 == 8,
        missing: vec!["-".to_owned()],
        columns: vec![
            (place(1, "a"), column("steer", u32::from(held % 5).max(1))),
            (place(2, "b"), column("rate.z", 1)),
        ],
    }
}

/// Measurements of a text by the reader, line by line.
fn by_reader(format: &Format, text: &str) -> usize {
    let mut reader = Reader::new(format.clone(), Vec::new());
    let mut held = Held::default();
    let mut count = 0;
    for line in text
        .split_inclusive('\n')
        .filter(|line| line.ends_with('\n'))
    {
        if let Ok(Line::Row(mut values)) = reader.take(line) {
            held.leave_out(format, &mut values);
            let columns = format.columns.iter().map(|(_, column)| column).zip(values);
            let present: Vec<_> = columns.filter_map(|(c, value)| Some((c, value?))).collect();
            count += column::measurements(&present).len();
        }
    }
    count
}

fuzz_target!(|data: &[u8]| {
    let Some((choice, data)) = data.split_first_chunk::<4>() else {
        return;
    };
    let format = format(*choice);
    let Ok(first) = Decoder::new(format.clone()) else {
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
    let plain = |byte: &u8| *byte == b'\n' || (b' '..0x7f).contains(byte);
    if data.iter().all(plain) && data.len() < wire::csv::MAX_LINE {
        let text = std::str::from_utf8(data).expect("ASCII");
        let mut found = 0;
        let mut decoder = first.clone();
        decoder.push(data, |_| found += 1);
        assert_eq!(found, by_reader(&format, text));
    }
});
