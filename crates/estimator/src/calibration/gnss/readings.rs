//! What is read when, and how the vehicle then moves.

use nalgebra::Vector3;

use super::GnssInput;
use crate::calibration::imu::ImuSignal;

/// Half of the time that a rate is averaged over, s.
const RATE_HALF_S: f64 = 0.025;

/// What is read when.
#[derive(Clone, Copy)]
pub(super) enum Reading {
    Velocity([f64; 3]),
    Attitude([f64; 3]),
}

/// All readings in the order of the instants that they are taken for.
pub(super) fn events(input: &GnssInput<'_>, latency_s: [f64; 2]) -> Vec<(f64, Reading)> {
    let velocity = input.velocity.time_s.iter().zip(input.velocity.value);
    let attitude = input.attitude.time_s.iter().zip(input.attitude.value);
    let finite = |value: &[f64; 3]| value.iter().all(|v| v.is_finite());
    let mut events: Vec<(f64, Reading)> = velocity
        .filter(|(_, value)| finite(value))
        .map(|(time_s, value)| (time_s - latency_s[0], Reading::Velocity(*value)))
        .chain(
            attitude
                .filter(|(_, value)| value[0].is_finite())
                .map(|(time_s, value)| (time_s - latency_s[1], Reading::Attitude(*value))),
        )
        .collect();
    events.sort_by(|a, b| a.0.total_cmp(&b.0));
    events
}

pub(super) fn first_attitude(events: &[(f64, Reading)]) -> (f64, [f64; 3]) {
    let mut attitudes = events.iter().filter_map(|(time_s, reading)| match reading {
        Reading::Attitude(angles) => Some((*time_s, *angles)),
        Reading::Velocity(_) => None,
    });
    attitudes.next().unwrap_or((0.0, [0.0; 3]))
}

/// Specific force and rate at `at_s`, linear between the samples `k` and `k + 1`.
pub(super) fn between(imu: &ImuSignal<'_>, k: usize, at_s: f64) -> (Vector3<f64>, Vector3<f64>) {
    let span_s = imu.time_s[k + 1] - imu.time_s[k];
    let part = ((at_s - imu.time_s[k]) / span_s).clamp(0.0, 1.0);
    let mix = |values: &[[f64; 3]]| {
        let (a, b) = (Vector3::from(values[k]), Vector3::from(values[k + 1]));
        a + (b - a) * part
    };
    (mix(imu.force_m_s2), mix(imu.rate_rad_s))
}

/// Rate, its derivative and specific force about an instant.
pub(super) struct Motion {
    pub(super) force: Vector3<f64>,
    pub(super) rate: Vector3<f64>,
    pub(super) rate_dot: Vector3<f64>,
}

impl Motion {
    pub(super) fn at(imu: &ImuSignal<'_>, time_s: f64) -> Self {
        let over = |from_s: f64, to_s: f64, values: &[[f64; 3]]| -> Vector3<f64> {
            Vector3::from_fn(|axis, _| {
                let first = imu.time_s.partition_point(|&t| t < from_s);
                let last = imu.time_s.partition_point(|&t| t <= to_s).max(first + 1);
                let rows = first.min(values.len() - 1)..last.min(values.len());
                let count = rows.len().max(1) as f64;
                rows.map(|k| values[k][axis]).sum::<f64>() / count
            })
        };
        let (before, after) = (time_s - 2.0 * RATE_HALF_S, time_s + 2.0 * RATE_HALF_S);
        Self {
            force: over(time_s - RATE_HALF_S, time_s + RATE_HALF_S, imu.force_m_s2),
            rate: over(time_s - RATE_HALF_S, time_s + RATE_HALF_S, imu.rate_rad_s),
            rate_dot: (over(time_s, after, imu.rate_rad_s) - over(before, time_s, imu.rate_rad_s))
                / (2.0 * RATE_HALF_S),
        }
    }
}
