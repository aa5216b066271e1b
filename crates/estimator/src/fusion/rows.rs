//! Measurement equations.

use model::suspension::CornerStatics;
use nalgebra::{Matrix3, Vector3};
use sample::StrainChannel;

use super::covariance::{Row, position};
use super::{
    ACCEL, Change, ChannelChange, FORCE, Fusion, LENGTH, MOMENT, OFFSET, RATE, SIZE, StepInput,
    TORQUE, TURN,
};
use crate::corners::CornerState;
use crate::inputs::CornerReadings;
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
/// Gate of rows that no channel answers for, squared.
const GATE: f64 = 25.0;
/// How far the vehicle model's F_x and F_y may be wrong, as a part of the load.
const BLIND_FORCE: [f64; 2] = [0.4, 0.1];
/// Strut's force where no strain tells what of it F_x and F_y carry, N.
const BLIND_STRUT_N: f64 = 70.0;
/// How long one such guess lasts, s.
const BLIND_TIME_S: f64 = 0.1;

/// The balance of moments at one instant: w' = jacobian (F, M) + constant.
#[derive(Clone, Debug)]
pub(super) struct Balance {
    pub(super) jacobian: [[f64; 24]; 3],
    constant: [f64; 3],
    directions: [Matrix3<f64>; 4],
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
            of_known += of_moment * self.known_moment_n_m(i, corner, input.motion.velocity_m_s.x);
            directions[i] = turn;
        }
        let rate = input.motion.rate_rad_s;
        let constant = of_known
            - (body.inverse * (rate.cross(&(body.inertia * rate + momentum)) + momentum_dot));
        Balance {
            jacobian,
            constant: constant.into(),
            directions,
        }
    }

    /// Moment that goes with the force of the last step, N m: M_x of the cambered tread, and of a
    /// rolling wheel M_z = -n F_y of a trail n that is a sixth of the contact's length and vanishes
    /// as the tyre begins to slide (brush model).
    fn known_moment_n_m(&self, wheel: usize, corner: &CornerState, speed_m_s: f64) -> Vector3<f64> {
        let normal = corner.frame.vehicle_from_tyre.column(2).into_owned();
        let inclination = corner.pose.spindle.dot(&normal).clamp(-1.0, 1.0).asin();
        let tyre = &self.body.tyres[wheel];
        let lateral = self.state[FORCE + 3 * wheel + 1];
        let load = self.state[FORCE + 3 * wheel + 2].max(0.0);
        let pressed = load / tyre.vertical_stiffness_n_m.max(1.0);
        let contact = 2.0 * (2.0 * tyre.unloaded_radius_m * pressed).sqrt();
        let sliding = lateral.abs() / (tyre.friction * load).max(1.0);
        let trail = contact / 6.0 * (1.0 - sliding).max(0.0) * speed_m_s.abs().min(1.0);
        let tipping = -tyre.tread_moment_n_m(load, inclination);
        Vector3::new(tipping, 0.0, -trail * lateral)
    }

    /// Specific force of the inertial unit and angular rate. With r from the centre of gravity to
    /// the unit, m f = sum R F + m (w' x r + w x (w x r)): the angular acceleration comes from the
    /// balance of moments, since a differentiated gyro would be three times noisier than the
    /// accelerometers. Tells whether the unit agrees with the forces.
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
        for axis in 0..3 {
            let mut row = Row::new();
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
            let innovation = self.take(&row, sum[axis], variance, GATE);
            agrees &= innovation * innovation <= GATE;
        }
        for axis in 0..3 {
            let mut row = Row::new();
            row.add(TURN + axis, 1.0);
            for (j, gain) in balance.jacobian[axis].iter().enumerate() {
                row.add(position(j), -age * gain);
            }
            let value = input.motion.rate_rad_s[axis] + age * balance.constant[axis];
            self.take(&row, value, gyro * gyro, GATE);
        }
        agrees
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

    /// Strut and strain channels of one corner.
    pub(super) fn take_corner(
        &mut self,
        input: &StepInput<'_>,
        wheel: usize,
        readings: &mut CornerReadings,
        changes: &mut impl FnMut(ChannelChange),
    ) {
        let corner = &input.corners[wheel];
        let rolling = -self.body.rolling[wheel] * input.motion.velocity_m_s.x.clamp(-1.0, 1.0);
        let torque = corner.frame.vehicle_from_tyre.transpose() * corner.pose.spindle;
        let known = self.known_moment_n_m(wheel, corner, input.motion.velocity_m_s.x);
        let gains = corner.statics.members_from_wrench.fixed_columns::<3>(3) * known;
        let offset: [f64; 6] = std::array::from_fn(|i| corner.statics.members_offset[i] + gains[i]);
        let member =
            |i: usize, age: f64| member_row(&corner.statics, wheel, i, age, rolling, torque);
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
        if corner.strut_sigma_n.is_finite() {
            // F = k (l_0 - l) - c l' of a strut that is longer than it seems.
            let mut row = member(5, 0.0);
            row.add(LENGTH + wheel, 1e-3 * corner.strut_stiffness_n_m);
            let value = corner.strut_n - offset[5];
            let length_mm = 1e3 * (value - row.times(&self.state)) / corner.strut_stiffness_n_m;
            let variance = corner.strut_sigma_n.powi(2) + blind * blind;
            let innovation = self.take(&row, value, variance, 4.0 * GATE);
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
            if reading.taken {
                continue;
            }
            reading.taken = true;
            let age = input.now.seconds_since(reading.time).clamp(-0.01, 0.05) + self.lag_s;
            let mut row = member(i, age);
            row.add(OFFSET + 5 * wheel + i, 1.0);
            let noise = input.channels.0[wheel].strain[channel.index()].noise_sigma;
            let floor = member_floor_n(corner.strut_sigma_n.is_finite(), reading.value);
            let variance = noise * noise + floor * floor;
            let value = reading.value - offset[i];
            let change = self.take_channel(&row, value, variance, wheel, i);
            if change != Change::None {
                changes(ChannelChange {
                    wheel,
                    channel: Some(channel),
                    faulty: change == Change::Faulty,
                });
            }
        }
        self.take_bending(input, wheel, offset[5], readings, changes);
        self.strut_n[wheel] = member(5, 0.0).times(&self.state) + offset[5];
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
        wheel: usize,
        strut_offset_n: f64,
        readings: &mut CornerReadings,
        changes: &mut impl FnMut(ChannelChange),
    ) {
        let corner = &input.corners[wheel];
        let statics = &corner.statics;
        let arm = 0.5 * self.bending_distance_m;
        let gain = arm * statics.ball_normal_per_strut;
        if gain == 0.0 {
            return;
        }
        let rolling = -self.body.rolling[wheel] * input.motion.velocity_m_s.x.clamp(-1.0, 1.0);
        let torque = corner.frame.vehicle_from_tyre.transpose() * corner.pose.spindle;
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
            let age = input.now.seconds_since(reading.time).clamp(-0.01, 0.05) + self.lag_s;
            let row = member_row(statics, wheel, 5, age, rolling, torque).scaled(gain);
            let known = gain * strut_offset_n + arm * statics.ball_normal_offset_n;
            let c = &input.channels.0[wheel].strain[i];
            let floor = arm * BENDING_FLOOR_N;
            let variance = c.noise_sigma.powi(2) + c.offset_sigma.powi(2) + floor * floor;
            let change = self.take_channel(&row, reading.value - known, variance, wheel, i);
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
                let mut row = Row::new();
                row.add(FORCE + 3 * wheel + axis, 1.0);
                self.take(&row, expected, variance, f64::INFINITY);
            }
        }
    }

    fn take_channel(
        &mut self,
        row: &Row,
        value: f64,
        variance: f64,
        wheel: usize,
        i: usize,
    ) -> Change {
        let variance = variance + self.health[wheel][i].model_variance();
        let ph = self.covariance.times(row);
        let total: f64 = row.terms().map(|(j, h)| h * ph[j]).sum::<f64>() + variance;
        let innovation = value - row.times(&self.state);
        let doubt = FAULT_FLOOR * value;
        let square = innovation * innovation / (total + doubt * doubt);
        if self.settling() {
            self.apply(&ph, innovation, total);
            return Change::None;
        }
        let (good, change) = self.health[wheel][i].judge(square, self.agility.open());
        self.agility.surprise(wheel, square);
        if good {
            self.health[wheel][i].learn(innovation);
            self.apply(&ph, innovation, total);
        }
        change
    }

    /// Takes a value in unless it is beyond the gate; returns its innovation in deviations.
    fn take(&mut self, row: &Row, value: f64, variance: f64, gate: f64) -> f64 {
        let ph = self.covariance.times(row);
        let total: f64 = row.terms().map(|(j, h)| h * ph[j]).sum::<f64>() + variance;
        let innovation = value - row.times(&self.state);
        if self.settling() || innovation * innovation <= gate * total {
            self.apply(&ph, innovation, total);
        }
        innovation / total.sqrt()
    }

    fn apply(&mut self, ph: &[f64; SIZE], innovation: f64, total: f64) {
        if total.is_nan() || total <= 0.0 || !innovation.is_finite() {
            return;
        }
        let gain = innovation / total;
        for (x, p) in self.state.iter_mut().zip(ph) {
            *x += gain * p;
        }
        self.covariance.reduce(ph, total);
    }
}

