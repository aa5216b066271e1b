//! Statics of one corner: from member forces to the contact-patch wrench and back.
//!
//! A two-leg arm takes the part of its ball joint's force that lies in its plane axially in its
//! legs; the part along the arm's normal is set by the strut (or read by bending bridges) through
//! the equilibrium about the hinge. With four legs, the tie rod and one of strut or ball-normal
//! force the upright's six equations are determined:
//!
//! A MacPherson strut has transverse forces at its top in place of the upper legs' forces. Bridges that read
//! the bending of its tube measure them: at a distance s below the top, the bending moment is s times the
//! force. The strut acts on the upright, and the force along the lower arm's normal is that of its weight and
//! inertia alone.
//!
//! Five links and a strut are six forces (`links.rs`). The bushings of a trailing arm hold it by five, which take the
//! place of the links' forces.
//!
//! w = G c + g, with the wrench w = (F, M) that the ground exerts on the tyre, in the tyre's
//! contact frame about the contact point, and the member forces c.

mod links;
mod others;
mod split_arm;

use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector6};
use sample::STANDARD_GRAVITY_M_S2;

use super::{Corner, CornerMotion, CornerPose, SuspensionError, TyreFrame};
use crate::vehicle::{Axle, Unsprung};

use links::{links_inertia, trailing_inertia};
use others::straight_inertia;
use split_arm::SplitArm;

/// Force and moment that the ground exerts on a tyre, contact frame, about the contact point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// Force, N.
    pub force_n: Vector3<f64>,
    /// Moment, N m.
    pub moment_n_m: Vector3<f64>,
}

impl Wrench {
    /// (F_x, F_y, F_z, M_x, M_y, M_z).
    #[must_use]
    pub fn to_vector(self) -> Vector6<f64> {
        stack(self.force_n, self.moment_n_m)
    }

    /// The inverse of [`Wrench::to_vector`].
    #[must_use]
    pub fn from_vector(v: &Vector6<f64>) -> Self {
        Self {
            force_n: v.fixed_rows::<3>(0).into_owned(),
            moment_n_m: v.fixed_rows::<3>(3).into_owned(),
        }
    }
}

/// What the sixth channel of a corner is, the five axial ones being given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChannelKind {
    /// Force of spring, damper and stops along the strut, pushing its ends apart, N.
    Strut,
    /// Force of the upright on the lower arm's ball joint along the arm's upward normal, N: what
    /// bending bridges between strut mount and ball joint read. No strut model enters.
    BallNormal,
}

/// Forces in the members of one corner, N. Axial forces are positive in tension; those of the
/// lower legs hold outboard of the strut's mount. Of five links, each field is the force of its link.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MemberForces {
    /// Upper arm, front leg. MacPherson strut: force of the body on its top across the strut, forwards.
    /// Trailing arm: force of the body on its outer bushing, forwards.
    pub upper_front_n: f64,
    /// Upper arm, rear leg. MacPherson strut: force of the body on its top across the strut, to the left.
    /// Trailing arm: force of the body on its outer bushing, upwards.
    pub upper_rear_n: f64,
    /// Lower arm, front leg. Trailing arm: force of the body on its inner bushing, forwards.
    pub lower_front_n: f64,
    /// Lower arm, rear leg. Trailing arm: force of the body on its inner bushing, upwards.
    pub lower_rear_n: f64,
    /// Tie rod or toe link. Trailing arm: force of the body on both bushings along their line, outwards.
    pub tie_rod_n: f64,
    /// Strut or ball-normal force: see [`ChannelKind`].
    pub sixth_n: f64,
}

impl MemberForces {
    /// The forces in the order of the fields.
    #[must_use]
    pub fn to_vector(self) -> Vector6<f64> {
        Vector6::new(
            self.upper_front_n,
            self.upper_rear_n,
            self.lower_front_n,
            self.lower_rear_n,
            self.tie_rod_n,
            self.sixth_n,
        )
    }

