//! Calibration files; one that is taken can be written and read again.
#![no_main]

use estimator::Calibration;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    if let Ok(calibration) = Calibration::from_toml(text) {
        let again = calibration.to_toml().expect("what was read can be written");
        Calibration::from_toml(&again).expect("its own text");
    }
});
