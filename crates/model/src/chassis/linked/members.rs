//! Forces in the linkage of a moving vehicle.

use super::{Inputs, Outputs, Parameters, State, Suspension};
use crate::Error;
use crate::suspension::linkage::Coordinates;
use crate::suspension::{
    BodyMotion, ChannelKind, CornerMotion, CornerPose, CornerStatics, MemberForces, TyreFrame,
    Wrench,
};

/// What the linkage of one corner carries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carried {
    /// Where the linkage stands.
    pub pose: CornerPose,
    /// Forces in the members; the sixth is the strut's. It is the force of spring, damper and stops,
    /// less what the anti-roll bar takes.
    pub members: MemberForces,
    /// Ball-normal force of the lower arm, N.
    pub ball_normal_n: f64,
}

/// Member forces of wheel `i`, with all unsprung masses accelerating along the wheel's path; `None`
/// on a straight path, which has no members.
///
/// # Errors
/// A strut length or rack travel that the linkage does not reach.
pub fn carried(
    parameters: &Parameters,
    state: &State,
    inputs: &Inputs,
    found: &Outputs,
    i: usize,
) -> Result<Option<Carried>, Error> {
    let (corner, wheel) = (&parameters.corners[i], &found.wheels[i]);
    let Suspension::Wishbone(linkage) = &corner.suspension else {
        return Ok(None);
    };
    let pose = linkage.pose(state.strut_m[i], state.rack[i])?;
    let body = BodyMotion {
        specific_force_m_s2: found.specific_force_m_s2,
        reference_m: parameters.sprung_cg_m,
        rate_rad_s: state.rate_rad_s,
        rate_dot_rad_s2: found.rate.rate_rad_s,
    };
    let rate = Coordinates {
        strut: state.strut_rate_m_s[i],
        rack: state.rack_rate[i],
    };
    let acceleration = Coordinates {
        strut: found.rate.strut_rate_m_s[i],
        rack: inputs.rack_acceleration[i],
    };
    let mut motion = CornerMotion::on_path(linkage, &pose, &body, rate, acceleration);
    motion.spin_rad_s = wheel.spin_rad_s;
    motion.spin_dot_rad_s2 =
        found.rate.wheel_speed_rad_s[i] - motion.upright_rate_dot_rad_s2.dot(&wheel.spindle);
    motion.axle_torque_n_m = wheel.axle_torque_n_m;
    let frame = TyreFrame::new(
        &pose,
        wheel.vehicle_from_contact.column(2).into_owned(),
        corner.tyre_file.unloaded_radius_m,
        wheel.contact.depth_m,
    );
    let unsprung = &corner.unsprung;
    let kind = ChannelKind::Strut;
    let statics = CornerStatics::new(linkage, &pose, &frame, unsprung, &motion, kind)?;
    let members = statics.members(&Wrench {
        force_n: wheel.force_n,
        moment_n_m: wheel.moment_n_m,
    });
    Ok(Some(Carried {
        pose,
        members,
        ball_normal_n: statics.ball_normal_n(&members),
    }))
}
