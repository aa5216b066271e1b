//! A wheel on a straight path, for a vehicle without hard-points.

use nalgebra::{Matrix3, Vector3};
use sample::Wheel;

use super::linkage::{
    Coordinates, Derivatives, Linkage, OutboardPart, PARTS, PointPath, StrutMount, TwoForceMember,
};
use super::{SuspensionError, finite};
use crate::vehicle::{Unsprung, Vehicle};

/// A wheel that travels along a straight line and turns about an upright axis through its centre.
///
/// With the strut length l, the design length l_0, the motion ratio i (strut travel for one metre of
/// wheel travel) and the path e (e_z = 1), the wheel centre is at c_0 + e (l_0 - l)/i. The second
/// coordinate is the steer angle, rad, in place of a rack's travel. All outboard mass is at the wheel
/// centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StraightPath {
    /// Wheel centre in the design position, m.
    pub wheel_centre_m: Vector3<f64>,
    /// Path e per metre of wheel travel.
    pub path: Vector3<f64>,
    /// Motion ratio i.
    pub motion_ratio: f64,
    /// Strut length l_0 in the design position, m.
    pub design_length_m: f64,
}

impl StraightPath {
    /// The path of a wheel by the roll centre of its axle (the slope of e) and the strut's motion ratio; `None`
    /// if the vehicle file does not have them.
    #[must_use]
    pub fn of(vehicle: &Vehicle, wheel: Wheel) -> Option<Self> {
        let axle = vehicle.axle(wheel);
        let strut = axle.strut.as_ref()?;
        let [x, y] = vehicle.wheel_place_m(wheel);
        let squeeze_m = vehicle.static_load_n(wheel) / axle.tyre.vertical_stiffness_n_m;
        let slope = 2.0 * wheel.side() * axle.roll_centre_height_m / axle.track_m;
        Some(Self {
            wheel_centre_m: Vector3::new(x, y, axle.tyre.unloaded_radius_m - squeeze_m),
            path: Vector3::new(0.0, slope, 1.0),
            motion_ratio: strut.motion_ratio?,
            design_length_m: strut.design_length_m,
        })
    }
}

impl Linkage for StraightPath {
    type Pose = Coordinates;
    type Members = [TwoForceMember; 0];

    fn pose(&self, at: Coordinates) -> Result<Coordinates, SuspensionError> {
        finite("strut length", at.strut, "m")?;
        finite("steer angle", at.rack, "rad")?;
        Ok(at)
    }

    fn wheel(&self, at: &Coordinates) -> PointPath {
        let jounce_m = (self.design_length_m - at.strut) / self.motion_ratio;
        PointPath {
            point_m: self.wheel_centre_m + self.path * jounce_m,
            travel: Derivatives {
                by_strut: self.path / -self.motion_ratio,
                ..Derivatives::default()
            },
            rotation: Derivatives {
                by_rack: Vector3::z(),
                ..Derivatives::default()
            },
        }
    }

    fn spindle(&self, at: &Coordinates) -> Vector3<f64> {
        let (sin, cos) = math::sin_cos(at.rack);
        Vector3::new(-sin, cos, 0.0)
    }

    fn members(&self, _: &Coordinates) -> [TwoForceMember; 0] {
        []
    }

    fn strut(&self, _: &Coordinates) -> Option<StrutMount> {
        None
    }

    fn parts(&self, at: &Coordinates, unsprung: &Unsprung) -> [OutboardPart; PARTS] {
        let (cg, s) = (self.wheel(at), self.spindle(at));
        let none = OutboardPart {
            mass_kg: 0.0,
            inertia_kg_m2: Matrix3::zeros(),
            cg,
        };
        let wheel = OutboardPart {
            mass_kg: unsprung.total_mass_kg(),
            inertia_kg_m2: (Matrix3::identity() - s * s.transpose())
                * unsprung.wheel_diametral_inertia_kg_m2,
            cg,
        };
        [wheel, none, none, none]
    }
}
