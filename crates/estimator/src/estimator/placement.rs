//! Where the wheels are, for pictures of the vehicle.

use model::suspension::CornerPose;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use sample::{PerWheel, Wheel};

use super::Estimator;

/// One wheel against the body at the last estimate. Vehicle axes; the origin is on the design ground
/// plane below the centre of gravity. Quaternions are x, y, z, w.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WheelPlacement {
    /// Centre of the wheel, m.
    pub centre_m: [f64; 3],
    /// Rotation that takes axes of the wheel carrier to vehicle axes.
    pub carrier_xyzw: [f64; 4],
    /// Point of contact with the ground, m.
    pub contact_m: [f64; 3],
    /// Rotation that takes axes of the contact frame to vehicle axes; its z axis is the normal of the
    /// ground.
    pub ground_xyzw: [f64; 4],
    /// Unloaded radius of the tyre, m.
    pub radius_m: f64,
    /// Width of the tyre, m; zero where the vehicle file does not say.
    pub width_m: f64,
}

impl Estimator {
    /// Where the wheels were at the last estimate: by the linkages, or in the design position where
    /// the vehicle file has no linkages. `steer_rad` are the steer angles for the latter.
    #[must_use]
    pub fn wheel_placements(&self, steer_rad: &PerWheel<f64>) -> PerWheel<WheelPlacement> {
        PerWheel::from_fn(|wheel| match &self.corners {
            Some(corners) => {
                let state = &corners.states()[wheel.index()];
                self.placement(
                    wheel,
                    state.pose.wheel_centre_m,
                    carrier_axes(&state.pose),
                    state.frame.contact_m,
                    state.frame.vehicle_from_tyre,
                )
            }
            None => {
                let [x, y] = self.vehicle.wheel_place_m(wheel);
                let radius = self.vehicle.axle(wheel).tyre.unloaded_radius_m;
                let steer = if steer_rad[wheel].is_nan() {
                    0.0
                } else {
                    steer_rad[wheel]
                };
                let (sin, cos) = math::sin_cos(steer);
                let axes = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
                let contact = Vector3::new(x, y, 0.0);
                let centre = Vector3::new(x, y, radius);
                self.placement(wheel, centre, axes, contact, axes)
            }
        })
    }

    /// Height of the centre of gravity above the origin of the vehicle axes, m.
    #[must_use]
    pub fn cg_height_m(&self) -> f64 {
        self.vehicle.body.cg_height_m
    }

    fn placement(
        &self,
        wheel: Wheel,
        centre: Vector3<f64>,
        carrier: Matrix3<f64>,
        contact: Vector3<f64>,
        ground: Matrix3<f64>,
    ) -> WheelPlacement {
        let tyre = &self.vehicle.axle(wheel).tyre;
        WheelPlacement {
            centre_m: centre.into(),
            carrier_xyzw: quaternion(carrier),
            contact_m: contact.into(),
            ground_xyzw: quaternion(ground),
            radius_m: tyre.unloaded_radius_m,
            width_m: tyre.width_m,
        }
    }
}

/// Axes of the wheel carrier in vehicle axes: y along the spindle, x = unit(y × z of the vehicle),
/// z = x × y.
fn carrier_axes(pose: &CornerPose) -> Matrix3<f64> {
    let y = pose.spindle;
    let x = y.cross(&Vector3::z()).normalize();
    Matrix3::from_columns(&[x, y, x.cross(&y)])
}

fn quaternion(axes: Matrix3<f64>) -> [f64; 4] {
    let rotation = Rotation3::from_matrix_unchecked(axes);
    UnitQuaternion::from_rotation_matrix(&rotation)
        .coords
        .into()
}
