//! Estimates against truth: errors, delay and consistency of time series.
//!
//! All functions take equally spaced, equally long slices. Pairs of which either value is not
//! finite are left out.

/// Errors of one signal.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    let mut sizes: Vec<f64> = Vec::with_capacity(estimate.len());
    let (mut sum, mut squares) = (0.0, 0.0);
    for (error, _) in pairs(estimate, truth).map(|(e, t)| (e - t, t)) {
        sum += error;
        squares += error * error;
        sizes.push(error.abs());
    }
    if sizes.is_empty() {
        return None;
    }
    sizes.sort_by(f64::total_cmp);
    let count = sizes.len();
    let rank = (0.95 * count as f64).ceil() as usize;
    Some(Errors {
        count,
        mean: sum / count as f64,
        rmse: (squares / count as f64).sqrt(),
        peak: sizes[count - 1],
        percentile_95: sizes[rank.clamp(1, count) - 1],
    })
}

/// 100 RMSE / max(peak of |truth|, floor), per cent: for a tyre's force the floor is the static
/// wheel load.
#[must_use]
pub fn normalised_error_percent(estimate: &[f64], truth: &[f64], floor: f64) -> Option<f64> {
    let errors = errors(estimate, truth)?;
    let peak = truth
        .iter()
        .filter(|value| value.is_finite())
        .fold(floor.abs(), |peak, value| peak.max(value.abs()));
    (peak > 0.0).then(|| 100.0 * errors.rmse / peak)
}

/// How late `estimate` is against `truth`, in sample intervals, within plus and minus `most`: the
/// peak of the cross-correlation of what both have beside their means, between samples by a
/// parabola. `None` where a series does not move or the peak stands at the end of the range.
#[must_use]
pub fn delay(estimate: &[f64], truth: &[f64], most: usize) -> Option<f64> {
    let length = estimate.len().min(truth.len());
    if length < 2 * most + 3 {
        return None;
    }
    let clean = |series: &[f64]| -> Option<Vec<f64>> {
        let finite: Vec<f64> = series.iter().copied().filter(|x| x.is_finite()).collect();
        let mean = finite.iter().sum::<f64>() / finite.len().max(1) as f64;
        let centred: Vec<f64> = series[..length]
            .iter()
            .map(|x| if x.is_finite() { x - mean } else { 0.0 })
            .collect();
        centred.iter().any(|x| *x != 0.0).then_some(centred)
    };
    let (estimate, truth) = (clean(estimate)?, clean(truth)?);
    let middle = &truth[most..length - most];
    let correlation = |shift: usize| -> f64 {
        let part = &estimate[shift..shift + middle.len()];
        let energy: f64 = part.iter().map(|x| x * x).sum();
        let product: f64 = part.iter().zip(middle).map(|(a, b)| a * b).sum();
        product / energy.max(f64::MIN_POSITIVE).sqrt()
    };
    let all: Vec<f64> = (0..=2 * most).map(correlation).collect();
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
    Some(best as f64 + part - most as f64)
}

/// Mean of ((estimate - truth)/sigma)^2: one where the stated deviations hold, more where the
/// estimator is too sure of itself.
#[must_use]
pub fn normalised_square(estimate: &[f64], truth: &[f64], sigma: &[f64]) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0.0);
    for ((e, t), s) in estimate.iter().zip(truth).zip(sigma) {
        let square = ((e - t) / s).powi(2);
        if square.is_finite() {
            sum += square;
            count += 1.0;
        }
    }
    (count > 0.0).then(|| sum / count)
}

/// Median; `None` without a value. The values are put in order.
#[must_use]
pub fn median(values: &mut [f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    let (_, median, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    Some(*median)
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
        let percent = normalised_error_percent(&[1.0, 1.0], &[0.0, 2.0], 4.0).unwrap();
        assert!((percent - 25.0).abs() < 1e-12);
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
        let mean = normalised_square(&[1.0, 3.0], &[0.0, 0.0], &[1.0, 1.0]).unwrap();
        assert!((mean - 5.0).abs() < 1e-12);
    }
}
