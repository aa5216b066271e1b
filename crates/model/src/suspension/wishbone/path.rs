//! Second derivatives of a corner's parts, in closed form.
//!
//! Each constraint is differentiated twice: the strut's length gives the lower arm's angle, the
//! distance of the ball joints the upper arm's, the tie rod's length the turn about the king-pin.
//! Squares of velocities are taken as products of two velocities a and b, so that one function
//! gives all three second derivatives.
//!
//! Under a MacPherson strut with the direction d, the point of the upright at the strut's top moves by l' d
//! and bends by l'' d + 2 l' d'; the distance of the ball joints gives the lower arm's angle.

use nalgebra::{Matrix3, Vector3};

use super::{Corner, CornerPose, CornerRates, Guide, Twist};
use crate::suspension::linkage::{
    Coordinates, Derivatives, Linkage, OutboardPart, PARTS, PointPath, StrutMount, TwoForceMember,
};
use crate::suspension::{CornerPath, SuspensionError};
use crate::vehicle::Unsprung;

/// Velocities of a corner for one unit of one coordinate.
#[derive(Clone, Copy)]
struct Unit {
    /// Of the strut's length.
    strut: f64,
    lower_angle: f64,
    upper_angle: f64,
    lower_ball: Vector3<f64>,
    upper_ball: Vector3<f64>,
    inner: Vector3<f64>,
    outer: Vector3<f64>,
    rotation: Vector3<f64>,
}

/// Second derivative of one quantity along two coordinates.
struct Bend {
    lower_angle: f64,
    upper_angle: f64,
    wheel_centre: Vector3<f64>,
    rotation: Vector3<f64>,
}

impl Corner {
    /// First and second derivatives at `pose`.
    #[must_use]
    pub fn path(&self, pose: &CornerPose) -> CornerPath {
        if let Some(path) = self.straight_path(pose) {
            let mut wheel = PointPath::fixed(pose.wheel_centre_m);
            wheel.travel.by_strut = path.travel;
            wheel.travel.by_strut_strut = path.bend;
            let arm = wheel;
            wheel.rotation.by_strut = path.turn;
            wheel.rotation.by_strut_strut = path.turn_bend;
            wheel.rotation.by_rack = Vector3::z();
            return CornerPath {
                wheel,
                upper_arm: arm,
                lower_arm: arm,
            };
        }
        match &self.guide {
            Guide::Links(links) => return self.links_path(links, pose),
            Guide::Trailing => return self.trailing_path(pose),
            _ => {}
        }
        let rates = self.rates(pose);
        let by_strut = self.unit(pose, 1.0, &rates.strut, &rates, Vector3::zeros());
        let inner = Vector3::y() * self.rack_direction;
        let held = CornerRates {
            lower_angle_per_strut: 0.0,
            upper_angle_per_strut: 0.0,
            ..rates
        };
        let by_rack = self.unit(pose, 0.0, &rates.rack, &held, inner);
        let bends = [
            self.bend(pose, &by_strut, &by_strut, self.lower_bend(pose, &rates)),
            self.bend(pose, &by_strut, &by_rack, 0.0),
            self.bend(pose, &by_rack, &by_rack, 0.0),
        ];
        let derivatives = |first: [Vector3<f64>; 2], of: fn(&Bend) -> Vector3<f64>| Derivatives {
            by_strut: first[0],
            by_rack: first[1],
            by_strut_strut: of(&bends[0]),
            by_strut_rack: of(&bends[1]),
            by_rack_rack: of(&bends[2]),
        };
        CornerPath {
            wheel: PointPath {
                point_m: pose.wheel_centre_m,
                travel: derivatives(
                    [rates.strut.wheel_centre, rates.rack.wheel_centre],
                    |bend| bend.wheel_centre,
                ),
                rotation: derivatives([rates.strut.rotation, rates.rack.rotation], |bend| {
                    bend.rotation
                }),
            },
            lower_arm: swing(
                self.points.lower_rear,
                self.lower_axis,
                pose.lower_arm_cg_m,
                rates.lower_angle_per_strut,
                bends[0].lower_angle,
            ),
            upper_arm: swing(
                self.points.upper_rear,
                self.upper_axis,
                pose.upper_arm_cg_m,
                rates.upper_angle_per_strut,
                bends[0].upper_angle,
            ),
        }
    }

