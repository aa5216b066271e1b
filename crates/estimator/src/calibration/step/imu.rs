//! Biases and misalignment of the inertial unit.

use super::{Calibrated, Calibration};
use crate::EstimatorError;
use crate::calibration::imu::{self, ImuLog};
use crate::calibration::recording::Column;
use crate::calibration::zero::rest_roll_pitch_rad;
use crate::calibration::{Recording, Resolved};

pub(super) fn imu(
    recordings: &[Recording],
    known: &Calibration,
) -> Result<Calibrated, EstimatorError> {
    for recording in recordings {
        recording.require_imu()?;
    }
    let resolved = Resolved::new(&recordings[0].sensors, known)?;
    let rests: Vec<_> = recordings.iter().map(Recording::rest).collect();
    let speeds: Vec<Column> = recordings.iter().map(Recording::rolling_speed).collect();
    let leans: Vec<[Column; 2]> = recordings.iter().map(|r| r.lean(&resolved)).collect();
    let logs: Vec<ImuLog<'_>> = recordings
        .iter()
        .zip(&rests)
        .zip(speeds.iter().zip(&leans))
        .map(|((recording, rest), (speed, lean))| ImuLog {
            imu: recording.imu_signal(),
            speed_m_s: speed.signal(),
            lean_rad: [lean[0].signal(), lean[1].signal()],
            rest,
        })
        .collect();
    let standing = rest_roll_pitch_rad(&recordings[0].vehicle)?;
    let found = imu::imu(&logs, standing, known)?;
    Ok(Calibrated {
        calibration: Calibration {
            imu: found.calibration,
            ..known.clone()
        },
        findings: vec![found.findings],
    })
}
