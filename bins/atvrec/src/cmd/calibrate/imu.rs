//! `atvrec calibrate imu`: bias and misalignment of the inertial unit.

use estimator::calibration::Resolved;
use estimator::calibration::imu::{ImuLog, imu};
use estimator::calibration::zero::rest_roll_pitch_rad;
use estimator::finding::Findings;

use super::Bench;
use super::recording::Column;

pub fn run(bench: &mut Bench) -> anyhow::Result<Vec<Findings>> {
    for recording in &bench.recordings {
        recording.require_imu()?;
    }
    let resolved = Resolved::new(&bench.recordings[0].sensors, &bench.calibration)?;
    let rests: Vec<_> = bench.recordings.iter().map(|r| r.rest()).collect();
    let speeds: Vec<Column> = bench.recordings.iter().map(|r| r.rolling_speed()).collect();
    let recordings = bench.recordings.iter();
    let leans: Vec<[Column; 2]> = recordings.map(|r| r.lean(&resolved)).collect();
    let logs: Vec<ImuLog<'_>> = bench
        .recordings
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
    let standing = rest_roll_pitch_rad(&bench.recordings[0].vehicle)?;
    let found = imu(&logs, standing, &bench.calibration)?;
    bench.calibration.imu = found.calibration;
    Ok(vec![found.findings])
}
