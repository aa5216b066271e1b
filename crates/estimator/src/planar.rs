//! Sideslip of a vehicle that is described by masses and lengths alone: a single-track model with
//! saturating tyres, corrected by yaw rate and lateral acceleration.
//!
//! The model is driven by the measured speed v and steer angle d (road wheels). With the slip
//! angles a_f = d - atan((v_y + a r)/v), a_r = -atan((v_y - b r)/v) and the axle forces of
//! `tyre`,
//!
//! ```text
//! m (v_y' + v r) = F_f cos d + F_r + m g_b      I_z r' = a F_f cos d - b F_r
//! ```
//!
//! (Mitschke and Wallentowitz, Dynamik der Kraftfahrzeuge, single-track model; axle loads with the
//! longitudinal load transfer m a_x h/(a + b)). g_b, a first-order Gauss-Markov process, is what a
//! banked road and whatever the model leaves out add. Steer, yaw rate and lateral acceleration have
//! offsets, which are states too. Tyre parameters do not wander: they come from the calibration
//! (see [`crate::identification::handling`]) or from the vehicle file.
//!
//! The accelerometer reads k (F_f cos d + F_r)/m + x r' + offset: k holds the part of gravity that a
//! rolling body adds, x is the unit's distance ahead of the centre of gravity.

mod input;
mod live;
mod tyre;

use model::vehicle::{Axle, Vehicle};
use nalgebra::{SMatrix, SVector};
use sample::STANDARD_GRAVITY_M_S2;
use serde::{Deserialize, Serialize};

pub use input::{PlanarInput, PlanarReadings};
pub use live::{Planar, PlanarMotion, PlanarRecorder};
pub use tyre::{SHAPE_RANGE, normalised_force};

/// Number of states.
pub const STATES: usize = 6;
/// Leftward velocity of the centre of gravity, m/s.
const LATERAL: usize = 0;
/// Yaw rate, rad/s.
const YAW_RATE: usize = 1;
/// What is to be added to the measured road-wheel angle, rad.
const STEER: usize = 2;
/// What the gyro reads too much, rad/s.
const GYRO: usize = 3;
/// What the accelerometer reads too much, m/s^2.
const ACCEL: usize = 4;
/// Lateral acceleration that no tyre gives, m/s^2.
const BANK: usize = 5;

/// Speed below which tyres hardly slip and the model is stiff, m/s.
pub const SPEED_MIN_M_S: f64 = 3.0;
/// Speed below which the vehicle stands, m/s.
const STANDSTILL_M_S: f64 = 0.2;
/// Steps of the integration in one step of the filter.
const SUBSTEPS: usize = 2;
/// Correlation time of [`BANK`], s, and its standard deviation, m/s^2: 2 degrees of bank.
const BANK_TIME_S: f64 = 3.0;
const BANK_SIGMA_M_S2: f64 = 0.35;
/// Spectral densities of the forces that the model leaves out: m/s per root second, and rad/s.
const LATERAL_NOISE: f64 = 0.05;
const YAW_NOISE: f64 = 0.03;
/// Walk of the offsets: rad, rad/s and m/s^2 per root second.
const OFFSET_WALK: [f64; 3] = [1e-6, 1e-6, 1e-3];
/// Standard deviations of the offsets before anything is known, and after a calibration.
const OFFSET_SIGMA: [f64; 3] = [0.01, 0.01, 0.2];
const OFFSET_SIGMA_CALIBRATED: [f64; 3] = [0.001, 0.0005, 0.05];
/// Floor of the measurements' deviations: rad/s, and m/s^2 for what vibration and the model's
/// errors add.
const MEASURED_SIGMA_MIN: [f64; 2] = [0.002, 0.1];
/// Part of the lateral acceleration that the model's errors are taken to be.
const MODEL_ERROR: f64 = 0.03;
/// Innovation, standard deviations, from which a value counts less than its noise says.
const HUBER: f64 = 3.0;
/// A step longer than this is a gap, behind which the motion is unknown, s.
const GAP_S: f64 = 0.5;
/// Standard deviation of a wheel's slip at walking pace, m/s.
const SLOW_SIGMA_M_S: f64 = 0.1;

