//! A vehicle file from a simulator's parameter file (`params.json` of a truth run).
//!
//! Only what a workshop could measure is taken: masses, inertia, geometry, springs, dampers,
//! stops, the tyres' radius and vertical stiffness. The run's tyre curves and friction are left
//! out on purpose: an estimator that is judged on the run must not know them. Values that bias-ply
//! tyres have in general take their place.

use std::collections::BTreeMap;

use model::suspension::{Corner, SuspensionError};
use model::vehicle::{
    Axle, Body, Drivetrain, Sprung, Steering, Strut, Tyre, Unsprung, Vehicle, Wishbone,
};
use nalgebra::Vector3;
use sample::Wheel;
use serde::Deserialize;

/// Cornering stiffness over load, 1/rad: 0.08 of the load per degree, rounded, the low end of what
/// bias-ply tyres have (0.08 to 0.18; Gillespie, Fundamentals of Vehicle Dynamics, chapter 10), as
/// low pressure makes tyres soft. Sideslip without satellites leans on it.
const CORNERING_PER_LOAD: f64 = 4.5;
/// Slip stiffness over load.
const SLIP_PER_LOAD: f64 = 12.0;
/// Exponent of the stiffness's growth with load, the mean, rounded: Pacejka's C = c_1 sin(2
/// atan(F_z/(2 F_z0))) has 0.88 at half of the nominal load and 0.60 at all of it (Tyre and Vehicle
/// Dynamics, 3rd edition, section 4.3).
const LOAD_EXPONENT: f64 = 0.75;
/// Friction coefficient of dry firm ground.
const FRICTION: f64 = 0.85;
/// Rolling resistance of a low-pressure tyre on firm ground.
const ROLLING_RESISTANCE: f64 = 0.02;
/// Vertical damping of a tyre that the file does not state, N s/m.
const TYRE_DAMPING_N_S_M: f64 = 500.0;

