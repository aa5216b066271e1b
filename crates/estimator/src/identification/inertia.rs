//! Moments of inertia: by formula, from a pendulum's record, from a drive.
//!
//! - Equation 2.29: I_z = m a b.
//! - A pendulum's record is a damped oscillation about one axis; from its period follows
//!   I = k/omega_0^2 with omega_0^2 = omega_d^2 + lambda^2 and the restoring moment k per radian:
//!   m g d for a body that swings d below its pivot (of which m d^2 is taken off by the parallel
//!   axes), m g R^2/l for a platform on three wires of length l at the radius R, the springs'
//!   k_t for a table on springs.
//! - On a drive, I_z r' = M_z, the moment of the measured tyre forces about the centre of gravity.
//!   Regressed on r' it is only as independent of the vehicle file's inertia as the forces are:
//!   those of the statics are, those of the fusion filter are not.

use std::f64::consts::TAU;

use model::vehicle::Vehicle;
use nalgebra::{DMatrix, DVector};
use sample::STANDARD_GRAVITY_M_S2;

use super::drive::{series, span_of};
use super::signals::{mean, slope, smooth, spread, stride};
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal, Span};
use crate::regression::{Nonlinear, least_squares, nonlinear};

const WHAT: &str = "moment of inertia";
/// Plausible I_z/(m a b).
const YAW_RATIO: [f64; 2] = [0.7, 1.5];
/// Least standard deviation of the yaw acceleration, rad/s^2.
const YAW_ACCELERATION_MIN_RAD_S2: f64 = 0.15;
/// Least number of a pendulum's periods.
const PERIODS_MIN: f64 = 4.0;

/// How the vehicle hangs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pendulum {
    /// It swings as a whole, its centre of gravity this far below the pivot, m.
    Compound {
        /// Mass of what swings, kg.
        mass_kg: f64,
        /// Distance d, m.
        distance_m: f64,
    },
    /// It turns about the vertical, hanging on three (or two) wires.
    Wires {
        /// Mass of what hangs, kg.
        mass_kg: f64,
        /// Distance R of the wires from the axis, m.
        radius_m: f64,
        /// Length l of the wires, m.
        length_m: f64,
    },
    /// It turns against springs.
    Springs {
        /// Stiffness, N m/rad.
        stiffness_n_m_rad: f64,
    },
}

impl Pendulum {
    /// Restoring moment per radian, and what to take off the inertia about the axis.
    fn restoring(self) -> [f64; 2] {
        match self {
            Self::Compound {
                mass_kg,
                distance_m,
            } => [
                mass_kg * STANDARD_GRAVITY_M_S2 * distance_m,
                mass_kg * distance_m.powi(2),
            ],
            Self::Wires {
                mass_kg,
                radius_m,
                length_m,
            } => [
                mass_kg * STANDARD_GRAVITY_M_S2 * radius_m.powi(2) / length_m,
                0.0,
            ],
            Self::Springs { stiffness_n_m_rad } => [stiffness_n_m_rad, 0.0],
        }
    }
}

/// Finds the inertia from a record of the rate about the pendulum's axis, on a grid of `dt_s`;
/// `fixture_kg_m2` is what platform and fixings have of their own.
///
/// Findings: `inertia` (kg m^2), `period` (s), `damping_ratio` (-). Its deviation is that of the
/// period alone: a mass or length that is off by one per cent is one more.
///
/// # Errors
/// Fewer than four periods, no oscillation, numbers that make no pendulum.
pub fn pendulum(
    rate_rad_s: &[f64],
    dt_s: f64,
    pendulum: Pendulum,
    fixture_kg_m2: f64,
    seed: u64,
) -> Result<Findings, Refusal> {
    let [stiffness, shift] = pendulum.restoring();
    if !(stiffness > 0.0 && stiffness.is_finite()) {
        return Err(Refusal::Value {
            what: WHAT.to_owned(),
            name: "the pendulum's restoring moment".to_owned(),
            value: stiffness,
            expected: "above 0 N m/rad; look at mass, distance and length".to_owned(),
        });
    }
    let rows: Vec<usize> = (0..rate_rad_s.len())
        .filter(|row| rate_rad_s[*row].is_finite())
        .collect();
    let values: Vec<f64> = rows.iter().map(|row| rate_rad_s[*row]).collect();
    let omega = dominant(&values, dt_s)?;
    let amplitude = 1.4 * spread(&values);
    let problem = Nonlinear {
        start: vec![
            omega,
            0.01 * omega,
            amplitude,
            amplitude,
            mean(values.iter().copied()),
        ],
        scale: vec![omega * 0.01, omega * 0.01, amplitude, amplitude, amplitude],
        iterations: 200,
    };
    let fit = nonlinear(&problem, |c| {
        rows.iter()
            .zip(&values)
            .map(|(row, value)| {
                let t = *row as f64 * dt_s;
                let (sin, cos) = math::sin_cos(c[0] * t);
                value - math::exp(-c[1] * t) * (c[2] * cos + c[3] * sin) - c[4]
            })
            .collect()
    })
    .map_err(|refusal| {
        refusal
            .of(WHAT)
            .advise("let it swing freely from rest, and cut the record to that")
    })?;
    let parameters = |c: &[f64]| {
        let natural = c[0].powi(2) + c[1].powi(2);
        vec![
            stiffness / natural - shift - fixture_kg_m2,
            TAU / c[0],
            c[1] / natural.sqrt(),
        ]
    };
    let values_found = parameters(&fit.coefficients);
    let gradient = gradient(&parameters, &fit.coefficients, &problem.scale);
    let covariance = fit.propagated(&gradient);
    let intervals = fit.intervals(seed, parameters);
    let span = span_of(&rows, dt_s, 1);
    let names = [
        ("inertia", "kg m^2"),
        ("period", "s"),
        ("damping_ratio", "-"),
    ];
    let findings = names.iter().enumerate().map(|(j, (name, unit))| Finding {
        name: (*name).to_owned(),
        value: values_found[j],
        unit: (*unit).to_owned(),
        sigma: covariance[(j, j)].max(0.0).sqrt(),
        interval: intervals.as_ref().map(|intervals| intervals[j]),
        condition: fit.condition,
        excitation: Some(Excitation {
            rms: spread(&values),
            unit: "rad/s".to_owned(),
        }),
        whiteness: Some(fit.whiteness),
        span,
    });
    let time: Vec<f64> = rows.iter().map(|row| *row as f64 * dt_s).collect();
    let fitted = values
        .iter()
        .zip(&fit.residuals)
        .map(|(v, r)| v - r)
        .collect();
    Ok(Findings {
        what: WHAT.to_owned(),
        findings: findings.collect(),
        figures: vec![Figure {
            title: "Swing of the pendulum".to_owned(),
            x_label: "time (s)".to_owned(),
            y_label: "rate (rad/s)".to_owned(),
            series: vec![
                series("measured", false, time.clone(), values),
                series("damped oscillation", true, time, fitted),
            ],
        }],
        ..Findings::default()
    })
}

