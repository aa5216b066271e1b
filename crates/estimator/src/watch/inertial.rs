//! Gyros and accelerometers. A reading that jumps further than a vehicle can move and that the balance
//! of moments or forces of all tyres contradicts is replaced by what that balance makes of it until
//! both agree again, so that neither attitude, velocity nor forces follow an axis that spikes, is
//! plugged in wrong or sits at the end of its range. Forces that are wrong themselves make no sensor
//! jump. One that hangs while the vehicle moves is replaced at once: the filter of forces follows a
//! gyro too closely to contradict one that stands still.

use nalgebra::Vector3;

use super::{BAD, CONTRADICTS, SensorChange};
use crate::gaussian::{Gaussian, beyond};
use crate::triads::{Triads, UsedAxes};
use crate::tuning::InertialWatchTuning;

/// What differs between gyros and accelerometers.
#[derive(Clone, Copy, Debug)]
struct Kind {
    names: [&'static str; 3],
    /// Change from one reading to the next that is no vehicle's, in 10 ms.
    jump: f64,
    /// Error of the balance of each axis beyond its own deviation.
    floor: [f64; 3],
    /// Readings in a row after which the forces may as well be what is wrong.
    rejections_max: u32,
    /// Readings in a row of a faulty axis that must agree before it is good again: one that is plugged
    /// in wrong agrees for a moment whenever both happen to be alike.
    good_readings: u32,
    /// What the balance does not tell, per square root of Hz.
    replaced_density: f64,
}

impl Kind {
    /// Rates, rad/s: attitude that is carried on without a gyro is off by what the moments are.
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

    /// Specific forces, m/s^2. The forces do not count as wrong, however long they are contradicted.
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

/// Memory of one axis.
#[derive(Clone, Copy, Debug, Default)]
struct Axis {
    /// The last reading, and how often it came again.
    read: f64,
    repeats: u32,
    /// The last one that was believed.
    last: Option<f64>,
    /// Readings in a row that were not.
    rejected: u32,
    /// Readings in a row that agreed since it was faulty.
    agreed: u32,
    /// Readings for which an axis that was faulty stays suspect.
    suspect: u32,
}

/// Memory of the unit.
#[derive(Clone, Debug, Default)]
pub struct InertialWatch {
    tuning: InertialWatchTuning,
    rate: [Axis; 3],
    force: [Axis; 3],
    /// Readings in a row that the unit itself called bad.
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

    /// Takes note of a reading that the unit itself calls bad: it failed its own test, or an axis is
    /// beyond its range.
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

    /// Which axes of the last reading were believed.
    pub fn used(&self) -> UsedAxes {
        Triads {
            rate: self.rate.map(|axis| axis.rejected == 0),
            force: self.force.map(|axis| axis.rejected == 0),
        }
    }

    /// Readings have jumped because a bias has: those that are not faulty are not suspect, either.
    pub fn clear_suspicion(&mut self) {
        for axis in self.rate.iter_mut().chain(&mut self.force) {
            if axis.rejected < self.tuning.faulty_readings {
                (axis.suspect, axis.rejected) = (0, 0);
            }
        }
    }

    /// What is unseen of each axis of the last reading that was handed out, (rad/s)/sqrt(Hz) and
    /// (m/s^2)/sqrt(Hz).
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

    /// The reading to go on with, from one of noise `sigma` that is `bias` too large, and what is
    /// expected of each axis without the bias as value and variance.
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
        // A vehicle that moves shakes every axis.
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

/// What is expected of three axes.
#[derive(Clone, Copy, Debug)]
struct Expected {
    /// Value and variance of each.
    expected: Option<[Gaussian; 3]>,
    /// Whether they cannot stand still.
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
        let told = axis.judge(reading[i], expected, moving, (tuning, kind));
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
        told
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
            // Nothing speaks for a sensor that was found faulty, either.
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
        let mut told = Vec::new();
        let expected = Some([0.1, 0.0, 0.3].map(|mean| Gaussian::new(mean, 1e-4)));
        for k in 0..200 {
            let wild = if (50..100).contains(&k) { 3.5 } else { 0.1 };
            let reading = Vector3::new(wild, 0.01, 0.31);
            let rate = judge(&mut watch, reading, expected, &mut |change| {
                told.push((k, change.name, change.faulty));
            });
            assert_eq!(rate.z, 0.31);
            assert_eq!(rate.x, 0.1, "{k}");
        }
        assert_eq!(watch.used().rate, [true; 3]);
        let name = RATE_NAMES[0];
        assert_eq!(told, [(69, name, true), (100, name, false)]);
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

    /// A body that begins to accelerate: the axis that hangs is replaced once it is contradicted,
    /// the others move and are believed.
    #[test]
    fn an_accelerometer_that_hangs_is_replaced_once_the_forces_move() {
        let mut watch = InertialWatch::default();
        let mut told = Vec::new();
        for k in 0..100 {
            let truth = 0.05 * f64::from(k);
            // What is known of the bias changes, the reading of the axis that hangs does not.
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
                told.push((change.name, change.faulty));
            });
            assert!((force.force.x - truth).abs() < 1.6, "{k}");
            assert_eq!(force.force.y, truth);
        }
        assert_eq!(watch.used().force, [false, true, true]);
        assert_eq!(told, [(FORCE_NAMES[0], true)]);
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
