use nalgebra::Vector3;

/// Contact of one tyre with the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundContact {
    /// How far the tyre is pressed in along its radius, m; zero or less without contact.
    pub depth_m: f64,
    /// Normal of the ground, upward unit vector in earth axes.
    pub normal: Vector3<f64>,
    /// Contact point, earth axes, m: in the wheel plane, the unloaded radius less the depth from
    /// the wheel centre.
    pub point_m: Vector3<f64>,
    /// Height of the ground below the wheel centre, m.
    pub ground_height_m: f64,
    /// Factor on the tyre's friction: 1 on the surface for which the vehicle file's friction holds.
    pub friction: f64,
    /// Resistance of soft ground: what the tyre's coefficient of rolling resistance grows by.
    pub resistance: f64,
}

/// Ground that tyres roll on.
pub trait Ground {
    /// Contact of a wheel from its centre (earth axes, m), its spindle (unit vector to the left,
    /// earth axes), the tyre's unloaded radius and the width of its tread, m.
    fn contact(
        &self,
        wheel_centre_m: Vector3<f64>,
        spindle: Vector3<f64>,
        radius_m: f64,
        width_m: f64,
    ) -> GroundContact;
}

/// A plane through a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Upward unit normal, earth axes.
    pub normal: Vector3<f64>,
    /// Height of the plane at x = y = 0, m.
    pub height_m: f64,
    /// Factor on the tyre's friction.
    pub friction: f64,
}

impl Plane {
    /// Level ground at height zero.
    pub const LEVEL: Self = Self {
        normal: Vector3::new(0.0, 0.0, 1.0),
        height_m: 0.0,
        friction: 1.0,
    };
}

impl Ground for Plane {
    fn contact(
        &self,
        wheel_centre_m: Vector3<f64>,
        spindle: Vector3<f64>,
        radius_m: f64,
        _: f64,
    ) -> GroundContact {
        let n = self.normal;
        let height = n.dot(&wheel_centre_m) - n.z * self.height_m;
        let in_plane = n - spindle * n.dot(&spindle);
        let upright = in_plane.norm();
        let distance_m = height / upright;
        let [x, y] = [wheel_centre_m.x, wheel_centre_m.y];
        GroundContact {
            depth_m: radius_m - distance_m,
            normal: n,
            point_m: wheel_centre_m - in_plane * (distance_m / upright),
            ground_height_m: self.height_m - (n.x * x + n.y * y) / n.z,
            friction: self.friction,
            resistance: 0.0,
        }
    }
}
