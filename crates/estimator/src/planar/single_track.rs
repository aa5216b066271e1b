//! The single-track model: forces, rates and their slopes.

use model::vehicle::Vehicle;
use nalgebra::{SMatrix, SVector};
use sample::STANDARD_GRAVITY_M_S2;

use super::{
    BANK, Handling, Innovation, LATERAL, PlanarInput, PlanarState, SLIP, SPEED_MIN_M_S, STATES,
    STEER, YAW_RATE, normalised_force,
};

use crate::tuning::PlanarTuning;

/// Parameters of the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarModel {
    pub(super) tuning: PlanarTuning,
    pub(super) handling: Handling,
    pub(super) mass_kg: f64,
    pub(super) front_m: f64,
    pub(super) rear_m: f64,
    pub(super) imu_ahead_m: f64,
}

/// Forces of both axles with their slopes over the slip angle.
#[derive(Clone, Copy, Debug)]
pub(super) struct AxleForces {
    pub force_n: [f64; 2],
    pub slope_n_rad: [f64; 2],
    pub steer_cosine: f64,
}

impl PlanarModel {
    /// A vehicle with this handling; `imu_ahead_m` is the inertial unit's distance ahead of the
    /// centre of gravity.
    #[must_use]
    pub fn new(
        vehicle: &Vehicle,
        handling: Handling,
        imu_ahead_m: f64,
        tuning: &PlanarTuning,
    ) -> Self {
        let body = &vehicle.body;
        Self {
            tuning: *tuning,
            handling,
            mass_kg: body.mass_kg,
            front_m: body.front_axle_to_cg_m,
            rear_m: body.cg_to_rear_axle_m,
            imu_ahead_m,
        }
    }

    pub(super) fn driven(&self, input: &PlanarInput) -> Driven {
        Driven {
            speed_m_s: input.speed_m_s.max(SPEED_MIN_M_S),
            steer_rad: self.handling.steer_gain * input.steer_rad,
            grip_n: self.grip_n(input.acceleration_m_s2),
        }
    }

    /// Result for a state at the instant of `input`.
    pub(super) fn result(
        &self,
        state: &SVector<f64, STATES>,
        covariance: &SMatrix<f64, STATES, STATES>,
        input: &PlanarInput,
    ) -> PlanarState {
        let driven = self.driven(input);
        let forces = self.forces(state, &driven);
        let [(side, _), _] = self.pushed(&forces);
        let rolls = input.speed_m_s >= SPEED_MIN_M_S;
        let across = state[LATERAL] - self.rear_m * state[YAW_RATE];
        PlanarState {
            lateral_m_s: state[LATERAL],
            lateral_sigma_m_s: covariance[(LATERAL, LATERAL)].max(0.0).sqrt(),
            yaw_rate_rad_s: state[YAW_RATE],
            acceleration_m_s2: if rolls { side } else { 0.0 },
            steer_rad: driven.steer_rad + state[STEER],
            rear_slip_rad: -math::atan(across / driven.speed_m_s),
            force_n: if rolls { forces.force_n } else { [f64::NAN; 2] },
            innovations: [Innovation::NONE; 2],
        }
    }

    /// Lateral capacity of each axle, N, at this longitudinal acceleration.
    pub(super) fn grip_n(&self, acceleration_m_s2: f64) -> [f64; 2] {
        let h = &self.handling;
        let length = self.front_m + self.rear_m;
        let weight = self.mass_kg * STANDARD_GRAVITY_M_S2 / length;
        let ahead_n = self.mass_kg * acceleration_m_s2;
        let transfer = ahead_n * h.load_transfer_height_m / length;
        let split = if ahead_n > 0.0 {
            h.drive_split_front
        } else {
            h.brake_split_front
        };
        let axle = |friction: f64, still_n: f64, transfer_n: f64, part: f64| {
            let whole = friction * (still_n + transfer_n).max(self.tuning.load_min_part * still_n);
            let used = (part * ahead_n / whole)
                .powi(2)
                .min(self.tuning.longitudinal_square_max);
            whole * (1.0 - used).sqrt()
        };
        [
            axle(h.front_friction, weight * self.rear_m, -transfer, split),
            axle(
                h.rear_friction,
                weight * self.front_m,
                transfer,
                1.0 - split,
            ),
        ]
    }

