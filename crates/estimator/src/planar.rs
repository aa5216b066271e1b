//! Sideslip of a vehicle without linkages: a single-track model with saturating tyres, corrected by
//! yaw rate and lateral acceleration.
//!
//! Inputs of the model are the measured speed v and steer angle d (road wheels). With the slip
//! angles a_f = d - atan((v_y + a r)/v), a_r = -atan((v_y - b r)/v) and the axle forces of `tyre`,
//!
//! ```text
//! m (v_y' + v r) = F_f cos d + F_r + m g_b      I_z r' = a F_f cos d - b F_r
//! ```
//!
//! (Mitschke and Wallentowitz, Dynamik der Kraftfahrzeuge, single-track model; axle loads with the
//! longitudinal load transfer m a_x h/(a + b)). Drive and brake forces reduce the lateral capacity
//! of an axle to sqrt((mu F_z)^2 - F_x^2), with F_x its part of m a_x. Slip angles build up with s'
//! = v (a - s)/sigma; the relaxation length sigma also covers roll and suspension compliance. g_b,
//! a first-order Gauss-Markov process, is the effect of a banked road and of what the model omits.
//! Steer angle, yaw rate and lateral acceleration have offsets, which are states. Tyre parameters
//! are constants: from the calibration (see [`crate::identification::handling`]) or from the
//! vehicle file.
//!
//! The accelerometer reads k (F_f cos d + F_r)/m + x r' + offset: k contains the part of gravity
//! that a rolling body adds, x is the unit's distance ahead of the centre of gravity.

mod input;
mod live;
mod single_track;
mod tyre;

use nalgebra::{SMatrix, SVector};

use crate::trace::{Operation, Restart, Trace, Update};
use crate::tuning::PlanarTuning;
use single_track::Driven;

pub use crate::handling::{Handling, SHAPE_RANGE};
pub use input::{LastInertial, PlanarInput, PlanarReadings};
pub use live::{Planar, PlanarMotion, PlanarRecorder, PlanarTrace};
pub use single_track::PlanarModel;
pub use tyre::normalised_force;

/// Number of states.
pub const STATES: usize = 8;
/// Leftward velocity of the centre of gravity, m/s.
const LATERAL: usize = 0;
/// Yaw rate, rad/s.
const YAW_RATE: usize = 1;
/// Correction of the measured road-wheel angle, rad.
const STEER: usize = 2;
/// Offset of the gyro, rad/s.
const GYRO: usize = 3;
/// Offset of the accelerometer, m/s^2.
const ACCEL: usize = 4;
/// Lateral acceleration without a tyre force, m/s^2.
const BANK: usize = 5;
/// Built-up slip angle of each axle, front first, rad.
const SLIP: [usize; 2] = [6, 7];

/// Speed below which the model is stiff and slip is negligible, m/s.
pub const SPEED_MIN_M_S: f64 = 3.0;
/// Steps of the integration in one step of the filter.
const SUBSTEPS: usize = 2;

/// Noise of the measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarNoise {
    /// Of the yaw rate, rad/s.
    pub yaw_rate_rad_s: f64,
    /// Of the lateral acceleration, m/s^2.
    pub acceleration_m_s2: f64,
}

/// Errors of the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarDoubt {
    /// Density of omitted lateral forces, m/s/√s.
    pub lateral: f64,
    /// Density of omitted yaw moments, rad/s/√s.
    pub yaw: f64,
    /// Standard deviation of a banked road's acceleration, m/s^2.
    pub bank_m_s2: f64,
    /// Error of the accelerometer's model as a part of the lateral acceleration.
    pub part: f64,
}

impl PlanarDoubt {
    /// With an identified tyre curve.
    #[must_use]
    pub fn identified(tuning: &PlanarTuning) -> Self {
        Self::new(tuning.identified_error)
    }

    /// With the vehicle file's tyre curve.
    #[must_use]
    pub fn file(tuning: &PlanarTuning) -> Self {
        Self::new(tuning.file_error)
    }

    fn new([lateral, yaw, bank_m_s2, part]: [f64; 4]) -> Self {
        Self {
            lateral,
            yaw,
            bank_m_s2,
            part,
        }
    }
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

/// The filter before a look ahead.
struct Kept {
    state: SVector<f64, STATES>,
    covariance: SMatrix<f64, STATES, STATES>,
    resets: u64,
    trace: Trace<STATES>,
}

/// Result of one step.
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

/// Innovation of a measurement.
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
    /// A filter without readings. `calibrated`: a calibration has removed the offsets.
    #[must_use]
    pub fn new(
        model: PlanarModel,
        noise: PlanarNoise,
        doubt: PlanarDoubt,
        calibrated: bool,
    ) -> Self {
        let t = model.tuning;
        let [rate_min, accel_min] = t.measured_sigma_min;
        let mut filter = Self {
            model,
            noise: PlanarNoise {
                yaw_rate_rad_s: noise.yaw_rate_rad_s.max(rate_min),
                acceleration_m_s2: noise.acceleration_m_s2.max(accel_min),
            },
            doubt,
            offset_sigma: if calibrated {
                t.offset_sigma_calibrated
            } else {
                t.offset_sigma
            },
            state: SVector::zeros(),
            covariance: SMatrix::zeros(),
            resets: 0,
            trace: Trace::default(),
        };
        filter.forget();
        filter
    }