/// How a vehicle handles: what [`crate::identification::handling`] finds, as it stands in a
/// calibration file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Handling {
    /// Cornering stiffness of the front axle at its static load, steering and suspension included,
    /// N/rad.
    pub front_stiffness_n_rad: f64,
    /// The same of the rear axle, N/rad.
    pub rear_stiffness_n_rad: f64,
    /// Greatest lateral force of the front axle over its load.
    pub front_friction: f64,
    /// The same of the rear axle.
    pub rear_friction: f64,
    /// Shape n of the tyre curve x/(1 + |x|^n)^(1/n).
    pub shape: f64,
    /// Yaw inertia, kg m^2.
    pub yaw_inertia_kg_m2: f64,
    /// What the accelerometer reads over the lateral acceleration: above 1, as the body rolls.
    pub roll_gain: f64,
    /// Road-wheel angle over the angle that the vehicle file's steering ratio gives.
    pub steer_gain: f64,
}

impl Handling {
    /// What the vehicle file alone tells.
    #[must_use]
    pub fn of_vehicle(vehicle: &Vehicle) -> Self {
        let body = &vehicle.body;
        let (a, b) = (body.front_axle_to_cg_m, body.cg_to_rear_axle_m);
        let weight = body.mass_kg * STANDARD_GRAVITY_M_S2 / (a + b);
        let stiffness = |axle: &Axle, load_n: f64| {
            let tyre = &axle.tyre;
            let ratio = 0.5 * load_n / tyre.reference_load_n;
            2.0 * tyre.cornering_stiffness_n_rad * ratio.powf(tyre.load_exponent)
        };
        let roll: f64 = [&vehicle.front, &vehicle.rear]
            .iter()
            .map(|axle| axle.roll_stiffness_n_m_rad)
            .sum();
        let arm = body.cg_height_m
            - (vehicle.front.roll_centre_height_m * b + vehicle.rear.roll_centre_height_m * a)
                / (a + b);
        let moment = body.mass_kg * arm.max(0.0);
        let left = (roll - moment * STANDARD_GRAVITY_M_S2)
            .max(0.2 * roll)
            .max(1.0);
        Self {
            front_stiffness_n_rad: stiffness(&vehicle.front, weight * b),
            rear_stiffness_n_rad: stiffness(&vehicle.rear, weight * a),
            front_friction: vehicle.front.tyre.friction,
            rear_friction: vehicle.rear.tyre.friction,
            shape: 2.5,
            yaw_inertia_kg_m2: body.inertia_kg_m2[2],
            roll_gain: 1.0 + STANDARD_GRAVITY_M_S2 * moment / left,
            steer_gain: 1.0,
        }
    }

    /// Name and value of the first member that no vehicle has.
    #[must_use]
    pub fn implausible(&self) -> Option<(&'static str, f64)> {
        [
            (
                "front_stiffness_n_rad",
                self.front_stiffness_n_rad,
                1e2,
                1e7,
            ),
            ("rear_stiffness_n_rad", self.rear_stiffness_n_rad, 1e2, 1e7),
            ("front_friction", self.front_friction, 0.05, 5.0),
            ("rear_friction", self.rear_friction, 0.05, 5.0),
            ("shape", self.shape, SHAPE_RANGE[0], SHAPE_RANGE[1]),
            ("yaw_inertia_kg_m2", self.yaw_inertia_kg_m2, 1.0, 1e7),
            ("roll_gain", self.roll_gain, 0.5, 2.0),
            ("steer_gain", self.steer_gain, 0.2, 5.0),
        ]
        .into_iter()
        .find(|(_, value, least, most)| !(*least..=*most).contains(value))
        .map(|(name, value, _, _)| (name, value))
    }
}

