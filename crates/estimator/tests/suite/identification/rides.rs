//! Drives of the four-wheel model as arrays, and sensors' noise on them.

use atvrec_estimator::identification::Drive;
use model::chassis::four_wheel::{Inputs, Parameters, State, outputs};
use model::simulation::Model;
use model::vehicle::Vehicle;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Interval of the drives, s.
pub const DT_S: f64 = 0.01;
/// Steps of the integration in an interval.
const SUBSTEPS: usize = 5;

/// A vehicle with lumped roll and pitch whose every parameter stands in its file.
pub fn vehicle() -> Vehicle {
    Vehicle::builtin("prowler").expect("ships with the program")
}

/// What the model does at a speed held by a driver, under a steer angle of both front wheels.
pub fn drive(
    vehicle: &Vehicle,
    duration_s: f64,
    speed_m_s: impl Fn(f64) -> f64,
    steer_rad: impl Fn(f64) -> f64,
) -> Drive {
    let parameters = Parameters::from_vehicle(vehicle);
    let mut state = State::rolling(speed_m_s(0.0), &parameters);
    let mut drive = Drive {
        dt_s: DT_S,
        ..Drive::default()
    };
    // Velocity is that of the body's point at the centre of gravity, acceleration that of the mass.
    let sway_m = vehicle.body.cg_height_m - vehicle.roll_axis_height_m();
    let mass_sway_m = parameters.sprung_mass_kg / parameters.mass_kg * parameters.roll_arm_m;
    let mut integral = 0.0;
    for row in 0..(duration_s / DT_S) as usize {
        for substep in 0..SUBSTEPS {
            let h = DT_S / SUBSTEPS as f64;
            let time_s = row as f64 * DT_S + substep as f64 * h;
            let steer = steer_rad(time_s);
            let mut inputs = Inputs::coasting();
            inputs.steer_rad = [steer, steer, 0.0, 0.0];
            let error = speed_m_s(time_s) - state.longitudinal_m_s;
            integral += error * h;
            let rate = (speed_m_s(time_s + h) - speed_m_s(time_s)) / h;
            let demand = rate + 2.0 * error + 0.5 * integral;
            let torque = parameters.mass_kg * demand * parameters.rear.rolling_radius_m;
            if torque > 0.0 {
                inputs.drive_n_m = [0.0, 0.0, 0.5 * torque, 0.5 * torque];
            } else {
                inputs.brake_n_m = [-0.3 * torque, -0.3 * torque, -0.2 * torque, -0.2 * torque];
            }
            if substep == 0 {
                let told = outputs(&parameters, &state, &inputs);
                let lateral = state.lateral_m_s - sway_m * state.roll_rate_rad_s;
                drive
                    .speed_m_s
                    .push(math::hypot(state.longitudinal_m_s, lateral));
                drive
                    .sideslip_rad
                    .push(math::atan2(lateral, state.longitudinal_m_s));
                drive.yaw_rate_rad_s.push(state.yaw_rate_rad_s);
                drive
                    .lateral_m_s2
                    .push(told.lateral_m_s2 - mass_sway_m * told.rate.roll_rate_rad_s);
                drive.longitudinal_m_s2.push(told.longitudinal_m_s2);
                let roll_steer = parameters.front.roll_steer * state.roll_rad;
                drive.steer_rad.push(steer + roll_steer);
                drive.roll_rad.push(state.roll_rad);
                drive.pitch_rad.push(state.pitch_rad);
            }
            state = parameters.steps(&state, &inputs, h, 1);
        }
    }
    drive
}

/// A sine of the steer angle at constant speed.
pub fn sine(vehicle: &Vehicle, amplitude_rad: f64, frequency_hz: f64, duration_s: f64) -> Drive {
    drive(
        vehicle,
        duration_s,
        |_| 8.0,
        |t| amplitude_rad * math::sin(std::f64::consts::TAU * frequency_hz * (t - 1.0).max(0.0)),
    )
}

