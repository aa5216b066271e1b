//! First and second derivatives of a live axle's pose by the lengths of its springs, in closed form.
//!
//! The six equations of the pose are differentiated twice. With the unit vector u from the axle's end x of a
//! line to the body and the line's length l,
//!
//! l_a = -u x_a, l_ab = -u x_ab + (x_a x_b - (u x_a)(u x_b))/l,
//!
//! where x_ab = p_ab + w_ab x r + (w_a x (w_b x r) + w_b x (w_a x r))/2.

use nalgebra::{Matrix6, SVector, Vector3, Vector6};

use super::{LINKS, LinkedAxle, LiveAxlePose, Place};
use crate::suspension::linkage::{Derivatives, PointPath};

/// Movement of the origin and rotation of the axle for one unit of one coordinate.
#[derive(Clone, Copy)]
struct Unit {
    origin: Vector3<f64>,
    rotation: Vector3<f64>,
}

impl Unit {
    fn of(column: &Vector6<f64>) -> Self {
        Self {
            origin: column.fixed_rows::<3>(0).into_owned(),
            rotation: column.fixed_rows::<3>(3).into_owned(),
        }
    }

    fn at(&self, arm: Vector3<f64>) -> Vector3<f64> {
        self.origin + self.rotation.cross(&arm)
    }
}

impl LinkedAxle {
    /// The pose at a place; `inverse` is that of its equations.
    pub(super) fn moving(
        &self,
        place: &Place,
        lengths_m: [f64; 2],
        inverse: &Matrix6<f64>,
    ) -> LiveAxlePose {
        let [left, right] = [4, 5].map(|k| Unit::of(&inverse.column(k).into_owned()));
        let bend = |a: &Unit, b: &Unit| Unit::of(&(inverse * -self.bends(place, a, b)));
        let bends = [
            bend(&left, &left),
            bend(&left, &right),
            bend(&right, &right),
        ];
        let derivatives = |of: fn(&Unit) -> Vector3<f64>| Derivatives {
            by_strut: of(&left),
            by_rack: of(&right),
            by_strut_strut: of(&bends[0]),
            by_strut_rack: of(&bends[1]),
            by_rack_rack: of(&bends[2]),
        };
        LiveAxlePose {
            lengths_m,
            vehicle_from_axle: place.turned.into_inner(),
            path: PointPath {
                point_m: place.origin_m,
                travel: derivatives(|unit| unit.origin),
                rotation: derivatives(|unit| unit.rotation),
            },
        }
    }

    /// Second derivatives of the six equations without the parts of p_ab and w_ab.
    fn bends(&self, place: &Place, a: &Unit, b: &Unit) -> Vector6<f64> {
        let of_line = |line| {
            let (towards, arm, length_m) = place.line(line);
            let (of_a, of_b) = (a.at(arm), b.at(arm));
            let centripetal = (a.rotation.cross(&b.rotation.cross(&arm))
                + b.rotation.cross(&a.rotation.cross(&arm)))
                * 0.5;
            (of_a.dot(&of_b) - towards.dot(&of_a) * towards.dot(&of_b)) / length_m
                - towards.dot(&centripetal)
        };
        let of_links = SVector::<f64, LINKS>::from_fn(|i, _| of_line(&self.links[i]));
        let held = self.held * of_links;
        let [left, right] = self.springs.each_ref().map(of_line);
        Vector6::new(held[0], held[1], held[2], held[3], left, right)
    }
}
