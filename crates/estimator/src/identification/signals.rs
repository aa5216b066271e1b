//! Filters without delay, for signals on an even time grid.

/// Length of a filter's wing, standard deviations of its kernel.
const WING: f64 = 4.0;

/// A Gaussian low-pass without delay; at `cutoff_hz` a sine keeps 1/sqrt(2) of its amplitude.
/// `NaN` where the kernel meets an unknown value or an end.
#[must_use]
pub fn smooth(values: &[f64], dt_s: f64, cutoff_hz: f64) -> Vec<f64> {
    convolve(values, &kernel(dt_s, cutoff_hz))
}

/// Derivative by time of what [`smooth`] gives.
#[must_use]
pub fn slope(values: &[f64], dt_s: f64, cutoff_hz: f64) -> Vec<f64> {
    let plain = kernel(dt_s, cutoff_hz);
    let middle = (plain.len() / 2) as f64;
    let odd: Vec<f64> = plain
        .iter()
        .enumerate()
        .map(|(i, weight)| (i as f64 - middle) * weight)
        .collect();
    // A ramp of slope one must come out as one.
    let gain: f64 = odd
        .iter()
        .enumerate()
        .map(|(i, weight)| weight * (i as f64 - middle) * dt_s)
        .sum();
    convolve(values, &odd.iter().map(|w| w / gain).collect::<Vec<_>>())
}

/// Rows to keep so that what [`smooth`] left is sampled at eight times its cut-off: more rows only
/// repeat each other.
#[must_use]
pub fn stride(dt_s: f64, cutoff_hz: f64) -> usize {
    ((dt_s * cutoff_hz * 8.0).recip().round() as usize).max(1)
}

fn kernel(dt_s: f64, cutoff_hz: f64) -> Vec<f64> {
    // H(f) = exp(-2 pi^2 sigma^2 f^2) is 1/sqrt(2) at the cut-off.
    let sigma = std::f64::consts::LN_2.sqrt() / (std::f64::consts::TAU * cutoff_hz) / dt_s;
    let wing = (WING * sigma).ceil() as i64;
    let plain: Vec<f64> = (-wing..=wing)
        .map(|i| math::exp(-0.5 * (i as f64 / sigma).powi(2)))
        .collect();
    let sum: f64 = plain.iter().sum();
    plain.iter().map(|weight| weight / sum).collect()
}

fn convolve(values: &[f64], kernel: &[f64]) -> Vec<f64> {
    let wing = kernel.len() / 2;
    (0..values.len())
        .map(|i| {
            if i < wing || i + wing >= values.len() {
                return f64::NAN;
            }
            let window = &values[i - wing..=i + wing];
            window.iter().zip(kernel).map(|(v, w)| v * w).sum()
        })
        .collect()
}

/// Mean of the values that are known; `NaN` if none is.
#[must_use]
pub fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values.into_iter().filter(|value| value.is_finite()) {
        sum += value;
        count += 1.0;
    }
    sum / count
}

/// Standard deviation of the values that are known.
#[must_use]
pub fn spread(values: &[f64]) -> f64 {
    let middle = mean(values.iter().copied());
    mean(values.iter().map(|value| (value - middle).powi(2))).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_keeps_its_phase_and_the_amplitude_that_the_cut_off_says() {
        let wave: Vec<f64> = (0..1000)
            .map(|i| math::sin(std::f64::consts::TAU * 2.0 * 0.01 * f64::from(i)))
            .collect();
        let smoothed = smooth(&wave, 0.01, 2.0);
        let rate = slope(&wave, 0.01, 2.0);
        let half = std::f64::consts::FRAC_1_SQRT_2;
        for i in 200..800 {
            assert!((smoothed[i] - half * wave[i]).abs() < 1e-3);
            let true_rate = half
                * std::f64::consts::TAU
                * 2.0
                * math::cos(std::f64::consts::TAU * 2.0 * 0.01 * i as f64);
            assert!(
                (rate[i] - true_rate).abs() < 0.02,
                "{} {true_rate}",
                rate[i]
            );
        }
        assert!(smoothed[0].is_nan() && smoothed[999].is_nan());
        assert_eq!(stride(0.01, 2.0), 6);
    }
}
