//! Corrections of the motion filter while GNSS is silent: wheel speeds, tyre slip, and zero
//! velocity along the ground's normal.

use nalgebra::Vector3;
use sample::{InnovationKind, LogTime, STANDARD_GRAVITY_M_S2, Wheel};

use super::Estimator;
use crate::corners::Corners;

impl Estimator {
    /// Mean forward speed of the wheels, m/s, if they roll freely.
    fn rolling_speed(&self, time: LogTime) -> Option<f64> {
        let fresh_s = self.settings.tuning.fresh_s;
        let (mut sum, mut count) = (0.0, 0.0);
        for wheel in Wheel::ALL {
            if let Some(speed) = self.readings.wheel_speed(wheel, time, fresh_s) {
                sum += speed * self.rolling_radius_m(wheel);
                count += 1.0;
            }
        }
        (count > 0.0).then(|| sum / count)
    }

    /// Forward speed over angular speed of a freely rolling wheel, m: as measured, else of the
    /// loaded tyre.
    pub(super) fn rolling_radius_m(&self, wheel: Wheel) -> f64 {
        let measured = self.calibration.rolling_radius_m[wheel];
        measured.unwrap_or_else(|| {
            let load_n = self.vehicle.body.mass_kg * STANDARD_GRAVITY_M_S2 / 4.0;
            let tyre = &self.vehicle.axle(wheel).tyre;
            tyre.rolling_radius_m(load_n)
        })
    }

    /// Corrects the motion filter by wheel speeds while GNSS velocity is silent, and by tyre slip
    /// while GNSS velocity or heading is.
    pub(super) fn aid_motion(&mut self, time: LogTime) {
        let t = self.settings.tuning;
        let aiding = t.motion.aiding;
        let blind = self.motion.velocity_age_s(time) > t.gnss_silent_s;
        if !blind && self.motion.attitude_age_s(time) < t.heading_silent_s {
            self.blind_since = None;
            return;
        }
        self.blind_since.get_or_insert(time);
        let normal = self
            .corners
            .as_ref()
            .map_or_else(Vector3::z, Corners::normal);
        let left = normal.cross(&Vector3::x()).normalize();
        let ahead = left.cross(&normal);
        let mut forward = self.motion.state(time).velocity_m_s.x;
        if blind {
            let Some(speed) = self.rolling_speed(time) else {
                return;
            };
            forward = speed;
            let sigma =
                aiding.wheel_speed_sigma_m_s + aiding.wheel_speed_sigma_part * forward.abs();
            let centre = Vector3::zeros();
            let kind = Some(InnovationKind::WheelSpeed);
            let _ = self
                .motion
                .push_body_velocity(ahead, centre, forward, sigma, kind);
            let _ = self.motion.push_body_velocity(
                normal,
                centre,
                0.0,
                aiding.vertical_sigma_m_s,
                None,
            );
        }
        self.constrain_axles(time, forward, left);
    }

    /// Standard deviation of the reported sideslip angle, rad, from that of the motion filter. While no receiver gives
    /// the sideslip, slip angles follow from forces and from a friction that nothing measures: on a ground that is so
    /// slippery that the tyres slide, they are larger.
    pub(super) fn sideslip_sigma_rad(&self, time: LogTime, filter_sigma_rad: f64) -> f64 {
        let t = self.settings.tuning.motion.aiding;
        // The rear wheels do not steer: their slip angle is that of the body.
        let surplus = self.grip.slip_surplus(1, &self.feedback.forces);
        match (self.blind_since, surplus) {
            (Some(since), Some(surplus)) => {
                let blind = 1.0 - math::exp(-time.seconds_since(since) / t.blind_time_s);
                math::hypot(filter_sigma_rad, blind * t.blind_slip_part * surplus)
            }
            _ => filter_sigma_rad,
        }
    }

    /// The middle of an axle moves along its wheels, apart from the slip angle that its lateral
    /// force implies; where the force is unknown the slip angle is taken as small.
    fn constrain_axles(&mut self, time: LogTime, forward: f64, left: Vector3<f64>) {
        let t = self.settings.tuning.motion.aiding;
        let steer = self.steer_angles(time);
        let body = &self.vehicle.body;
        let ahead = [body.front_axle_to_cg_m, -body.cg_to_rear_axle_m];
        for (axle, x) in ahead.into_iter().enumerate() {
            let [place, travel] = match &self.corners {
                Some(corners) => corners.axle_middle(axle),
                None => [Vector3::x() * x, Vector3::zeros()],
            };
            let (slip, sigma) = self
                .grip
                .slip_angle(axle, &self.feedback.forces)
                .unwrap_or((0.0, t.slip_unknown_sigma_rad));
            let wheels = 0.5 * (steer[2 * axle] + steer[2 * axle + 1]);
            let across = forward * math::tan(wheels + slip) - left.dot(&travel);
            let sigma_m_s = t.slip_correlation * (t.lateral_sigma_m_s + sigma * forward.abs());
            let _ = self
                .motion
                .push_body_velocity(left, place, across, sigma_m_s, None);
        }
    }
}
