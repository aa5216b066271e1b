//! Estimates against truth: errors, delay and consistency of time series.
//!
//! All functions take equally spaced, equally long slices. Pairs of which either value is not
//! finite are left out. The statistics take a long series part by part, in constant memory.

mod distribution;

use multiversion::multiversion;

pub use distribution::Distribution;

/// Errors of one signal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    /// Pairs that were compared.
    pub count: usize,
    /// Mean error, estimate less truth.
    pub mean: f64,
    /// Root mean square of the error.
    pub rmse: f64,
    /// Largest absolute error.
    pub peak: f64,
    /// 95th percentile of the absolute error.
    pub percentile_95: f64,
}

/// Errors of `estimate` against `truth`; `None` without a single pair.
#[must_use]
pub fn errors(estimate: &[f64], truth: &[f64]) -> Option<Errors> {
    let mut all = ErrorStatistics::default();
    all.push(estimate, truth);
    all.errors()
}

/// Errors of a signal that comes in parts.
#[derive(Clone, Debug, Default)]
pub struct ErrorStatistics {
    sum: f64,
    squares: f64,
    sizes: Distribution,
    largest_truth: f64,
}

impl ErrorStatistics {
    /// Takes the next part.
    pub fn push(&mut self, estimate: &[f64], truth: &[f64]) {
        for (e, t) in pairs(estimate, truth) {
            let error = e - t;
            self.sum += error;
            self.squares += error * error;
            self.sizes.push(error.abs());
        }
        let sizes = truth.iter().filter(|value| value.is_finite());
        self.largest_truth = sizes.fold(self.largest_truth, |peak, value| peak.max(value.abs()));
    }

    /// The errors so far; `None` without a single pair.
    #[must_use]
    pub fn errors(&self) -> Option<Errors> {
        let count = self.sizes.count();
        let rank = (0.95 * count as f64).ceil() as usize;
        Some(Errors {
            count,
            mean: self.sum / count as f64,
            rmse: (self.squares / count as f64).sqrt(),
            peak: self.sizes.largest()?,
            percentile_95: self.sizes.at_rank(rank.clamp(1, count.max(1)) - 1)?,
        })
    }

    /// 100 RMSE / max(peak of |truth|, floor), per cent: for a tyre's force the floor is the static
    /// wheel load.
    #[must_use]
    pub fn normalised_percent(&self, floor: f64) -> Option<f64> {
        let peak = floor.abs().max(self.largest_truth);
        let errors = self.errors()?;
        (peak > 0.0).then(|| 100.0 * errors.rmse / peak)
    }
}

/// How late an estimate is, from parts of at most some minutes.
///
/// The delay is the peak of the cross-correlation of what estimate and truth have beside their means, in
/// sample intervals, between samples by a parabola. The means are those of each part.
#[derive(Clone, Debug)]
pub struct DelayStatistics {
    most: usize,
    products: Vec<f64>,
    energies: Vec<f64>,
}

impl DelayStatistics {
    /// For delays within plus and minus `most`.
    #[must_use]
    pub fn new(most: usize) -> Self {
        Self {
            most,
            products: vec![0.0; 2 * most + 1],
            energies: vec![0.0; 2 * most + 1],
        }
    }

    /// Takes the next part. A part that is too short, or in which a series does not move, has no effect.
    pub fn push(&mut self, estimate: &[f64], truth: &[f64]) {
        let length = estimate.len().min(truth.len());
        if length < 2 * self.most + 3 {
            return;
        }
        let (Some(estimate), Some(truth)) =
            (centred(&estimate[..length]), centred(&truth[..length]))
        else {
            return;
        };
        let middle = &truth[self.most..length - self.most];
        correlate([middle], &estimate, [&mut self.products]);
        let mut energy: f64 = estimate[..middle.len()].iter().map(|x| x * x).sum();
        for (shift, sum) in self.energies.iter_mut().enumerate() {
            *sum += energy.max(0.0);
            let next = estimate.get(shift + middle.len()).copied();
            energy += next.unwrap_or_default().powi(2) - estimate[shift].powi(2);
        }
    }

