//! Jumps of the inertial unit's biases: a blow or a change of supply moves one for good.
//!
//! A filter that is sure of a bias learns a jump late, and meanwhile takes the receivers for wrong.
//! What a jump by one would make of the filter's errors is known, though: it goes through the
//! inertial equations and is corrected as an error is. So of each bias, and for several instants
//! at which it may have jumped, that signature is carried along, and the innovations are held
//! against it: a generalised likelihood ratio (A. S. Willsky and H. L. Jones, A generalized
//! likelihood ratio approach to the detection and estimation of jumps in linear systems, IEEE
//! Transactions on Automatic Control 21, 1976). A jump that explains them opens the covariance along
//! its signature, and the filter learns it from the next values.

use std::ops::Range;

use nalgebra::{SMatrix, SVector};
use sample::LogTime;

use super::{ACCEL_BIAS, Flow, STATES};

/// Biases: those of the accelerometers, then those of the gyros.
pub const BIASES: usize = STATES - ACCEL_BIAS;
/// Values that receivers tell: velocity, and yaw, pitch and roll.
const VALUES: usize = ANGLE_TOLD + 3;
pub const VELOCITY_TOLD: usize = 0;
pub const ANGLE_TOLD: usize = 3;
/// Instants, the newest of which is never older than [`SPACING_S`].
const INSTANTS: usize = 6;
const SPACING_S: f64 = 0.2;
/// How long ago a jump must be, s: what a single value says is no slope.
const AGE_MIN_S: f64 = 0.25;
/// How much likelier a jump must make the innovations (twice the logarithm), over what is left of
/// them unexplained.
const RATIO: f64 = 30.0;
/// Mean square up to which what is left may be noise, and the part that must be explained otherwise:
/// a receiver that is off from one value to the next leaves a quarter and more.
const NOISE_MAX: f64 = 2.0;
const EXPLAINED: f64 = 0.8;
/// Deviations beyond which a receiver that is off is not followed.
const FAR: f64 = 4.0;
/// Part of the likeliest jump's ratio above which that of another bias may be what happened.
const ALIKE: f64 = 0.25;
/// Largest jumps, m/s^2 and rad/s: what jumps further is contradicted by the balances of forces and
/// moments.
const LARGEST: [f64; 2] = [2.5, 0.4];

/// A jump that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jump {
    /// Which bias.
    pub bias: usize,
    /// By how much, m/s^2 or rad/s.
    pub by: f64,
    /// What it has made of the errors.
    pub errors: SVector<f64, STATES>,
    /// How much likelier the innovations are with it than without, as twice the logarithm.
    pub ratio: f64,
}

/// Jumps at one instant.
#[derive(Clone, Copy, Debug)]
struct Instant {
    at: Option<LogTime>,
    /// What a jump of each bias by one has made of the errors until now.
    signatures: SMatrix<f64, STATES, BIASES>,
    /// What the innovations tell of a jump of each bias, and how they agree with it.
    information: SVector<f64, BIASES>,
    agreement: SVector<f64, BIASES>,
    /// The same of values that are off by as much as ever since.
    off_information: [f64; VALUES],
    off_agreement: [f64; VALUES],
    off_count: [f64; VALUES],
    /// Sum of the normalised innovations squared, and how many.
    square: f64,
    count: f64,
}

impl Instant {
    fn new(at: Option<LogTime>) -> Self {
        let mut signatures = SMatrix::<f64, STATES, BIASES>::zeros();
        signatures
            .fixed_rows_mut::<BIASES>(ACCEL_BIAS)
            .fill_with_identity();
        Self {
            at,
            signatures,
            information: SVector::zeros(),
            agreement: SVector::zeros(),
            off_information: [0.0; VALUES],
            off_agreement: [0.0; VALUES],
            off_count: [0.0; VALUES],
            square: 0.0,
            count: 0.0,
        }
    }

    /// The jump of a bias that the innovations tell.
    fn jump(&self, bias: usize) -> Jump {
        let by = self.agreement[bias] / self.information[bias];
        Jump {
            bias,
            by,
            errors: self.signatures.column(bias) * by,
            ratio: by * self.agreement[bias],
        }
    }

