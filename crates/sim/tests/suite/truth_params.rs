//! The converter from `params.json` to a vehicle file.

use atvrec_sim::vehicle_from_truth_params;
use model::suspension::Corner;
use model::vehicle::Vehicle;
use sample::Wheel;

fn vehicle() -> Vehicle {
    vehicle_from_truth_params(&params_text()).expect("params.json converts")
}

fn params_text() -> String {
    let path = testkit::project().join("testdata/truth/params.json");
    std::fs::read_to_string(path).expect("readable")
}

#[test]
fn vehicle_file_survives_the_round_trip() {
    let vehicle = vehicle();
    let text = vehicle.to_toml().expect("finite values");
    let back = Vehicle::from_toml(&text, "vehicle.toml").expect("the converter's file is valid");
    assert_eq!(back, vehicle);
    assert!(vehicle.warnings().is_empty(), "{:?}", vehicle.warnings());
}

#[test]
fn parts_add_up_to_the_whole() {
    let vehicle = vehicle();
    let body = &vehicle.body;
    let sprung = body.sprung.as_ref().expect("given");
    let corners = [
        (body.front_axle_to_cg_m, &vehicle.front),
        (-body.cg_to_rear_axle_m, &vehicle.rear),
    ];
    let unsprung = |moment: &dyn Fn(f64, f64) -> f64| -> f64 {
        corners
            .iter()
            .map(|(x, axle)| moment(*x, axle.unsprung_mass_kg()))
            .sum()
    };
    assert!((sprung.mass_kg + unsprung(&|_, m| m) - body.mass_kg).abs() < 1e-9);
    // The arms' centres of gravity are millimetres off the axles' lines.
    let moment = sprung.mass_kg * sprung.cg_m[0] + unsprung(&|x, m| x * m);
    assert!(moment.abs() < 0.1, "{moment} kg m off the middle");
}

/// The run's tyre curves and friction must not reach the estimator through the vehicle file.
#[test]
fn tyre_curves_are_not_taken() {
    let (vehicle, text) = (vehicle(), params_text());
    let mut other: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    for tyre in ["tyre_front", "tyre_rear"] {
        for curve in ["dfy0", "dfx0", "fym", "sym", "mu_0"] {
            other[tyre][curve] = serde_json::json!([1.0, 2.0]);
        }
        other[tyre]["cornering_stiffness_at_static_load_N_per_rad_per_tyre"] = 1.0.into();
    }
    let changed = vehicle_from_truth_params(&other.to_string()).expect("converts");
    assert_eq!(changed, vehicle);
}

#[test]
fn heavier_vehicle_with_another_split() {
    let (first, text) = (vehicle(), params_text());
    let mut other: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    other["mass_total_kg"] = 844.0.into();
    other["sprung_body"]["mass_kg"] = 737.0.into();
    other["a_m"] = 0.95.into();
    other["b_m"] = 0.498.into();
    other["suspension_rear"]["spring_k_N_per_m"] = 90_000.0.into();
    let heavy = vehicle_from_truth_params(&other.to_string()).expect("converts");
    assert!((heavy.body.mass_kg - 844.0).abs() < 1e-12);
    assert!((heavy.wheelbase_m() - first.wheelbase_m()).abs() < 1e-12);
    assert!(heavy.rear.tyre.reference_load_n > first.rear.tyre.reference_load_n + 500.0);
    let ratio = heavy.rear.roll_stiffness_n_m_rad / first.rear.roll_stiffness_n_m_rad;
    assert!((ratio - 90.0 / 65.0).abs() < 1e-9);
    let corner = Corner::of(&heavy, Wheel::RearRight).expect("hard-points");
    assert!((corner.points.wheel_centre.x + 0.498).abs() < 1e-12);
    let text = heavy.to_toml().expect("finite values");
    Vehicle::from_toml(&text, "vehicle.toml").expect("valid");
}

/// Each change of a parameter file arrives where it belongs, and the vehicle stays one that the file
/// format admits.
#[test]
fn other_parameter_files_give_other_vehicles_with_no_hand_work() {
    let (first, text) = (vehicle(), params_text());
    let convert = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut other: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        change(&mut other);
        let vehicle = vehicle_from_truth_params(&other.to_string()).expect("converts");
        let text = vehicle.to_toml().expect("finite values");
        Vehicle::from_toml(&text, "vehicle.toml").expect("valid")
    };
    let grown = |value: &serde_json::Value, factor: f64| {
        serde_json::json!(value.as_f64().expect("a number") * factor)
    };
    let heavy = convert(&|p| {
        p["mass_total_kg"] = grown(&p["mass_total_kg"], 1.3);
        let more = 0.3 * 644.0;
        let own = p["sprung_body"]["mass_kg"].as_f64().expect("a number");
        p["sprung_body"]["mass_kg"] = (own + more).into();
    });
    assert!((heavy.body.mass_kg / first.body.mass_kg - 1.3).abs() < 1e-9);
    let stiffer =
        heavy.front.tyre.cornering_stiffness_n_rad / first.front.tyre.cornering_stiffness_n_rad;
    assert!(
        (stiffer - 1.3).abs() < 0.03,
        "the prior goes with the load: {stiffer}"
    );
    let swapped = convert(&|p| {
        (p["a_m"], p["b_m"]) = (p["b_m"].clone(), p["a_m"].clone());
    });
    let (load, old) = (
        swapped.front.tyre.reference_load_n,
        first.rear.tyre.reference_load_n,
    );
    assert!((load - old).abs() < 1.5, "{load} {old}");
    let wide = convert(&|p| {
        p["track_front_m"] = 1.3.into();
        let points = &mut p["suspension_front"]["hardpoints_left_in_axle_frame_m"];
        for (_, point) in points.as_object_mut().expect("points") {
            point[1] = (point[1].as_f64().expect("a number") + 0.0785).into();
        }
    });
    assert_eq!(wide.front.track_m, 1.3);
    assert!(wide.front.roll_stiffness_n_m_rad > first.front.roll_stiffness_n_m_rad);
    let shifted = convert(&|p| {
        let points = &mut p["suspension_rear"]["hardpoints_left_in_axle_frame_m"];
        let z = points["UCA_F"][2].as_f64().expect("a number");
        points["UCA_F"][2] = (z + 0.01).into();
        let z = points["UCA_B"][2].as_f64().expect("a number");
        points["UCA_B"][2] = (z + 0.01).into();
    });
    let heights = [&shifted, &first].map(|v| v.rear.roll_centre_height_m);
    assert!((heights[0] - heights[1]).abs() > 1e-3, "{heights:?}");
    let bare = convert(&|p| {
        let all = p.as_object_mut().expect("an object");
        all.remove("aero_drag");
        all.remove("brake_split_front");
    });
    assert_eq!(bare.drivetrain.brake_split_front, 0.6);
}

#[test]
fn broken_files_are_errors() {
    assert!(vehicle_from_truth_params("{}").is_err());
    let text = params_text();
    let mut flat: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let points = &mut flat["suspension_front"]["hardpoints_left_in_axle_frame_m"];
    points["LCA_U"] = points["LCA_F"].clone();
    let error = vehicle_from_truth_params(&flat.to_string()).expect_err("degenerate");
    let cause = std::error::Error::source(&error)
        .expect("a cause")
        .to_string();
    assert!(cause.contains("lower arm"), "{error}: {cause}");
}
