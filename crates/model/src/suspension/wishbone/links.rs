//! Kinematics of an upright on five links: six lengths hold it, those of the links and that of the strut.
//!
//! With the end x_i of link i at the upright and its end p_i at the body or rack, a pose solves
//!
//! |x_i - p_i| = L_i for i = 1 to 5, |s - p_6| = l
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | x_i, p_i | ends of link i at the upright and at the body | m |
//! | L_i, l | length of link i in the design position, wanted length of the strut | m |
//! | s, p_6 | ends of the strut at the upright or at a link, and at the body | m |
//!
//! A strut on link k acts at the part f of its length from the body: s = p_k + f (x_k - p_k). Each length is
//! q = |q|, with q' = f (v + w x a) - p' for the twist (v, w) of the upright and the arm a from the wheel centre.
//! Differentiated twice along the coordinates a and b, with the unit vector d = q/|q|:
//!
//! d q_a = l_a, d q_ab = (l_a l_b - q_a q_b)/|q|, l_a = 1 for the strut along its length, otherwise 0.
//!
//! Both are systems of six equations with one matrix.

use nalgebra::{Matrix6, Rotation3, Vector3, Vector6};

use super::{Corner, CornerPose, CornerRates, Guide, HardPoints, Twist};
use crate::suspension::linkage::{Derivatives, PointPath, TwoForceMember};
use crate::suspension::live_axle::{is_below, rotated};
use crate::suspension::{CornerPath, SuspensionError};
use crate::vehicle::{Axle, FiveLink};
use sample::Wheel;

/// Number of links: upper front and rear, lower front and rear, tie rod.
pub(in crate::suspension) const LINKS: usize = 5;
/// Index of the link that ends at the rack.
const TIE_ROD: usize = 4;
/// Largest error of a length in a pose, m.
const CLOSED_M: f64 = 1e-13;
/// Newton's steps at most: five suffice over the travel of a wheel.
const ROUNDS: usize = 30;
/// Largest step of Newton's method, m and rad.
const LONGEST_STEP: f64 = 0.1;
/// Shortest line, m.
const SHORTEST_M: f64 = 1e-3;
/// Least determinant of the directions of links and strut (arms in m) that hold an upright, m^3.
const SINGULAR: f64 = 1e-4;

/// A line between the body and the upright.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Line {
    /// End at the body or rack in the design position, vehicle axes, m.
    inner_m: Vector3<f64>,
    /// From the wheel centre to the end at the upright, axes of the design position, m.
    arm_m: Vector3<f64>,
}

/// Five links and a strut.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::suspension) struct Links {
    links: [Line; LINKS],
    lengths_m: [f64; LINKS],
    strut: Mount,
    wheel_centre_m: Vector3<f64>,
    /// Sign of the determinant of the constraints in the design position.
    branch: f64,
}

/// Where the strut acts.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Mount {
    chassis_m: Vector3<f64>,
    /// Arm at the upright; of a strut on a link, that of the link's outer end.
    arm_m: Vector3<f64>,
    /// The link and the part of its length between body and mount.
    on_link: Option<(usize, f64)>,
}

/// Place of an upright.
#[derive(Clone, Copy)]
struct Place {
    centre_m: Vector3<f64>,
    turned: Rotation3<f64>,
}

/// One length: its vector q, its length, the arm at the upright, and the part of the arm's movement in q.
#[derive(Clone, Copy, Default)]
struct Length {
    between: Vector3<f64>,
    length_m: f64,
    arm: Vector3<f64>,
    part: f64,
}

impl Length {
    fn new(between: Vector3<f64>, arm: Vector3<f64>, part: f64) -> Self {
        Self {
            between,
            length_m: between.norm(),
            arm,
            part,
        }
    }

    /// Change of the length for a movement and a rotation of the upright.
    fn gradient(&self) -> Vector6<f64> {
        let along = self.between * (self.part / self.length_m);
        let about = self.arm.cross(&along);
        Vector6::new(along.x, along.y, along.z, about.x, about.y, about.z)
    }
}

