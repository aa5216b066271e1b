//! Comparison of a column with what another one lets expect.

use model::nalgebra::{Matrix4, Vector4};

/// Fewest intervals that anything is judged by.
pub const ROWS_MIN: usize = 50;
/// Correlation from which a column follows another one.
const FOLLOWS: f64 = 0.5;

/// A column against its expectation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Coefficient of correlation.
    pub correlation: f64,
    /// Ratio of the root mean squares, without sign.
    pub ratio: f64,
    /// Root mean square of the expectation.
    pub expected_rms: f64,
}

/// Whether a column follows its expectation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Follows {
    /// Yes.
    Yes,
    /// With the opposite sign.
    Reversed,
    /// No.
    No,
}

impl Line {
    /// Compares the rows where both are known, without their means; `None` with too few of them.
    pub fn of(expected: &[f64], found: &[f64]) -> Option<Self> {
        let pairs = known(expected, found);
        let n = pairs.len() as f64;
        let (x, y) = pairs
            .iter()
            .fold((0.0, 0.0), |(a, b), (x, y)| (a + x, b + y));
        Self::about(&pairs, x / n, y / n)
    }

    /// The same with the means: a constant turn is a turn.
    pub fn through_zero(expected: &[f64], found: &[f64]) -> Option<Self> {
        Self::about(&known(expected, found), 0.0, 0.0)
    }

    fn about(pairs: &[(f64, f64)], zero_x: f64, zero_y: f64) -> Option<Self> {
        if pairs.len() < ROWS_MIN {
            return None;
        }
        let squares = pairs.iter().fold([0.0; 3], |[xx, yy, xy], (x, y)| {
            let (x, y) = (x - zero_x, y - zero_y);
            [xx + x * x, yy + y * y, xy + x * y]
        });
        let [xx, yy, xy] = squares;
        Some(Self {
            correlation: if xx * yy > 0.0 {
                xy / (xx * yy).sqrt()
            } else {
                0.0
            },
            ratio: if xx > 0.0 { (yy / xx).sqrt() } else { f64::NAN },
            expected_rms: (xx / pairs.len() as f64).sqrt(),
        })
    }

    /// Whether the column follows its expectation.
    pub fn follows(&self) -> Follows {
        match self.correlation {
            c if c > FOLLOWS => Follows::Yes,
            c if c < -FOLLOWS => Follows::Reversed,
            _ => Follows::No,
        }
    }
}

fn known(expected: &[f64], found: &[f64]) -> Vec<(f64, f64)> {
    let pairs = expected.iter().copied().zip(found.iter().copied());
    pairs
        .filter(|(x, y)| x.is_finite() && y.is_finite())
        .collect()
}

/// What braking and cornering make of a column: coefficients of the longitudinal acceleration while it is
/// negative, and of the lateral acceleration.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reaction {
    /// Per m/s^2 of braking (negative acceleration); `None` without enough braking.
    pub braking: Option<f64>,
    /// Per m/s^2 to the left; `None` without enough cornering.
    pub cornering: Option<f64>,
}

/// Least root mean square of an acceleration whose effect is judged, m/s^2.
pub const ACCELERATION_MIN_M_S2: f64 = 0.6;
/// Least part of the remainder that the effect of an acceleration must reach.
const EFFECT_MIN: f64 = 0.5;

/// Regression of a column on braking, drive and lateral acceleration.
pub fn reaction(column: &[f64], longitudinal: &[f64], lateral: &[f64]) -> Reaction {
    let mut normal = Matrix4::zeros();
    let mut right = Vector4::zeros();
    let mut rows = Vec::new();
    for ((value, along), across) in column.iter().zip(longitudinal).zip(lateral) {
        if value.is_finite() && along.is_finite() && across.is_finite() {
            let row = Vector4::new(1.0, along.min(0.0), along.max(0.0), *across);
            normal += row * row.transpose();
            right += row * *value;
            rows.push((row, *value));
        }
    }
    let n = rows.len() as f64;
    if rows.len() < ROWS_MIN {
        return Reaction::default();
    }
    // A little of each column's size, so that an acceleration that does not occur has no effect.
    for k in 0..4 {
        normal[(k, k)] += 1e-6 * n;
    }
    let Some(coefficients) = normal.cholesky().map(|factor| factor.solve(&right)) else {
        return Reaction::default();
    };
    let rms_of = |k: usize| {
        let mean = rows.iter().map(|(row, _)| row[k]).sum::<f64>() / n;
        (rows
            .iter()
            .map(|(row, _)| (row[k] - mean).powi(2))
            .sum::<f64>()
            / n)
            .sqrt()
    };
    let left = rows
        .iter()
        .map(|(row, value)| (value - row.dot(&coefficients)).powi(2));
    let left_rms = (left.sum::<f64>() / n).sqrt();
    let judged = |k: usize, part: f64| {
        let rms = rms_of(k);
        let acts = (coefficients[k] * rms).abs() >= EFFECT_MIN * part * left_rms;
        (rms >= part * ACCELERATION_MIN_M_S2 && acts).then_some(coefficients[k])
    };
    let to_side = |side: f64| {
        let turning = rows
            .iter()
            .filter(|(row, _)| side * row[3] > ACCELERATION_MIN_M_S2);
        turning.count() >= ROWS_MIN / 2
    };
    Reaction {
        // A vehicle brakes for a part of the time only.
        braking: judged(1, 0.5),
        // A circle to one side differs from a straight in more than its lateral acceleration.
        cornering: judged(3, 1.0).filter(|_| to_side(1.0) && to_side(-1.0)),
    }
}

/// A factor between units.
pub const FACTORS: [(f64, &str); 14] = [
    (
        180.0 / std::f64::consts::PI,
        "degrees are taken for radians",
    ),
    (
        std::f64::consts::PI / 180.0,
        "radians are taken for degrees",
    ),
    (1.0 / sample::STANDARD_GRAVITY_M_S2, "g is taken for m/s^2"),
    (sample::STANDARD_GRAVITY_M_S2, "m/s^2 is taken for g"),
    (3.6, "km/h is taken for m/s"),
    (1.0 / 3.6, "m/s is taken for km/h"),
    (1.0 / 0.447_04, "mph is taken for m/s"),
    (0.447_04, "m/s is taken for mph"),
    (
        30.0 / std::f64::consts::PI,
        "revolutions per minute are taken for rad/s",
    ),
    (
        std::f64::consts::PI / 30.0,
        "rad/s is taken for revolutions per minute",
    ),
    (
        1.0 / (2.0 * std::f64::consts::PI),
        "revolutions per second are taken for rad/s",
    ),
    (1000.0, "mm is taken for m, or N for kN"),
    (1e-3, "m is taken for mm, or kN for N"),
    (1.0 / 0.0254, "inches are taken for metres"),
];

/// Units whose factor is within `tolerance` (a ratio above 1) of `ratio`, among those of `words`.
pub fn unit_of(ratio: f64, tolerance: f64, words: &[&str]) -> Option<&'static str> {
    let near = |factor: f64| math::ln(ratio / factor).abs();
    let fitting = FACTORS.iter().filter(|(factor, text)| {
        near(*factor) < math::ln(tolerance) && words.iter().any(|word| text.contains(word))
    });
    fitting
        .min_by(|a, b| near(a.0).total_cmp(&near(b.0)))
        .map(|(_, text)| *text)
}