    pub(super) fn forces(&self, state: &SVector<f64, STATES>, input: &Driven) -> AxleForces {
        let h = &self.handling;
        let stiffness = [h.front_stiffness_n_rad, h.rear_stiffness_n_rad];
        let shape = [h.front_shape, h.rear_shape];
        let (mut force_n, mut slope_n_rad) = ([0.0; 2], [0.0; 2]);
        for axle in 0..2 {
            let most = input.grip_n[axle];
            let slip = state[SLIP[axle]];
            let (value, slope) = normalised_force(stiffness[axle] * slip / most, shape[axle]);
            force_n[axle] = most * value;
            slope_n_rad[axle] = stiffness[axle] * slope;
        }
        AxleForces {
            force_n,
            slope_n_rad,
            steer_cosine: math::cos(input.steer_rad + state[STEER]),
        }
    }

    /// Derivatives of lateral velocity and yaw rate as the tyres give them, and their slopes over
    /// the states.
    pub(super) fn pushed(&self, forces: &AxleForces) -> [(f64, SVector<f64, STATES>); 2] {
        let c = forces.steer_cosine;
        let [front, rear] = [forces.force_n[0] * c, forces.force_n[1]];
        let [kf, kr] = [forces.slope_n_rad[0] * c, forces.slope_n_rad[1]];
        let (a, b) = (self.front_m, self.rear_m);
        let (m, inertia) = (self.mass_kg, self.handling.yaw_inertia_kg_m2);
        let mut side = SVector::<f64, STATES>::zeros();
        let mut turn = SVector::<f64, STATES>::zeros();
        (side[SLIP[0]], side[SLIP[1]]) = (kf / m, kr / m);
        (turn[SLIP[0]], turn[SLIP[1]]) = (a * kf / inertia, -b * kr / inertia);
        [
            ((front + rear) / m, side),
            ((a * front - b * rear) / inertia, turn),
        ]
    }

    /// Derivatives of all states, and their slopes.
    pub(super) fn rates(
        &self,
        state: &SVector<f64, STATES>,
        input: &Driven,
    ) -> (SVector<f64, STATES>, SMatrix<f64, STATES, STATES>) {
        let v = input.speed_m_s;
        let [(side, side_slope), (turn, turn_slope)] = self.pushed(&self.forces(state, input));
        let mut rate = SVector::<f64, STATES>::zeros();
        let mut slope = SMatrix::<f64, STATES, STATES>::zeros();
        slope.set_row(LATERAL, &side_slope.transpose());
        slope.set_row(YAW_RATE, &turn_slope.transpose());
        rate[LATERAL] = side - v * state[YAW_RATE] + state[BANK];
        slope[(LATERAL, YAW_RATE)] = -v;
        slope[(LATERAL, BANK)] = 1.0;
        rate[YAW_RATE] = turn;
        rate[BANK] = -state[BANK] / self.tuning.bank_time_s;
        slope[(BANK, BANK)] = -1.0 / self.tuning.bank_time_s;
        let lag = v / self.handling.relaxation_length_m;
        let steer = input.steer_rad + state[STEER];
        for (i, steer, arm) in [(SLIP[0], steer, self.front_m), (SLIP[1], 0.0, -self.rear_m)] {
            let drift = (state[LATERAL] + arm * state[YAW_RATE]) / v;
            rate[i] = lag * (steer - math::atan(drift) - state[i]);
            let over = lag / (v * (1.0 + drift * drift));
            slope[(i, LATERAL)] = -over;
            slope[(i, YAW_RATE)] = -arm * over;
            slope[(i, i)] = -lag;
        }
        slope[(SLIP[0], STEER)] = lag;
        (rate, slope)
    }
}

/// Inputs of the model in one step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Driven {
    pub speed_m_s: f64,
    pub steer_rad: f64,
    pub grip_n: [f64; 2],
}