/// Movement of wheel centre, upright and rack for one unit of one coordinate.
#[derive(Clone, Copy)]
struct Unit {
    twist: Twist,
    inner: Vector3<f64>,
    strut: f64,
}

/// How an upright moves.
struct Moving {
    lengths: [Length; LINKS + 1],
    inverse: Matrix6<f64>,
    /// For one unit of strut and of rack.
    units: [Unit; 2],
}

impl Links {
    /// Links in the order of [`LINKS`].
    pub(super) fn new(file: &FiveLink, place: impl Fn([f64; 3]) -> Vector3<f64>) -> Self {
        let centre_m = place(file.wheel_centre_m);
        let links = file.links_m().map(|[inner_m, outer_m]| Line {
            inner_m: place(inner_m),
            arm_m: place(outer_m) - centre_m,
        });
        let mount_m = place(file.strut_mount_m);
        let on_link = file.strut_on.link().map(|k| {
            let link = &links[k];
            let along = centre_m + link.arm_m - link.inner_m;
            let part = (mount_m - link.inner_m).dot(&along) / along.norm_squared();
            (k, part)
        });
        let mut made = Self {
            links,
            lengths_m: [0.0; LINKS],
            strut: Mount {
                chassis_m: place(file.strut_chassis_m),
                arm_m: on_link.map_or(mount_m - centre_m, |(k, _)| links[k].arm_m),
                on_link,
            },
            wheel_centre_m: centre_m,
            branch: 1.0,
        };
        let design = made.lengths(&made.design(), Vector3::zeros());
        made.lengths_m = std::array::from_fn(|k| design[k].length_m);
        made.branch = constraints(&design).determinant().signum();
        made
    }

    /// Points that stand for those of a double wishbone: hinges are the ends at the body, ball joints the middles
    /// between the outer ends of both links.
    pub(super) fn points(&self) -> HardPoints {
        let outer = |k: usize| self.wheel_centre_m + self.links[k].arm_m;
        let middle = |a: Vector3<f64>, b: Vector3<f64>| 0.5 * (a + b);
        let [uf, ur, lf, lr, tie] = self.links.map(|link| link.inner_m);
        let (upper, lower) = (middle(outer(0), outer(1)), middle(outer(2), outer(3)));
        let mount = self.mount_m(&self.design());
        HardPoints {
            wheel_centre: self.wheel_centre_m,
            upper_front: uf,
            upper_rear: ur,
            upper_ball: upper,
            lower_front: lf,
            lower_rear: lr,
            lower_ball: lower,
            strut_chassis: self.strut.chassis_m,
            strut_arm: mount,
            tie_rod_inner: tie,
            tie_rod_outer: outer(TIE_ROD),
            upright_cg: middle(upper, lower),
            upper_arm_cg: middle(middle(uf, ur), upper),
            lower_arm_cg: middle(middle(lf, lr), lower),
        }
    }

    /// Whether lengths and directions of the design position hold the upright.
    pub(super) fn check(&self) -> Result<(), SuspensionError> {
        let design = self.lengths(&self.design(), Vector3::zeros());
        if design
            .iter()
            .any(|length| is_below(length.length_m, SHORTEST_M))
        {
            return Err(SuspensionError::Degenerate {
                what: "both ends of a link or of the strut coincide",
            });
        }
        if is_below(constraints(&design).determinant().abs(), SINGULAR) {
            return Err(SuspensionError::Degenerate {
                what: "the five links and the strut do not hold the upright, since too many of them are parallel or \
                       meet one line",
            });
        }
        Ok(())
    }

    /// The link on which the strut acts, with the part of its length between body and mount.
    pub(in crate::suspension) fn strut_link(&self) -> Option<(usize, f64)> {
        self.strut.on_link
    }

    fn design(&self) -> Place {
        Place {
            centre_m: self.wheel_centre_m,
            turned: Rotation3::identity(),
        }
    }

