//! A drive that the tests change, and what identification makes of its log.

use estimator::identification::{Identified, Method};
use sim::Options;
use store::Reader;

use super::simulate;
use crate::output::{Kind, Target};
use crate::virtual_drive::{Course, Drive};
use crate::{Config, FileSource, VirtualDrive, Window, read_drive};

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

/// Applies a method to the log of a drive that was recorded with a configuration.
pub fn identified(mut simulated: VirtualDrive, config: &Config, method: &Method) -> Identified {
    let folder = tempfile::tempdir().expect("a directory");
    let path = folder.path().join("drive.mcap");
    let target = Target::new(&path, Kind::Log, false, []).expect("a target");
    let session = simulated.session(config);
    let mut log = target
        .log(session, config.storage.options.clone())
        .expect("a log");
    simulate(&mut simulated, config, |entry| log.push(entry)).expect("a simulation");
    log.finish().expect("a log");
    let reader = Reader::open([&path]).expect("the log");
    let recorded = read_drive(&reader, None, Window::default(), method).expect("a drive");
    method.identify(&recorded, 1).expect("a result")
}
