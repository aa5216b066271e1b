//! Measured signals of MF4 files, and formats by their first bytes.
#![no_main]

use std::io::Cursor;
use std::ops::ControlFlow;

use libfuzzer_sys::fuzz_target;
use wire::can_log::mf4::{Tables, Value};

/// Most rows of a table: their number in a damaged file has no limit.
const ROWS_MAX: usize = 200;

fuzz_target!(|data: &[u8]| {
    let _ = wire::can_log::recognise(data);
    let mut input = Cursor::new(data);
    let Ok(mut tables) = Tables::open(&mut input) else {
        return;
    };
    for table in 0..tables.tables().len() {
        let columns = tables.tables()[table].columns.len();
        let mut rows = 0;
        let read = tables.rows(table, &mut |row: &[Value]| {
            assert_eq!(row.len(), columns);
            rows += 1;
            match rows < ROWS_MAX {
                true => ControlFlow::Continue(()),
                false => ControlFlow::Break(()),
            }
        });
        read.expect("a file in memory has no errors of reading");
    }
});
