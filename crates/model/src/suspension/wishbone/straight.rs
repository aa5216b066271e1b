//! The corner of an axle whose linkage is not known.

use nalgebra::{Rotation3, Vector3};
use sample::Wheel;

use super::{Corner, CornerPose, Guide, HardPoints, WheelPath};
use crate::suspension::StraightPath;
use crate::vehicle::Vehicle;

impl Corner {
    /// The corner of `wheel` of an axle without hard-points: its wheel moves straight up, with the slope of the
    /// axle's roll centre and the strut's motion ratio, and turns about an upright axis by the second coordinate,
    /// rad, which is no travel of a rack here. `None` if the file lacks them.
    #[must_use]
    pub fn straight(vehicle: &Vehicle, wheel: Wheel) -> Option<Self> {
        let straight = StraightPath::of(vehicle, wheel)?;
        let path = WheelPath {
            travel: straight.path / -straight.motion_ratio,
            ..WheelPath::default()
        };
        Self::along(vehicle, wheel, path)
    }

    /// The same corner on another path. `None` if the file lacks the strut or its motion ratio.
    #[must_use]
    pub fn along(vehicle: &Vehicle, wheel: Wheel, path: WheelPath) -> Option<Self> {
        let straight = StraightPath::of(vehicle, wheel)?;
        let (centre, length_m) = (straight.wheel_centre_m, straight.design_length_m);
        let points = HardPoints::all_at(centre, centre + Vector3::z() * length_m);
        Some(Self::guided(wheel, points, Guide::Straight(path), length_m))
    }

    /// Whether the linkage is known.
    #[must_use]
    pub fn is_known(&self) -> bool {
        !matches!(self.guide, Guide::Straight(_))
    }

    /// Path of the wheel in a pose if the linkage is not known.
    pub(in crate::suspension) fn straight_path(&self, pose: &CornerPose) -> Option<WheelPath> {
        let Guide::Straight(path) = self.guide else {
            return None;
        };
        let longer_m = pose.strut_length_m - self.design_strut_length_m;
        Some(WheelPath {
            travel: path.travel + path.bend * longer_m,
            turn: path.turn + path.turn_bend * longer_m,
            ..path
        })
    }

    pub(super) fn straight_pose(
        &self,
        strut_length_m: f64,
        steer_rad: f64,
        path: WheelPath,
    ) -> CornerPose {
        let mut turned = *Rotation3::from_axis_angle(&Vector3::z_axis(), steer_rad).matrix();
        let longer_m = strut_length_m - self.design_strut_length_m;
        let turn = path.turn * longer_m + path.turn_bend * (0.5 * longer_m * longer_m);
        if turn != Vector3::zeros() {
            turned = Rotation3::new(turn).matrix() * turned;
        }
        let centre = self.points.wheel_centre
            + path.travel * longer_m
            + path.bend * (0.5 * longer_m * longer_m);
        let path = path.travel + path.bend * longer_m;
        CornerPose {
            strut_length_m,
            rack_m: steer_rad,
            lower_angle_rad: 0.0,
            upper_angle_rad: 0.0,
            lower_ball_m: centre,
            upper_ball_m: centre,
            tie_rod_inner_m: centre,
            tie_rod_outer_m: centre,
            strut_arm_m: centre,
            strut_direction: path.normalize(),
            wheel_centre_m: centre,
            spindle: turned.column(1).into_owned(),
            vehicle_from_upright: turned,
            upright_cg_m: centre,
            upper_arm_cg_m: centre,
            lower_arm_cg_m: centre,
        }
    }
}
