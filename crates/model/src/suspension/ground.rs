//! The ground under the wheels: contact points, tyre axes and the ground's normal, seen from the
//! sprung body.

use nalgebra::{Matrix3, Vector3};
use sample::PerWheel;

use super::CornerPose;

/// The tyre's contact frame: x along the wheel's heading, y left of it, z along the ground's
/// normal; origin at the contact point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TyreFrame {
    /// Contact point, vehicle axes, m.
    pub contact_m: Vector3<f64>,
    /// Its columns are the frame's axes in vehicle axes.
    pub vehicle_from_tyre: Matrix3<f64>,
}

impl TyreFrame {
    /// The frame of a wheel on ground with the unit normal `normal` (vehicle axes), its tyre of
    /// unloaded radius R_0 pressed in by F_z/k_z.
    ///
    /// x = s x n, y = n x x, contact = c - (R_0 - F_z/k_z) (n - (n.s) s)/|n - (n.s) s|, with the
    /// wheel centre c and the spindle's direction s.
    #[must_use]
    pub fn new(
        pose: &CornerPose,
        normal: Vector3<f64>,
        unloaded_radius_m: f64,
        compression_m: f64,
    ) -> Self {
        let radius_m = unloaded_radius_m - compression_m;
        Self::of_wheel(pose.wheel_centre_m, pose.spindle, normal, radius_m)
    }

    /// The frame of a wheel by its centre, m, its spindle and the radius of the loaded tyre, m.
    pub(super) fn of_wheel(
        centre_m: Vector3<f64>,
        spindle: Vector3<f64>,
        normal: Vector3<f64>,
        radius_m: f64,
    ) -> Self {
        let x = spindle.cross(&normal).normalize();
        let upward = (normal - spindle * normal.dot(&spindle)).normalize();
        Self {
            contact_m: centre_m - upward * radius_m,
            vehicle_from_tyre: Matrix3::from_columns(&[x, normal.cross(&x), normal]),
        }
    }

    /// The ground's normal, vehicle axes.
    #[must_use]
    pub fn normal(&self) -> Vector3<f64> {
        self.vehicle_from_tyre.column(2).into_owned()
    }
}

/// A plane, vehicle axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundPlane {
    /// Unit normal, upwards.
    pub normal: Vector3<f64>,
    /// Height of the plane at x = y = 0, m.
    pub height_m: f64,
    /// How much its slopes along x and y grow with the height of each wheel's contact point, 1/m.
    pub slopes_per_height: [[f64; 2]; 4],
}

impl GroundPlane {
    /// Roll and pitch of the body against this plane, rad: right side down and nose down positive.
    #[must_use]
    pub fn body_roll_pitch_rad(&self) -> [f64; 2] {
        let n = self.normal;
        [
            math::atan2(n.y, n.z),
            math::atan2(-n.x, math::hypot(n.y, n.z)),
        ]
    }
}

/// The plane through the wheels' contact points, by least squares with one weight a wheel (0 for
/// a wheel that may be off the ground). `None` with fewer than three weighted wheels: carry the
/// last normal on with the gyro then.
#[must_use]
pub fn ground_plane(
    poses: &PerWheel<CornerPose>,
    unloaded_radius_m: &PerWheel<f64>,
    compression_m: &PerWheel<f64>,
    weight: &PerWheel<f64>,
) -> Option<GroundPlane> {
    if weight.0.iter().filter(|w| **w > 0.0).count() < 3 {
        return None;
    }
    let mut plane = GroundPlane {
        normal: Vector3::z(),
        height_m: 0.0,
        slopes_per_height: [[0.0; 2]; 4],
    };
    // The contact points depend on the normal to first order in camber only: three rounds leave
    // less than a nanometre.
    for _ in 0..4 {
        let mut normal_matrix = Matrix3::zeros();
        let mut right = Vector3::zeros();
        let mut rows = [Vector3::zeros(); 4];
        for i in 0..4 {
            let frame = TyreFrame::new(
                &poses.0[i],
                plane.normal,
                unloaded_radius_m.0[i],
                compression_m.0[i],
            );
            let row = Vector3::new(1.0, frame.contact_m.x, frame.contact_m.y);
            rows[i] = row * weight.0[i];
            normal_matrix += rows[i] * row.transpose();
            right += rows[i] * frame.contact_m.z;
        }
        let inverse = normal_matrix.try_inverse()?;
        let solution = inverse * right;
        plane = GroundPlane {
            normal: Vector3::new(-solution.y, -solution.z, 1.0).normalize(),
            height_m: solution.x,
            slopes_per_height: rows.map(|row| {
                let of_height = inverse * row;
                [of_height.y, of_height.z]
            }),
        };
    }
    plane.height_m.is_finite().then_some(plane)
}

#[cfg(test)]
mod tests {
    use sample::Wheel;

    use super::*;
    use crate::suspension::Corner;
    use crate::vehicle::Vehicle;

    #[test]
    fn a_contact_point_that_stands_higher_turns_the_plane_as_told() {
        let vehicle = Vehicle::builtin("prowler").unwrap();
        let poses = PerWheel::from_fn(|wheel| {
            let corner = Corner::of(&vehicle, wheel).unwrap();
            corner.pose(corner.design_strut_length_m(), 0.0).unwrap()
        });
        let radius = PerWheel::from_fn(|wheel| {
            let axle = vehicle.axle(wheel);
            axle.tyre.unloaded_radius_m
        });
        let weight = PerWheel([1.0, 1.0, 1.0, 0.5]);
        let plane = |compression| ground_plane(&poses, &radius, &compression, &weight).unwrap();
        let slopes = |plane: &GroundPlane| {
            let n = plane.normal;
            [-n.x / n.z, -n.y / n.z]
        };
        let level = plane(PerWheel([0.0; 4]));
        let higher_m = 1e-5;
        for wheel in Wheel::ALL {
            let mut compression = PerWheel([0.0; 4]);
            compression[wheel] = higher_m;
            let (now, before) = (slopes(&plane(compression)), slopes(&level));
            for axis in 0..2 {
                let found = (now[axis] - before[axis]) / higher_m;
                let told = level.slopes_per_height[wheel.index()][axis];
                assert!(
                    (found - told).abs() < 1e-3 * (1.0 + told.abs()),
                    "{wheel:?} {found} {told}"
                );
            }
        }
    }
}
