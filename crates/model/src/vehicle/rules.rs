//! What each field of a vehicle file may hold.

use super::StrutOn;
use crate::file::rules::Kind::{
    Choice, Flag, Number, Pairs, Table, Tables, Text, Texts, TyreFile, Vector,
};
use crate::file::rules::Range::{Finite, NonNegative, Positive, Within};
use crate::file::rules::{Kind, Rule, TableRules, may, must, must_unless};
use crate::tolerances::OF_VEHICLE;

/// Lengths beyond this are taken for millimetres.
pub(super) const LENGTH: f64 = 30.0;
pub(super) const MASS: f64 = 1e5;
const STIFFNESS: f64 = 1e8;
const POINT: Kind = Vector(3, Within(-LENGTH, LENGTH));

/// All tables of a vehicle file.
pub(crate) const SECTIONS: &[TableRules] = &[
    TableRules {
        tables: &[""],
        rules: TOP,
    },
    TableRules {
        tables: &["body"],
        rules: BODY,
    },
    TableRules {
        tables: &["body.sprung"],
        rules: SPRUNG,
    },
    TableRules {
        tables: &["body.pitch"],
        rules: PITCH,
    },
    TableRules {
        tables: &["front", "rear"],
        rules: AXLE,
    },
    TableRules {
        tables: &["front.unsprung", "rear.unsprung"],
        rules: UNSPRUNG,
    },
    TableRules {
        tables: &["front.strut", "rear.strut"],
        rules: STRUT,
    },
    TableRules {
        tables: &["front.wishbone", "rear.wishbone"],
        rules: WISHBONE,
    },
    TableRules {
        tables: &["front.macpherson", "rear.macpherson"],
        rules: MACPHERSON,
    },
    TableRules {
        tables: &["front.five_link", "rear.five_link"],
        rules: FIVE_LINK,
    },
    TableRules {
        tables: &["front.trailing_arm", "rear.trailing_arm"],
        rules: TRAILING_ARM,
    },
    TableRules {
        tables: &["front.live_axle", "rear.live_axle"],
        rules: LIVE_AXLE,
    },
    TableRules {
        tables: &["front.leaf_axle", "rear.leaf_axle"],
        rules: LEAF_AXLE,
    },
    TableRules {
        tables: &["front.tyre", "rear.tyre"],
        rules: TYRE,
    },
    TableRules {
        tables: &["front.tyre.pressure", "rear.tyre.pressure"],
        rules: TYRE_PRESSURE,
    },
    TableRules {
        tables: &["steering"],
        rules: STEERING,
    },
    TableRules {
        tables: &["drivetrain"],
        rules: DRIVETRAIN,
    },
    TableRules {
        tables: &["payload"],
        rules: PAYLOAD,
    },
    TableRules {
        tables: &["hitch"],
        rules: HITCH,
    },
    TableRules {
        tables: &["tolerances"],
        rules: OF_VEHICLE,
    },
];

const TOP: &[Rule] = &[
    must("name", Text),
    must("description", Text),
    must("body", Table),
    must("front", Table),
    must("rear", Table),
    must("steering", Table),
    may("drivetrain", Table),
    may("sources", Texts),
    may("payload", Tables),
    may("hitch", Table),
    may("tolerances", Table),
];

const HITCH: &[Rule] = &[must("position_m", POINT)];

const PAYLOAD: &[Rule] = &[
    must("name", Text),
    must("mass_kg", Number(Positive(MASS))),
    must("position_m", POINT),
    may("inertia_kg_m2", Vector(3, NonNegative(1e7))),
];

const BODY: &[Rule] = &[
    must("mass_kg", Number(Positive(MASS))),
    must("front_axle_to_cg_m", Number(Positive(LENGTH))),
    must("cg_to_rear_axle_m", Number(Positive(LENGTH))),
    must("cg_height_m", Number(Positive(LENGTH))),
    may("cg_y_m", Number(Within(-LENGTH, LENGTH))),
    must("inertia_kg_m2", Vector(3, Positive(1e7))),
    may("inertia_xz_kg_m2", Number(Within(-1e7, 1e7))),
    may("drag_n_s2_m2", Number(NonNegative(100.0))),
    may("sprung", Table),
    may("pitch", Table),
];

