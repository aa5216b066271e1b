//! A vehicle of which only mass and axle distances are known. The rest is common for a car of this
//! size and marked so in `sources`. It is enough where a drive tells how the vehicle handles.

use std::collections::BTreeMap;

use sample::STANDARD_GRAVITY_M_S2;
use serde::Deserialize;

use super::rules::{DRIVETRAIN, LENGTH, MASS};
use super::{Axle, Body, Drivetrain, Steering, Tyre, Vehicle};
use crate::file::rules::Kind::{Number, Table, Text, Texts, Vector};
use crate::file::rules::Range::{NonNegative, Positive};
use crate::file::rules::{Rule, TableRules, may, must};

/// What is common, as multiples of what is known.
const HEIGHT_OVER_WHEELBASE: f64 = 0.2;
const TRACK_OVER_WHEELBASE: f64 = 0.57;
const INERTIA_OVER_YAW: [f64; 3] = [0.25, 0.9, 1.0];
const ROLL_CENTRE_HEIGHT_M: f64 = 0.1;
/// Roll angle at one g of lateral acceleration, rad.
const ROLL_RAD: f64 = 0.04;
const ROLL_DAMPING_S: f64 = 0.08;
const TYRE_RADIUS_M: f64 = 0.32;
const VERTICAL_STIFFNESS_M: f64 = 55.0;
const CORNERING_STIFFNESS_RAD: f64 = 12.0;
const SLIP_STIFFNESS: f64 = 15.0;
/// Cornering stiffness of a car tyre over its load: degressive.
const LOAD_EXPONENT: f64 = 0.8;
const FRICTION: f64 = 1.0;
/// What stands beside each of them in `sources`.
const SOURCE: &str = "common for a car of this mass and wheelbase";

/// The tables of such a file.
pub(super) const SECTIONS: &[TableRules] = &[
    TableRules {
        tables: &[""],
        rules: TOP,
    },
    TableRules {
        tables: &["body"],
        rules: BODY,
    },
    TableRules {
        tables: &["steering"],
        rules: STEERING,
    },
    TableRules {
        tables: &["drivetrain"],
        rules: DRIVETRAIN,
    },
];

const TOP: &[Rule] = &[
    must("name", Text),
    may("description", Text),
    must("body", Table),
    may("steering", Table),
    may("drivetrain", Table),
    may("sources", Texts),
];

const BODY: &[Rule] = &[
    must("mass_kg", Number(Positive(MASS))),
    must("front_axle_to_cg_m", Number(Positive(LENGTH))),
    must("cg_to_rear_axle_m", Number(Positive(LENGTH))),
    may("cg_height_m", Number(Positive(LENGTH))),
    may("inertia_kg_m2", Vector(3, Positive(1e7))),
    may("drag_n_s2_m2", Number(NonNegative(100.0))),
];

const STEERING: &[Rule] = &[may("ratio", Number(Positive(100.0)))];

impl Vehicle {
    /// Whether a value (its dotted name, or that of its table) is not of the vehicle file but common for a vehicle of
    /// this mass and wheelbase.
    #[must_use]
    pub fn is_guessed(&self, field: &str) -> bool {
        self.sources
            .get(field)
            .is_some_and(|source| source == SOURCE)
    }
}

/// A vehicle file without axles.
#[derive(Deserialize)]
pub(super) struct Plain {
    name: String,
    #[serde(default)]
    description: String,
    body: PlainBody,
    #[serde(default)]
    steering: PlainSteering,
    #[serde(default)]
    drivetrain: Drivetrain,
    #[serde(default)]
    sources: BTreeMap<String, String>,
}

#[derive(Deserialize)]
struct PlainBody {
    mass_kg: f64,
    front_axle_to_cg_m: f64,
    cg_to_rear_axle_m: f64,
    cg_height_m: Option<f64>,
    inertia_kg_m2: Option<[f64; 3]>,
    #[serde(default)]
    drag_n_s2_m2: f64,
}

#[derive(Default, Deserialize)]
struct PlainSteering {
    ratio: Option<f64>,
}

/// Whether a file speaks of no axle.
pub(super) fn is_plain(text: &str) -> bool {
    text.parse::<toml::Table>()
        .is_ok_and(|file| !file.contains_key("front") && !file.contains_key("rear"))
}

impl From<Plain> for Vehicle {
    fn from(plain: Plain) -> Self {
        let known = &plain.body;
        let (a, b) = (known.front_axle_to_cg_m, known.cg_to_rear_axle_m);
        let height_m = known.cg_height_m.unwrap_or(HEIGHT_OVER_WHEELBASE * (a + b));
        let body = Body {
            mass_kg: known.mass_kg,
            front_axle_to_cg_m: a,
            cg_to_rear_axle_m: b,
            cg_height_m: height_m,
            cg_y_m: 0.0,
            inertia_kg_m2: known
                .inertia_kg_m2
                .unwrap_or(INERTIA_OVER_YAW.map(|part| part * known.mass_kg * a * b)),
            inertia_xz_kg_m2: 0.0,
            drag_n_s2_m2: known.drag_n_s2_m2,
            sprung: None,
            pitch: None,
        };
        let mut sources = plain.sources;
        let guessed = [
            ("body.cg_height_m", known.cg_height_m.is_none()),
            ("body.inertia_kg_m2", known.inertia_kg_m2.is_none()),
            ("front", true),
            ("rear", true),
        ];
        for (field, _) in guessed.into_iter().filter(|(_, guessed)| *guessed) {
            sources.insert(field.to_owned(), SOURCE.to_owned());
        }
        let part = |arm: f64| arm / (a + b);
        Self {
            name: plain.name,
            description: plain.description,
            front: axle(&body, part(b)),
            rear: axle(&body, part(a)),
            body,
            steering: Steering {
                ratio: plain.steering.ratio.unwrap_or(1.0),
                rack_m_rad: None,
                ackermann: 0.0,
                lash_rad: 0.0,
                left_map_rad: Vec::new(),
                right_map_rad: Vec::new(),
                roll_steer: [0.0; 2],
                toe_compliance_rad_n: [0.0; 2],
                toe_play_rad: [0.0; 2],
            },
            drivetrain: plain.drivetrain,
            payload: Vec::new(),
            hitch: None,
            tolerances: None,
            sources,
        }
    }
}

