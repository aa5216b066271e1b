//! The kind of ground, by forces alone: a hidden Markov model whose classes have Gaussian features.
//!
//! | feature | from |
//! |---|---|
//! | ln of the friction over that of the vehicle file | `grip.rs`, mean of the axles; while too little of the grip is used, the lower bound of the friction |
//! | ln of the factor on the cornering stiffness | `grip.rs`, mean of the axles |
//! | rolling resistance over load, less that of the vehicle file | -F_x/F_z of the axle that is not driven, while the other one drives: then nobody brakes |
//! | ln of the density of the load's noise | `fusion/force_noise.rs`: roughness of the last seconds; the class of `/estimate/road` needs 50 m |
//!
//! A class has a mean m and a standard deviation d of each feature. A feature x with the standard deviation s has the
//! density N(x; m, d^2 + s^2). A lower bound b of a feature has the probability of a value above it,
//! Phi((m - b)/d). The filter lowers the density of the load's noise slowly after a step of the ground or on smoother
//! ground: while the density falls faster than `road_falls_1_s`, it is an upper bound with the probability
//! Phi((x - m)/sqrt(d^2 + s^2)). The class "unknown" has wide standard deviations: it is the most probable where no class fits. A
//! feature that is not known does not count. With the product L of the densities, the probabilities p follow
//! from those of the last time by the forward step of the hidden Markov model (Rabiner, A tutorial on hidden Markov
//! models, Proc. IEEE 77, 1989, section III.A):
//!
//! p ~ ((1 - e) p_before + e/5) L^w
//!
//! e is the time between two steps over `stays_s`. Errors of the features last for `correlation_s`, and w is the time
//! between two steps over it.

use model::vehicle::{Axle, Vehicle};
use sample::{AxleGrip, LogTime, PerWheel, Terrain, TerrainClass, TyreForce};

use crate::tuning::TerrainTuning;

const CLASSES: usize = TerrainClass::COUNT;

/// Number of features.
const FEATURES: usize = 4;

/// Features that can be bounds.
const FRICTION: usize = 0;
const ROAD: usize = 3;

/// A value with its standard deviation; `NaN` where not known.
type Feature = [f64; 2];

/// Probabilities of the classes of ground.
#[derive(Clone, Debug)]
pub struct TerrainEstimator {
    tuning: TerrainTuning,
    /// The axle that is not driven; `None` if both are.
    free_axle: Option<usize>,
    file_friction: [f64; 2],
    file_resistance: [f64; 2],
    probability: [f64; CLASSES],
    resistance: Resistance,
    road: RoadDensity,
}

/// Ln of the density of the road and the fading mean of its rate, 1/s.
#[derive(Clone, Copy, Debug, Default)]
struct RoadDensity {
    before: Option<f64>,
    rate_1_s: f64,
}

/// Fading means of the rolling resistance over load and of its standard deviation.
#[derive(Clone, Copy, Debug, Default)]
struct Resistance {
    mean: f64,
    sigma: f64,
    /// Time that the means contain, s.
    span_s: f64,
}

impl TerrainEstimator {
    /// Nothing known yet.
    #[must_use]
    pub fn new(vehicle: &Vehicle, tuning: &TerrainTuning) -> Self {
        let axles = [&vehicle.front, &vehicle.rear];
        let front = vehicle.drivetrain.drive_split_front;
        Self {
            tuning: *tuning,
            free_axle: if front <= 0.0 {
                Some(0)
            } else if front >= 1.0 {
                Some(1)
            } else {
                None
            },
            file_friction: axles.map(|axle: &Axle| axle.tyre.friction),
            file_resistance: axles.map(|axle: &Axle| axle.tyre.rolling_resistance),
            probability: [1.0 / CLASSES as f64; CLASSES],
            resistance: Resistance::default(),
            road: RoadDensity::default(),
        }
    }

    /// The same on other tyres.
    pub fn load(&mut self, vehicle: &Vehicle) {
        let tyres = [&vehicle.front.tyre, &vehicle.rear.tyre];
        self.file_friction = tyres.map(|tyre| tyre.friction);
        self.file_resistance = tyres.map(|tyre| tyre.rolling_resistance);
    }

    /// Takes the forces of one instant, contact frame.
    pub fn step(&mut self, dt: f64, speed_m_s: f64, forces: &PerWheel<TyreForce>) {
        let t = &self.tuning;
        let Some(free) = self.free_axle else {
            return;
        };
        let resistance = &mut self.resistance;
        resistance.span_s *= 1.0 - dt / t.resistance_kept_s;
        let sum = |axle: usize, axis: usize| {
            forces.0[2 * axle].force_n[axis] + forces.0[2 * axle + 1].force_n[axis]
        };
        let sigma_n = math::hypot(
            forces.0[2 * free].sigma_n[0],
            forces.0[2 * free + 1].sigma_n[0],
        );
        let (along_n, load_n) = (sum(free, 0), sum(free, 2));
        let driven = sum(1 - free, 0) / sum(1 - free, 2).max(1.0);
        let usable = speed_m_s > t.speed_min_m_s && load_n > t.load_min_n && driven > t.driven_min;
        if usable && along_n.is_finite() && sigma_n.is_finite() {
            let excess = -along_n / load_n - self.file_resistance[free];
            resistance.take(dt, [excess, sigma_n / load_n], t.resistance_s);
        }
    }