const SPRUNG: &[Rule] = &[
    must("mass_kg", Number(Positive(MASS))),
    must("cg_m", POINT),
    must("inertia_kg_m2", Vector(3, Positive(1e7))),
    may("inertia_xz_kg_m2", Number(Within(-1e7, 1e7))),
];

const PITCH: &[Rule] = &[
    must("centre_height_m", Number(Within(-LENGTH, LENGTH))),
    must("stiffness_n_m_rad", Number(Positive(STIFFNESS))),
    must("damping_n_m_s_rad", Number(NonNegative(STIFFNESS))),
];

const AXLE: &[Rule] = &[
    must("track_m", Number(Positive(LENGTH))),
    must("roll_centre_height_m", Number(Within(-LENGTH, LENGTH))),
    must("roll_stiffness_n_m_rad", Number(Positive(STIFFNESS))),
    must("roll_damping_n_m_s_rad", Number(NonNegative(STIFFNESS))),
    may("anti_roll_bar_n_m_rad", Number(NonNegative(STIFFNESS))),
    may("unsprung", Table),
    may("strut", Table),
    may("wishbone", Table),
    may("macpherson", Table),
    may("five_link", Table),
    may("trailing_arm", Table),
    may("live_axle", Table),
    may("leaf_axle", Table),
    must("tyre", Table),
];

const UNSPRUNG: &[Rule] = &[
    must("wheel_mass_kg", Number(Positive(MASS))),
    must("wheel_spin_inertia_kg_m2", Number(Positive(1e5))),
    must("wheel_diametral_inertia_kg_m2", Number(Positive(1e5))),
    must("upright_mass_kg", Number(NonNegative(MASS))),
    must("upper_arm_mass_kg", Number(NonNegative(MASS))),
    must("lower_arm_mass_kg", Number(NonNegative(MASS))),
    may("upright_cg_m", POINT),
    may("upper_arm_cg_m", POINT),
    may("lower_arm_cg_m", POINT),
];

const STRUT: &[Rule] = &[
    must("stiffness_n_m", Number(Positive(STIFFNESS))),
    must("free_length_m", Number(Positive(LENGTH))),
    must("design_length_m", Number(Positive(LENGTH))),
    must("damping_n_s_m", Number(NonNegative(STIFFNESS))),
    may("rebound_damping_n_s_m", Number(NonNegative(STIFFNESS))),
    must("droop_stop_length_m", Number(Positive(LENGTH))),
    must("bump_stop_length_m", Number(Positive(LENGTH))),
    must("stop_stiffness_n_m", Number(Positive(1e10))),
    may("bump_stop_stiffness_n_m", Number(Positive(1e10))),
    may("bump_stop_progression_n_m2", Number(NonNegative(1e12))),
    may("stop_damping_n_s_m", Number(NonNegative(STIFFNESS))),
    may("motion_ratio", Number(Within(0.05, 2.0))),
];

const WISHBONE: &[Rule] = &[
    must("wheel_centre_m", POINT),
    must("upper_front_m", POINT),
    must("upper_rear_m", POINT),
    must("upper_ball_m", POINT),
    must("lower_front_m", POINT),
    must("lower_rear_m", POINT),
    must("lower_ball_m", POINT),
    must("strut_chassis_m", POINT),
    must("strut_arm_m", POINT),
    must("tie_rod_inner_m", POINT),
    must("tie_rod_outer_m", POINT),
];

const MACPHERSON: &[Rule] = &[
    must("wheel_centre_m", POINT),
    must("lower_front_m", POINT),
    must("lower_rear_m", POINT),
    must("lower_ball_m", POINT),
    must("strut_top_m", POINT),
    must("strut_low_m", POINT),
    may("hinge_front_share", Number(Within(0.0, 1.0))),
    must("tie_rod_inner_m", POINT),
    must("tie_rod_outer_m", POINT),
];

const FIVE_LINK: &[Rule] = &[
    must("wheel_centre_m", POINT),
    must("upper_front_inner_m", POINT),
    must("upper_front_outer_m", POINT),
    must("upper_rear_inner_m", POINT),
    must("upper_rear_outer_m", POINT),
    must("lower_front_inner_m", POINT),
    must("lower_front_outer_m", POINT),
    must("lower_rear_inner_m", POINT),
    must("lower_rear_outer_m", POINT),
    must("tie_rod_inner_m", POINT),
    must("tie_rod_outer_m", POINT),
    must("strut_chassis_m", POINT),
    must("strut_mount_m", POINT),
    may("strut_on", Choice(StrutOn::NAMES)),
];

