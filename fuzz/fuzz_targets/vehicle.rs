//! Vehicle files; one that is taken can be written and read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use model::vehicle::Vehicle;

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    match Vehicle::from_toml(text, "fuzz.toml") {
        Ok(vehicle) => {
            let _ = vehicle.warnings();
            let _ = vehicle.sprung();
            let _ = vehicle.pitch();
            let again = vehicle.to_toml().expect("what was read can be written");
            Vehicle::from_toml(&again, "again.toml").expect("its own text");
        }
        Err(errors) => assert!(!errors.to_string().is_empty()),
    }
});
