//! Every byte of a closed log stands under a checksum.

use std::collections::BTreeMap;

use atvrec_store::{LogWriter, Options, Reader};

use crate::common::{START, arrivals, records, session};

#[test]
fn one_changed_bit_anywhere_is_found() {
    let mut writer =
        LogWriter::new(Vec::new(), session(), Options::default(), 0).expect("a vector");
    for record in records(START) {
        writer.record(&record);
    }
    for arrival in arrivals(5, 40) {
        writer.push(arrival).expect("a vector");
    }
    let bytes = writer.finish(&BTreeMap::new()).expect("a vector");
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("log.mcap");
    std::fs::write(&path, &bytes).expect("written");
    let whole = Reader::open([&path]).expect("a log");
    assert_eq!(whole.changed().expect("readable"), []);

    for index in (0..bytes.len()).step_by(29) {
        let mut changed = bytes.clone();
        changed[index] ^= 1 << (index % 8);
        std::fs::write(&path, &changed).expect("written");
        let found = match Reader::open([&path]) {
            Err(_) => true,
            Ok(reader) => {
                !reader.info().missing.is_empty() || !reader.changed().expect("readable").is_empty()
            }
        };
        assert!(found, "byte {index} of {}", bytes.len());
    }
}