const TRAILING_ARM: &[Rule] = &[
    must("wheel_centre_m", POINT),
    must("outer_bushing_m", POINT),
    must("inner_bushing_m", POINT),
    must("strut_chassis_m", POINT),
    must("strut_arm_m", POINT),
];

const LIVE_AXLE: &[Rule] = &[
    must("wheel_centre_m", POINT),
    must("lower_link_body_m", POINT),
    must("lower_link_axle_m", POINT),
    must("upper_link_body_m", POINT),
    must("upper_link_axle_m", POINT),
    must("panhard_body_m", POINT),
    must("panhard_axle_m", POINT),
    must("spring_body_m", POINT),
    must("spring_axle_m", POINT),
    must("damper_body_m", POINT),
    must("damper_axle_m", POINT),
    must("cg_m", POINT),
    must("inertia_kg_m2", Vector(3, Positive(1e6))),
    may("link_stiffness_n_m", Number(Positive(1e10))),
    may("final_drive_ratio", Number(Within(1.0, 20.0))),
    may("section_y_m", Number(Positive(LENGTH))),
    may("end_mass_kg", Number(NonNegative(MASS))),
    may("end_cg_m", POINT),
];

const LEAF_AXLE: &[Rule] = &[
    must("wheel_centre_m", POINT),
    must("seat_m", POINT),
    must("eye_body_m", POINT),
    may("radius_part", Number(Within(0.5, 1.0))),
    must("spring_body_m", POINT),
    must("damper_body_m", POINT),
    must("damper_axle_m", POINT),
    must("cg_m", POINT),
    must("inertia_kg_m2", Vector(3, Positive(1e6))),
    may("final_drive_ratio", Number(Within(1.0, 20.0))),
    may("section_y_m", Number(Positive(LENGTH))),
    may("end_mass_kg", Number(NonNegative(MASS))),
    may("end_cg_m", POINT),
];

const TYRE: &[Rule] = &[
    may("tir", TyreFile),
    must_unless("unloaded_radius_m", Number(Positive(3.0)), "tir"),
    must_unless("vertical_stiffness_n_m", Number(Positive(STIFFNESS)), "tir"),
    may("vertical_damping_n_s_m", Number(NonNegative(1e6))),
    may("width_m", Number(NonNegative(3.0))),
    must_unless("cornering_stiffness_n_rad", Number(Positive(1e7)), "tir"),
    must_unless("slip_stiffness_n", Number(Positive(1e7)), "tir"),
    must_unless("reference_load_n", Number(Positive(1e6)), "tir"),
    may("load_exponent", Number(Within(0.0, 2.0))),
    must_unless("friction", Number(Positive(3.0)), "tir"),
    may("relaxation_length_m", Number(NonNegative(5.0))),
    may("rolling_resistance", Number(Within(0.0, 0.5))),
    may("camber_stiffness_n_rad", Number(NonNegative(1e6))),
    may("pressure", Table),
];

/// Changes that keep each value above zero from half of the nominal pressure to twice that pressure.
const CHANGE: Kind = Number(Within(-0.9, 1.9));

const TYRE_PRESSURE: &[Rule] = &[
    must("nominal_pa", Number(Within(1e3, 2e6))),
    may("vertical_stiffness_change", CHANGE),
    may("cornering_stiffness_change", CHANGE),
    may("slip_stiffness_change", CHANGE),
    may("friction_change", CHANGE),
];

const STEERING: &[Rule] = &[
    must("ratio", Number(Positive(100.0))),
    may("rack_m_rad", Number(Positive(1.0))),
    may("ackermann", Number(Within(-1.0, 2.0))),
    may("lash_rad", Number(Within(0.0, 2.0))),
    may("left_map_rad", Pairs),
    may("right_map_rad", Pairs),
    may("roll_steer", Vector(2, Finite)),
    may("toe_compliance_rad_n", Vector(2, Within(-1e-3, 1e-3))),
    may("toe_play_rad", Vector(2, Within(0.0, 0.5))),
];

pub(super) const DRIVETRAIN: &[Rule] = &[
    must("drive_split_front", Number(Within(0.0, 1.0))),
    must("brake_split_front", Number(Within(0.0, 1.0))),
    must("drive_reacted_by_chassis", Flag),
    must("front_brake_outboard", Flag),
    must("rear_brake_outboard", Flag),
];
