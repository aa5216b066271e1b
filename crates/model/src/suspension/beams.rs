//! Tension and bending along the members of a corner that stands under a load (thesis section 3.3).
//!
//! Each member is a beam between its joints. Its forces are those of [`CornerStatics`]. The arms of the upright and
//! of the tie rod have joints at both ends and no load between them, so that they carry tension alone. The upright
//! pushes on the ball joint of the lower arm with the force n along the normal of the arm, and the strut holds the
//! arm at its mount. Both tubes take a half of n. At the distance x from the ball joint along a tube of the length
//! L, with the mount at s, the moment is
//!
//! M = n x/2 for x <= s, M = n s/2 (L - x)/(L - s) for x > s
//!
//! and zero at the hinge, which turns freely. The weight of the arm bends it little and is left out; the balance at
//! the ball joint contains it.

use nalgebra::Vector3;
use sample::{STANDARD_GRAVITY_M_S2, StrainChannel, Wheel};

use super::wishbone::Links;
use super::{
    ChannelKind, Corner, CornerMotion, CornerPose, CornerStatics, MemberForces, SuspensionError,
    Wrench, inboard_excess_n,
};
use crate::vehicle::Vehicle;

/// A member as a beam from its outer joint inwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MemberBeam {
    /// Axial channel of the member.
    pub channel: StrainChannel,
    /// Length between the joints, m.
    pub length_m: f64,
    /// Distance of the strut's mount from the outer joint along the member, m; `None` without a mount.
    pub mount_m: Option<f64>,
    /// Tension outboard and inboard of the mount, N.
    pub tension_n: [f64; 2],
    /// Bending moment at the mount, N m; positive as an upward force on the outer joint.
    pub moment_n_m: f64,
}

impl MemberBeam {
    /// Tension at a distance from the outer joint, N.
    #[must_use]
    pub fn tension_n(&self, distance_m: f64) -> f64 {
        let inboard = self.mount_m.is_some_and(|mount_m| distance_m > mount_m);
        self.tension_n[usize::from(inboard)]
    }

    /// Bending moment at a distance from the outer joint, N m.
    #[must_use]
    pub fn moment_n_m(&self, distance_m: f64) -> f64 {
        match self.mount_m {
            Some(mount_m) if distance_m <= mount_m => self.moment_n_m * distance_m / mount_m,
            Some(mount_m) => {
                self.moment_n_m * (self.length_m - distance_m) / (self.length_m - mount_m)
            }
            None => 0.0,
        }
    }
}

/// The members of a corner that stands under a force of the ground on its tyre: F_x, F_y and F_z in the contact
/// frame, at the contact point, N. The strut is compressed by `compression_m` from its design length, and the wheels
/// are straight ahead. A torque of F_x about the wheel's axis acts on the upright, as that of a brake.
///
/// # Errors
/// A corner without hard-points or on a trailing arm, or without unsprung masses; a strut
/// beyond the linkage's reach; a force that is not finite.
pub fn beams(
    vehicle: &Vehicle,
    wheel: Wheel,
    force_n: [f64; 3],
    compression_m: f64,
) -> Result<Vec<MemberBeam>, SuspensionError> {
    for force_n in force_n {
        super::finite("force on the wheel", force_n, "N")?;
    }
    let corner = with_members(vehicle, wheel)?;
    let axle = vehicle.axle(wheel);
    let length_m = corner.design_strut_length_m() - compression_m;
    let pose = corner.pose(length_m, 0.0)?;
    let statics = CornerStatics::standing(
        &corner,
        &pose,
        axle,
        Vector3::z(),
        force_n[2],
        ChannelKind::Strut,
    )?;
    let members = statics.members(&Wrench {
        force_n: force_n.into(),
        ..Wrench::default()
    });
    if let Some(links) = corner.links() {
        return Ok(links_beams(&corner, links, &pose, &members));
    }
    let p = &corner.points;
    let lower_m = |inner: Vector3<f64>| (pose.lower_ball_m - inner).norm();
    let mut lower = [
        plain(
            StrainChannel::LowerFront,
            lower_m(p.lower_front),
            members.lower_front_n,
        ),
        plain(
            StrainChannel::LowerRear,
            lower_m(p.lower_rear),
            members.lower_rear_n,
        ),
    ];
    let tie_rod_m = (pose.tie_rod_outer_m - pose.tie_rod_inner_m).norm();
    let tie_rod = plain(StrainChannel::TieRod, tie_rod_m, members.tie_rod_n);
    if axle.macpherson.is_some() {
        return Ok(vec![lower[0], lower[1], tie_rod]);
    }
    if let Some(unsprung) = &axle.unsprung {
        let motion = CornerMotion::at_rest(Vector3::z() * STANDARD_GRAVITY_M_S2);
        let excess_n = inboard_excess_n(&corner, &pose, unsprung, &motion, members.sixth_n);
        let part = mount_part(&corner, &pose);
        bend(&mut lower, part, excess_n, statics.ball_normal_n(&members));
    }
    let upper_m = |inner: Vector3<f64>| (pose.upper_ball_m - inner).norm();
    Ok(vec![
        plain(
            StrainChannel::UpperFront,
            upper_m(p.upper_front),
            members.upper_front_n,
        ),
        plain(
            StrainChannel::UpperRear,
            upper_m(p.upper_rear),
            members.upper_rear_n,
        ),
        lower[0],
        lower[1],
        tie_rod,
    ])
}

