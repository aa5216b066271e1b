//! How wheel angles, track, roll centre and motion ratio change with jounce.

use nalgebra::Vector3;

use super::{Corner, SuspensionError, finite};

/// One position of a corner under equal jounce of both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JouncePoint {
    /// Wheel centre above its design height, m.
    pub jounce_m: f64,
    /// Strut length, m.
    pub strut_length_m: f64,
    /// Camber against the body, top outwards positive, rad.
    pub camber_rad: f64,
    /// Toe, front inwards positive, rad.
    pub toe_in_rad: f64,
    /// Track width at the ground, m.
    pub track_m: f64,
    /// Kinematic roll centre's height above ground, m.
    pub roll_centre_height_m: f64,
    /// Strut travel over wheel travel.
    pub motion_ratio: f64,
}

impl Corner {
    /// The corner at one jounce, with a tyre of this loaded radius.
    ///
    /// The roll centre is where the normal to the contact point's path meets the vehicle's middle
    /// plane: h = |y| dy/dz, with y and z of the contact point and dy counted outwards.
    ///
    /// # Errors
    /// When the linkage does not reach the jounce.
    pub fn jounce_point(
        &self,
        jounce_m: f64,
        loaded_radius_m: f64,
    ) -> Result<JouncePoint, SuspensionError> {
        finite("loaded radius", loaded_radius_m, "m")?;
        let pose = self.pose_at_jounce(jounce_m, 0.0)?;
        let rates = self.rates(&pose);
        let s = pose.spindle;
        let down = (s * s.z - Vector3::z()).normalize();
        let contact = pose.wheel_centre_m + down * loaded_radius_m;
        let path = rates.strut.at(&pose, contact);
        Ok(JouncePoint {
            jounce_m,
            strut_length_m: pose.strut_length_m,
            camber_rad: pose.camber_rad(self.wheel),
            toe_in_rad: pose.toe_in_rad(self.wheel),
            track_m: 2.0 * contact.y.abs(),
            roll_centre_height_m: contact.y * path.y / path.z,
            motion_ratio: rates.motion_ratio(),
        })
    }

    /// The corner at `points` jounces, evenly from `from_m` to `to_m`.
    ///
    /// # Errors
    /// When the linkage does not reach one of them.
    pub fn jounce_curve(
        &self,
        from_m: f64,
        to_m: f64,
        points: usize,
        loaded_radius_m: f64,
    ) -> Result<Vec<JouncePoint>, SuspensionError> {
        let last = points.saturating_sub(1).max(1) as f64;
        (0..points)
            .map(|k| from_m + (to_m - from_m) * k as f64 / last)
            .map(|jounce| self.jounce_point(jounce, loaded_radius_m))
            .collect()
    }
}
