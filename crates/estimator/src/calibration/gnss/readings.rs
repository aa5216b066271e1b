//! What is read when, and how the vehicle then moves.

use std::ops::Range;

use nalgebra::Vector3;

use super::GnssInput;
use crate::calibration::imu::ImuSignal;

/// Half of the time that a rate is averaged over where the receiver averages over less, s.
const SHORTEST_HALF_S: f64 = 0.0125;
/// Time to either side that a rate's derivative is taken over, s.
const DERIVATIVE_S: f64 = 0.05;

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
    /// Mean over the receiver's averaging.
    pub(super) rate: Vector3<f64>,
    /// Readings that this mean holds.
    pub(super) rate_readings: f64,
    pub(super) rate_dot: Vector3<f64>,
    /// What the receiver's averaging adds to the velocity of the inertial unit, m/s.
    pub(super) rounding: Vector3<f64>,
}

impl Motion {
    /// Around `time_s`, as a receiver feels it that averages over `averaging_s`:
    ///
    /// mean of v(t + s) over |s| < h = v(t) + 1/(2h) integral of (h - s) (a(t + s) - a(t - s)) ds
    ///
    /// with s from 0 to h.
    pub(super) fn at(imu: &ImuSignal<'_>, time_s: f64, averaging_s: f64) -> Self {
        let rows = |from_s: f64, to_s: f64| {
            let first = imu.time_s.partition_point(|&t| t < from_s);
            let last = imu.time_s.partition_point(|&t| t <= to_s).max(first + 1);
            first.min(imu.time_s.len() - 1)..last.min(imu.time_s.len())
        };
        let over = |rows: Range<usize>, values: &[[f64; 3]], weight: &dyn Fn(usize) -> f64| {
            let weights: f64 = rows.clone().map(weight).sum();
            let sum: Vector3<f64> = rows.map(|k| Vector3::from(values[k]) * weight(k)).sum();
            sum / weights.max(f64::MIN_POSITIVE)
        };
        let even = |_: usize| 1.0;
        let half_s = (0.5 * averaging_s).max(SHORTEST_HALF_S);
        let around = rows(time_s - half_s, time_s + half_s);
        let (before_s, after_s) = (time_s - DERIVATIVE_S, time_s + DERIVATIVE_S);
        let change = over(rows(time_s, after_s), imu.rate_rad_s, &even)
            - over(rows(before_s, time_s), imu.rate_rad_s, &even);
        let near = |k: usize| (half_s - (imu.time_s[k] - time_s).abs()).max(0.0);
        let sides = over(rows(time_s, time_s + half_s), imu.force_m_s2, &near)
            - over(rows(time_s - half_s, time_s), imu.force_m_s2, &near);
        Self {
            force: over(around.clone(), imu.force_m_s2, &even),
            rate: over(around.clone(), imu.rate_rad_s, &even),
            rate_readings: around.len() as f64,
            rate_dot: change / DERIVATIVE_S,
            rounding: sides * (averaging_s / 8.0),
        }
    }
}
