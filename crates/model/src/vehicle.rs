//! The vehicle file: what a workshop can measure of a vehicle, in SI units.
//!
//! Axes are ISO 8855. Positions are given in the *axle frame* of their axle: origin on the design
//! ground plane, in the vehicle's middle plane, below the wheel centres' line; left-hand side, the
//! right-hand side being its mirror image.

mod builtin;
mod check;
mod derived;
mod linkages;
mod payload;
mod plain;
mod plausible;
mod pressure;
mod rules;
mod tyre_file;

use std::borrow::Cow;
use std::collections::BTreeMap;

use sample::Mounting;
use serde::{Deserialize, Serialize};

use crate::tolerances::VehicleTolerances;
use crate::tyre::Tir;

pub use check::Warning;
pub use linkages::{FiveLink, LeafAxle, StrutOn, TrailingArm};
pub use payload::{Loaded, MassProperties, Payload};
pub use pressure::{TyrePressure, pressure_change, pressures_of_axles};
#[cfg(test)]
pub(crate) use rules::SECTIONS;

/// All that is wrong with a vehicle file.
pub type VehicleErrors = crate::file::FileErrors;

/// A vehicle, as its file describes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Vehicle {
    /// Name, for people.
    pub name: String,
    /// What is meant by this variant and where it is from.
    pub description: String,
    /// Mass properties.
    pub body: Body,
    /// Front axle.
    pub front: Axle,
    /// Rear axle.
    pub rear: Axle,
    /// From the steering wheel to the road wheels.
    pub steering: Steering,
    /// Where torque comes from and where it is reacted.
    #[serde(default)]
    pub drivetrain: Drivetrain,
    /// Where each value is from, by its dotted name, such as `body.mass_kg`.
    #[serde(default)]
    pub sources: BTreeMap<String, String>,
    /// Masses that the vehicle carries or not; the values above are without them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub payload: Vec<Payload>,
    /// Where a load is hitched.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hitch: Option<Hitch>,
    /// How far the values above can be from the truth. With this table, the standard deviations of the forces contain
    /// it from the first second on; without it, once a drive shows that the values are not exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerances: Option<VehicleTolerances>,
}

/// Where a load is hitched to the sprung part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hitch {
    /// Place in the front axle's frame: forward and left of, and above, the point on the design ground below the
    /// middle of the front wheel centres, m.
    pub position_m: [f64; 3],
}

/// Mass properties of the whole vehicle and of its sprung part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Total mass m, kg.
    pub mass_kg: f64,
    /// Front axle to centre of gravity a, m.
    pub front_axle_to_cg_m: f64,
    /// Centre of gravity to rear axle b, m.
    pub cg_to_rear_axle_m: f64,
    /// Height h of the whole vehicle's centre of gravity above ground, m.
    pub cg_height_m: f64,
    /// Centre of gravity left of the middle plane, m.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub cg_y_m: f64,
    /// Moments of inertia of the whole vehicle about its centre of gravity (roll, pitch, yaw),
    /// kg m^2.
    pub inertia_kg_m2: [f64; 3],
    /// Product of inertia I_xz of the whole vehicle, kg m^2.
    #[serde(default)]
    pub inertia_xz_kg_m2: f64,
    /// Aerodynamic drag coefficient times area times half the air's density, N s^2/m^2.
    #[serde(default)]
    pub drag_n_s2_m2: f64,
    /// The sprung part; without it, it is taken from the total and the axles' unsprung masses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sprung: Option<Sprung>,
    /// The lumped pitch model; without it, it is derived from the axles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pitch: Option<Pitch>,
}

/// Springs and dampers of both axles, lumped at a pitch centre as in equation 2.15 of the thesis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pitch {
    /// Height h_pc of the pitch centre above ground, m.
    pub centre_height_m: f64,
    /// Pitch stiffness K_theta, N m/rad.
    pub stiffness_n_m_rad: f64,
    /// Pitch damping B_theta, N m s/rad.
    pub damping_n_m_s_rad: f64,
}