    /// The inverse of [`MemberForces::to_vector`].
    #[must_use]
    pub fn from_vector(v: &Vector6<f64>) -> Self {
        Self {
            upper_front_n: v[0],
            upper_rear_n: v[1],
            lower_front_n: v[2],
            lower_rear_n: v[3],
            tie_rod_n: v[4],
            sixth_n: v[5],
        }
    }
}

/// The linear map of one corner at one instant, both ways.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CornerStatics {
    /// G of w = G c + g.
    pub wrench_from_members: Matrix6<f64>,
    /// g of w = G c + g: weight and inertia of the unsprung parts, spin, half-shaft torque.
    pub wrench_offset: Vector6<f64>,
    /// G^-1 of c = G^-1 w + c_0. Its columns 0-2 are the gains A on the tyre's force, 3-5 the
    /// gains B on its moment: a filter predicts each member's force as A F + B M + c_0.
    pub members_from_wrench: Matrix6<f64>,
    /// c_0 = -G^-1 g.
    pub members_offset: Vector6<f64>,
    /// Ball-normal force for one newton of strut force.
    pub ball_normal_per_strut: f64,
    /// Ball-normal force without strut force (the lower arm's weight and inertia), N.
    pub ball_normal_offset_n: f64,
    /// Upward unit normal of the lower arm's plane, vehicle axes.
    pub lower_normal: Vector3<f64>,
    /// What the sixth channel is.
    pub sixth: ChannelKind,
}

impl CornerStatics {
    /// The map at `pose`, with the tyre standing in `frame`, the parts' masses in `unsprung` and
    /// their motion.
    ///
    /// # Errors
    /// When the members' lines of action are dependent, so that they cannot hold the upright.
    pub fn new(
        corner: &Corner,
        pose: &CornerPose,
        frame: &TyreFrame,
        unsprung: &Unsprung,
        motion: &CornerMotion,
        sixth: ChannelKind,
    ) -> Result<Self, SuspensionError> {
        if let Some(path) = corner.straight_path(pose) {
            return Self::of_straight(path, pose, frame, unsprung, motion);
        }
        if let Some(across) = corner.across_strut(pose) {
            return Self::of_strut(corner, pose, frame, unsprung, motion, across);
        }
        if let Some(links) = corner.links() {
            return Self::of_links(corner, links, pose, frame, unsprung, motion);
        }
        if corner.is_trailing() {
            return Self::of_trailing_arm(corner, pose, frame, unsprung, motion);
        }
        let p = &corner.points;
        let contact = frame.contact_m;
        let [upper, lower] = arms(corner, pose);
        let tie_rod = (pose.tie_rod_inner_m - pose.tie_rod_outer_m).normalize();

        let strut_gain = -lower.lever(pose.strut_arm_m, pose.strut_direction);
        let (known, lower_weight) =
            known_wrench(pose, contact, Some(&upper), &lower, unsprung, motion, sixth);
        let sixth_gain = match sixth {
            ChannelKind::Strut => strut_gain,
            ChannelKind::BallNormal => 1.0,
        };
        let members = Members {
            at_lower: Matrix3::from_columns(&[
                pull(p.lower_front, pose.lower_ball_m),
                pull(p.lower_rear, pose.lower_ball_m),
                -lower.normal * sixth_gain,
            ]),
            elsewhere: Matrix3::from_columns(&[
                pull(p.upper_front, pose.upper_ball_m),
                pull(p.upper_rear, pose.upper_ball_m),
                tie_rod,
            ]),
            lower_m: pose.lower_ball_m - contact,
            places_m: [pose.upper_ball_m, pose.upper_ball_m, pose.tie_rod_outer_m]
                .map(|place| place - contact),
        };
        let from_vehicle = -frame.vehicle_from_tyre.transpose();
        let wrench_from_members = members.wrench(&from_vehicle);
        let wrench_offset = turned(&known, frame);
        let members_from_wrench =
            members
                .inverse(&frame.vehicle_from_tyre)
                .ok_or(SuspensionError::Degenerate {
                    what: "the members' lines of action depend on each other",
                })?;
        Ok(Self {
            wrench_from_members,
            wrench_offset,
            members_from_wrench,
            members_offset: -(members_from_wrench * wrench_offset),
            ball_normal_per_strut: strut_gain,
            ball_normal_offset_n: lower_weight,
            lower_normal: lower.normal,
            sixth,
        })
    }

