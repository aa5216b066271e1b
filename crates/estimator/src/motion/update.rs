//! Corrections of the motion filter.

use nalgebra::{Rotation3, SMatrix, SVector, Vector3};
use sample::{InnovationKind, LogTime};

use crate::gaussian::beyond;
use crate::trace::{Operation, Update};

use super::history::Pose;
use super::jumps::{ANGLE_VALUE, VELOCITY_VALUE};
use super::{
    ACCEL_BIAS, ATTITUDE, AcceptanceCounter, GYRO_BIAS, MotionFilter, STATES, VELOCITY,
    VelocityReceiver, cross, orthonormal, wrap,
};

/// Outcome of one value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It was used.
    Used,
    /// It contradicts the state and was left out.
    Rejected,
    /// It could not be compared: too old, not finite, or nothing to compare with.
    Unusable,
}

impl MotionFilter {
    /// GNSS velocity of a receiver's antenna, earth axes, true at `valid`.
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
        let speed = velocity_m_s.x.hypot(velocity_m_s.y);
        if !self.heading_known && speed > t.course_speed_min_m_s {
            // No antenna has told a heading yet: a vehicle drives forward, nearly.
            let (_, _, yaw) = pose.earth_from_body.euler_angles();
            let course = velocity_m_s.y.atan2(velocity_m_s.x);
            self.adopt_yaw(wrap(course - yaw), t.course_sigma_rad);
            self.heading_known = true;
            return Verdict::Used;
        }
        if self.velocity_time.is_none() {
            self.adopt_velocity(residual);
            residual = Vector3::zeros();
            if !self.heading_known {
                self.forget_yaw(t.heading_unknown_sigma_rad);
            }
        }
        // A receiver that hangs says the same again, and contradicts ever more as the body goes on: it
        // is left out until it says something else, but what it says is not adopted. One that stands
        // may well be told as zero.
        let told = &mut self.velocities[own];
        let repeated = told.at.is_some() && told.velocity_m_s == velocity_m_s && speed > 0.0;
        (told.at, told.velocity_m_s) = (Some(valid), velocity_m_s);
        let slope = -cross(swing);
        let rows = std::array::from_fn::<_, 3, _>(|axis| {
            let mut h = SVector::<f64, STATES>::zeros();
            h[VELOCITY + axis] = 1.0;
            for j in 0..3 {
                h[ATTITUDE + j] = slope[(axis, j)];
            }
            h
        });
        let mut rejected = repeated && told.rejected;
        for axis in 0..3 {
            let variance =
                self.covariance[(VELOCITY + axis, VELOCITY + axis)] + sigma[axis].powi(2);
            rejected |= beyond(t.gate_sigma, residual[axis], variance);
        }
        let imu_consistent = self.is_imu_consistent();
        let told = &mut self.velocities[own];
        told.rejected = rejected && self.velocity_time.is_some();
        if told.rejected {
            if !repeated {
                told.acceptance.contradicted(imu_consistent);
                for (axis, h) in rows.iter().enumerate() {
                    self.compare(
                        VELOCITY_VALUE + axis,
                        h,
                        residual[axis],
                        sigma[axis].powi(2),
                    );
                }
            }
            let told = &self.velocities[own];
            let too_many = told.acceptance.too_many(&t.receivers);
            // One of two receivers alone is not adopted.
            let other = &self.velocities[1 - own];
            let alone =
                !(other.is_active(valid, t.receivers.active_s) && other.acceptance.uses > 0);
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
            return Verdict::Rejected;
        }
        let mut delta = SVector::<f64, STATES>::zeros();
        for (axis, h) in rows.iter().enumerate() {
            if !repeated {
                let innovation = residual[axis] - h.dot(&delta);
                self.compare(VELOCITY_VALUE + axis, h, innovation, sigma[axis].powi(2));
            }
            let kind = Some(InnovationKind::GnssVelocity);
            self.scalar(kind, h, residual[axis], sigma[axis].powi(2), &mut delta);
        }
        self.inject(&delta);
        self.seek_jump(valid);
        self.velocities[own].acceptance.used(&t.receivers);
        self.velocity_time = Some(valid);
        Verdict::Used
    }

    /// Whether GNSS velocity and attitude both contradict the state.
    fn is_contradicted(&self, now: LogTime) -> bool {
        let t = &self.tuning.receivers;
        let active = (self.velocities.iter()).filter(|told| told.is_active(now, t.active_s));
        let velocity = active
            .map(|told| told.acceptance.rejections_unconfirmed)
            .min();
        velocity
            .unwrap_or(0)
            .min(self.attitude_acceptance.rejections_unconfirmed)
            >= t.contradictions
    }

    fn adopt_velocity(&mut self, residual: Vector3<f64>) {
        self.velocity_m_s += residual;
        self.history.correct(Rotation3::identity(), residual);
        for i in VELOCITY..VELOCITY + 3 {
            let sigma = self.tuning.adopted_velocity_sigma_m_s;
            self.forget(i, sigma * sigma);
        }
    }

    /// GNSS attitude, true at `valid`: yaw, pitch, roll in rad, absent where the receiver has none.
    pub fn push_attitude(
        &mut self,
        valid: LogTime,
        angles: [Option<f64>; 3],
        sigma_rad: Option<[f64; 3]>,
    ) -> Verdict {
        let t = self.tuning;
        let Some(pose) = self.history.at(valid) else {
            return Verdict::Unusable;
        };
        if self.attitude_lost {
            return self.adopt_attitude(valid, &pose, angles);
        }
        let (roll, pitch, mut yaw) = pose.earth_from_body.euler_angles();
        let residual = |angle: Option<f64>, nominal: f64| {
            angle
                .filter(|angle| angle.abs() < 1e6)
                .map(|angle| wrap(angle - nominal))
        };
        let mut residuals = [
            residual(angles[0], yaw),
            residual(angles[1], pitch),
            residual(angles[2], roll),
        ];
        let s = &self.settings;
        let floors = [s.heading_sigma_rad, s.tilt_sigma_rad, s.tilt_sigma_rad];
        let mut sigma = floors;
        if let Some(given) = sigma_rad {
            for axis in 0..3 {
                if given[axis].is_finite() {
                    sigma[axis] = given[axis].max(t.stated_sigma_min * floors[axis]);
                }
            }
        }
        // As of a velocity.
        let repeated: [bool; 3] =
            std::array::from_fn(|axis| angles[axis] == self.last_angles[axis]);
        self.last_angles = angles;
        let (mut used, mut rejected, mut contradicted) = (false, false, false);
        if !self.is_steady()
            && let Some(turn) = residuals[0].take()
        {
            self.count_heading(turn + yaw, sigma[0]);
            if self.is_steady() {
                self.adopt_yaw(turn, sigma[0]);
                self.heading_known = true;
                yaw += turn;
                used = true;
            }
        }
        let (sine, cosine) = yaw.sin_cos();
        let tangent = pitch.tan().clamp(-2.0, 2.0);
        let secant = (1.0 / pitch.cos()).clamp(0.0, 2.0);
        let slopes = [
            [tangent * cosine, tangent * sine, 1.0],
            [-sine, cosine, 0.0],
            [secant * cosine, secant * sine, 0.0],
        ];
        let mut delta = SVector::<f64, STATES>::zeros();
        for axis in 0..3 {
            let Some(value) = residuals[axis] else {
                continue;
            };
            let mut h = SVector::<f64, STATES>::zeros();
            for j in 0..3 {
                h[ATTITUDE + j] = slopes[axis][j];
            }
            let innovation = value - h.dot(&delta);
            let variance = (h.transpose() * self.covariance * h)[0] + sigma[axis].powi(2);
            let stuck = repeated[axis] && self.angles_rejected[axis];
            self.angles_rejected[axis] = stuck || beyond(t.gate_sigma, innovation, variance);
            if !repeated[axis] {
                self.jumps
                    .compare(ANGLE_VALUE + axis, &h, innovation, variance);
            }
            if self.angles_rejected[axis] {
                rejected = true;
                contradicted |= !repeated[axis];
                self.innovations.rejected(InnovationKind::GnssAttitude);
                continue;
            }
            let kind = Some(InnovationKind::GnssAttitude);
            self.scalar(kind, &h, value, sigma[axis].powi(2), &mut delta);
            used = true;
        }
        self.inject(&delta);
        self.seek_jump(valid);
        if rejected {
            if contradicted {
                let imu_consistent = self.is_imu_consistent();
                self.attitude_acceptance.contradicted(imu_consistent);
            }
            if self.is_contradicted(valid) {
                self.restart_from_gnss();
            } else if self.attitude_acceptance.too_many(&t.receivers) {
                self.resets += 1;
                self.attitude_acceptance = AcceptanceCounter::adopted();
                self.forget_attitude();
                self.forget_biases();
            }
            return Verdict::Rejected;
        }
        if used {
            self.attitude_acceptance.used(&t.receivers);
            self.attitude_time = Some(valid);
            Verdict::Used
        } else {
            Verdict::Unusable
        }
    }

    /// Whether headings go on as the gyros have the body turn, and so are more than noise: those of a
    /// vehicle that stands or creeps may be wild.
    fn is_steady(&self) -> bool {
        self.heading_run[1] >= f64::from(self.tuning.steady_headings)
    }

    fn count_heading(&mut self, heading_rad: f64, sigma: f64) {
        let began = heading_rad - self.turned_rad;
        let [before, count] = self.heading_run;
        let agrees =
            wrap(began - before).abs() < self.tuning.gate_sigma * std::f64::consts::SQRT_2 * sigma;
        self.heading_run = [began, if agrees { count + 1.0 } else { 1.0 }];
    }

    /// Takes the angles for the attitude at `pose`, whatever the state says; those that are absent
    /// stay as they are.
    fn adopt_attitude(&mut self, valid: LogTime, pose: &Pose, angles: [Option<f64>; 3]) -> Verdict {
        let (roll, pitch, yaw) = pose.earth_from_body.euler_angles();
        let told = |angle: Option<f64>, stays: f64| {
            angle.filter(|angle| angle.abs() < 1e6).unwrap_or(stays)
        };
        let adopted = Rotation3::from_euler_angles(
            told(angles[2], roll),
            told(angles[1], pitch),
            told(angles[0], yaw),
        );
        let turn = adopted * pose.earth_from_body.inverse();
        self.earth_from_body = orthonormal(&(turn * self.earth_from_body));
        self.history.correct(turn, Vector3::zeros());
        let s = &self.settings;
        let sigma = [s.tilt_sigma_rad, s.tilt_sigma_rad, s.heading_sigma_rad];
        for (axis, sigma) in sigma.into_iter().enumerate() {
            self.forget(ATTITUDE + axis, sigma * sigma);
        }
        self.attitude_lost = false;
        if angles[0].is_some_and(|heading| heading.abs() < 1e6) {
            self.heading_run[1] = f64::from(self.tuning.steady_headings);
        }
        self.attitude_time = Some(valid);
        Verdict::Used
    }

    fn adopt_yaw(&mut self, turn: f64, sigma: f64) {
        let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), turn);
        self.earth_from_body = rotation * self.earth_from_body;
        self.turn_covariance(&rotation);
        self.forget_yaw(sigma);
        // A velocity that was known in earth axes stays; one that was known in the body's turns
        // with it, and is as uncertain across as the heading: d v = d psi z x v.
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

    /// Errors in earth axes turn with the body: they were found in its axes.
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

    /// Leaves nothing known of the heading but its deviation.
    fn forget_yaw(&mut self, sigma: f64) {
        self.forget(ATTITUDE + 2, sigma * sigma);
    }

    /// What a road vehicle does: velocity along the unit vector `direction`, body axes, of a point
    /// `arm_m` from the centre of gravity: forwards from wheel speeds, leftwards because the
    /// tyres' slip is small, along the ground's normal because it does not fly. Of what a sensor
    /// tells, `kind` is what its innovation counts as.
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

    /// One scalar value; `residual` is against the nominal state, `delta` what was found so far.
    fn scalar(
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

    /// Holds a value of a receiver against the jumps that there may have been.
    fn compare(&mut self, value: usize, h: &SVector<f64, STATES>, innovation: f64, variance: f64) {
        let total = (h.transpose() * self.covariance * h)[0] + variance;
        self.jumps.compare(value, h, innovation, total);
    }

    /// Where an error has jumped, lets it be learnt.
    fn seek_jump(&mut self, now: LogTime) {
        for errors in self.jumps.take(now) {
            self.before_jump = Some(self.biases());
            self.open(&errors);
        }
    }

    fn inject(&mut self, delta: &SVector<f64, STATES>) {
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
