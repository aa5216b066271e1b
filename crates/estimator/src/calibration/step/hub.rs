//! Bias and axes of the hub accelerometers.

use sample::{PerWheel, Wheel};

use super::{Calibrated, Calibration};
use crate::EstimatorError;
use crate::calibration::gnss::Vectors;
use crate::calibration::hub::{self, HubLog};
use crate::calibration::recording::{Column, ImuColumns};
use crate::calibration::rest::Stretch;
use crate::calibration::{Recording, Resolved};

/// Columns of a recording with the calibration applied.
struct Columns {
    imu: ImuColumns,
    compression_m: PerWheel<Column>,
    steering_wheel_rad: Column,
    rest: Vec<Stretch>,
}

pub(super) fn hub(
    recordings: &[Recording],
    known: &Calibration,
) -> Result<Calibrated, EstimatorError> {
    let first = &recordings[0];
    let resolved = Resolved::new(&first.sensors, known)?;
    let mut columns = Vec::with_capacity(recordings.len());
    for recording in recordings {
        recording.require_imu()?;
        recording.require("hub acceleration", recording.has_hub_acceleration())?;
        columns.push(Columns {
            imu: recording.body_imu(&resolved),
            compression_m: recording.compression_m(&resolved),
            steering_wheel_rad: recording.steering_wheel_rad(&resolved),
            rest: recording.rest(),
        });
    }
    let logs: Vec<HubLog<'_>> = recordings
        .iter()
        .zip(&columns)
        .map(|(recording, columns)| HubLog {
            imu: columns.imu.signal(),
            imu_m: resolved.imu_m.into(),
            hub: PerWheel::from_fn(|wheel| Vectors {
                time_s: &recording.hub_acceleration[wheel].time_s,
                value: &recording.hub_acceleration[wheel].value,
            }),
            compression_m: PerWheel::from_fn(|wheel| columns.compression_m[wheel].signal()),
            steering_wheel_rad: columns.steering_wheel_rad.signal(),
            rest: &columns.rest,
        })
        .collect();
    let spec = first.sensors.hub_acceleration.as_ref();
    let spec = spec.ok_or_else(|| {
        EstimatorError::Sensors(format!(
            "{}: the sensors file \"{}\" has no table [hub_acceleration]; add it",
            first.name, first.sensors.name
        ))
    })?;
    let found = hub::hub(&first.vehicle, spec, &logs)?;
    let mut calibration = known.clone();
    for wheel in Wheel::ALL {
        if let Some(hub) = found.calibration[wheel] {
            let corner = calibration.corner.entry(wheel).or_default();
            corner.hub_acceleration = hub;
        }
    }
    Ok(Calibrated {
        calibration,
        findings: vec![found.findings],
    })
}
