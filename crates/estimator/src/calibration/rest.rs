//! Channels at rest: when a vehicle rests, and what a converter then says.

use nalgebra::DMatrix;

use crate::finding::{Span, Whiteness};
use crate::regression::{Bootstrap, whiteness};

/// Length of the pieces that rest is judged by, s.
const PIECE_S: f64 = 0.5;
/// Greatest change of a steady signal from piece to piece at rest, standard deviations.
const MOVED: f64 = 4.5;
/// Wheel speed of a vehicle at rest, rad/s.
const WHEEL_AT_REST_RAD_S: f64 = 0.1;
/// Pieces left out at both ends of a stretch: they may hold the beginning of a movement.
const TRIMMED: usize = 2;
/// Shortest stretch that is of use, s.
const SHORTEST_S: f64 = 2.0;
/// Pieces that the steadiness of a level is judged by.
const STEADY_PIECES: usize = 20;

/// A signal: instants in order, s, and values, as many; `NaN` where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Signal<'a> {
    /// Instants, s, rising.
    pub time_s: &'a [f64],
    /// Values.
    pub value: &'a [f64],
}

impl Signal<'_> {
    /// The finite values from `from_s` to `to_s` with their instants.
    #[must_use]
    pub fn within(&self, from_s: f64, to_s: f64) -> (Vec<f64>, Vec<f64>) {
        let first = self.time_s.partition_point(|&time_s| time_s < from_s);
        let last = self.time_s.partition_point(|&time_s| time_s <= to_s);
        let pairs = self.time_s[first..last]
            .iter()
            .zip(&self.value[first..last]);
        pairs.filter(|(_, value)| value.is_finite()).unzip()
    }

    /// Mean of the values from `from_s` to `to_s`.
    #[must_use]
    pub fn mean(&self, from_s: f64, to_s: f64) -> Option<f64> {
        let (_, values) = self.within(from_s, to_s);
        (!values.is_empty()).then(|| mean(&values))
    }
}

/// What a channel says at rest, in its own unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Rest {
    /// Mean.
    pub mean: f64,
    /// Standard deviation of the mean, correlation taken into account.
    pub mean_sigma: f64,
    /// Standard deviation of one reading, from the differences of neighbours.
    pub noise: f64,
    /// Drift, a second.
    pub slope_per_s: f64,
    /// Standard deviation of the drift.
    pub slope_sigma: f64,
    /// How much more short means differ than noise and drift let them (1: no more).
    pub unsteadiness: f64,
    /// Every reading is the same.
    pub unmoved: bool,
    /// Part of the readings at either end of the range.
    pub saturated: f64,
    /// Interval of the mean that a bootstrap gives.
    pub interval: Option<[f64; 2]>,
    /// Whether what is left is white.
    pub whiteness: Whiteness,
    /// Data used.
    pub span: Span,
}

impl Rest {
    /// What a channel says between `from_s` and `to_s`; readings at or beyond the ends of `range`
    /// count as saturated. `None` with fewer than 20 readings.
    #[must_use]
    pub fn of(signal: &Signal<'_>, from_s: f64, to_s: f64, range: [f64; 2]) -> Option<Self> {
        let (time_s, values) = signal.within(from_s, to_s);
        if values.len() < 20 {
            return None;
        }
        let n = values.len() as f64;
        let (centre_s, centre) = (mean(&time_s), mean(&values));
        let square: f64 = time_s.iter().map(|t| (t - centre_s).powi(2)).sum();
        let cross: f64 = time_s
            .iter()
            .zip(&values)
            .map(|(t, v)| (t - centre_s) * (v - centre))
            .sum();
        let slope = cross / square;
        let residual: Vec<f64> = time_s
            .iter()
            .zip(&values)
            .map(|(t, v)| v - centre - slope * (t - centre_s))
            .collect();
        let steps: f64 = values
            .windows(2)
            .map(|pair| (pair[1] - pair[0]).powi(2))
            .sum();
        let noise = (steps / (2.0 * (n - 1.0))).sqrt();
        let spread = (residual.iter().map(|r| r * r).sum::<f64>() / (n - 2.0)).sqrt();
        let inflation = correlation_inflation(&residual);
        // A level that noise does not carry over the converter's steps is known to a step only.
        let rounding = if noise < 0.3 {
            1.0 / 12.0_f64.sqrt()
        } else {
            0.0
        };
        let scores = DMatrix::from_column_slice(residual.len(), 1, &residual);
        let interval = Bootstrap::for_influence(&scores, 1)
            .intervals(values.len(), |rows| {
                Some(vec![rows.iter().map(|&row| values[row]).sum::<f64>() / n])
            })
            .and_then(|intervals| intervals.first().copied());
        Some(Self {
            mean: centre,
            mean_sigma: math::hypot(spread * inflation / n.sqrt(), rounding),
            noise,
            slope_per_s: slope,
            slope_sigma: spread * inflation / square.sqrt(),
            unsteadiness: unsteadiness(&residual, noise),
            unmoved: values.iter().all(|value| *value == values[0]),
            saturated: values
                .iter()
                .filter(|value| **value <= range[0] || **value >= range[1])
                .count() as f64
                / n,
            interval,
            whiteness: whiteness(&residual),
            span: Span {
                from_s: time_s[0],
                to_s: time_s[time_s.len() - 1],
                used_s: time_s[time_s.len() - 1] - time_s[0],
                rows: values.len(),
            },
        })
    }
}

