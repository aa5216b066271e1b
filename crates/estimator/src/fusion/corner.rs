//! Measurement equations of strut and strain channels.

use model::suspension::CornerStatics;
use nalgebra::Vector3;
use sample::{InnovationKind, StrainChannel, Wheel};

use super::inertial::Balance;
use super::joint::{Joint, NO_OWN, Rows, TOGETHER};
use super::{
    Change, ChannelChange, FORCE, Fusion, MOMENT, MOMENT_AXES, OFFSET, RATE, STRUT_LENGTH,
    StepInput, TORQUE,
};
use crate::inputs::{CornerReadings, Reading};
use crate::statics::AXIAL;
use crate::tuning::MemberTuning;

/// States of one corner: force, rate, moments and torques.
const CORNER: usize = 10;
type CornerRows = Rows<CORNER>;
/// Rows of a corner's strut and of its first strain channel.
const STRUT: usize = 0;
const STRAIN: usize = 1;

impl Fusion {
    /// Age of the force that a strain channel's lagged reading shows, s.
    fn age_s(&self, input: &StepInput<'_>, reading: &Reading) -> f64 {
        let age_s = input.now.seconds_since(reading.time);
        age_s.clamp(-0.01, input.fresh_s) + self.lag_s
    }

    /// Maps from the states to the members of a corner.
    fn members<'a>(&self, input: &StepInput<'a>, balance: &Balance, wheel: usize) -> Members<'a> {
        let corner = &input.corners[wheel];
        Members {
            wheel,
            statics: [&corner.statics, &input.statics_before[wheel]],
            step_s: input.dt,
            steps_back_max: self.tuning.members.steps_back_max,
            known_n_m: balance.known[wheel].moment_n_m,
            rolling_m: -self.body.rolling[wheel] * input.motion.velocity_m_s.x.clamp(-1.0, 1.0),
            spindle: corner.frame.vehicle_from_tyre.transpose() * corner.pose.spindle,
        }
    }

    /// Measurements of strut and strain channels of a corner with a new reading.
    pub(super) fn measure_corner(
        &self,
        input: &StepInput<'_>,
        balance: &Balance,
        wheel: usize,
        readings: &mut CornerReadings,
    ) -> CornerMeasurements {
        let t = &self.tuning.members;
        let corner = &input.corners[wheel];
        let members = self.members(input, balance, wheel);
        let of_strut = members.force(5, 0.0);
        let mut rows = CornerRows::new(members.states());
        // F = k (l_0 - l) - c l' of a strut that is longer than it seems.
        let stiffness_n_mm = 1e-3 * corner.strut_stiffness_n_m;
        rows.set(
            STRUT,
            of_strut.gains,
            (STRUT_LENGTH + wheel, stiffness_n_mm),
        );
        let strut = corner.strut_read.map(|read| RowMeasurement {
            value: read.force_n - of_strut.offset_n,
            variance: read.sigma_n * read.sigma_n,
            tolerance: 0.0,
        });
        let posed = corner.strut_sigma_n.is_finite();
        // Each tube of the lower arm carries half of the ball-normal force, so its bending gauges
        // measure M = F_n d/2, independent of spring and damper.
        let arm = 0.5 * self.bending_distance_m;
        let mut alive = 0;
        let strain = StrainChannel::ALL.map(|channel| {
            let i = channel.index();
            let reading = readings.strain[i].as_mut()?;
            let axial = i < AXIAL.len();
            alive += usize::from(axial && reading.fresh(input.now, input.fresh_s).is_some());
            if std::mem::replace(&mut reading.taken, true) || !axial && arm == 0.0 {
                return None;
            }
            let age = self.age_s(input, reading);
            let c = &input.channels.0[wheel].strain[i];
            if axial {
                let force = members.force(i, age);
                rows.set(STRAIN + i, force.gains, (OFFSET + 5 * wheel + i, 1.0));
                Some(RowMeasurement {
                    value: reading.value - force.offset_n,
                    variance: c.noise_sigma.powi(2),
                    tolerance: member_tolerance_n(posed, reading.value, t),
                })
            } else {
                let [per_strut, without] = members.ball_normal_n(age);
                let bending = arm * per_strut;
                let of_strut = members.force(5, age);
                let gains = of_strut.gains.map(|gain| bending * gain);
                rows.set(STRAIN + i, gains, NO_OWN);
                let known = bending * of_strut.offset_n + arm * without;
                Some(RowMeasurement {
                    value: reading.value - known,
                    variance: c.noise_sigma.powi(2) + c.offset_sigma.powi(2),
                    tolerance: arm * t.bending_sigma_n,
                })
            }
        });
        CornerMeasurements {
            rows,
            strut,
            strut_offset_n: of_strut.offset_n,
            strain,
            alive,
        }
    }

    /// Inflates the covariance of forces and rates if the strain channels together contradict the
    /// predicted state, before the readings are taken.
    pub(super) fn inflate_on_multi_channel_innovation(
        &mut self,
        measured: &[CornerMeasurements; 4],
    ) {
        let t = self.tuning;
        for (wheel, corner) in measured.iter().enumerate() {
            let predicted = corner.rows.view().times(&self.state);
            for i in 0..AXIAL.len() {
                let square = corner.strain[i].and_then(|measured| {
                    let innovation = measured.value - predicted[STRAIN + i];
                    self.health[wheel][i].predicted_square(innovation, &t.channels)
                });
                if let Some(square) = square {
                    self.force_noise.add_innovation(wheel, square);
                }
            }
        }
        if self.force_noise.exceeded() {
            let [force, rate] = [t.members.surprise_n, t.members.surprise_n_s];
            for i in 0..12 {
                self.covariance.add_noise(FORCE + i, force * force);
                self.covariance.add_noise(RATE + i, rate * rate);
            }
        }
    }

    /// Takes strut and strain channels of one corner.
    pub(super) fn take_corner(
        &mut self,
        input: &StepInput<'_>,
        of_corner: &CornerMeasurements,
        wheel: usize,
        changes: &mut impl FnMut(ChannelChange),
    ) {
        let t = self.tuning;
        let corner = &input.corners[wheel];
        if corner.strut_jumped {
            self.suspect_length(wheel);
        }
        let mut joint = self.covariance.project(&of_corner.rows, &self.state);
        let before: [f64; TOGETHER] = std::array::from_fn(|m| joint.variance(m));
        if let Some(measured) = of_corner.strut {
            let blind = if of_corner.alive < 4 {
                t.members.blind_strut_n
            } else {
                0.0
            };
            let length_mm =
                1e3 * (measured.value - joint.value(STRUT)) / corner.strut_stiffness_n_m;
            let variance = measured.variance + blind * blind;
            let gate = t.members.strut_gate_sigma;
            let innovation = self.take(&mut joint, STRUT, measured.value, variance, gate);
            self.count(InnovationKind::Strut, innovation, gate);
            if !self.settling() {
                self.lengths[wheel].learn(innovation, length_mm, &t.potentiometers);
            }
        }
        for (channel, measured) in StrainChannel::ALL.into_iter().zip(&of_corner.strain) {
            let Some(measured) = measured else { continue };
            let known = before[STRAIN + channel.index()];
            let change = self.take_channel(&mut joint, measured, known, wheel, channel);
            if change != Change::None {
                changes(ChannelChange {
                    wheel,
                    channel: Some(channel),
                    faulty: change == Change::Faulty,
                });
            }
        }
        self.covariance
            .apply(&of_corner.rows, &joint, &mut self.state);
        self.strut_n[wheel] =
            of_corner.rows.view().of_shared(&self.state)[STRUT] + of_corner.strut_offset_n;
        if of_corner.alive < 4 {
            self.blind = true;
            self.take_expected(input, wheel);
        }
    }

    /// Takes the vehicle model's forces where strain is missing: without strain the forces of one
    /// axle are not observable separately, and without a potentiometer neither are the loads of the
    /// diagonals.
    fn take_expected(&mut self, input: &StepInput<'_>, wheel: usize) {
        let t = self.tuning.members;
        let posed = input.corners[wheel].strut_sigma_n.is_finite();
        let expected = input.expected.0[wheel].force_n;
        let load = if posed {
            self.state[FORCE + 3 * wheel + 2].abs()
        } else {
            expected[2]
        };
        let mut rows = Rows::new([0, 1, 2].map(|axis| FORCE + 3 * wheel + axis));
        for (axis, unit) in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .into_iter()
            .enumerate()
        {
            rows.set(axis, unit, NO_OWN);
        }
        let mut joint = self.covariance.project(&rows, &self.state);
        for axis in 0..if posed { 2 } else { 3 } {
            // The same expected force in every step is one measurement, not many.
            let sigma = t.expected_sigma_part[axis] * load + t.expected_sigma_n;
            let variance = sigma * sigma * (t.expected_time_s / input.dt).max(1.0);
            self.take(&mut joint, axis, expected[axis], variance, f64::INFINITY);
        }
        self.covariance.apply(&rows, &joint, &mut self.state);
    }

    /// Takes one channel. `known` is the variance of its row before any row of the corner was
    /// taken.
    fn take_channel(
        &mut self,
        joint: &mut Joint,
        measured: &RowMeasurement,
        known: f64,
        wheel: usize,
        channel: StrainChannel,
    ) -> Change {
        let t = self.tuning;
        let i = channel.index();
        let m = STRAIN + i;
        let model = self.health[wheel][i].model_variance(measured.tolerance, &t.channels);
        let total = joint.variance(m) + measured.variance + model;
        let innovation = measured.value - joint.value(m);
        let doubt = t.members.gain_tolerance * measured.value;
        let square = innovation * innovation / (total + doubt * doubt);
        if self.settling() {
            joint.take(m, measured.value, total);
            return Change::None;
        }
        let (good, change) =
            self.health[wheel][i].judge(square, self.force_noise.open(), &t.channels);
        self.health[wheel][i].expect([total, known + measured.variance + model]);
        let kind = if i < AXIAL.len() {
            InnovationKind::Strain
        } else {
            InnovationKind::Bending
        };
        if good {
            self.innovations.used(kind, innovation * innovation / total);
            self.health[wheel][i].learn(innovation, measured.tolerance, &t.channels);
            joint.take(m, measured.value, total);
        } else {
            self.innovations.rejected(kind);
        }
        change
    }
}

