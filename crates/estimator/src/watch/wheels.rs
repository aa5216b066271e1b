//! Monitor of wheel speeds. A wheel without drive or brake force rolls as fast as the ground
//! passes; a different reading is a fault. A locked or spinning wheel has a longitudinal force and
//! is not judged. A reading that does not change at all while the speed over ground changes is a fault,
//! too, however near it is.

use sample::{LogTime, PerWheel, Wheel};

use super::{CONTRADICTS, SensorChange, Stuck};
use crate::tuning::WheelWatchTuning;

/// Names, as events have them.
const NAMES: [&str; 4] = [
    "FL wheel speed",
    "FR wheel speed",
    "RL wheel speed",
    "RR wheel speed",
];

/// Monitor of the four wheels.
#[derive(Clone, Copy, Debug, Default)]
pub struct WheelWatch([One; 4]);

#[derive(Clone, Copy, Debug, Default)]
struct One {
    contradicted_since: Option<LogTime>,
    agreed: Option<LogTime>,
    faulty: bool,
    stuck: Stuck,
}

/// A wheel's reading with the speed and force of other sensors.
#[derive(Clone, Copy, Debug)]
pub struct Rolling {
    /// Angular speed by the sensor, rad/s.
    pub read_rad_s: f64,
    /// Rolling radius, m.
    pub radius_m: f64,
    /// Speed over ground, m/s.
    pub over_ground_m_s: f64,
    /// Its force, contact frame, N.
    pub force_n: [f64; 3],
}

impl Rolling {
    /// Whether the reading contradicts the speed over ground; `None` where slip can explain the
    /// difference.
    fn contradicts(&self, tuning: &WheelWatchTuning) -> Option<bool> {
        let [forward, _, load] = self.force_n;
        let apart = (self.read_rad_s * self.radius_m - self.over_ground_m_s).abs();
        let most = tuning.difference_m_s + tuning.difference_part * self.over_ground_m_s.abs();
        (load > 0.0 && forward.abs() < tuning.rolling_force * load).then_some(apart > most)
    }
}

impl WheelWatch {
    /// Whether a wheel's sensor is used.
    pub fn is_used(&self, wheel: Wheel) -> bool {
        !self.0[wheel.index()].faulty
    }

    /// Compares the readings at `now` with the speed over ground.
    pub fn judge(
        &mut self,
        now: LogTime,
        rolling: &PerWheel<Option<Rolling>>,
        tuning: &WheelWatchTuning,
        changes: &mut impl FnMut(SensorChange),
    ) {
        let verdicts: [Option<bool>; 4] = std::array::from_fn(|i| {
            let rolling = rolling.0[i]?;
            let stuck = self.0[i].stuck.take(
                rolling.read_rad_s,
                Some(rolling.over_ground_m_s).filter(|speed| speed.abs() > tuning.stuck_speed_m_s),
                tuning.stuck_readings,
                tuning.stuck_change_m_s,
            );
            let contradicts = rolling.contradicts(tuning)?;
            Some(contradicts || stuck)
        });
        let count = |verdict| verdicts.iter().filter(|v| **v == Some(verdict)).count();
        if count(true) > count(false) {
            // Most wheels contradict: the speed over ground is wrong.
            return;
        }
        for (i, one) in self.0.iter_mut().enumerate() {
            let Some(contradicted_since) = verdicts[i] else {
                continue;
            };
            let (held, other) = if contradicted_since {
                (&mut one.contradicted_since, &mut one.agreed)
            } else {
                (&mut one.agreed, &mut one.contradicted_since)
            };
            *other = None;
            let since = now.seconds_since(*held.get_or_insert(now));
            let span_s = if contradicted_since {
                tuning.faulty_s
            } else {
                tuning.good_s
            };
            if contradicted_since != one.faulty && since >= span_s {
                one.faulty = contradicted_since;
                changes(SensorChange {
                    name: NAMES[i],
                    faulty: contradicted_since,
                    why: CONTRADICTS,
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dead_sensor_is_named_and_a_locked_wheel_is_not() {
        let mut watch = WheelWatch::default();
        let mut faulty = Vec::new();
        for k in 0..300 {
            let dead = (50..150).contains(&k);
            let wheel = |read_rad_s, forward| {
                Some(Rolling {
                    read_rad_s,
                    radius_m: 1.0,
                    over_ground_m_s: 10.0,
                    force_n: [forward, 0.0, 1000.0],
                })
            };
            let rolling = PerWheel([
                wheel(if dead { 0.0 } else { 10.1 }, 20.0),
                wheel(if dead { 0.0 } else { 10.1 }, -800.0),
                wheel(9.0, 0.0),
                None,
            ]);
            let tuning = WheelWatchTuning::default();
            watch.judge(LogTime(10_000_000 * k), &rolling, &tuning, &mut |change| {
                faulty.push((k, change.name, change.faulty));
            });
            assert_eq!(watch.is_used(Wheel::FrontLeft), !(100..200).contains(&k));
        }
        assert_eq!(faulty, [(100, NAMES[0], true), (200, NAMES[0], false)]);
    }

    #[test]
    fn wheels_that_all_contradict_are_right() {
        let mut watch = WheelWatch::default();
        let wheel = |read_rad_s| {
            Some(Rolling {
                read_rad_s,
                radius_m: 1.0,
                over_ground_m_s: 3.0,
                force_n: [0.0, 0.0, 1000.0],
            })
        };
        let rolling = PerWheel([wheel(10.0), wheel(10.0), wheel(3.0), wheel(10.0)]);
        for k in 0..300 {
            let tuning = WheelWatchTuning::default();
            watch.judge(LogTime(10_000_000 * k), &rolling, &tuning, &mut |change| {
                panic!("{change:?}");
            });
        }
    }
}