/// A stretch of rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Its beginning, s.
    pub from_s: f64,
    /// Its end, s.
    pub to_s: f64,
}

/// The stretches of at least two seconds over which no steady signal (potentiometers, rates of an
/// inertial unit) changes and no wheel turns. Signals without noise (dead ones) say nothing; without
/// a live one there is no stretch.
#[must_use]
pub fn stretches(steady: &[Signal<'_>], wheels_rad_s: &[Signal<'_>]) -> Vec<Stretch> {
    let ends = steady
        .iter()
        .chain(wheels_rad_s)
        .filter_map(|signal| Some([*signal.time_s.first()?, *signal.time_s.last()?]));
    let [start_s, end_s] = ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], [c, d]| {
        [a.min(c), b.max(d)]
    });
    let count = ((end_s - start_s) / PIECE_S).floor();
    if count.is_nan() || count < 1.0 {
        return Vec::new();
    }
    let piece = |k: usize| {
        let from_s = start_s + k as f64 * PIECE_S;
        [from_s, from_s + PIECE_S]
    };
    let count = count as usize;
    let live: Vec<Vec<Option<[f64; 2]>>> = steady
        .iter()
        .map(|signal| (0..count).map(|k| level(signal, piece(k))).collect())
        .filter(|levels: &Vec<Option<[f64; 2]>>| {
            levels.iter().flatten().any(|[_, sigma]| *sigma > 0.0)
        })
        .collect();
    let turning = |k: usize| {
        wheels_rad_s.iter().any(|wheel| {
            let [from_s, to_s] = piece(k);
            wheel
                .mean(from_s, to_s)
                .is_some_and(|speed| speed.abs() > WHEEL_AT_REST_RAD_S)
        })
    };
    let differ = |a: usize, b: usize| {
        live.iter().any(|levels| match (levels[a], levels[b]) {
            (Some([x, s]), Some([y, t])) => (x - y).abs() > MOVED * math::hypot(s, t),
            _ => false,
        })
    };
    let mut found = Vec::new();
    let mut first = 0;
    for k in 0..=count {
        let breaks = k == count
            || live.is_empty()
            || turning(k)
            || (k > first && (differ(k - 1, k) || differ(first, k)));
        if !breaks {
            continue;
        }
        let left = if first == 0 { 0 } else { first + TRIMMED };
        let right = if k == count {
            count
        } else {
            k.saturating_sub(TRIMMED)
        };
        if right > left {
            let stretch = Stretch {
                from_s: piece(left)[0],
                to_s: piece(right - 1)[1],
            };
            if stretch.to_s - stretch.from_s >= SHORTEST_S {
                found.push(stretch);
            }
        }
        first = if k < count && turning(k) { k + 1 } else { k };
    }
    found
}

/// Mean of a piece and its standard deviation; zero where nothing moves.
fn level(signal: &Signal<'_>, [from_s, to_s]: [f64; 2]) -> Option<[f64; 2]> {
    let (_, values) = signal.within(from_s, to_s);
    if values.len() < 5 {
        return None;
    }
    let steps: f64 = values
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).powi(2))
        .sum();
    let noise = (steps / (2.0 * (values.len() - 1) as f64)).sqrt();
    Some([mean(&values), noise / (values.len() as f64).sqrt()])
}

