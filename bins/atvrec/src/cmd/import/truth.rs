//! Measurements of a reference instrument, interpolated at the times of the estimates.

use std::collections::BTreeMap;

use estimator::GRID_NANOS;
use sample::{LogTime, Motion, PerWheel, TyreForce, Wheel};
use store::Record;
use wire::column::Truth;

/// Longest interval of a reference channel over which values are interpolated: as a multiple of the
/// median interval, and in ns.
const INTERPOLATED_FACTOR: u64 = 3;
const INTERPOLATED_MAX_NS: u64 = 500_000_000;

/// Channels of a reference, each in the order of time.
#[derive(Default)]
pub struct Reference {
    channels: BTreeMap<Truth, Vec<(LogTime, f64)>>,
}

/// Values of the reference at one time.
pub struct TruthPoint {
    /// Time.
    pub time: LogTime,
    values: BTreeMap<Truth, f64>,
}

impl Reference {
    /// Adds a value.
    pub fn push(&mut self, truth: Truth, time: LogTime, value: f64) {
        self.channels.entry(truth).or_default().push((time, value));
    }

    /// All channels at the times of the estimator's grid, by linear interpolation between adjacent
    /// values.
    pub fn on_grid(mut self) -> Vec<TruthPoint> {
        let mut points: BTreeMap<u64, BTreeMap<Truth, f64>> = BTreeMap::new();
        for (truth, channel) in &mut self.channels {
            channel.sort_by_key(|(time, _)| *time);
            let limit = interpolated_max_ns(channel);
            for pair in channel.windows(2) {
                let [(t0, v0), (t1, v1)] = [pair[0], pair[1]];
                let step = t1.0 - t0.0;
                if step == 0 || step > limit {
                    continue;
                }
                let mut grid = t0.0.div_ceil(GRID_NANOS) * GRID_NANOS;
                while grid <= t1.0 {
                    let part = (grid - t0.0) as f64 / step as f64;
                    let value = v0 + part * (v1 - v0);
                    points.entry(grid).or_default().insert(*truth, value);
                    grid += GRID_NANOS;
                }
            }
        }
        points
            .into_iter()
            .map(|(time, values)| TruthPoint {
                time: LogTime(time),
                values,
            })
            .collect()
    }
}

fn interpolated_max_ns(channel: &[(LogTime, f64)]) -> u64 {
    let mut steps: Vec<u64> = channel.windows(2).map(|p| p[1].0.0 - p[0].0.0).collect();
    steps.sort_unstable();
    let usual = steps.get(steps.len() / 2).copied().unwrap_or(0);
    (INTERPOLATED_FACTOR * usual).min(INTERPOLATED_MAX_NS)
}

impl TruthPoint {
    /// Record of `/truth/…`; quantities that the reference does not measure are NaN.
    pub fn record(&self) -> Record {
        let get = |truth| self.values.get(&truth).copied().unwrap_or(f64::NAN);
        let forward = get(Truth::ForwardSpeed);
        let (mut sideslip, mut leftward) = (get(Truth::Sideslip), get(Truth::LeftwardSpeed));
        if sideslip.is_nan() && math::hypot(forward, leftward) > 0.0 {
            sideslip = math::atan2(leftward, forward);
        } else if leftward.is_nan() {
            leftward = forward * math::tan(sideslip);
        }
        let motion = Motion {
            velocity_x_m_s: forward,
            velocity_y_m_s: leftward,
            sideslip_rad: sideslip,
            roll_rad: get(Truth::Roll),
            pitch_rad: get(Truth::Pitch),
            rate_rad_s: [f64::NAN, f64::NAN, get(Truth::YawRate)],
            ..Motion::UNKNOWN
        };
        let forces = PerWheel::from_fn(|wheel: Wheel| TyreForce {
            force_n: [0, 1, 2].map(|axis| get(Truth::Force(wheel, axis))),
            ..TyreForce::default()
        });
        Record::Truth(Box::new(store::Truth {
            time: self.time,
            motion,
            carrier: Some(forces),
            contact: None,
            ground: None,
            pose: None,
            friction: None,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_interpolated_on_the_grid_but_not_over_gaps() {
        let mut reference = Reference::default();
        let ms = |ms: u64| LogTime(ms * 1_000_000);
        for (time, value) in [(5, 0.5), (25, 2.5), (45, 4.5), (600, 60.0), (620, 62.0)] {
            reference.push(Truth::Sideslip, ms(time), value);
        }
        let points = reference.on_grid();
        let found: Vec<u64> = points.iter().map(|p| p.time.0 / 1_000_000).collect();
        assert_eq!(found, [10, 20, 30, 40, 600, 610, 620]);
        let Record::Truth(truth) = points[0].record() else {
            panic!("a truth");
        };
        let (motion, forces) = (truth.motion, truth.carrier.expect("forces"));
        assert!((motion.sideslip_rad - 1.0).abs() < 1e-12);
        assert!(motion.roll_rad.is_nan() && forces[Wheel::FrontLeft].force_n[2].is_nan());
    }
}