    fn mount_m(&self, place: &Place) -> Vector3<f64> {
        let at_upright = place.centre_m + place.turned * self.strut.arm_m;
        self.strut.on_link.map_or(at_upright, |(k, part)| {
            let inner = self.links[k].inner_m;
            inner + (at_upright - inner) * part
        })
    }

    /// Links, then the strut. `rack_m`: movement of the inner end of the tie rod.
    fn lengths(&self, place: &Place, rack_m: Vector3<f64>) -> [Length; LINKS + 1] {
        std::array::from_fn(|k| {
            if k == LINKS {
                let between = self.mount_m(place) - self.strut.chassis_m;
                let part = self.strut.on_link.map_or(1.0, |(_, part)| part);
                return Length::new(between, place.turned * self.strut.arm_m, part);
            }
            let link = &self.links[k];
            let inner = if k == TIE_ROD {
                link.inner_m + rack_m
            } else {
                link.inner_m
            };
            let arm = place.turned * link.arm_m;
            Length::new(place.centre_m + arm - inner, arm, 1.0)
        })
    }

    /// The place in which the strut has this length; `None` where Newton's method finds none, or only one in which the
    /// linkage has passed through a dead centre.
    fn place(&self, strut_length_m: f64, rack_m: Vector3<f64>) -> Option<Place> {
        let mut place = self.design();
        for _ in 0..ROUNDS {
            let lengths = self.lengths(&place, rack_m);
            let errors = Vector6::from_fn(|k, _| {
                let wanted_m = if k == LINKS {
                    strut_length_m
                } else {
                    self.lengths_m[k]
                };
                wanted_m - lengths[k].length_m
            });
            let factors = constraints(&lengths).lu();
            if errors.amax() < CLOSED_M {
                let is_same = factors.determinant() * self.branch > SINGULAR;
                return is_same.then_some(place);
            }
            let step = factors.solve(&errors)?;
            let largest = step.amax();
            if !largest.is_finite() {
                return None;
            }
            let step = step * (LONGEST_STEP / largest).min(1.0);
            place.centre_m += step.fixed_rows::<3>(0);
            place.turned = rotated(step.fixed_rows::<3>(3).into_owned()) * place.turned;
        }
        None
    }

    /// Path of the strut's lower end.
    pub(super) fn mount_path(&self, wheel: &PointPath, pose: &CornerPose) -> PointPath {
        match self.strut.on_link {
            None => wheel.at(pose.strut_arm_m),
            Some((_, part)) => {
                let outer = pose.wheel_centre_m + pose.vehicle_from_upright * self.strut.arm_m;
                PointPath {
                    travel: wheel.at(outer).travel.times(part),
                    ..PointPath::fixed(pose.strut_arm_m)
                }
            }
        }
    }

    fn placed(pose: &CornerPose) -> Place {
        Place {
            centre_m: pose.wheel_centre_m,
            turned: Rotation3::from_matrix_unchecked(pose.vehicle_from_upright),
        }
    }
}

/// Change of each length for a movement and a rotation of the upright, as rows.
fn constraints(lengths: &[Length; LINKS + 1]) -> Matrix6<f64> {
    Matrix6::from_columns(&lengths.map(|length| length.gradient())).transpose()
}

fn twist(found: &Vector6<f64>) -> Twist {
    Twist {
        wheel_centre: found.fixed_rows::<3>(0).into_owned(),
        rotation: found.fixed_rows::<3>(3).into_owned(),
    }
}

