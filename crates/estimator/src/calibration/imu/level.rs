//! What all rests say together: biases and the floor's slope.

use nalgebra::{Matrix2x4, Matrix4, Vector4};
use sample::STANDARD_GRAVITY_M_S2;

use super::ImuLog;
use crate::calibration::rest::{Stretch, mean};
use crate::finding::{Finding, Refusal, Span};
use crate::statistics::interval_95;

/// Two headings must differ by this much, rad (150 degrees).
const HEADINGS_DIFFER_RAD: f64 = 2.6;
/// Least rest at a heading, s.
const REST_NEEDED_S: f64 = 3.0;
/// Most that an accelerometer at rest may be from gravity, m/s^2.
const GRAVITY_WITHIN_M_S2: f64 = 1.0;

/// What all rests say together.
pub(super) struct Level {
    /// Specific force without the floor's slope, sensor axes, m/s^2.
    pub(super) force: [f64; 3],
    pub(super) force_sigma: [f64; 3],
    /// Rate, sensor axes, rad/s.
    pub(super) rate: [f64; 3],
    pub(super) rate_sigma: [f64; 3],
    /// Lean at rest, rad: pots that are not zeroed yet, and the springs' own.
    pub(super) lean: [f64; 2],
    pub(super) slope_rad: f64,
    pub(super) condition: f64,
    pub(super) span: Span,
}

/// One stretch of rest.
struct Still {
    force: [f64; 3],
    rate: [f64; 3],
    /// Standard deviations of one reading.
    noise: [[f64; 3]; 2],
    readings: f64,
    heading_rad: f64,
    lean: [f64; 2],
    stretch: Stretch,
}