/// A corner that is not on a trailing arm.
fn with_members(vehicle: &Vehicle, wheel: Wheel) -> Result<Corner, SuspensionError> {
    let corner = Corner::of(vehicle, wheel)?;
    if corner.is_trailing() {
        return Err(SuspensionError::Missing {
            axle: "rear",
            table: "wishbone, macpherson or five_link",
        });
    }
    Ok(corner)
}

/// The links of a corner on five links. The mount of a strut on a link bends it as a beam on its two joints.
fn links_beams(
    corner: &Corner,
    links: &Links,
    pose: &CornerPose,
    members: &MemberForces,
) -> Vec<MemberBeam> {
    let ends = corner.ends_m(links, pose);
    let channels = [
        StrainChannel::UpperFront,
        StrainChannel::UpperRear,
        StrainChannel::LowerFront,
        StrainChannel::LowerRear,
        StrainChannel::TieRod,
    ];
    let beam = |(k, channel): (usize, StrainChannel)| {
        let [inner, outer] = ends[k];
        let between = outer - inner;
        let length_m = between.norm();
        let beam = plain(channel, length_m, members.to_vector()[k]);
        let Some((_, part)) = links.strut_link().filter(|(link, _)| *link == k) else {
            return beam;
        };
        let along = between / length_m;
        let push = pose.strut_direction * members.sixth_n;
        let across = push - along * along.dot(&push);
        MemberBeam {
            mount_m: Some((1.0 - part) * length_m),
            tension_n: [beam.tension_n[0], beam.tension_n[0] + along.dot(&push)],
            moment_n_m: -across.z.signum() * across.norm() * part * (1.0 - part) * length_m,
            ..beam
        }
    };
    channels.into_iter().enumerate().map(beam).collect()
}

/// Adds to the tubes of a lower arm what the strut's mount makes, at a part of their length from the ball joint.
fn bend(lower: &mut [MemberBeam; 2], part: f64, excess_n: [f64; 2], ball_normal_n: f64) {
    for (beam, excess_n) in lower.iter_mut().zip(excess_n) {
        let mount_m = part * beam.length_m;
        beam.mount_m = Some(mount_m);
        beam.tension_n[1] += excess_n;
        beam.moment_n_m = 0.5 * ball_normal_n * mount_m;
    }
}

/// A member with tension alone.
fn plain(channel: StrainChannel, length_m: f64, tension_n: f64) -> MemberBeam {
    MemberBeam {
        channel,
        length_m,
        mount_m: None,
        tension_n: [tension_n; 2],
        moment_n_m: 0.0,
    }
}

/// Place of the strut's mount between ball joint (0) and hinge (1) of the lower arm.
fn mount_part(corner: &Corner, pose: &CornerPose) -> f64 {
    let from_hinge = |point: Vector3<f64>| {
        let arm = point - corner.points.lower_rear;
        (arm - corner.lower_axis * arm.dot(&corner.lower_axis)).norm()
    };
    (1.0 - from_hinge(pose.strut_arm_m) / from_hinge(pose.lower_ball_m)).clamp(0.0, 1.0)
}