    /// The delay; `None` where no part had an effect or the peak is at the end of the range.
    #[must_use]
    pub fn delay(&self) -> Option<f64> {
        let both = self.products.iter().zip(&self.energies);
        let all: Vec<f64> = both
            .map(|(product, energy)| product / energy.max(f64::MIN_POSITIVE).sqrt())
            .collect();
        let best = (0..all.len()).max_by(|a, b| all[*a].total_cmp(&all[*b]))?;
        if best == 0 || best == all.len() - 1 {
            return None;
        }
        let [left, top, right] = [all[best - 1], all[best], all[best + 1]];
        let bend = left - 2.0 * top + right;
        let part = if bend < 0.0 {
            0.5 * (left - right) / bend
        } else {
            0.0
        };
        Some(best as f64 + part - self.most as f64)
    }
}

/// A series less its mean, zero where it is not finite; `None` if it does not move.
fn centred(series: &[f64]) -> Option<Vec<f64>> {
    let finite = || series.iter().copied().filter(|x| x.is_finite());
    let mean = finite().sum::<f64>() / finite().count().max(1) as f64;
    let centred: Vec<f64> = series
        .iter()
        .map(|x| if x.is_finite() { x - mean } else { 0.0 })
        .collect();
    centred.iter().any(|x| *x != 0.0).then_some(centred)
}

/// Number of lags whose sums are formed together, in registers of the processor.
const LAGS_TOGETHER: usize = 16;

/// Adds to each `sums[lag]` the products `fixed[k] moving[k + lag]` over all k, in the order of k; of several
/// equally long series `fixed` in one pass over `moving`.
pub(crate) fn correlate<const N: usize>(
    fixed: [&[f64]; N],
    moving: &[f64],
    mut sums: [&mut [f64]; N],
) {
    let lags = sums.first().map_or(0, |sums| sums.len());
    let length = fixed.first().map_or(0, |fixed| fixed.len());
    let mut lag = 0;
    while lag < lags {
        let count = (lags - lag).min(LAGS_TOGETHER);
        let mut running = [[0.0; LAGS_TOGETHER]; N];
        for (running, sums) in running.iter_mut().zip(&sums) {
            running[..count].copy_from_slice(&sums[lag..lag + count]);
        }
        // Sums of lags that were not asked for are dropped; what they would read behind the end is not.
        let whole = moving[lag..]
            .len()
            .saturating_sub(LAGS_TOGETHER - 1)
            .min(length);
        add_products(
            fixed.map(|fixed| &fixed[..whole]),
            &moving[lag..],
            &mut running,
        );
        for ((running, sums), fixed) in running.iter_mut().zip(&mut sums).zip(fixed) {
            for k in whole..length {
                for (i, sum) in running[..count].iter_mut().enumerate() {
                    *sum += fixed[k] * moving[lag + k + i];
                }
            }
            sums[lag..lag + count].copy_from_slice(&running[..count]);
        }
        lag += count;
    }
}

/// Adds the products of all values of each `fixed` with [`LAGS_TOGETHER`] values of `moving` from the same place
/// on.
#[multiversion(targets("x86_64+avx+avx2"))]
fn add_products<const N: usize>(
    fixed: [&[f64]; N],
    moving: &[f64],
    sums: &mut [[f64; LAGS_TOGETHER]; N],
) {
    let mut running = *sums;
    let length = fixed.first().map_or(0, |fixed| fixed.len());
    let mut k = 0;
    while k < length {
        let window = &moving[k..k + LAGS_TOGETHER];
        let mut n = 0;
        while n < N {
            let x = fixed[n][k];
            let mut i = 0;
            while i < LAGS_TOGETHER {
                running[n][i] += x * window[i];
                i += 1;
            }
            n += 1;
        }
        k += 1;
    }
    *sums = running;
}

/// Mean of ((estimate - truth)/sigma)^2: one where the stated deviations hold, more where the
/// estimator is too sure of itself.
#[derive(Clone, Copy, Debug, Default)]
pub struct SquareStatistics {
    sum: f64,
    count: f64,
}

