//! Tread envelope: the circle of a tyre laid over strips of ground.
//!
//! The wheel plane stands on three strips of ground that run along the wheel's heading, in the
//! middle of the tread and a third of its width to each side. Along each strip the ground is sampled
//! at points below the tyre's circle and is straight in between.
//!
//! 1. The tilt across the wheel is that of the strips' mean heights, weighted with the overlap of
//!    circle and ground.
//! 2. With the tilt taken out, each strip covers a part of the circle. The depth is that which gives
//!    the mean of the covered areas on a plane: a circle of radius R pressed in by d covers
//!    A(d) = R^2 (t - sin t cos t) with cos t = 1 - d/R.
//! 3. The normal in the wheel plane points from the centroid of the covered area to the wheel centre.
//!
//! On every plane, up to a depth of 0.4 R on level ground, depth and normal are exact: depth = R - h/cos(camber) with the distance h of the
//! centre from the plane, as [`crate::suspension::TyreFrame`] has it. A step shorter than the contact
//! patch raises the depth by less than its height. The model has no dynamics of the belt and no
//! stiffness that depends on the shape of the ground, and the ground touches only the part of the
//! circle within 0.8 R ahead and behind.

use nalgebra::Vector3;

use super::{Ground, GroundContact, Road, tread_width_m};

/// Parts along a strip.
const PARTS: usize = 24;
const POINTS: usize = PARTS + 1;
/// Half of a strip's length in radii.
const REACH: f64 = 0.8;

impl Ground for Road {
    fn contact(
        &self,
        wheel_centre_m: Vector3<f64>,
        spindle: Vector3<f64>,
        radius_m: f64,
        width_m: f64,
    ) -> GroundContact {
        let envelope = Envelope::new(wheel_centre_m, spindle, radius_m, width_m);
        let laid = envelope.lay_on(|x, y| self.height_m(x, y));
        GroundContact {
            depth_m: laid.depth_m,
            normal: laid.normal,
            point_m: laid.point_m,
            ground_height_m: self.height_m(wheel_centre_m.x, wheel_centre_m.y),
            friction: self.friction(laid.point_m.x, laid.point_m.y),
            resistance: 0.0,
        }
    }
}

/// The circle of a tyre at its place.
struct Envelope {
    centre_m: Vector3<f64>,
    /// Forward and horizontal, in the wheel plane.
    forward: Vector3<f64>,
    /// Upward in the wheel plane.
    upward: Vector3<f64>,
    /// Left and horizontal.
    left: Vector3<f64>,
    radius_m: f64,
    /// Distance of the outer strips from the middle one.
    offset_m: f64,
    /// Along the strip, m.
    along_m: [f64; POINTS],
    /// Depth of the circle's lower edge below the centre, m.
    edge_m: [f64; POINTS],
}

/// The circle on the ground.
struct Laid {
    depth_m: f64,
    normal: Vector3<f64>,
    point_m: Vector3<f64>,
}

/// Covered area and its first moments about the wheel centre: along, and down.
#[derive(Clone, Copy, Default)]
struct Covered {
    area_m2: f64,
    along_m3: f64,
    down_m3: f64,
}

impl Envelope {
    fn new(centre_m: Vector3<f64>, spindle: Vector3<f64>, radius_m: f64, width_m: f64) -> Self {
        let forward = spindle.cross(&Vector3::z()).normalize();
        let along = |k: usize| REACH * radius_m * (2.0 * k as f64 / PARTS as f64 - 1.0);
        let along_m: [f64; POINTS] = std::array::from_fn(along);
        Self {
            centre_m,
            forward,
            upward: forward.cross(&spindle),
            left: Vector3::z().cross(&forward),
            radius_m,
            offset_m: tread_width_m(radius_m, width_m) / 3.0,
            along_m,
            edge_m: along_m.map(|x| (radius_m * radius_m - x * x).sqrt()),
        }
    }

    /// Lays the circle on ground of these heights.
    fn lay_on(&self, height_m: impl Fn(f64, f64) -> f64) -> Laid {
        // How far the ground stands above the circle's lower edge, vertically.
        let mut above_m = [[0.0; POINTS]; 3];
        for (strip, above_m) in above_m.iter_mut().enumerate() {
            let side = self.left * ((strip as f64 - 1.0) * self.offset_m);
            for k in 0..POINTS {
                let edge =
                    self.centre_m + self.forward * self.along_m[k] - self.upward * self.edge_m[k];
                let place = edge + side;
                above_m[k] = height_m(place.x, place.y) - edge.z;
            }
        }
        let tilt = self.tilt(&above_m);
        // From vertical distances to those along the wheel plane, on ground of this tilt.
        let steepness = self.upward.z - tilt * self.upward.dot(&self.left);
        let mut covered = Covered::default();
        for (strip, above_m) in above_m.iter().enumerate() {
            let level_m = tilt * (strip as f64 - 1.0) * self.offset_m;
            let ground_m: [f64; POINTS] =
                std::array::from_fn(|k| self.edge_m[k] - (above_m[k] - level_m) / steepness);
            self.cover(&ground_m, &mut covered);
        }
        self.laid(&covered, tilt)
    }

