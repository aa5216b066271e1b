//! Estimates against truth: errors, delay and consistency of time series.
//!
//! All functions take equally spaced, equally long slices. Pairs of which either value is not
//! finite are left out. The statistics take a long series part by part, in constant memory.

mod distribution;
mod products;

pub use distribution::Distribution;
pub(crate) use products::LaggedProducts;

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
    relative: RelativeErrorStatistics,
    sizes: Distribution,
}

/// Root mean square of the errors of a signal that comes in parts, and the peak of its truth.
#[derive(Clone, Debug, Default)]
pub struct RelativeErrorStatistics {
    count: usize,
    squares: f64,
    largest_truth: f64,
}

impl RelativeErrorStatistics {
    /// Takes the next part.
    pub fn push(&mut self, estimate: &[f64], truth: &[f64]) {
        for (e, t) in estimate.iter().zip(truth) {
            let error = e - t;
            if error.is_finite() {
                self.count += 1;
                self.squares += error * error;
            }
            if t.is_finite() {
                self.largest_truth = self.largest_truth.max(t.abs());
            }
        }
    }

    /// 100 RMSE / max(peak of |truth|, floor), per cent: for a tyre's force the floor is the static
    /// wheel load. `None` without a single pair.
    #[must_use]
    pub fn normalised_percent(&self, floor: f64) -> Option<f64> {
        let peak = floor.abs().max(self.largest_truth);
        (self.count > 0 && peak > 0.0).then(|| 100.0 * self.rmse() / peak)
    }

    /// Pairs that were compared.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.count
    }

    /// The same without a part of the pairs. The peak of the truth stays that of all.
    #[must_use]
    pub fn without(&self, part: &Self) -> Self {
        Self {
            count: self.count - part.count,
            squares: (self.squares - part.squares).max(0.0),
            largest_truth: self.largest_truth,
        }
    }

    /// The part with the peak of the truth of all pairs.
    #[must_use]
    pub fn part(&self, part: &Self) -> Self {
        Self {
            largest_truth: self.largest_truth,
            ..part.clone()
        }
    }

    fn rmse(&self) -> f64 {
        (self.squares / self.count as f64).sqrt()
    }
}

impl ErrorStatistics {
    /// Takes the next part.
    pub fn push(&mut self, estimate: &[f64], truth: &[f64]) {
        self.relative.push(estimate, truth);
        for (e, t) in estimate.iter().zip(truth) {
            let error = e - t;
            if error.is_finite() {
                self.sum += error;
                self.sizes.push(error.abs());
            }
        }
    }

    /// The errors so far; `None` without a single pair.
    #[must_use]
    pub fn errors(&self) -> Option<Errors> {
        let count = self.sizes.count();
        let rank = (0.95 * count as f64).ceil() as usize;
        Some(Errors {
            count,
            mean: self.sum / count as f64,
            rmse: self.relative.rmse(),
            peak: self.sizes.largest()?,
            percentile_95: self.sizes.at_rank(rank.clamp(1, count.max(1)) - 1)?,
        })
    }

    /// As [`RelativeErrorStatistics::normalised_percent`].
    #[must_use]
    pub fn normalised_percent(&self, floor: f64) -> Option<f64> {
        self.relative.normalised_percent(floor)
    }
}

/// How late an estimate is, from parts of at most some minutes.
///
/// The delay is the peak of the cross-correlation of what estimate and truth have beside their means, in
/// sample intervals, between samples by a parabola. The means are those of each part.
#[derive(Clone, Debug)]
pub struct DelayStatistics {
    most: usize,
    products: LaggedProducts,
    energies: Vec<f64>,
}

impl DelayStatistics {
    /// For delays within plus and minus `most`.
    #[must_use]
    pub fn new(most: usize) -> Self {
        Self {
            most,
            products: LaggedProducts::new(1, 2 * most + 1),
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
        self.products.add(&[middle], &[&estimate]);
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
        let products = self.products.sums().next()?;
        let both = products.iter().zip(&self.energies);
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

    /// The same without a part of the errors.
    #[must_use]
    pub fn without(&self, part: &Self) -> Self {
        Self {
            sum: (self.sum - part.sum).max(0.0),
            count: self.count - part.count,
        }
    }

    /// The mean so far; `None` without a single error.
    #[must_use]
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0.0).then(|| self.sum / self.count)
    }
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

    #[test]
    fn a_part_and_the_rest_have_the_peak_of_the_whole() {
        let (estimate, truth) = ([1.0, 1.0, 7.0], [0.0, 2.0, 10.0]);
        let [mut all, mut part] = [(); 2].map(|()| RelativeErrorStatistics::default());
        all.push(&estimate, &truth);
        part.push(&estimate[..2], &truth[..2]);
        let percent = |of: RelativeErrorStatistics| of.normalised_percent(4.0).unwrap();
        assert!((percent(all.part(&part)) - 10.0).abs() < 1e-12);
        assert!((percent(all.without(&part)) - 30.0).abs() < 1e-12);
        assert_eq!(all.without(&part).count(), 1);
        let [mut all, mut part] = [SquareStatistics::default(); 2];
        all.push(1.0);
        all.push(3.0);
        part.push(3.0);
        assert_eq!(all.without(&part).mean(), Some(1.0));
        assert_eq!(all.without(&all).mean(), None);
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
}
