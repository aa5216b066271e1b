//! Measurement equations.

use model::suspension::CornerStatics;
use nalgebra::{Matrix3, Vector3};
use sample::StrainChannel;

use super::covariance::{Row, position};
use super::{
    ACCEL, Change, ChannelChange, FORCE, Fusion, MOMENT, OFFSET, RATE, SIZE, StepInput, TORQUE,
    TURN,
};
use crate::inputs::CornerReadings;
use crate::statics::AXIAL;

/// Error of geometry and model on a member's force, N, and as a part of it.
const MEMBER_FLOOR_N: f64 = 8.0;
const MEMBER_FLOOR: f64 = 0.01;
const UNPOSED_FLOOR_N: f64 = 60.0;
const UNPOSED_FLOOR: f64 = 0.15;
/// The same on the ball-normal force that bending tells, N.
const BENDING_FLOOR_N: f64 = 10.0;
/// The same on the sum of all forces, N.
const SUM_FLOOR_N: f64 = 40.0;
/// Gate of rows that no channel answers for, squared.
const GATE: f64 = 25.0;
/// How far the vehicle model's horizontal forces may be wrong, as a part of the load.
const BLIND_FORCE: f64 = 0.4;
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
            directions[i] = turn;
        }
        let rate = input.motion.rate_rad_s;
        let constant =
            -(body.inverse * (rate.cross(&(body.inertia * rate + momentum)) + momentum_dot));
        Balance {
            jacobian,
            constant: constant.into(),
            directions,
        }
    }

    /// Specific force and angular rate: sum R F = m f, and the rate itself.
    pub(super) fn take_inertial(&mut self, input: &StepInput<'_>, balance: &Balance) {
        let age = input.motion.inertial_age_s.max(0.0);
        let [gyro, accel] = input.imu_sigma;
        let mass = self.body.mass_kg;
        let u = input.motion.velocity_m_s.x;
        let drag = Vector3::new(self.body.drag * u * u.abs(), 0.0, 0.0);
        let sum = input.motion.specific_force_m_s2 * mass + drag;
        let variance = (mass * accel).powi(2) + SUM_FLOOR_N * SUM_FLOOR_N;
        for axis in 0..3 {
            let mut row = Row::new();
            for (i, direction) in balance.directions.iter().enumerate() {
                for k in 0..3 {
                    let gain = direction[(axis, k)];
                    row.add(FORCE + 3 * i + k, gain);
                    row.add(RATE + 3 * i + k, -age * gain);
                }
            }
            row.add(ACCEL + axis, mass);
            self.take(&row, sum[axis], variance, GATE);
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
        let member =
            |i: usize, age: f64| member_row(&corner.statics, wheel, i, age, rolling, torque);
        if corner.strut_sigma_n.is_finite() {
            let row = member(5, 0.0);
            let value = corner.strut_n - corner.statics.members_offset[5];
            self.take(&row, value, corner.strut_sigma_n.powi(2), 4.0 * GATE);
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
            let value = reading.value - corner.statics.members_offset[i];
            let change = self.take_channel(&row, value, variance, wheel, i);
            if change != Change::None {
                changes(ChannelChange {
                    wheel,
                    channel,
                    faulty: change == Change::Faulty,
                });
            }
        }
        self.take_bending(input, wheel, readings, changes);
        if alive < 4 {
            self.take_expected(input, wheel);
        }
    }

    /// Bending bridges between strut mount and ball joint: each tube carries one half of the
    /// ball-normal force, so that its gauges see M = F_n d/2, whatever spring and damper do.
    fn take_bending(
        &mut self,
        input: &StepInput<'_>,
        wheel: usize,
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
            let known = gain * statics.members_offset[5] + arm * statics.ball_normal_offset_n;
            let c = &input.channels.0[wheel].strain[i];
            let floor = arm * BENDING_FLOOR_N;
            let variance = c.noise_sigma.powi(2) + c.offset_sigma.powi(2) + floor * floor;
            let change = self.take_channel(&row, reading.value - known, variance, wheel, i);
            if change != Change::None {
                changes(ChannelChange {
                    wheel,
                    channel,
                    faulty: change == Change::Faulty,
                });
            }
        }
    }

    /// Without strain nothing tells the forces of one axle apart: the vehicle model has to.
    fn take_expected(&mut self, input: &StepInput<'_>, wheel: usize) {
        let load = self.state[FORCE + 3 * wheel + 2].abs();
        // The same guess every step is one piece of knowledge, not many.
        let variance = (BLIND_FORCE * load + 50.0).powi(2) * (BLIND_TIME_S / input.dt).max(1.0);
        for axis in 0..2 {
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
        let ph = self.covariance.times(row);
        let total: f64 = row.terms().map(|(j, h)| h * ph[j]).sum::<f64>() + variance;
        let innovation = value - row.times(&self.state);
        let square = innovation * innovation / total;
        if self.settling() {
            self.apply(&ph, innovation, total);
            return Change::None;
        }
        let (good, change) = self.health[wheel][i].judge(square);
        if good {
            self.apply(&ph, innovation, total);
        }
        change
    }

    fn take(&mut self, row: &Row, value: f64, variance: f64, gate: f64) {
        let ph = self.covariance.times(row);
        let total: f64 = row.terms().map(|(j, h)| h * ph[j]).sum::<f64>() + variance;
        let innovation = value - row.times(&self.state);
        if self.settling() || innovation * innovation <= gate * total {
            self.apply(&ph, innovation, total);
        }
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