    /// Rise of the ground to the left, m/m, from the strips' mean heights where they meet the circle.
    fn tilt(&self, above_m: &[[f64; POINTS]; 3]) -> f64 {
        let (mut weights, mut difference) = (0.0, 0.0);
        for k in 0..POINTS {
            let weight: f64 = above_m.iter().map(|strip| strip[k].max(0.0)).sum();
            weights += weight;
            difference += weight * (above_m[2][k] - above_m[0][k]);
        }
        if weights > 0.0 {
            difference / (2.0 * self.offset_m * weights)
        } else {
            0.0
        }
    }

    /// Adds the area between the circle and ground at these depths below the centre.
    fn cover(&self, ground_m: &[f64; POINTS], covered: &mut Covered) {
        for k in 0..PARTS {
            let (x0, x1) = (self.along_m[k], self.along_m[k + 1]);
            let (g0, g1) = (ground_m[k], ground_m[k + 1]);
            let slope = (g1 - g0) / (x1 - x0);
            let at_centre = g0 - slope * x0;
            // Where the straight ground cuts the circle.
            let square = 1.0 + slope * slope;
            let middle = -slope * at_centre / square;
            let root2 =
                self.radius_m * self.radius_m / square - at_centre * at_centre / (square * square);
            if root2 <= 0.0 {
                continue;
            }
            let root = root2.sqrt();
            let (from, to) = (x0.max(middle - root), x1.min(middle + root));
            if to > from {
                self.cover_part([from, to], [at_centre, slope], covered);
            }
        }
    }

    /// Adds the area from `from` to `to` between the circle and ground at the depth a + b x.
    fn cover_part(&self, [from, to]: [f64; 2], [a, b]: [f64; 2], covered: &mut Covered) {
        let r2 = self.radius_m * self.radius_m;
        let edge = |x: f64| (r2 - x * x).max(0.0).sqrt();
        let (e0, e1) = (edge(from), edge(to));
        let sector = {
            let turn = math::asin(((to * e0 - from * e1) / r2).clamp(-1.0, 1.0));
            0.5 * (to * e1 - from * e0 + r2 * turn)
        };
        let power = |n: i32| (to.powi(n) - from.powi(n)) / f64::from(n);
        covered.area_m2 += sector - a * power(1) - b * power(2);
        covered.along_m3 += (e0.powi(3) - e1.powi(3)) / 3.0 - a * power(2) - b * power(3);
        covered.down_m3 +=
            0.5 * ((r2 - a * a) * power(1) - 2.0 * a * b * power(2) - (1.0 + b * b) * power(3));
    }

    fn laid(&self, covered: &Covered, tilt: f64) -> Laid {
        // Part of the circle's area; below it there is no contact.
        const NOTHING: f64 = 1e-12;
        if covered.area_m2 <= NOTHING * self.radius_m * self.radius_m {
            return Laid {
                depth_m: 0.0,
                normal: Vector3::z(),
                point_m: self.centre_m - self.upward * self.radius_m,
            };
        }
        let depth_m = depth_of(covered.area_m2 / 3.0, self.radius_m);
        // From the centroid to the centre.
        let out = (self.upward * covered.down_m3 - self.forward * covered.along_m3).normalize();
        let along = out.cross(&self.forward.cross(&self.upward));
        let across = self.left + Vector3::z() * tilt;
        Laid {
            depth_m,
            normal: along.cross(&across).normalize(),
            point_m: self.centre_m - out * (self.radius_m - depth_m),
        }
    }
}

