//! Errors that jump: a bias, for good, when the inertial unit is hit or its supply changes, or the
//! attitude, when a gyro tells wrong for a moment.
//!
//! A filter that is sure of a state learns a jump late, and meanwhile takes the receivers for wrong.
//! What a jump by one makes of the filter's errors is known, though: it goes through the inertial
//! equations and is corrected as any error is. So for each error that may jump, and for several
//! instants at which it may have jumped, that signature is carried along, and the innovations are
//! held against it: a generalised likelihood ratio (A. S. Willsky and H. L. Jones, A generalized
//! likelihood ratio approach to the detection and estimation of jumps in linear systems, IEEE
//! Transactions on Automatic Control 21, 1976). A jump that explains them opens the covariance
//! along its signature, and the filter learns it from the next values.

use std::ops::Range;

use nalgebra::{SMatrix, SVector};
use sample::LogTime;

use super::flow::{Flow, Passed};
use super::{ACCEL_BIAS, ATTITUDE, GYRO_BIAS, STATES};
use crate::tuning::JumpTuning;

/// Errors that can jump, three axes of each.
const JUMPING: [usize; 3] = [ATTITUDE, ACCEL_BIAS, GYRO_BIAS];

const ERRORS: usize = 3 * JUMPING.len();

/// Values that receivers tell: velocity, and yaw, pitch and roll.
pub const VELOCITY_VALUE: usize = 0;
pub const ANGLE_VALUE: usize = 3;
const VALUES: usize = ANGLE_VALUE + 3;

/// Instants, the newest of which is never older than [`SPACING_S`].
/// Number of instants at which a jump is assumed.
const INSTANTS: usize = 6;

/// Jumps at one instant.
#[derive(Clone, Copy, Debug)]
struct Instant {
    at: Option<LogTime>,
    /// What a jump of each error by one has made of all until now.
    signatures: SMatrix<f64, STATES, ERRORS>,
    /// What the innovations tell of each jump, and how they agree with it.
    information: SVector<f64, ERRORS>,
    agreement: SVector<f64, ERRORS>,
    /// The same of values that are off by as much ever since, and how many values there were.
    off_information: [f64; VALUES],
    off_agreement: [f64; VALUES],
    counts: [f64; VALUES],
    /// Sum of the normalised innovations squared.
    square: f64,
}

impl Instant {
    fn new(at: Option<LogTime>) -> Self {
        let mut signatures = SMatrix::<f64, STATES, ERRORS>::zeros();
        for (i, first) in JUMPING.into_iter().enumerate() {
            for axis in 0..3 {
                signatures[(first + axis, 3 * i + axis)] = 1.0;
            }
        }
        Self {
            at,
            signatures,
            information: SVector::zeros(),
            agreement: SVector::zeros(),
            off_information: [0.0; VALUES],
            off_agreement: [0.0; VALUES],
            counts: [0.0; VALUES],
            square: 0.0,
        }
    }

    /// By how much the innovations tell that an error has jumped.
    fn by(&self, error: usize) -> f64 {
        self.agreement[error] / self.information[error]
    }

    /// How much likelier they are with that jump than without, as twice the logarithm.
    fn ratio(&self, error: usize) -> f64 {
        self.by(error) * self.agreement[error]
    }

    fn is_possible(&self, error: usize, tuning: &JumpTuning) -> bool {
        self.by(error).abs() < tuning.largest[error / 3]
    }

    /// How much likelier a receiver that is far off since then makes the innovations: one that is off
    /// by less is followed anyway.
    fn off_ratio(&self, tuning: &JumpTuning) -> f64 {
        let ratio = |value: usize| self.off_agreement[value].powi(2) / self.off_information[value];
        let ratios = |values: Range<usize>| -> f64 {
            let gate = tuning.receiver_error_sigma;
            let far = values.filter(|value| ratio(*value) > gate * gate * self.counts[*value]);
            far.map(ratio).sum()
        };
        ratios(VELOCITY_VALUE..ANGLE_VALUE).max(ratios(ANGLE_VALUE..VALUES))
    }