/// Everything that the model is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarModel {
    handling: Handling,
    mass_kg: f64,
    front_m: f64,
    rear_m: f64,
    cg_height_m: f64,
    imu_ahead_m: f64,
}

/// Forces of both axles with their slopes over the slip angle.
#[derive(Clone, Copy, Debug)]
struct AxleForces {
    force_n: [f64; 2],
    slope_n_rad: [f64; 2],
    steer_cosine: f64,
}

impl PlanarModel {
    /// A vehicle that handles like this; `imu_ahead_m` is the inertial unit's distance ahead of the
    /// centre of gravity.
    #[must_use]
    pub fn new(vehicle: &Vehicle, handling: Handling, imu_ahead_m: f64) -> Self {
        let body = &vehicle.body;
        Self {
            handling,
            mass_kg: body.mass_kg,
            front_m: body.front_axle_to_cg_m,
            rear_m: body.cg_to_rear_axle_m,
            cg_height_m: body.cg_height_m,
            imu_ahead_m,
        }
    }

    /// Loads of both axles, N, at this longitudinal acceleration; none falls below a tenth.
    fn loads_n(&self, acceleration_m_s2: f64) -> [f64; 2] {
        let length = self.front_m + self.rear_m;
        let weight = self.mass_kg * STANDARD_GRAVITY_M_S2 / length;
        let transfer = self.mass_kg * acceleration_m_s2 * self.cg_height_m / length;
        let [front, rear] = [weight * self.rear_m, weight * self.front_m];
        [
            (front - transfer).max(0.1 * front),
            (rear + transfer).max(0.1 * rear),
        ]
    }

    fn forces(&self, state: &SVector<f64, STATES>, input: &Driven) -> AxleForces {
        let h = &self.handling;
        let steer = input.steer_rad + state[STEER];
        let (v, lateral, yaw) = (input.speed_m_s, state[LATERAL], state[YAW_RATE]);
        let slip = [
            steer - ((lateral + self.front_m * yaw) / v).atan(),
            -((lateral - self.rear_m * yaw) / v).atan(),
        ];
        let stiffness = [h.front_stiffness_n_rad, h.rear_stiffness_n_rad];
        let friction = [h.front_friction, h.rear_friction];
        let (mut force_n, mut slope_n_rad) = ([0.0; 2], [0.0; 2]);
        for axle in 0..2 {
            let most = friction[axle] * input.loads_n[axle];
            let (value, slope) = normalised_force(stiffness[axle] * slip[axle] / most, h.shape);
            force_n[axle] = most * value;
            slope_n_rad[axle] = stiffness[axle] * slope;
        }
        AxleForces {
            force_n,
            slope_n_rad,
            steer_cosine: steer.cos(),
        }
    }

    /// Derivatives of lateral velocity and yaw rate, without the bank, and their slopes over the
    /// states.
    fn motion(&self, forces: &AxleForces, speed_m_s: f64) -> [(f64, SVector<f64, STATES>); 2] {
        let [front, rear] = forces.force_n;
        let c = forces.steer_cosine;
        let [kf, kr] = forces.slope_n_rad;
        let (a, b, v) = (self.front_m, self.rear_m, speed_m_s);
        let (m, inertia) = (self.mass_kg, self.handling.yaw_inertia_kg_m2);
        let mut side = SVector::<f64, STATES>::zeros();
        side[LATERAL] = -(kf * c + kr) / (m * v);
        side[YAW_RATE] = -(kf * c * a - kr * b) / (m * v);
        side[STEER] = kf * c / m;
        let mut turn = SVector::<f64, STATES>::zeros();
        turn[LATERAL] = -(kf * c * a - kr * b) / (inertia * v);
        turn[YAW_RATE] = -(kf * c * a * a + kr * b * b) / (inertia * v);
        turn[STEER] = kf * c * a / inertia;
        [
            ((front * c + rear) / m, side),
            ((a * front * c - b * rear) / inertia, turn),
        ]
    }
}

