//! Measurement equations.

use model::suspension::CornerStatics;
use nalgebra::{Matrix3, Vector3};
use sample::{InnovationKind, STANDARD_GRAVITY_M_S2, StrainChannel};

use super::covariance::{Row, position};
use super::moments::KnownMoment;
use super::{
    ACCEL, Change, ChannelChange, FORCE, Fusion, LENGTH, MOMENT, OFFSET, RATE, SIZE, StepInput,
    TORQUE, TURN, TURN_VARIANCE,
};
use crate::inputs::{CornerReadings, Reading};
use crate::statics::AXIAL;

/// Error of geometry and model on a member's force, N, and as a part of it.
const MEMBER_FLOOR_N: f64 = 1.5;
const MEMBER_FLOOR: f64 = 0.003;
const UNPOSED_FLOOR_N: f64 = 60.0;
const UNPOSED_FLOOR: f64 = 0.15;
/// The same on the ball-normal force that bending tells, N.
const BENDING_FLOOR_N: f64 = 1.5;
/// The same on the sum of all forces, N.
const SUM_FLOOR_N: f64 = 10.0;
/// Error of a channel's gain that is no fault.
const FAULT_FLOOR: f64 = 0.02;
/// Deviations of the forces, N, and of their rates, N/s, where many channels are surprised at once.
/// The lag's inverse would make a wild rate of a jump that the force itself may not make.
const SURPRISE_N: f64 = 150.0;
const SURPRISE_N_S: f64 = 4.0e3;
/// Gate of rows that no channel answers for, squared.
const GATE: f64 = 25.0;
/// The same of a strut's force, whose level may be off.
const STRUT_GATE: f64 = 100.0;
/// Square of the forward accelerometer's normalised innovation that is a push: drive or brake that
/// has just come.
const PUSH: f64 = 8.0;
/// The same beyond which it is the accelerometer that is doubted.
const PUSH_MAX: f64 = 400.0;
/// Rate of the loads after a push, N/s of a newton of its surplus: the body begins to pitch.
const PUSH_RATE: f64 = 3.0;
/// Part of the weight within which the tyres must carry it before a vehicle that was held counts as
/// free. The doubt after a surprise alone would let a part of the weight pass for all of it.
const HELD_PART: f64 = 0.05;
/// How far the vehicle model's F_x and F_y may be wrong, as a part of the load.
const BLIND_FORCE: [f64; 2] = [0.4, 0.1];
/// Strut's force where no strain tells what of it F_x and F_y carry, N.
const BLIND_STRUT_N: f64 = 70.0;
/// How long one such guess lasts, s.
const BLIND_TIME_S: f64 = 0.1;

/// Of one corner's channel: force, rate, moment, torque and one more.
type CornerRow = Row<12>;
/// Of the inertial unit: forces, their rates, moments and a bias.
type InertialRow = Row<40>;

/// The balance of moments at one instant: w' = jacobian (F, M) + constant.
#[derive(Clone, Debug)]
pub(super) struct Balance {
    pub(super) jacobian: [[f64; 24]; 3],
    pub(super) constant: [f64; 3],
    directions: [Matrix3<f64>; 4],
    /// The tyres' moments that go with the forces of the last step.
    pub(super) known: [KnownMoment; 4],
}

impl Balance {
    pub(super) fn turn_rate(&self, axis: usize, state: &[f64; SIZE]) -> f64 {
        let gains = self.jacobian[axis].iter().enumerate();
        let sum: f64 = gains.map(|(j, gain)| gain * state[position(j)]).sum();
        sum + self.constant[axis]
    }
}