    /// Whether a jump is likely enough.
    fn is_likely(&self, error: usize, tuning: &JumpTuning) -> bool {
        let ratio = self.ratio(error);
        let left = (self.square - ratio) / self.counts.iter().sum::<f64>();
        let explained = left < tuning.noise_max || ratio > tuning.explained * self.square;
        ratio > tuning.ratio * left.max(1.0) && explained && self.is_possible(error, tuning)
    }
}

/// The instants at which something may have jumped, in a ring.
#[derive(Clone, Debug)]
pub struct Jumps {
    tuning: JumpTuning,
    instants: [Instant; INSTANTS],
    newest: usize,
    /// Steps through which the signatures have not been carried yet.
    passed: Option<Passed>,
}

impl Jumps {
    /// No instant yet.
    pub fn new(tuning: JumpTuning) -> Self {
        Self {
            tuning,
            instants: [Instant::new(None); INSTANTS],
            newest: 0,
            passed: None,
        }
    }

    /// Goes one step on to `now`, when something may jump, too.
    pub(super) fn propagate(&mut self, now: LogTime, flow: &Flow) {
        self.passed.get_or_insert_default().step(flow);
        let newest = self.instants[self.newest].at;
        if newest.is_none_or(|at| now.seconds_since(at) >= self.tuning.spacing_s) {
            self.catch_up();
            self.newest = (self.newest + 1) % INSTANTS;
            self.instants[self.newest] = Instant::new(Some(now));
        }
    }

    /// Takes note of a receiver's innovation: of which value, measurement row `h` and variance `total`.
    pub fn compare(&mut self, value: usize, h: &SVector<f64, STATES>, innovation: f64, total: f64) {
        self.catch_up();
        for instant in self.begun() {
            let expected = instant.signatures.tr_mul(h);
            instant.information += expected.component_mul(&expected) / total;
            instant.agreement += expected * (innovation / total);
            instant.off_information[value] += 1.0 / total;
            instant.off_agreement[value] += innovation / total;
            instant.counts[value] += 1.0;
            instant.square += innovation * innovation / total;
        }
    }

    /// Takes note of a correction by a measurement of row `h`.
    pub fn correct(&mut self, h: &SVector<f64, STATES>, gain: &SVector<f64, STATES>) {
        self.catch_up();
        for instant in self.begun() {
            let expected = instant.signatures.tr_mul(h);
            instant.signatures -= gain * expected.transpose();
        }
    }

    fn catch_up(&mut self) {
        if let Some(passed) = self.passed.take() {
            for instant in self.begun() {
                instant.signatures = passed.times(instant.signatures);
            }
        }
    }

    fn begun(&mut self) -> impl Iterator<Item = &mut Instant> {
        let all = self.instants.iter_mut();
        all.filter(|instant| instant.at.is_some())
    }

    /// What the jumps that are likely at the instant of the likeliest one have made of the errors, if
    /// one is likely enough; all begins anew then.
    pub fn take(&mut self, now: LogTime) -> impl Iterator<Item = SVector<f64, STATES>> + use<> {
        let tuning = self.tuning;
        let mut likeliest: Option<(f64, &Instant)> = None;
        // From the newest instant back: a receiver may be off since any later one.
        let mut off_ratio: f64 = 0.0;
        for age in 0..INSTANTS {
            let instant = &self.instants[(self.newest + INSTANTS - age) % INSTANTS];
            off_ratio = off_ratio.max(instant.off_ratio(&tuning));
            if instant
                .at
                .is_none_or(|at| now.seconds_since(at) < tuning.age_min_s)
            {
                continue;
            }
            for error in (0..ERRORS).filter(|error| instant.is_likely(*error, &tuning)) {
                let least = likeliest.map_or(off_ratio, |(ratio, _)| ratio.max(off_ratio));
                if instant.ratio(error) > least {
                    likeliest = Some((instant.ratio(error), instant));
                }
            }
        }
        let found = likeliest.map(|(ratio, instant)| (ratio, *instant));
        if found.is_some() {
            *self = Self::new(tuning);
        }
        found.into_iter().flat_map(move |(ratio, instant)| {
            let alike = move |error: &usize| {
                instant.is_possible(*error, &tuning)
                    && instant.ratio(*error) > tuning.alternative * ratio
            };
            let all = (0..ERRORS).filter(alike);
            all.map(move |error| instant.signatures.column(error) * instant.by(error))
        })
    }
}
