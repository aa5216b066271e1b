//! Whether the gyros can be believed. A rate that jumps further than a vehicle can turn, to where
//! the balance of moments of all tyres contradicts it, is replaced by what that balance makes of the
//! last rate until both agree again, so that neither attitude nor forces follow a gyro that spikes,
//! is plugged in wrong or sits at the end of its range. Forces that are wrong themselves make no gyro
//! jump.

use nalgebra::Vector3;

/// Axes, as events name them.
pub const AXES: [&str; 3] = ["roll rate", "pitch rate", "yaw rate"];

/// Rate that the balance of moments does not tell, rad/s/sqrt(Hz): of attitude that is carried on
/// without a gyro.
const UNTOLD_RATE: f64 = 0.1;
/// Change from one reading to the next that is no vehicle's, rad/s in 10 ms.
const JUMP_RAD_S: f64 = 0.25;
/// Square of the normalised difference that contradicts.
const GATE: f64 = 25.0;
/// Readings in a row, 100 a second, that make a fault of it, and after which the forces may as well
/// be what is wrong.
const FAULTY: u32 = 20;
const DOUBTFUL: u32 = 500;

/// Memory of one axis.
#[derive(Clone, Copy, Debug, Default)]
struct Axis {
    /// The last reading that was believed.
    last: Option<f64>,
    /// Readings in a row that were not.
    strange: u32,
}

/// Memory of the three axes.
#[derive(Clone, Debug, Default)]
pub struct GyroWatch([Axis; 3]);

impl GyroWatch {
    /// Which axes of the last reading were believed.
    pub fn believed(&self) -> [bool; 3] {
        self.0.map(|axis| axis.strange == 0)
    }

    /// What is unseen of the last rate that was handed out, rad/s/sqrt(Hz).
    pub fn untold_rate(&self) -> f64 {
        if self.believed() == [true; 3] {
            0.0
        } else {
            UNTOLD_RATE
        }
    }

    /// The rate to go on with, rad/s, from a reading of noise `sigma` and what is expected of each
    /// axis as value and variance. Tells axes that are found faulty (`true`) or good again.
    pub fn judge(
        &mut self,
        reading: Vector3<f64>,
        sigma: f64,
        expected: Option<[[f64; 2]; 3]>,
        changes: &mut impl FnMut(usize, bool),
    ) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| {
            let memory = &mut self.0[axis];
            let before = memory.strange;
            let expected = expected.map(|all| all[axis]);
            let told = memory.judge(reading[axis], sigma, expected);
            if memory.strange == FAULTY {
                changes(axis, true);
            } else if memory.strange == 0 && before >= FAULTY {
                changes(axis, false);
            }
            told
        })
    }
}

impl Axis {
    fn judge(&mut self, reading: f64, sigma: f64, expected: Option<[f64; 2]>) -> f64 {
        let contradicted = expected.filter(|[value, variance]| {
            let apart = reading - value;
            apart * apart > GATE * (variance + sigma * sigma)
        });
        let jumped = self
            .last
            .is_some_and(|last| (reading - last).abs() > JUMP_RAD_S);
        match contradicted {
            Some([value, _]) if (self.strange > 0 || jumped) && self.strange < DOUBTFUL => {
                self.strange += 1;
                value
            }
            _ => {
                self.strange = 0;
                self.last = Some(reading);
                reading
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wild_axis_is_replaced_named_and_taken_back() {
        let mut watch = GyroWatch::default();
        let mut told = Vec::new();
        let expected = Some([[0.1, 1e-4], [0.0, 1e-4], [0.3, 1e-4]]);
        for k in 0..200 {
            let wild = if (50..100).contains(&k) { 3.5 } else { 0.1 };
            let reading = Vector3::new(wild, 0.01, 0.31);
            let rate = watch.judge(reading, 0.005, expected, &mut |axis, faulty| {
                told.push((k, axis, faulty));
            });
            assert_eq!(rate.z, 0.31);
            assert_eq!(rate.x, 0.1, "{k}");
        }
        assert_eq!(watch.believed(), [true; 3]);
        assert_eq!(told, [(69, 0, true), (100, 0, false)]);
        let wild = Vector3::repeat(9.0);
        assert_eq!(watch.judge(wild, 0.005, None, &mut |_, _| {}), wild);
    }

    #[test]
    fn forces_that_go_wrong_by_themselves_spoil_no_rate() {
        let mut watch = GyroWatch::default();
        for k in 0..400 {
            let wrong = 0.01 * f64::from(k);
            let reading = Vector3::repeat(0.001 * f64::from(k));
            let rate = watch.judge(reading, 0.005, Some([[wrong, 1e-4]; 3]), &mut |_, _| {});
            assert_eq!(rate, reading);
        }
    }
}
