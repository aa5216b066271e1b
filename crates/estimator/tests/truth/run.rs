//! Truth runs of the independent simulator, and the vehicle file made from their parameters.

use std::collections::HashMap;
use std::fs::File;
use std::path::PathBuf;

use model::vehicle::Vehicle;
use parquet::column::reader::ColumnReader;
use parquet::file::reader::{FileReader, SerializedFileReader};
use serde_json::{Value, json};

/// Rate of the truth files, Hz.
pub const RATE_HZ: f64 = 200.0;

/// Where the truth runs are; `None`, with a loud word, where they are absent.
pub fn directory() -> Option<PathBuf> {
    let path = PathBuf::from(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../shared/data/truth"
    ));
    if path.join("params.json").exists() {
        Some(path)
    } else {
        eprintln!("SKIPPED: no truth runs at {}", path.display());
        None
    }
}

/// The columns of one run.
pub struct Run {
    pub rows: usize,
    columns: HashMap<String, Vec<f64>>,
}

impl Run {
    pub fn load(name: &str) -> Self {
        let path = directory()
            .expect("checked by the caller")
            .join(format!("{name}.parquet"));
        let reader = SerializedFileReader::new(File::open(path).unwrap()).unwrap();
        let schema = reader.metadata().file_metadata().schema_descr_ptr();
        let mut columns = HashMap::new();
        for index in 0..schema.num_columns() {
            let full = schema.column(index).name().to_owned();
            let short = full.split('[').next().unwrap_or(&full).to_owned();
            let mut values = Vec::new();
            for group in 0..reader.num_row_groups() {
                let group = reader.get_row_group(group).unwrap();
                let rows = group.metadata().num_rows() as usize;
                match group.get_column_reader(index).unwrap() {
                    ColumnReader::DoubleColumnReader(mut column) => {
                        let mut part = Vec::with_capacity(rows);
                        let mut levels = Vec::new();
                        column
                            .read_records(rows, Some(&mut levels), None, &mut part)
                            .unwrap();
                        values.extend(part);
                    }
                    ColumnReader::FloatColumnReader(mut column) => {
                        let mut part = Vec::with_capacity(rows);
                        let mut levels = Vec::new();
                        column
                            .read_records(rows, Some(&mut levels), None, &mut part)
                            .unwrap();
                        values.extend(part.into_iter().map(f64::from));
                    }
                    _ => panic!("column {full} is not a floating-point number"),
                }
            }
            columns.insert(short, values);
        }
        let rows = columns["t"].len();
        Self { rows, columns }
    }

    pub fn column(&self, name: &str) -> &[f64] {
        self.columns
            .get(name)
            .unwrap_or_else(|| panic!("no column {name}"))
    }

    pub fn vector(&self, names: [&str; 3], row: usize) -> [f64; 3] {
        names.map(|name| self.column(name)[row])
    }
}

