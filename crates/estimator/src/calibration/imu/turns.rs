//! Turns of the unit about x and y, by what the roll and pitch gyros see of the yaw rate.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::level::Level;
use super::windows::{END_READINGS, extend, windows};
use super::{ImuLog, interval};
use crate::calibration::rest::mean;
use crate::finding::{Figure, Refusal, Series, Span};
use crate::regression::{Fit, least_squares};

/// Length of the windows, s.
const TURN_WINDOW_S: f64 = 1.0;
/// Least yaw rate (rms) that tells a mounting, rad/s.
const YAW_RATE_NEEDED_RAD_S: f64 = 0.08;
/// Least driving, s.
const DRIVE_NEEDED_S: f64 = 20.0;

/// What the roll and pitch gyros see of the yaw rate.
pub(super) struct Turns {
    /// Of the roll rate and of the pitch rate; columns as [`turn_row`] gives them.
    pub(super) fits: [Fit; 2],
    pub(super) design: DMatrix<f64>,
    pub(super) intervals: [Option<[f64; 2]>; 2],
    pub(super) span: Span,
}

pub(super) fn turns(logs: &[ImuLog<'_>], level: &Level) -> Result<Turns, Refusal> {
    let leaning = logs
        .iter()
        .all(|log| log.lean_rad.iter().all(|lean| !lean.time_s.is_empty()));
    let columns = if leaning { 5 } else { 6 };
    let mut rows: Vec<Vec<f64>> = Vec::new();
    let mut span = Span::default();
    for log in logs {
        for window in windows(log, TURN_WINDOW_S) {
            let Some(row) = turn_row(log, level, &window, leaning) else {
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
    let yaw_rate = (rows.iter().map(|row| row[3] * row[3]).sum::<f64>() / rows.len() as f64).sqrt();
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
    let design = DMatrix::from_fn(rows.len(), columns, |i, j| rows[i][j + 2]);
    let responses = [0, 1].map(|axis| DVector::from_fn(rows.len(), |i, _| rows[i][axis]));
    let fits = [
        least_squares(&design, &responses[0])?,
        least_squares(&design, &responses[1])?,
    ];
    let intervals = [0, 1].map(|axis| interval(&design, &responses[axis], &fits[axis]));
    Ok(Turns {
        fits,
        design,
        intervals,
        span,
    })
}

/// Mean roll rate and pitch rate over a window, less what lean makes of the yaw rate, then the
/// columns: 1, yaw rate, yaw rate times roll, and the changes of roll and pitch. Where they are not measured, of f_x and
/// f_y each the change over the window and the mean product with the yaw rate.
fn turn_row(
    log: &ImuLog<'_>,
    level: &Level,
    window: &Range<usize>,
    leaning: bool,
) -> Option<Vec<f64>> {
    let imu = &log.imu;
    let (first, last) = (window.start, window.end - 1);
    let time_s = imu.time_s[last] - imu.time_s[first];
    let over =
        |value: &dyn Fn(usize) -> f64| window.clone().map(value).sum::<f64>() / window.len() as f64;
    let rate = |k: usize, axis: usize| imu.rate_rad_s[k][axis] - level.rate[axis];
    let yaw_rate = over(&|k| rate(k, 2));
    let mut row = vec![over(&|k| rate(k, 0)), over(&|k| rate(k, 1)), 1.0, yaw_rate];
    if leaning {
        let at = |axis: usize, k: usize| {
            let half_s = 0.5 * END_READINGS as f64 * time_s / window.len() as f64;
            let (from_s, to_s) = (imu.time_s[k] - half_s, imu.time_s[k] + half_s);
            Some(log.lean_rad[axis].mean(from_s, to_s)? - level.lean[axis])
        };
        // Lean changes slowly against the readings: the mean of a few places does.
        let places = |axis: usize| -> Option<f64> {
            let places = (0..=4).map(|part| at(axis, first + part * (last - first) / 4));
            Some(mean(&places.collect::<Option<Vec<f64>>>()?))
        };
        // p = phi' - r sin(theta), q = theta' + r sin(phi).
        let roll = places(0)?;
        row[0] += yaw_rate * places(1)?;
        row[1] -= yaw_rate * roll;
        // Roll is large in turns: a twentieth that the motion ratio is wrong by would count.
        row.push(yaw_rate * roll);
        for axis in 0..2 {
            row.push((at(axis, last)? - at(axis, first)?) / time_s);
        }
        return Some(row);
    }
    for axis in 0..2 {
        let force = |k: usize| imu.force_m_s2[k][axis] - level.force[axis];
        let end = |start: usize| {
            (start..start + END_READINGS).map(force).sum::<f64>() / END_READINGS as f64
        };
        row.push((end(last + 1 - END_READINGS) - end(first)) / time_s);
        row.push(over(&|k| rate(k, 2) * force(k)));
    }
    Some(row)
}

impl Turns {
    /// The roll gyro against the yaw rate, all else taken off.
    pub(super) fn figure(&self) -> Figure {
        let series = |axis: usize, name: &str| {
            let fit = &self.fits[axis];
            let x: Vec<f64> = self.design.column(1).iter().copied().collect();
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
