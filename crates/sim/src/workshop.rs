//! What a workshop does with a vehicle that is to be calibrated: turned on a floor that is not quite
//! level, loaded on scales, pushed at one wheel after the other, steered on turn plates. Marks say
//! what a person would read off; each stands at the beginning of at least two seconds of rest.

use model::vehicle::Vehicle;
use sample::{PerWheel, STANDARD_GRAVITY_M_S2, Wheel};

use crate::jackstand::smooth;
use crate::linkage::Linkage;
use crate::slope::Slope;
use crate::truth::fill_missing;
use crate::{Motion, SimError, TruthState, WheelTruth};

const STEP_S: f64 = 0.01;
/// How long everything rests at a mark, and how long the way to the next takes.
const REST_S: f64 = 3.0;
const WAY_S: f64 = 1.0;

/// Rest before and after the turn, and how long the turn takes.
const TURN_S: [f64; 2] = [10.0, 14.0];
/// The floor's turn about east and north, rad.
const FLOOR_RAD: [f64; 2] = [0.008, -0.006];

/// Loads put into the vehicle, kg, and where, from the centre of gravity, m.
const LOADS_KG: [f64; 7] = [0.0, 60.0, 120.0, 180.0, 120.0, 60.0, 0.0];
const LOAD_AT_M: [f64; 2] = [-0.15, 0.08];

/// Forces on a wheel in the rig, one after the other: forward, left and up, N.
pub const RIG_N: [[f64; 3]; 9] = [
    [0.0, 0.0, 0.0],
    [0.0, 0.0, 1000.0],
    [0.0, 0.0, 2000.0],
    [700.0, 0.0, 2000.0],
    [-700.0, 0.0, 2000.0],
    [0.0, 900.0, 2000.0],
    [0.0, -900.0, 2000.0],
    [400.0, 500.0, 1500.0],
    [-400.0, -500.0, 1500.0],
];

/// Steering-wheel angles on the turn plates, rad.
const PLATES_RAD: [f64; 17] = [
    0.0, 1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0, 0.0, -1.0, -2.0, -3.0, -4.0, -3.0, -2.0, -1.0, 0.0,
];

/// At rest, turned by half a turn on a sloping floor, at rest.
pub(crate) fn turned(vehicle: &Vehicle) -> Result<Motion, SimError> {
    let [rest_s, turn_s] = TURN_S;
    let duration_s = 2.0 * rest_s + turn_s;
    let mut states = plateaus(duration_s, |time_s| TruthState {
        time_s,
        wheels: standing(vehicle, 0.0),
        ..level(vehicle)
    });
    complete(vehicle, &mut states)?;
    let floor = Slope::turned(FLOOR_RAD[0], FLOOR_RAD[1]);
    for state in &mut states {
        let [part, slower] = [0.0, 1e-3]
            .map(|ahead| smooth((state.time_s + ahead - rest_s) / turn_s) * std::f64::consts::PI);
        let rate = (slower - part) / 1e-3;
        state.rate_rad_s = (state.up_body() * rate).into();
        state.rate_derivative_rad_s2 = [f64::NAN; 3];
        state.yaw_rad = part;
        floor.lay(state);
        state.specific_force_m_s2 = (state.up_body() * STANDARD_GRAVITY_M_S2).into();
        state.acceleration_m_s2 = [0.0; 3];
    }
    fill_missing(&mut states);
    Motion::new("turned", states)
}

/// On scales, with load put in and taken out.
pub(crate) fn weighed(vehicle: &Vehicle) -> Result<Motion, SimError> {
    let at = |time_s: f64| stepped(&LOADS_KG, time_s);
    let mut states = plateaus(period_s() * LOADS_KG.len() as f64, |time_s| TruthState {
        time_s,
        wheels: standing(vehicle, at(time_s)),
        ..level(vehicle)
    });
    complete(vehicle, &mut states)?;
    let marks = (0..LOADS_KG.len()).map(|k| {
        let wheels = standing(vehicle, LOADS_KG[k]);
        let loads = wheels.0.map(|wheel| format!("{:.1}", wheel.force_n[2]));
        (mark_s(k), format!("scales {}", loads.join(" ")))
    });
    Ok(Motion::new("weighed", states)?.with_marks(marks.collect()))
}

/// On stands, one wheel after the other pushed by known forces at its hub.
pub(crate) fn rigged(vehicle: &Vehicle) -> Result<Motion, SimError> {
    let corner_s = period_s() * RIG_N.len() as f64;
    let force = |wheel: Wheel, time_s: f64| -> [f64; 3] {
        let own_s = time_s - corner_s * wheel.index() as f64;
        if !(0.0..corner_s).contains(&own_s) {
            return [0.0; 3];
        }
        std::array::from_fn(|axis| stepped(&RIG_N.map(|force| force[axis]), own_s))
    };
    let mut states = plateaus(4.0 * corner_s + WAY_S, |time_s| TruthState {
        time_s,
        wheels: PerWheel::from_fn(|wheel| pushed(vehicle, wheel, force(wheel, time_s))),
        ..level(vehicle)
    });
    if let Some(linkage) = Linkage::new(vehicle)? {
        // The stands hold the body level, whatever the wheels do.
        linkage.balance(&mut states)?;
        linkage.complete(&mut states)?;
    }
    let marks = Wheel::ALL.into_iter().flat_map(|wheel| {
        (0..RIG_N.len()).map(move |k| {
            let [x, y, z] = RIG_N[k];
            let time_s = corner_s * wheel.index() as f64 + mark_s(k);
            (time_s, format!("rig {wheel} {x:.1} {y:.1} {z:.1}"))
        })
    });
    Ok(Motion::new("load-rig", states)?.with_marks(marks.collect()))
}

