//! Monitor of the hub accelerometers' axes: over some seconds the mean specific force is gravity, which
//! must show on the upward axis.

use sample::{LogTime, PerWheel, Wheel};

use crate::calibration::hub::WrongAxes;
use crate::tuning::HubWatchTuning;

/// Monitor of all hub accelerometers.
#[derive(Clone, Copy, Debug, Default)]
pub struct HubWatch(PerWheel<Block>);

/// Readings of one sensor since the last judgement.
#[derive(Clone, Copy, Debug, Default)]
struct Block {
    begin: Option<LogTime>,
    sum: [f64; 3],
    count: [f64; 3],
    wrong: bool,
}

impl HubWatch {
    /// Takes readings of a sensor, sensor axes, m/s^2. `changes` gets the wheel and, for a sensor that
    /// was found to be mounted turned, what is wrong; `None` for one that is right again.
    pub fn judge(
        &mut self,
        time: LogTime,
        wheel: Wheel,
        axes_m_s2: [Option<f64>; 3],
        tuning: &HubWatchTuning,
        changes: &mut impl FnMut(Wheel, Option<WrongAxes>),
    ) {
        let block = &mut self.0[wheel];
        for (axis, value) in axes_m_s2.into_iter().enumerate() {
            if let Some(value) = value {
                block.sum[axis] += value;
                block.count[axis] += 1.0;
            }
        }
        let begin = *block.begin.get_or_insert(time);
        if time.seconds_since(begin) < tuning.block_s {
            return;
        }
        let mean = std::array::from_fn(|axis| {
            let count = block.count[axis];
            (count >= tuning.readings_min).then(|| block.sum[axis] / count)
        });
        let found = WrongAxes::find(wheel, mean);
        let known = mean.iter().any(Option::is_some);
        if known && found.is_some() != block.wrong {
            changes(wheel, found);
        }
        let wrong = if known { found.is_some() } else { block.wrong };
        *block = Block {
            wrong,
            ..Block::default()
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_sensor_is_reported_once_and_again_when_it_is_right() {
        let mut watch = HubWatch::default();
        let mut told = Vec::new();
        for k in 0..3000_u64 {
            // Turned for the first ten seconds; hops of 5 Hz all the time.
            let hop = 30.0 * math::sin(0.314 * k as f64);
            let axes = if k < 1000 {
                [Some(0.1), Some(9.8 + hop), Some(0.2)]
            } else {
                [Some(0.1), Some(-0.2), Some(9.8 + hop)]
            };
            let tuning = HubWatchTuning::default();
            let time = LogTime(10_000_000 * k);
            watch.judge(time, Wheel::RearLeft, axes, &tuning, &mut |wheel, wrong| {
                told.push((k, wheel, wrong.map(|wrong| wrong.axis)));
            });
        }
        assert_eq!(told.len(), 2, "{told:?}");
        assert_eq!((told[0].1, told[0].2), (Wheel::RearLeft, Some(1)));
        assert!(told[0].0 <= 400 && told[1].0 <= 1700, "{told:?}");
        assert_eq!(told[1].2, None);
    }
}
