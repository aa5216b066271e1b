//! A trailing or semi-trailing arm: the wheel turns with the arm about its bushings.

use nalgebra::{Matrix3, Vector3};
use sample::Wheel;

use super::circle::Turn;
use super::{Corner, CornerPose, CornerRates, Guide, HardPoints, Twist, path};
use crate::suspension::{CornerPath, PointPath, SuspensionError};

impl Corner {
    /// A corner on a trailing arm; its lower hinges are the bushings, inner and outer.
    pub(super) fn on_trailing_arm(
        points: HardPoints,
        wheel: Wheel,
    ) -> Result<Self, SuspensionError> {
        points.check_trailing_arm()?;
        let length_m = (points.strut_arm - points.strut_chassis).norm();
        Ok(Self::guided(wheel, points, Guide::Trailing, length_m))
    }

    /// Whether the wheel is carried by a trailing arm.
    pub(in crate::suspension) fn is_trailing(&self) -> bool {
        matches!(self.guide, Guide::Trailing)
    }

    /// Unit vectors across the line of the bushings, forwards and upwards.
    pub(in crate::suspension) fn across_bushings(&self) -> [Vector3<f64>; 2] {
        let axis = self.lower_axis;
        let forwards = (Vector3::x() - axis * axis.x).normalize();
        let upwards = forwards.cross(&axis);
        [forwards, upwards * upwards.z.signum()]
    }

    pub(super) fn trailing_pose(&self, turn: Turn, angle_rad: f64, rack_m: f64) -> CornerPose {
        let p = &self.points;
        let carry = |point| turn.carry(p.lower_rear, self.lower_axis, point);
        let about_axis = |v| turn.carry(Vector3::zeros(), self.lower_axis, v);
        let rotation =
            Matrix3::from_columns(&[Vector3::x(), Vector3::y(), Vector3::z()].map(about_axis));
        let strut_arm_m = carry(p.strut_arm);
        let strut = strut_arm_m - p.strut_chassis;
        let wheel_centre_m = carry(p.wheel_centre);
        CornerPose {
            strut_length_m: strut.norm(),
            rack_m,
            lower_angle_rad: angle_rad,
            upper_angle_rad: 0.0,
            lower_ball_m: wheel_centre_m,
            upper_ball_m: wheel_centre_m,
            tie_rod_inner_m: p.tie_rod_inner,
            tie_rod_outer_m: carry(p.tie_rod_outer),
            strut_arm_m,
            strut_direction: strut.normalize(),
            wheel_centre_m,
            spindle: rotation.column(1).into_owned(),
            vehicle_from_upright: rotation,
            upright_cg_m: carry(p.upright_cg),
            upper_arm_cg_m: p.upper_arm_cg,
            lower_arm_cg_m: carry(p.lower_arm_cg),
        }
    }

    pub(super) fn trailing_rates(&self, pose: &CornerPose) -> CornerRates {
        let along = |point: Vector3<f64>| self.lower_axis.cross(&(point - self.points.lower_rear));
        let per_strut = 1.0 / along(pose.strut_arm_m).dot(&pose.strut_direction);
        CornerRates {
            strut: Twist {
                wheel_centre: along(pose.wheel_centre_m) * per_strut,
                rotation: self.lower_axis * per_strut,
            },
            rack: Twist::default(),
            lower_angle_per_strut: per_strut,
            upper_angle_per_strut: 0.0,
        }
    }

    /// Path of the wheel, and that of the arm. The upper arm stands still: there is none.
    pub(super) fn trailing_path(&self, pose: &CornerPose) -> CornerPath {
        let rates = self.rates(pose);
        let bend = self.lower_bend(pose, &rates);
        let of = |point_m| {
            let hinge = self.points.lower_rear;
            path::swing(
                hinge,
                self.lower_axis,
                point_m,
                rates.lower_angle_per_strut,
                bend,
            )
        };
        CornerPath {
            wheel: of(pose.wheel_centre_m),
            upper_arm: PointPath::fixed(pose.upper_arm_cg_m),
            lower_arm: of(pose.lower_arm_cg_m),
        }
    }
}
