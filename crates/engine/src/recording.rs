//! A log as the columns that calibration works on.

use std::path::Path;

use estimator::calibration::Recording;
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{ControlSample, LogTime, Wheel};
use store::{Reader, Record, Selection, Values};

use crate::{Config, Error, Result};

/// Topics that are read.
const TOPICS: [&str; 8] = [
    "/imu/*",
    "/gnss/*",
    "/strain",
    "/deflection",
    "/hub_acceleration",
    "/steer",
    "/wheel_speed",
    "/mark",
];

/// Topics of the steering and of what turns the wheels with the springs.
pub(crate) const STEERING: [&str; 2] = ["/steer", "/deflection"];

/// Reads the measurements and the marks of a log.
///
/// # Errors
/// If the log cannot be read, or its configuration names no vehicle.
pub fn read_recording(path: &Path) -> Result<Recording> {
    let reader = Reader::open([path])?;
    let config = Config::from_attachments(&reader.attachments()?);
    let config = config.map_err(|source| Error::InLog {
        path: path.to_owned(),
        source: Box::new(source),
    })?;
    let Some(estimator) = config.estimator else {
        return Err(Error::NoVehicleIn(path.to_owned()));
    };
    let loaded = estimator.vehicle.loaded(&estimator.settings.payload);
    let loaded = loaded.map_err(estimator::EstimatorError::from)?;
    let sensors = loaded.sensors(&estimator.sensors);
    let name = path.display().to_string();
    recording_of(&reader, &TOPICS, name, &loaded.vehicle, &sensors)
}

/// Reads measurements of some topics, those of controllers, and the marks among the topics, of a log.
pub(crate) fn recording_of<const N: usize>(
    reader: &Reader,
    topics: &[&str; N],
    name: String,
    vehicle: &Vehicle,
    sensors: &Sensors,
) -> Result<Recording> {
    let start = reader.info().span.map_or(LogTime(0), |span| span.0);
    let mut recording = Recording::new(name, vehicle.clone(), sensors.clone(), start);
    for message in reader.messages(Selection::topics(*topics)) {
        let message = message?;
        match message.record()? {
            Some(Record::Sample(sample)) => {
                recording.push(source_of(&message.channel.topic), &sample);
            }
            Some(Record::Mark { time, text }) => recording.mark(time, text),
            _ => {}
        }
    }
    read_controls(reader, &mut recording)?;
    Ok(recording)
}

/// Reads the temperatures of the bridges and the angles of the front wheels, which are values of controllers.
fn read_controls(reader: &Reader, recording: &mut Recording) -> Result<()> {
    let channels = reader.info().channels;
    for topic in channels
        .keys()
        .filter(|topic| topic.starts_with("/control/"))
    {
        let table = reader.table(topic, LogTime(0), LogTime(u64::MAX))?;
        for column in &table.columns {
            let corner = column.name.strip_prefix("bridge_temperature_");
            let wheel = corner.and_then(Wheel::from_abbreviation);
            let mut angles = ControlSample::WHEEL_ANGLE.iter();
            let side = angles.position(|name| *name == column.name);
            let Values::F64(values) = &column.values else {
                continue;
            };
            for (time_ns, value) in table.publish_time_ns.iter().zip(values) {
                let time = LogTime(u64::try_from(*time_ns).unwrap_or_default());
                match (wheel, side) {
                    (Some(wheel), _) => recording.push_temperature(time, wheel, *value),
                    (None, Some(side)) => recording.push_wheel_angle(time, side, *value),
                    (None, None) => break,
                }
            }
        }
    }
    Ok(())
}

/// The device's name in `/imu/<name>` and `/gnss/<name>/...`.
fn source_of(topic: &str) -> &str {
    topic.split('/').nth(2).unwrap_or_default()
}
