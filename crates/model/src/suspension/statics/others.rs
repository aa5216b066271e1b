//! Statics of a MacPherson strut, and of a wheel whose linkage is not known.

use nalgebra::{Vector3, Vector6};

use super::{ChannelKind, CornerStatics, corner_inertia, known_wrench, lower_arm, pull, stack};
use crate::suspension::{Corner, CornerMotion, CornerPose, SuspensionError, TyreFrame, WheelPath};
use crate::vehicle::Unsprung;

impl CornerStatics {
    /// The map of a MacPherson strut whose tube is bent along `across`.
    pub(super) fn of_strut(
        corner: &Corner,
        pose: &CornerPose,
        frame: &TyreFrame,
        unsprung: &Unsprung,
        motion: &CornerMotion,
        across: [Vector3<f64>; 2],
    ) -> Result<Self, SuspensionError> {
        let p = &corner.points;
        let contact = frame.contact_m;
        let lower = lower_arm(corner, pose);
        let (known, lower_weight) = known_wrench(
            pose,
            contact,
            None,
            &lower,
            unsprung,
            motion,
            ChannelKind::Strut,
        );
        let (top, ball) = (pose.upper_ball_m, pose.lower_ball_m);
        let tie_rod = (pose.tie_rod_inner_m - pose.tie_rod_outer_m).normalize();
        let [front, rear] = match &lower.split {
            Some(split) => split.pulls(),
            None => [p.lower_front, p.lower_rear].map(|hinge| pull(hinge, ball)),
        };
        let columns = [
            (top, across[0]),
            (top, across[1]),
            (ball, front),
            (ball, rear),
            (pose.tie_rod_outer_m, tie_rod),
            (pose.strut_arm_m, pose.strut_direction),
        ];
        let columns = columns.map(|(at, force)| stack(force, (at - contact).cross(&force)));
        Self::of_columns(&columns, &known, frame, (lower.normal, lower_weight))
    }

    /// The map of a wheel whose linkage is not known: the members are forces along x and across the path and
    /// moments about the wheel centre, in the place of what the linkage has. By virtual work, those do no work
    /// as the strut moves.
    pub(super) fn of_straight(
        WheelPath {
            travel: path, turn, ..
        }: WheelPath,
        pose: &CornerPose,
        frame: &TyreFrame,
        unsprung: &Unsprung,
        motion: &CornerMotion,
    ) -> Result<Self, SuspensionError> {
        let to_centre = pose.wheel_centre_m - frame.contact_m;
        let force = |force: Vector3<f64>| stack(force, to_centre.cross(&force));
        let along = path / path.norm_squared();
        let moment =
            |unit: Vector3<f64>| stack(Vector3::zeros(), unit) - force(along * turn.dot(&unit));
        let columns = [
            force(Vector3::x() - along * path.x),
            force(path.cross(&Vector3::x()).normalize()),
            moment(Vector3::x()),
            moment(Vector3::y()),
            moment(Vector3::z()),
            force(along),
        ];
        let known = straight_inertia(pose, frame.contact_m, unsprung, motion);
        Self::of_columns(&columns, &known, frame, (Vector3::z(), 0.0))
    }
}

/// What the members need not carry where all outboard mass is at the wheel centre.
pub(super) fn straight_inertia(
    pose: &CornerPose,
    contact: Vector3<f64>,
    unsprung: &Unsprung,
    motion: &CornerMotion,
) -> Vector6<f64> {
    let arms = motion.lower_arm_specific_force_m_s2 * -unsprung.lower_arm_mass_kg
        + motion.upper_arm_specific_force_m_s2 * -unsprung.upper_arm_mass_kg;
    corner_inertia(pose, contact, unsprung, motion)
        + stack(arms, (pose.wheel_centre_m - contact).cross(&arms))
}
