//! Whether the intervals of the steps that measure a few readings, or windows of a drive, hold the
//! truth as often as they say.

use atvrec_estimator::Calibration;
use atvrec_estimator::calibration::gnss::Vectors;
use atvrec_estimator::calibration::imu::ImuSignal;
use atvrec_estimator::calibration::load_rig::{RigLoad, load_rig, members};
use atvrec_estimator::calibration::rest::Signal;
use atvrec_estimator::calibration::weight::{ScaleReading, weight};
use atvrec_estimator::calibration::wheel_radius::{RadiusInput, wheel_radius};
use atvrec_estimator::finding::Findings;
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use sample::{PerWheel, STANDARD_GRAVITY_M_S2, StrainChannel, Wheel};

use crate::coverage::covers;

const FEW: std::ops::Range<u64> = 0..30;
const ALL: std::ops::Range<u64> = 0..200;

pub struct Noise(ChaCha8Rng);

impl Noise {
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub fn of(&mut self, sigma: f64) -> f64 {
        let unit: f64 = StandardNormal.sample(&mut self.0);
        sigma * unit
    }
}

fn prowler() -> (Vehicle, Calibration) {
    let vehicle = Vehicle::builtin("prowler").expect("sound");
    let nominal = Calibration::nominal(&vehicle.name);
    (vehicle, nominal)
}

/// Seven loads on scales that err by 1.5 N; `None` for scales without error.
fn springs(seed: Option<u64>) -> Findings {
    let (vehicle, nominal) = prowler();
    let mut noise = Noise::new(seed.unwrap_or(0));
    let sigma_n = if seed.is_some() { 1.5 } else { 0.0 };
    let readings: Vec<ScaleReading> = [0.0, 60.0, 120.0, 180.0, 120.0, 60.0, 0.0]
        .into_iter()
        .map(|load_kg: f64| {
            let part_n = STANDARD_GRAVITY_M_S2 * load_kg / 4.0;
            ScaleReading {
                load_n: PerWheel(
                    [1327.0, 1327.0, 1831.0, 1831.0].map(|n| n + part_n + noise.of(sigma_n)),
                ),
                compression_m: PerWheel([0.0002 + part_n / 0.41 / 65_000.0; 4]),
            }
        })
        .collect();
    weight(&vehicle, &nominal, &readings)
        .expect("three loads")
        .findings
}

fn springs_hold(seeds: std::ops::Range<u64>) {
    let exact = springs(None);
    let names = ["preload", "rate", "friction"].map(|name| format!("RL spring {name}"));
    let truths: Vec<(&str, f64)> = names
        .iter()
        .map(|name| (name.as_str(), exact.value(name)[0]))
        .collect();
    covers(seeds, &truths, |seed| springs(Some(seed)));
}

#[test]
fn intervals_of_springs_hold() {
    springs_hold(FEW);
}

#[test]
#[ignore = "200 seeds: `make campaigns`"]
fn intervals_of_200_springs_hold() {
    springs_hold(ALL);
}

const GAIN_N: f64 = 27.025 * 1.03;
const OFFSET_COUNTS: f64 = 498.3;

/// One corner in the rig: counts err by 0.05, the linkage's forces by 0.2 % of the greatest.
fn gains(seed: u64) -> Findings {
    let (vehicle, nominal) = prowler();
    let sensors = Sensors::builtin("thesis-10bit").expect("sound");
    let mut noise = Noise::new(seed);
    let mut loads: Vec<RigLoad> = sim::RIG_N
        .into_iter()
        .map(|force_n| RigLoad {
            wheel: Wheel::FrontLeft,
            force_n,
            at_m: [0.0; 3],
            compression_m: 2e-5 * force_n[2] - 0.03,
            steering_wheel_rad: 0.0,
            counts: [None; StrainChannel::COUNT],
        })
        .collect();
    let forces: Vec<_> = loads
        .iter()
        .map(|load| members(&vehicle, &sensors, load).expect("within reach"))
        .collect();
    for channel in 0..5 {
        let most = forces.iter().map(|f| f[channel].abs()).fold(0.0, f64::max);
        for (load, force) in loads.iter_mut().zip(&forces) {
            let force_n = force[channel] + noise.of(0.002 * most);
            let counts = OFFSET_COUNTS + force_n / GAIN_N + noise.of(0.05);
            load.counts[channel] = Some([counts, 0.05]);
        }
    }
    load_rig(&vehicle, &sensors, &nominal, &loads)
        .expect("loads in all directions")
        .findings
}

const GAIN_TRUTHS: [(&str, f64); 4] = [
    ("FL upper_front gain", GAIN_N),
    ("FL upper_front offset", OFFSET_COUNTS),
    ("FL lower_rear gain", GAIN_N),
    ("FL lower_rear offset", OFFSET_COUNTS),
];

#[test]
fn intervals_of_gains_hold() {
    covers(FEW, &GAIN_TRUTHS, gains);
}

#[test]
#[ignore = "200 seeds: `make campaigns`"]
fn intervals_of_200_gains_hold() {
    covers(ALL, &GAIN_TRUTHS, gains);
}

const RADIUS_M: f64 = 0.2795;

/// Half a minute straight on at a speed that changes slowly.
fn radii(seed: u64) -> Findings {
    let mut noise = Noise::new(seed);
    let speed = |t: f64| 6.0 + 2.0 * math::sin(0.1 * t);
    let grid = |step_s: f64| -> Vec<f64> {
        (0..(30.0 / step_s) as usize)
            .map(|k| k as f64 * step_s)
            .collect()
    };
    let (fast_s, slow_s) = (grid(0.01), grid(0.05));
    let mut three = |base: [f64; 3], sigma: f64| base.map(|value| value + noise.of(sigma));
    let force: Vec<_> = fast_s
        .iter()
        .map(|_| three([0.0, 0.0, STANDARD_GRAVITY_M_S2], 0.03))
        .collect();
    let rate: Vec<_> = fast_s.iter().map(|_| three([0.0; 3], 0.005)).collect();
    let velocity: Vec<_> = slow_s
        .iter()
        .map(|t| three([0.6 * speed(*t), 0.8 * speed(*t), 0.0], 0.03))
        .collect();
    let wheels: [Vec<f64>; 4] = std::array::from_fn(|_| {
        let turning = fast_s.iter().map(|t| speed(*t) / RADIUS_M);
        turning.map(|w| w * (1.0 + noise.of(0.005))).collect()
    });
    wheel_radius(&RadiusInput {
        velocity: Vectors {
            time_s: &slow_s,
            value: &velocity,
        },
        latency_s: 0.0,
        imu: ImuSignal {
            time_s: &fast_s,
            force_m_s2: &force,
            rate_rad_s: &rate,
        },
        wheels_rad_s: std::array::from_fn(|i| Signal {
            time_s: &fast_s,
            value: &wheels[i],
        }),
    })
    .expect("straight and even")
    .findings
}

#[test]
fn intervals_of_rolling_radii_hold() {
    covers(FEW, &[("FL rolling radius", RADIUS_M)], radii);
}

#[test]
#[ignore = "200 seeds: `make campaigns`"]
fn intervals_of_200_rolling_radii_hold() {
    covers(ALL, &[("FL rolling radius", RADIUS_M)], radii);
}