impl Level {
    pub(super) fn find(logs: &[ImuLog<'_>]) -> Result<Self, Refusal> {
        // A slope belongs to one floor: the log with the most different headings is taken.
        let stills: Vec<Vec<Still>> = logs.iter().map(stills).collect();
        let spread = |stills: &Vec<Still>| {
            let turned = stills.iter().flat_map(|a| {
                stills
                    .iter()
                    .map(move |b| apart(a.heading_rad, b.heading_rad))
            });
            turned.fold(0.0, f64::max)
        };
        let Some(stills) = stills.iter().max_by(|a, b| spread(a).total_cmp(&spread(b))) else {
            return Err(missing("inertial unit", "give a log with one"));
        };
        let rested_s: f64 = stills
            .iter()
            .map(|s| s.stretch.to_s - s.stretch.from_s)
            .fold(0.0, |sum, length| sum + length);
        if rested_s < 2.0 * REST_NEEDED_S {
            return Err(Refusal::TooShort {
                what: String::new(),
                found_s: rested_s,
                needed_s: 2.0 * REST_NEEDED_S,
                help:
                    "let the vehicle stand still for 10 s, turn it by 180 degrees on the spot of \
                       floor, and let it stand for 10 s, in one log"
                        .to_owned(),
            });
        }
        let turned = spread(stills);
        if turned < HEADINGS_DIFFER_RAD {
            return Err(Refusal::NotExcited {
                what: String::new(),
                quantity: "difference of the headings at rest".to_owned(),
                found: turned.to_degrees(),
                needed: HEADINGS_DIFFER_RAD.to_degrees(),
                unit: "deg".to_owned(),
                help: "turn the vehicle by 180 degrees between two stretches of rest in one log"
                    .to_owned(),
            });
        }
        Self::solve(stills)
    }

    /// f_x = c_x + cos(psi) t_1 + sin(psi) t_2, f_y = c_y - sin(psi) t_1 + cos(psi) t_2, with the
    /// slope's part t of gravity in floor axes; weighted by readings.
    fn solve(stills: &[Still]) -> Result<Self, Refusal> {
        let (mut normal, mut right, mut spread) =
            (Matrix4::zeros(), Vector4::zeros(), Matrix4::zeros());
        for still in stills {
            let (sine, cosine) = math::sin_cos(still.heading_rad);
            let rows = Matrix2x4::new(1.0, 0.0, cosine, sine, 0.0, 1.0, -sine, cosine);
            for axis in 0..2 {
                let row = rows.row(axis).transpose();
                normal += row * row.transpose() * still.readings;
                right += row * still.force[axis] * still.readings;
                let variance = still.noise[0][axis].powi(2);
                spread += row * row.transpose() * still.readings * variance;
            }
        }
        let inverse = normal.try_inverse().ok_or(Refusal::Singular {
            what: String::new(),
            condition: f64::INFINITY,
            help: "turn the vehicle by 180 degrees between two stretches of rest".to_owned(),
        })?;
        let solution = inverse * right;
        let covariance = inverse * spread * inverse;
        let readings: f64 = stills.iter().map(|still| still.readings).sum();
        let over = |value: &dyn Fn(&Still) -> f64| {
            stills
                .iter()
                .map(|still| value(still) * still.readings)
                .sum::<f64>()
                / readings
        };
        let deviation = |value: &dyn Fn(&Still) -> f64| over(&|s| value(s).powi(2)).sqrt();
        let values = normal.symmetric_eigenvalues();
        let first = stills
            .iter()
            .map(|s| s.stretch.from_s)
            .fold(f64::INFINITY, f64::min);
        let last = stills.iter().map(|s| s.stretch.to_s).fold(0.0, f64::max);
        Ok(Self {
            force: [solution[0], solution[1], over(&|s| s.force[2])],
            force_sigma: [
                covariance[(0, 0)].sqrt(),
                covariance[(1, 1)].sqrt(),
                deviation(&|s| s.noise[0][2]) / readings.sqrt(),
            ],
            rate: std::array::from_fn(|axis| over(&|s| s.rate[axis])),
            rate_sigma: std::array::from_fn(|axis| {
                deviation(&|s| s.noise[1][axis]) / readings.sqrt()
            }),
            lean: [0, 1].map(|axis| over(&|s| s.lean[axis])),
            slope_rad: math::hypot(solution[2], solution[3]) / STANDARD_GRAVITY_M_S2,
            condition: (values.max() / values.min()).sqrt(),
            span: Span {
                from_s: first,
                to_s: last,
                used_s: stills
                    .iter()
                    .map(|s| s.stretch.to_s - s.stretch.from_s)
                    .sum(),
                rows: readings as usize,
            },
        })
    }

    pub(super) fn findings(&self, bias: [f64; 3], bias_sigma: [f64; 3]) -> Vec<Finding> {
        let finding = |name: String, value: f64, sigma: f64, unit: &str| Finding {
            name,
            value,
            unit: unit.to_owned(),
            sigma,
            interval: Some(interval_95(value, sigma)),
            condition: self.condition,
            excitation: None,
            whiteness: None,
            span: self.span,
        };
        let names = ["x", "y", "z"];
        let forces = (0..3).map(|axis| {
            let name = format!("accelerometer bias {}", names[axis]);
            finding(name, bias[axis], bias_sigma[axis], "m/s^2")
        });
        let rates = (0..3).map(|axis| {
            let name = format!("gyro bias {}", names[axis]);
            finding(name, self.rate[axis], self.rate_sigma[axis], "rad/s")
        });
        forces.chain(rates).collect()
    }
}

/// The stretches of rest of a log with the headings that the yaw gyro tells from one to the next.
fn stills(log: &ImuLog<'_>) -> Vec<Still> {
    let mut stills: Vec<Still> = Vec::new();
    for stretch in log.rest {
        let rows = log.imu.rows(stretch.from_s, stretch.to_s);
        if rows.len() < 20 || stretch.to_s - stretch.from_s < REST_NEEDED_S {
            continue;
        }
        let of = |values: &[[f64; 3]], axis: usize| -> [f64; 2] {
            let values: Vec<f64> = values[rows.clone()].iter().map(|v| v[axis]).collect();
            let centre = mean(&values);
            let square: f64 = values.iter().map(|v| (v - centre).powi(2)).sum();
            [centre, (square / values.len() as f64).sqrt()]
        };
        let force: [[f64; 2]; 3] = std::array::from_fn(|axis| of(log.imu.force_m_s2, axis));
        let rate: [[f64; 2]; 3] = std::array::from_fn(|axis| of(log.imu.rate_rad_s, axis));
        let size = force.iter().map(|f| f[0] * f[0]).sum::<f64>().sqrt();
        // Wheels on stands that are still, and a body that is not, or a unit on its side.
        if (size - STANDARD_GRAVITY_M_S2).abs() > GRAVITY_WITHIN_M_S2 || force[2][0] < 0.5 * size {
            continue;
        }
        let heading_rad = stills.last().map_or(0.0, |last| {
            let bias = 0.5 * (last.rate[2] + rate[2][0]);
            let between = log.imu.rows(last.stretch.to_s, stretch.from_s);
            let turned = between.clone().skip(1).map(|k| {
                let step_s = log.imu.time_s[k] - log.imu.time_s[k - 1];
                (log.imu.rate_rad_s[k][2] - bias) * step_s
            });
            last.heading_rad + turned.sum::<f64>()
        });
        stills.push(Still {
            force: force.map(|f| f[0]),
            rate: rate.map(|r| r[0]),
            noise: [force.map(|f| f[1]), rate.map(|r| r[1])],
            readings: rows.len() as f64,
            heading_rad,
            lean: log
                .lean_rad
                .map(|lean| lean.mean(stretch.from_s, stretch.to_s).unwrap_or(0.0)),
            stretch: *stretch,
        });
    }
    stills
}

fn missing(channel: &str, help: &str) -> Refusal {
    Refusal::Missing {
        what: String::new(),
        channel: channel.to_owned(),
        help: help.to_owned(),
    }
}

/// How far apart two headings are, 0 to pi.
fn apart(a_rad: f64, b_rad: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    let d = (a_rad - b_rad).rem_euclid(turn);
    d.min(turn - d)
}