/// Ratio of the deviation of short means to what white noise gives them.
fn unsteadiness(residual: &[f64], noise: f64) -> f64 {
    let length = residual.len() / STEADY_PIECES;
    if length < 2 || noise <= 0.0 {
        return 1.0;
    }
    let means: Vec<f64> = residual.chunks_exact(length).map(mean).collect();
    let square: f64 = means.iter().map(|m| m * m).sum::<f64>() / means.len() as f64;
    (square * length as f64).sqrt() / noise
}

/// Factor on the deviation of a mean, sqrt((1 + rho)/(1 - rho)), where neighbours are alike beyond
/// chance.
fn correlation_inflation(residual: &[f64]) -> f64 {
    let square: f64 = residual.iter().map(|r| r * r).sum();
    if square <= 0.0 {
        return 1.0;
    }
    let cross: f64 = residual.windows(2).map(|pair| pair[0] * pair[1]).sum();
    let rho = (cross / square).clamp(-0.9, 0.98);
    if rho < 3.0 / (residual.len() as f64).sqrt() {
        1.0
    } else {
        ((1.0 + rho) / (1.0 - rho)).sqrt()
    }
}

pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn noisy(seed: u64, level: impl Fn(f64) -> f64, duration_s: f64) -> (Vec<f64>, Vec<f64>) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        (0..(duration_s * 100.0) as usize)
            .map(|k| {
                let time_s = k as f64 * 0.01;
                let noise: f64 = StandardNormal.sample(&mut random);
                (time_s, (level(time_s) + noise).round())
            })
            .unzip()
    }

    #[test]
    fn means_cover_the_truth_as_often_as_they_say() {
        let mut inside = 0;
        for seed in 0..200 {
            let truth = 500.0 + 0.37 * seed as f64;
            let (time_s, value) = noisy(seed, |_| truth, 6.0);
            let signal = Signal {
                time_s: &time_s,
                value: &value,
            };
            let rest = Rest::of(&signal, 0.0, 10.0, [0.0, 1023.0]).unwrap();
            inside += u32::from((rest.mean - truth).abs() < 1.96 * rest.mean_sigma);
            assert!(rest.unsteadiness < 1.6 && !rest.unmoved && rest.saturated == 0.0);
        }
        assert!((180..=196).contains(&inside), "{inside} of 200");
    }

    #[test]
    fn drift_and_jumps_are_seen() {
        let of = |level: &dyn Fn(f64) -> f64| {
            let (time_s, value) = noisy(3, level, 6.0);
            let signal = Signal {
                time_s: &time_s,
                value: &value,
            };
            Rest::of(&signal, 0.0, 10.0, [0.0, 1023.0]).unwrap()
        };
        let drifting = of(&|time_s| 500.0 + 0.5 * time_s);
        assert!((drifting.slope_per_s - 0.5).abs() < 3.0 * drifting.slope_sigma);
        assert!(drifting.slope_sigma < 0.05);
        let jumping = of(&|time_s| if time_s < 2.0 { 500.0 } else { 510.0 });
        assert!(jumping.unsteadiness > 4.0, "{}", jumping.unsteadiness);
    }

    #[test]
    fn rest_ends_where_something_moves() {
        let (time_s, value) = noisy(
            1,
            |t| {
                if t < 6.0 {
                    400.0
                } else {
                    400.0 + 40.0 * (t - 6.0).min(2.0)
                }
            },
            14.0,
        );
        let pot = Signal {
            time_s: &time_s,
            value: &value,
        };
        let speed: Vec<f64> = time_s
            .iter()
            .map(|t| f64::from(u8::from(*t > 12.0)))
            .collect();
        let wheel = Signal {
            time_s: &time_s,
            value: &speed,
        };
        let found = stretches(&[pot], &[wheel]);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].from_s == 0.0 && (5.0..6.0).contains(&found[0].to_s));
        assert!(found[1].from_s >= 8.0 && found[1].to_s <= 12.0, "{found:?}");
    }
}
