use nalgebra::Vector3;
use sample::Wheel;

use crate::suspension::SuspensionError;
use crate::vehicle::{Axle, Macpherson, TrailingArm, Wishbone};

/// Smallest span of hard-points that counts as one, m or m^2.
const COINCIDENT: f64 = 1e-6;

/// Hard-points of one corner in the design position, vehicle axes, m.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(
    missing_docs,
    reason = "the fields are those of vehicle::Wishbone and Unsprung; of a MacPherson strut, the upper \
              joints are its top, and the strut's end at the arm is its lower end; of five links, the ball joints are \
              the middles between two outer ends; of a trailing arm, the lower hinges are its bushings"
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
    /// The hard-points of a corner of `axle`, whose frame's origin is `axle_m` ahead and left of the centre of
    /// gravity; `None` without a linkage.
    pub(super) fn new(axle: &Axle, axle_m: [f64; 2], wheel: Wheel) -> Option<Self> {
        if let Some(wishbone) = &axle.wishbone {
            return Some(Self::placed(axle, wishbone, axle_m, wheel));
        }
        if let Some(arm) = &axle.trailing_arm {
            let mut points = Self::placed(axle, &as_lower_arm(arm), axle_m, wheel);
            points.upper_arm_cg = points.wheel_centre;
            return Some(points);
        }
        let strut = axle.macpherson.as_ref()?;
        let mut points = Self::placed(axle, &with_top(strut), axle_m, wheel);
        if axle
            .unsprung
            .as_ref()
            .is_none_or(|u| u.upright_cg_m.is_none())
        {
            points.upright_cg = 0.5 * (points.strut_arm + points.lower_ball);
        }
        points.upper_arm_cg = points.upper_ball;
        Some(points)
    }

    /// A wheel without a linkage.
    pub(super) fn all_at(centre: Vector3<f64>, strut_chassis: Vector3<f64>) -> Self {
        Self {
            wheel_centre: centre,
            upper_front: centre,
            upper_rear: centre,
            upper_ball: centre,
            lower_front: centre,
            lower_rear: centre,
            lower_ball: centre,
            strut_chassis,
            strut_arm: centre,
            tie_rod_inner: centre,
            tie_rod_outer: centre,
            upright_cg: centre,
            upper_arm_cg: centre,
            lower_arm_cg: centre,
        }
    }

    fn placed(axle: &Axle, w: &Wishbone, axle_m: [f64; 2], wheel: Wheel) -> Self {
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

    pub(super) fn check(&self, has_upper_arm: bool) -> Result<(), SuspensionError> {
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
        let of_upper_arm = [1, 3];
        let spans = spans.into_iter().enumerate();
        let spans = spans.filter(|(i, _)| has_upper_arm || !of_upper_arm.contains(i));
        all_span(spans.map(|(_, span)| span))
    }

    pub(super) fn check_trailing_arm(&self) -> Result<(), SuspensionError> {
        let hinge = self.lower_front - self.lower_rear;
        let area = |point: Vector3<f64>| hinge.cross(&(point - self.lower_rear)).norm();
        let strut = self.strut_arm - self.strut_chassis;
        let lever = hinge
            .cross(&(self.strut_arm - self.lower_rear))
            .dot(&strut)
            .abs();
        all_span([
            (hinge.norm(), "both bushings of the trailing arm coincide"),
            (
                area(self.wheel_centre),
                "the wheel centre is on the line through both bushings of the trailing arm",
            ),
            (strut.norm(), "both ends of the strut coincide"),
            (
                lever,
                "the strut has no lever about the line through both bushings of the trailing arm",
            ),
        ])
    }
}

/// Fails with the text of the first size that is zero.
fn all_span(sizes: impl IntoIterator<Item = (f64, &'static str)>) -> Result<(), SuspensionError> {
    for (size, what) in sizes {
        // `!(a > b)` also catches NaN.
        if !(size > COINCIDENT && size.is_finite()) {
            return Err(SuspensionError::Degenerate { what });
        }
    }
    Ok(())
}

/// A trailing arm as the lower arm of a double wishbone whose ball joints are at the wheel centre.
fn as_lower_arm(arm: &TrailingArm) -> Wishbone {
    let centre_m = arm.wheel_centre_m;
    Wishbone {
        wheel_centre_m: centre_m,
        upper_front_m: centre_m,
        upper_rear_m: centre_m,
        upper_ball_m: centre_m,
        lower_front_m: arm.outer_bushing_m,
        lower_rear_m: arm.inner_bushing_m,
        lower_ball_m: centre_m,
        strut_chassis_m: arm.strut_chassis_m,
        strut_arm_m: arm.strut_arm_m,
        tie_rod_inner_m: centre_m,
        tie_rod_outer_m: centre_m,
    }
}

/// A MacPherson strut as a double wishbone whose upper joints are all at the strut's top.
fn with_top(strut: &Macpherson) -> Wishbone {
    Wishbone {
        wheel_centre_m: strut.wheel_centre_m,
        upper_front_m: strut.strut_top_m,
        upper_rear_m: strut.strut_top_m,
        upper_ball_m: strut.strut_top_m,
        lower_front_m: strut.lower_front_m,
        lower_rear_m: strut.lower_rear_m,
        lower_ball_m: strut.lower_ball_m,
        strut_chassis_m: strut.strut_top_m,
        strut_arm_m: strut.strut_low_m,
        tie_rod_inner_m: strut.tie_rod_inner_m,
        tie_rod_outer_m: strut.tie_rod_outer_m,
    }
}
