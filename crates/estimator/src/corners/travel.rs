//! What the acceleration of a strut does to a corner whose wheel moves along its path.
//!
//! The unsprung parts accelerate with the body and along the wheel's path, whatever the ground is. All
//! that depends on the strut's acceleration l'' is linear in it, so each quantity is given without l''
//! and for 1 m/s^2 of it. The row of the strut in the corner's statics then gives l'' itself.

use model::suspension::{
    BodyMotion, ChannelKind, Coordinates, CornerMotion, CornerPath, CornerStatics, SuspensionError,
    TyreFrame,
};
use nalgebra::{Matrix3, Vector3, Vector6};
use sample::WheelAxes;

use super::linkage::Linkage;
use crate::calibration::HubSensor;

/// The motion of a corner's unsprung parts along the wheel's path.
#[derive(Clone, Copy, Debug, Default)]
pub struct Travel {
    /// Member forces for 1 m/s^2 of strut acceleration, N/(m/s^2).
    pub members: [f64; 6],
    /// Ball-normal force for 1 m/s^2.
    pub ball_normal: f64,
    /// Force, N, and moment about the centre of gravity, N m, that accelerate the unsprung parts
    /// against the body: without l'' and for 1 m/s^2. Vehicle axes.
    pub wrench: [Vector6<f64>; 2],
    /// Specific force at the hub accelerometer along its axes: without l'' and for 1 m/s^2.
    pub hub: [Vector3<f64>; 2],
    /// Movement of the wheel centre for 1 m of strut length, vehicle axes.
    pub path: Vector3<f64>,
    /// The strut's force near its present length and rate.
    pub strut: StrutLine,
}

/// Strut force F + k (l_0 - l) + c (l'_0 - l') near a length and a rate.
#[derive(Clone, Copy, Debug, Default)]
pub struct StrutLine {
    /// F, N.
    pub force_n: f64,
    /// l_0 by the hard-points, m.
    pub length_m: f64,
    /// l'_0, m/s.
    pub rate_m_s: f64,
    /// k, N/m.
    pub stiffness_n_m: f64,
    /// c, N s/m.
    pub damping_n_s_m: f64,
    /// Whether a stop touches.
    pub stopped: bool,
}

impl StrutLine {
    /// Force without the parts of length and rate, N.
    pub fn constant_n(&self) -> f64 {
        self.force_n + self.stiffness_n_m * self.length_m + self.damping_n_s_m * self.rate_m_s
    }
}

/// A corner on its path: motion of the parts, statics in the wheel-carrier frame, and what l'' changes.
pub(super) struct OnPath {
    pub(super) motion: CornerMotion,
    pub(super) statics: CornerStatics,
    pub(super) travel: Travel,
}

impl Linkage {
    /// The corner in the present pose with the strut's rate, rack rate and acceleration, and the spin of
    /// the wheel.
    pub(super) fn on_path(
        &self,
        body: &BodyMotion,
        frame: &TyreFrame,
        [rate_m_s, rack_m_s, rack_m_s2]: [f64; 3],
        spin_rad_s: f64,
    ) -> Result<OnPath, SuspensionError> {
        let pose = &self.pose;
        let path = self.corner.path(pose);
        let rate = Coordinates {
            strut: rate_m_s,
            rack: rack_m_s,
        };
        let [still, unit] = [0.0, 1.0].map(|strut| Coordinates {
            strut,
            rack: rack_m_s2,
        });
        let moving = |acceleration| CornerMotion {
            spin_rad_s,
            ..CornerMotion::on_known_path(&path, pose, body, rate, acceleration)
        };
        let [motion, of_unit] = [still, unit].map(moving);
        let axes = WheelAxes::carrier(pose.spindle.into());
        let carrier = TyreFrame {
            contact_m: frame.contact_m,
            vehicle_from_tyre: Matrix3::from_fn(|row, column| axes.rows()[column][row]),
        };
        let (corner, unsprung) = (&self.corner, &self.unsprung);
        let statics = CornerStatics::new(
            corner,
            pose,
            &carrier,
            unsprung,
            &motion,
            ChannelKind::Strut,
        )?;
        let unit_statics = statics.moved(corner, pose, &carrier, unsprung, &of_unit);
        let members = unit_statics.members_offset - statics.members_offset;
        let fixed = CornerMotion::fixed_to(body, pose);
        let about_m = body.reference_m;
        let [of_still, of_unit_at_hub] =
            [still, unit].map(|acceleration| self.at_hub_sensor(&path, body, rate, acceleration));
        let travel = Travel {
            members: members.into(),
            ball_normal: unit_statics.ball_normal_offset_n - statics.ball_normal_offset_n,
            wrench: [
                motion.wrench_beyond(&fixed, pose, unsprung, about_m),
                of_unit.wrench_beyond(&motion, pose, unsprung, about_m),
            ],
            hub: [of_still, of_unit_at_hub - of_still],
            path: path.wheel.travel.by_strut,
            strut: self.strut_line(rate_m_s),
        };
        Ok(OnPath {
            motion,
            statics,
            travel,
        })
    }

    /// Specific force along the axes of the hub accelerometer; zero without one.
    fn at_hub_sensor(
        &self,
        path: &CornerPath,
        body: &BodyMotion,
        rate: Coordinates,
        acceleration: Coordinates,
    ) -> Vector3<f64> {
        self.hub
            .as_ref()
            .map_or_else(Vector3::zeros, |hub: &HubSensor| {
                let upright = &self.pose.vehicle_from_upright;
                let place_m = self.pose.wheel_centre_m + upright * hub.position_m;
                let force = path.wheel.at(place_m);
                let force = force.specific_force_m_s2(body, rate, acceleration);
                hub.sensor_from_carrier * upright.transpose() * force
            })
    }

    fn strut_line(&self, rate_m_s: f64) -> StrutLine {
        let length_m = self.pose.strut_length_m;
        let spring_m = length_m + self.design_shift_m();
        let strut = &self.strut;
        let force = strut.force(spring_m, rate_m_s);
        let stopped = force.stop_n != 0.0;
        StrutLine {
            force_n: force.total_n() - self.strut_offset_n(),
            length_m,
            rate_m_s,
            stiffness_n_m: strut.stiffness_at(spring_m),
            damping_n_s_m: strut.damping_at(rate_m_s)
                + if stopped {
                    strut.stop_damping_n_s_m
                } else {
                    0.0
                },
            stopped,
        }
    }
}