/// Why a parameter file gave no vehicle.
#[derive(Debug, thiserror::Error)]
pub enum TruthParamsError {
    /// The file is not the JSON that is expected.
    #[error("the parameters cannot be read")]
    Json(#[from] serde_json::Error),
    /// The hard-points make no linkage.
    #[error("the hard-points are not valid")]
    Suspension(#[from] SuspensionError),
}

/// The vehicle that a truth run's `params.json` describes, without its tyre curves.
///
/// # Errors
/// When the text does not parse or its hard-points are degenerate.
pub fn vehicle_from_truth_params(json: &str) -> Result<Vehicle, TruthParamsError> {
    let params: Params = serde_json::from_str(json)?;
    let mut vehicle = params.vehicle();
    derive_from_hard_points(&mut vehicle)?;
    Ok(vehicle)
}

/// Fills roll centre, roll stiffness, roll damping and steering ratio from the linkages.
fn derive_from_hard_points(vehicle: &mut Vehicle) -> Result<(), SuspensionError> {
    for wheel in [Wheel::FrontLeft, Wheel::RearLeft] {
        let corner = Corner::of(vehicle, wheel)?;
        let axle = if wheel.is_front() {
            &mut vehicle.front
        } else {
            &mut vehicle.rear
        };
        let pose = corner.pose_at_jounce(0.0, 0.0)?;
        let rates = corner.rates(&pose);
        let contact = Vector3::new(pose.wheel_centre_m.x, pose.wheel_centre_m.y, 0.0);
        let path = rates.strut.at(&pose, contact);
        axle.roll_centre_height_m = 0.5 * axle.track_m * path.y / path.z;
        let lever = (rates.motion_ratio() * axle.track_m).powi(2) / 2.0;
        if let Some(strut) = &mut axle.strut {
            strut.motion_ratio = Some(rates.motion_ratio());
            axle.roll_stiffness_n_m_rad = strut.stiffness_n_m * lever;
            axle.roll_damping_n_m_s_rad = strut.damping_n_s_m * lever;
        }
        if let (true, Some(rack)) = (wheel.is_front(), vehicle.steering.rack_m_rad) {
            vehicle.steering.ratio = 1.0 / (rates.rack.rotation.z * rack);
        }
    }
    Ok(())
}

#[derive(Deserialize)]
struct Params {
    g: f64,
    mass_total_kg: f64,
    a_m: f64,
    b_m: f64,
    h_cg_m: f64,
    track_front_m: f64,
    track_rear_m: f64,
    inertia_total_about_cg_kgm2: Principal,
    sprung_body: SprungBody,
    rack: Rack,
    unsprung_per_corner: UnsprungParts,
    suspension_front: Linkage,
    suspension_rear: Linkage,
    tyre_front: TyreSize,
    tyre_rear: TyreSize,
    #[serde(default = "brake_split")]
    brake_split_front: f64,
    #[serde(default)]
    aero_drag: f64,
}

#[derive(Deserialize)]
#[serde(rename_all = "PascalCase")]
struct Principal {
    ixx: f64,
    iyy: f64,
    izz: f64,
}

#[derive(Deserialize)]
struct SprungBody {
    mass_kg: f64,
    com_m: [f64; 3],
    inertia_about_own_com: Tensor,
}

#[derive(Deserialize)]
struct Tensor {
    #[serde(rename = "Ixx")]
    xx: f64,
    #[serde(rename = "Iyy")]
    yy: f64,
    #[serde(rename = "Izz")]
    zz: f64,
    #[serde(rename = "Ixz_tensor")]
    xz: f64,
}

#[derive(Deserialize)]
struct Rack {
    mass_kg: f64,
    pos_m: [f64; 3],
    rack_m_per_handwheel_rad: f64,
}

#[derive(Deserialize)]
struct UnsprungParts {
    spindle_hub: Part,
    rim: Part,
    tyre: Part,
    upright: Part,
    upper_arm: Part,
    lower_arm: Part,
    halfshaft_spin_inertia: f64,
}

#[derive(Deserialize)]
struct Part {
    m: f64,
    #[serde(rename = "I")]
    inertia: [f64; 3],
}

#[derive(Deserialize)]
struct Linkage {
    hardpoints_left_in_axle_frame_m: Points,
    #[serde(rename = "spring_k_N_per_m")]
    spring_n_m: f64,
    spring_free_length_m: f64,
    design_length_m: f64,
    #[serde(rename = "damper_c_Ns_per_m")]
    damper_n_s_m: f64,
    rebound_stop_length_m: f64,
    rebound_stop_k: f64,
    #[serde(default)]
    rebound_stop_c: f64,
    bump_stop_length_m: f64,
}

#[derive(Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
struct Points {
    spindle: [f64; 3],
    upright_cm: [f64; 3],
    uca_f: [f64; 3],
    uca_b: [f64; 3],
    uca_u: [f64; 3],
    uca_cm: [f64; 3],
    lca_f: [f64; 3],
    lca_b: [f64; 3],
    lca_u: [f64; 3],
    lca_cm: [f64; 3],
    shock_c: [f64; 3],
    shock_a: [f64; 3],
    tierod_c: [f64; 3],
    tierod_u: [f64; 3],
}

#[derive(Deserialize)]
struct TyreSize {
    unloaded_radius_m: f64,
    #[serde(rename = "vertical_stiffness_N_per_m")]
    vertical_n_m: f64,
    #[serde(rename = "vertical_damping_Ns_per_m", default = "tyre_damping")]
    vertical_damping_n_s_m: f64,
    #[serde(default)]
    width_m: f64,
}

const fn tyre_damping() -> f64 {
    TYRE_DAMPING_N_S_M
}

impl Params {
    fn vehicle(&self) -> Vehicle {
        let wheelbase_m = self.a_m + self.b_m;
        let wheel_load = |other_m: f64| 0.5 * self.mass_total_kg * self.g * other_m / wheelbase_m;
        let inertia = &self.inertia_total_about_cg_kgm2;
        Vehicle {
            name: "truth".to_owned(),
            description: "converted from a simulator's params.json: what a workshop could \
                          measure, with a neutral prior for the tyres"
                .to_owned(),
            body: Body {
                mass_kg: self.mass_total_kg,
                front_axle_to_cg_m: self.a_m,
                cg_to_rear_axle_m: self.b_m,
                cg_height_m: self.h_cg_m,
                cg_y_m: 0.0,
                inertia_kg_m2: [inertia.ixx, inertia.iyy, inertia.izz],
                inertia_xz_kg_m2: 0.0,
                drag_n_s2_m2: self.aero_drag,
                pitch: None,
                sprung: Some(self.sprung()),
            },
            front: self.axle(
                self.track_front_m,
                &self.suspension_front,
                &self.tyre_front,
                wheel_load(self.b_m),
            ),
            rear: self.axle(
                self.track_rear_m,
                &self.suspension_rear,
                &self.tyre_rear,
                wheel_load(self.a_m),
            ),
            steering: Steering {
                ratio: f64::NAN,
                rack_m_rad: Some(self.rack.rack_m_per_handwheel_rad),
                ackermann: 0.0,
                lash_rad: 0.0,
                left_map_rad: Vec::new(),
                right_map_rad: Vec::new(),
                roll_steer: [0.0; 2],
                toe_compliance_rad_n: [0.0; 2],
                toe_play_rad: [0.0; 2],
            },
            drivetrain: Drivetrain {
                drive_split_front: 0.0,
                brake_split_front: self.brake_split_front,
                drive_reacted_by_chassis: true,
                front_brake_outboard: true,
                rear_brake_outboard: true,
            },
            sources: sources(),
            payload: Vec::new(),
            hitch: None,
            tolerances: None,
        }
    }

    /// Body and rack together.
    fn sprung(&self) -> Sprung {
        let body = &self.sprung_body;
        let own = &body.inertia_about_own_com;
        let mass_kg = body.mass_kg + self.rack.mass_kg;
        let share = self.rack.mass_kg / mass_kg;
        let offset: [f64; 3] = std::array::from_fn(|i| self.rack.pos_m[i] - body.com_m[i]);
        let [x, y, z] = offset;
        let reduced_kg = body.mass_kg * share;
        Sprung {
            mass_kg,
            cg_m: std::array::from_fn(|i| body.com_m[i] + share * offset[i]),
            inertia_kg_m2: [
                own.xx + reduced_kg * (y * y + z * z),
                own.yy + reduced_kg * (x * x + z * z),
                own.zz + reduced_kg * (x * x + y * y),
            ],
            // The file has the tensor's element, which is the negative of the product.
            inertia_xz_kg_m2: -own.xz + reduced_kg * x * z,
        }
    }

    fn axle(&self, track_m: f64, linkage: &Linkage, tyre: &TyreSize, load_n: f64) -> Axle {
        let points = &linkage.hardpoints_left_in_axle_frame_m;
        Axle {
            track_m,
            roll_centre_height_m: f64::NAN,
            roll_stiffness_n_m_rad: f64::NAN,
            roll_damping_n_m_s_rad: f64::NAN,
            anti_roll_bar_n_m_rad: 0.0,
            unsprung: Some(self.unsprung_per_corner.corner(points)),
            strut: Some(linkage.strut()),
            wishbone: Some(points.wishbone()),
            macpherson: None,
            five_link: None,
            trailing_arm: None,
            live_axle: None,
            leaf_axle: None,
            tyre: Tyre {
                tir: None,
                unloaded_radius_m: tyre.unloaded_radius_m,
                vertical_stiffness_n_m: tyre.vertical_n_m,
                vertical_damping_n_s_m: tyre.vertical_damping_n_s_m,
                width_m: tyre.width_m,
                cornering_stiffness_n_rad: round_to(CORNERING_PER_LOAD * load_n, 100.0),
                slip_stiffness_n: round_to(SLIP_PER_LOAD * load_n, 100.0),
                reference_load_n: round_to(load_n, 1.0),
                load_exponent: LOAD_EXPONENT,
                friction: FRICTION,
                relaxation_length_m: 0.0,
                rolling_resistance: ROLLING_RESISTANCE,
                camber_stiffness_n_rad: 0.0,
                pressure: None,
            },
        }
    }
}

impl UnsprungParts {
    fn corner(&self, points: &Points) -> Unsprung {
        let turning = [&self.spindle_hub, &self.rim, &self.tyre];
        Unsprung {
            wheel_mass_kg: turning.iter().map(|part| part.m).sum(),
            wheel_spin_inertia_kg_m2: turning.iter().map(|part| part.inertia[1]).sum::<f64>()
                + self.halfshaft_spin_inertia,
            wheel_diametral_inertia_kg_m2: turning.iter().map(|part| part.inertia[0]).sum(),
            upright_mass_kg: self.upright.m,
            upper_arm_mass_kg: self.upper_arm.m,
            lower_arm_mass_kg: self.lower_arm.m,
            upright_cg_m: Some(points.upright_cm),
            upper_arm_cg_m: Some(points.uca_cm),
            lower_arm_cg_m: Some(points.lca_cm),
        }
    }
}

impl Linkage {
    fn strut(&self) -> Strut {
        Strut {
            stiffness_n_m: self.spring_n_m,
            free_length_m: self.spring_free_length_m,
            design_length_m: self.design_length_m,
            damping_n_s_m: self.damper_n_s_m,
            rebound_damping_n_s_m: None,
            bump_stop_stiffness_n_m: None,
            bump_stop_progression_n_m2: 0.0,
            droop_stop_length_m: self.rebound_stop_length_m,
            bump_stop_length_m: self.bump_stop_length_m,
            stop_stiffness_n_m: self.rebound_stop_k,
            stop_damping_n_s_m: self.rebound_stop_c,
            motion_ratio: None,
        }
    }
}

impl Points {
    fn wishbone(&self) -> Wishbone {
        Wishbone {
            wheel_centre_m: self.spindle,
            upper_front_m: self.uca_f,
            upper_rear_m: self.uca_b,
            upper_ball_m: self.uca_u,
            lower_front_m: self.lca_f,
            lower_rear_m: self.lca_b,
            lower_ball_m: self.lca_u,
            strut_chassis_m: self.shock_c,
            strut_arm_m: self.shock_a,
            tie_rod_inner_m: self.tierod_c,
            tie_rod_outer_m: self.tierod_u,
        }
    }
}

fn brake_split() -> f64 {
    Drivetrain::default().brake_split_front
}

fn round_to(value: f64, step: f64) -> f64 {
    (value / step).round() * step
}

fn sources() -> BTreeMap<String, String> {
    let tyre = "prior that depends on no vehicle (Gillespie: bias-ply tyres), not the run's curves";
    [
        ("body", "params.json"),
        ("front.wishbone", "params.json"),
        ("rear.wishbone", "params.json"),
        (
            "front.roll_centre_height_m",
            "from the hard-points, design position",
        ),
        (
            "rear.roll_centre_height_m",
            "from the hard-points, design position",
        ),
        (
            "front.roll_stiffness_n_m_rad",
            "coil and motion ratio, design position",
        ),
        (
            "rear.roll_stiffness_n_m_rad",
            "coil and motion ratio, design position",
        ),
        ("steering.ratio", "from the hard-points, design position"),
        ("front.tyre.cornering_stiffness_n_rad", tyre),
        ("rear.tyre.cornering_stiffness_n_rad", tyre),
        ("front.tyre.slip_stiffness_n", tyre),
        ("rear.tyre.slip_stiffness_n", tyre),
        ("front.tyre.friction", tyre),
        ("rear.tyre.friction", tyre),
    ]
    .into_iter()
    .map(|(name, source)| (name.to_owned(), source.to_owned()))
    .collect()
}