/// Depth by which a circle on a plane covers this area: Newton's method on t - sin t cos t = A/R^2,
/// from the first term of its series.
fn depth_of(area_m2: f64, radius_m: f64) -> f64 {
    let part = (area_m2 / (radius_m * radius_m)).min(0.5 * std::f64::consts::PI);
    let mut angle = math::cbrt(1.5 * part);
    for _ in 0..4 {
        let (sin, cos) = math::sin_cos(angle);
        angle -= (angle - sin * cos - part) / (2.0 * sin * sin);
    }
    let half = math::sin(0.5 * angle);
    2.0 * radius_m * half * half
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS_M: f64 = 0.31;
    const WIDTH_M: f64 = 0.2;

    fn spindle(heading_rad: f64, camber_rad: f64) -> Vector3<f64> {
        let (sh, ch) = math::sin_cos(heading_rad);
        let (sc, cc) = math::sin_cos(camber_rad);
        Vector3::new(-sh * cc, ch * cc, sc)
    }

    /// Heights of the plane through the origin with a normal.
    fn plane(normal: Vector3<f64>) -> impl Fn(f64, f64) -> f64 {
        move |x, y| -(normal.x * x + normal.y * y) / normal.z
    }

    #[test]
    fn depth_and_normal_on_planes_are_exact() {
        for (tilt_x, tilt_y, heading, camber) in [
            (0.0, 0.0, 0.0, 0.0),
            (0.3, 0.0, 0.7, 0.0),
            (-0.2, 0.35, -2.1, 0.0),
            (0.1, 0.3, 0.4, 0.2),
            (-0.45, -0.1, 1.4, -0.3),
        ] {
            let normal = Vector3::new(tilt_x, tilt_y, 1.0).normalize();
            let s = spindle(heading, camber);
            let sine = normal.dot(&s);
            for depth_m in [0.001, 0.02, 0.07] {
                // h = (R - depth) cos(camber to the plane).
                let h = (RADIUS_M - depth_m) * (1.0 - sine * sine).sqrt();
                let envelope = Envelope::new(normal * h, s, RADIUS_M, WIDTH_M);
                let laid = envelope.lay_on(plane(normal));
                assert!((laid.depth_m - depth_m).abs() < 1e-9, "{}", laid.depth_m);
                assert!((laid.normal - normal).norm() < 1e-9, "{}", laid.normal);
                assert!(laid.point_m.dot(&normal).abs() < 1e-9);
            }
            let above = Envelope::new(normal * (1.01 * RADIUS_M), s, RADIUS_M, WIDTH_M);
            assert_eq!(above.lay_on(plane(normal)).depth_m, 0.0);
        }
    }

    /// Load against depth on a plane is the tyre's spring: k times the depth, for every height.
    #[test]
    fn load_on_a_plane_is_that_of_the_tyre_s_spring() {
        let stiffness_n_m = 60_000.0;
        for step in 1..=40 {
            let depth_m = 0.002 * f64::from(step);
            let centre = Vector3::new(3.0, -1.0, RADIUS_M - depth_m);
            let laid = Envelope::new(centre, Vector3::y(), RADIUS_M, WIDTH_M).lay_on(|_, _| 0.0);
            let load_n = stiffness_n_m * laid.depth_m;
            assert!((load_n / (stiffness_n_m * depth_m) - 1.0).abs() < 1e-9);
        }
    }

    /// A cleat of 30 mm by 40 mm below a contact patch of 0.22 m: a single point of contact would
    /// see its full height at once.
    #[test]
    fn a_cleat_shorter_than_the_contact_patch_is_filtered() {
        let cleat = |x: f64, _: f64| if (0.0..0.04).contains(&x) { 0.03 } else { 0.0 };
        let depth_m = |x: f64| {
            let centre = Vector3::new(x, 0.0, RADIUS_M - 0.02);
            Envelope::new(centre, Vector3::y(), RADIUS_M, WIDTH_M).lay_on(cleat)
        };
        let over = depth_m(0.025);
        assert!((0.022..0.035).contains(&over.depth_m), "{}", over.depth_m);
        // It is felt before the centre is above it, and pushes back.
        let before = depth_m(-0.12);
        assert!(before.depth_m > 0.021 && before.depth_m < over.depth_m);
        assert!(before.normal.x < -0.01, "{}", before.normal);
        let step_m = 0.002;
        let mut steepest: f64 = 0.0;
        for k in -100..100 {
            let x = f64::from(k) * step_m;
            let change = depth_m(x + step_m).depth_m - depth_m(x).depth_m;
            steepest = steepest.max(change.abs());
        }
        // The point contact jumps by 30 mm.
        assert!(steepest < 0.006, "{steepest}");
    }

    #[test]
    fn ground_below_one_side_of_the_tread_tilts_the_normal() {
        let rock = |_: f64, y: f64| if y > 0.04 { 0.02 } else { 0.0 };
        let centre = Vector3::new(0.0, 0.0, RADIUS_M - 0.02);
        let laid = Envelope::new(centre, Vector3::y(), RADIUS_M, WIDTH_M).lay_on(rock);
        assert!(laid.normal.y < -0.05 && laid.normal.x.abs() < 1e-9);
        assert!((0.02..0.04).contains(&laid.depth_m), "{}", laid.depth_m);
    }
}