    /// The map of forces that hold the upright, as wrenches on it about the contact point, vehicle axes.
    /// `lower`: normal of the lower arm, and the force along it that its weight and inertia call for, N.
    fn of_columns(
        columns: &[Vector6<f64>; 6],
        known: &Vector6<f64>,
        frame: &TyreFrame,
        lower: (Vector3<f64>, f64),
    ) -> Result<Self, SuspensionError> {
        let wrench_from_members = Matrix6::from_columns(&columns.map(|c| turned(&c, frame)));
        let members_from_wrench =
            wrench_from_members
                .try_inverse()
                .ok_or(SuspensionError::Degenerate {
                    what: "the members' lines of action depend on each other",
                })?;
        let wrench_offset = turned(known, frame);
        let (lower_normal, ball_normal_offset_n) = lower;
        Ok(Self {
            wrench_from_members,
            wrench_offset,
            members_from_wrench,
            members_offset: -(members_from_wrench * wrench_offset),
            ball_normal_per_strut: 0.0,
            ball_normal_offset_n,
            lower_normal,
            sixth: ChannelKind::Strut,
        })
    }

    /// The map of a corner of `axle` that stands still with a load on a plane whose unit normal is `up`, in the
    /// contact frame.
    ///
    /// # Errors
    /// When the axle has no unsprung masses, and as [`CornerStatics::new`].
    pub fn standing(
        corner: &Corner,
        pose: &CornerPose,
        axle: &Axle,
        up: Vector3<f64>,
        load_n: f64,
        sixth: ChannelKind,
    ) -> Result<Self, SuspensionError> {
        let unsprung = axle.unsprung.as_ref().ok_or(SuspensionError::Missing {
            axle: if corner.wheel.is_front() {
                "front"
            } else {
                "rear"
            },
            table: "unsprung",
        })?;
        let pressed_m = (load_n / axle.tyre.vertical_stiffness_n_m).max(0.0);
        let frame = TyreFrame::new(pose, up, axle.tyre.unloaded_radius_m, pressed_m);
        let motion = CornerMotion::at_rest(up * STANDARD_GRAVITY_M_S2);
        Self::new(corner, pose, &frame, unsprung, &motion, sixth)
    }

    /// The same map with another motion of the parts.
    #[must_use]
    pub fn moved(
        &self,
        corner: &Corner,
        pose: &CornerPose,
        frame: &TyreFrame,
        unsprung: &Unsprung,
        motion: &CornerMotion,
    ) -> Self {
        let contact = frame.contact_m;
        let without_arms = if corner.straight_path(pose).is_some() {
            Some(straight_inertia(pose, contact, unsprung, motion))
        } else if let Some(links) = corner.links() {
            Some(links_inertia(
                corner, links, pose, contact, unsprung, motion,
            ))
        } else if corner.is_trailing() {
            Some(trailing_inertia(pose, contact, unsprung, motion))
        } else {
            None
        };
        if let Some(known) = without_arms {
            let wrench_offset = turned(&known, frame);
            return Self {
                wrench_offset,
                members_offset: -(self.members_from_wrench * wrench_offset),
                ..*self
            };
        }
        let (upper, lower) = match corner.across_strut(pose) {
            Some(_) => (None, lower_arm(corner, pose)),
            None => {
                let [upper, lower] = arms(corner, pose);
                (Some(upper), lower)
            }
        };
        let (known, lower_weight) = known_wrench(
            pose,
            contact,
            upper.as_ref(),
            &lower,
            unsprung,
            motion,
            self.sixth,
        );
        let wrench_offset = turned(&known, frame);
        Self {
            wrench_offset,
            members_offset: -(self.members_from_wrench * wrench_offset),
            ball_normal_offset_n: lower_weight,
            ..*self
        }
    }