/// What drives the model in one step.
#[derive(Clone, Copy, Debug)]
struct Driven {
    speed_m_s: f64,
    steer_rad: f64,
    loads_n: [f64; 2],
}

/// Noise of the measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarNoise {
    /// Of the yaw rate, rad/s.
    pub yaw_rate_rad_s: f64,
    /// Of the lateral acceleration, m/s^2.
    pub acceleration_m_s2: f64,
}

/// The filter.
#[derive(Clone, Debug)]
pub struct PlanarFilter {
    model: PlanarModel,
    noise: PlanarNoise,
    offset_sigma: [f64; 3],
    state: SVector<f64, STATES>,
    covariance: SMatrix<f64, STATES, STATES>,
    acceleration_m_s2: f64,
    resets: u64,
}

/// What one step found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarState {
    /// Leftward velocity of the centre of gravity, m/s.
    pub lateral_m_s: f64,
    /// Its standard deviation, m/s.
    pub lateral_sigma_m_s: f64,
    /// Yaw rate, rad/s.
    pub yaw_rate_rad_s: f64,
    /// Lateral acceleration that the tyres give, m/s^2.
    pub acceleration_m_s2: f64,
    /// Road-wheel angle, offset and gain taken into account, rad.
    pub steer_rad: f64,
    /// Slip angle of the rear axle, rad.
    pub rear_slip_rad: f64,
    /// Lateral force of each axle, N.
    pub force_n: [f64; 2],
    /// Innovations of yaw rate (rad/s) and lateral acceleration (m/s^2).
    pub innovations: [Innovation; 2],
}

/// What a measurement differed from its prediction by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation {
    /// Measured less predicted; `NaN` where nothing was measured.
    pub value: f64,
    /// The standard deviation that the filter expected of it.
    pub sigma: f64,
}

impl Innovation {
    const NONE: Self = Self {
        value: f64::NAN,
        sigma: f64::NAN,
    };
}

impl PlanarFilter {
    /// A filter that has seen nothing. `calibrated` says that offsets were taken off already.
    #[must_use]
    pub fn new(model: PlanarModel, noise: PlanarNoise, calibrated: bool) -> Self {
        let mut filter = Self {
            model,
            noise: PlanarNoise {
                yaw_rate_rad_s: noise.yaw_rate_rad_s.max(MEASURED_SIGMA_MIN[0]),
                acceleration_m_s2: noise.acceleration_m_s2.max(MEASURED_SIGMA_MIN[1]),
            },
            offset_sigma: if calibrated {
                OFFSET_SIGMA_CALIBRATED
            } else {
                OFFSET_SIGMA
            },
            state: SVector::zeros(),
            covariance: SMatrix::zeros(),
            acceleration_m_s2: 0.0,
            resets: 0,
        };
        filter.forget();
        filter
    }

    /// How often the filter diverged and was started anew.
    #[must_use]
    pub fn resets(&self) -> u64 {
        self.resets
    }

    /// Offsets of steer (rad, to be added), yaw rate (rad/s, read too much) and lateral
    /// acceleration (m/s^2, read too much).
    #[must_use]
    pub fn offsets(&self) -> [f64; 3] {
        [STEER, GYRO, ACCEL].map(|i| self.state[i])
    }

    fn forget(&mut self) {
        self.state = SVector::zeros();
        let [steer, gyro, accel] = self.offset_sigma.map(|sigma| sigma * sigma);
        let bank = BANK_SIGMA_M_S2 * BANK_SIGMA_M_S2;
        let diagonal = [0.1, 0.003, steer, gyro, accel, bank];
        self.covariance = SMatrix::from_diagonal(&SVector::from(diagonal));
    }

