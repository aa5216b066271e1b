//! The filter that carries attitude, velocity and the constants through a drive.

use std::ops::AddAssign;

use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, Vector3};
use sample::STANDARD_GRAVITY_M_S2;

use super::readings::{Motion, Reading};

/// States: turn of earth axes, velocity, accelerometer and gyro bias, lever arm, latency of
/// velocity and of attitude, what the mounting adds to yaw, pitch and roll, what is left of the
/// inertial unit's misalignment.
pub(super) const N: usize = 23;
/// The first of them, turn and velocity, move; the others are constants.
const MOVING: usize = 6;
const TURN: usize = 0;
const VELOCITY: usize = 3;
const ACCEL_BIAS: usize = 6;
const GYRO_BIAS: usize = 9;
pub(super) const LEVER: usize = 12;
pub(super) const VELOCITY_LATENCY: usize = 15;
pub(super) const ATTITUDE_LATENCY: usize = 16;
pub(super) const OFFSET: usize = 17;
const MISALIGNMENT: usize = 20;
/// What is known beforehand, standard deviations in the order of the states.
const PRIOR: [f64; 9] = [0.1, 1.0, 0.15, 0.02, 0.7, 0.1, 0.1, 0.15, 1e-3];
/// A reading further off than this many deviations is left out.
const GATE: f64 = 6.0;

/// The filter between two readings.
pub(super) struct Filter {
    pub(super) earth_from_body: Rotation3<f64>,
    pub(super) velocity: Vector3<f64>,
    pub(super) accel_bias: Vector3<f64>,
    pub(super) gyro_bias: Vector3<f64>,
    pub(super) lever: Vector3<f64>,
    /// Latencies beyond those that the instants are moved by already.
    pub(super) latency: [f64; 2],
    pub(super) offset: Vector3<f64>,
    /// Small turn m from body to sensor axes beyond the one that is taken off: f + m x f, w + m x w
    /// are read.
    pub(super) misalignment: Vector3<f64>,
    covariance: SMatrix<f64, N, N>,
    /// What the gyros' noise seemed to tell of each axis of the lever arm, 1/m^2.
    told_by_noise: f64,
}

impl Filter {
    pub(super) fn new(
        start: (f64, [f64; 3]),
        events: &[(f64, Reading)],
        lever_m: [f64; 3],
    ) -> Self {
        let [yaw, pitch, roll] = start
            .1
            .map(|angle| if angle.is_finite() { angle } else { 0.0 });
        let velocity = events.iter().find_map(|(time_s, reading)| match reading {
            Reading::Velocity(value) if *time_s >= start.0 => Some(Vector3::from(*value)),
            _ => None,
        });
        let sizes = [3, 3, 3, 3, 3, 1, 1, 3, 3];
        let mut covariance = SMatrix::<f64, N, N>::zeros();
        let mut state = 0;
        for (size, sigma) in sizes.into_iter().zip(PRIOR) {
            for _ in 0..size {
                covariance[(state, state)] = sigma * sigma;
                state += 1;
            }
        }
        Self {
            earth_from_body: Rotation3::from_euler_angles(roll, pitch, yaw),
            velocity: velocity.unwrap_or_default(),
            accel_bias: Vector3::zeros(),
            gyro_bias: Vector3::zeros(),
            lever: lever_m.into(),
            latency: [0.0; 2],
            offset: Vector3::zeros(),
            misalignment: Vector3::zeros(),
            covariance,
            told_by_noise: 0.0,
        }
    }

    pub(super) fn parameters(&self, latency_s: [f64; 2]) -> SVector<f64, N> {
        let mut p = SVector::<f64, N>::zeros();
        p.fixed_rows_mut::<3>(ACCEL_BIAS)
            .copy_from(&self.accel_bias);
        p.fixed_rows_mut::<3>(GYRO_BIAS).copy_from(&self.gyro_bias);
        p.fixed_rows_mut::<3>(LEVER).copy_from(&self.lever);
        p[VELOCITY_LATENCY] = latency_s[0] + self.latency[0];
        p[ATTITUDE_LATENCY] = latency_s[1] + self.latency[1];
        p.fixed_rows_mut::<3>(OFFSET).copy_from(&self.offset);
        p
    }