    /// The tyre's wrench from all six member forces: nothing is inverted.
    #[must_use]
    pub fn wrench(&self, members: &MemberForces) -> Wrench {
        let w = self.wrench_from_members * members.to_vector() + self.wrench_offset;
        Wrench::from_vector(&w)
    }

    /// The member forces that a tyre's wrench calls for.
    #[must_use]
    pub fn members(&self, wrench: &Wrench) -> MemberForces {
        let c = self.members_from_wrench * wrench.to_vector() + self.members_offset;
        MemberForces::from_vector(&c)
    }

    /// Gains A (3 columns) of every member's force on the tyre's force.
    #[must_use]
    pub fn force_gains(&self) -> SMatrix<f64, 6, 3> {
        self.members_from_wrench.fixed_columns::<3>(0).into_owned()
    }

    /// Gains B (3 columns) of every member's force on the tyre's moment, N per N m.
    #[must_use]
    pub fn moment_gains(&self) -> SMatrix<f64, 6, 3> {
        self.members_from_wrench.fixed_columns::<3>(3).into_owned()
    }

    /// Ball-normal force of the lower arm that belongs to these member forces, N.
    #[must_use]
    pub fn ball_normal_n(&self, members: &MemberForces) -> f64 {
        match self.sixth {
            ChannelKind::Strut => {
                self.ball_normal_per_strut * members.sixth_n + self.ball_normal_offset_n
            }
            ChannelKind::BallNormal => members.sixth_n,
        }
    }
}

/// How much more tension the lower legs (front, rear) carry inboard of the strut's mount than
/// outboard, N: T_in = T_out + pinv([u_F u_B]) (F_strut d - m f), with the legs' directions u
/// from hinge to ball joint. A gauge inboard of the mount reads T_in.
///
/// It holds for ideal hinges; in the metal their axial split and the legs' own bending add to it,
/// so mount axial bridges outboard.
#[must_use]
pub fn inboard_excess_n(
    corner: &Corner,
    pose: &CornerPose,
    unsprung: &Unsprung,
    motion: &CornerMotion,
    strut_force_n: f64,
) -> [f64; 2] {
    let strut_force_n = match corner.across_strut(pose) {
        Some(_) => 0.0,
        None => strut_force_n,
    };
    let front = (pose.lower_ball_m - corner.points.lower_front).normalize();
    let rear = (pose.lower_ball_m - corner.points.lower_rear).normalize();
    let load = pose.strut_direction * strut_force_n
        - motion.lower_arm_specific_force_m_s2 * unsprung.lower_arm_mass_kg;
    let (a, b) = (front.dot(&load), rear.dot(&load));
    let c = front.dot(&rear);
    let scale = 1.0 / (1.0 - c * c);
    [(a - c * b) * scale, (b - c * a) * scale]
}

/// An arm's hinge and ball joint.
struct Arm {
    origin: Vector3<f64>,
    axis: Vector3<f64>,
    normal: Vector3<f64>,
    normal_moment: f64,
    /// Of an arm in one piece on two bushings.
    split: Option<SplitArm>,
}

impl Arm {
    fn new(
        front: Vector3<f64>,
        rear: Vector3<f64>,
        axis: Vector3<f64>,
        ball: Vector3<f64>,
    ) -> Self {
        let across = (front - ball).cross(&(rear - ball)).normalize();
        let normal = if across.z < 0.0 { -across } else { across };
        Self {
            origin: rear,
            axis,
            normal,
            normal_moment: (ball - rear).cross(&normal).dot(&axis),
            split: None,
        }
    }

    /// The force along the normal at the ball joint that has the same moment about the hinge as
    /// `force` at `point`. A force -m f there (weight and inertia) thus calls for this force of
    /// the upright on the arm.
    fn lever(&self, point: Vector3<f64>, force: Vector3<f64>) -> f64 {
        (point - self.origin).cross(&force).dot(&self.axis) / self.normal_moment
    }
}