/// Angular frequency of the strongest oscillation, from the crossings of the mean.
fn dominant(values: &[f64], dt_s: f64) -> Result<f64, Refusal> {
    let none = |periods: f64| Refusal::NotExcited {
        what: WHAT.to_owned(),
        quantity: "the number of periods in the record".to_owned(),
        found: periods,
        needed: PERIODS_MIN,
        unit: "-".to_owned(),
        help: "let it swing longer".to_owned(),
    };
    let duration_s = values.len() as f64 * dt_s;
    if values.len() < 50 {
        return Err(none(0.0));
    }
    let middle = mean(values.iter().copied());
    let power = |frequency_hz: f64| {
        let (mut re, mut im) = (0.0, 0.0);
        for (row, value) in values.iter().enumerate() {
            let (sin, cos) = math::sin_cos(TAU * frequency_hz * row as f64 * dt_s);
            re += (value - middle) * cos;
            im += (value - middle) * sin;
        }
        re * re + im * im
    };
    let step = 0.25 / duration_s;
    let lines = (5.0 / step) as usize;
    let best = (2..lines)
        .map(|line| line as f64 * step)
        .max_by(|a, b| power(*a).total_cmp(&power(*b)))
        .unwrap_or(0.0);
    let periods = best * duration_s;
    if periods < PERIODS_MIN {
        return Err(none(periods));
    }
    Ok(TAU * best)
}

fn gradient(
    parameters: &impl Fn(&[f64]) -> Vec<f64>,
    coefficients: &[f64],
    scale: &[f64],
) -> DMatrix<f64> {
    let columns: Vec<Vec<f64>> = (0..coefficients.len())
        .map(|j| {
            let step = 1e-4 * scale[j];
            let at = |side: f64| {
                let mut moved = coefficients.to_vec();
                moved[j] += side * step;
                parameters(&moved)
            };
            let (low, high) = (at(-1.0), at(1.0));
            low.iter()
                .zip(high)
                .map(|(l, h)| (h - l) / (2.0 * step))
                .collect()
        })
        .collect();
    DMatrix::from_fn(columns[0].len(), columns.len(), |i, j| columns[j][i])
}

