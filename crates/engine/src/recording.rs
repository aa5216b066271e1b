//! A log as the columns that calibration works on.

use std::path::Path;

use estimator::calibration::Recording;
use sample::{LogTime, Wheel};
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
    let start = reader.info().span.map_or(LogTime(0), |span| span.0);
    let name = path.display().to_string();
    let mut recording = Recording::new(name, loaded.vehicle, sensors, start);
    for message in reader.messages(Selection::topics(TOPICS)) {
        let message = message?;
        match message.record()? {
            Some(Record::Sample(sample)) => {
                recording.push(source_of(&message.channel.topic), &sample);
            }
            Some(Record::Mark { time, text }) => recording.mark(time, text),
            _ => {}
        }
    }
    read_temperatures(&reader, &mut recording)?;
    Ok(recording)
}

/// Reads the temperatures of the bridges, which are values of controllers.
fn read_temperatures(reader: &Reader, recording: &mut Recording) -> Result<()> {
    let channels = reader.info().channels;
    for topic in channels
        .keys()
        .filter(|topic| topic.starts_with("/control/"))
    {
        let table = reader.table(topic, LogTime(0), LogTime(u64::MAX))?;
        for column in &table.columns {
            let corner = column.name.strip_prefix("bridge_temperature_");
            let wheel = corner.and_then(Wheel::from_abbreviation);
            if let (Some(wheel), Values::F64(values)) = (wheel, &column.values) {
                for (time_ns, value) in table.publish_time_ns.iter().zip(values) {
                    let time = LogTime(u64::try_from(*time_ns).unwrap_or_default());
                    recording.push_temperature(time, wheel, *value);
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
