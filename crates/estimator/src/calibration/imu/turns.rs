//! Turns of the unit about x and y, by what the roll and pitch gyros see of the yaw rate.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::level::Level;
use super::windows::{END_READINGS, extend, windows};
use super::{ImuLog, interval};
use crate::finding::{Figure, Refusal, Series, Span};
use crate::regression::{Fit, least_squares};

/// Length of the windows, s.
const TURN_WINDOW_S: f64 = 1.0;
/// Parts of a window that products of rate and lean are taken over.
const PARTS: usize = 5;
/// Least yaw rate (rms) that tells a mounting, rad/s.
const YAW_RATE_NEEDED_RAD_S: f64 = 0.08;
/// Least driving, s.
const DRIVE_NEEDED_S: f64 = 20.0;

/// What the roll and pitch gyros see of the yaw rate.
pub(super) struct Turns {
    /// Of the roll rate and of the pitch rate; columns as [`turn_row`] gives them.
    pub(super) fits: [Fit; 2],
    pub(super) intervals: [Option<[f64; 2]>; 2],
    pub(super) span: Span,
    yaw_rate_rad_s: Vec<f64>,
}

/// A window: of the roll gyro and of the pitch gyro what they read, and the columns.
type Row = [(f64, Vec<f64>); 2];

/// `about_z_rad` is the turn about z, which is taken off both gyros.
pub(super) fn turns(
    logs: &[ImuLog<'_>],
    level: &Level,
    about_z_rad: f64,
) -> Result<Turns, Refusal> {
    let leaning = logs
        .iter()
        .all(|log| log.lean_rad.iter().all(|lean| !lean.time_s.is_empty()));
    let mut rows: Vec<Row> = Vec::new();
    let mut span = Span::default();
    for log in logs {
        for window in windows(log, TURN_WINDOW_S) {
            let Some(row) = turn_row(log, level, about_z_rad, &window, leaning) else {
                continue;
            };
            rows.push(row);
            let (first, last) = (window.start, window.end - 1);
            extend(&mut span, log.imu.time_s[first], log.imu.time_s[last], 1);
        }
    }
    if span.used_s < DRIVE_NEEDED_S {
        return Err(Refusal::TooShort {
            what: String::new(),
            found_s: span.used_s,
            needed_s: DRIVE_NEEDED_S,
            help: "add a log of a drive with turns to both sides and straight braking".to_owned(),
        });
    }
    let yaw_rate_rad_s: Vec<f64> = rows.iter().map(|row| row[0].1[1]).collect();
    let squares: f64 = yaw_rate_rad_s.iter().map(|rate| rate * rate).sum();
    let yaw_rate = (squares / rows.len() as f64).sqrt();
    if yaw_rate < YAW_RATE_NEEDED_RAD_S {
        return Err(Refusal::NotExcited {
            what: String::new(),
            quantity: "yaw rate (rms)".to_owned(),
            found: yaw_rate,
            needed: YAW_RATE_NEEDED_RAD_S,
            unit: "rad/s".to_owned(),
            help: "drive turns to both sides".to_owned(),
        });
    }
    let of_axis = |axis: usize| -> Result<(Fit, Option<[f64; 2]>), Refusal> {
        let columns = rows[0][axis].1.len();
        let design = DMatrix::from_fn(rows.len(), columns, |i, j| rows[i][axis].1[j]);
        let response = DVector::from_fn(rows.len(), |i, _| rows[i][axis].0);
        let fit = least_squares(&design, &response)?;
        let interval = interval(&design, &response, &fit);
        Ok((fit, interval))
    };
    let ((roll, roll_interval), (pitch, pitch_interval)) = (of_axis(0)?, of_axis(1)?);
    Ok(Turns {
        fits: [roll, pitch],
        intervals: [roll_interval, pitch_interval],
        span,
        yaw_rate_rad_s,
    })
}

/// Mean roll rate and pitch rate over a window, less what lean makes of the yaw rate, and their
/// columns: 1, yaw rate, and the change of roll or of pitch; for the pitch rate yaw rate times roll,
/// since a twentieth that the springs' roll is wrong by would count. Where lean is not measured, of
/// f_x and f_y each the change over the window and the mean product with the yaw rate.
fn turn_row(
    log: &ImuLog<'_>,
    level: &Level,
    about_z_rad: f64,
    window: &Range<usize>,
    leaning: bool,
) -> Option<Row> {
    let imu = &log.imu;
    let (first, last) = (window.start, window.end - 1);
    let time_s = imu.time_s[last] - imu.time_s[first];
    let over =
        |value: &dyn Fn(usize) -> f64| window.clone().map(value).sum::<f64>() / window.len() as f64;
    let rate = |k: usize, axis: usize| imu.rate_rad_s[k][axis] - level.rate[axis];
    let [p_s, q_s, yaw_rate] = [0, 1, 2].map(|axis| over(&|k| rate(k, axis)));
    let (sine, cosine) = math::sin_cos(about_z_rad);
    let (p, q) = (cosine * p_s + sine * q_s, cosine * q_s - sine * p_s);
    if leaning {
        let at = |axis: usize, k: usize| {
            let half_s = 0.5 * END_READINGS as f64 * time_s / window.len() as f64;
            let (from_s, to_s) = (imu.time_s[k] - half_s, imu.time_s[k] + half_s);
            Some(log.lean_rad[axis].mean(from_s, to_s)? - level.lean[axis])
        };
        // p = phi' - r sin(theta), q = theta' + r sin(phi).
        let [mut pitching, mut rolling] = [0.0; 2];
        for part in 0..PARTS {
            let [from, to] = [part, part + 1].map(|end| first + end * window.len() / PARTS);
            let [from_s, to_s] = [from, to - 1].map(|k| imu.time_s[k]);
            let turning = (from..to).map(|k| rate(k, 2)).sum::<f64>() / window.len() as f64;
            let lean =
                |axis: usize| Some(log.lean_rad[axis].mean(from_s, to_s)? - level.lean[axis]);
            rolling += turning * lean(0)?;
            pitching += turning * lean(1)?;
        }
        let change = |axis: usize| Some((at(axis, last)? - at(axis, first)?) / time_s);
        return Some([
            (p + pitching, vec![1.0, yaw_rate, change(0)?]),
            (q - rolling, vec![1.0, yaw_rate, rolling, change(1)?]),
        ]);
    }
    let mut columns = vec![1.0, yaw_rate];
    for axis in 0..2 {
        let force = |k: usize| imu.force_m_s2[k][axis] - level.force[axis];
        let end = |start: usize| {
            (start..start + END_READINGS).map(force).sum::<f64>() / END_READINGS as f64
        };
        columns.push((end(last + 1 - END_READINGS) - end(first)) / time_s);
        columns.push(over(&|k| rate(k, 2) * force(k)));
    }
    Some([(p, columns.clone()), (q, columns)])
}

impl Turns {
    /// The roll gyro against the yaw rate, all else taken off.
    pub(super) fn figure(&self) -> Figure {
        let series = |axis: usize, name: &str| {
            let fit = &self.fits[axis];
            let x = self.yaw_rate_rad_s.clone();
            let y = x
                .iter()
                .zip(&fit.residuals)
                .map(|(x, residual)| fit.coefficients[1] * x + residual)
                .collect();
            Series {
                name: name.to_owned(),
                line: false,
                x,
                y,
            }
        };
        Figure {
            title: "What roll and pitch gyros see of the yaw rate".to_owned(),
            x_label: "yaw rate (rad/s)".to_owned(),
            y_label: "rate, all else taken off (rad/s)".to_owned(),
            series: vec![series(0, "roll gyro"), series(1, "pitch gyro")],
        }
    }
}