impl Fusion {
    pub(super) fn balance(&self, input: &StepInput<'_>) -> Balance {
        let body = &self.body;
        let cg = Vector3::new(0.0, 0.0, body.cg_height_m);
        let mut jacobian = [[0.0; 24]; 3];
        let mut of_known = Vector3::zeros();
        let mut momentum = Vector3::zeros();
        let mut momentum_dot = Vector3::zeros();
        let mut directions = [Matrix3::zeros(); 4];
        let known = std::array::from_fn(|wheel| {
            self.known_moment(wheel, &input.corners[wheel], input.motion.velocity_m_s.x)
        });
        let backward = input.motion.velocity_m_s.x.clamp(-1.0, 1.0);
        for (i, corner) in input.corners.iter().enumerate() {
            let turn = corner.frame.vehicle_from_tyre;
            let arm = corner.frame.contact_m - cg;
            let mut of_force = body.inverse * arm.cross_matrix() * turn;
            let of_moment = body.inverse * turn;
            // Rolling resistance: M_y = -c R F_z of a wheel that rolls forward, about the
            // contact point, where the load stands ahead of the wheel's centre.
            let rolling = of_moment.column(1) * (-body.rolling[i] * backward);
            let with_rolling = of_force.column(2) + rolling;
            of_force.set_column(2, &with_rolling);
            for axis in 0..3 {
                for k in 0..3 {
                    jacobian[axis][3 * i + k] = of_force[(axis, k)];
                    jacobian[axis][12 + 3 * i + k] = of_moment[(axis, k)];
                }
            }
            let spindle = corner.pose.spindle;
            momentum += spindle * (body.spin_inertia[i] * corner.spin_rad_s);
            momentum_dot += spindle * (body.spin_inertia[i] * corner.spin_dot_rad_s2);
            of_known += of_moment * known[i].moment_n_m;
            directions[i] = turn;
        }
        let rate = input.motion.rate_rad_s;
        let constant = of_known
            - (body.inverse * (rate.cross(&(body.inertia * rate + momentum)) + momentum_dot));
        Balance {
            jacobian,
            constant: constant.into(),
            directions,
            known,
        }
    }

    /// Specific force of the inertial unit and angular rate. With r from the centre of gravity to
    /// the unit, m f = sum R F + m (w' x r + w x (w x r)): the angular acceleration comes from the
    /// balance of moments, since a differentiated gyro would be three times noisier than the
    /// accelerometers. Where the upward axis contradicts the loads of wheels whose struts are known,
    /// the vehicle is held: then the other axes tell nothing, and the gyro alone tells how the body
    /// turns. Tells whether the unit agrees with the forces.
    pub(super) fn take_inertial(&mut self, input: &StepInput<'_>, balance: &Balance) -> bool {
        let age = input.motion.inertial_age_s.max(0.0);
        let [gyro, accel] = input.imu_sigma;
        let mass = self.body.mass_kg;
        let u = input.motion.velocity_m_s.x;
        let drag = Vector3::new(self.body.drag * u * u.abs(), 0.0, 0.0);
        let swing = -input.imu_m.cross_matrix() * mass;
        let at_unit =
            input.motion.specific_force_m_s2 + input.motion.rate_dot_rad_s2.cross(&input.imu_m);
        let sum = at_unit * mass + drag - swing * Vector3::from(balance.constant);
        let variance = (mass * accel).powi(2) + SUM_FLOOR_N.powi(2);
        let mut agrees = true;
        let posed = (input.corners.iter()).all(|corner| corner.strut_sigma_n.is_finite());
        // Upward first: what carries a part of the weight pushes along the other axes, too.
        for axis in [2, 0, 1] {
            let mut row = InertialRow::new();
            for j in 0..24 {
                let turning = (0..3).map(|k| swing[(axis, k)] * balance.jacobian[k][j]);
                let mut gain: f64 = turning.sum();
                if j < 12 {
                    gain += balance.directions[j / 3][(axis, j % 3)];
                    row.add(RATE + j, -age * gain);
                }
                row.add(position(j), gain);
            }
            row.add(ACCEL + axis, mass);
            if axis == 0 && !self.settling() {
                self.heed_push(&row, sum[axis], variance);
            }
            if axis == 2 {
                let missing = sum[axis] - row.times(&self.state);
                self.held &= posed && missing.abs() > HELD_PART * mass * STANDARD_GRAVITY_M_S2;
            }
            let gate = if self.held { 0.0 } else { GATE };
            let innovation = self.take(&row, sum[axis], variance, gate);
            self.count(InnovationKind::Accelerometer, innovation, gate);
            agrees &= innovation * innovation <= gate;
            if axis == 2 && !agrees && posed {
                self.held = true;
                for axis in 0..3 {
                    self.covariance.add_noise(TURN + axis, TURN_VARIANCE);
                }
                break;
            }
        }
        for axis in (0..3).filter(|axis| input.gyro_believed[*axis]) {
            let mut row = InertialRow::new();
            row.add(TURN + axis, 1.0);
            for (j, gain) in balance.jacobian[axis].iter().enumerate() {
                row.add(position(j), -age * gain);
            }
            // The reading itself: the motion's rate is already carried on to now.
            let read = input.motion.rate_rad_s[axis] - age * input.motion.rate_dot_rad_s2[axis];
            let value = read + age * balance.constant[axis];
            let innovation = self.take(&row, value, gyro * gyro, GATE);
            self.count(InnovationKind::Gyro, innovation, GATE);
        }
        agrees
    }