    pub(super) fn propagate(
        &mut self,
        dt: f64,
        force: Vector3<f64>,
        rate: Vector3<f64>,
        sigma: [f64; 2],
    ) {
        let body = self.earth_from_body.into_inner();
        let force = force - self.accel_bias - self.misalignment.cross(&force);
        let rate = rate - self.gyro_bias - self.misalignment.cross(&rate);
        let half = Rotation3::new(rate * (0.5 * dt));
        let push = (self.earth_from_body * half) * force;
        self.velocity += (push - Vector3::z() * STANDARD_GRAVITY_M_S2) * dt;
        self.earth_from_body *= Rotation3::new(rate * dt);
        let bias = -body * dt;
        // d(-m x w) = w x dm.
        let [turned, pushed] = [rate, force].map(|felt| body * cross(felt) * dt);
        let lean = -cross(push) * dt;
        let own = |state: usize| self.covariance.fixed_columns::<3>(state);
        let turn = own(GYRO_BIAS) * bias.transpose() + own(MISALIGNMENT) * turned.transpose();
        let velocity = own(TURN) * lean.transpose()
            + own(ACCEL_BIAS) * bias.transpose()
            + own(MISALIGNMENT) * pushed.transpose();
        let mut moved = self.covariance.fixed_columns::<MOVING>(0).into_owned();
        moved.fixed_columns_mut::<3>(TURN).add_assign(turn);
        moved.fixed_columns_mut::<3>(VELOCITY).add_assign(velocity);
        let own = |state: usize| moved.fixed_rows::<3>(state);
        let turn = bias * own(GYRO_BIAS) + turned * own(MISALIGNMENT);
        let velocity = lean * own(TURN) + bias * own(ACCEL_BIAS) + pushed * own(MISALIGNMENT);
        self.covariance
            .fixed_rows_mut::<MOVING>(0)
            .copy_from(&moved.transpose());
        moved.fixed_rows_mut::<3>(TURN).add_assign(turn);
        moved.fixed_rows_mut::<3>(VELOCITY).add_assign(velocity);
        self.covariance
            .fixed_columns_mut::<MOVING>(0)
            .copy_from(&moved);
        // A reading stands for the time until the next: its noise adds up as a random walk.
        let interval_s = 0.01_f64.max(dt);
        for axis in 0..3 {
            self.covariance[(TURN + axis, TURN + axis)] += sigma[1].powi(2) * interval_s * dt;
            self.covariance[(VELOCITY + axis, VELOCITY + axis)] +=
                sigma[0].powi(2) * interval_s * dt;
        }
    }

    /// The horizontal normalised innovations; none where the reading is left out. `sigma` is the
    /// reading's, `rate_sigma` that of one reading of the gyros.
    pub(super) fn push_velocity(
        &mut self,
        read: &[f64; 3],
        motion: &Motion,
        sigma: f64,
        rate_sigma: f64,
    ) -> Option<[f64; 2]> {
        let body = self.earth_from_body.into_inner();
        let rate = motion.rate - self.gyro_bias - self.misalignment.cross(&motion.rate);
        let swing = body * rate.cross(&self.lever);
        let push = body * (motion.force - self.accel_bias) - Vector3::z() * STANDARD_GRAVITY_M_S2;
        let whirl = motion.rate_dot.cross(&self.lever) + rate.cross(&rate.cross(&self.lever));
        let pull = push + body * whirl;
        let expected = self.velocity + body * motion.rounding + swing - pull * self.latency[0];
        let mut h = SMatrix::<f64, 3, N>::zeros();
        h.fixed_view_mut::<3, 3>(0, VELOCITY)
            .copy_from(&Matrix3::identity());
        h.fixed_view_mut::<3, 3>(0, TURN).copy_from(&-cross(swing));
        h.fixed_view_mut::<3, 3>(0, GYRO_BIAS)
            .copy_from(&(body * cross(self.lever)));
        h.fixed_view_mut::<3, 3>(0, LEVER)
            .copy_from(&(body * cross(rate)));
        h.fixed_view_mut::<3, 3>(0, MISALIGNMENT)
            .copy_from(&-(body * cross(self.lever) * cross(rate)));
        h.fixed_view_mut::<3, 1>(0, VELOCITY_LATENCY)
            .copy_from(&-pull);
        let residual = Vector3::from(*read) - expected;
        let mut normalised = [0.0; 2];
        let mut delta = SVector::<f64, N>::zeros();
        for axis in 0..3 {
            let row = h.row(axis).transpose();
            let variance = (row.transpose() * self.covariance * row)[(0, 0)] + sigma * sigma;
            let innovation = residual[axis] - row.dot(&delta);
            if innovation * innovation > GATE * GATE * variance {
                self.inject(&delta);
                return None;
            }
            if axis < 2 {
                normalised[axis] = innovation / variance.sqrt();
            }
            self.scalar(&row, residual[axis], sigma * sigma, &mut delta);
        }
        self.forget_noise(rate_sigma.powi(2) / motion.rate_readings, sigma, &mut delta);
        self.inject(&delta);
        Some(normalised)
    }

