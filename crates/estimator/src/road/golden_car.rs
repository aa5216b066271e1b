//! International Roughness Index: the quarter car with the golden parameters at 80 km/h over a profile.
//!
//! z_s'' = -c (z_s' - z_u') - k_s (z_s - z_u)
//! mu z_u'' = c (z_s' - z_u') + k_s (z_s - z_u) - k_t (z_u - h)
//!
//! with c = 6.0 1/s, k_s = 63.3 1/s^2, k_t = 653 1/s^2, mu = 0.15, all over the sprung mass, and h the
//! profile averaged over 0.25 m. The index is the mean of |z_s' - z_u'| over the distance, divided by the
//! speed (Sayers, On the calculation of international roughness index from longitudinal road profile,
//! Transportation Research Record 1501, 1995). The profile is linear between its points.

use nalgebra::{SMatrix, SVector};

/// Parameters of a quarter car over its sprung mass.
struct QuarterCar {
    /// k_s, 1/s^2.
    spring: f64,
    /// k_t, 1/s^2.
    tyre: f64,
    /// c, 1/s.
    damper: f64,
    /// mu.
    mass: f64,
    /// Speed, m/s.
    speed_m_s: f64,
}

/// The golden car.
const GOLDEN: QuarterCar = QuarterCar {
    spring: 63.3,
    tyre: 653.0,
    damper: 6.0,
    mass: 0.15,
    speed_m_s: 80.0 / 3.6,
};

type Transition = SMatrix<f64, 6, 6>;

/// A step of the car over one distance between points of the profile.
#[derive(Clone, Debug)]
pub(super) struct GoldenStep(Transition);

impl GoldenStep {
    /// For points that are `spacing_m` apart.
    pub(super) fn new(spacing_m: f64) -> Self {
        // States: z_s, z_s', z_u, z_u', the profile, and its change over the step.
        let dt = spacing_m / GOLDEN.speed_m_s;
        let mut rates = Transition::zeros();
        rates[(0, 1)] = dt;
        rates[(2, 3)] = dt;
        for (column, value) in [-GOLDEN.spring, -GOLDEN.damper, GOLDEN.spring, GOLDEN.damper]
            .into_iter()
            .enumerate()
        {
            rates[(1, column)] = dt * value;
            rates[(3, column)] = -dt * value / GOLDEN.mass;
        }
        rates[(3, 2)] -= dt * GOLDEN.tyre / GOLDEN.mass;
        rates[(3, 4)] = dt * GOLDEN.tyre / GOLDEN.mass;
        rates[(4, 5)] = 1.0;
        Self(exponential(&rates))
    }
}

/// e^A by its series of A/256, squared eight times.
fn exponential(a: &Transition) -> Transition {
    let small = a / 256.0;
    let mut sum = Transition::identity();
    let mut term = Transition::identity();
    for n in 1..=12 {
        term = term * small / f64::from(n);
        sum += term;
    }
    for _ in 0..8 {
        sum = sum * sum;
    }
    sum
}

/// The car on one profile.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct GoldenCar {
    state: [f64; 4],
    /// The last three points of the profile, the newest first; no point before the first.
    points: [Option<f64>; 3],
    /// The last point of the averaged profile.
    before: Option<f64>,
}

impl GoldenCar {
    /// Takes the next point of the profile; returns |z_s' - z_u'| over the speed, m/m.
    pub(super) fn push(&mut self, height_m: f64, step: &GoldenStep) -> Option<f64> {
        self.points.rotate_right(1);
        self.points[0] = Some(height_m);
        let [Some(newest), Some(middle), Some(oldest)] = self.points else {
            return None;
        };
        // Weights with the second moment of the mean over 0.25 m, for points 0.1 m apart.
        let mean = 0.26 * newest + 0.48 * middle + 0.26 * oldest;
        let Some(before) = self.before.replace(mean) else {
            self.state = [mean, 0.0, mean, 0.0];
            return None;
        };
        let [s, ds, u, du] = self.state;
        let next = step.0 * SVector::from([s, ds, u, du, before, mean - before]);
        self.state = [next[0], next[1], next[2], next[3]];
        Some((next[1] - next[3]).abs() / GOLDEN.speed_m_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The response to a sine by the equations in the frequency domain.
    #[test]
    fn a_sine_gives_the_response_of_the_equations() {
        let spacing_m = 0.1;
        let step = GoldenStep::new(spacing_m);
        for wave_m in [2.0, 5.0, 15.0] {
            let mut car = GoldenCar::default();
            let (mut sum, mut count) = (0.0, 0);
            let amplitude = 0.01;
            for k in 0..20_000 {
                let x = spacing_m * f64::from(k);
                let h = amplitude * math::sin(std::f64::consts::TAU * x / wave_m);
                if let Some(moved) = car.push(h, &step).filter(|_| x > 500.0) {
                    sum += moved;
                    count += 1;
                }
            }
            let w = std::f64::consts::TAU * GOLDEN.speed_m_s / wave_m;
            let gain = suspension_rate(w);
            // Mean of |sin| is 2/pi; the profile is averaged over 0.25 m and between its points.
            let half = std::f64::consts::PI * 0.25 / wave_m;
            let expected = 2.0 / std::f64::consts::PI * amplitude * gain / GOLDEN.speed_m_s
                * (math::sin(half) / half);
            let found = sum / f64::from(count);
            assert!(
                (found / expected - 1.0).abs() < 0.02,
                "{wave_m}: {found} {expected}"
            );
        }
    }

    /// |z_s' - z_u'| for a profile of amplitude 1 at the angular frequency w, 1/s.
    fn suspension_rate(w: f64) -> f64 {
        use nalgebra::Complex;
        let i = Complex::new(0.0, w);
        let link = i * GOLDEN.damper + GOLDEN.spring;
        // (s^2 + link) z_s = link z_u; (mu s^2 + link + k_t) z_u = link z_s + k_t.
        let ratio = link / (i * i + link);
        let unsprung = Complex::new(GOLDEN.tyre, 0.0)
            / (i * i * GOLDEN.mass + link + GOLDEN.tyre - link * ratio);
        (i * (ratio - 1.0) * unsprung).norm()
    }
}
