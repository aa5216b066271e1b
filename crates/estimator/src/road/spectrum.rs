//! Roughness by ISO 8608 from the variances of a profile in octave bands.
//!
//! On a road with Gd(n) = G (n0/n)^2 the output of a band filter with the gain |H(n)| has the variance
//! G I with I = integral of (n0/n)^2 |H(n)|^2 dn. Each band gives G = variance/I, whose distribution is that
//! of chi-square over nu with nu = 2 B L: the statistical bandwidth B = I^2/integral of ((n0/n)^2 |H|^2)^2 dn
//! and the length L. The sum of all bands weighted by nu is the maximum likelihood of G for separate bands. Its
//! degrees of freedom contain that the bands overlap.

use sample::RoadRoughness;

/// Number of bands.
const BANDS: usize = 4;

/// What the spectrum of a road is.
struct Standard {
    /// Reference n0, cycles/m.
    n0: f64,
    /// Edges of the octave bands, cycles/m: waves of 0.6 to 10 m.
    edges: [f64; BANDS + 1],
    /// Quantile of the normal distribution for bounds of 95 %.
    quantile: f64,
}

/// ISO 8608.
const ISO8608: Standard = Standard {
    n0: 0.1,
    edges: [0.1, 0.2, 0.4, 0.8, 1.6],
    quantile: 1.96,
};

/// A section of second order in direct form II, transposed.
#[derive(Clone, Copy, Debug)]
pub struct Section {
    b: [f64; 3],
    a: [f64; 2],
}

impl Section {
    /// Butterworth section with the corner at `edge`, cycles over cycles of sampling: low-pass or high-pass.
    #[must_use]
    pub fn new(edge: f64, high: bool) -> Self {
        Self::with_damping(edge, high, std::f64::consts::SQRT_2)
    }

    /// The same with another `damping`, which is twice the damping ratio: one section of a Butterworth
    /// filter of higher order.
    #[must_use]
    pub fn with_damping(edge: f64, high: bool, damping: f64) -> Self {
        let w = math::tan(std::f64::consts::PI * edge);
        let scale = 1.0 / (1.0 + damping * w + w * w);
        let a = [
            2.0 * (w * w - 1.0) * scale,
            (1.0 - damping * w + w * w) * scale,
        ];
        let b = if high {
            [scale, -2.0 * scale, scale]
        } else {
            let gain = w * w * scale;
            [gain, 2.0 * gain, gain]
        };
        Self { b, a }
    }

    /// Takes the next value and gives the filtered one. `memory`: of this signal, zero at the start.
    pub fn push(&self, memory: &mut [f64; 2], x: f64) -> f64 {
        let y = self.b[0] * x + memory[0];
        memory[0] = self.b[1] * x - self.a[0] * y + memory[1];
        memory[1] = self.b[2] * x - self.a[1] * y;
        y
    }

    /// |H|^2 at a frequency, cycles over cycles of sampling.
    fn power(&self, frequency: f64) -> f64 {
        let (s1, c1) = math::sin_cos(std::f64::consts::TAU * frequency);
        let (s2, c2) = math::sin_cos(2.0 * std::f64::consts::TAU * frequency);
        let square = |k: [f64; 3]| {
            let re = k[0] + k[1] * c1 + k[2] * c2;
            let im = k[1] * s1 + k[2] * s2;
            re * re + im * im
        };
        square(self.b) / square([1.0, self.a[0], self.a[1]])
    }
}

/// Filter of one band.
#[derive(Clone, Copy, Debug)]
struct Band {
    sections: [Section; 2],
    /// I, 1/m.
    integral: f64,
    /// B, cycles/m.
    bandwidth: f64,
}

impl Band {
    fn new(from: f64, to: f64, spacing_m: f64) -> Self {
        let sections = [
            Section::new(from * spacing_m, true),
            Section::new(to * spacing_m, false),
        ];
        let density = |n: f64| density(&sections, n, spacing_m);
        let integral = integral(spacing_m, density);
        let squares = self::integral(spacing_m, |n| density(n).powi(2));
        Self {
            sections,
            integral,
            bandwidth: integral * integral / squares,
        }
    }
}