/// Upper and lower arm.
fn arms(corner: &Corner, pose: &CornerPose) -> [Arm; 2] {
    let p = &corner.points;
    [
        Arm::new(
            p.upper_front,
            p.upper_rear,
            corner.upper_axis,
            pose.upper_ball_m,
        ),
        lower_arm(corner, pose),
    ]
}

fn lower_arm(corner: &Corner, pose: &CornerPose) -> Arm {
    let p = &corner.points;
    let arm = Arm::new(
        p.lower_front,
        p.lower_rear,
        corner.lower_axis,
        pose.lower_ball_m,
    );
    let split = corner.hinge_front_share.and_then(|share| {
        let bushings = [p.lower_front, p.lower_rear];
        SplitArm::new(bushings, pose.lower_ball_m, arm.normal, share)
    });
    Arm { split, ..arm }
}

/// Unit vector of the pull of an arm's leg on its ball joint.
fn pull(hinge: Vector3<f64>, ball: Vector3<f64>) -> Vector3<f64> {
    -(ball - hinge).normalize()
}

/// What the members need not carry to hold the upright: weight and inertia of all parts, as a wrench on
/// the upright about the contact point, and the lower arm's part of the ball-normal force, N.
fn known_wrench(
    pose: &CornerPose,
    contact: Vector3<f64>,
    upper: Option<&Arm>,
    lower: &Arm,
    unsprung: &Unsprung,
    motion: &CornerMotion,
    sixth: ChannelKind,
) -> (Vector6<f64>, f64) {
    let line = |at: Vector3<f64>, direction: Vector3<f64>| {
        stack(direction, (at - contact).cross(&direction))
    };
    let lower_weight = lower.lever(
        pose.lower_arm_cg_m,
        motion.lower_arm_specific_force_m_s2 * unsprung.lower_arm_mass_kg,
    );
    let mut known = corner_inertia(pose, contact, unsprung, motion);
    if let Some(upper) = upper {
        let upper_weight = upper.lever(
            pose.upper_arm_cg_m,
            motion.upper_arm_specific_force_m_s2 * unsprung.upper_arm_mass_kg,
        );
        known += line(pose.upper_ball_m, -upper.normal) * upper_weight;
    }
    if sixth == ChannelKind::Strut {
        known += line(pose.lower_ball_m, -lower.normal) * lower_weight;
    }
    if let Some(split) = &lower.split {
        let load = motion.lower_arm_specific_force_m_s2 * -unsprung.lower_arm_mass_kg;
        let at_ball = split.at_ball(pose.lower_arm_cg_m, load);
        known += stack(at_ball, (pose.lower_ball_m - contact).cross(&at_ball));
    }
    (known, lower_weight)
}

/// The wrench that balances one of vehicle axes, in the tyre's axes.
fn turned(known: &Vector6<f64>, frame: &TyreFrame) -> Vector6<f64> {
    let from_vehicle = -frame.vehicle_from_tyre.transpose();
    stack(
        from_vehicle * known.fixed_rows::<3>(0),
        from_vehicle * known.fixed_rows::<3>(3),
    )
}

/// Weight, inertia, spin and half-shaft torque of wheel and upright as a wrench on them about the
/// contact point, vehicle axes:
///
/// F = -sum m f, M = sum (r x -m f) - I' w' - w x H + T s, H = I w + I_s Omega s.
fn corner_inertia(
    pose: &CornerPose,
    contact: Vector3<f64>,
    unsprung: &Unsprung,
    motion: &CornerMotion,
) -> Vector6<f64> {
    let wheel = motion.wheel_specific_force_m_s2 * -unsprung.wheel_mass_kg;
    let upright = motion.upright_specific_force_m_s2 * -unsprung.upright_mass_kg;
    let s = pose.spindle;
    let spin = unsprung.wheel_spin_inertia_kg_m2;
    let diametral = unsprung.wheel_diametral_inertia_kg_m2;
    let inertia = |v: Vector3<f64>| v * diametral + s * (s.dot(&v) * (spin - diametral));
    let rate = motion.upright_rate_rad_s;
    let momentum = inertia(rate) + s * (spin * motion.spin_rad_s);
    let momentum_dot = inertia(motion.upright_rate_dot_rad_s2)
        + s * (spin * motion.spin_dot_rad_s2)
        + rate.cross(&momentum);
    stack(
        wheel + upright,
        (pose.wheel_centre_m - contact).cross(&wheel)
            + (pose.upright_cg_m - contact).cross(&upright)
            - momentum_dot
            + s * motion.axle_torque_n_m,
    )
}

