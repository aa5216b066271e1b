//! What all suspension linkages of one corner have in common.
//!
//! A corner has two coordinates: the length l of its strut and the travel z of its rack (on an axle
//! without a rack z stays 0). Every outboard part is a rigid body whose place and attitude against
//! the sprung body are functions of both. With first and second derivatives, velocity and
//! acceleration of a point p and the rate and angular acceleration of its part, both against the
//! body, are
//!
//! p' = p_l l' + p_z z'
//! p'' = p_l l'' + p_z z'' + p_ll l'^2 + 2 p_lz l' z' + p_zz z'^2
//!
//! and alike for the rotation, with w_l and w_z in place of p_l and p_z. All vectors stand in
//! vehicle axes.

use nalgebra::{Matrix3, Vector3};

use super::{BodyMotion, SuspensionError};
use crate::vehicle::Unsprung;

/// Most parts of one corner that have a mass: wheel, upright or carrier, two arms.
pub const PARTS: usize = 4;

/// Length l of the strut and travel z of the rack, or one of their time derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coordinates {
    /// Of the strut length: m, m/s or m/s^2.
    pub strut: f64,
    /// Of the rack travel: m, m/s or m/s^2.
    pub rack: f64,
}

/// First and second derivatives of one vector quantity by strut length and rack travel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Derivatives {
    /// By strut length.
    pub by_strut: Vector3<f64>,
    /// By rack travel.
    pub by_rack: Vector3<f64>,
    /// Twice by strut length.
    pub by_strut_strut: Vector3<f64>,
    /// Once by either; half of the sum of both orders for a rotation, whose derivatives do not
    /// commute.
    pub by_strut_rack: Vector3<f64>,
    /// Twice by rack travel.
    pub by_rack_rack: Vector3<f64>,
}

impl Derivatives {
    /// A part of the quantity.
    #[must_use]
    pub fn times(&self, part: f64) -> Self {
        Self {
            by_strut: self.by_strut * part,
            by_rack: self.by_rack * part,
            by_strut_strut: self.by_strut_strut * part,
            by_strut_rack: self.by_strut_rack * part,
            by_rack_rack: self.by_rack_rack * part,
        }
    }

    /// Rate of the quantity.
    #[must_use]
    pub fn rate(&self, rate: Coordinates) -> Vector3<f64> {
        self.by_strut * rate.strut + self.by_rack * rate.rack
    }

    /// Second time derivative of the quantity without l'': what velocity and rack make of it.
    #[must_use]
    pub fn bend(&self, rate: Coordinates, rack_m_s2: f64) -> Vector3<f64> {
        self.by_rack * rack_m_s2
            + self.by_strut_strut * (rate.strut * rate.strut)
            + self.by_strut_rack * (2.0 * rate.strut * rate.rack)
            + self.by_rack_rack * (rate.rack * rate.rack)
    }

    /// Second time derivative of the quantity.
    #[must_use]
    pub fn acceleration(&self, rate: Coordinates, acceleration: Coordinates) -> Vector3<f64> {
        self.by_strut * acceleration.strut + self.bend(rate, acceleration.rack)
    }
}

/// A point of an outboard part, with the rotation of that part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointPath {
    /// Where the point is, m.
    pub point_m: Vector3<f64>,
    /// How it moves.
    pub travel: Derivatives,
    /// How its part turns.
    pub rotation: Derivatives,
}

impl PointPath {
    /// A point that does not move against the body.
    #[must_use]
    pub fn fixed(point_m: Vector3<f64>) -> Self {
        Self {
            point_m,
            travel: Derivatives::default(),
            rotation: Derivatives::default(),
        }
    }

    /// Another point of the same part.
    #[must_use]
    pub fn at(&self, point_m: Vector3<f64>) -> Self {
        let arm = point_m - self.point_m;
        let (p, w) = (&self.travel, &self.rotation);
        let twice = |a: &Vector3<f64>, b: &Vector3<f64>| a.cross(&b.cross(&arm));
        let across = twice(&w.by_strut, &w.by_rack) + twice(&w.by_rack, &w.by_strut);
        Self {
            point_m,
            travel: Derivatives {
                by_strut: p.by_strut + w.by_strut.cross(&arm),
                by_rack: p.by_rack + w.by_rack.cross(&arm),
                by_strut_strut: p.by_strut_strut
                    + w.by_strut_strut.cross(&arm)
                    + twice(&w.by_strut, &w.by_strut),
                by_strut_rack: p.by_strut_rack + w.by_strut_rack.cross(&arm) + across * 0.5,
                by_rack_rack: p.by_rack_rack
                    + w.by_rack_rack.cross(&arm)
                    + twice(&w.by_rack, &w.by_rack),
            },
            rotation: *w,
        }
    }

    /// Specific force at the point on a moving body: the body's at that place, 2 w x p' and p''.
    #[must_use]
    pub fn specific_force_m_s2(
        &self,
        body: &BodyMotion,
        rate: Coordinates,
        acceleration: Coordinates,
    ) -> Vector3<f64> {
        body.specific_force_at(self.point_m)
            + body.rate_rad_s.cross(&self.travel.rate(rate)) * 2.0
            + self.travel.acceleration(rate, acceleration)
    }