    /// Drive and brake come through all tyres at once, and the accelerometer feels them before the
    /// bridges' lag shows them: what of its innovation is more than noise is set free in the forward
    /// forces, a quarter of its variance in each, so that they follow at once and say how unsure
    /// they are, and in the rates of the loads that follow.
    fn heed_push(&mut self, row: &InertialRow, value: f64, variance: f64) {
        let total = self.covariance.project(row) + variance;
        let innovation = value - row.times(&self.state);
        let square = innovation * innovation;
        self.pushed = (PUSH * total..PUSH_MAX * total).contains(&square);
        if self.pushed {
            let surplus = square / PUSH - total;
            for wheel in 0..4 {
                let (forward, load_rate) = (FORCE + 3 * wheel, RATE + 3 * wheel + 2);
                self.covariance.add_noise(forward, 0.25 * surplus);
                self.covariance
                    .add_noise(load_rate, PUSH_RATE * PUSH_RATE * surplus);
            }
        }
    }

    pub(super) fn body_motion_ahead(
        &self,
        input: &StepInput<'_>,
        balance: &Balance,
    ) -> [Vector3<f64>; 2] {
        let ahead = |j: usize| self.state[FORCE + j] + input.dt * self.state[RATE + j];
        let mut sum = Vector3::zeros();
        for (i, direction) in balance.directions.iter().enumerate() {
            sum += direction * Vector3::from_fn(|k, _| ahead(3 * i + k));
        }
        let u = input.motion.velocity_m_s.x;
        sum.x -= self.body.drag * u * u.abs();
        let turn = Vector3::from_fn(|axis, _| balance.turn_rate(axis, &self.state));
        [sum / self.body.mass_kg, turn]
    }