    /// Takes back what the gyros' noise n tells of the lever arm, being a part of w: it adds
    /// E[(n x)^T (n x)] = 2 var(n) to the equations' matrix and nothing to their right side, and would
    /// shorten the arm.
    fn forget_noise(&mut self, rate_variance: f64, sigma: f64, delta: &mut SVector<f64, N>) {
        if rate_variance <= 0.0 {
            return;
        }
        let told = 2.0 * rate_variance / (sigma * sigma);
        self.told_by_noise += told;
        for axis in 0..3 {
            let mut row = SVector::<f64, N>::zeros();
            row[LEVER + axis] = 1.0;
            self.scalar(&row, -self.lever[axis], -told.recip(), delta);
        }
    }

    /// Covariance of the constants at the end. The right side of the equations holds noise times
    /// noise as well, which the covariance P of a filter does not know: P + P D P, where D is what
    /// [`Self::forget_noise`] took back.
    pub(super) fn covariance_at_end(&self) -> SMatrix<f64, N, N> {
        let arm = self.covariance.fixed_columns::<3>(LEVER);
        self.covariance + arm * arm.transpose() * self.told_by_noise
    }

    pub(super) fn push_attitude(&mut self, read: &[f64; 3], motion: &Motion, sigma: [f64; 4]) {
        let (roll, pitch, yaw) = self.earth_from_body.euler_angles();
        let (sine, cosine) = math::sin_cos(yaw);
        let (tangent, secant) = (math::tan(pitch), 1.0 / math::cos(pitch));
        // How a turn of earth axes moves yaw, pitch and roll.
        let slopes = [
            Vector3::new(tangent * cosine, tangent * sine, 1.0),
            Vector3::new(-sine, cosine, 0.0),
            Vector3::new(secant * cosine, secant * sine, 0.0),
        ];
        let rate = self.earth_from_body * (motion.rate - self.gyro_bias);
        let mut delta = SVector::<f64, N>::zeros();
        for (axis, nominal) in [yaw, pitch, roll].into_iter().enumerate() {
            if !read[axis].is_finite() {
                continue;
            }
            let speed = slopes[axis].dot(&rate);
            let expected = nominal + self.offset[axis] - speed * self.latency[1];
            let residual = wrap(read[axis] - expected);
            let mut row = SVector::<f64, N>::zeros();
            row.fixed_rows_mut::<3>(TURN).copy_from(&slopes[axis]);
            row[ATTITUDE_LATENCY] = -speed;
            row[OFFSET + axis] = 1.0;
            let variance = sigma[1 + axis].powi(2);
            let total = (row.transpose() * self.covariance * row)[(0, 0)] + variance;
            let innovation = residual - row.dot(&delta);
            if innovation * innovation <= GATE * GATE * total {
                self.scalar(&row, residual, variance, &mut delta);
            }
        }
        self.inject(&delta);
    }

    fn scalar(
        &mut self,
        row: &SVector<f64, N>,
        residual: f64,
        variance: f64,
        delta: &mut SVector<f64, N>,
    ) {
        let gain = self.covariance * row;
        let total = row.dot(&gain) + variance;
        let innovation = residual - row.dot(delta);
        *delta += gain * (innovation / total);
        self.covariance.ger(-total.recip(), &gain, &gain, 1.0);
    }

    fn inject(&mut self, delta: &SVector<f64, N>) {
        let part = |state: usize| delta.fixed_rows::<3>(state).into_owned();
        self.earth_from_body = Rotation3::new(part(TURN)) * self.earth_from_body;
        self.velocity += part(VELOCITY);
        self.accel_bias += part(ACCEL_BIAS);
        self.gyro_bias += part(GYRO_BIAS);
        self.lever += part(LEVER);
        self.latency[0] += delta[VELOCITY_LATENCY];
        self.latency[1] += delta[ATTITUDE_LATENCY];
        self.offset += part(OFFSET);
        self.misalignment += part(MISALIGNMENT);
        self.covariance = (self.covariance + self.covariance.transpose()) * 0.5;
    }
}

/// The matrix of a vector product from the left.
fn cross(v: Vector3<f64>) -> Matrix3<f64> {
    v.cross_matrix()
}

fn wrap(angle_rad: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    angle_rad - turn * (angle_rad / turn).round()
}
