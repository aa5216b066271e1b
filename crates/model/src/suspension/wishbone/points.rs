use nalgebra::Vector3;
use sample::Wheel;

use crate::suspension::SuspensionError;
use crate::vehicle::{Axle, Wishbone};

/// Smallest span of hard-points that counts as one, m or m^2.
const COINCIDENT: f64 = 1e-6;

/// Hard-points of one corner in the design position, vehicle axes, m.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(
    missing_docs,
    reason = "the fields are those of vehicle::Wishbone and Unsprung"
)]
pub struct HardPoints {
    pub wheel_centre: Vector3<f64>,
    pub upper_front: Vector3<f64>,
    pub upper_rear: Vector3<f64>,
    pub upper_ball: Vector3<f64>,
    pub lower_front: Vector3<f64>,
    pub lower_rear: Vector3<f64>,
    pub lower_ball: Vector3<f64>,
    pub strut_chassis: Vector3<f64>,
    pub strut_arm: Vector3<f64>,
    pub tie_rod_inner: Vector3<f64>,
    pub tie_rod_outer: Vector3<f64>,
    pub upright_cg: Vector3<f64>,
    pub upper_arm_cg: Vector3<f64>,
    pub lower_arm_cg: Vector3<f64>,
}

impl HardPoints {
    pub(super) fn new(axle: &Axle, w: &Wishbone, axle_m: [f64; 2], wheel: Wheel) -> Self {
        let [ahead_m, left_m] = axle_m;
        let place = |p: [f64; 3]| Vector3::new(ahead_m + p[0], wheel.side() * p[1] + left_m, p[2]);
        let centroid = |a: [f64; 3], b: [f64; 3], ball: [f64; 3]| {
            std::array::from_fn(|i| 0.25 * (a[i] + b[i]) + 0.5 * ball[i])
        };
        let unsprung = axle.unsprung.as_ref();
        let upright = unsprung.and_then(|u| u.upright_cg_m).unwrap_or_else(|| {
            std::array::from_fn(|i| 0.5 * (w.upper_ball_m[i] + w.lower_ball_m[i]))
        });
        let upper = unsprung
            .and_then(|u| u.upper_arm_cg_m)
            .unwrap_or_else(|| centroid(w.upper_front_m, w.upper_rear_m, w.upper_ball_m));
        let lower = unsprung
            .and_then(|u| u.lower_arm_cg_m)
            .unwrap_or_else(|| centroid(w.lower_front_m, w.lower_rear_m, w.lower_ball_m));
        Self {
            wheel_centre: place(w.wheel_centre_m),
            upper_front: place(w.upper_front_m),
            upper_rear: place(w.upper_rear_m),
            upper_ball: place(w.upper_ball_m),
            lower_front: place(w.lower_front_m),
            lower_rear: place(w.lower_rear_m),
            lower_ball: place(w.lower_ball_m),
            strut_chassis: place(w.strut_chassis_m),
            strut_arm: place(w.strut_arm_m),
            tie_rod_inner: place(w.tie_rod_inner_m),
            tie_rod_outer: place(w.tie_rod_outer_m),
            upright_cg: place(upright),
            upper_arm_cg: place(upper),
            lower_arm_cg: place(lower),
        }
    }

    pub(super) fn check(&self) -> Result<(), SuspensionError> {
        let area =
            |a: Vector3<f64>, b: Vector3<f64>, c: Vector3<f64>| (b - a).cross(&(c - a)).norm();
        let spans = [
            (
                area(self.lower_front, self.lower_rear, self.lower_ball),
                "the lower arm's hinges and ball joint stand on one line",
            ),
            (
                area(self.upper_front, self.upper_rear, self.upper_ball),
                "the upper arm's hinges and ball joint stand on one line",
            ),
            (
                area(self.lower_ball, self.upper_ball, self.tie_rod_outer),
                "the tie rod meets the line through both ball joints",
            ),
            (
                area(self.lower_front, self.lower_rear, self.strut_arm),
                "the strut meets the lower arm on its hinge",
            ),
            (
                (self.strut_arm - self.strut_chassis).norm(),
                "both ends of the strut coincide",
            ),
            (
                (self.tie_rod_outer - self.tie_rod_inner).norm(),
                "both ends of the tie rod coincide",
            ),
        ];
        for (size, what) in spans {
            // `!(a > b)` also catches NaN.
            if !(size > COINCIDENT && size.is_finite()) {
                return Err(SuspensionError::Degenerate { what });
            }
        }
        Ok(())
    }
}
