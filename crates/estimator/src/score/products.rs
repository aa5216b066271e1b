//! Sums of products of series at many lags, formed in the frequency domain.

use std::fmt;
use std::sync::{Arc, Mutex, OnceLock};

use multiversion::multiversion;
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftDirection, FftPlanner};

/// Length of a transform for each lag, at least: a block of it is used without its last lags.
const LENGTH_PER_LAG: usize = 8;

/// Sums of `fixed[i][k] moving[j][k + lag]` over all k, for each pair of several series and each lag from
/// zero up, of series that come in parts.
///
/// Each block of a series is transformed together with its counterpart: the fixed series, followed by zeros,
/// is the real part. The moving one, which is longer by the lags, is the imaginary part. The sum of
/// `conj(F_i) M_j` over the blocks is the transform of the sums.
#[derive(Clone)]
pub(crate) struct LaggedProducts {
    series: usize,
    lags: usize,
    /// Number of values of a fixed series that are transformed together.
    block: usize,
    forward: Arc<dyn Fft<f64>>,
    /// Of each pair, at each frequency from zero up to half of the rate.
    spectra: Vec<Spectrum>,
}

/// Real and imaginary parts.
#[derive(Clone)]
struct Spectrum([Vec<f64>; 2]);

impl Spectrum {
    fn zero(frequencies: usize) -> Self {
        Self([(); 2].map(|()| vec![0.0; frequencies]))
    }
}

impl fmt::Debug for LaggedProducts {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (series, lags) = (self.series, self.lags);
        write!(out, "LaggedProducts({series} series, {lags} lags)")
    }
}

/// The transform of a length. Transforms of a length share their tables.
fn transform(length: usize, direction: FftDirection) -> Arc<dyn Fft<f64>> {
    static PLANNER: OnceLock<Mutex<FftPlanner<f64>>> = OnceLock::new();
    let planner = PLANNER.get_or_init(|| Mutex::new(FftPlanner::new()));
    let mut planner = planner.lock().unwrap_or_else(|held| held.into_inner());
    planner.plan_fft(length, direction)
}

impl LaggedProducts {
    /// For pairs of `series` fixed and as many moving series.
    pub fn new(series: usize, lags: usize) -> Self {
        let length = (LENGTH_PER_LAG * lags.max(1)).next_power_of_two();
        Self {
            series,
            lags,
            block: length - lags.saturating_sub(1),
            forward: transform(length, FftDirection::Forward),
            spectra: vec![Spectrum::zero(length / 2 + 1); series * series],
        }
    }

    /// Number of values of a fixed series that are transformed together.
    pub const fn block(&self) -> usize {
        self.block
    }

    /// Takes the next values, of the moving series those of the lags too. The series are equally long, and
    /// the moving ones are longer by the number of lags less one.
    pub fn add(&mut self, fixed: &[&[f64]], moving: &[&[f64]]) {
        let (block, frequencies) = (self.block, self.forward.len() / 2 + 1);
        let mut buffer = vec![Complex::default(); self.forward.len()];
        let mut scratch = vec![Complex::default(); self.forward.get_inplace_scratch_len()];
        let mut transforms =
            vec![[(); 2].map(|()| Spectrum::zero(frequencies)); fixed.len().min(self.series)];
        let length = fixed.first().map_or(0, |fixed| fixed.len());
        for start in (0..length).step_by(block) {
            let end = length.min(start + block);
            for ((fixed, moving), transforms) in fixed.iter().zip(moving).zip(&mut transforms) {
                let moving = &moving[start..end + self.lags - 1];
                buffer.fill(Complex::default());
                for (to, value) in buffer.iter_mut().zip(&fixed[start..end]) {
                    to.re = *value;
                }
                for (to, value) in buffer.iter_mut().zip(moving) {
                    to.im = *value;
                }
                self.forward.process_with_scratch(&mut buffer, &mut scratch);
                separate(&buffer, transforms);
            }
            let pairs = transforms.iter().flat_map(|[fixed, _]| {
                let moving = transforms.iter().map(|[_, moving]| moving);
                moving.map(move |moving| (fixed, moving))
            });
            for (sums, (fixed, moving)) in self.spectra.iter_mut().zip(pairs) {
                add_products(sums, fixed, moving);
            }
        }
    }

