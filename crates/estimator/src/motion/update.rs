//! Corrections of the motion filter by measurements.

use nalgebra::{Rotation3, SMatrix, SVector, Vector3};
use sample::{InnovationKind, LogTime};

use crate::gaussian::beyond;
use crate::trace::{Operation, Update};

use super::history::Pose;
use super::jumps::VELOCITY_VALUE;
use super::{
    ACCEL_BIAS, ATTITUDE, AcceptanceCounter, GYRO_BIAS, MotionFilter, STATES, VELOCITY,
    VelocityReceiver, cross, orthonormal, wrap,
};

/// Outcome of one measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The measurement was used.
    Used,
    /// The measurement contradicts the state and was rejected.
    Rejected,
    /// The measurement cannot be compared: too old, not finite, or no state to compare with.
    Unusable,
}

/// Residual of a GNSS velocity with its measurement rows.
struct VelocityResidual {
    residual: Vector3<f64>,
    sigma: [f64; 3],
    rows: [SVector<f64, STATES>; 3],
    /// Whether the receiver sent the same nonzero velocity as before, or one component is stuck.
    repeated: bool,
    /// Whether one component is stuck.
    stuck: bool,
}

impl MotionFilter {
    /// GNSS velocity of a receiver's antenna, m/s, earth axes, valid at `valid`.
    pub fn push_velocity(
        &mut self,
        valid: LogTime,
        receiver: VelocityReceiver,
        velocity_m_s: Vector3<f64>,
        sigma_m_s: Option<[f64; 3]>,
    ) -> Verdict {
        let t = self.tuning;
        let own = receiver as usize;
        if self.attitude_lost || !velocity_m_s.iter().all(|v| v.abs() < t.velocity_max_m_s) {
            return Verdict::Unusable;
        }
        let Some(pose) = self.history.at(valid) else {
            return Verdict::Unusable;
        };
        let speed = math::hypot(velocity_m_s.x, velocity_m_s.y);
        if !self.heading_known && speed > t.course_speed_min_m_s {
            // Without a heading source a vehicle is assumed to drive forward.
            let (_, _, yaw) = pose.earth_from_body.euler_angles();
            let course = math::atan2(velocity_m_s.y, velocity_m_s.x);
            self.adopt_yaw(wrap(course - yaw), t.course_sigma_rad);
            self.heading_known = true;
            return Verdict::Used;
        }
        let measured = self.velocity_residual(valid, own, &pose, velocity_m_s, sigma_m_s);
        let mut rejected = measured.stuck || measured.repeated && self.velocities[own].rejected;
        for axis in 0..3 {
            let variance =
                self.covariance[(VELOCITY + axis, VELOCITY + axis)] + measured.sigma[axis].powi(2);
            rejected |= beyond(t.gate_sigma, measured.residual[axis], variance);
        }
        rejected &= self.velocity_time.is_some();
        self.velocities[own].rejected = rejected;
        if rejected {
            self.reject_velocity(valid, own, &measured);
            return Verdict::Rejected;
        }
        let mut delta = SVector::<f64, STATES>::zeros();
        for (axis, h) in measured.rows.iter().enumerate() {
            let (residual, variance) = (measured.residual[axis], measured.sigma[axis].powi(2));
            if !measured.repeated {
                let innovation = residual - h.dot(&delta);
                self.compare(VELOCITY_VALUE + axis, h, innovation, variance);
            }
            let kind = Some(InnovationKind::GnssVelocity);
            self.scalar(kind, h, residual, variance, &mut delta);
        }
        self.inject(&delta);
        self.seek_jump(valid);
        self.velocities[own].acceptance.used(&t.receivers);
        self.velocity_time = Some(valid);
        Verdict::Used
    }