/// Finds the yaw inertia on a drive from the moment of the tyre forces about the centre of gravity
/// (N m) and the yaw rate (rad/s), both on a grid of `dt_s`.
///
/// Findings: `yaw_inertia` (kg m^2).
///
/// # Errors
/// Missing signals, too little data, too little yaw acceleration.
pub fn yaw(
    moment_n_m: &[f64],
    yaw_rate_rad_s: &[f64],
    dt_s: f64,
    seed: u64,
) -> Result<Findings, Refusal> {
    const CUTOFF_HZ: f64 = 2.0;
    const ADVICE: &str = "steer quickly to and fro, such as the manoeuvre fast-sine";
    if moment_n_m.len() != yaw_rate_rad_s.len() {
        return Err(Refusal::Length {
            what: WHAT.to_owned(),
            name: "yaw rate".to_owned(),
            found: yaw_rate_rad_s.len(),
            expected: moment_n_m.len(),
        });
    }
    let moment = smooth(moment_n_m, dt_s, CUTOFF_HZ);
    let acceleration = slope(yaw_rate_rad_s, dt_s, CUTOFF_HZ);
    let step = stride(dt_s, CUTOFF_HZ);
    let rows: Vec<usize> = (0..moment.len())
        .step_by(step)
        .filter(|row| (moment[*row] + acceleration[*row]).is_finite())
        .collect();
    let span = span_of(&rows, dt_s, step);
    if rows.is_empty() {
        return Err(Refusal::Missing {
            what: WHAT.to_owned(),
            channel: "tyre forces with yaw rate".to_owned(),
            help: "it needs strain and deflection for the forces".to_owned(),
        });
    }
    if span.used_s < 5.0 {
        return Err(Refusal::TooShort {
            what: WHAT.to_owned(),
            found_s: span.used_s,
            needed_s: 5.0,
            help: ADVICE.to_owned(),
        });
    }
    let x: Vec<f64> = rows.iter().map(|row| acceleration[*row]).collect();
    let found = spread(&x);
    if found < YAW_ACCELERATION_MIN_RAD_S2 {
        return Err(Refusal::NotExcited {
            what: WHAT.to_owned(),
            quantity: "the yaw acceleration's standard deviation".to_owned(),
            found,
            needed: YAW_ACCELERATION_MIN_RAD_S2,
            unit: "rad/s^2".to_owned(),
            help: ADVICE.to_owned(),
        });
    }
    let y: Vec<f64> = rows.iter().map(|row| moment[*row]).collect();
    let design = DMatrix::from_fn(rows.len(), 2, |i, j| if j == 0 { 1.0 } else { x[i] });
    let fit = least_squares(&design, &DVector::from_column_slice(&y))
        .map_err(|refusal| refusal.of(WHAT).advise(ADVICE))?;
    let intervals = fit.intervals(seed, |c| vec![c[1]]);
    let line = vec![-2.0 * found, 2.0 * found];
    let fitted = line
        .iter()
        .map(|v| fit.coefficients[0] + fit.coefficients[1] * v)
        .collect();
    Ok(Findings {
        what: WHAT.to_owned(),
        findings: vec![Finding {
            name: "yaw_inertia".to_owned(),
            value: fit.coefficients[1],
            unit: "kg m^2".to_owned(),
            sigma: fit.sigma(1),
            interval: intervals.map(|intervals| intervals[0]),
            condition: fit.condition,
            excitation: Some(Excitation {
                rms: fit.excitation[1],
                unit: "rad/s^2".to_owned(),
            }),
            whiteness: Some(fit.whiteness),
            span,
        }],
        figures: vec![Figure {
            title: "Yaw moment of the tyre forces against yaw acceleration".to_owned(),
            x_label: "yaw acceleration (rad/s²)".to_owned(),
            y_label: "moment (N m)".to_owned(),
            series: vec![
                series("measured", false, x, y),
                series("fit", true, line, fitted),
            ],
        }],
        ..Findings::default()
    })
}

/// Equation 2.29 beside what the vehicle file says, and whether that can be: the triangle
/// inequalities hold and I_z/(m a b) lies between 0.7 and 1.5.
#[must_use]
pub fn by_formula(vehicle: &Vehicle) -> Findings {
    let body = &vehicle.body;
    let product = body.mass_kg * body.front_axle_to_cg_m * body.cg_to_rear_axle_m;
    let [roll, pitch, yaw] = body.inertia_kg_m2;
    let mut notes = Vec::new();
    let ratio = yaw / product;
    if !(YAW_RATIO[0]..=YAW_RATIO[1]).contains(&ratio) {
        notes.push(format!(
            "the vehicle file's I_z is {ratio:.2} times m a b; {} to {} is plausible",
            YAW_RATIO[0], YAW_RATIO[1]
        ));
    }
    let most = roll.max(pitch).max(yaw);
    if most > roll + pitch + yaw - most {
        notes.push(format!(
            "the vehicle file's moments {roll:.0}, {pitch:.0}, {yaw:.0} kg m^2 are no rigid body's: \
             the greatest is more than the sum of the others"
        ));
    }
    Findings {
        what: WHAT.to_owned(),
        findings: vec![Finding {
            name: "yaw_inertia_m_a_b".to_owned(),
            value: product,
            unit: "kg m^2".to_owned(),
            sigma: f64::NAN,
            interval: None,
            condition: f64::NAN,
            excitation: None,
            whiteness: None,
            span: Span::default(),
        }],
        beside: vec![
            (
                "vehicle_file_roll_inertia".to_owned(),
                roll,
                "kg m^2".to_owned(),
            ),
            (
                "vehicle_file_pitch_inertia".to_owned(),
                pitch,
                "kg m^2".to_owned(),
            ),
            (
                "vehicle_file_yaw_inertia".to_owned(),
                yaw,
                "kg m^2".to_owned(),
            ),
            ("yaw_inertia_over_m_a_b".to_owned(), ratio, "-".to_owned()),
        ],
        notes,
        ..Findings::default()
    }
}
