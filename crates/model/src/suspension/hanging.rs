//! A corner whose wheel hangs free: the state of the jackstand zero.

use nalgebra::Vector3;

use super::{
    ChannelKind, Corner, CornerMotion, CornerPose, CornerStatics, MemberForces, SuspensionError,
    TyreFrame, Wrench, finite,
};
use crate::vehicle::Axle;

/// How far the droop stop may give way, m.
const LONGEST_STOP_TRAVEL_M: f64 = 0.03;
/// Halvings of the interval of strut lengths: below a nanometre.
const HALVINGS: usize = 40;

/// Rest position and loads of a corner without ground contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hanging {
    /// Where the linkage comes to rest.
    pub pose: CornerPose,
    /// Forces in the members; the sixth is the strut's.
    pub members: MemberForces,
    /// Ball-normal force of the lower arm, N.
    pub ball_normal_n: f64,
}

impl Corner {
    /// The rest position with the vehicle on stands and the wheel in the air.
    ///
    /// The legs are not free of load then (the thesis's section 3.5 takes them to be): they carry
    /// wheel, upright and arms against coil and droop stop. A zero taken on stands must subtract
    /// these forces. `specific_force_m_s2` is (0, 0, g) in vehicle axes on level stands.
    ///
    /// # Errors
    /// When the axle has no strut or unsprung masses, or the wheel finds no rest between the
    /// stops.
    pub fn hanging(
        &self,
        axle: &Axle,
        rack_m: f64,
        specific_force_m_s2: Vector3<f64>,
    ) -> Result<Hanging, SuspensionError> {
        let name = if self.wheel.is_front() {
            "front"
        } else {
            "rear"
        };
        let missing = |table| SuspensionError::Missing { axle: name, table };
        let strut = axle.strut.as_ref().ok_or(missing("strut"))?;
        let unsprung = axle.unsprung.as_ref().ok_or(missing("unsprung"))?;
        for value in specific_force_m_s2.iter() {
            finite("specific force", *value, "m/s^2")?;
        }
        let motion = CornerMotion::at_rest(specific_force_m_s2);
        let at = |length_m: f64| -> Result<(Hanging, f64), SuspensionError> {
            let pose = self.pose(length_m, rack_m)?;
            // Without a wrench the contact point is of no account.
            let frame = TyreFrame::new(&pose, Vector3::z(), axle.tyre.unloaded_radius_m, 0.0);
            let statics =
                CornerStatics::new(self, &pose, &frame, unsprung, &motion, ChannelKind::Strut)?;
            let members = statics.members(&Wrench::default());
            let hanging = Hanging {
                pose,
                members,
                ball_normal_n: statics.ball_normal_n(&members),
            };
            let surplus = strut.force(length_m, 0.0).total_n() - members.sixth_n;
            Ok((hanging, surplus))
        };
        let mut short = strut.bump_stop_length_m;
        let mut long = strut.droop_stop_length_m + LONGEST_STOP_TRAVEL_M;
        // A surplus pushes the arm down and lengthens the strut.
        let (at_short, at_long) = (at(short)?.1, at(long)?.1);
        if !(at_short > 0.0 && at_long < 0.0) {
            return Err(SuspensionError::OutOfReach {
                what: "strut force at rest",
                value: at_short,
                unit: "N",
            });
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (short + long);
            if at(middle)?.1 > 0.0 {
                short = middle;
            } else {
                long = middle;
            }
        }
        Ok(at(0.5 * (short + long))?.0)
    }
}