/// (n0/n)^2 |H(n)|^2.
fn density(sections: &[Section; 2], n: f64, spacing_m: f64) -> f64 {
    let gain: f64 = sections.iter().map(|s| s.power(n * spacing_m)).product();
    (ISO8608.n0 / n) * (ISO8608.n0 / n) * gain
}

/// Integral over all frequencies of a profile, cycles/m.
fn integral(spacing_m: f64, value: impl Fn(f64) -> f64) -> f64 {
    let steps = (500.0 / spacing_m) as u32;
    let step = 0.5 / spacing_m / f64::from(steps);
    (0..steps)
        .map(|k| step * value(step * (f64::from(k) + 0.5)))
        .sum()
}

fn overlaps(bands: &[Band; BANDS], spacing_m: f64) -> [[f64; BANDS]; BANDS] {
    let of = |band: &Band, n: f64| density(&band.sections, n, spacing_m) / band.integral;
    std::array::from_fn(|i| {
        std::array::from_fn(|j| integral(spacing_m, |n| of(&bands[i], n) * of(&bands[j], n)))
    })
}

/// Variance of a band with a fading memory.
#[derive(Clone, Copy, Debug, Default)]
struct Fading {
    weights: f64,
    squares_of_weights: f64,
    sum_m2: f64,
}

/// Spectrum of four profiles.
#[derive(Clone, Debug)]
pub(super) struct Spectrum {
    spacing_m: f64,
    bands: [Band; BANDS],
    /// Integrals of the products of the bands' densities over their integrals, m: bands overlap.
    overlaps: [[f64; BANDS]; BANDS],
    /// Filters of each band and profile.
    memory: [[[[f64; 2]; 2]; 4]; BANDS],
    fading: [Fading; BANDS],
    /// Points since the profile began.
    points: u32,
    first_m: [f64; 4],
}

impl Spectrum {
    /// For points that are `spacing_m` apart.
    pub(super) fn new(spacing_m: f64) -> Self {
        let edges = &ISO8608.edges;
        let bands: [Band; BANDS] =
            std::array::from_fn(|i| Band::new(edges[i], edges[i + 1], spacing_m));
        Self {
            spacing_m,
            overlaps: overlaps(&bands, spacing_m),
            bands,
            memory: Default::default(),
            fading: Default::default(),
            points: 0,
            first_m: [0.0; 4],
        }
    }

    /// The profile begins anew; what is known of the road stays.
    pub(super) fn begin(&mut self) {
        self.memory = Default::default();
        self.points = 0;
    }

    /// Takes the next point of the four profiles, passed at `speed_m_s`.
    pub(super) fn push(
        &mut self,
        height_m: &[f64; 4],
        speed_m_s: f64,
        wave_hz_max: f64,
        memory_m: f64,
    ) {
        if self.points == 0 {
            self.first_m = *height_m;
        }
        self.points = self.points.saturating_add(1);
        let keep = 1.0 - self.spacing_m / memory_m;
        for (i, band) in self.bands.iter().enumerate() {
            let mut square = 0.0;
            for (profile, memory) in self.memory[i].iter_mut().enumerate() {
                let mut value = height_m[profile] - self.first_m[profile];
                for (section, memory) in band.sections.iter().zip(memory) {
                    value = section.push(memory, value);
                }
                square += 0.25 * value * value;
            }
            let settled = f64::from(self.points) * self.spacing_m * ISO8608.edges[i] > 1.5;
            if !settled || ISO8608.edges[i + 1] * speed_m_s > wave_hz_max {
                continue;
            }
            let fading = &mut self.fading[i];
            fading.weights = keep * fading.weights + 1.0;
            fading.squares_of_weights = keep * keep * fading.squares_of_weights + 1.0;
            fading.sum_m2 = keep * fading.sum_m2 + square;
        }
    }

