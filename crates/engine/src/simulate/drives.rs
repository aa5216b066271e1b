//! A drive that the tests change.

use sim::Options;

use crate::FileSource;
use crate::virtual_drive::{Course, Drive};

/// The built-in vehicle on a whole manoeuvre, with a sensors file that is part of the program, seed 11.
pub fn of_prowler(manoeuvre: &str, sensors: &str) -> Drive {
    Drive {
        course: Course::Manoeuvre(manoeuvre.to_owned()),
        road: None,
        vehicle: FileSource::Path("prowler".into()),
        sensors: FileSource::Path(sensors.into()),
        payload: Vec::new(),
        seed: 11,
        options: Options::default(),
        duration_s: None,
    }
}