    /// The ground after a time since the last call, by the grip of both axles and the density of the road, N²/s.
    pub fn terrain(
        &mut self,
        now: LogTime,
        dt: f64,
        grip: [&AxleGrip; 2],
        road_density: f64,
    ) -> Terrain {
        let t = &self.tuning;
        let features = self.features(grip, road_density);
        let bound = [0, 1].map(|i| grip[i].friction_min / self.file_friction[i]);
        let bound_ln = math::ln(bound[0].max(bound[1]).max(t.bound_min));
        let falls = self.road.falls(dt, features[ROAD][0], t);
        let changes = (dt / t.stays_s).min(1.0);
        let weight = (dt / t.correlation_s).min(1.0);
        let logs: [f64; CLASSES] = std::array::from_fn(|class| {
            weight * log_likelihood(&features, bound_ln, falls, &t.class(class))
        });
        let most = logs.into_iter().fold(f64::NEG_INFINITY, f64::max);
        for (probability, log) in self.probability.iter_mut().zip(logs) {
            let before = (1.0 - changes) * *probability + changes / CLASSES as f64;
            *probability = before * math::exp(log - most);
        }
        let sum: f64 = self.probability.iter().sum();
        self.probability.iter_mut().for_each(|p| *p /= sum);
        self.present(now)
    }

    /// The ground by what is known until now.
    #[must_use]
    pub fn present(&self, now: LogTime) -> Terrain {
        let t = &self.tuning;
        let named = TerrainClass::ALL
            .into_iter()
            .find(|class| self.probability[class.index()] >= t.named_min);
        let [resistance, sigma] = self.resistance.feature(t);
        let file = self
            .free_axle
            .map_or(0.0, |free| self.file_resistance[free]);
        Terrain {
            time: now,
            class: named.unwrap_or(TerrainClass::Unknown),
            probability: self.probability,
            rolling_resistance: resistance + file,
            rolling_resistance_sigma: sigma,
        }
    }

    fn features(&self, grip: [&AxleGrip; 2], road_density: f64) -> [Feature; FEATURES] {
        let t = &self.tuning;
        let friction = [0, 1].map(|axle| {
            let (Some(value), Some(sigma)) = (grip[axle].friction, grip[axle].friction_sigma)
            else {
                return [f64::NAN; 2];
            };
            [math::ln(value / self.file_friction[axle]), sigma / value]
        });
        let stiffness = grip.map(|axle| {
            let (factor, sigma) = (axle.stiffness_factor, axle.stiffness_factor_sigma);
            [math::ln(factor), sigma / factor]
        });
        [
            mean(friction),
            mean(stiffness),
            self.resistance.feature(t),
            [math::ln(road_density), t.road_sigma],
        ]
    }
}

impl RoadDensity {
    /// Takes the present value; tells whether the density falls as fast as the filter lets it.
    fn falls(&mut self, dt: f64, now_ln: f64, tuning: &TerrainTuning) -> bool {
        let before = self.before.replace(now_ln).unwrap_or(now_ln);
        let part = (dt / tuning.road_rate_s).min(1.0);
        self.rate_1_s += part * ((now_ln - before) / dt - self.rate_1_s);
        self.rate_1_s < -tuning.road_falls_1_s
    }
}

impl Resistance {
    fn take(&mut self, dt: f64, [value, sigma]: Feature, memory_s: f64) {
        self.span_s += dt;
        let part = dt / self.span_s.clamp(dt, memory_s);
        self.mean += part * (value - self.mean);
        self.sigma += part * (sigma - self.sigma);
    }

    fn feature(&self, tuning: &TerrainTuning) -> Feature {
        if self.span_s < tuning.resistance_min_s {
            return [f64::NAN; 2];
        }
        [self.mean, math::hypot(self.sigma, tuning.resistance_sigma)]
    }
}

/// Mean of the axles that are known, weighted by their variances.
fn mean(axles: [Feature; 2]) -> Feature {
    let known = axles
        .into_iter()
        .filter(|[value, sigma]| value.is_finite() && *sigma > 0.0);
    let (mut weights, mut sum) = (0.0, 0.0);
    for [value, sigma] in known {
        weights += 1.0 / (sigma * sigma);
        sum += value / (sigma * sigma);
    }
    [sum / weights, (1.0 / weights).sqrt()]
}

/// Logarithm of the density of the known features in a class, whose features have means and standard deviations. The
/// friction has a lower bound where it is not known. The density of a road that falls is an upper bound.
fn log_likelihood(
    features: &[Feature; FEATURES],
    bound: f64,
    road_falls: bool,
    class: &[Feature; FEATURES],
) -> f64 {
    let of_feature = |feature: usize| {
        let ([value, sigma], [mean, spread]) = (features[feature], class[feature]);
        let variance = sigma * sigma + spread * spread;
        match feature {
            FRICTION if value.is_nan() => log_probability((mean - bound) / spread),
            _ if value.is_nan() => 0.0,
            ROAD if road_falls => log_probability((value - mean) / variance.sqrt()),
            _ => -0.5 * ((value - mean) * (value - mean) / variance + math::ln(variance)),
        }
    };
    (0..FEATURES).map(of_feature).sum()
}

/// Ln of the probability of a standard normal value below x, by the logistic function 1/(1 + e^(-1.702 x)), which differs
/// from that probability by less than 0.01 (Camilli, Origin of the scaling constant d = 1.7 in item response theory, J.
/// Educational and Behavioral Statistics 19, 1994).
fn log_probability(x: f64) -> f64 {
    -math::ln(1.0 + math::exp(-1.702 * x))
}

impl TerrainTuning {
    /// Means and standard deviations of the features of a class.
    fn class(&self, class: usize) -> [Feature; FEATURES] {
        [
            [self.friction_ln[class], self.friction_ln_spread[class]],
            [self.stiffness_ln[class], self.stiffness_ln_spread[class]],
            [self.resistance[class], self.resistance_spread[class]],
            [self.road_ln[class], self.road_ln_spread[class]],
        ]
    }
}

#[cfg(test)]
mod tests;
