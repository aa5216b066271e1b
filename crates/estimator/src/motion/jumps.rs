//! Detection of jumps: of a bias, when the inertial unit is hit or its supply changes, or of the
//! attitude, after a short gyro fault.
//!
//! A filter with a small covariance follows a jump late and rejects the receivers meanwhile. The
//! effect of a unit jump on the filter's errors is known: it passes through the inertial equations
//! and the corrections like any error. So for each error that can jump, and for several assumed
//! instants, this signature is propagated, and the innovations are compared with it: a generalised
//! likelihood ratio (A. S. Willsky and H. L. Jones, A generalized likelihood ratio approach to the
//! detection and estimation of jumps in linear systems, IEEE Transactions on Automatic Control 21,
//! 1976). A jump that explains the innovations inflates the covariance along its signature, and the
//! filter learns it from the next values.

use std::ops::Range;

use nalgebra::{SMatrix, SVector};
use sample::LogTime;

use super::flow::{Flow, Passed};
use super::{ACCEL_BIAS, ATTITUDE, GYRO_BIAS, STATES};
use crate::tuning::JumpTuning;

/// Errors that can jump, three axes of each.
const JUMPING: [usize; 3] = [ATTITUDE, ACCEL_BIAS, GYRO_BIAS];

const ERRORS: usize = 3 * JUMPING.len();

/// Values of receivers: velocity; yaw, pitch and roll.
pub const VELOCITY_VALUE: usize = 0;
pub const ANGLE_VALUE: usize = 3;
const VALUES: usize = ANGLE_VALUE + 3;

/// Instants, the newest of which is never older than [`SPACING_S`].
/// Number of instants at which a jump is assumed.
const INSTANTS: usize = 6;

/// Jumps at one assumed instant.
#[derive(Clone, Copy, Debug)]
struct Instant {
    at: Option<LogTime>,
    /// Effect of a unit jump of each error on all errors until now.
    signatures: SMatrix<f64, STATES, ERRORS>,
    /// Information of the innovations about each jump, and their correlation with it.
    information: SVector<f64, ERRORS>,
    agreement: SVector<f64, ERRORS>,
    /// The same for a constant error of each value since the instant, and the number of values.
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

    /// Estimated size of a jump.
    fn by(&self, error: usize) -> f64 {
        self.agreement[error] / self.information[error]
    }

    /// Twice the logarithm of the likelihood ratio of a jump.
    fn ratio(&self, error: usize) -> f64 {
        self.by(error) * self.agreement[error]
    }

    fn is_possible(&self, error: usize, tuning: &JumpTuning) -> bool {
        self.by(error).abs() < tuning.largest[error / 3]
    }

    /// The same for a large constant error of a receiver since the instant; a smaller error is
    /// followed.
    fn off_ratio(&self, tuning: &JumpTuning) -> f64 {
        let ratio = |value: usize| self.off_agreement[value].powi(2) / self.off_information[value];
        let ratios = |values: Range<usize>| -> f64 {
            let gate = tuning.receiver_error_sigma;
            let far = values.filter(|value| ratio(*value) > gate * gate * self.counts[*value]);
            far.map(ratio).sum()
        };
        ratios(VELOCITY_VALUE..ANGLE_VALUE).max(ratios(ANGLE_VALUE..VALUES))
    }

    /// Whether a jump is accepted.
    fn is_likely(&self, error: usize, tuning: &JumpTuning) -> bool {
        let ratio = self.ratio(error);
        let left = (self.square - ratio) / self.counts.iter().sum::<f64>();
        let explained = left < tuning.noise_max || ratio > tuning.explained * self.square;
        ratio > tuning.ratio * left.max(1.0) && explained && self.is_possible(error, tuning)
    }
}

/// Assumed instants, in a ring.
#[derive(Clone, Debug)]
pub struct Jumps {
    tuning: JumpTuning,
    instants: [Instant; INSTANTS],
    newest: usize,
    /// Steps through which the signatures have not been propagated yet.
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

    /// Propagates by one step to `now`, which may become a further assumed instant.
    pub(super) fn propagate(&mut self, now: LogTime, flow: &Flow) {
        self.passed.get_or_insert_default().step(flow);
        let newest = self.instants[self.newest].at;
        if newest.is_none_or(|at| now.seconds_since(at) >= self.tuning.spacing_s) {
            self.catch_up();
            self.newest = (self.newest + 1) % INSTANTS;
            self.instants[self.newest] = Instant::new(Some(now));
        }
    }

    /// Takes a receiver's innovation: value, measurement row `h`, variance `total`.
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

    /// Applies a correction by a measurement with row `h` to the signatures.
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

    /// Effects on the errors of the accepted jumps at the likeliest instant, if there is one; then
    /// all instants are cleared.
    pub fn take(&mut self, now: LogTime) -> impl Iterator<Item = SVector<f64, STATES>> + use<> {
        let tuning = self.tuning;
        let mut likeliest: Option<(f64, &Instant)> = None;
        // From the newest instant back: a receiver's error may have begun at any later instant.
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
