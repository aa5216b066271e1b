//! Hard-points of corners on five links and on trailing arms, and of solid axles on leaf springs.

use serde::{Deserialize, Serialize};

use super::LiveAxle;

/// Hard-points of a left-hand corner whose upright is held by five links and a strut, axle frame, design position, m.
/// Each link has a ball joint at both ends. Five links, four links with a track rod and a double wishbone whose arms
/// are two links each have this form. `[unsprung]` has the mass of both upper links as `upper_arm_mass_kg` and that of
/// both lower links as `lower_arm_mass_kg`, with the centre of gravity of each link in its middle; half of the tie rod
/// belongs to `upright_mass_kg`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FiveLink {
    /// Wheel centre.
    pub wheel_centre_m: [f64; 3],
    /// Upper front link, end at the body.
    pub upper_front_inner_m: [f64; 3],
    /// Upper front link, end at the upright.
    pub upper_front_outer_m: [f64; 3],
    /// Upper rear link, end at the body.
    pub upper_rear_inner_m: [f64; 3],
    /// Upper rear link, end at the upright.
    pub upper_rear_outer_m: [f64; 3],
    /// Lower front link, end at the body.
    pub lower_front_inner_m: [f64; 3],
    /// Lower front link, end at the upright.
    pub lower_front_outer_m: [f64; 3],
    /// Lower rear link, end at the body.
    pub lower_rear_inner_m: [f64; 3],
    /// Lower rear link, end at the upright.
    pub lower_rear_outer_m: [f64; 3],
    /// Tie rod (rear axle: toe link), end at the rack or chassis.
    pub tie_rod_inner_m: [f64; 3],
    /// Tie rod, end at the upright.
    pub tie_rod_outer_m: [f64; 3],
    /// Strut, end at the chassis.
    pub strut_chassis_m: [f64; 3],
    /// Strut, lower end: a point of the upright, or of the line between the joints of the link in `strut_on`.
    pub strut_mount_m: [f64; 3],
    /// What carries the lower end of the strut. A link that carries it is bent; its channel is the axial force between
    /// the strut and the upright.
    #[serde(default, skip_serializing_if = "StrutOn::is_upright")]
    pub strut_on: StrutOn,
}

/// What carries the lower end of a strut.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StrutOn {
    /// The upright.
    #[default]
    Upright,
    /// The upper front link.
    UpperFront,
    /// The upper rear link.
    UpperRear,
    /// The lower front link.
    LowerFront,
    /// The lower rear link.
    LowerRear,
}

impl StrutOn {
    /// Names in the vehicle file.
    pub(super) const NAMES: &'static [&'static str] = &[
        "upright",
        "upper_front",
        "upper_rear",
        "lower_front",
        "lower_rear",
    ];

    fn is_upright(&self) -> bool {
        *self == Self::Upright
    }

    /// Index of the link in the order of [`FiveLink::links_m`].
    #[must_use]
    pub fn link(self) -> Option<usize> {
        (self as usize).checked_sub(1)
    }
}

impl FiveLink {
    /// Ends of the links at body and upright: upper front and rear, lower front and rear, tie rod.
    #[must_use]
    pub fn links_m(&self) -> [[[f64; 3]; 2]; 5] {
        [
            [self.upper_front_inner_m, self.upper_front_outer_m],
            [self.upper_rear_inner_m, self.upper_rear_outer_m],
            [self.lower_front_inner_m, self.lower_front_outer_m],
            [self.lower_rear_inner_m, self.lower_rear_outer_m],
            [self.tie_rod_inner_m, self.tie_rod_outer_m],
        ]
    }

    /// All points.
    pub(crate) fn points_mut(&mut self) -> Vec<&mut [f64; 3]> {
        vec![
            &mut self.wheel_centre_m,
            &mut self.upper_front_inner_m,
            &mut self.upper_front_outer_m,
            &mut self.upper_rear_inner_m,
            &mut self.upper_rear_outer_m,
            &mut self.lower_front_inner_m,
            &mut self.lower_front_outer_m,
            &mut self.lower_rear_inner_m,
            &mut self.lower_rear_outer_m,
            &mut self.tie_rod_inner_m,
            &mut self.tie_rod_outer_m,
            &mut self.strut_chassis_m,
            &mut self.strut_mount_m,
        ]
    }
}

/// Hard-points of a left-hand trailing or semi-trailing arm, axle frame, design position, m: of the rear axle only. The
/// arm carries the wheel and turns about the line through its two bushings: across the vehicle for a trailing arm,
/// oblique for a semi-trailing arm. `[rear.unsprung]` has the arm as `lower_arm_mass_kg`, and no upper arm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrailingArm {
    /// Wheel centre.
    pub wheel_centre_m: [f64; 3],
    /// Outer bushing.
    pub outer_bushing_m: [f64; 3],
    /// Inner bushing.
    pub inner_bushing_m: [f64; 3],
    /// Strut, end at the chassis.
    pub strut_chassis_m: [f64; 3],
    /// Strut, end at the arm.
    pub strut_arm_m: [f64; 3],
}