    /// How much likelier a receiver that is far off since then makes the innovations: one that is off
    /// by less is followed anyway.
    fn off_ratio(&self) -> f64 {
        let ratio = |value: usize| self.off_agreement[value].powi(2) / self.off_information[value];
        let ratios = |values: Range<usize>| -> f64 {
            let far = values.filter(|value| ratio(*value) > FAR * FAR * self.off_count[*value]);
            far.map(ratio).sum()
        };
        ratios(VELOCITY_TOLD..ANGLE_TOLD).max(ratios(ANGLE_TOLD..VALUES))
    }

    /// Whether a jump is likely enough.
    fn believes(&self, jump: &Jump, now: LogTime) -> bool {
        let old = self.at.is_some_and(|at| now.seconds_since(at) >= AGE_MIN_S);
        let left = (self.square - jump.ratio) / self.count;
        let explained = left < NOISE_MAX || jump.ratio > EXPLAINED * self.square;
        let likely = jump.ratio > RATIO * left.max(1.0);
        old && likely && explained && jump.by.abs() < LARGEST[jump.bias / 3]
    }
}

/// The instants at which a bias may have jumped, in a ring.
#[derive(Clone, Debug)]
pub struct Jumps {
    instants: [Instant; INSTANTS],
    newest: usize,
}

impl Default for Jumps {
    fn default() -> Self {
        Self {
            instants: [Instant::new(None); INSTANTS],
            newest: 0,
        }
    }
}

impl Jumps {
    /// Carries the signatures on to `now`, where a bias may jump, too.
    pub(super) fn carry(&mut self, now: LogTime, flow: &Flow) {
        for instant in self
            .instants
            .iter_mut()
            .filter(|instant| instant.at.is_some())
        {
            instant.signatures = flow.times(instant.signatures);
        }
        let newest = self.instants[self.newest].at;
        if newest.is_none_or(|at| now.seconds_since(at) >= SPACING_S) {
            self.newest = (self.newest + 1) % INSTANTS;
            self.instants[self.newest] = Instant::new(Some(now));
        }
    }

    /// Takes note of a receiver's innovation, of which value, measurement row `h` and variance `total`.
    pub fn compare(&mut self, value: usize, h: &SVector<f64, STATES>, innovation: f64, total: f64) {
        for instant in &mut self.instants {
            let expected = instant.signatures.tr_mul(h);
            instant.information += expected.component_mul(&expected) / total;
            instant.agreement += expected * (innovation / total);
            instant.off_information[value] += 1.0 / total;
            instant.off_agreement[value] += innovation / total;
            instant.off_count[value] += 1.0;
            instant.square += innovation * innovation / total;
            instant.count += 1.0;
        }
    }

    /// Takes note of a correction by a measurement of row `h`.
    pub fn correct(&mut self, h: &SVector<f64, STATES>, gain: &SVector<f64, STATES>) {
        for instant in &mut self.instants {
            let expected = instant.signatures.tr_mul(h);
            instant.signatures -= gain * expected.transpose();
        }
    }

    /// The jumps that are likely at the likeliest instant, if there is one, the likeliest first; all
    /// begins anew then.
    pub fn take(&mut self, now: LogTime) -> impl Iterator<Item = Jump> + use<> {
        let mut likeliest: Option<Jump> = None;
        let mut of = None;
        // From the newest instant back: a receiver may be off since any later one.
        let mut off_ratio: f64 = 0.0;
        for age in 0..INSTANTS {
            let instant = &self.instants[(self.newest + INSTANTS - age) % INSTANTS];
            off_ratio = off_ratio.max(instant.off_ratio());
            for bias in 0..BIASES {
                let jump = instant.jump(bias);
                if jump.ratio > off_ratio
                    && instant.believes(&jump, now)
                    && likeliest.is_none_or(|l| jump.ratio > l.ratio)
                {
                    likeliest = Some(jump);
                    of = Some(*instant);
                }
            }
        }
        if likeliest.is_some() {
            *self = Self::default();
        }
        let least = likeliest.map_or(0.0, |jump| ALIKE * jump.ratio);
        let jumps = of
            .into_iter()
            .flat_map(|i| (0..BIASES).map(move |bias| i.jump(bias)));
        jumps.filter(move |jump| jump.ratio > least && jump.by.abs() < LARGEST[jump.bias / 3])
    }
}
