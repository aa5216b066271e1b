//! Measurement equations.

use nalgebra::{Matrix3, Vector3};
use sample::{InnovationKind, STANDARD_GRAVITY_M_S2, StrainChannel};

use super::covariance::{BALANCED, position};
use super::joint::{Joint, Rows};
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

/// Of one corner: force, rate, moments and torques.
const CORNER: usize = 10;
type CornerRows = Rows<CORNER>;
/// Of the inertial unit: all forces, their rates and moments, as the states begin.
type InertialRows = Rows<TORQUE>;
/// Axes of the moments.
const MOMENT_AXES: [usize; 2] = [0, 2];
/// A corner's strut, and the first of its strain channels, among its rows.
const STRUT: usize = 0;
const STRAIN: usize = 1;
/// Order in which the accelerometer's axes are taken in. Upward first: what carries a part of the
/// weight pushes along the other axes, too.
const UPWARD_FIRST: [usize; 3] = [2, 0, 1];
/// Where the forward one comes.
const FORWARD: usize = 1;
/// The gyro's first axis among the inertial unit's rows.
const GYRO: usize = 3;

/// The balance of moments at one instant: w' = jacobian (F, M) + constant.
#[derive(Clone, Debug)]
pub(super) struct Balance {
    pub(super) jacobian: [[f64; BALANCED]; 3],
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
        let mut jacobian = [[0.0; BALANCED]; 3];
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
                }
                for (k, about) in MOMENT_AXES.into_iter().enumerate() {
                    jacobian[axis][12 + 2 * i + k] = of_moment[(axis, about)];
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
        let posed = (input.corners.iter()).all(|corner| corner.strut_sigma_n.is_finite());
        let mut rows = InertialRows::new(std::array::from_fn(|i| i));
        for (m, axis) in UPWARD_FIRST.into_iter().enumerate() {
            let mut gains = [0.0; TORQUE];
            for j in 0..BALANCED {
                let turning = (0..3).map(|k| swing[(axis, k)] * balance.jacobian[k][j]);
                let turning: f64 = turning.sum();
                if j < 12 {
                    let gain = turning + balance.directions[j / 3][(axis, j % 3)];
                    gains[FORCE + j] = gain;
                    gains[RATE + j] = -age * gain;
                } else {
                    gains[position(j)] = turning;
                }
            }
            rows.set(m, gains, (ACCEL + axis, mass));
        }
        for axis in 0..3 {
            let mut gains = [0.0; TORQUE];
            for (j, gain) in balance.jacobian[axis].iter().enumerate() {
                gains[position(j)] = -age * gain;
            }
            rows.set(GYRO + axis, gains, (TURN + axis, 1.0));
        }
        let mut joint = self.covariance.project(&rows, &self.state);
        let mut agrees = true;
        for (m, axis) in UPWARD_FIRST.into_iter().enumerate() {
            if axis == 0 && !self.settling() {
                self.heed_push(&rows, &mut joint, sum[axis], variance);
            }
            if axis == 2 {
                let missing = sum[axis] - joint.value(m);
                self.held &= posed && missing.abs() > HELD_PART * mass * STANDARD_GRAVITY_M_S2;
            }
            let gate = if self.held { 0.0 } else { GATE };
            let innovation = self.take(&mut joint, m, sum[axis], variance, gate);
            self.count(InnovationKind::Accelerometer, innovation, gate);
            agrees &= innovation * innovation <= gate;
            if axis == 2 && !agrees && posed {
                self.held = true;
                for axis in 0..3 {
                    self.covariance.add_noise(TURN + axis, TURN_VARIANCE);
                }
                joint = self.covariance.project(&rows, &self.state);
                break;
            }
        }
        for axis in (0..3).filter(|axis| input.gyro_believed[*axis]) {
            // The reading itself: the motion's rate is already carried on to now.
            let read = input.motion.rate_rad_s[axis] - age * input.motion.rate_dot_rad_s2[axis];
            let value = read + age * balance.constant[axis];
            let innovation = self.take(&mut joint, GYRO + axis, value, gyro * gyro, GATE);
            self.count(InnovationKind::Gyro, innovation, GATE);
        }
        self.covariance.apply(&rows, &joint, &mut self.state);
        agrees
    }

    /// Drive and brake come through all tyres at once, and the accelerometer feels them before the
    /// bridges' lag shows them: what of its innovation is more than noise is set free in the forward
    /// forces, a quarter of its variance in each, so that they follow at once and say how unsure
    /// they are, and in the rates of the loads that follow.
    fn heed_push(&mut self, rows: &InertialRows, joint: &mut Joint, value: f64, variance: f64) {
        let total = joint.variance(FORWARD) + variance;
        let innovation = value - joint.value(FORWARD);
        let square = innovation * innovation;
        self.pushed = (PUSH * total..PUSH_MAX * total).contains(&square);
        if self.pushed {
            self.covariance.apply(rows, joint, &mut self.state);
            let surplus = square / PUSH - total;
            for wheel in 0..4 {
                let (forward, load_rate) = (FORCE + 3 * wheel, RATE + 3 * wheel + 2);
                self.covariance.add_noise(forward, 0.25 * surplus);
                self.covariance
                    .add_noise(load_rate, PUSH_RATE * PUSH_RATE * surplus);
            }
            *joint = self.covariance.project(rows, &self.state);
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

    /// How long ago the force stood that a strain channel's lagged reading tells, s.
    fn age_s(&self, input: &StepInput<'_>, reading: &Reading) -> f64 {
        input.now.seconds_since(reading.time).clamp(-0.01, 0.05) + self.lag_s
    }

    /// What strut and strain channels of a corner say that have a new reading: a member's force is
    /// A (F - age F') + B (M, with rolling resistance and half-shaft torque) + offset.
    pub(super) fn corner_says(
        &self,
        input: &StepInput<'_>,
        balance: &Balance,
        wheel: usize,
        readings: &mut CornerReadings,
    ) -> CornerSays {
        let corner = &input.corners[wheel];
        let statics = &corner.statics;
        let known =
            statics.members_from_wrench.fixed_columns::<3>(3) * balance.known[wheel].moment_n_m;
        let offset_n: [f64; 6] = std::array::from_fn(|i| statics.members_offset[i] + known[i]);
        // M_y of a newton of load, and the spindle in the contact frame.
        let rolling_m = -self.body.rolling[wheel] * input.motion.velocity_m_s.x.clamp(-1.0, 1.0);
        let spindle = corner.frame.vehicle_from_tyre.transpose() * corner.pose.spindle;
        let of_member = |i: usize, age: f64, factor: f64| {
            let wrench = statics.members_from_wrench.row(i);
            let mut gains = [0.0; CORNER];
            for k in 0..3 {
                gains[k] = factor * wrench[k];
                gains[8] += factor * wrench[3 + k] * spindle[k];
            }
            gains[9] = if wheel % 2 == 0 { gains[8] } else { -gains[8] };
            gains[2] += factor * rolling_m * wrench[4];
            for k in 0..3 {
                gains[3 + k] = -age * gains[k];
            }
            for (k, about) in MOMENT_AXES.into_iter().enumerate() {
                gains[6 + k] = factor * wrench[3 + about];
            }
            gains
        };
        let [force, rate] = [FORCE, RATE].map(|first| first + 3 * wheel);
        let moment = MOMENT + 2 * wheel;
        let mut rows = CornerRows::new(std::array::from_fn(|i| match i {
            0..3 => force + i,
            3..6 => rate + i - 3,
            6..8 => moment + i - 6,
            8 => TORQUE + wheel / 2,
            _ => TORQUE + 2 + wheel / 2,
        }));
        // F = k (l_0 - l) - c l' of a strut that is longer than it seems.
        let stiffness_n_mm = 1e-3 * corner.strut_stiffness_n_m;
        rows.set(
            STRUT,
            of_member(5, 0.0, 1.0),
            (LENGTH + wheel, stiffness_n_mm),
        );
        let strut = corner.strut_read.map(|[force_n, sigma_n]| Said {
            value: force_n - offset_n[5],
            variance: sigma_n * sigma_n,
            tolerance: 0.0,
        });
        let posed = corner.strut_sigma_n.is_finite();
        // Each of the lower arm's tubes carries one half of the ball-normal force, so that its
        // bending gauges see M = F_n d/2, whatever spring and damper do.
        let arm = 0.5 * self.bending_distance_m;
        let bending = arm * statics.ball_normal_per_strut;
        let mut alive = 0;
        let strain = StrainChannel::ALL.map(|channel| {
            let i = channel.index();
            let reading = readings.strain[i].as_mut()?;
            let axial = i < AXIAL.len();
            alive += usize::from(axial && reading.fresh(input.now).is_some());
            if std::mem::replace(&mut reading.taken, true) || !axial && bending == 0.0 {
                return None;
            }
            let age = self.age_s(input, reading);
            let c = &input.channels.0[wheel].strain[i];
            if axial {
                rows.set(
                    STRAIN + i,
                    of_member(i, age, 1.0),
                    (OFFSET + 5 * wheel + i, 1.0),
                );
                Some(Said {
                    value: reading.value - offset_n[i],
                    variance: c.noise_sigma.powi(2),
                    tolerance: member_tolerance_n(posed, reading.value),
                })
            } else {
                rows.set(STRAIN + i, of_member(5, age, bending), (0, 0.0));
                let known = bending * offset_n[5] + arm * statics.ball_normal_offset_n;
                Some(Said {
                    value: reading.value - known,
                    variance: c.noise_sigma.powi(2) + c.offset_sigma.powi(2),
                    tolerance: arm * BENDING_FLOOR_N,
                })
            }
        });
        CornerSays {
            rows,
            strut,
            strut_offset_n: offset_n[5],
            strain,
            alive,
        }
    }

    /// Whether the strain channels together contradict what the state foretells: where they do the
    /// forces are set free before the readings are taken in.
    pub(super) fn heed_surprise(&mut self, said: &[CornerSays; 4]) {
        for (wheel, corner) in said.iter().enumerate() {
            let foretold = corner.rows.view().times(&self.state);
            for i in 0..AXIAL.len() {
                let square = corner.strain[i].and_then(|said| {
                    self.health[wheel][i].foretold_square(said.value - foretold[STRAIN + i])
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

    /// Takes strut and strain channels of one corner in.
    pub(super) fn take_corner(
        &mut self,
        input: &StepInput<'_>,
        says: &CornerSays,
        wheel: usize,
        changes: &mut impl FnMut(ChannelChange),
    ) {
        let corner = &input.corners[wheel];
        if corner.strut_jumped {
            self.doubt_length(wheel);
        }
        let mut joint = self.covariance.project(&says.rows, &self.state);
        if let Some(said) = says.strut {
            let blind = if says.alive < 4 { BLIND_STRUT_N } else { 0.0 };
            let length_mm = 1e3 * (said.value - joint.value(STRUT)) / corner.strut_stiffness_n_m;
            let variance = said.variance + blind * blind;
            let innovation = self.take(&mut joint, STRUT, said.value, variance, STRUT_GATE);
            self.count(InnovationKind::Strut, innovation, STRUT_GATE);
            if !self.settling() {
                self.lengths[wheel].learn(innovation, length_mm);
            }
        }
        for (channel, said) in StrainChannel::ALL.into_iter().zip(&says.strain) {
            let Some(said) = said else { continue };
            let change = self.take_channel(&mut joint, said, wheel, channel);
            if change != Change::None {
                changes(ChannelChange {
                    wheel,
                    channel: Some(channel),
                    faulty: change == Change::Faulty,
                });
            }
        }
        self.covariance.apply(&says.rows, &joint, &mut self.state);
        self.strut_n[wheel] = says.rows.view().of_shared(&self.state)[STRUT] + says.strut_offset_n;
        if says.alive < 4 {
            self.blind = true;
            self.take_expected(input, wheel);
        }
    }

    /// Without strain nothing tells the forces of one axle apart: the vehicle model has to.
    fn take_expected(&mut self, input: &StepInput<'_>, wheel: usize) {
        let load = self.state[FORCE + 3 * wheel + 2].abs();
        let mut rows = Rows::new([FORCE + 3 * wheel, FORCE + 3 * wheel + 1]);
        rows.set(0, [1.0, 0.0], (0, 0.0));
        rows.set(1, [0.0, 1.0], (0, 0.0));
        let mut joint = self.covariance.project(&rows, &self.state);
        for axis in 0..2 {
            // The same guess every step is one piece of knowledge, not many.
            let sigma = BLIND_FORCE[axis] * load + 30.0;
            let variance = sigma * sigma * (BLIND_TIME_S / input.dt).max(1.0);
            let expected = input.expected.0[wheel].force_n[axis];
            self.take(&mut joint, axis, expected, variance, f64::INFINITY);
        }
        self.covariance.apply(&rows, &joint, &mut self.state);
    }

    fn take_channel(
        &mut self,
        joint: &mut Joint,
        said: &Said,
        wheel: usize,
        channel: StrainChannel,
    ) -> Change {
        let i = channel.index();
        let m = STRAIN + i;
        let model = self.health[wheel][i].model_variance(said.tolerance);
        let total = joint.variance(m) + said.variance + model;
        let innovation = said.value - joint.value(m);
        let doubt = FAULT_FLOOR * said.value;
        let square = innovation * innovation / (total + doubt * doubt);
        if self.settling() {
            joint.take(m, said.value, total);
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
            joint.take(m, said.value, total);
        } else {
            self.innovations.rejected(kind);
        }
        change
    }

    /// Takes a row's value in unless it is beyond the gate; returns its innovation in deviations.
    fn take(&self, joint: &mut Joint, m: usize, value: f64, variance: f64, gate: f64) -> f64 {
        let total = joint.variance(m) + variance;
        let innovation = value - joint.value(m);
        if self.settling() || innovation * innovation <= gate * total {
            joint.take(m, value, total);
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
}

/// What one corner's sensors say that have a new reading.
pub(super) struct CornerSays {
    rows: CornerRows,
    strut: Option<Said>,
    /// Strut's force without any on the tyre.
    strut_offset_n: f64,
    strain: [Option<Said>; StrainChannel::COUNT],
    /// How many axial channels are read.
    alive: usize,
}

/// Value of a row.
#[derive(Clone, Copy)]
struct Said {
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
