use nalgebra::Vector3;

/// The path of a point that turns about a hinge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Circle {
    centre: Vector3<f64>,
    /// From the centre to the point at angle zero.
    start: Vector3<f64>,
    /// A quarter of a turn on.
    quarter: Vector3<f64>,
    branch: f64,
}

impl Circle {
    /// The circle of `point` about the hinge; of both points at a given distance from a target
    /// near `target`, the one on `point`'s side is kept.
    pub(super) fn new(
        hinge: Vector3<f64>,
        axis: Vector3<f64>,
        point: Vector3<f64>,
        target: Vector3<f64>,
    ) -> Self {
        let centre = hinge + axis * axis.dot(&(point - hinge));
        let start = point - centre;
        Self {
            centre,
            start,
            quarter: axis.cross(&start),
            branch: branch(centre, axis, start, target),
        }
    }

    /// The turn by which the point is `distance` away from `target`.
    pub(super) fn turn_to(&self, target: Vector3<f64>, distance: f64) -> Option<Turn> {
        let to_target = target - self.centre;
        let a = to_target.dot(&self.start);
        let b = to_target.dot(&self.quarter);
        let c = 0.5 * (to_target.norm_squared() + self.start.norm_squared() - distance * distance);
        // A cos + B sin = C: in the direction of (A, B) the point stands at C, across from it at D.
        let square = a * a + b * b;
        let rest = square - c * c;
        if !(square > 0.0 && rest >= 0.0) {
            return None;
        }
        let d = self.branch * rest.sqrt();
        Some(Turn {
            cosine: (a * c - b * d) / square,
            sine: (b * c + a * d) / square,
        })
    }
}

/// A turn about a hinge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn {
    cosine: f64,
    sine: f64,
}

impl Turn {
    pub(super) fn by(angle_rad: f64) -> Self {
        let (sine, cosine) = math::sin_cos(angle_rad);
        Self { cosine, sine }
    }

    pub(super) fn angle_rad(self) -> f64 {
        math::atan2(self.sine, self.cosine)
    }

    /// `point` turned about the line through `origin` along the unit vector `axis`.
    pub(super) fn carry(
        self,
        origin: Vector3<f64>,
        axis: Vector3<f64>,
        point: Vector3<f64>,
    ) -> Vector3<f64> {
        let r = point - origin;
        let along = axis * (axis.dot(&r) * (1.0 - self.cosine));
        origin + r * self.cosine + axis.cross(&r) * self.sine + along
    }
}

/// On which side of the direction to `target` the lever points, seen along the axis.
pub(super) fn branch(
    centre: Vector3<f64>,
    axis: Vector3<f64>,
    lever: Vector3<f64>,
    target: Vector3<f64>,
) -> f64 {
    if axis.dot(&(target - centre).cross(&lever)) < 0.0 {
        -1.0
    } else {
        1.0
    }
}
