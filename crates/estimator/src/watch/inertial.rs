//! Monitor of gyros and accelerometers.
//!
//! A reading that jumps further than a vehicle can move and that the balance of moments or forces
//! contradicts is replaced by the value of the balance until both agree again. So attitude,
//! velocity and forces do not follow an axis with spikes, with a wrong connection, or in
//! saturation. A jump is required because wrong forces do not make a sensor jump. An axis that is
//! stuck while the vehicle moves is replaced at once: the force filter follows a gyro too closely
//! to contradict a constant one.

use nalgebra::Vector3;

use super::{BAD, CONTRADICTS, SensorChange};
use crate::gaussian::{Gaussian, beyond};
use crate::triads::{Triads, UsedAxes};
use crate::tuning::InertialWatchTuning;

/// What differs between gyros and accelerometers.
#[derive(Clone, Copy, Debug)]
struct Kind {
    names: [&'static str; 3],
    /// Change between two readings (10 ms) that no vehicle makes.
    jump: f64,
    /// Standard deviation of the balance of each axis, beyond its own variance.
    floor: [f64; 3],
    /// Consecutive rejected readings after which the forces can be wrong instead.
    rejections_max: u32,
    /// Consecutive consistent readings of a faulty axis before it is used again: an axis with a
    /// wrong connection agrees by chance for a moment.
    good_readings: u32,
    /// Density of the error of the balance, per √Hz.
    replaced_density: f64,
}

impl Kind {
    /// Of gyros, rad/s. An attitude that is propagated without a gyro has the error of the moments.
    fn rates(tuning: &InertialWatchTuning) -> Self {
        Self {
            names: RATE_NAMES,
            jump: tuning.gyro_jump_rad_s,
            floor: [0.0; 3],
            rejections_max: tuning.gyro_rejections_max,
            good_readings: 0,
            replaced_density: tuning.gyro_replaced_density,
        }
    }

    /// Of accelerometers, m/s². The forces never count as wrong, however long they contradict.
    fn forces(tuning: &InertialWatchTuning) -> Self {
        Self {
            names: FORCE_NAMES,
            jump: tuning.accel_jump_m_s2,
            floor: tuning.accel_balance_sigma_m_s2,
            rejections_max: u32::MAX,
            good_readings: tuning.accel_good_readings,
            replaced_density: tuning.accel_replaced_density,
        }
    }
}

const RATE_NAMES: [&str; 3] = [
    "inertial unit roll rate",
    "inertial unit pitch rate",
    "inertial unit yaw rate",
];

const FORCE_NAMES: [&str; 3] = [
    "inertial unit forward acceleration",
    "inertial unit leftward acceleration",
    "inertial unit upward acceleration",
];

/// Monitor of one axis.
#[derive(Clone, Copy, Debug, Default)]
struct Axis {
    /// The last reading and the number of its repeats.
    read: f64,
    repeats: u32,
    /// The last reading that was used.
    last: Option<f64>,
    /// Consecutive rejected readings.
    rejected: u32,
    /// Consecutive consistent readings of a faulty axis.
    agreed: u32,
    /// Remaining readings for which an axis that was faulty is suspect.
    suspect: u32,
}

/// Monitor of the inertial unit.
#[derive(Clone, Debug, Default)]
pub struct InertialWatch {
    tuning: InertialWatchTuning,
    rate: [Axis; 3],
    force: [Axis; 3],
    /// Consecutive readings that the unit marks as invalid.
    bad: u32,
}

/// The whole unit's name.
const UNIT: &str = "inertial unit";

impl InertialWatch {
    /// A monitor that has seen nothing.
    pub fn new(tuning: InertialWatchTuning) -> Self {
        Self {
            tuning,
            ..Self::default()
        }
    }

    /// Counts a reading that the unit marks as invalid: its self test failed, or an axis is out of
    /// range.
    pub fn invalid_reading(&mut self, changes: &mut impl FnMut(SensorChange)) {
        self.bad = self.bad.saturating_add(1);
        if self.bad == self.tuning.faulty_readings {
            changes(SensorChange {
                name: UNIT,
                faulty: true,
                why: BAD,
            });
        }
    }

    /// Which axes of the last reading were used.
    pub fn used(&self) -> UsedAxes {
        Triads {
            rate: self.rate.map(|axis| axis.rejected == 0),
            force: self.force.map(|axis| axis.rejected == 0),
        }
    }