impl Corner {
    /// A corner on five links on `axle`, whose frame's origin is `axle_m` ahead and left of the centre of gravity.
    pub(super) fn on_links(
        axle: &Axle,
        file: &FiveLink,
        [ahead_m, left_m]: [f64; 2],
        wheel: Wheel,
    ) -> Result<Self, SuspensionError> {
        let place = |p: [f64; 3]| Vector3::new(ahead_m + p[0], wheel.side() * p[1] + left_m, p[2]);
        let links = Links::new(file, place);
        links.check()?;
        let mut points = links.points();
        if let Some(cg_m) = axle.unsprung.as_ref().and_then(|u| u.upright_cg_m) {
            points.upright_cg = place(cg_m);
        }
        let length_m = (points.strut_arm - points.strut_chassis).norm();
        let axis = (points.upper_ball - points.lower_ball).normalize();
        let lever = points.tie_rod_outer - points.lower_ball;
        let ahead = lever.x - axis.x * axis.dot(&lever);
        let guide = Guide::Links(Box::new(links));
        Ok(Self {
            rack_direction: if ahead < 0.0 { -1.0 } else { 1.0 },
            ..Self::guided(wheel, points, guide, length_m)
        })
    }

    /// The links of a corner that has five.
    pub(in crate::suspension) fn links(&self) -> Option<&Links> {
        match &self.guide {
            Guide::Links(links) => Some(links),
            _ => None,
        }
    }

    pub(super) fn links_pose(
        &self,
        links: &Links,
        strut_length_m: f64,
        rack_m: f64,
    ) -> Result<CornerPose, SuspensionError> {
        let shift = Vector3::y() * (self.rack_direction * rack_m);
        let place = (links.place(strut_length_m, shift)).ok_or_else(|| {
            let is_rack = links.place(strut_length_m, Vector3::zeros()).is_some();
            if is_rack {
                super::out_of_reach("rack travel", rack_m, "m")
            } else {
                super::out_of_reach("strut length", strut_length_m, "m")
            }
        })?;
        let p = &self.points;
        let rotation = *place.turned.matrix();
        let follow = |point: Vector3<f64>| place.centre_m + rotation * (point - p.wheel_centre);
        let (lower_ball, upper_ball) = (follow(p.lower_ball), follow(p.upper_ball));
        let strut_arm_m = links.mount_m(&place);
        let half_way =
            |cg: Vector3<f64>, before: Vector3<f64>, ball: Vector3<f64>| cg + 0.5 * (ball - before);
        Ok(CornerPose {
            strut_length_m,
            rack_m,
            lower_angle_rad: 0.0,
            upper_angle_rad: 0.0,
            lower_ball_m: lower_ball,
            upper_ball_m: upper_ball,
            tie_rod_inner_m: p.tie_rod_inner + shift,
            tie_rod_outer_m: follow(p.tie_rod_outer),
            strut_arm_m,
            strut_direction: (strut_arm_m - p.strut_chassis).normalize(),
            wheel_centre_m: place.centre_m,
            spindle: rotation.column(1).into_owned(),
            vehicle_from_upright: rotation,
            upright_cg_m: follow(p.upright_cg),
            upper_arm_cg_m: half_way(p.upper_arm_cg, p.upper_ball, upper_ball),
            lower_arm_cg_m: half_way(p.lower_arm_cg, p.lower_ball, lower_ball),
        })
    }

    /// Lengths, inverse of the constraints, and movements by strut and rack.
    fn links_units(&self, links: &Links, pose: &CornerPose) -> Moving {
        let shift = pose.tie_rod_inner_m - self.points.tie_rod_inner;
        let lengths = links.lengths(&Links::placed(pose), shift);
        // A pose is not singular: `Links::place` refuses such a one.
        let inverse = constraints(&lengths).try_inverse().unwrap_or_default();
        let inner = Vector3::y() * self.rack_direction;
        let along_rod = lengths[TIE_ROD].between.dot(&inner) / lengths[TIE_ROD].length_m;
        let units = [
            Unit {
                twist: twist(&inverse.column(LINKS).into_owned()),
                inner: Vector3::zeros(),
                strut: 1.0,
            },
            Unit {
                twist: twist(&(inverse.column(TIE_ROD) * along_rod)),
                inner,
                strut: 0.0,
            },
        ];
        Moving {
            lengths,
            inverse,
            units,
        }
    }