    pub(super) fn members<'a>(
        &self,
        input: &StepInput<'a>,
        balance: &Balance,
        wheel: usize,
    ) -> Members<'a> {
        let corner = &input.corners[wheel];
        let speed_m_s = input.motion.velocity_m_s.x;
        let known = balance.known[wheel].moment_n_m;
        let of_known = corner.statics.members_from_wrench.fixed_columns::<3>(3) * known;
        Members {
            wheel,
            statics: &corner.statics,
            rolling_m: -self.body.rolling[wheel] * speed_m_s.clamp(-1.0, 1.0),
            torque: corner.frame.vehicle_from_tyre.transpose() * corner.pose.spindle,
            offset_n: std::array::from_fn(|i| corner.statics.members_offset[i] + of_known[i]),
        }
    }

    /// How long ago the force stood that a strain channel's lagged reading tells, s.
    fn age_s(&self, input: &StepInput<'_>, reading: &Reading) -> f64 {
        input.now.seconds_since(reading.time).clamp(-0.01, 0.05) + self.lag_s
    }

    /// What the axial channels of a corner say that have a new reading.
    pub(super) fn said(
        &self,
        input: &StepInput<'_>,
        members: &Members<'_>,
        readings: &CornerReadings,
    ) -> [Option<Expected>; AXIAL.len()] {
        std::array::from_fn(|i| {
            let reading = readings.strain[AXIAL[i].index()].filter(|reading| !reading.taken)?;
            let wheel = members.wheel;
            let mut row = members.row(i, self.age_s(input, &reading));
            row.add(OFFSET + 5 * wheel + i, 1.0);
            let noise = input.channels.0[wheel].strain[AXIAL[i].index()].noise_sigma;
            let posed = input.corners[wheel].strut_sigma_n.is_finite();
            Some(Expected {
                row,
                value: reading.value - members.offset_n[i],
                variance: noise * noise,
                tolerance: member_tolerance_n(posed, reading.value),
            })
        })
    }

    /// Whether the strain channels together contradict what the state foretells: where they do the
    /// forces are set free before the readings are taken in.
    pub(super) fn heed_surprise(&mut self, said: &[[Option<Expected>; AXIAL.len()]; 4]) {
        for (wheel, said) in said.iter().enumerate() {
            for (said, health) in said.iter().zip(&self.health[wheel]) {
                let square = said.as_ref().and_then(|said| {
                    health.foretold_square(said.value - said.row.times(&self.state))
                });
                if let Some(square) = square {
                    self.agility.surprise(wheel, square);
                }
            }
        }
        if self.agility.surprised() {
            for i in 0..12 {
                self.covariance
                    .add_noise(FORCE + i, SURPRISE_N * SURPRISE_N);
                self.covariance
                    .add_noise(RATE + i, SURPRISE_N_S * SURPRISE_N_S);
            }
        }
    }

    /// Strut and strain channels of one corner.
    pub(super) fn take_corner(
        &mut self,
        input: &StepInput<'_>,
        members: &Members<'_>,
        said: &[Option<Expected>; AXIAL.len()],
        readings: &mut CornerReadings,
        changes: &mut impl FnMut(ChannelChange),
    ) {
        let wheel = members.wheel;
        let corner = &input.corners[wheel];
        let of_strut = members.row(5, 0.0);
        let strained = AXIAL
            .iter()
            .filter_map(|channel| readings.strain[channel.index()])
            .filter(|reading| reading.fresh(input.now).is_some());
        let blind = if strained.count() < 4 {
            BLIND_STRUT_N
        } else {
            0.0
        };
        if corner.strut_jumped {
            self.doubt_length(wheel);
        }
        if let Some([force_n, sigma_n]) = corner.strut_read {
            // F = k (l_0 - l) - c l' of a strut that is longer than it seems.
            let mut row = of_strut;
            row.add(LENGTH + wheel, 1e-3 * corner.strut_stiffness_n_m);
            let value = force_n - members.offset_n[5];
            let length_mm = 1e3 * (value - row.times(&self.state)) / corner.strut_stiffness_n_m;
            let variance = sigma_n * sigma_n + blind * blind;
            let innovation = self.take(&row, value, variance, STRUT_GATE);
            self.count(InnovationKind::Strut, innovation, STRUT_GATE);
            if !self.settling() {
                self.lengths[wheel].learn(innovation, length_mm);
            }
        }
        let mut alive = 0;
        for (i, channel) in AXIAL.into_iter().enumerate() {
            let Some(reading) = &mut readings.strain[channel.index()] else {
                continue;
            };
            alive += u32::from(reading.fresh(input.now).is_some());
            reading.taken = true;
            let Some(said) = &said[i] else {
                continue;
            };
            let change = self.take_channel(said, wheel, i);
            if change != Change::None {
                changes(ChannelChange {
                    wheel,
                    channel: Some(channel),
                    faulty: change == Change::Faulty,
                });
            }
        }
        self.take_bending(input, members, readings, changes);
        self.strut_n[wheel] = of_strut.times(&self.state) + members.offset_n[5];
        if alive < 4 {
            self.blind = true;
            self.take_expected(input, wheel);
        }
    }

    /// Bending bridges between strut mount and ball joint: each tube carries one half of the
    /// ball-normal force, so that its gauges see M = F_n d/2, whatever spring and damper do.
    fn take_bending(
        &mut self,
        input: &StepInput<'_>,
        members: &Members<'_>,
        readings: &mut CornerReadings,
        changes: &mut impl FnMut(ChannelChange),
    ) {
        let (wheel, statics) = (members.wheel, members.statics);
        let arm = 0.5 * self.bending_distance_m;
        let gain = arm * statics.ball_normal_per_strut;
        if gain == 0.0 {
            return;
        }
        for channel in [
            StrainChannel::LowerFrontBending,
            StrainChannel::LowerRearBending,
        ] {
            let i = channel.index();
            let Some(reading) = &mut readings.strain[i] else {
                continue;
            };
            if reading.taken {
                continue;
            }
            reading.taken = true;
            let row = members.row(5, self.age_s(input, reading)).scaled(gain);
            let known = gain * members.offset_n[5] + arm * statics.ball_normal_offset_n;
            let c = &input.channels.0[wheel].strain[i];
            let said = Expected {
                row,
                value: reading.value - known,
                variance: c.noise_sigma.powi(2) + c.offset_sigma.powi(2),
                tolerance: arm * BENDING_FLOOR_N,
            };
            let change = self.take_channel(&said, wheel, i);
            if change != Change::None {
                changes(ChannelChange {
                    wheel,
                    channel: Some(channel),
                    faulty: change == Change::Faulty,
                });
            }
        }
    }

    /// Without strain nothing tells the forces of one axle apart: the vehicle model has to.
    fn take_expected(&mut self, input: &StepInput<'_>, wheel: usize) {
        let load = self.state[FORCE + 3 * wheel + 2].abs();
        for axis in 0..2 {
            // The same guess every step is one piece of knowledge, not many.
            let sigma = BLIND_FORCE[axis] * load + 30.0;
            let variance = sigma * sigma * (BLIND_TIME_S / input.dt).max(1.0);
            let expected = input.expected.0[wheel].force_n[axis];
            if expected.is_finite() {
                let mut row = CornerRow::new();
                row.add(FORCE + 3 * wheel + axis, 1.0);
                self.take(&row, expected, variance, f64::INFINITY);
            }
        }
    }

    fn take_channel(&mut self, said: &Expected, wheel: usize, i: usize) -> Change {
        let row = &said.row;
        let model = self.health[wheel][i].model_variance(said.tolerance);
        let total = self.covariance.project(row) + said.variance + model;
        let innovation = said.value - row.times(&self.state);
        let doubt = FAULT_FLOOR * said.value;
        let square = innovation * innovation / (total + doubt * doubt);
        if self.settling() {
            self.apply(row, innovation, total);
            return Change::None;
        }
        let (good, change) = self.health[wheel][i].judge(square, self.agility.open());
        self.health[wheel][i].expect(total);
        let kind = if i < AXIAL.len() {
            InnovationKind::Strain
        } else {
            InnovationKind::Bending
        };
        if good {
            self.innovations.used(kind, innovation * innovation / total);
            self.health[wheel][i].learn(innovation, said.tolerance);
            self.apply(row, innovation, total);
        } else {
            self.innovations.rejected(kind);
        }
        change
    }

    /// Takes a value in unless it is beyond the gate; returns its innovation in deviations.
    fn take<const N: usize>(&mut self, row: &Row<N>, value: f64, variance: f64, gate: f64) -> f64 {
        let total = self.covariance.project(row) + variance;
        let innovation = value - row.times(&self.state);
        if self.settling() || innovation * innovation <= gate * total {
            self.apply(row, innovation, total);
        }
        innovation / total.sqrt()
    }

    /// Counts an innovation, in deviations, of a filter that has settled.
    fn count(&mut self, kind: InnovationKind, innovation: f64, gate: f64) {
        if self.settling() {
            return;
        }
        if innovation * innovation <= gate {
            self.innovations.used(kind, innovation * innovation);
        } else {
            self.innovations.rejected(kind);
        }
    }

    /// Takes in the value of a row that was projected last.
    fn apply<const N: usize>(&mut self, row: &Row<N>, innovation: f64, total: f64) {
        if total.is_nan() || total <= 0.0 || !innovation.is_finite() {
            return;
        }
        self.covariance
            .reduce(row, &mut self.state, innovation, total);
    }
}

