//! Corrections of the motion filter by GNSS attitude.

use nalgebra::{Rotation3, SVector, Vector3};
use sample::{InnovationKind, LogTime};

use super::history::Pose;
use super::jumps::ANGLE_VALUE;
use super::{ATTITUDE, AcceptanceCounter, MotionFilter, STATES, Verdict, orthonormal, wrap};
use crate::gaussian::beyond;

/// Angles beyond this are not used, rad.
const ANGLE_MAX_RAD: f64 = 1e6;

/// One angle of a GNSS attitude.
struct AngleResidual {
    axis: usize,
    residual: f64,
    sigma: f64,
    row: SVector<f64, STATES>,
    /// Whether the receiver sent the same angle as before.
    repeated: bool,
}

impl MotionFilter {
    /// GNSS attitude, valid at `valid`: yaw, pitch and roll, rad; `None` for an angle that the
    /// receiver does not measure.
    pub fn push_attitude(
        &mut self,
        valid: LogTime,
        angles: [Option<f64>; 3],
        sigma_rad: Option<[f64; 3]>,
    ) -> Verdict {
        let Some(pose) = self.history.at(valid) else {
            return Verdict::Unusable;
        };
        if self.attitude_lost {
            return self.adopt_attitude(valid, &pose, angles);
        }
        let (residuals, mut used) = self.angle_residuals(&pose, angles, sigma_rad);
        let (mut rejected, mut contradicted) = (false, false);
        let mut delta = SVector::<f64, STATES>::zeros();
        for measured in residuals.iter().flatten() {
            let accepted = self.take_angle(measured, &mut delta);
            used |= accepted;
            rejected |= !accepted;
            contradicted |= !accepted && !measured.repeated;
        }
        self.inject(&delta);
        self.seek_jump(valid);
        if rejected {
            self.reject_attitude(valid, contradicted);
            return Verdict::Rejected;
        }
        if used {
            self.attitude_acceptance.used(&self.tuning.receivers);
            self.attitude_time = Some(valid);
            Verdict::Used
        } else {
            Verdict::Unusable
        }
    }

    /// Residuals of the angles against the state at `pose`, and whether a heading was adopted. A
    /// heading is adopted only after several consecutive ones agree.
    fn angle_residuals(
        &mut self,
        pose: &Pose,
        angles: [Option<f64>; 3],
        sigma_rad: Option<[f64; 3]>,
    ) -> ([Option<AngleResidual>; 3], bool) {
        let (roll, pitch, mut yaw) = pose.earth_from_body.euler_angles();
        let residual = |angle: Option<f64>, nominal: f64| {
            angle
                .filter(|angle| angle.abs() < ANGLE_MAX_RAD)
                .map(|angle| wrap(angle - nominal))
        };
        let mut residuals = [
            residual(angles[0], yaw),
            residual(angles[1], pitch),
            residual(angles[2], roll),
        ];
        let sigma = self.late_angle_sigma(pose, self.angle_sigma(sigma_rad));
        let repeated: [bool; 3] =
            std::array::from_fn(|axis| angles[axis] == self.last_angles[axis]);
        self.last_angles = angles;
        let mut adopted = false;
        if !self.is_steady()
            && let Some(turn) = residuals[0].take()
        {
            self.count_heading(turn + yaw, sigma[0]);
            if self.is_steady() {
                self.adopt_yaw(turn, sigma[0]);
                self.heading_known = true;
                yaw += turn;
                adopted = true;
            }
        }
        let (sine, cosine) = math::sin_cos(yaw);
        let tangent = math::tan(pitch).clamp(-2.0, 2.0);
        let secant = (1.0 / math::cos(pitch)).clamp(0.0, 2.0);
        let slopes = [
            [tangent * cosine, tangent * sine, 1.0],
            [-sine, cosine, 0.0],
            [secant * cosine, secant * sine, 0.0],
        ];
        let measured = std::array::from_fn(|axis| {
            let mut row = SVector::<f64, STATES>::zeros();
            for j in 0..3 {
                row[ATTITUDE + j] = slopes[axis][j];
            }
            residuals[axis].map(|residual| AngleResidual {
                axis,
                residual,
                sigma: sigma[axis],
                row,
                repeated: repeated[axis],
            })
        });
        (measured, adopted)
    }

    /// Standard deviations of yaw, pitch and roll, rad: as stated, at least a part of the sensors
    /// file's.
    fn angle_sigma(&self, stated_rad: Option<[f64; 3]>) -> [f64; 3] {
        let s = &self.settings;
        let floors = [s.heading_sigma_rad, s.tilt_sigma_rad, s.tilt_sigma_rad];
        let mut sigma = floors;
        if let Some(given) = stated_rad {
            for axis in 0..3 {
                if given[axis].is_finite() {
                    sigma[axis] = given[axis].max(self.tuning.stated_sigma_min * floors[axis]);
                }
            }
        }
        sigma
    }

    /// Takes one angle unless it is beyond the gate; returns whether it was taken. A stuck angle that
    /// was rejected stays rejected until it changes.
    fn take_angle(&mut self, measured: &AngleResidual, delta: &mut SVector<f64, STATES>) -> bool {
        let AngleResidual {
            axis,
            residual,
            sigma,
            row: h,
            repeated,
        } = measured;
        let innovation = residual - h.dot(delta);
        let variance = (h.transpose() * self.covariance * h)[0] + sigma.powi(2);
        let stuck = *repeated && self.angles_rejected[*axis];
        let rejected = stuck || beyond(self.tuning.gate_sigma, innovation, variance);
        self.angles_rejected[*axis] = rejected;
        if !repeated {
            self.jumps
                .compare(ANGLE_VALUE + axis, h, innovation, variance);
        }
        if rejected {
            self.innovations.rejected(InnovationKind::GnssAttitude);
        } else {
            let kind = Some(InnovationKind::GnssAttitude);
            self.scalar(kind, h, *residual, sigma.powi(2), delta);
        }
        !rejected
    }

    /// Counts a rejected attitude. After too many rejections the attitude is found again from the
    /// receiver, and the biases start again.
    fn reject_attitude(&mut self, valid: LogTime, contradicted: bool) {
        if contradicted {
            let imu_consistent = self.is_imu_consistent();
            self.attitude_acceptance.contradicted(imu_consistent);
        }
        if self.is_contradicted(valid) {
            self.restart_from_gnss();
        } else if self.attitude_acceptance.too_many(&self.tuning.receivers) {
            self.resets += 1;
            self.attitude_acceptance = AcceptanceCounter::adopted();
            self.forget_attitude();
            self.forget_biases();
        }
    }

    /// Whether consecutive headings follow the gyros. Headings of a vehicle that stands or creeps can
    /// be wrong.
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

    /// Sets the attitude at `pose` to the angles, independent of the state. Absent angles keep their
    /// value.
    fn adopt_attitude(&mut self, valid: LogTime, pose: &Pose, angles: [Option<f64>; 3]) -> Verdict {
        let (roll, pitch, yaw) = pose.earth_from_body.euler_angles();
        let measured_or = |angle: Option<f64>, present: f64| {
            angle
                .filter(|angle| angle.abs() < ANGLE_MAX_RAD)
                .unwrap_or(present)
        };
        let adopted = Rotation3::from_euler_angles(
            measured_or(angles[2], roll),
            measured_or(angles[1], pitch),
            measured_or(angles[0], yaw),
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
        if angles[0].is_some_and(|heading| heading.abs() < ANGLE_MAX_RAD) {
            self.heading_run[1] = f64::from(self.tuning.steady_headings);
        }
        self.attitude_time = Some(valid);
        Verdict::Used
    }
}
