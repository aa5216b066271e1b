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

    /// The angle at which the point is `distance` away from `target`.
    pub(super) fn angle_at(&self, target: Vector3<f64>, distance: f64) -> Option<f64> {
        let to_target = target - self.centre;
        let a = to_target.dot(&self.start);
        let b = to_target.dot(&self.quarter);
        let c = 0.5 * (to_target.norm_squared() + self.start.norm_squared() - distance * distance);
        let cosine = c / a.hypot(b);
        if cosine.is_nan() || cosine.abs() > 1.0 {
            return None;
        }
        let angle = b.atan2(a) + self.branch * cosine.acos();
        Some(wrap(angle))
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

fn wrap(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    if angle > PI {
        angle - TAU
    } else if angle <= -PI {
        angle + TAU
    } else {
        angle
    }
}