    /// Residual of a velocity against the state of its own time. The first velocity is adopted.
    ///
    /// A receiver that is stuck repeats its value and contradicts the state more and more while the
    /// body moves on. Its value is rejected until it changes, and is not adopted. A receiver that
    /// stands may repeat zero. One component alone can be stuck, too.
    fn velocity_residual(
        &mut self,
        valid: LogTime,
        own: usize,
        pose: &Pose,
        velocity_m_s: Vector3<f64>,
        sigma_m_s: Option<[f64; 3]>,
    ) -> VelocityResidual {
        let t = self.tuning;
        let arm = self.settings.antenna_m[own] - self.settings.imu_m;
        let swing = pose.earth_from_body * pose.rate_rad_s.cross(&arm);
        let mut residual = velocity_m_s - pose.velocity_m_s - swing;
        let floor = self.settings.velocity_sigma_m_s;
        let sigma = sigma_m_s.map_or([floor; 3], |s| {
            s.map(|s| {
                if s.is_finite() {
                    s.max(t.stated_sigma_min * floor)
                } else {
                    floor
                }
            })
        });
        let sigma = self.late_velocity_sigma(pose, sigma);
        if self.velocity_time.is_none() {
            self.adopt_velocity(residual);
            residual = Vector3::zeros();
            if !self.heading_known {
                self.forget_yaw(t.heading_unknown_sigma_rad);
            }
        }
        let receiver = &mut self.velocities[own];
        let speed = math::hypot(velocity_m_s.x, velocity_m_s.y);
        let repeated =
            receiver.at.is_some() && receiver.velocity_m_s == velocity_m_s && speed > 0.0;
        (receiver.at, receiver.velocity_m_s) = (Some(valid), velocity_m_s);
        let by_state = pose.velocity_m_s + swing;
        let moves = math::hypot(by_state.x, by_state.y) > t.receivers.stuck_speed_m_s;
        let stuck_now: [bool; 3] = std::array::from_fn(|axis| {
            receiver.stuck[axis].take(
                velocity_m_s[axis],
                moves.then_some(by_state[axis]),
                t.receivers.stuck_values,
                t.receivers.stuck_change_m_s,
            )
        });
        let stuck = stuck_now.contains(&true) && !repeated;
        let slope = -cross(swing);
        let rows = std::array::from_fn::<_, 3, _>(|axis| {
            let mut h = SVector::<f64, STATES>::zeros();
            h[VELOCITY + axis] = 1.0;
            for j in 0..3 {
                h[ATTITUDE + j] = slope[(axis, j)];
            }
            h
        });
        VelocityResidual {
            residual,
            sigma,
            rows,
            repeated: repeated || stuck,
            stuck,
        }
    }

    /// Counts a rejected velocity. If GNSS velocity and attitude both contradict the state, the
    /// filter starts again from GNSS; after too many rejections the receiver's next value is adopted,
    /// unless the other receiver agrees with the state.
    fn reject_velocity(&mut self, valid: LogTime, own: usize, measured: &VelocityResidual) {
        let t = self.tuning.receivers;
        let imu_consistent = self.is_imu_consistent();
        if !measured.repeated {
            (self.velocities[own].acceptance).contradicted(imu_consistent);
            for (axis, h) in measured.rows.iter().enumerate() {
                let (residual, variance) = (measured.residual[axis], measured.sigma[axis].powi(2));
                self.compare(VELOCITY_VALUE + axis, h, residual, variance);
            }
        }
        let too_many = self.velocities[own].acceptance.too_many(&t);
        let other = &self.velocities[1 - own];
        let alone = !(other.is_active(valid, t.active_s) && other.acceptance.uses > 0);
        if self.is_contradicted(valid) {
            self.restart_from_gnss();
        } else if too_many && alone {
            self.resets += 1;
            self.velocities[own].acceptance = AcceptanceCounter::adopted();
            self.velocity_time = None;
        }
        for _ in 0..3 {
            self.innovations.rejected(InnovationKind::GnssVelocity);
        }
        self.seek_jump(valid);
    }

    /// Whether GNSS velocity and attitude both contradict the state.
    pub(super) fn is_contradicted(&self, now: LogTime) -> bool {
        let t = &self.tuning.receivers;
        let active =
            (self.velocities.iter()).filter(|receiver| receiver.is_active(now, t.active_s));
        let velocity = active
            .map(|receiver| receiver.acceptance.rejections_unconfirmed)
            .min();
        let attitude = self.attitude_acceptance.rejections_unconfirmed;
        velocity.unwrap_or(0).min(attitude) >= t.contradictions
    }

    fn adopt_velocity(&mut self, residual: Vector3<f64>) {
        self.velocity_m_s += residual;
        self.history.correct(Rotation3::identity(), residual);
        for i in VELOCITY..VELOCITY + 3 {
            let sigma = self.tuning.adopted_velocity_sigma_m_s;
            self.forget(i, sigma * sigma);
        }
    }