/// The vehicle file of `params.json`: what a workshop could measure. Tyre stiffness and friction
/// are the published Prowler's, not the run's.
pub fn vehicle() -> Vehicle {
    let path = directory()
        .expect("checked by the caller")
        .join("params.json");
    let p: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let unsprung = &p["unsprung_per_corner"];
    let axle = |end: &str| {
        let s = &p[format!("suspension_{end}")];
        let h = &s["hardpoints_left_in_axle_frame_m"];
        let tyre = &p[format!("tyre_{end}")];
        let wheel_mass = ["spindle_hub", "rim", "tyre"]
            .iter()
            .map(|part| unsprung[part]["m"].as_f64().unwrap())
            .sum::<f64>();
        let diametral = ["spindle_hub", "rim", "tyre"]
            .iter()
            .map(|part| unsprung[part]["I"][0].as_f64().unwrap())
            .sum::<f64>();
        let spin = ["spindle_hub", "rim", "tyre"]
            .iter()
            .map(|part| unsprung[part]["I"][1].as_f64().unwrap())
            .sum::<f64>()
            + unsprung["halfshaft_spin_inertia"].as_f64().unwrap();
        json!({
            "track_m": p[format!("track_{end}_m")],
            "roll_centre_height_m": 0.155,
            "roll_stiffness_n_m_rad": 7700.0,
            "roll_damping_n_m_s_rad": 750.0,
            "unsprung": {
                "wheel_mass_kg": wheel_mass,
                "wheel_spin_inertia_kg_m2": spin,
                "wheel_diametral_inertia_kg_m2": diametral,
                "upright_mass_kg": unsprung["upright"]["m"],
                "upper_arm_mass_kg": unsprung["upper_arm"]["m"],
                "lower_arm_mass_kg": unsprung["lower_arm"]["m"],
                "upright_cg_m": h["UPRIGHT_CM"],
                "upper_arm_cg_m": h["UCA_CM"],
                "lower_arm_cg_m": h["LCA_CM"],
            },
            "strut": {
                "stiffness_n_m": s["spring_k_N_per_m"],
                "free_length_m": s["spring_free_length_m"],
                "design_length_m": s["design_length_m"],
                "damping_n_s_m": s["damper_c_Ns_per_m"],
                "droop_stop_length_m": s["rebound_stop_length_m"],
                "bump_stop_length_m": s["bump_stop_length_m"],
                "stop_stiffness_n_m": s["rebound_stop_k"],
                "stop_damping_n_s_m": s["rebound_stop_c"],
            },
            "wishbone": {
                "wheel_centre_m": h["SPINDLE"],
                "upper_front_m": h["UCA_F"],
                "upper_rear_m": h["UCA_B"],
                "upper_ball_m": h["UCA_U"],
                "lower_front_m": h["LCA_F"],
                "lower_rear_m": h["LCA_B"],
                "lower_ball_m": h["LCA_U"],
                "strut_chassis_m": h["SHOCK_C"],
                "strut_arm_m": h["SHOCK_A"],
                "tie_rod_inner_m": h["TIEROD_C"],
                "tie_rod_outer_m": h["TIEROD_U"],
            },
            "tyre": {
                "unloaded_radius_m": tyre["unloaded_radius_m"],
                "vertical_stiffness_n_m": tyre["vertical_stiffness_N_per_m"],
                "vertical_damping_n_s_m": tyre["vertical_damping_Ns_per_m"],
                "cornering_stiffness_n_rad": if end == "front" { 2987.5 } else { 8538.0 },
                "slip_stiffness_n": 12000.0,
                "reference_load_n": p["static_Fz_per_wheel_N"][end],
                "friction": 0.87,
                "rolling_resistance": tyre["rolling_resistance"],
            },
        })
    };
    let i = &p["inertia_total_about_cg_kgm2"];
    let sprung = &p["sprung_body"];
    let si = &sprung["inertia_about_own_com"];
    let value = json!({
        "name": "truth",
        "description": "the independent simulator's vehicle",
        "body": {
            "mass_kg": p["mass_total_kg"],
            "front_axle_to_cg_m": p["a_m"],
            "cg_to_rear_axle_m": p["b_m"],
            "cg_height_m": p["h_cg_m"],
            "inertia_kg_m2": [i["Ixx"], i["Iyy"], i["Izz"]],
            "sprung": {
                "mass_kg": sprung["mass_kg"],
                "cg_m": sprung["com_m"],
                "inertia_kg_m2": [si["Ixx"], si["Iyy"], si["Izz"]],
                "inertia_xz_kg_m2": si["Ixz_tensor"],
            },
        },
        "front": axle("front"),
        "rear": axle("rear"),
        "steering": { "ratio": 12.0, "rack_m_rad": p["rack"]["rack_m_per_handwheel_rad"] },
        "drivetrain": {
            "drive_split_front": 0.5,
            "brake_split_front": 0.6,
            "drive_reacted_by_chassis": true,
            "front_brake_outboard": true,
            "rear_brake_outboard": true,
        },
    });
    serde_json::from_value(value).unwrap()
}