/// The sprung part of the vehicle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sprung {
    /// Sprung mass m_s, kg.
    pub mass_kg: f64,
    /// Its centre of gravity from the point on the ground below the whole vehicle's, m.
    pub cg_m: [f64; 3],
    /// Its moments of inertia about its own centre of gravity, kg m^2.
    pub inertia_kg_m2: [f64; 3],
    /// Its product of inertia I_xz, kg m^2.
    #[serde(default)]
    pub inertia_xz_kg_m2: f64,
}

/// One axle and both its wheels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axle {
    /// Track width t, m.
    pub track_m: f64,
    /// Roll-centre height h_r above ground, m (equivalent model; hard-points give their own).
    pub roll_centre_height_m: f64,
    /// Roll stiffness K_phi of springs and bars of this axle, N m/rad.
    pub roll_stiffness_n_m_rad: f64,
    /// Roll damping B_phi of this axle, N m s/rad.
    pub roll_damping_n_m_s_rad: f64,
    /// Stiffness of the anti-roll bar alone, already part of the roll stiffness, N m/rad.
    #[serde(default)]
    pub anti_roll_bar_n_m_rad: f64,
    /// Wheels, hubs and arms of one corner.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unsprung: Option<Unsprung>,
    /// Spring, damper and stops of one corner.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strut: Option<Strut>,
    /// Double-wishbone hard-points of the left corner.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wishbone: Option<Wishbone>,
    /// Hard-points of the left corner's MacPherson strut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub macpherson: Option<Macpherson>,
    /// Hard-points of the left corner on five links.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub five_link: Option<FiveLink>,
    /// Hard-points of the left corner's trailing or semi-trailing arm: of the rear axle only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trailing_arm: Option<TrailingArm>,
    /// Hard-points of a solid axle on links, which is not steered: of the rear axle only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub live_axle: Option<LiveAxle>,
    /// A solid axle on leaf springs, which is not steered: of the rear axle only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub leaf_axle: Option<LeafAxle>,
    /// Tyre of one corner.
    pub tyre: Tyre,
}

/// Unsprung masses of one corner.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unsprung {
    /// Spindle, rim and tyre: what turns with the wheel, kg.
    pub wheel_mass_kg: f64,
    /// Spin inertia of what turns, half-shaft included, kg m^2.
    pub wheel_spin_inertia_kg_m2: f64,
    /// Inertia of the wheel about its diameter, kg m^2.
    pub wheel_diametral_inertia_kg_m2: f64,
    /// Upright, kg.
    pub upright_mass_kg: f64,
    /// Upper arm, kg.
    pub upper_arm_mass_kg: f64,
    /// Lower arm, kg.
    pub lower_arm_mass_kg: f64,
    /// Centre of gravity of the upright, axle frame, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub upright_cg_m: Option<[f64; 3]>,
    /// Centre of gravity of the upper arm, axle frame, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub upper_arm_cg_m: Option<[f64; 3]>,
    /// Centre of gravity of the lower arm, axle frame, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lower_arm_cg_m: Option<[f64; 3]>,
}

impl Unsprung {
    /// Mass of the whole corner, kg.
    #[must_use]
    pub fn total_mass_kg(&self) -> f64 {
        self.wheel_mass_kg + self.upright_mass_kg + self.upper_arm_mass_kg + self.lower_arm_mass_kg
    }
}

/// Spring, damper and stops along one strut. Force pushes the strut's ends apart:
/// F = k (l_0 - l) - c l' + stops.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Strut {
    /// Spring stiffness k, N/m.
    pub stiffness_n_m: f64,
    /// Length l_0 at which the spring's force would vanish, m. A preload F_0 at length l makes
    /// l_0 = l + F_0/k.
    pub free_length_m: f64,
    /// Length in the design position, m.
    pub design_length_m: f64,
    /// Damping c, N s/m.
    pub damping_n_s_m: f64,
    /// Damping while the damper lengthens, N s/m; c is then the mean of both directions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rebound_damping_n_s_m: Option<f64>,
    /// Length at which the droop (rebound) stop touches, m.
    pub droop_stop_length_m: f64,
    /// Length at which the bump stop touches, m.
    pub bump_stop_length_m: f64,
    /// Stiffness of both stops, N/m.
    pub stop_stiffness_n_m: f64,
    /// Stiffness of the bump stop as it touches, N/m, if it is another.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bump_stop_stiffness_n_m: Option<f64>,
    /// Force of the bump stop for the square of the travel into it, N/m^2.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub bump_stop_progression_n_m2: f64,
    /// Damping of both stops, N s/m.
    #[serde(default)]
    pub stop_damping_n_s_m: f64,
    /// Spring travel for one metre of wheel travel in the design position; used where no
    /// hard-points are given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion_ratio: Option<f64>,
}

