//! Simple methods on the samples of a log.

use estimator::simple::{Simple, simple_methods};
use sample::Sample;
use store::{Reader, Record, Selection};

use crate::{Config, Error, Result};

/// Topics of the samples that the methods use.
const TOPICS: [&str; 7] = [
    "/strain",
    "/deflection",
    "/wheel_speed",
    "/steer",
    "/imu/*",
    "/gnss/*",
    "/ground_speed/*",
];

/// Runs the simple methods over the samples of a log, with its own vehicle, sensors and calibration.
///
/// # Errors
/// If the log cannot be read, or its configuration has no vehicle.
pub fn simple_methods_of(reader: &Reader) -> Result<Simple> {
    let config = Config::from_attachments(&reader.attachments()?)?;
    let own = config.estimator.ok_or(Error::NoVehicle)?;
    let mut samples: Vec<Sample> = Vec::new();
    for message in reader.messages(Selection::topics(TOPICS)) {
        if let Some(Record::Sample(sample)) = message?.record()? {
            samples.push(sample);
        }
    }
    samples.sort_by_key(|sample| sample.log_time);
    let all = samples.into_iter();
    Ok(simple_methods(
        &own.vehicle,
        &own.sensors,
        &own.calibration,
        all,
    )?)
}