impl TrailingArm {
    /// All points.
    pub(crate) fn points_mut(&mut self) -> Vec<&mut [f64; 3]> {
        vec![
            &mut self.wheel_centre_m,
            &mut self.outer_bushing_m,
            &mut self.inner_bushing_m,
            &mut self.strut_chassis_m,
            &mut self.strut_arm_m,
        ]
    }
}

/// A solid axle on leaf springs that lie along the vehicle, axle frame, design position. Points of the left side, which the
/// right side mirrors. Each spring guides its seat like a link and carries it: the seat moves on an arc about a point
/// between it and the fixed eye, keeps its inclination, and does not move sideways. `[rear.unsprung]` and `[rear.strut]`
/// are as for `[rear.live_axle]`, with the distance from `spring_body_m` to the seat as the length of the spring.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeafAxle {
    /// Wheel centre, m.
    pub wheel_centre_m: [f64; 3],
    /// Middle of the main leaf at the axle's seat, m.
    pub seat_m: [f64; 3],
    /// Fixed eye of the main leaf at the body; the shackle is at the other end, m.
    pub eye_body_m: [f64; 3],
    /// Radius of the seat's arc over the distance from seat to eye. Without it: 0.75.
    #[serde(
        default = "LeafAxle::usual_radius",
        skip_serializing_if = "LeafAxle::is_usual_radius"
    )]
    pub radius_part: f64,
    /// Point of the body above the seat to which the spring's length is measured, such as the bump stop, m.
    pub spring_body_m: [f64; 3],
    /// Damper, end at the body, m.
    pub damper_body_m: [f64; 3],
    /// Damper, end at the axle, m.
    pub damper_axle_m: [f64; 3],
    /// Centre of gravity of the axle without its wheels, m.
    pub cg_m: [f64; 3],
    /// Moments of inertia of the axle without its wheels about its own centre of gravity (roll, pitch, yaw), kg m^2.
    pub inertia_kg_m2: [f64; 3],
    /// Torque of both half-shafts over that of the propeller shaft, whose torque the axle reacts; without it, the axle
    /// has no propeller shaft.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub final_drive_ratio: Option<f64>,
    /// Distance from the middle plane of the sections of the axle tubes that have bending gauges, outboard of springs
    /// and dampers, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub section_y_m: Option<f64>,
    /// Mass of the axle outboard of a section, without the wheel, kg; 0 if it is not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end_mass_kg: Option<f64>,
    /// Centre of gravity of this part, m; halfway between section and wheel centre if it is not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end_cg_m: Option<[f64; 3]>,
}

impl LeafAxle {
    /// Height of the upper links over the lower ones, m: the force of both together does not depend on it.
    const LINKS_APART_M: f64 = 0.2;
    /// Length of the line that holds the axle sideways, m. A seat that moves by 0.1 m goes 0.5 mm sideways on it.
    const SIDE_LINE_M: f64 = 10.0;

    /// Radius of the seat's arc over the distance from seat to eye. Without it: 0.75. three quarters for a main leaf with the shape of a
    /// circle (SAE HS-788, Spring Design Manual, geometry of leaf springs).
    fn usual_radius() -> f64 {
        0.75
    }

    #[allow(
        clippy::trivially_copy_pass_by_ref,
        reason = "serde passes a reference"
    )]
    fn is_usual_radius(part: &f64) -> bool {
        part.to_bits() == Self::usual_radius().to_bits()
    }

    /// The axle on links that guide it alike: parallel links from each seat and above it to the centre of its arc, and
    /// a long line across the vehicle at the height of the seats.
    #[must_use]
    pub fn on_links(&self) -> LiveAxle {
        let (seat, part) = (self.seat_m, self.radius_part);
        let centre: [f64; 3] =
            std::array::from_fn(|i| seat[i] + part * (self.eye_body_m[i] - seat[i]));
        let above = |[x, y, z]: [f64; 3]| [x, y, z + Self::LINKS_APART_M];
        let [x, _, z] = seat;
        LiveAxle {
            wheel_centre_m: self.wheel_centre_m,
            lower_link_body_m: centre,
            lower_link_axle_m: seat,
            upper_link_body_m: above(centre),
            upper_link_axle_m: above(seat),
            panhard_body_m: [x, Self::SIDE_LINE_M, z],
            panhard_axle_m: [x, 0.0, z],
            spring_body_m: self.spring_body_m,
            spring_axle_m: seat,
            damper_body_m: self.damper_body_m,
            damper_axle_m: self.damper_axle_m,
            cg_m: self.cg_m,
            inertia_kg_m2: self.inertia_kg_m2,
            link_stiffness_n_m: None,
            final_drive_ratio: self.final_drive_ratio,
            section_y_m: self.section_y_m,
            end_mass_kg: self.end_mass_kg,
            end_cg_m: self.end_cg_m,
        }
    }
}
