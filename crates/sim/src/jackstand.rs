//! The jackstand run of the thesis's section 3.5, by its geometry alone: wheels hanging, front
//! lowered, rear lowered, at rest, rolled forward so that the tyres let go of their scrub, and the
//! steering wheel turned to either side.

use model::vehicle::Vehicle;
use nalgebra::Vector3;
use sample::{PerWheel, STANDARD_GRAVITY_M_S2, Wheel};

use crate::linkage::{ATTITUDE_ROUNDS, Linkage};
use crate::truth::fill_missing;
use crate::{SimError, TruthState, WheelTruth};

const DURATION_S: f64 = 40.0;
const STEP_S: f64 = 0.005;
/// How high the jackstands hold the body, m.
const LIFT_M: f64 = 0.15;
/// When (s) and for how long each axle, front and rear, is lowered.
const LOWERED_S: [[f64; 2]; 2] = [[6.0, 4.0], [10.0, 4.0]];
/// The part of its lowering at which a wheel touches the ground.
const TOUCH: f64 = 0.45;
/// Side force that tyres which were lowered without rolling hold, N.
const SCRUB_N: f64 = 700.0;
/// When, for how long and how far the vehicle is rolled.
const ROLLED_S: [f64; 2] = [18.0, 4.0];
const ROLLED_M: f64 = 2.0;
/// Distance over which rolling tyres let go of a side force, m.
const RELAXATION_M: f64 = 0.4;
/// When the steering wheel begins to turn, how long a swing to one side takes, and how far it goes.
const STEERED_S: f64 = 25.0;
const SWING_S: f64 = 5.0;
const SWING_RAD: f64 = 2.0;

/// The states of the run. With hard-points the body stands as its springs and linkage hold it.
pub(crate) fn states(vehicle: &Vehicle) -> Result<Vec<TruthState>, SimError> {
    let rows = (DURATION_S / STEP_S) as usize;
    let mut states: Vec<_> = (0..=rows)
        .map(|row| state(vehicle, row as f64 * STEP_S))
        .collect();
    differentiate(&mut states);
    if let Some(linkage) = Linkage::new(vehicle)? {
        for _ in 0..ATTITUDE_ROUNDS {
            linkage.balance(&mut states)?;
            for state in &mut states {
                stand(&linkage, vehicle.body.cg_height_m, state)?;
            }
            differentiate(&mut states);
        }
    }
    Ok(states)
}

/// Puts the body where its wheels stand or hang.
fn stand(linkage: &Linkage, cg_height_m: f64, state: &mut TruthState) -> Result<(), SimError> {
    let time_s = state.time_s;
    let clearance = |wheel: Wheel| Some(clearance_m(time_s, usize::from(!wheel.is_front())));
    if let Some(plane) = linkage.ground(state, clearance)? {
        [state.roll_rad, state.pitch_rad] = plane.body_roll_pitch_rad();
        state.position_m[2] = (cg_height_m - plane.height_m) * plane.normal.z;
    }
    Ok(())
}

/// How high the wheels of an axle hang above the ground.
fn clearance_m(time_s: f64, axle: usize) -> f64 {
    let [start_s, length_s] = LOWERED_S[axle];
    LIFT_M * (1.0 - ramp(time_s, [start_s, TOUCH * length_s]))
}

/// Place, attitude and forces at a time; their derivatives come later.
fn state(vehicle: &Vehicle, time_s: f64) -> TruthState {
    let body = &vehicle.body;
    let (a, b) = (body.front_axle_to_cg_m, body.cg_to_rear_axle_m);
    let height_m = [0, 1].map(|axle| clearance_m(time_s, axle));
    let rolled_m = ROLLED_M * ramp(time_s, ROLLED_S);
    let wheel = |wheel: Wheel| {
        let axle = usize::from(!wheel.is_front());
        let [start_s, length_s] = LOWERED_S[axle];
        let touch_s = start_s + TOUCH * length_s;
        let pressed = ramp(time_s, [touch_s, (1.0 - TOUCH) * length_s]);
        let load_n = vehicle.static_load_n(wheel) * pressed;
        let scrub_n = -wheel.side() * SCRUB_N * pressed * math::exp(-rolled_m / RELAXATION_M);
        WheelTruth {
            force_n: [0.0, scrub_n, load_n],
            moment_n_m: [0.0; 3],
            slip_angle_rad: 0.0,
            ..WheelTruth::default()
        }
    };
    let height_at_cg_m = (height_m[0] * b + height_m[1] * a) / (a + b);
    TruthState {
        time_s,
        position_m: [rolled_m, 0.0, body.cg_height_m + height_at_cg_m],
        pitch_rad: math::asin((height_m[1] - height_m[0]) / (a + b)),
        steering_wheel_rad: swing(time_s - STEERED_S),
        wheels: PerWheel::from_fn(wheel),
        ..TruthState::default()
    }
}

/// Velocity, rates, accelerations and wheel speed as difference quotients of place and attitude.
/// Only pitch turns.
fn differentiate(states: &mut [TruthState]) {
    let central = |states: &[TruthState], row: usize, value: &dyn Fn(&TruthState) -> f64| {
        let (before, after) = (row.saturating_sub(1), (row + 1).min(states.len() - 1));
        (value(&states[after]) - value(&states[before]))
            / (states[after].time_s - states[before].time_s)
    };
    let earth: Vec<[f64; 3]> = (0..states.len())
        .map(|row| std::array::from_fn(|axis| central(states, row, &|s| s.position_m[axis])))
        .collect();
    for row in 0..states.len() {
        let (before, after) = (row.saturating_sub(1), (row + 1).min(states.len() - 1));
        let span_s = states[after].time_s - states[before].time_s;
        states[row].rate_derivative_rad_s2 = [f64::NAN; 3];
        states[row].acceleration_m_s2 = [f64::NAN; 3];
        let pitch_rate = central(states, row, &|s| s.pitch_rad);
        let force: [f64; 3] = std::array::from_fn(|axis| {
            let gravity = if axis == 2 {
                STANDARD_GRAVITY_M_S2
            } else {
                0.0
            };
            (earth[after][axis] - earth[before][axis]) / span_s + gravity
        });
        let body_from_earth = states[row].earth_from_body().inverse();
        let turn = |v: [f64; 3]| (body_from_earth * Vector3::from(v)).into();
        let state = &mut states[row];
        state.velocity_body_m_s = turn(earth[row]);
        state.specific_force_m_s2 = turn(force);
        state.rate_rad_s = [0.0, pitch_rate, 0.0];
        for wheel in &mut state.wheels.0 {
            // A rolling radius of about 0.3 m: only the wheel-speed channel notices.
            wheel.angular_speed_rad_s = earth[row][0] / 0.305;
        }
    }
    fill_missing(states);
}

/// From 0 before a span (start, length) to 1 after it.
fn ramp(time_s: f64, [start_s, length_s]: [f64; 2]) -> f64 {
    smooth((time_s - start_s) / length_s)
}

/// The polynomial of fifth order from 0 at 0 to 1 at 1 with vanishing first and second derivatives
/// at both ends.
pub(crate) fn smooth(part: f64) -> f64 {
    let x = part.clamp(0.0, 1.0);
    x * x * x * (10.0 + x * (6.0 * x - 15.0))
}

/// To the left, to the right, and back to the middle.
fn swing(time_s: f64) -> f64 {
    let to = |at: f64| smooth((time_s - at) / (0.4 * SWING_S));
    SWING_RAD * (to(0.0) - 2.0 * to(SWING_S) + to(2.0 * SWING_S))
}