/// Hard-points of a left-hand double wishbone, axle frame, design position, m.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wishbone {
    /// Wheel centre.
    pub wheel_centre_m: [f64; 3],
    /// Upper arm, front hinge.
    pub upper_front_m: [f64; 3],
    /// Upper arm, rear hinge.
    pub upper_rear_m: [f64; 3],
    /// Upper ball joint.
    pub upper_ball_m: [f64; 3],
    /// Lower arm, front hinge.
    pub lower_front_m: [f64; 3],
    /// Lower arm, rear hinge.
    pub lower_rear_m: [f64; 3],
    /// Lower ball joint.
    pub lower_ball_m: [f64; 3],
    /// Strut, end at the chassis.
    pub strut_chassis_m: [f64; 3],
    /// Strut, end at the lower arm.
    pub strut_arm_m: [f64; 3],
    /// Tie rod (rear axle: toe link), end at the rack or chassis.
    pub tie_rod_inner_m: [f64; 3],
    /// Tie rod, end at the upright.
    pub tie_rod_outer_m: [f64; 3],
}

/// Hard-points of a left-hand MacPherson strut, axle frame, design position, m. The strut's tube is part of
/// the upright. Its rod is held by a ball joint at the body, along which the upright slides and about which it
/// turns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Macpherson {
    /// Wheel centre.
    pub wheel_centre_m: [f64; 3],
    /// Lower arm, front hinge.
    pub lower_front_m: [f64; 3],
    /// Lower arm, rear hinge.
    pub lower_rear_m: [f64; 3],
    /// Lower ball joint.
    pub lower_ball_m: [f64; 3],
    /// Strut, ball joint at the body.
    pub strut_top_m: [f64; 3],
    /// Strut, lower end of spring and damper on the upright: a point of the strut's axis.
    pub strut_low_m: [f64; 3],
    /// Part of the force along the lower arm's hinge that the front bushing takes, by the stiffness of both bushings
    /// along it. Then the channels of the legs are axial forces near the bushings of an arm that is one piece. Without
    /// it, each leg is taken for a rod between two joints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hinge_front_share: Option<f64>,
    /// Tie rod (rear axle: toe link), end at the rack or chassis.
    pub tie_rod_inner_m: [f64; 3],
    /// Tie rod, end at the upright.
    pub tie_rod_outer_m: [f64; 3],
}

