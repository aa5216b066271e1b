//! DBC files; the first 64 bytes are a frame that every message of the file decodes.
#![no_main]

use libfuzzer_sys::fuzz_target;
use wire::dbc::Database;

fuzz_target!(|data: &[u8]| {
    let (frame, file) = data.split_at(data.len().min(64));
    let strict = Database::parse(file);
    let Ok(database) = Database::parse_usable(file) else {
        assert!(strict.is_err(), "the strict reader takes no more");
        return;
    };
    assert_eq!(strict.is_ok(), database.left_out().is_empty());
    let _ = database.warnings();
    for message in database.messages() {
        for length in [0, 1, 8, 64] {
            for value in message.decode(&frame[..frame.len().min(length)]) {
                let _ = (value.physical, value.signal.name.len());
            }
        }
    }
});
