//! Statics of five links, and of a trailing arm.
//!
//! A link with ball joints at both ends carries its axial force. Its weight and inertia -m f at its middle are carried
//! across it by both joints in halves, and along it by its inner joint. The inertia of its turning is left out. A strut
//! on a link with the force F d at the part p of its length from the body bends the link: its outer joint carries
//! p (F d - u (u F d)) across the link, with its direction u. The axial force is that between strut and outer joint.
//!
//! A trailing arm is held by two bushings across their line and by both together along it.

use nalgebra::{Vector3, Vector6};

use super::{CornerStatics, corner_inertia, pull, stack};
use crate::suspension::wishbone::Links;
use crate::suspension::{Corner, CornerMotion, CornerPose, SuspensionError, TyreFrame};
use crate::vehicle::Unsprung;

/// The part of a vector across a unit vector.
fn across(v: Vector3<f64>, unit: Vector3<f64>) -> Vector3<f64> {
    v - unit * unit.dot(&v)
}

/// What the five links and the strut need not carry, as a wrench on the upright about the contact point.
pub(super) fn links_inertia(
    corner: &Corner,
    links: &Links,
    pose: &CornerPose,
    contact: Vector3<f64>,
    unsprung: &Unsprung,
    motion: &CornerMotion,
) -> Vector6<f64> {
    let ends = corner.ends_m(links, pose);
    let upper = motion.upper_arm_specific_force_m_s2 * (-0.5 * unsprung.upper_arm_mass_kg);
    let lower = motion.lower_arm_specific_force_m_s2 * (-0.5 * unsprung.lower_arm_mass_kg);
    let loads = [upper, upper, lower, lower];
    let mut known = corner_inertia(pose, contact, unsprung, motion);
    for ([inner, outer], load) in ends.into_iter().zip(loads) {
        let force = across(load, pull(inner, outer)) * 0.5;
        known += stack(force, (outer - contact).cross(&force));
    }
    known
}

/// What bushings and strut need not carry, as a wrench on the arm about the contact point.
pub(super) fn trailing_inertia(
    pose: &CornerPose,
    contact: Vector3<f64>,
    unsprung: &Unsprung,
    motion: &CornerMotion,
) -> Vector6<f64> {
    let arm = motion.lower_arm_specific_force_m_s2 * -unsprung.lower_arm_mass_kg;
    corner_inertia(pose, contact, unsprung, motion)
        + stack(arm, (pose.lower_arm_cg_m - contact).cross(&arm))
}

impl CornerStatics {
    /// The map of five links and a strut.
    pub(super) fn of_links(
        corner: &Corner,
        links: &Links,
        pose: &CornerPose,
        frame: &TyreFrame,
        unsprung: &Unsprung,
        motion: &CornerMotion,
    ) -> Result<Self, SuspensionError> {
        let contact = frame.contact_m;
        let ends = corner.ends_m(links, pose);
        let pulls = ends.map(|[inner, outer]| (outer, pull(inner, outer)));
        let push = pose.strut_direction;
        let strut = match links.strut_link() {
            None => (pose.strut_arm_m, push),
            Some((k, part)) => {
                let (outer, pull) = pulls[k];
                (outer, across(push, pull) * part)
            }
        };
        let columns = [pulls[0], pulls[1], pulls[2], pulls[3], pulls[4], strut];
        let columns = columns.map(|(at, force)| stack(force, (at - contact).cross(&force)));
        let known = links_inertia(corner, links, pose, contact, unsprung, motion);
        Self::of_columns(&columns, &known, frame, (Vector3::z(), 0.0))
    }

    /// The map of a trailing arm: forces of the outer and of the inner bushing forwards and upwards, of both outwards
    /// along their line, and the strut.
    pub(super) fn of_trailing_arm(
        corner: &Corner,
        pose: &CornerPose,
        frame: &TyreFrame,
        unsprung: &Unsprung,
        motion: &CornerMotion,
    ) -> Result<Self, SuspensionError> {
        let (p, contact) = (&corner.points, frame.contact_m);
        let [forwards, upwards] = corner.across_bushings();
        let columns = [
            (p.lower_front, forwards),
            (p.lower_front, upwards),
            (p.lower_rear, forwards),
            (p.lower_rear, upwards),
            (p.lower_rear, corner.lower_axis),
            (pose.strut_arm_m, pose.strut_direction),
        ];
        let columns = columns.map(|(at, force)| stack(force, (at - contact).cross(&force)));
        let known = trailing_inertia(pose, contact, unsprung, motion);
        Self::of_columns(&columns, &known, frame, (Vector3::z(), 0.0))
    }
}
