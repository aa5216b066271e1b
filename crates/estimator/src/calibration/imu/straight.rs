//! Turn of the unit about z, by what f_y sees of f_x while the vehicle drives straight.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::level::Level;
use super::windows::{extend, windows};
use super::{ImuLog, interval};
use crate::finding::{Figure, Refusal, Series, Span};
use crate::regression::{Fit, least_squares};

/// Length of the windows, s.
const STRAIGHT_WINDOW_S: f64 = 0.4;
/// Windows before and after a straight one that must be straight too.
const STRAIGHT_AROUND: usize = 5;
/// Yaw rate below which the vehicle drives straight, rad/s.
const STRAIGHT_RAD_S: f64 = 0.02;
/// Least acceleration (rms) that tells a mounting, m/s^2.
const ACCELERATION_NEEDED_M_S2: f64 = 0.3;

/// What f_y sees of f_x while the vehicle drives straight.
pub(super) struct Straight {
    pub(super) fit: Fit,
    pub(super) design: DMatrix<f64>,
    pub(super) interval: Option<[f64; 2]>,
    pub(super) span: Span,
}

/// `turned_rad` are the turns about x and y: what f_y sees of the vertical force, which changes as
/// braking pitches the body, is taken off.
pub(super) fn straight(
    logs: &[ImuLog<'_>],
    level: &Level,
    turned_rad: [f64; 2],
) -> Result<Straight, Refusal> {
    straight_within(logs, level, turned_rad, STRAIGHT_RAD_S)
        .or_else(|_| straight_within(logs, level, turned_rad, 2.5 * STRAIGHT_RAD_S))
}

fn straight_within(
    logs: &[ImuLog<'_>],
    level: &Level,
    turned_rad: [f64; 2],
    most_rad_s: f64,
) -> Result<Straight, Refusal> {
    let mut rows: Vec<[f64; 4]> = Vec::new();
    let mut span = Span::default();
    for log in logs {
        let imu = &log.imu;
        let over = |values: &[[f64; 3]], axis: usize, window: &Range<usize>| {
            window.clone().map(|k| values[k][axis]).sum::<f64>() / window.len() as f64
        };
        let windows = windows(log, STRAIGHT_WINDOW_S);
        let turning = |k: usize| {
            windows.get(k).is_none_or(|window| {
                (over(imu.rate_rad_s, 2, window) - level.rate[2]).abs() > most_rad_s
            })
        };
        for (k, window) in windows.iter().enumerate() {
            let (from_s, to_s) = (imu.time_s[window.start], imu.time_s[window.end - 1]);
            // A turn that has just ended or is about to begin still leans the body.
            let near = k.saturating_sub(STRAIGHT_AROUND)..=k + STRAIGHT_AROUND;
            let Some(speed) = log.speed_m_s.mean(from_s, to_s) else {
                continue;
            };
            if near.into_iter().any(turning) || speed < 1.0 {
                continue;
            }
            let yaw_rate = over(imu.rate_rad_s, 2, window) - level.rate[2];
            let [along, across, up] = [0, 1, 2].map(|axis| over(imu.force_m_s2, axis, window));
            let [about_x_rad, about_y_rad] = turned_rad;
            let across = across + about_x_rad * (up + about_y_rad * along);
            rows.push([across, 1.0, along, speed * yaw_rate]);
            extend(&mut span, from_s, to_s, 1);
        }
    }
    let centre = rows.iter().map(|row| row[2]).sum::<f64>() / rows.len().max(1) as f64;
    let rms = (rows
        .iter()
        .map(|row| (row[2] - centre).powi(2))
        .sum::<f64>()
        / rows.len().max(1) as f64)
        .sqrt();
    if rows.len() < 20 || rms < ACCELERATION_NEEDED_M_S2 {
        return Err(Refusal::NotExcited {
            what: String::new(),
            quantity: "acceleration while driving straight (rms)".to_owned(),
            found: rms,
            needed: ACCELERATION_NEEDED_M_S2,
            unit: "m/s^2".to_owned(),
            help: "speed up and brake firmly on a straight".to_owned(),
        });
    }
    let design = DMatrix::from_fn(rows.len(), 3, |i, j| rows[i][j + 1]);
    let response = DVector::from_fn(rows.len(), |i, _| rows[i][0]);
    let fit = least_squares(&design, &response)?;
    let interval = interval(&design, &response, &fit);
    Ok(Straight {
        fit,
        design,
        interval,
        span,
    })
}

impl Straight {
    pub(super) fn figure(&self) -> Figure {
        let x: Vec<f64> = self.design.column(1).iter().copied().collect();
        let fitted: Vec<f64> = x.iter().map(|x| self.fit.coefficients[1] * x).collect();
        let y = fitted.iter().zip(&self.fit.residuals).map(|(a, b)| a + b);
        Figure {
            title: "Lateral against longitudinal specific force, driving straight".to_owned(),
            x_label: "f_x (m/s^2)".to_owned(),
            y_label: "f_y, all else taken off (m/s^2)".to_owned(),
            series: vec![
                Series {
                    name: "measured".to_owned(),
                    line: false,
                    x: x.clone(),
                    y: y.collect(),
                },
                Series {
                    name: "fit".to_owned(),
                    line: true,
                    x,
                    y: fitted,
                },
            ],
        }
    }
}