    /// Number of restarts after divergence.
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

    /// Keeps state and covariance, and switches the trace off, until [`Self::end_look_ahead`].
    fn begin_look_ahead(&mut self) -> Kept {
        Kept {
            state: self.state,
            covariance: self.covariance,
            resets: self.resets,
            trace: std::mem::take(&mut self.trace),
        }
    }

    /// Returns to the state before a look ahead.
    fn end_look_ahead(&mut self, kept: Kept) {
        self.state = kept.state;
        self.covariance = kept.covariance;
        self.resets = kept.resets;
        self.trace = kept.trace;
    }

    fn forget(&mut self) {
        self.state = SVector::zeros();
        let [steer, gyro, accel] = self.offset_sigma.map(|sigma| sigma * sigma);
        let bank = self.doubt.bank_m_s2.powi(2);
        let [lateral, yaw, front, rear] = self.model.tuning.motion_variance;
        let diagonal = [lateral, yaw, steer, gyro, accel, bank, front, rear];
        self.covariance = SMatrix::from_diagonal(&SVector::from(diagonal));
    }

    /// Restarts motion and offsets; an offset that a sensor can have keeps its value.
    fn start_anew(&mut self) {
        let before = self.state;
        self.forget();
        for (i, sigma) in [STEER, GYRO, ACCEL].into_iter().zip(self.offset_sigma) {
            if before[i].abs() < self.model.tuning.offset_kept_sigma * sigma {
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

    /// Resets the motion; offsets stay.
    fn forget_motion(&mut self) {
        self.state[BANK] = 0.0;
        self.decouple(BANK, self.doubt.bank_m_s2.powi(2));
        for (i, variance) in [LATERAL, YAW_RATE, SLIP[0], SLIP[1]]
            .into_iter()
            .zip(self.model.tuning.motion_variance)
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

    /// Propagates the filter by `dt_s` to the instant of `input` and takes its measurements. After
    /// a gap the motion is found again.
    pub fn step(&mut self, dt_s: f64, input: &PlanarInput) -> PlanarState {
        let mut innovations = [Innovation::NONE; 2];
        if input.speed_m_s < SPEED_MIN_M_S {
            self.roll_slowly(input);
        } else {
            let driven = self.model.driven(input);
            if (0.0..self.model.tuning.gap_s).contains(&dt_s) {
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
            ..self.model.result(&self.state, &self.covariance, input)
        }
    }

    /// Low speed: tyres roll without slip; a standing vehicle shows the gyro's offset.
    fn roll_slowly(&mut self, input: &PlanarInput) {
        let t = self.model.tuning;
        if let Some(rate) = input.yaw_rate_rad_s {
            if input.speed_m_s.abs() < t.standstill_m_s {
                let mut h = SVector::<f64, STATES>::zeros();
                h[GYRO] = 1.0;
                let variance = self.noise.yaw_rate_rad_s.powi(2);
                let _ = self.scalar(&h, rate - self.state[GYRO], variance);
            }
            self.state[YAW_RATE] = rate - self.state[GYRO];
        }
        self.state[LATERAL] = self.model.rear_m * self.state[YAW_RATE];
        for (i, variance) in [
            (LATERAL, t.slow_sigma_m_s.powi(2)),
            (YAW_RATE, self.noise.yaw_rate_rad_s.powi(2)),
            (SLIP[0], t.motion_variance[2]),
            (SLIP[1], t.motion_variance[3]),
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
        let t = &self.model.tuning;
        let noise = [
            self.doubt.lateral,
            self.doubt.yaw,
            t.offset_walk[0],
            t.offset_walk[1],
            t.offset_walk[2],
            self.doubt.bank_m_s2 * (2.0 / t.bank_time_s).sqrt(),
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

    /// One scalar measurement; beyond `huber_sigma` its variance is increased.
    fn scalar(&mut self, h: &SVector<f64, STATES>, residual: f64, variance: f64) -> Innovation {
        let ph = self.covariance * h;
        let spread = h.dot(&ph);
        let normalised = residual / (spread + variance).sqrt();
        let excess = (normalised.abs() / self.model.tuning.huber_sigma).max(1.0);
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