/// What a strain channel says, and its row.
pub(super) struct Expected {
    row: CornerRow,
    value: f64,
    /// Of the converter's noise.
    variance: f64,
    /// Deviation that the model may have.
    tolerance: f64,
}

/// Error of the linkage's model on a member's force, N: where no deflection tells the pose, the
/// design position stands in for it and is far off.
fn member_tolerance_n(posed: bool, force_n: f64) -> f64 {
    if posed {
        MEMBER_FLOOR_N + MEMBER_FLOOR * force_n.abs()
    } else {
        UNPOSED_FLOOR_N + UNPOSED_FLOOR * force_n.abs()
    }
}

/// The members' forces of one corner: A (F - age F') + B (M, with rolling resistance and half-shaft
/// torque) + offset.
pub(super) struct Members<'a> {
    wheel: usize,
    statics: &'a CornerStatics,
    /// M_y of a newton of load.
    rolling_m: f64,
    /// The spindle in the contact frame.
    torque: Vector3<f64>,
    offset_n: [f64; 6],
}

impl Members<'_> {
    /// Row of member i as it was `age` ago.
    fn row(&self, i: usize, age: f64) -> CornerRow {
        let gains = self.statics.members_from_wrench.row(i);
        let mut row = CornerRow::new();
        for k in 0..3 {
            let mut gain = gains[k];
            if k == 2 {
                gain += self.rolling_m * gains[4];
            }
            row.add(FORCE + 3 * self.wheel + k, gain);
            row.add(RATE + 3 * self.wheel + k, -age * gain);
            row.add(MOMENT + 3 * self.wheel + k, gains[3 + k]);
        }
        let of_torque =
            gains[3] * self.torque.x + gains[4] * self.torque.y + gains[5] * self.torque.z;
        row.add(TORQUE + self.wheel / 2, of_torque);
        row
    }
}
