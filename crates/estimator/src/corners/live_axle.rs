//! A live axle at one instant: its pose from the lengths of both springs, and the maps between its members and both
//! tyres.

use model::suspension::live_axle::LINKS;
use model::suspension::{
    BodyMotion, CornerPose, LinkedAxle, LiveAxleAtRest, LiveAxleMotion, LiveAxlePose,
    LiveAxleStatics, SuspensionError, TyreFrame,
};
use model::vehicle::{Strut, Unsprung, Vehicle};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3, Vector6};
use sample::{StrainChannel, WheelAxes};

use super::CornerState;
use super::travel::StrutLine;

/// Strain channels of a wheel of a live axle: upper link, lower link, Panhard rod (of the left wheel only), and the
/// bending of the tube about the axle's x and z axes.
const UPPER: usize = 0;
const LOWER: usize = 2;
pub const PANHARD: usize = 4;
pub const BENDING: [usize; 2] = [5, 6];

/// Link of a strain channel of the left (0) or right (1) wheel.
pub fn link_of(side: usize, channel: usize) -> Option<usize> {
    match (channel, side) {
        (LOWER, _) => Some(side),
        (UPPER, _) => Some(2 + side),
        (PANHARD, 0) => Some(4),
        _ => None,
    }
}

/// What the strain channels of the left (0) or right (1) wheel measure of an axle at rest: N, N m of bending.
pub fn axle_channels(rest: &LiveAxleAtRest, side: usize) -> [f64; StrainChannel::COUNT] {
    std::array::from_fn(|channel| {
        let bending = BENDING.iter().position(|of_bending| *of_bending == channel);
        match (link_of(side, channel), bending) {
            (Some(link), _) => rest.members.links_n[link],
            (None, Some(axis)) => rest.bending_n_m[side][axis],
            (None, None) => 0.0,
        }
    })
}

/// A live axle with its springs and dampers.
#[derive(Clone, Debug)]
pub(super) struct AxleLinkage {
    axle: LinkedAxle,
    strut: Strut,
    unsprung: Unsprung,
    final_drive_ratio: Option<f64>,
    link_stiffness_n_m: f64,
    has_links: bool,
    pub(super) pose: LiveAxlePose,
}

/// A live axle at one instant, wheels left and right.
#[derive(Clone, Copy, Debug)]
pub struct LiveAxleState {
    /// Forces of links (5) and springs (2) for the wrench of each tyre, wheel-carrier frame, about the contact point.
    pub members_from_tyre: [SMatrix<f64, 7, 6>; 2],
    /// The same for the force of each damper, N.
    pub members_from_damper: [SVector<f64, 7>; 2],
    /// The same without tyres, dampers and the accelerations of the lengths, and for 1 m/s^2 of each. What the
    /// self-stress of the links by their elongation takes of the springs is in it.
    pub members_offset: [SVector<f64, 7>; 3],
    /// The same for 1 N m of the propeller shaft.
    pub members_from_shaft: SVector<f64, 7>,
    /// Forces of the links in their state of self-stress.
    pub self_stress: [f64; LINKS],
    /// Bending moments of each tube about the axle's x and z axes for the wrench of its tyre.
    pub bending_from_tyre: [SMatrix<f64, 2, 6>; 2],
    /// The same without the tyre and the accelerations, and for 1 m/s^2 of each length, N m.
    pub bending_offset: [[[f64; 2]; 3]; 2],
    /// Springs with their bump stops.
    pub springs: [StrutLine; 2],
    /// Dampers with their droop stops.
    pub dampers: [Damper; 2],
    /// Movement of each wheel centre for 1 m of each spring's length, vehicle axes.
    pub paths: [[Vector3<f64>; 2]; 2],
    /// Torque of both half-shafts over that of the propeller shaft, if there is one.
    pub final_drive_ratio: Option<f64>,
    /// Whether its links are real: those of an axle on leaf springs stand for the leaves.
    pub has_links: bool,
    /// Whether the tubes have bending gauges.
    pub has_section: bool,
}

/// Force of a damper, F - c G (l' - l'_0) - k G (l - l_0), near the lengths l_0 and rates l'_0 of both springs.
#[derive(Clone, Copy, Debug, Default)]
pub struct Damper {
    /// F, N.
    pub force_n: f64,
    /// G: change of the damper's length for 1 m of each spring's length.
    pub by_length: [f64; 2],
    /// k, of the droop stop, N/m.
    pub stiffness_n_m: f64,
    /// c, N s/m.
    pub damping_n_s_m: f64,
}

