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
//! longitudinal load transfer m a_x h/(a + b)). A tyre that drives or brakes has less left for the
//! side: of mu F_z each axle keeps sqrt((mu F_z)^2 - F_x^2), F_x being its part of m a_x. Slip angles
//! act late, s' = v (a - s)/sigma with the relaxation length sigma, in which roll and a compliant
//! suspension are seen too. g_b, a first-order Gauss-Markov process, is what a banked road and
//! whatever the model leaves out add. Steer, yaw rate and lateral acceleration have offsets, which
//! are states too. Tyre parameters do not wander: they come from the calibration (see
//! [`crate::identification::handling`]) or from the vehicle file.
//!
//! The accelerometer reads k (F_f cos d + F_r)/m + x r' + offset: k holds the part of gravity that a
//! rolling body adds, x is the unit's distance ahead of the centre of gravity.

mod handling;
mod input;
mod live;
mod single_track;
mod tyre;

use nalgebra::{SMatrix, SVector};

use crate::trace::{Operation, Restart, Trace, Update};
use single_track::Driven;

pub use handling::Handling;
pub use input::{PlanarInput, PlanarReadings};
pub use live::{Planar, PlanarBelief, PlanarMotion, PlanarRecorder};
pub use single_track::PlanarModel;
pub use tyre::{SHAPE_RANGE, normalised_force};

/// Number of states.
pub const STATES: usize = 8;
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
/// Slip angle that the tyres of each axle, front first, have built up, rad.
const SLIP: [usize; 2] = [6, 7];

/// Speed below which tyres hardly slip and the model is stiff, m/s.
pub const SPEED_MIN_M_S: f64 = 3.0;
/// Speed below which the vehicle stands, m/s.
const STANDSTILL_M_S: f64 = 0.2;
/// Steps of the integration in one step of the filter.
const SUBSTEPS: usize = 2;
/// Correlation time of [`BANK`], s.
const BANK_TIME_S: f64 = 3.0;
/// Variances of lateral velocity, yaw rate and built-up slip angles before anything is known.
const MOTION_VARIANCE: [f64; 4] = [0.1, 0.003, 1e-3, 1e-3];
/// Walk of the offsets: rad, rad/s and m/s^2 per root second.
const OFFSET_WALK: [f64; 3] = [1e-6, 1e-6, 1e-3];
/// Standard deviations of the offsets before anything is known, and after a calibration.
const OFFSET_SIGMA: [f64; 3] = [0.01, 0.01, 0.2];
const OFFSET_SIGMA_CALIBRATED: [f64; 3] = [0.001, 0.0005, 0.05];
/// An offset further out, deviations, is not kept when the filter starts anew.
const OFFSET_SIGMAS_MAX: f64 = 4.0;
/// Floor of the measurements' deviations: rad/s, and m/s^2 for what vibration and the model's
/// errors add.
const MEASURED_SIGMA_MIN: [f64; 2] = [0.002, 0.1];
/// Innovation, standard deviations, from which a value counts less than its noise says.
const HUBER: f64 = 3.0;
/// A step longer than this is a gap, behind which the motion is unknown, s.
const GAP_S: f64 = 0.5;
/// Standard deviation of a wheel's slip at walking pace, m/s.
const SLOW_SIGMA_M_S: f64 = 0.1;

/// Noise of the measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarNoise {
    /// Of the yaw rate, rad/s.
    pub yaw_rate_rad_s: f64,
    /// Of the lateral acceleration, m/s^2.
    pub acceleration_m_s2: f64,
}

/// How far the model is believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarDoubt {
    /// Spectral density of lateral forces that the model leaves out, m/s per root second.
    pub lateral: f64,
    /// The same of yaw moments, rad/s per root second.
    pub yaw: f64,
    /// Standard deviation of what a banked road adds, m/s^2.
    pub bank_m_s2: f64,
    /// Part of the lateral acceleration that the accelerometer's model errs by.
    pub part: f64,
}

impl PlanarDoubt {
    /// A tyre curve that was identified: 0.9 degrees of bank.
    pub const IDENTIFIED: Self = Self {
        lateral: 0.015,
        yaw: 0.02,
        bank_m_s2: 0.15,
        part: 0.02,
    };
    /// A vehicle file's tyre curve.
    pub const FILE: Self = Self {
        lateral: 0.08,
        yaw: 0.08,
        bank_m_s2: 0.4,
        part: 0.06,
    };
}