    pub(super) fn adopt_yaw(&mut self, turn: f64, sigma: f64) {
        let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), turn);
        self.earth_from_body = rotation * self.earth_from_body;
        self.turn_covariance(&rotation);
        self.forget_yaw(sigma);
        // A velocity that is known in earth axes stays. A velocity that is known in body axes turns
        // with the body, and its lateral error is the heading's: d v = d psi z x v.
        if self.velocity_time.is_some() {
            self.history.correct(rotation, Vector3::zeros());
        } else {
            self.history.turn(rotation);
            self.velocity_m_s = rotation * self.velocity_m_s;
            let mut spread = SMatrix::identity();
            spread[(VELOCITY, ATTITUDE + 2)] = -self.velocity_m_s.y;
            spread[(VELOCITY + 1, ATTITUDE + 2)] = self.velocity_m_s.x;
            self.mix(&spread);
        }
    }

    /// Turns the errors in earth axes with the body: they were estimated in the body's axes.
    fn turn_covariance(&mut self, rotation: &Rotation3<f64>) {
        let mut turn = SMatrix::<f64, STATES, STATES>::identity();
        for block in [ATTITUDE, VELOCITY] {
            let mut part = turn.fixed_view_mut::<3, 3>(block, block);
            if block == ATTITUDE || self.velocity_time.is_none() {
                part.copy_from(rotation.matrix());
            }
        }
        self.mix(&turn);
    }

    /// Makes the heading error independent of all others, with this standard deviation, rad.
    pub(super) fn forget_yaw(&mut self, sigma: f64) {
        self.forget(ATTITUDE + 2, sigma * sigma);
    }

    /// Velocity along the unit vector `direction`, body axes, of a point `arm_m` from the centre of
    /// gravity: forward from wheel speeds, leftward from tyre slip, zero along the ground's normal.
    /// `kind` counts the innovation; `None` for a constraint that no sensor measures.
    pub fn push_body_velocity(
        &mut self,
        direction: Vector3<f64>,
        arm_m: Vector3<f64>,
        value_m_s: f64,
        sigma_m_s: f64,
        kind: Option<InnovationKind>,
    ) -> Verdict {
        if !value_m_s.is_finite() || self.time.is_none() {
            return Verdict::Unusable;
        }
        let arm = arm_m - self.settings.imu_m;
        let rate = self.rate - self.gyro_bias;
        let body = self.earth_from_body.inverse() * self.velocity_m_s;
        let residual = value_m_s - direction.dot(&(body + rate.cross(&arm)));
        let earth = self.earth_from_body * direction;
        let across = -cross(self.velocity_m_s) * earth;
        // d(w x r) = -(d b_g) x r = r x d b_g
        let bias = -cross(arm) * direction;
        let mut h = SVector::<f64, STATES>::zeros();
        h.fixed_rows_mut::<3>(VELOCITY).copy_from(&earth);
        h.fixed_rows_mut::<3>(ATTITUDE).copy_from(&across);
        h.fixed_rows_mut::<3>(GYRO_BIAS).copy_from(&bias);
        let variance = (h.transpose() * self.covariance * h)[0] + sigma_m_s * sigma_m_s;
        if beyond(self.tuning.gate_sigma, residual, variance) {
            if let Some(kind) = kind {
                self.innovations.rejected(kind);
            }
            return Verdict::Rejected;
        }
        let mut delta = SVector::<f64, STATES>::zeros();
        self.scalar(kind, &h, residual, sigma_m_s * sigma_m_s, &mut delta);
        self.inject(&delta);
        Verdict::Used
    }

    /// One scalar measurement. `residual` is against the nominal state, `delta` the correction of the
    /// measurements before it.
    pub(super) fn scalar(
        &mut self,
        kind: Option<InnovationKind>,
        h: &SVector<f64, STATES>,
        residual: f64,
        variance: f64,
        delta: &mut SVector<f64, STATES>,
    ) {
        let ph = self.covariance * h;
        let total = h.dot(&ph) + variance;
        if total.is_nan() || total <= 0.0 || !residual.is_finite() {
            return;
        }
        let innovation = residual - h.dot(delta);
        if let Some(kind) = kind {
            self.innovations.used(kind, innovation * innovation / total);
        }
        self.jumps.correct(h, &(ph / total));
        *delta += ph * (innovation / total);
        self.covariance -= ph * ph.transpose() / total;
        self.trace.note(|| {
            let row = h.iter().copied().enumerate();
            Operation::Update(Box::new(Update {
                row: row.filter(|(_, h)| *h != 0.0).collect(),
                value: residual,
                innovation,
                variance,
                total,
                gain: ph / total,
            }))
        });
    }

    /// Passes an innovation to the jump detector.
    pub(super) fn compare(
        &mut self,
        value: usize,
        h: &SVector<f64, STATES>,
        innovation: f64,
        variance: f64,
    ) {
        let total = (h.transpose() * self.covariance * h)[0] + variance;
        self.jumps.compare(value, h, innovation, total);
    }

    /// Inflates the covariance along the signature of a jump, if one is found.
    pub(super) fn seek_jump(&mut self, now: LogTime) {
        for errors in self.jumps.take(now) {
            self.before_jump = Some(self.biases());
            self.open(&errors);
        }
    }

    pub(super) fn inject(&mut self, delta: &SVector<f64, STATES>) {
        let turn = Rotation3::new(delta.fixed_rows::<3>(ATTITUDE).into_owned());
        let shift = delta.fixed_rows::<3>(VELOCITY).into_owned();
        self.earth_from_body = turn * self.earth_from_body;
        self.earth_from_body = orthonormal(&self.earth_from_body);
        self.velocity_m_s += shift;
        self.accel_bias += delta.fixed_rows::<3>(ACCEL_BIAS);
        self.gyro_bias += delta.fixed_rows::<3>(GYRO_BIAS);
        self.history.correct(turn, shift);
        self.tidy();
    }
}