impl AxleLinkage {
    /// The rear axle of a vehicle; `None` if it is not a live axle with strut and masses.
    pub(super) fn new(vehicle: &Vehicle) -> Result<Option<Self>, SuspensionError> {
        let rear = &vehicle.rear;
        let (Some(live), Some(strut), Some(unsprung)) =
            (rear.solid_axle(), &rear.strut, &rear.unsprung)
        else {
            return Ok(None);
        };
        let axle = LinkedAxle::of(vehicle)?;
        Ok(Some(Self {
            pose: axle.pose(axle.design_lengths_m())?,
            axle,
            strut: strut.clone(),
            unsprung: unsprung.clone(),
            final_drive_ratio: live.final_drive_ratio,
            link_stiffness_n_m: live.link_stiffness_n_m.unwrap_or(0.0),
            has_links: rear.leaf_axle.is_none(),
        }))
    }

    /// The same axle under a vehicle whose mass properties have changed.
    pub(super) fn load(&mut self, vehicle: &Vehicle) -> Result<(), SuspensionError> {
        self.axle = LinkedAxle::of(vehicle)?;
        Ok(())
    }

    /// Moves the axle to these lengths of its springs. Lengths out of reach leave it where it is.
    pub(super) fn place(&mut self, lengths_m: [f64; 2]) {
        if let Ok(pose) = self.axle.pose(lengths_m) {
            self.pose = pose;
        }
    }

    /// The pose of a wheel: `side` 0 left, 1 right.
    pub(super) fn corner_pose(&self, side: usize, before: &CornerPose) -> CornerPose {
        let centre = self.pose.point_m(self.axle.wheel_centres_m[side]);
        CornerPose {
            strut_length_m: before.strut_length_m,
            strut_direction: -self.pose.line(&self.axle.springs[side]).0,
            wheel_centre_m: centre,
            spindle: self.pose.spindle(),
            vehicle_from_upright: self.pose.vehicle_from_axle,
            lower_ball_m: centre,
            upper_ball_m: centre,
            tie_rod_inner_m: centre,
            tie_rod_outer_m: centre,
            strut_arm_m: self.pose.point_m(self.axle.springs[side].axle_m),
            upright_cg_m: centre,
            upper_arm_cg_m: centre,
            lower_arm_cg_m: centre,
            ..*before
        }
    }

    /// The axle with the rates of its springs' lengths under a body that moves; both its corners become those of the
    /// axle.
    pub(super) fn state(
        &self,
        body: &BodyMotion,
        rates_m_s: [f64; 2],
        corners: &mut [CornerState],
    ) -> Result<LiveAxleState, SuspensionError> {
        let (axle, pose) = (&self.axle, &self.pose);
        let motion = LiveAxleMotion {
            body: *body,
            rates_m_s,
            spin_rad_s: [0, 1].map(|side| corners[side].spin_rad_s),
            spin_dot_rad_s2: [0, 1].map(|side| corners[side].spin_dot_rad_s2),
            shaft_torque_n_m: 0.0,
        };
        let axes = WheelAxes::carrier(pose.spindle().into());
        let frames = [0, 1].map(|side| TyreFrame {
            contact_m: corners[side].frame.contact_m,
            vehicle_from_tyre: Matrix3::from_fn(|row, column| axes.rows()[column][row]),
        });
        let statics = LiveAxleStatics::new(axle, pose, &frames, &self.unsprung, &motion);
        let members = statics.members_from_balance(axle)?;
        let springs = [0, 1].map(|side| self.spring(side, rates_m_s[side]));
        self.move_corners(&motion, &springs, corners);
        let backward = -pose.vehicle_from_axle.column(0);
        let shaft = Vector6::new(0.0, 0.0, 0.0, backward.x, backward.y, backward.z);
        let damper_columns = [7, 8].map(|k| statics.balance_from_members.column(k).into_owned());
        let stress = statics.self_stress(axle);
        let mut members_offset = statics.balance_offset.map(|offset| members * offset);
        // Roll binds the links; what it takes of the springs' forces resists the roll.
        let bound_n = self.link_stiffness_n_m * axle.bind_m(pose);
        for k in [LINKS, LINKS + 1] {
            members_offset[0][k] += bound_n * stress[k];
        }
        Ok(LiveAxleState {
            members_from_tyre: statics.balance_from_tyre.map(|map| members * map),
            members_from_damper: damper_columns.map(|column| members * column),
            members_offset,
            members_from_shaft: members * shaft,
            self_stress: std::array::from_fn(|i| stress[i]),
            bending_from_tyre: statics.bending_from_tyre,
            bending_offset: statics.bending_offset.map(|side| side.map(Into::into)),
            springs,
            dampers: [0, 1].map(|side| self.damper(side, rates_m_s)),
            paths: self.paths(),
            final_drive_ratio: self.final_drive_ratio,
            has_links: self.has_links,
            has_section: axle.section.is_some(),
        })
    }