/// A solid axle on two lower links, two upper links and a Panhard rod, axle frame, design position. Points of the left
/// side, which the right side mirrors; those of the Panhard rod as they are. `[rear.unsprung]` has the half of the
/// axle without wheels as `upright_mass_kg`, and no arms. `[rear.strut]` has the spring and its bump stop by their
/// lengths, and the damper and the droop stop along the damper: `droop_stop_length_m` is a length of the damper.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LiveAxle {
    /// Wheel centre, m.
    pub wheel_centre_m: [f64; 3],
    /// Lower link, end at the body, m.
    pub lower_link_body_m: [f64; 3],
    /// Lower link, end at the axle, m.
    pub lower_link_axle_m: [f64; 3],
    /// Upper link, end at the body, m.
    pub upper_link_body_m: [f64; 3],
    /// Upper link, end at the axle, m.
    pub upper_link_axle_m: [f64; 3],
    /// Panhard rod, end at the body, m.
    pub panhard_body_m: [f64; 3],
    /// Panhard rod, end at the axle, m.
    pub panhard_axle_m: [f64; 3],
    /// Spring, end at the body, m.
    pub spring_body_m: [f64; 3],
    /// Spring, end at the axle, m.
    pub spring_axle_m: [f64; 3],
    /// Damper, end at the body, m.
    pub damper_body_m: [f64; 3],
    /// Damper, end at the axle, m.
    pub damper_axle_m: [f64; 3],
    /// Centre of gravity of the axle without its wheels, m.
    pub cg_m: [f64; 3],
    /// Moments of inertia of the axle without its wheels about its own centre of gravity (roll, pitch, yaw), kg m^2.
    pub inertia_kg_m2: [f64; 3],
    /// Stiffness of a link along its length, bushings in series, N/m: the mean of all. With it, the links' resistance to
    /// roll (roll bind) is known; without it, they have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub link_stiffness_n_m: Option<f64>,
    /// Torque of both half-shafts over that of the propeller shaft, whose torque the axle reacts; without it, the axle
    /// has no propeller shaft.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub final_drive_ratio: Option<f64>,
    /// Distance from the middle plane of the sections of the axle tubes that have bending gauges, outboard of links,
    /// springs and dampers, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub section_y_m: Option<f64>,
    /// Mass of the axle outboard of a section, without the wheel, kg; 0 if it is not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end_mass_kg: Option<f64>,
    /// Centre of gravity of this part, m; halfway between section and wheel centre if it is not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end_cg_m: Option<[f64; 3]>,
}

impl Axle {
    /// Name of the table with the linkage of a corner, if the file has one.
    #[must_use]
    pub fn linkage_table(&self) -> Option<&'static str> {
        self.linkage_tables().next()
    }

    /// Names of all tables with a linkage of a corner; a file that is right has one at most.
    pub(crate) fn linkage_tables(&self) -> impl Iterator<Item = &'static str> {
        [
            ("wishbone", self.wishbone.is_some()),
            ("macpherson", self.macpherson.is_some()),
            ("five_link", self.five_link.is_some()),
            ("trailing_arm", self.trailing_arm.is_some()),
        ]
        .into_iter()
        .filter_map(|(name, is_given)| is_given.then_some(name))
    }

    /// What carries its wheels, where strain channels have other names.
    #[must_use]
    pub fn mounting(&self) -> Option<Mounting> {
        [
            (Mounting::Strut, self.macpherson.is_some()),
            (Mounting::TrailingArm, self.trailing_arm.is_some()),
            (Mounting::SolidAxle, self.is_solid()),
        ]
        .into_iter()
        .find_map(|(mounting, is_given)| is_given.then_some(mounting))
    }

    /// The solid axle on its links, or on links that guide it as its leaf springs do.
    #[must_use]
    pub fn solid_axle(&self) -> Option<Cow<'_, LiveAxle>> {
        let on_leaves = || Some(Cow::Owned(self.leaf_axle.as_ref()?.on_links()));
        self.live_axle
            .as_ref()
            .map(Cow::Borrowed)
            .or_else(on_leaves)
    }

    /// Whether both wheels are on a solid axle.
    #[must_use]
    pub fn is_solid(&self) -> bool {
        self.live_axle.is_some() || self.leaf_axle.is_some()
    }

    /// Whether the file tells the linkages of both corners, each by itself, by hard-points.
    #[must_use]
    pub fn has_hard_points(&self) -> bool {
        self.linkage_table().is_some()
    }
}

