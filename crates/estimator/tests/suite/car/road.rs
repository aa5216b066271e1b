//! A lap of bends and straights with bank and grade, and the speed that is driven there.

use std::f64::consts::TAU;

use math::Random;

/// Distance of the grid, m.
const GRID_M: f64 = 1.0;

/// How fast, and over what road.
#[derive(Clone, Copy)]
pub struct Lap {
    pub seed: u64,
    pub lateral_m_s2: f64,
    pub speed_max_m_s: f64,
    pub push_m_s2: f64,
    pub brake_m_s2: f64,
    /// Bank of bends, rad for each m/s^2 of lateral acceleration.
    pub bend_bank: f64,
    /// Size of the bank elsewhere, rad, and of the grade.
    pub bank_rad: f64,
    pub grade: f64,
    /// Change of friction and stiffness from begin to end.
    pub drift: f64,
}

/// Columns over the way, one value a metre, around the lap.
pub struct Road {
    pub curvature: Vec<f64>,
    pub speed: Vec<f64>,
    pub bank: Vec<f64>,
    pub grade: Vec<f64>,
}

impl Road {
    pub fn new(lap: &Lap) -> Self {
        let mut random = Random::new(lap.seed);
        let curvature = bends(&mut random);
        let n = curvature.len();
        let bank = waves(&mut random, n, lap.bank_rad);
        let grade = waves(&mut random, n, lap.grade);
        let speed = speeds(&curvature, lap);
        let banked: Vec<f64> = (0..n)
            .map(|i| bank[i] + lap.bend_bank * speed[i] * speed[i] * curvature[i])
            .collect();
        Self {
            bank: smoothed(&banked, 40),
            grade,
            curvature,
            speed: smoothed(&speed, 6),
        }
    }

    pub fn length_m(&self) -> f64 {
        self.curvature.len() as f64 * GRID_M
    }

    pub fn at(&self, column: &[f64], place_m: f64) -> f64 {
        let whole = place_m.rem_euclid(self.length_m()) / GRID_M;
        let (i, part) = (whole as usize % column.len(), whole.fract());
        column[i] * (1.0 - part) + column[(i + 1) % column.len()] * part
    }
}

fn smoothed(values: &[f64], length: usize) -> Vec<f64> {
    let n = values.len();
    let mean = |i: usize| {
        let around = (0..length).map(|k| values[(i + n + k - length / 2) % n]);
        around.sum::<f64>() / length as f64
    };
    (0..n).map(mean).collect()
}

fn bends(random: &mut Random) -> Vec<f64> {
    let mut raw = Vec::new();
    let mut turned: f64 = 0.0;
    while raw.len() < 2600 {
        let straight_m = random.between(20.0, 260.0) as usize;
        raw.extend(std::iter::repeat_n(0.0, straight_m));
        let radius_m = math::exp(random.between(2.6, 4.8));
        let angle = random.between(0.5, 2.4);
        let sign = if turned.abs() > 2.5 {
            -turned.signum()
        } else {
            random.sign()
        };
        turned += sign * angle;
        let bend_m = (radius_m * angle) as usize;
        raw.extend(std::iter::repeat_n(sign / radius_m, bend_m));
    }
    smoothed(&smoothed(&raw, 22), 14)
}

fn waves(random: &mut Random, n: usize, size: f64) -> Vec<f64> {
    let parts: Vec<[f64; 3]> = (0..6)
        .map(|_| {
            let count = random.between(2.0, 25.0).floor();
            [random.normal(), count, random.between(0.0, TAU)]
        })
        .collect();
    let at = |i: usize| {
        let turn = TAU * i as f64 / n as f64;
        let sum = |[size, count, phase]: &[f64; 3]| size * math::sin(count * turn + phase);
        size * 0.577 * parts.iter().map(sum).sum::<f64>()
    };
    (0..n).map(at).collect()
}

/// What the friction ellipse lets through, braking and speeding up included.
fn speeds(curvature: &[f64], lap: &Lap) -> Vec<f64> {
    let n = curvature.len();
    let mut speed: Vec<f64> = curvature
        .iter()
        .map(|k| {
            (lap.lateral_m_s2 / k.abs().max(1e-5))
                .sqrt()
                .min(lap.speed_max_m_s)
        })
        .collect();
    let left = |v: f64, k: f64, most: f64| {
        let used = (v * v * k.abs() / lap.lateral_m_s2).min(1.0);
        most * (1.0 - used * used).sqrt().max(0.05)
    };
    for _ in 0..2 {
        for i in 0..n {
            let (v, next) = (speed[i], (i + 1) % n);
            let engine = lap.push_m_s2 * (1.0 - 0.5 * v / lap.speed_max_m_s);
            let gained = 2.0 * left(v, curvature[i], engine) * GRID_M;
            speed[next] = speed[next].min((v * v + gained).sqrt());
        }
        for i in (0..n).rev() {
            let next = (i + 1) % n;
            let v = speed[next];
            let lost = 2.0 * left(v, curvature[next], lap.brake_m_s2) * GRID_M;
            speed[i] = speed[i].min((v * v + lost).sqrt());
        }
    }
    speed
}
