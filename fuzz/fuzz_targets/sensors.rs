//! Sensors files.
#![no_main]

use libfuzzer_sys::fuzz_target;
use model::sensors::Sensors;

fuzz_target!(|data: &[u8]| {
    if let Ok(text) = std::str::from_utf8(data)
        && let Err(errors) = Sensors::from_toml(text, "fuzz.toml")
    {
        assert!(!errors.to_string().is_empty());
    }
});