    /// Motion is unknown, offsets stay.
    fn forget_motion(&mut self) {
        for (i, variance) in [
            (LATERAL, 0.1),
            (YAW_RATE, 0.003),
            (BANK, BANK_SIGMA_M_S2 * BANK_SIGMA_M_S2),
        ] {
            self.state[i] = 0.0;
            self.decouple(i, variance);
        }
    }

    fn decouple(&mut self, i: usize, variance: f64) {
        for j in 0..STATES {
            self.covariance[(i, j)] = 0.0;
            self.covariance[(j, i)] = 0.0;
        }
        self.covariance[(i, i)] = variance;
    }

    /// Carries the filter on by `dt_s` to the instant of `input` and takes its measurements in.
    /// Behind a gap the motion is found anew.
    pub fn step(&mut self, dt_s: f64, input: &PlanarInput) -> PlanarState {
        self.acceleration_m_s2 = input.acceleration_m_s2;
        let mut innovations = [Innovation::NONE; 2];
        if input.speed_m_s < SPEED_MIN_M_S {
            self.roll_slowly(input);
        } else {
            let driven = self.driven(input);
            if (0.0..GAP_S).contains(&dt_s) {
                for _ in 0..SUBSTEPS {
                    self.predict(dt_s / SUBSTEPS as f64, &driven);
                }
            } else {
                self.forget_motion();
            }
            innovations = self.correct(&driven, input);
        }
        if !self.is_sound(input.speed_m_s) {
            self.forget();
            self.resets += 1;
        }
        self.tell(input, innovations)
    }

    fn driven(&self, input: &PlanarInput) -> Driven {
        Driven {
            speed_m_s: input.speed_m_s.max(SPEED_MIN_M_S),
            steer_rad: self.model.handling.steer_gain * input.steer_rad,
            loads_n: self.model.loads_n(self.acceleration_m_s2),
        }
    }

    /// Tyres roll where they point; a standing vehicle shows the gyro's offset.
    fn roll_slowly(&mut self, input: &PlanarInput) {
        if let Some(rate) = input.yaw_rate_rad_s {
            if input.speed_m_s.abs() < STANDSTILL_M_S {
                let mut h = SVector::<f64, STATES>::zeros();
                h[GYRO] = 1.0;
                let variance = self.noise.yaw_rate_rad_s.powi(2);
                let _ = self.scalar(&h, rate - self.state[GYRO], variance);
            }
            self.state[YAW_RATE] = rate - self.state[GYRO];
        }
        self.state[LATERAL] = self.model.rear_m * self.state[YAW_RATE];
        for (i, variance) in [
            (LATERAL, SLOW_SIGMA_M_S.powi(2)),
            (YAW_RATE, self.noise.yaw_rate_rad_s.powi(2)),
        ] {
            self.decouple(i, variance);
        }
    }

    fn predict(&mut self, dt: f64, driven: &Driven) {
        let forces = self.model.forces(&self.state, driven);
        let v = driven.speed_m_s;
        let [(side, side_slope), (turn, turn_slope)] = self.model.motion(&forces, v);
        let mut slope = SMatrix::<f64, STATES, STATES>::zeros();
        slope.set_row(LATERAL, &side_slope.transpose());
        slope.set_row(YAW_RATE, &turn_slope.transpose());
        slope[(LATERAL, YAW_RATE)] -= v;
        slope[(LATERAL, BANK)] = 1.0;
        slope[(BANK, BANK)] = -1.0 / BANK_TIME_S;
        let mut rate = SVector::<f64, STATES>::zeros();
        rate[LATERAL] = side - v * self.state[YAW_RATE] + self.state[BANK];
        rate[YAW_RATE] = turn;
        rate[BANK] = -self.state[BANK] / BANK_TIME_S;
        self.state += rate * dt + slope * rate * (0.5 * dt * dt);
        let transition = SMatrix::identity() + slope * dt + slope * slope * (0.5 * dt * dt);
        self.covariance = transition * self.covariance * transition.transpose();
        let noise = [
            LATERAL_NOISE,
            YAW_NOISE,
            OFFSET_WALK[0],
            OFFSET_WALK[1],
            OFFSET_WALK[2],
            BANK_SIGMA_M_S2 * (2.0 / BANK_TIME_S).sqrt(),
        ];
        for (i, density) in noise.into_iter().enumerate() {
            self.covariance[(i, i)] += density * density * dt;
        }
    }