    /// Acceleration l'' of the strut's length at which the point has a specific force f on a moving
    /// body, by least squares along its path: l'' = (f - f_0) p_l/p_l^2, with the specific force f_0
    /// without l''.
    #[must_use]
    pub fn strut_acceleration_m_s2(
        &self,
        body: &BodyMotion,
        rate: Coordinates,
        rack_acceleration: f64,
        specific_force_m_s2: Vector3<f64>,
    ) -> f64 {
        let held = Coordinates {
            strut: 0.0,
            rack: rack_acceleration,
        };
        let along = self.travel.by_strut;
        let rest = specific_force_m_s2 - self.specific_force_m_s2(body, rate, held);
        rest.dot(&along) / along.norm_squared()
    }

    /// Angular acceleration of the part on a moving body.
    #[must_use]
    pub fn rate_dot_rad_s2(
        &self,
        body: &BodyMotion,
        rate: Coordinates,
        acceleration: Coordinates,
    ) -> Vector3<f64> {
        body.rate_dot_rad_s2
            + body.rate_rad_s.cross(&self.rotation.rate(rate))
            + self.rotation.acceleration(rate, acceleration)
    }
}

/// A rigid part outboard of the hinges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutboardPart {
    /// Mass, kg; zero for a part that the linkage does not have.
    pub mass_kg: f64,
    /// Inertia about its centre of gravity, kg m^2; of the wheel about its diameter, without the
    /// spin.
    pub inertia_kg_m2: Matrix3<f64>,
    /// Its centre of gravity.
    pub cg: PointPath,
}

/// A member that carries force along the line between its joints only: a leg of an arm, a tie rod,
/// a toe link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoForceMember {
    /// Joint at the sprung body or rack, m.
    pub inboard_m: Vector3<f64>,
    /// Joint at the outboard part.
    pub outboard: PointPath,
}

impl TwoForceMember {
    /// Unit vector of the pull on the outboard part under tension.
    #[must_use]
    pub fn pull(&self) -> Vector3<f64> {
        (self.inboard_m - self.outboard.point_m).normalize()
    }
}

/// Where a strut acts on the linkage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrutMount {
    /// Unit vector from the chassis end to the outboard end: the push on the outboard part.
    pub direction: Vector3<f64>,
    /// Its outboard end.
    pub outboard: PointPath,
}

/// One corner's linkage, as the equations of motion and the statics ask for it.
///
/// The coordinates are those of the module. A linkage with other parts (half of a
/// live axle) tells its own members and parts; equations of motion and forces
/// ([`strut_force_n`]) stay the same.
pub trait Linkage {
    /// Where all points are at one place of the coordinates.
    type Pose;
    /// The two-force members.
    type Members: AsRef<[TwoForceMember]>;

    /// The pose at a strut length and a rack travel, m.
    ///
    /// # Errors
    /// When the linkage does not reach it.
    fn pose(&self, at: Coordinates) -> Result<Self::Pose, SuspensionError>;

    /// The wheel centre's path with the rotation of the wheel's carrier.
    fn wheel(&self, pose: &Self::Pose) -> PointPath;

    /// Unit vector of the spindle; it points left on both sides.
    fn spindle(&self, pose: &Self::Pose) -> Vector3<f64>;

    /// The members that hold the wheel's carrier.
    fn members(&self, pose: &Self::Pose) -> Self::Members;

    /// Where the strut acts; `None` where a motion ratio stands for it.
    fn strut(&self, pose: &Self::Pose) -> Option<StrutMount>;

    /// The parts outboard: first the wheel, then the others.
    fn parts(&self, pose: &Self::Pose, unsprung: &Unsprung) -> [OutboardPart; PARTS];
}

/// Force of a strut that the motion of the outboard parts calls for, N, pushing its ends apart, by
/// virtual work along the strut's length: with a force F at the wheel centre and a moment M about it
/// on the wheel's carrier (tyre, gyroscopic and half-shaft's moments),
///
/// F_s = -(F p_l + M w_l) + sum m f p_l,i + (I w' + w x I w) w_l,i
///
/// | symbol | name | unit |
/// |---|---|---|
/// | p_l, w_l | derivatives of wheel centre and carrier by strut length | 1, rad/m |
/// | m, I, f, w | mass, inertia, specific force and rate of each part | kg, kg m^2, m/s^2, rad/s |
#[must_use]
pub fn strut_force_n(
    wheel: &PointPath,
    parts: &[OutboardPart; PARTS],
    body: &BodyMotion,
    rate: Coordinates,
    acceleration: Coordinates,
    [force_n, moment_n_m]: [Vector3<f64>; 2],
) -> f64 {
    let inertial = |part: &OutboardPart| {
        let (cg, inertia) = (&part.cg, &part.inertia_kg_m2);
        let force = cg.specific_force_m_s2(body, rate, acceleration) * part.mass_kg;
        let turning = body.rate_rad_s + cg.rotation.rate(rate);
        let moment = inertia * cg.rate_dot_rad_s2(body, rate, acceleration)
            + turning.cross(&(inertia * turning));
        force.dot(&cg.travel.by_strut) + moment.dot(&cg.rotation.by_strut)
    };
    parts.iter().map(inertial).sum::<f64>()
        - force_n.dot(&wheel.travel.by_strut)
        - moment_n_m.dot(&wheel.rotation.by_strut)
}