/// A sine of 0.3 Hz of a two-wheel model at constant speed, its tyres linear in the slip angle; no
/// roll angle, and no loads.
pub fn two_wheel_sine(
    vehicle: &Vehicle,
    stiffness_n_rad: [f64; 2],
    amplitude_rad: f64,
    duration_s: f64,
) -> Drive {
    const SPEED_M_S: f64 = 8.0;
    const H: f64 = DT_S / 20.0;
    let body = &vehicle.body;
    let (a, b) = (body.front_axle_to_cg_m, body.cg_to_rear_axle_m);
    let forces_n = |[left_m_s, yaw_rad_s]: [f64; 2], steer_rad: f64| {
        let front_rad = math::atan2(left_m_s + a * yaw_rad_s, SPEED_M_S) - steer_rad;
        let rear_rad = math::atan2(left_m_s - b * yaw_rad_s, SPEED_M_S);
        let front_n = -stiffness_n_rad[0] * front_rad;
        [
            front_n * math::cos(steer_rad),
            -stiffness_n_rad[1] * rear_rad,
        ]
    };
    let mut drive = Drive {
        dt_s: DT_S,
        ..Drive::default()
    };
    let mut state = [0.0_f64; 2];
    for row in 0..(duration_s / DT_S) as usize {
        let time_s = row as f64 * DT_S;
        let steer_rad = amplitude_rad * math::sin(std::f64::consts::TAU * 0.3 * time_s);
        let [front_n, rear_n] = forces_n(state, steer_rad);
        drive.speed_m_s.push(math::hypot(SPEED_M_S, state[0]));
        drive.sideslip_rad.push(math::atan2(state[0], SPEED_M_S));
        drive.yaw_rate_rad_s.push(state[1]);
        drive.lateral_m_s2.push((front_n + rear_n) / body.mass_kg);
        drive.steer_rad.push(steer_rad);
        for _ in 0..20 {
            let [front_n, rear_n] = forces_n(state, steer_rad);
            state[0] += ((front_n + rear_n) / body.mass_kg - state[1] * SPEED_M_S) * H;
            state[1] += (a * front_n - b * rear_n) / body.inertia_kg_m2[2] * H;
        }
    }
    drive
}

/// Random numbers of a test.
pub struct Noise(ChaCha8Rng);

impl Noise {
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// Adds noise that wanders with this correlation time, or is white for zero.
    pub fn spoil(&mut self, values: &mut [f64], sigma: f64, correlation_s: f64) {
        let keep = if correlation_s > 0.0 {
            math::exp(-DT_S / correlation_s)
        } else {
            0.0
        };
        let mut state = self.normal();
        for value in values {
            *value += sigma * state;
            state = keep * state + (1.0 - keep * keep).sqrt() * self.normal();
        }
    }
}

/// The drive as the motion filter tells it from the thesis's sensors: sideslip to 0.14 degrees
/// that wanders over half a second, roll and pitch to 0.05 degrees, white noise of the inertial
/// unit and the steer encoder.
pub fn as_measured(drive: &Drive, steer_offset_rad: f64, seed: u64) -> Drive {
    let mut noise = Noise::new(seed);
    let mut measured = drive.clone();
    noise.spoil(&mut measured.sideslip_rad, 0.14_f64.to_radians(), 0.5);
    noise.spoil(&mut measured.speed_m_s, 0.02, 0.5);
    noise.spoil(&mut measured.yaw_rate_rad_s, 0.008, 0.0);
    noise.spoil(&mut measured.lateral_m_s2, 0.08, 0.0);
    noise.spoil(&mut measured.longitudinal_m_s2, 0.08, 0.0);
    noise.spoil(&mut measured.roll_rad, 0.05_f64.to_radians(), 0.5);
    noise.spoil(&mut measured.pitch_rad, 0.05_f64.to_radians(), 0.5);
    noise.spoil(&mut measured.steer_rad, 0.1_f64.to_radians(), 0.0);
    for steer in &mut measured.steer_rad {
        *steer += steer_offset_rad;
    }
    measured
}