/// An axle that carries this part of the vehicle.
fn axle(body: &Body, part: f64) -> Axle {
    let weight_n = body.mass_kg * STANDARD_GRAVITY_M_S2;
    let load_n = 0.5 * part * weight_n;
    let arm_m = (body.cg_height_m - ROLL_CENTRE_HEIGHT_M).max(0.1 * body.cg_height_m);
    let roll_stiffness_n_m_rad = 0.5 * weight_n * arm_m * (1.0 / ROLL_RAD + 1.0);
    Axle {
        track_m: TRACK_OVER_WHEELBASE * (body.front_axle_to_cg_m + body.cg_to_rear_axle_m),
        roll_centre_height_m: ROLL_CENTRE_HEIGHT_M,
        roll_stiffness_n_m_rad,
        roll_damping_n_m_s_rad: ROLL_DAMPING_S * roll_stiffness_n_m_rad,
        anti_roll_bar_n_m_rad: 0.0,
        unsprung: None,
        strut: None,
        wishbone: None,
        macpherson: None,
        five_link: None,
        trailing_arm: None,
        live_axle: None,
        leaf_axle: None,
        tyre: Tyre {
            tir: None,
            unloaded_radius_m: TYRE_RADIUS_M,
            vertical_stiffness_n_m: VERTICAL_STIFFNESS_M * load_n,
            vertical_damping_n_s_m: 0.0,
            width_m: 0.0,
            cornering_stiffness_n_rad: CORNERING_STIFFNESS_RAD * load_n,
            slip_stiffness_n: SLIP_STIFFNESS * load_n,
            reference_load_n: load_n,
            load_exponent: LOAD_EXPONENT,
            friction: FRICTION,
            relaxation_length_m: 0.0,
            rolling_resistance: 0.0,
            camber_stiffness_n_rad: 0.0,
            pressure: None,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAST: &str = "name = \"car\"\n[body]\nmass_kg = 1500.0\nfront_axle_to_cg_m = 1.2\n\
                         cg_to_rear_axle_m = 1.4\n";

    #[test]
    fn mass_and_axle_distances_suffice_and_the_rest_is_marked_as_guessed() {
        let vehicle = Vehicle::from_toml(LEAST, "car.toml").unwrap();
        assert!(vehicle.warnings().is_empty(), "{:?}", vehicle.warnings());
        let weight_n = 1500.0 * STANDARD_GRAVITY_M_S2;
        let load_n = |axle: &Axle| 2.0 * axle.tyre.reference_load_n;
        assert!((load_n(&vehicle.front) - weight_n * 1.4 / 2.6).abs() < 1e-6);
        assert!((load_n(&vehicle.front) + load_n(&vehicle.rear) - weight_n).abs() < 1e-6);
        assert_eq!(vehicle.steering.ratio, 1.0);
        assert_eq!(vehicle.sources["front"], SOURCE);
        let whole = vehicle.to_toml().unwrap();
        assert_eq!(Vehicle::from_toml(&whole, "whole.toml").unwrap(), vehicle);
    }

    #[test]
    fn what_a_plain_file_tells_is_kept() {
        let more = format!("{LEAST}cg_height_m = 0.6\n[steering]\nratio = 15.0\n");
        let vehicle = Vehicle::from_toml(&more, "car.toml").unwrap();
        assert_eq!(vehicle.body.cg_height_m, 0.6);
        assert_eq!(vehicle.steering.ratio, 15.0);
        assert!(!vehicle.sources.contains_key("body.cg_height_m"));
    }

    #[test]
    fn mistakes_in_a_plain_file_are_told_together() {
        let wrong = LEAST
            .replace("mass_kg = 1500.0\n", "")
            .replace("= 1.4", "= 1400.0");
        let errors = Vehicle::from_toml(&wrong, "car.toml").unwrap_err();
        let fields: Vec<&str> = errors.problems.iter().map(|p| &*p.field).collect();
        assert_eq!(fields, ["body.mass_kg", "body.cg_to_rear_axle_m"]);
    }

    #[test]
    fn one_axle_makes_it_a_whole_vehicle_file() {
        let half = format!("{LEAST}[front]\ntrack_m = 1.5\n");
        let errors = Vehicle::from_toml(&half, "car.toml").unwrap_err();
        assert!(errors.problems.iter().any(|p| p.field == "rear"));
    }
}
