//! Prints what `scripts/ground-pictures` draws, as JSON: heights of two roads, the vehicle on one of
//! them, and the forces of a wheel in both frames.

use atvrec_sim::model::nalgebra::Vector3;
use atvrec_sim::model::road::{Ground, Road, RoadClass};
use atvrec_sim::model::vehicle::{Tyre, Vehicle};
use atvrec_sim::sample::{ForceFrame, Wheel};
use atvrec_sim::{Manoeuvre, TruthState};
use serde_json::{Value, json};

/// Seed of the road of class C.
const SEED: u64 = 11;
/// Where the front wheels are in the side view: on a half-round of the trail, m.
const PICTURE_X_M: f64 = 59.85;
/// The part of the drive whose forces are drawn, by the place of the front wheel, m.
const FORCES_X_M: [f64; 2] = [58.0, 75.0];
/// Depth of the tyre for the tread envelope, m.
const DEPTH_M: f64 = 0.02;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let vehicle = Vehicle::builtin("prowler")?;
    let road = Manoeuvre::Trail.road()?.ok_or("the trail has a road")?;
    let motion = Manoeuvre::Trail.drive_on(&vehicle, &road)?;
    let front_x_m = |state: &TruthState| {
        let wheel = state.wheels[Wheel::FrontLeft].motion;
        wheel.map_or(f64::NAN, |motion| motion.centre_m[0])
    };
    let states = motion.states();
    let drawn = (states.iter()).find(|state| front_x_m(state) >= PICTURE_X_M);
    let [from_m, to_m] = FORCES_X_M;
    let loaded = states
        .iter()
        .filter(|state| (from_m..to_m).contains(&front_x_m(state)));
    let path: Vec<[f64; 2]> = states
        .iter()
        .step_by(20)
        .map(|state| [state.position_m[0], state.position_m[1]])
        .collect();
    let class_c = Road::iso8608(RoadClass::C, SEED);
    let picture = json!({
        "class_c": height_map(&class_c, [0.0, 60.0], [-6.0, 6.0], 0.1),
        "trail": height_map(&road, [40.0, 160.0], [-10.0, 10.0], 0.2),
        "path_m": path,
        "side": side(drawn.ok_or("the vehicle does not reach the half-round")?, &road, &vehicle),
        "forces": loaded.map(forces).collect::<Vec<_>>(),
    });
    println!("{picture}");
    Ok(())
}

/// Heights in rows from north to south, mm.
fn height_map(road: &Road, x_m: [f64; 2], y_m: [f64; 2], step_m: f64) -> Value {
    let count = |[from, to]: [f64; 2]| ((to - from) / step_m).round() as usize;
    let row = |j: usize| -> Vec<i64> {
        let y = y_m[1] - (j as f64 + 0.5) * step_m;
        let height_mm = |i: usize| 1e3 * road.height_m(x_m[0] + (i as f64 + 0.5) * step_m, y);
        (0..count(x_m))
            .map(|i| height_mm(i).round() as i64)
            .collect()
    };
    let heights_mm: Vec<_> = (0..count(y_m)).map(row).collect();
    json!({ "x_m": x_m, "y_m": y_m, "heights_mm": heights_mm })
}

/// The left wheels on the ground below their paths, and the body.
fn side(state: &TruthState, road: &Road, vehicle: &Vehicle) -> Value {
    let wheel = |wheel: Wheel, tyre: &Tyre| {
        let motion = state.wheels[wheel].motion?;
        let [x_m, y_m, z_m] = motion.centre_m;
        let around = (-150..=150).map(|k| x_m + 0.01 * f64::from(k));
        let ground: Vec<_> = around.clone().map(|x| [x, road.height_m(x, y_m)]).collect();
        let envelope: Vec<_> = around.map(|x| [x, felt_m(road, tyre, [x, y_m])]).collect();
        Some(json!({
            "centre_m": [x_m, z_m],
            "contact_m": [motion.contact_m[0], motion.contact_m[2]],
            "radius_m": tyre.unloaded_radius_m,
            "ground_m": ground,
            "envelope_m": envelope,
        }))
    };
    let body = &vehicle.body;
    let at = |x: f64, z: f64| {
        let place =
            Vector3::from(state.position_m) + state.earth_from_body() * Vector3::new(x, 0.0, z);
        [place.x, place.z]
    };
    let [front, rear] = [body.front_axle_to_cg_m, -body.cg_to_rear_axle_m];
    json!({
        "time_s": state.time_s,
        "speed_m_s": state.velocity_body_m_s[0],
        "front": wheel(Wheel::FrontLeft, &vehicle.front.tyre),
        "rear": wheel(Wheel::RearLeft, &vehicle.rear.tyre),
        "body_m": [at(rear - 0.2, -0.15), at(front + 0.2, -0.15), at(front + 0.2, 0.1), at(rear - 0.2, 0.1)],
        "cg_m": at(0.0, 0.0),
    })
}

/// Height of the ground that an upright tyre at [`DEPTH_M`] rolls over: that of its lowest point, by
/// bisection of the height of the wheel centre.
fn felt_m(road: &Road, tyre: &Tyre, [x_m, y_m]: [f64; 2]) -> f64 {
    let radius_m = tyre.unloaded_radius_m;
    let [mut low_m, mut high_m] = [-1.0, 1.0].map(|far_m| road.height_m(x_m, y_m) + far_m);
    for _ in 0..40 {
        let middle_m = 0.5 * (low_m + high_m);
        let centre_m = Vector3::new(x_m, y_m, middle_m);
        let contact = road.contact(centre_m, Vector3::y(), radius_m, tyre.width_m);
        if contact.depth_m > DEPTH_M {
            low_m = middle_m;
        } else {
            high_m = middle_m;
        }
    }
    low_m + DEPTH_M - radius_m
}

/// Time, and the force of the left front wheel in the wheel-carrier and in the contact frame.
fn forces(state: &TruthState) -> Value {
    let wheel = &state.wheels[Wheel::FrontLeft];
    let force = |frame| wheel.ground.map(|ground| ground.force_n(frame));
    json!([
        state.time_s,
        force(ForceFrame::WheelCarrier),
        force(ForceFrame::Contact)
    ])
}