/// On turn plates, steered from side to side.
pub(crate) fn plated(vehicle: &Vehicle) -> Result<Motion, SimError> {
    let mut states = plateaus(period_s() * PLATES_RAD.len() as f64, |time_s| TruthState {
        time_s,
        steering_wheel_rad: stepped(&PLATES_RAD, time_s),
        wheels: standing(vehicle, 0.0),
        ..level(vehicle)
    });
    complete(vehicle, &mut states)?;
    let plate = |time_s: f64, wheel: Wheel| {
        let row = states.partition_point(|state| state.time_s < time_s);
        let steer_rad = states[row.min(states.len() - 1)].wheels[wheel].steer_rad;
        // Turn plates are read to a tenth of a degree.
        (steer_rad.to_degrees() * 10.0).round() / 10.0
    };
    let marks = (0..PLATES_RAD.len()).map(|k| {
        let [left, right] = [Wheel::FrontLeft, Wheel::FrontRight]
            .map(|wheel| plate(mark_s(k) + 0.5 * REST_S, wheel));
        (mark_s(k), format!("plates {left:.1} {right:.1}"))
    });
    let marks = marks.collect();
    Ok(Motion::new("turn-plates", states)?.with_marks(marks))
}

/// One plateau with the way to it.
fn period_s() -> f64 {
    WAY_S + REST_S
}

/// Where the mark of a plateau stands.
fn mark_s(plateau: usize) -> f64 {
    period_s() * plateau as f64 + WAY_S + 0.2
}

/// The value of a staircase with smooth steps.
fn stepped(values: &[f64], time_s: f64) -> f64 {
    // The cast takes negative numbers to 0.
    let k = ((time_s / period_s()) as usize).min(values.len() - 1);
    let before = if k == 0 { values[0] } else { values[k - 1] };
    before + (values[k] - before) * smooth((time_s - period_s() * k as f64) / WAY_S)
}

fn plateaus(duration_s: f64, state: impl Fn(f64) -> TruthState) -> Vec<TruthState> {
    let rows = (duration_s / STEP_S) as usize;
    (0..=rows).map(|row| state(row as f64 * STEP_S)).collect()
}

fn level(vehicle: &Vehicle) -> TruthState {
    TruthState {
        position_m: [0.0, 0.0, vehicle.body.cg_height_m],
        ..TruthState::default()
    }
}

fn loaded(force_n: [f64; 3]) -> WheelTruth {
    WheelTruth {
        force_n,
        moment_n_m: [0.0; 3],
        angular_speed_rad_s: 0.0,
        slip_angle_rad: 0.0,
        ..WheelTruth::default()
    }
}

/// A plate in a wheel's place, pushed forward and sideways at the hub: no half-shaft feels it.
fn pushed(vehicle: &Vehicle, wheel: Wheel, force_n: [f64; 3]) -> WheelTruth {
    let tyre = &vehicle.axle(wheel).tyre;
    let [x, y, z] = force_n;
    let height_m = tyre.unloaded_radius_m - z / tyre.vertical_stiffness_n_m;
    WheelTruth {
        moment_n_m: [-height_m * y, height_m * x, 0.0],
        ..loaded(force_n)
    }
}

/// The wheels of a vehicle at rest with a load put in.
fn standing(vehicle: &Vehicle, load_kg: f64) -> PerWheel<WheelTruth> {
    let body = &vehicle.body;
    let (a, b) = (body.front_axle_to_cg_m, body.cg_to_rear_axle_m);
    let [x, y] = LOAD_AT_M;
    PerWheel::from_fn(|wheel| {
        let (own, added, track) = if wheel.is_front() {
            (b, b + x, vehicle.front.track_m)
        } else {
            (a, a - x, vehicle.rear.track_m)
        };
        let own_kg = 0.5 * body.mass_kg * own / (a + b);
        let added_kg = load_kg * added / (a + b) * (0.5 + wheel.side() * y / track);
        loaded([0.0, 0.0, (own_kg + added_kg) * STANDARD_GRAVITY_M_S2])
    })
}

fn complete(vehicle: &Vehicle, states: &mut [TruthState]) -> Result<(), SimError> {
    match Linkage::new(vehicle)? {
        Some(linkage) => linkage.complete(states),
        None => Ok(()),
    }
}