/// Error of the linkage's model on a member's force, N: where no deflection tells the pose, the
/// design position stands in for it and is far off.
fn member_floor_n(posed: bool, force_n: f64) -> f64 {
    if posed {
        MEMBER_FLOOR_N + MEMBER_FLOOR * force_n.abs()
    } else {
        UNPOSED_FLOOR_N + UNPOSED_FLOOR * force_n.abs()
    }
}

/// Force of member i of one corner: A (F - age F') + B (M, with rolling resistance and half-shaft
/// torque).
fn member_row(
    statics: &CornerStatics,
    wheel: usize,
    i: usize,
    age: f64,
    rolling: f64,
    torque: Vector3<f64>,
) -> Row {
    let gains = statics.members_from_wrench.row(i);
    let mut row = Row::new();
    for k in 0..3 {
        let mut gain = gains[k];
        if k == 2 {
            gain += rolling * gains[4];
        }
        row.add(FORCE + 3 * wheel + k, gain);
        row.add(RATE + 3 * wheel + k, -age * gain);
        row.add(MOMENT + 3 * wheel + k, gains[3 + k]);
    }
    let of_torque = gains[3] * torque.x + gains[4] * torque.y + gains[5] * torque.z;
    row.add(TORQUE + wheel / 2, of_torque);
    row
}