/// The filter.
#[derive(Clone, Debug)]
pub struct PlanarFilter {
    model: PlanarModel,
    noise: PlanarNoise,
    doubt: PlanarDoubt,
    offset_sigma: [f64; 3],
    state: SVector<f64, STATES>,
    covariance: SMatrix<f64, STATES, STATES>,
    resets: u64,
    trace: Trace<STATES>,
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
    pub fn new(
        model: PlanarModel,
        noise: PlanarNoise,
        doubt: PlanarDoubt,
        calibrated: bool,
    ) -> Self {
        let mut filter = Self {
            model,
            noise: PlanarNoise {
                yaw_rate_rad_s: noise.yaw_rate_rad_s.max(MEASURED_SIGMA_MIN[0]),
                acceleration_m_s2: noise.acceleration_m_s2.max(MEASURED_SIGMA_MIN[1]),
            },
            doubt,
            offset_sigma: if calibrated {
                OFFSET_SIGMA_CALIBRATED
            } else {
                OFFSET_SIGMA
            },
            state: SVector::zeros(),
            covariance: SMatrix::zeros(),
            resets: 0,
            trace: Trace::default(),
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
        let bank = self.doubt.bank_m_s2.powi(2);
        let [lateral, yaw, front, rear] = MOTION_VARIANCE;
        let diagonal = [lateral, yaw, steer, gyro, accel, bank, front, rear];
        self.covariance = SMatrix::from_diagonal(&SVector::from(diagonal));
    }

    /// Motion and offsets are open again; offsets begin where they were, if a sensor can have them.
    fn start_anew(&mut self) {
        let before = self.state;
        self.forget();
        for (i, sigma) in [STEER, GYRO, ACCEL].into_iter().zip(self.offset_sigma) {
            if before[i].abs() < OFFSET_SIGMAS_MAX * sigma {
                self.state[i] = before[i];
            }
        }
        self.resets += 1;
        self.trace.note(|| {
            Operation::Restart(Box::new(Restart {
                state: self.state,
                variance: self.covariance.diagonal(),
            }))
        });
    }

    /// Motion is unknown, offsets stay.
    fn forget_motion(&mut self) {
        self.state[BANK] = 0.0;
        self.decouple(BANK, self.doubt.bank_m_s2.powi(2));
        for (i, variance) in [LATERAL, YAW_RATE, SLIP[0], SLIP[1]]
            .into_iter()
            .zip(MOTION_VARIANCE)
        {
            self.state[i] = 0.0;
            self.decouple(i, variance);
        }
    }

    fn decouple(&mut self, i: usize, variance: f64) {
        self.trace.note(|| Operation::Forget { index: i, variance });
        for j in 0..STATES {
            self.covariance[(i, j)] = 0.0;
            self.covariance[(j, i)] = 0.0;
        }
        self.covariance[(i, i)] = variance;
    }

    /// Carries the filter on by `dt_s` to the instant of `input` and takes its measurements in.
    /// Behind a gap the motion is found anew.
    pub fn step(&mut self, dt_s: f64, input: &PlanarInput) -> PlanarState {
        let mut innovations = [Innovation::NONE; 2];
        if input.speed_m_s < SPEED_MIN_M_S {
            self.roll_slowly(input);
        } else {
            let driven = self.model.driven(input);
            if (0.0..GAP_S).contains(&dt_s) {
                self.predict(dt_s, &driven);
            } else {
                self.forget_motion();
            }
            innovations = self.correct(&driven, input);
        }
        if !self.is_sound(input.speed_m_s) {
            self.start_anew();
        }
        PlanarState {
            innovations,
            ..self.model.told(&self.state, &self.covariance, input)
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
            (SLIP[0], MOTION_VARIANCE[2]),
            (SLIP[1], MOTION_VARIANCE[3]),
        ] {
            self.decouple(i, variance);
        }
        (self.state[SLIP[0]], self.state[SLIP[1]]) = (0.0, 0.0);
    }

    fn predict(&mut self, dt: f64, driven: &Driven) {
        let (mut rate, mut slope) = self.model.rates(&self.state, driven);
        let transition = SMatrix::identity() + slope * dt + slope * slope * (0.5 * dt * dt);
        self.covariance = transition * self.covariance * transition.transpose();
        self.trace.note(|| Operation::mixed(&transition));
        let part = dt / SUBSTEPS as f64;
        for step in 0..SUBSTEPS {
            if step > 0 {
                (rate, slope) = self.model.rates(&self.state, driven);
            }
            self.state += rate * part + slope * rate * (0.5 * part * part);
        }
        let noise = [
            self.doubt.lateral,
            self.doubt.yaw,
            OFFSET_WALK[0],
            OFFSET_WALK[1],
            OFFSET_WALK[2],
            self.doubt.bank_m_s2 * (2.0 / BANK_TIME_S).sqrt(),
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
            let [(side, side_slope), (turn, turn_slope)] =
                self.model.pushed(&self.model.forces(&self.state, driven));
            let gain = self.model.handling.roll_gain;
            let ahead = self.model.imu_ahead_m;
            let mut h = side_slope * gain + turn_slope * ahead;
            h[ACCEL] = 1.0;
            let residual = measured - gain * side - ahead * turn - self.state[ACCEL];
            let doubt = self.noise.acceleration_m_s2.powi(2) + (self.doubt.part * side).powi(2);
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
        self.trace.note(|| {
            let row = h.iter().copied().enumerate();
            Operation::Update(Box::new(Update {
                row: row.filter(|(_, h)| *h != 0.0).collect(),
                value: h.dot(&self.state) + residual,
                innovation: residual,
                variance: total - spread,
                total,
                gain: ph / total,
            }))
        });
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
}

#[cfg(test)]
mod tests;