/// The members' forces of one corner, A (F - age F') + B (M, with rolling resistance and half-shaft
/// torque) + offset, with A, B and offset of the linkage `age` ago. A strut that moves at 0.1 m/s
/// turns the members by 6 mrad in the 8 ms of a bridge's lag, 12 N at a wheel's static load.
struct Members<'a> {
    wheel: usize,
    /// The linkage's map now and a step before.
    statics: [&'a CornerStatics; 2],
    step_s: f64,
    steps_back_max: f64,
    /// The tyre's moment that belongs to its force.
    known_n_m: Vector3<f64>,
    /// M_y of a newton of load.
    rolling_m: f64,
    /// The spindle in the contact frame.
    spindle: Vector3<f64>,
}

impl Members<'_> {
    fn states(&self) -> [usize; CORNER] {
        let wheel = self.wheel;
        std::array::from_fn(|i| match i {
            0..3 => FORCE + 3 * wheel + i,
            3..6 => RATE + 3 * wheel + i - 3,
            6..8 => MOMENT + 2 * wheel + i - 6,
            8 => TORQUE + wheel / 2,
            _ => TORQUE + 2 + wheel / 2,
        })
    }

    /// Numbers of the linkage's map `age` ago, extrapolated by the change of the last step.
    fn ago<const N: usize>(
        &self,
        age: f64,
        numbers: impl Fn(&CornerStatics) -> [f64; N],
    ) -> [f64; N] {
        let back = (age / self.step_s).clamp(0.0, self.steps_back_max);
        let [now, before] = self.statics.map(numbers);
        std::array::from_fn(|k| now[k] + (before[k] - now[k]) * back)
    }

    /// Ball-normal force of a newton in the strut, and without any.
    fn ball_normal_n(&self, age: f64) -> [f64; 2] {
        self.ago(age, |s| [s.ball_normal_per_strut, s.ball_normal_offset_n])
    }

    /// The force of member `i` as it was `age` ago.
    fn force(&self, i: usize, age: f64) -> MemberForce {
        let [wrench @ .., offset_n]: [f64; 7] = self.ago(age, |statics| {
            let of_wrench = |k| statics.members_from_wrench[(i, k)];
            std::array::from_fn(|k| {
                if k < 6 {
                    of_wrench(k)
                } else {
                    statics.members_offset[i]
                }
            })
        });
        let of_known: f64 = (0..3).map(|k| wrench[3 + k] * self.known_n_m[k]).sum();
        let mut gains = [0.0; CORNER];
        gains[..3].copy_from_slice(&wrench[..3]);
        gains[8] = (0..3).map(|k| wrench[3 + k] * self.spindle[k]).sum();
        gains[2] += self.rolling_m * wrench[4];
        for k in 0..3 {
            gains[3 + k] = -age * gains[k];
        }
        for (k, about) in MOMENT_AXES.into_iter().enumerate() {
            gains[6 + k] = wrench[3 + about];
        }
        let left = Wheel::ALL[self.wheel].is_left();
        gains[9] = if left { gains[8] } else { -gains[8] };
        MemberForce {
            gains,
            offset_n: offset_n + of_known,
        }
    }
}

/// A member's force: gains of [`Members::states`] and the force without any tyre force.
struct MemberForce {
    gains: [f64; CORNER],
    offset_n: f64,
}

/// Measurements of one corner with a new reading.
pub(super) struct CornerMeasurements {
    rows: CornerRows,
    strut: Option<RowMeasurement>,
    /// Strut force without any tyre force.
    strut_offset_n: f64,
    strain: [Option<RowMeasurement>; StrainChannel::COUNT],
    /// Number of axial channels with a recent reading.
    alive: usize,
}

/// Measured value of a row.
#[derive(Clone, Copy)]
struct RowMeasurement {
    value: f64,
    /// Variance of the converter's noise.
    variance: f64,
    /// Standard deviation of the model.
    tolerance: f64,
}

/// Error of the linkage's model on a member's force, N. Without a deflection the design position
/// replaces the measured one, with a large error.
fn member_tolerance_n(posed: bool, force_n: f64, tuning: &MemberTuning) -> f64 {
    if posed {
        tuning.member_sigma_n + tuning.member_sigma_part * force_n.abs()
    } else {
        tuning.unposed_sigma_n + tuning.unposed_sigma_part * force_n.abs()
    }
}