    fn paths(&self) -> [[Vector3<f64>; 2]; 2] {
        self.axle.wheel_centres_m.map(|centre| {
            let path = self.pose.path_of(centre).travel;
            [path.by_strut, path.by_rack]
        })
    }

    /// Motion of the wheels against the body, and what accelerates the axle against the body, as the balance of the
    /// whole vehicle needs it: the parts that no acceleration of a length changes are of the left corner.
    fn move_corners(
        &self,
        motion: &LiveAxleMotion,
        springs: &[StrutLine; 2],
        corners: &mut [CornerState],
    ) {
        let [left, right] = motion.rates_m_s;
        let own = LiveAxleMotion {
            spin_rad_s: [0.0; 2],
            spin_dot_rad_s2: [0.0; 2],
            ..*motion
        };
        let fixed = LiveAxleMotion {
            rates_m_s: [0.0; 2],
            ..own
        };
        let inertia = |motion| self.axle.inertia(&self.pose, &self.unsprung, motion);
        let [still, of_left, of_right] = inertia(&own);
        let [of_fixed, ..] = inertia(&fixed);
        let arm = self.pose.path.point_m - motion.body.reference_m;
        let about_cg = |wrench: Vector6<f64>| {
            let force: Vector3<f64> = wrench.fixed_rows::<3>(0).into_owned();
            let moment = arm.cross(&force);
            wrench + Vector6::new(0.0, 0.0, 0.0, moment.x, moment.y, moment.z)
        };
        let beyond = about_cg(of_fixed - still);
        let per_unit = [about_cg(-of_left), about_cg(-of_right)];
        let paths = self.paths();
        let rotation = &self.pose.path.rotation;
        for (side, corner) in corners.iter_mut().enumerate() {
            let none = Vector6::zeros();
            corner.travel.wrench = [if side == 0 { beyond } else { none }, per_unit[side]];
            corner.travel.path = paths[side][side];
            corner.travel.strut = springs[side];
            corner.travel_m_s = paths[side][0] * left + paths[side][1] * right;
            corner.turn_rad_s = rotation.by_strut * left + rotation.by_rack * right;
        }
    }

    /// Spring and bump stop along the spring.
    fn spring(&self, side: usize, rate_m_s: f64) -> StrutLine {
        let strut = &self.strut;
        let length_m = self.pose.lengths_m[side];
        let spring_m = length_m + strut.design_length_m - self.axle.design_lengths_m()[side];
        let force = strut.force(spring_m, rate_m_s);
        let is_stopped = spring_m < strut.bump_stop_length_m;
        let [stop_n, stiffness, damping] = if is_stopped {
            [
                force.stop_n,
                strut.bump_stop_stiffness(strut.bump_stop_length_m - spring_m),
                strut.stop_damping_n_s_m,
            ]
        } else {
            [0.0; 3]
        };
        StrutLine {
            force_n: force.spring_n + stop_n,
            length_m,
            rate_m_s,
            stiffness_n_m: strut.stiffness_n_m + stiffness,
            damping_n_s_m: damping,
            stopped: is_stopped,
        }
    }

    /// Damper and droop stop along the damper.
    fn damper(&self, side: usize, [left, right]: [f64; 2]) -> Damper {
        let strut = &self.strut;
        let line = &self.axle.dampers[side];
        let (towards, length_m) = self.pose.line(line);
        let path = self.pose.path_of(line.axle_m).travel;
        let by_length = [-towards.dot(&path.by_strut), -towards.dot(&path.by_rack)];
        let rate_m_s = by_length[0] * left + by_length[1] * right;
        let own_damping = strut.damping_at(rate_m_s);
        let past_m = length_m - strut.droop_stop_length_m;
        let [stop_n, stiffness, damping] = if past_m > 0.0 {
            let push_n = strut.stop_stiffness_n_m * past_m + strut.stop_damping_n_s_m * rate_m_s;
            [
                -push_n.max(0.0),
                strut.stop_stiffness_n_m,
                strut.stop_damping_n_s_m,
            ]
        } else {
            [0.0; 3]
        };
        Damper {
            force_n: stop_n - own_damping * rate_m_s,
            by_length,
            stiffness_n_m: stiffness,
            damping_n_s_m: own_damping + damping,
        }
    }
}