    /// Clears the suspicion of axes that are not faulty: their readings have jumped because a bias
    /// has.
    pub fn clear_suspicion(&mut self) {
        for axis in self.rate.iter_mut().chain(&mut self.force) {
            if axis.rejected < self.tuning.faulty_readings {
                (axis.suspect, axis.rejected) = (0, 0);
            }
        }
    }

    /// Density of the error of each replaced axis of the last reading, (rad/s)/√Hz and (m/s²)/√Hz;
    /// zero for a used axis.
    pub fn replaced_density(&self) -> Triads<[f64; 3]> {
        let of = |used: [bool; 3], kind: &Kind| {
            used.map(|used| if used { 0.0 } else { kind.replaced_density })
        };
        let used = self.used();
        Triads {
            rate: of(used.rate, &Kind::rates(&self.tuning)),
            force: of(used.force, &Kind::forces(&self.tuning)),
        }
    }

    /// The reading to use, from `reading` with noise `sigma` and `bias`, and from the expected
    /// values without bias.
    pub fn judge(
        &mut self,
        reading: Triads<Vector3<f64>>,
        bias: Triads<Vector3<f64>>,
        sigma: Triads<f64>,
        expected: &Triads<Option<[Gaussian; 3]>>,
        changes: &mut impl FnMut(SensorChange),
    ) -> Triads<Vector3<f64>> {
        if std::mem::take(&mut self.bad) >= self.tuning.faulty_readings {
            changes(SensorChange {
                name: UNIT,
                faulty: false,
                why: BAD,
            });
        }
        // While a vehicle moves, every axis of a good unit changes.
        let moving = expected.force.is_some();
        let tuning = self.tuning;
        let [rates, forces] = [Kind::rates(&tuning), Kind::forces(&tuning)];
        let mut judge = |axes: &mut [Axis; 3], kind, reading, bias, sigma, expected| {
            let expected = Expected { expected, moving };
            let limits = (&tuning, kind);
            judge_all(
                axes,
                limits,
                [reading, bias],
                sigma,
                expected,
                &mut *changes,
            )
        };
        Triads {
            rate: judge(
                &mut self.rate,
                &rates,
                reading.rate,
                bias.rate,
                sigma.rate,
                expected.rate,
            ),
            force: judge(
                &mut self.force,
                &forces,
                reading.force,
                bias.force,
                sigma.force,
                expected.force,
            ),
        }
    }
}

/// Expected values of three axes.
#[derive(Clone, Copy, Debug)]
struct Expected {
    /// Expected value of each axis.
    expected: Option<[Gaussian; 3]>,
    /// Whether the vehicle moves, so that constant readings are stuck.
    moving: bool,
}

fn judge_all(
    axes: &mut [Axis; 3],
    (tuning, kind): (&InertialWatchTuning, &Kind),
    [reading, bias]: [Vector3<f64>; 2],
    sigma: f64,
    Expected { expected, moving }: Expected,
    changes: &mut impl FnMut(SensorChange),
) -> Vector3<f64> {
    Vector3::from_fn(|i, _| {
        let axis = &mut axes[i];
        let before = axis.rejected;
        let doubt = sigma * sigma + kind.floor[i].powi(2);
        let expected =
            expected.map(|all| Gaussian::new(all[i].mean + bias[i], all[i].variance + doubt));
        let used = axis.judge(reading[i], expected, moving, (tuning, kind));
        let change = |faulty| SensorChange {
            name: kind.names[i],
            faulty,
            why: CONTRADICTS,
        };
        if axis.rejected == tuning.faulty_readings && before < tuning.faulty_readings {
            changes(change(true));
        } else if axis.rejected == 0 && before >= tuning.faulty_readings {
            changes(change(false));
        }
        used
    })
}

impl Axis {
    fn judge(
        &mut self,
        reading: f64,
        expected: Option<Gaussian>,
        moving: bool,
        (tuning, kind): (&InertialWatchTuning, &Kind),
    ) -> f64 {
        self.repeats = if reading == self.read {
            self.repeats.saturating_add(1)
        } else {
            0
        };
        self.read = reading;
        let Some(expected) = expected else {
            // A sensor that was found faulty stays faulty.
            if self.rejected < tuning.faulty_readings {
                self.rejected = 0;
                self.last = Some(reading);
            }
            return reading;
        };
        let value = expected.mean;
        let contradicted = beyond(tuning.gate_sigma, reading - value, expected.variance);
        let jumped = self
            .last
            .is_some_and(|last| (reading - last).abs() > kind.jump);
        let stuck = moving && self.repeats >= tuning.stuck_readings;
        let suspect = self.suspect > 0 || self.rejected > 0 || jumped;
        self.suspect = if self.rejected >= tuning.faulty_readings {
            tuning.suspect_readings
        } else {
            self.suspect.saturating_sub(1)
        };
        if stuck || contradicted && suspect && self.rejected < kind.rejections_max {
            self.rejected = self.rejected.saturating_add(1);
            self.agreed = 0;
            value
        } else if self.rejected >= tuning.faulty_readings && self.agreed < kind.good_readings {
            self.agreed += 1;
            value
        } else {
            (self.rejected, self.agreed) = (0, 0);
            self.last = Some(reading);
            reading
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIGMA: Triads<f64> = Triads {
        rate: 0.005,
        force: 0.03,
    };

    fn judge(
        watch: &mut InertialWatch,
        rate: Vector3<f64>,
        expected: Option<[Gaussian; 3]>,
        changes: &mut impl FnMut(SensorChange),
    ) -> Vector3<f64> {
        let reading = Triads {
            rate,
            force: Vector3::zeros(),
        };
        let expected = Triads {
            rate: expected,
            force: None,
        };
        let bias = Triads::default();
        watch.judge(reading, bias, SIGMA, &expected, changes).rate
    }

    #[test]
    fn a_wild_axis_is_replaced_named_and_taken_back() {
        let mut watch = InertialWatch::default();
        let mut reported = Vec::new();
        let expected = Some([0.1, 0.0, 0.3].map(|mean| Gaussian::new(mean, 1e-4)));
        for k in 0..200 {
            let wild = if (50..100).contains(&k) { 3.5 } else { 0.1 };
            let reading = Vector3::new(wild, 0.01, 0.31);
            let rate = judge(&mut watch, reading, expected, &mut |change| {
                reported.push((k, change.name, change.faulty));
            });
            assert_eq!(rate.z, 0.31);
            assert_eq!(rate.x, 0.1, "{k}");
        }
        assert_eq!(watch.used().rate, [true; 3]);
        let name = RATE_NAMES[0];
        assert_eq!(reported, [(69, name, true), (100, name, false)]);
        let wild = Vector3::repeat(9.0);
        assert_eq!(judge(&mut watch, wild, None, &mut |_| {}), wild);
    }

    #[test]
    fn forces_that_go_wrong_by_themselves_spoil_no_rate() {
        let mut watch = InertialWatch::default();
        for k in 0..400 {
            let wrong = 0.01 * f64::from(k);
            let reading = Vector3::repeat(0.001 * f64::from(k));
            let expected = Some([Gaussian::new(wrong, 1e-4); 3]);
            let rate = judge(&mut watch, reading, expected, &mut |_| {});
            assert_eq!(rate, reading);
        }
    }

    /// A body begins to accelerate. The stuck axis is replaced once the balance contradicts it; the
    /// other axes change and are used.
    #[test]
    fn an_accelerometer_that_hangs_is_replaced_once_the_forces_move() {
        let mut watch = InertialWatch::default();
        let mut reported = Vec::new();
        for k in 0..100 {
            let truth = 0.05 * f64::from(k);
            // The estimate of the bias changes, the reading of the stuck axis does not.
            let bias = Triads {
                rate: Vector3::zeros(),
                force: Vector3::repeat(1e-4 * f64::from(k % 7)),
            };
            let reading = Triads {
                rate: Vector3::zeros(),
                force: Vector3::new(0.0, truth, 9.81 + truth),
            };
            let expected = Triads {
                rate: None,
                force: Some([truth, truth, 9.81 + truth].map(|mean| Gaussian::new(mean, 1e-3))),
            };
            let force = watch.judge(reading, bias, SIGMA, &expected, &mut |change| {
                reported.push((change.name, change.faulty));
            });
            assert!((force.force.x - truth).abs() < 1.6, "{k}");
            assert_eq!(force.force.y, truth);
        }
        assert_eq!(watch.used().force, [false, true, true]);
        assert_eq!(reported, [(FORCE_NAMES[0], true)]);
        assert_eq!(
            watch.replaced_density().force,
            [
                InertialWatchTuning::default().accel_replaced_density,
                0.0,
                0.0
            ]
        );
    }
}