    /// The sums of each pair, of which the moving series changes first, for each lag.
    pub fn sums(&self) -> impl Iterator<Item = Vec<f64>> {
        let length = self.forward.len();
        let inverse = transform(length, FftDirection::Inverse);
        self.spectra.iter().map(move |Spectrum([re, im])| {
            let mut buffer = vec![Complex::default(); length];
            for (k, (re, im)) in re.iter().zip(im).enumerate() {
                buffer[k] = Complex::new(*re, *im);
                buffer[(length - k) % length] = Complex::new(*re, -im);
            }
            inverse.process(&mut buffer);
            let lags = buffer.iter().take(self.lags);
            lags.map(|sum| sum.re / length as f64).collect()
        })
    }
}

/// The transforms of the real and of the imaginary part out of that of both.
fn separate(both: &[Complex<f64>], [real, imaginary]: &mut [Spectrum; 2]) {
    let length = both.len();
    for k in 0..=length / 2 {
        let (one, other) = (both[k], both[(length - k) % length].conj());
        let (sum, difference) = (0.5 * (one + other), 0.5 * (one - other));
        (real.0[0][k], real.0[1][k]) = (sum.re, sum.im);
        (imaginary.0[0][k], imaginary.0[1][k]) = (difference.im, -difference.re);
    }
}

/// Adds the products of the conjugate of `fixed` with `moving`.
fn add_products(sums: &mut Spectrum, fixed: &Spectrum, moving: &Spectrum) {
    let ([re, im], [a, b], [c, d]) = (&mut sums.0, &fixed.0, &moving.0);
    add_complex_products(re, im, [a, b], [c, d]);
}

/// Adds `(a - bi)(c + di)`.
#[multiversion(targets("x86_64+avx+avx2"))]
fn add_complex_products(re: &mut [f64], im: &mut [f64], [a, b]: [&[f64]; 2], [c, d]: [&[f64]; 2]) {
    let count = re.len();
    let (im, a, b, c, d) = (
        &mut im[..count],
        &a[..count],
        &b[..count],
        &c[..count],
        &d[..count],
    );
    for k in 0..count {
        re[k] += a[k] * c[k] + b[k] * d[k];
        im[k] += a[k] * d[k] - b[k] * c[k];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of a sum of thousands of products whose size is about one.
    const ROUNDING: f64 = 1e-9;

    #[test]
    fn sums_are_those_of_one_lag_at_a_time() {
        let wave = |length: usize, phase: f64| -> Vec<f64> {
            let at = |k: usize| math::sin(0.11 * k as f64 + phase) + 0.3 * (k % 7) as f64;
            (0..length).map(at).collect()
        };
        let lags = 37;
        let mut all = LaggedProducts::new(2, lags);
        let length = 3 * all.block() + 11;
        let series = [0.0, 1.0].map(|phase| wave(length + lags - 1, phase));
        // Two parts: the second begins where the fixed series of the first end.
        for range in [0..500, 500..length] {
            let fixed = series.each_ref().map(|all| &all[range.clone()]);
            let longer = range.start..range.end + lags - 1;
            let moving = series.each_ref().map(|all| &all[longer.clone()]);
            all.add(&fixed, &moving);
        }
        let found: Vec<Vec<f64>> = all.sums().collect();
        assert_eq!(found.len(), 4);
        for (pair, sums) in found.iter().enumerate() {
            let (fixed, moving) = (&series[pair / 2][..length], &series[pair % 2]);
            assert_eq!(sums.len(), lags);
            for (lag, sum) in sums.iter().enumerate() {
                let products = fixed.iter().zip(&moving[lag..]).map(|(x, y)| x * y);
                let exact: f64 = products.sum();
                assert!((sum - exact).abs() < ROUNDING, "{pair} {lag} {sum} {exact}");
            }
        }
    }
}