    fn unit(
        &self,
        pose: &CornerPose,
        strut: f64,
        twist: &Twist,
        rates: &CornerRates,
        inner: Vector3<f64>,
    ) -> Unit {
        let p = &self.points;
        let turned = |hinge: Vector3<f64>, axis: Vector3<f64>, ball: Vector3<f64>, angle: f64| {
            axis.cross(&(ball - hinge)) * angle
        };
        let (lower_angle, upper_angle) = (rates.lower_angle_per_strut, rates.upper_angle_per_strut);
        let upper_ball = match self.guide {
            Guide::Arm(_) => turned(
                p.upper_rear,
                self.upper_axis,
                pose.upper_ball_m,
                upper_angle,
            ),
            _ => pose.strut_direction * strut,
        };
        Unit {
            strut,
            lower_angle,
            upper_angle,
            lower_ball: turned(
                p.lower_rear,
                self.lower_axis,
                pose.lower_ball_m,
                lower_angle,
            ),
            upper_ball,
            inner,
            outer: twist.at(pose, pose.tie_rod_outer_m),
            rotation: twist.rotation,
        }
    }

    /// Second derivative of the lower arm's angle by the strut's length: with the length l(theta),
    /// l l_tt = s_tt (s - c) + s_t^2 - l_t^2, theta_ll = -l_tt/l_t^3.
    pub(super) fn lower_bend(&self, pose: &CornerPose, rates: &CornerRates) -> f64 {
        let arm = pose.strut_arm_m - self.points.lower_rear;
        let once = self.lower_axis.cross(&arm);
        let twice = self.lower_axis.cross(&once);
        let angle = rates.lower_angle_per_strut;
        let slope = 1.0 / angle;
        let bend = twice.dot(&pose.strut_direction)
            + (once.norm_squared() - slope * slope) / pose.strut_length_m;
        -bend * angle.powi(3)
    }

    fn bend(&self, pose: &CornerPose, a: &Unit, b: &Unit, lower_angle: f64) -> Bend {
        let p = &self.points;
        let (lower_arm, upper_arm) = (
            pose.lower_ball_m - p.lower_rear,
            pose.upper_ball_m - p.upper_rear,
        );
        let along = self.lower_axis.cross(&lower_arm);
        let lower_turn = self.lower_axis.cross(&along) * (a.lower_angle * b.lower_angle);
        let kingpin = pose.upper_ball_m - pose.lower_ball_m;
        let apart = (a.upper_ball - a.lower_ball).dot(&(b.upper_ball - b.lower_ball));
        let (lower_angle, upper_angle, lower, upper) = match self.guide {
            Guide::Arm(_) => {
                let lower = along * lower_angle + lower_turn;
                let upper_path = self.upper_axis.cross(&upper_arm);
                let upper_turn =
                    self.upper_axis.cross(&upper_path) * (a.upper_angle * b.upper_angle);
                let upper_angle =
                    (kingpin.dot(&(lower - upper_turn)) - apart) / kingpin.dot(&upper_path);
                let upper = upper_path * upper_angle + upper_turn;
                (lower_angle, upper_angle, lower, upper)
            }
            _ => {
                let direction = pose.strut_direction;
                let upper =
                    b.rotation.cross(&direction) * a.strut + a.rotation.cross(&direction) * b.strut;
                let lower_angle =
                    (kingpin.dot(&(upper - lower_turn)) + apart) / kingpin.dot(&along);
                (lower_angle, 0.0, along * lower_angle + lower_turn, upper)
            }
        };
        // Centripetal part of an arm of the upright, the mean of both orders of a and b.
        let centripetal = |arm: Vector3<f64>| {
            (a.rotation.cross(&b.rotation.cross(&arm)) + b.rotation.cross(&a.rotation.cross(&arm)))
                * 0.5
        };
        let across =
            kingpin.cross(&(upper - lower - centripetal(kingpin))) / kingpin.norm_squared();
        let rod = pose.tie_rod_outer_m - pose.tie_rod_inner_m;
        let arm = pose.tie_rod_outer_m - pose.lower_ball_m;
        let held = lower + across.cross(&arm) + centripetal(arm);
        let stretch = (a.outer - a.inner).dot(&(b.outer - b.inner));
        let about_kingpin = -(rod.dot(&held) + stretch) / rod.dot(&kingpin.cross(&arm));
        let rotation = across + kingpin * about_kingpin;
        let to_centre = pose.wheel_centre_m - pose.lower_ball_m;
        Bend {
            lower_angle,
            upper_angle,
            wheel_centre: lower + rotation.cross(&to_centre) + centripetal(to_centre),
            rotation,
        }
    }
}

