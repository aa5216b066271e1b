//! Lever arms and delays of the receivers, and rolling radii by their velocity.

use super::{Calibrated, Calibration};
use crate::EstimatorError;
use crate::calibration::gnss::{self, GnssInput, Vectors, sigma_of};
use crate::calibration::recording::{self, Column};
use crate::calibration::wheel_radius::{self, RadiusInput};
use crate::calibration::{GnssCalibration, Recording, RecordingError, Resolved};

pub(super) fn gnss(
    recording: &Recording,
    known: &Calibration,
) -> Result<Calibrated, EstimatorError> {
    recording.require_imu()?;
    let resolved = Resolved::new(&recording.sensors, known)?;
    let imu = recording.body_imu(&resolved);
    let log = || recording.name.clone();
    let attitude = recording.attitude.iter().next();
    let (attitude_name, attitude) =
        attitude.ok_or_else(|| RecordingError::NoAttitude { log: log() })?;
    let sensors = &recording.sensors;
    let mut findings = Vec::new();
    let mut calibration = known.clone();
    for (name, velocity) in &recording.velocity {
        let is_attitude = name == attitude_name;
        let antenna_m = if is_attitude {
            let known = known.gnss_attitude.antenna_m;
            known.unwrap_or(sensors.gnss_attitude.antenna_m)
        } else {
            resolved.velocity_antenna_m.into()
        };
        let averaging_s = if is_attitude {
            1.0 / sensors.gnss_attitude.rate_hz
        } else {
            sensors.gnss_velocity.averaging_s
        };
        let receiver = gnss::gnss(&GnssInput {
            receiver: name,
            imu: imu.signal(),
            velocity: vectors(velocity),
            attitude: vectors(attitude),
            sigma: sigma_of(sensors),
            averaging_s,
            imu_sigma: [sensors.imu.accel_noise_m_s2, sensors.imu.gyro_noise_rad_s],
            imu_m: resolved.imu_m.into(),
            antenna_m,
        })?;
        if is_attitude {
            calibration.gnss_attitude.antenna_m = receiver.velocity.antenna_m;
        } else {
            calibration.gnss_velocity = receiver.velocity;
        }
        if !is_attitude || recording.velocity.len() == 1 {
            calibration.gnss_attitude = GnssCalibration {
                antenna_m: calibration.gnss_attitude.antenna_m,
                ..receiver.attitude
            };
        }
        findings.push(receiver.findings);
    }
    if findings.is_empty() {
        return Err(RecordingError::NoVelocity { log: log() }.into());
    }
    Ok(Calibrated {
        calibration,
        findings,
    })
}

pub(super) fn wheel_radius(
    recording: &Recording,
    known: &Calibration,
) -> Result<Calibrated, EstimatorError> {
    recording.require_imu()?;
    let turning = recording.wheel_speed.0.iter().any(Column::is_known);
    recording.require("wheel speed", turning)?;
    let resolved = Resolved::new(&recording.sensors, known)?;
    let imu = recording.body_imu(&resolved);
    let velocity = fastest(recording).ok_or_else(|| RecordingError::NoVelocity {
        log: recording.name.clone(),
    })?;
    let speeds: Vec<_> = recording.wheel_speed.0.iter().map(|c| c.signal()).collect();
    let found = wheel_radius::wheel_radius(&RadiusInput {
        velocity: vectors(velocity),
        latency_s: resolved.velocity_latency_s,
        imu: imu.signal(),
        wheels_rad_s: [speeds[0], speeds[1], speeds[2], speeds[3]],
    })?;
    let mut calibration = known.clone();
    for (wheel, radius_m) in found.radius_m {
        let corner = calibration.corner.entry(wheel).or_default();
        corner.rolling_radius_m = Some(radius_m);
    }
    Ok(Calibrated {
        calibration,
        findings: vec![found.findings],
    })
}

/// Receiver with the most velocities.
fn fastest(recording: &Recording) -> Option<&recording::Vectors> {
    let receivers = recording.velocity.values();
    receivers.max_by_key(|velocity| velocity.time_s.len())
}

fn vectors(columns: &recording::Vectors) -> Vectors<'_> {
    Vectors {
        time_s: &columns.time_s,
        value: &columns.value,
    }
}