impl SquareStatistics {
    /// Takes the next normalised error; one that is not finite is left out.
    pub fn push(&mut self, normalised: f64) {
        let square = normalised.powi(2);
        if square.is_finite() {
            self.sum += square;
            self.count += 1.0;
        }
    }

    /// The mean so far; `None` without a single error.
    #[must_use]
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0.0).then(|| self.sum / self.count)
    }
}

fn pairs<'a>(estimate: &'a [f64], truth: &'a [f64]) -> impl Iterator<Item = (f64, f64)> + 'a {
    let both = estimate.iter().copied().zip(truth.iter().copied());
    both.filter(|(e, t)| e.is_finite() && t.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(length: usize, late: f64) -> Vec<f64> {
        (0..length)
            .map(|i| {
                math::sin(0.11 * (i as f64 - late)) + 0.3 * math::cos(0.031 * (i as f64 - late))
            })
            .collect()
    }

    #[test]
    fn errors_of_known_series() {
        let found = errors(&[1.0, 2.0, f64::NAN, 7.0], &[0.0, 2.0, 1.0, 3.0]).unwrap();
        assert_eq!(found.count, 3);
        assert!((found.mean - 5.0 / 3.0).abs() < 1e-12);
        assert!((found.rmse - (17.0_f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!(found.peak, 4.0);
        assert_eq!(found.percentile_95, 4.0);
        assert!(errors(&[f64::NAN], &[1.0]).is_none());
        let mut all = ErrorStatistics::default();
        all.push(&[1.0, 1.0], &[0.0, 2.0]);
        let percent = all.normalised_percent(4.0).unwrap();
        assert!((percent - 25.0).abs() < 1e-12);
    }

    fn delay(estimate: &[f64], truth: &[f64], most: usize) -> Option<f64> {
        let mut all = DelayStatistics::new(most);
        all.push(estimate, truth);
        all.delay()
    }

    #[test]
    fn delay_is_found_between_samples() {
        let truth = wave(1000, 0.0);
        for late in [-3.4, 0.0, 0.5, 7.25] {
            let found = delay(&wave(1000, late), &truth, 20).unwrap();
            assert!((found - late).abs() < 0.02, "{late} {found}");
        }
        assert!(delay(&wave(1000, 30.0), &truth, 20).is_none());
        assert!(delay(&[1.0; 1000], &truth, 20).is_none());
    }

    #[test]
    fn normalised_square_of_known_errors() {
        let mut all = SquareStatistics::default();
        assert_eq!(all.mean(), None);
        for normalised in [1.0, f64::NAN, 3.0] {
            all.push(normalised);
        }
        assert!((all.mean().unwrap() - 5.0).abs() < 1e-12);
    }

    /// The parts of a long series give what the whole gives.
    #[test]
    fn parts_give_what_the_whole_gives() {
        let (truth, estimate) = (wave(4000, 0.0), wave(4000, 2.6));
        let (mut delays, mut all) = (DelayStatistics::new(20), ErrorStatistics::default());
        for (e, t) in estimate.chunks(1000).zip(truth.chunks(1000)) {
            delays.push(e, t);
            all.push(e, t);
        }
        assert!((delays.delay().unwrap() - 2.6).abs() < 0.02);
        assert_eq!(all.errors(), errors(&estimate, &truth));
    }

    #[test]
    fn products_of_all_lags_are_those_of_one_lag_at_a_time() {
        let (one, other, moving) = (wave(300, 0.0), wave(300, 9.0), wave(360, 5.0));
        let [mut sums, mut others] = [[1.0; 37]; 2];
        correlate([&one, &other], &moving, [&mut sums, &mut others]);
        for (fixed, sums) in [(one, sums), (other, others)] {
            for (lag, sum) in sums.iter().enumerate() {
                let products = fixed.iter().zip(&moving[lag..]).map(|(x, y)| x * y);
                assert_eq!(*sum, products.fold(1.0, |sum, product| sum + product));
            }
        }
    }
}