    pub(super) fn links_rates(&self, links: &Links, pose: &CornerPose) -> CornerRates {
        let [strut, rack] = self.links_units(links, pose).units;
        CornerRates {
            strut: strut.twist,
            rack: rack.twist,
            lower_angle_per_strut: 0.0,
            upper_angle_per_strut: 0.0,
        }
    }

    /// Path of the upright, and those of the links' middles: half of the paths of their outer ends.
    pub(super) fn links_path(&self, links: &Links, pose: &CornerPose) -> CornerPath {
        let Moving {
            lengths,
            inverse,
            units: [by_strut, by_rack],
        } = self.links_units(links, pose);
        let pairs = [
            (by_strut, by_strut),
            (by_strut, by_rack),
            (by_rack, by_rack),
        ];
        let bends = pairs
            .map(|(a, b)| twist(&(inverse * Vector6::from_fn(|k, _| bend(&lengths, k, &a, &b)))));
        let derivatives = |of: fn(&Twist) -> Vector3<f64>| Derivatives {
            by_strut: of(&by_strut.twist),
            by_rack: of(&by_rack.twist),
            by_strut_strut: of(&bends[0]),
            by_strut_rack: of(&bends[1]),
            by_rack_rack: of(&bends[2]),
        };
        let wheel = PointPath {
            point_m: pose.wheel_centre_m,
            travel: derivatives(|twist| twist.wheel_centre),
            rotation: derivatives(|twist| twist.rotation),
        };
        let half = |cg_m: Vector3<f64>, ball_m: Vector3<f64>| PointPath {
            travel: wheel.at(ball_m).travel.times(0.5),
            ..PointPath::fixed(cg_m)
        };
        CornerPath {
            wheel,
            upper_arm: half(pose.upper_arm_cg_m, pose.upper_ball_m),
            lower_arm: half(pose.lower_arm_cg_m, pose.lower_ball_m),
        }
    }

    /// Ends of the five links at body and upright in a pose, m: upper front and rear, lower front and rear, tie rod.
    /// `None` for another linkage.
    #[must_use]
    pub fn link_ends_m(&self, pose: &CornerPose) -> Option<[[Vector3<f64>; 2]; LINKS]> {
        self.links().map(|links| self.ends_m(links, pose))
    }

    pub(in crate::suspension) fn ends_m(
        &self,
        links: &Links,
        pose: &CornerPose,
    ) -> [[Vector3<f64>; 2]; LINKS] {
        std::array::from_fn(|k| {
            let link = &links.links[k];
            let inner = if k == TIE_ROD {
                pose.tie_rod_inner_m
            } else {
                link.inner_m
            };
            let outer = pose.wheel_centre_m + pose.vehicle_from_upright * link.arm_m;
            [inner, outer]
        })
    }

    pub(super) fn links_members(
        &self,
        links: &Links,
        pose: &CornerPose,
        wheel: &PointPath,
    ) -> [TwoForceMember; LINKS] {
        let member = |[inboard_m, outer_m]: [Vector3<f64>; 2]| TwoForceMember {
            inboard_m,
            outboard: wheel.at(outer_m),
        };
        self.ends_m(links, pose).map(member)
    }
}

/// What length `k` asks of the second derivatives along the coordinates of `a` and `b`.
fn bend(lengths: &[Length; LINKS + 1], k: usize, a: &Unit, b: &Unit) -> f64 {
    let Length {
        between,
        length_m,
        arm,
        part,
    } = lengths[k];
    let (wa, wb) = (a.twist.rotation, b.twist.rotation);
    let moved = |unit: &Unit| {
        let inner = if k == TIE_ROD {
            unit.inner
        } else {
            Vector3::zeros()
        };
        (unit.twist.wheel_centre + unit.twist.rotation.cross(&arm)) * part - inner
    };
    let along = if k == LINKS { a.strut * b.strut } else { 0.0 };
    let centripetal = (wa.cross(&wb.cross(&arm)) + wb.cross(&wa.cross(&arm))) * (0.5 * part);
    (along - moved(a).dot(&moved(b)) - between.dot(&centripetal)) / length_m
}

#[cfg(test)]
mod tests;