    fn correct(&mut self, driven: &Driven, input: &PlanarInput) -> [Innovation; 2] {
        let mut innovations = [Innovation::NONE; 2];
        if let Some(rate) = input.yaw_rate_rad_s {
            let mut h = SVector::<f64, STATES>::zeros();
            h[YAW_RATE] = 1.0;
            h[GYRO] = 1.0;
            let residual = rate - self.state[YAW_RATE] - self.state[GYRO];
            innovations[0] = self.scalar(&h, residual, self.noise.yaw_rate_rad_s.powi(2));
        }
        if let Some(measured) = input.lateral_m_s2 {
            let forces = self.model.forces(&self.state, driven);
            let [(side, side_slope), (turn, turn_slope)] =
                self.model.motion(&forces, driven.speed_m_s);
            let gain = self.model.handling.roll_gain;
            let ahead = self.model.imu_ahead_m;
            let mut h = side_slope * gain + turn_slope * ahead;
            h[ACCEL] = 1.0;
            let residual = measured - gain * side - ahead * turn - self.state[ACCEL];
            let doubt = self.noise.acceleration_m_s2.powi(2) + (MODEL_ERROR * side).powi(2);
            innovations[1] = self.scalar(&h, residual, doubt);
        }
        innovations
    }

    /// One scalar value; beyond [`HUBER`] deviations its noise is taken for as much larger.
    fn scalar(&mut self, h: &SVector<f64, STATES>, residual: f64, variance: f64) -> Innovation {
        let ph = self.covariance * h;
        let spread = h.dot(&ph);
        let normalised = residual / (spread + variance).sqrt();
        let excess = (normalised.abs() / HUBER).max(1.0);
        let total = spread + variance * excess * excess;
        if !normalised.is_finite() || total <= 0.0 {
            return Innovation::NONE;
        }
        self.state += ph * (residual / total);
        self.covariance -= ph * ph.transpose() / total;
        self.covariance = (self.covariance + self.covariance.transpose()) * 0.5;
        Innovation {
            value: residual,
            sigma: (spread + variance).sqrt(),
        }
    }

    fn is_sound(&self, speed_m_s: f64) -> bool {
        self.state.iter().all(|x| x.is_finite())
            && (0..STATES).all(|i| self.covariance[(i, i)] > 0.0)
            && self.state[LATERAL].abs() < 2.0 * speed_m_s.abs() + 2.0
    }

    fn tell(&self, input: &PlanarInput, innovations: [Innovation; 2]) -> PlanarState {
        let driven = self.driven(input);
        let forces = self.model.forces(&self.state, &driven);
        let [(side, _), _] = self.model.motion(&forces, driven.speed_m_s);
        let rolls = input.speed_m_s >= SPEED_MIN_M_S;
        let force_n = if rolls { forces.force_n } else { [f64::NAN; 2] };
        PlanarState {
            lateral_m_s: self.state[LATERAL],
            lateral_sigma_m_s: self.covariance[(LATERAL, LATERAL)].sqrt(),
            yaw_rate_rad_s: self.state[YAW_RATE],
            acceleration_m_s2: if rolls { side } else { 0.0 },
            steer_rad: driven.steer_rad + self.state[STEER],
            rear_slip_rad: -((self.state[LATERAL] - self.model.rear_m * self.state[YAW_RATE])
                / driven.speed_m_s)
                .atan(),
            force_n,
            innovations,
        }
    }
}

#[cfg(test)]
mod tests;