/// Directions and places of the six forces that hold the upright. Three of them (the lower legs and
/// the sixth) go through the lower ball joint, so that the balance of moments about it tells the
/// other three by themselves: two systems of three equations instead of one of six.
struct Members {
    /// Lower front leg, lower rear leg, sixth.
    at_lower: Matrix3<f64>,
    /// Upper front leg, upper rear leg, tie rod.
    elsewhere: Matrix3<f64>,
    /// The lower ball joint from the contact point.
    lower_m: Vector3<f64>,
    /// Where those elsewhere act, from the contact point.
    places_m: [Vector3<f64>; 3],
}

/// Order of [`Members::at_lower`] and of [`Members::elsewhere`] among the members.
const AT_LOWER: [usize; 3] = [2, 3, 5];
const ELSEWHERE: [usize; 3] = [0, 1, 4];

impl Members {
    /// Forces and moments about the contact point, turned by `turn`.
    fn wrench(&self, turn: &Matrix3<f64>) -> Matrix6<f64> {
        let mut all = Matrix6::zeros();
        let forces = [turn * self.at_lower, turn * self.elsewhere];
        let moments = [
            turn * self.lower_m.cross_matrix() * self.at_lower,
            turn * self.moments(|k| self.places_m[k]),
        ];
        for (group, members) in [AT_LOWER, ELSEWHERE].iter().enumerate() {
            for (k, member) in members.iter().enumerate() {
                let mut column = all.column_mut(*member);
                column
                    .fixed_rows_mut::<3>(0)
                    .copy_from(&forces[group].column(k));
                column
                    .fixed_rows_mut::<3>(3)
                    .copy_from(&moments[group].column(k));
            }
        }
        all
    }

    fn moments(&self, arm: impl Fn(usize) -> Vector3<f64>) -> Matrix3<f64> {
        let of = |k: usize| arm(k).cross(&self.elsewhere.column(k));
        Matrix3::from_columns(&[of(0), of(1), of(2)])
    }

    /// Inverse of [`Members::wrench`] turned by the negative inverse of `back`.
    ///
    /// With F and M in vehicle axes, the lower ball joint r and the moments A about it of those
    /// elsewhere, these are A^-1 (r x F - M), and those through the joint balance what is left.
    fn inverse(&self, back: &Matrix3<f64>) -> Option<Matrix6<f64>> {
        let of_moments = self
            .moments(|k| self.places_m[k] - self.lower_m)
            .try_inverse()?;
        let of_forces = self.at_lower.try_inverse()?;
        let elsewhere_by_moment = -of_moments * back;
        let elsewhere_by_force = of_moments * self.lower_m.cross_matrix() * back;
        let lower_by_moment = -of_forces * self.elsewhere * elsewhere_by_moment;
        let lower_by_force = -of_forces * (back + self.elsewhere * elsewhere_by_force);
        let mut all = Matrix6::zeros();
        for (members, by_force, by_moment) in [
            (AT_LOWER, lower_by_force, lower_by_moment),
            (ELSEWHERE, elsewhere_by_force, elsewhere_by_moment),
        ] {
            for (k, member) in members.into_iter().enumerate() {
                let mut row = all.row_mut(member);
                row.fixed_columns_mut::<3>(0).copy_from(&by_force.row(k));
                row.fixed_columns_mut::<3>(3).copy_from(&by_moment.row(k));
            }
        }
        Some(all)
    }
}

fn stack(force: Vector3<f64>, moment: Vector3<f64>) -> Vector6<f64> {
    Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
}
