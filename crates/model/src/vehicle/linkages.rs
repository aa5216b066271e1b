//! Hard-points of corners on five links and on trailing arms.

use serde::{Deserialize, Serialize};

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
