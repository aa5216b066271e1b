//! A lower arm in one piece on two bushings, with axial gauges on its legs near them.
//!
//! A load w in the arm's plane at a point p is carried by both bushings. Along the hinge h they share it by their
//! stiffness; across it, along q, the balance of moments about the arm's normal gives the parts:
//!
//! R_F h = -s w_h, R_F q = -((p - B)_h w_q - (p - B)_q w_h)/L, R_B = -w - R_F
//!
//! with the places F and B of the bushings, their distance L and the front one's share s. A gauge reads the part of
//! the bushing's force along its leg.

use nalgebra::{Matrix2, Vector2, Vector3};

/// How the legs of an arm share a load in its plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct SplitArm {
    rear: Vector3<f64>,
    /// Hinge from the rear to the front bushing, and the direction across it in the arm's plane.
    axes: [Vector3<f64>; 2],
    length_m: f64,
    front_share: f64,
    /// From each bushing to the ball joint, along [`SplitArm::axes`].
    legs: [Vector2<f64>; 2],
    /// Force at the ball joint in the plane for the readings of both legs.
    load_from_legs: Matrix2<f64>,
}

impl SplitArm {
    /// The arm on bushings front and rear; `None` if the legs do not tell the load.
    pub(super) fn new(
        [front, rear]: [Vector3<f64>; 2],
        ball: Vector3<f64>,
        normal: Vector3<f64>,
        front_share: f64,
    ) -> Option<Self> {
        let hinge = front - rear;
        let length_m = hinge.norm();
        let along = hinge / length_m;
        let axes = [along, normal.cross(&along).normalize()];
        let mut arm = Self {
            rear,
            axes,
            length_m,
            front_share,
            legs: [Vector2::zeros(); 2],
            load_from_legs: Matrix2::zeros(),
        };
        arm.legs = [front, rear].map(|bushing| arm.planar(ball - bushing).normalize());
        let unit = |axis: usize| arm.readings(ball, axes[axis]);
        arm.load_from_legs = Matrix2::from_columns(&[unit(0), unit(1)]).try_inverse()?;
        Some(arm)
    }

    fn planar(&self, v: Vector3<f64>) -> Vector2<f64> {
        Vector2::new(self.axes[0].dot(&v), self.axes[1].dot(&v))
    }

    /// Tension that the gauges of the front and the rear leg read for a load on the arm at a point.
    fn readings(&self, point: Vector3<f64>, load: Vector3<f64>) -> Vector2<f64> {
        let (at, w) = (self.planar(point - self.rear), self.planar(load));
        let front = Vector2::new(
            -self.front_share * w.x,
            -(at.x * w.y - at.y * w.x) / self.length_m,
        );
        let rear = -w - front;
        Vector2::new(-front.dot(&self.legs[0]), -rear.dot(&self.legs[1]))
    }

    fn load(&self, readings: Vector2<f64>) -> Vector3<f64> {
        let w = self.load_from_legs * readings;
        self.axes[0] * w.x + self.axes[1] * w.y
    }

    /// Forces of the arm on the upright for 1 N of the reading of the front and of the rear leg.
    pub(super) fn pulls(&self) -> [Vector3<f64>; 2] {
        [Vector2::x(), Vector2::y()].map(|reading| -self.load(reading))
    }

    /// Load at the ball joint that the legs read as they read this one.
    pub(super) fn at_ball(&self, point: Vector3<f64>, load: Vector3<f64>) -> Vector3<f64> {
        self.load(self.readings(point, load))
    }
}
