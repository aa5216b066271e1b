//! `atvrec calibrate gnss` and `wheel-radius`.

use anyhow::Context;
use estimator::calibration::gnss::{GnssInput, Vectors, gnss, sigma_of};
use estimator::calibration::wheel_radius::{RadiusInput, wheel_radius};
use estimator::calibration::{GnssCalibration, Resolved};
use estimator::finding::Findings;

use super::recording::{self, Column, Recording};
use super::{Bench, one_log};

pub fn run(bench: &mut Bench) -> anyhow::Result<Vec<Findings>> {
    let recording = one_log(&bench.recordings, "gnss")?;
    recording.require_imu()?;
    let resolved = Resolved::new(&recording.sensors, &bench.calibration)?;
    let imu = recording.body_imu(&resolved);
    let (attitude_name, attitude) = recording.attitude.iter().next().with_context(|| {
        format!(
            "{}: the log has no GNSS attitude, so that the heading is unknown; record the attitude \
             receiver in the same drive",
            recording.path.display()
        )
    })?;
    let sensors = &recording.sensors;
    let mut results = Vec::new();
    let mut found = bench.calibration.clone();
    for (name, velocity) in &recording.velocity {
        let is_attitude = name == attitude_name;
        let antenna_m = if is_attitude {
            let known = bench.calibration.gnss_attitude.antenna_m;
            known.unwrap_or(sensors.gnss_attitude.antenna_m)
        } else {
            resolved.velocity_antenna_m.into()
        };
        let averaging_s = if is_attitude {
            1.0 / sensors.gnss_attitude.rate_hz
        } else {
            sensors.gnss_velocity.averaging_s
        };
        let receiver = gnss(&GnssInput {
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
            found.gnss_attitude.antenna_m = receiver.velocity.antenna_m;
        } else {
            found.gnss_velocity = receiver.velocity;
        }
        if !is_attitude || recording.velocity.len() == 1 {
            found.gnss_attitude = GnssCalibration {
                antenna_m: found.gnss_attitude.antenna_m,
                ..receiver.attitude
            };
        }
        results.push(receiver.findings);
    }
    anyhow::ensure!(
        !results.is_empty(),
        "{}: the log has no GNSS velocity; record a receiver with velocity",
        recording.path.display()
    );
    bench.calibration = found;
    Ok(results)
}

/// `atvrec calibrate wheel-radius`.
pub fn wheels(bench: &mut Bench) -> anyhow::Result<Vec<Findings>> {
    let recording = one_log(&bench.recordings, "wheel-radius")?;
    recording.require_imu()?;
    let turning = recording.wheel_speed.0.iter().any(Column::is_known);
    recording.require("wheel speed", turning)?;
    let resolved = Resolved::new(&recording.sensors, &bench.calibration)?;
    let imu = recording.body_imu(&resolved);
    let velocity = fastest(recording).with_context(|| {
        format!(
            "{}: the log has no GNSS velocity; record a receiver with velocity",
            recording.path.display()
        )
    })?;
    let speeds: Vec<_> = recording.wheel_speed.0.iter().map(|c| c.signal()).collect();
    let found = wheel_radius(&RadiusInput {
        velocity: vectors(velocity),
        latency_s: resolved.velocity_latency_s,
        imu: imu.signal(),
        wheels_rad_s: [speeds[0], speeds[1], speeds[2], speeds[3]],
    })?;
    for (wheel, radius_m) in found.radius_m {
        let corner = bench.calibration.corner.entry(wheel).or_default();
        corner.rolling_radius_m = Some(radius_m);
    }
    Ok(vec![found.findings])
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
