//! What is read when, and how the vehicle then moves.

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
        let even = |_: f64| 1.0;
        let half_s = (0.5 * averaging_s).max(SHORTEST_HALF_S);
        let around = Mean::over(imu, time_s - half_s, time_s + half_s, &even);
        let before = Mean::over(imu, time_s - DERIVATIVE_S, time_s, &even);
        let after = Mean::over(imu, time_s, time_s + DERIVATIVE_S, &even);
        let near = |at_s: f64| half_s - (at_s - time_s).abs();
        let sides = Mean::over(imu, time_s, time_s + half_s, &near).force
            - Mean::over(imu, time_s - half_s, time_s, &near).force;
        Self {
            force: around.force,
            rate: around.rate,
            rate_readings: around.readings,
            rate_dot: (after.rate - before.rate) / DERIVATIVE_S,
            rounding: sides * (averaging_s / 8.0),
        }
    }
}

/// Weighted means over a stretch of time of what runs linearly from sample to sample.
#[derive(Default)]
struct Mean {
    force: Vector3<f64>,
    rate: Vector3<f64>,
    /// How many samples, evenly weighted, would be as certain.
    readings: f64,
}

impl Mean {
    fn over(imu: &ImuSignal<'_>, from_s: f64, to_s: f64, weight: &dyn Fn(f64) -> f64) -> Self {
        let last = imu.time_s.len() - 2;
        let first = imu.time_s.partition_point(|&t| t <= from_s).max(1) - 1;
        let mut mean = Self::default();
        // Of the sample before, of all, and of their squares.
        let (mut shared, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for k in first.min(last)..=last {
            let (begin_s, end_s) = (imu.time_s[k].max(from_s), imu.time_s[k + 1].min(to_s));
            if end_s <= begin_s {
                break;
            }
            let middle_s = 0.5 * (begin_s + end_s);
            let own = weight(middle_s) * (end_s - begin_s);
            let (force, rate) = between(imu, k, middle_s);
            mean.force += force * own;
            mean.rate += rate * own;
            let part = (middle_s - imu.time_s[k]) / (imu.time_s[k + 1] - imu.time_s[k]);
            let of_first: f64 = shared + own * (1.0 - part);
            squares += of_first * of_first;
            shared = own * part;
            sum += own;
        }
        squares += shared * shared;
        let sum = f64::max(sum, f64::MIN_POSITIVE);
        mean.force /= sum;
        mean.rate /= sum;
        mean.readings = sum * sum / f64::max(squares, f64::MIN_POSITIVE);
        mean
    }
}