    /// Roughness after at least `distance_m`.
    pub(super) fn roughness(&self, distance_m: f64) -> Option<RoadRoughness> {
        let (mut freedom, mut sum, mut longest_m) = (0.0, 0.0, 0.0_f64);
        let mut line = Line::default();
        let mut each = [[0.0; 2]; BANDS];
        for (i, (band, fading)) in self.bands.iter().zip(&self.fading).enumerate() {
            if fading.weights <= 0.0 {
                continue;
            }
            let length_m =
                self.spacing_m * fading.weights * fading.weights / fading.squares_of_weights;
            let nu = 2.0 * band.bandwidth * length_m;
            let density = fading.sum_m2 / fading.weights / band.integral;
            each[i] = [nu, length_m];
            freedom += nu;
            sum += nu * density;
            longest_m = longest_m.max(length_m);
            line.add(band.bandwidth_centre(), density, nu);
        }
        let known = freedom > 0.0 && longest_m >= distance_m && sum > 0.0;
        known.then(|| {
            let gd_n0_m3 = sum / freedom;
            // Wilson and Hilferty's approximation of the quantiles of chi-square over its degrees of freedom.
            let part = self.variance(&each, freedom) / 9.0;
            let bound = |z: f64| gd_n0_m3 / (1.0 - part + z * part.sqrt()).powi(3);
            RoadRoughness {
                gd_n0_m3,
                bounds_m3: [bound(ISO8608.quantile), bound(-ISO8608.quantile)],
                waviness: line.slope().map_or(f64::NAN, |slope| 2.0 - slope),
                distance_m: longest_m,
            }
        })
    }
}

impl Spectrum {
    /// Relative variance of the weighted sum: 2 over its degrees of freedom.
    fn variance(&self, each: &[[f64; 2]; BANDS], freedom: f64) -> f64 {
        let mut variance = 0.0;
        for ([nu, length_m], row) in each.iter().zip(&self.overlaps) {
            for ([other_nu, other_m], overlap) in each.iter().zip(row) {
                if *nu > 0.0 && *other_nu > 0.0 {
                    variance += nu * other_nu * overlap / (length_m * other_m).sqrt();
                }
            }
        }
        variance / (freedom * freedom)
    }
}

impl Band {
    /// Logarithm of the middle of the band, cycles/m.
    fn bandwidth_centre(&self) -> f64 {
        // The centre of (n0/n)^2 |H|^2 follows from its integral: G I/B is the density there.
        0.5 * math::ln(ISO8608.n0 * ISO8608.n0 * self.bandwidth / self.integral)
    }
}

/// Straight line through logarithms by weighted least squares.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    count: u32,
    w: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
}

impl Line {
    fn add(&mut self, x: f64, density: f64, weight: f64) {
        if density <= 0.0 {
            return;
        }
        let y = math::ln(density);
        self.count += 1;
        self.w += weight;
        self.x += weight * x;
        self.y += weight * y;
        self.xx += weight * x * x;
        self.xy += weight * x * y;
    }

    fn slope(&self) -> Option<f64> {
        (self.count > 1)
            .then(|| (self.w * self.xy - self.x * self.y) / (self.w * self.xx - self.x * self.x))
    }
}

#[cfg(test)]
mod tests {
    use math::Random;

    use super::*;

    /// A random walk of heights has the waviness 2: steps of variance q d have the density
    /// q/(2 pi n)^2 two-sided, twice that one-sided.
    #[test]
    fn a_random_walk_has_its_roughness_within_the_bounds() {
        let spacing_m = 0.1;
        let wanted = 256e-6;
        let q = wanted * 0.5 * (std::f64::consts::TAU * ISO8608.n0).powi(2);
        let mut random = Random::new(11);
        let mut inside = 0;
        for _ in 0..40 {
            let mut spectrum = Spectrum::new(spacing_m);
            let mut height_m = [0.0; 4];
            for _ in 0..4000 {
                let step = (q * spacing_m).sqrt() * random.normal();
                height_m = height_m.map(|h| h + step);
                spectrum.push(&height_m, 10.0, 22.0, 150.0);
            }
            let found = spectrum.roughness(50.0).expect("a roughness");
            let [low, high] = found.bounds_m3;
            inside += u32::from(low < wanted && wanted < high);
            assert!((found.gd_n0_m3 / wanted - 1.0).abs() < 0.4, "{found:?}");
            assert!((found.waviness - 2.0).abs() < 0.5, "{found:?}");
        }
        assert!(inside >= 34, "{inside} of 40");
    }
}