/// Tyre of one corner. With a tyre property file, fields that are left out come from that file: radius,
/// width, vertical stiffness and damping, and at FNOMIN the other values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tyre {
    /// Tyre property file of the Magic Formula 5.2 or 6.1, relative to the vehicle file. A log contains its
    /// coefficients as a table in place of the name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tir: Option<Tir>,
    /// Unloaded radius R_0, m.
    #[serde(default = "unset")]
    pub unloaded_radius_m: f64,
    /// Vertical stiffness, N/m.
    #[serde(default = "unset")]
    pub vertical_stiffness_n_m: f64,
    /// Vertical damping, N s/m.
    #[serde(default = "unset")]
    pub vertical_damping_n_s_m: f64,
    /// Width of the tread on the ground, m; 0 if it is unknown.
    #[serde(default = "unset")]
    pub width_m: f64,
    /// Cornering stiffness of one tyre at `reference_load_n`, N/rad. Beside `tir` it scales the formula.
    #[serde(default = "unset")]
    pub cornering_stiffness_n_rad: f64,
    /// Longitudinal slip stiffness of one tyre at `reference_load_n`, N per unit slip. Beside `tir` it
    /// scales the formula.
    #[serde(default = "unset")]
    pub slip_stiffness_n: f64,
    /// Load for which the stiffnesses hold, N. Beside `tir` it must be FNOMIN.
    #[serde(default = "unset")]
    pub reference_load_n: f64,
    /// Exponent n of C = C_0 (F_z/F_z0)^n. Beside `tir` it has no influence on the formula.
    #[serde(default = "unset_one")]
    pub load_exponent: f64,
    /// Friction coefficient mu. Beside `tir` it scales the formula, whose mu is the lateral one at FNOMIN.
    #[serde(default = "unset")]
    pub friction: f64,
    /// Relaxation length sigma, m.
    #[serde(default = "unset")]
    pub relaxation_length_m: f64,
    /// Rolling resistance coefficient. Beside `tir` it scales QSY1 to QSY6.
    #[serde(default = "unset")]
    pub rolling_resistance: f64,
    /// Camber stiffness, N/rad. Beside `tir` it has no influence on the formula.
    #[serde(default = "unset")]
    pub camber_stiffness_n_rad: f64,
    /// Change with the inflation pressure. Beside `tir` of the Magic Formula 6.1 it is refused: that file has its own
    /// terms of the pressure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pressure: Option<TyrePressure>,
}

/// Steering gear.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Steering {
    /// Steering-wheel angle over mean road-wheel angle; used where no map or rack is given.
    pub ratio: f64,
    /// Rack travel per steering-wheel angle, m/rad; with hard-points it gives exact wheel angles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rack_m_rad: Option<f64>,
    /// Part of the way from parallel steering (0) to Ackermann's (1); used where no map or rack is
    /// given.
    #[serde(default)]
    pub ackermann: f64,
    /// Free play at the steering wheel, rad, from one contact to the other.
    #[serde(default)]
    pub lash_rad: f64,
    /// Calibrated map, left front wheel: pairs of steering-wheel and road-wheel angle, rad, ascending.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_map_rad: Vec<[f64; 2]>,
    /// Calibrated map, right front wheel.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub right_map_rad: Vec<[f64; 2]>,
    /// Road-wheel steer per roll angle (front, rear).
    #[serde(default)]
    pub roll_steer: [f64; 2],
    /// Toe compliance of the left and the right front wheel: angle by which the wheel yields to one
    /// newton of its lateral force, rad/N. Positive: a force to the left turns the wheel to the right.
    #[serde(default)]
    pub toe_compliance_rad_n: [f64; 2],
    /// Play of the left and the right front wheel behind the rack, rad, from one contact to the other.
    #[serde(default)]
    pub toe_play_rad: [f64; 2],
}

/// Drive and brake torque.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drivetrain {
    /// Part of the drive torque that goes to the front axle.
    pub drive_split_front: f64,
    /// Part of the brake torque that goes to the front axle.
    pub brake_split_front: f64,
    /// Whether drive torque is reacted by the chassis (half-shafts) rather than the upright.
    pub drive_reacted_by_chassis: bool,
    /// Whether the front brake is reacted by the upright (outboard) rather than the chassis.
    pub front_brake_outboard: bool,
    /// Whether the rear brake is reacted by the upright (outboard) rather than the chassis.
    pub rear_brake_outboard: bool,
}

impl Default for Drivetrain {
    fn default() -> Self {
        Self {
            drive_split_front: 0.0,
            brake_split_front: 0.6,
            drive_reacted_by_chassis: true,
            front_brake_outboard: true,
            rear_brake_outboard: false,
        }
    }
}

/// A field that the file leaves out; reading the file replaces it.
fn unset() -> f64 {
    f64::NAN
}

/// As [`unset`]; without a property file it becomes 1.
fn unset_one() -> f64 {
    f64::NAN
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}