/// Path of an arm's point about its hinge.
pub(super) fn swing(
    hinge: Vector3<f64>,
    axis: Vector3<f64>,
    point_m: Vector3<f64>,
    angle: f64,
    angle_bend: f64,
) -> PointPath {
    let once = axis.cross(&(point_m - hinge));
    let twice = axis.cross(&once);
    PointPath {
        point_m,
        travel: Derivatives {
            by_strut: once * angle,
            by_strut_strut: once * angle_bend + twice * (angle * angle),
            ..Derivatives::default()
        },
        rotation: Derivatives {
            by_strut: axis * angle,
            by_strut_strut: axis * angle_bend,
            ..Derivatives::default()
        },
    }
}

impl Linkage for Corner {
    type Pose = (CornerPose, CornerPath);
    type Members = [TwoForceMember; 5];

    fn pose(&self, at: Coordinates) -> Result<Self::Pose, SuspensionError> {
        let pose = Self::pose(self, at.strut, at.rack)?;
        Ok((pose, self.path(&pose)))
    }

    fn wheel(&self, (_, path): &Self::Pose) -> PointPath {
        path.wheel
    }

    fn spindle(&self, (pose, _): &Self::Pose) -> Vector3<f64> {
        pose.spindle
    }

    /// Upper front and rear leg, lower front and rear leg, tie rod; the lower legs outboard of the
    /// strut's mount. Of a MacPherson strut, the first two have no length; of a trailing arm, none is a member.
    fn members(&self, (pose, path): &Self::Pose) -> [TwoForceMember; 5] {
        if let Guide::Links(links) = &self.guide {
            return self.links_members(links, pose, &path.wheel);
        }
        let p = &self.points;
        [
            (p.upper_front, pose.upper_ball_m),
            (p.upper_rear, pose.upper_ball_m),
            (p.lower_front, pose.lower_ball_m),
            (p.lower_rear, pose.lower_ball_m),
            (pose.tie_rod_inner_m, pose.tie_rod_outer_m),
        ]
        .map(|(inboard_m, outboard_m)| TwoForceMember {
            inboard_m,
            outboard: path.wheel.at(outboard_m),
        })
    }

    fn strut(&self, (pose, path): &Self::Pose) -> Option<StrutMount> {
        Some(StrutMount {
            direction: pose.strut_direction,
            outboard: match self.guide {
                Guide::Arm(_) => path.lower_arm.at(pose.strut_arm_m),
                Guide::Links(ref links) => links.mount_path(&path.wheel, pose),
                Guide::Strut(_) | Guide::Trailing | Guide::Straight(_) => {
                    path.wheel.at(pose.strut_arm_m)
                }
            },
        })
    }

    /// Wheel, upright, upper arm, lower arm.
    fn parts(&self, (pose, path): &Self::Pose, unsprung: &Unsprung) -> [OutboardPart; PARTS] {
        let part = |mass_kg: f64, cg: PointPath| OutboardPart {
            mass_kg,
            inertia_kg_m2: Matrix3::zeros(),
            cg,
        };
        let s = pose.spindle;
        let diametral =
            (Matrix3::identity() - s * s.transpose()) * unsprung.wheel_diametral_inertia_kg_m2;
        [
            OutboardPart {
                inertia_kg_m2: diametral,
                ..part(unsprung.wheel_mass_kg, path.wheel)
            },
            part(unsprung.upright_mass_kg, path.wheel.at(pose.upright_cg_m)),
            part(unsprung.upper_arm_mass_kg, path.upper_arm),
            part(unsprung.lower_arm_mass_kg, path.lower_arm),
        ]
    }
}

#[cfg(test)]
mod tests;
