//! Rolling radius of each wheel from GNSS speed on straight and even stretches: v = R w.
//!
//! The radius is that of the wheel as it is driven, its slip under rolling resistance included.

use nalgebra::{DMatrix, DVector};
use sample::Wheel;

use super::gnss::Vectors;
use super::imu::ImuSignal;
use super::rest::Signal;
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal, Series, Span};
use crate::regression::{Bootstrap, least_squares};

const WHAT: &str = "wheel-radius";
/// Length of the windows, s.
const WINDOW_S: f64 = 0.5;
/// Straight and even: yaw rate, rad/s, and longitudinal specific force, m/s^2.
const STRAIGHT_RAD_S: f64 = 0.05;
const EVEN_M_S2: f64 = 0.6;
/// Least speed, m/s, and least time of such windows, s.
const SPEED_NEEDED_M_S: f64 = 2.0;
const NEEDED_S: f64 = 6.0;

/// A drive.
#[derive(Clone, Copy, Debug)]
pub struct RadiusInput<'a> {
    /// Velocity of an antenna, east, north, up, m/s.
    pub velocity: Vectors<'a>,
    /// Latency that its stamps still hold, s.
    pub latency_s: f64,
    /// Inertial unit, body axes.
    pub imu: ImuSignal<'a>,
    /// Wheel speeds, rad/s.
    pub wheels_rad_s: [Signal<'a>; 4],
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct RadiusFound {
    /// Radii with their deviations.
    pub findings: Findings,
    /// Radius of each wheel whose speed is measured, m.
    pub radius_m: Vec<(Wheel, f64)>,
}

/// Finds the rolling radii.
///
/// # Errors
/// No wheel speeds, or too little straight and even driving.
pub fn wheel_radius(input: &RadiusInput<'_>) -> Result<RadiusFound, Refusal> {
    let windows = windows(input);
    let mut found = RadiusFound {
        findings: Findings {
            what: "rolling radii".to_owned(),
            ..Findings::default()
        },
        radius_m: Vec::new(),
    };
    let mut figure = Figure {
        title: "Speed against wheel speed, straight and even".to_owned(),
        x_label: "wheel speed (rad/s)".to_owned(),
        y_label: "speed (m/s)".to_owned(),
        series: Vec::new(),
    };
    let mut longest_s = 0.0_f64;
    for (wheel, signal) in Wheel::ALL.into_iter().zip(&input.wheels_rad_s) {
        let rows: Vec<(f64, f64, f64)> = windows
            .iter()
            .filter_map(|(from_s, speed)| {
                let turning = signal.mean(*from_s, from_s + WINDOW_S)?;
                (turning > 1.0).then_some((*from_s, turning, *speed))
            })
            .collect();
        let used_s = rows.len() as f64 * WINDOW_S;
        longest_s = longest_s.max(used_s);
        if used_s < NEEDED_S {
            continue;
        }
        let design = DMatrix::from_fn(rows.len(), 1, |i, _| rows[i].1);
        let response = DVector::from_fn(rows.len(), |i, _| rows[i].2);
        let fit = least_squares(&design, &response).map_err(|refusal| refusal.of(WHAT))?;
        let ratio = |drawn: &[usize]| {
            let (mut cross, mut square) = (0.0, 0.0);
            for &row in drawn {
                cross += rows[row].1 * rows[row].2;
                square += rows[row].1 * rows[row].1;
            }
            (square > 0.0).then(|| vec![cross / square])
        };
        let bootstrap = Bootstrap::for_influence(&fit.influence, 1);
        let radius_m = fit.coefficients[0];
        found.radius_m.push((wheel, radius_m));
        found.findings.findings.push(Finding {
            name: format!("{wheel} rolling radius"),
            value: radius_m,
            unit: "m".to_owned(),
            sigma: fit.sigma(0),
            interval: bootstrap
                .intervals(rows.len(), ratio)
                .and_then(|intervals| intervals.first().copied()),
            condition: fit.condition,
            excitation: Some(Excitation {
                rms: fit.excitation[0],
                unit: "rad/s".to_owned(),
            }),
            whiteness: Some(fit.whiteness),
            span: Span {
                from_s: rows[0].0,
                to_s: rows[rows.len() - 1].0 + WINDOW_S,
                used_s,
                rows: rows.len(),
            },
        });
        figure.series.push(Series {
            name: wheel.abbreviation().to_owned(),
            line: false,
            x: rows.iter().map(|row| row.1).collect(),
            y: rows.iter().map(|row| row.2).collect(),
        });
    }
    if found.radius_m.is_empty() {
        return Err(Refusal::TooShort {
            what: WHAT.to_owned(),
            found_s: longest_s,
            needed_s: NEEDED_S,
            help: "drive straight at constant speed above 2 m/s, with wheel speeds and GNSS \
                   velocity recorded"
                .to_owned(),
        });
    }
    found.findings.figures.push(figure);
    Ok(found)
}

/// Beginnings and GNSS speeds of the windows in which the vehicle drives straight and evenly.
fn windows(input: &RadiusInput<'_>) -> Vec<(f64, f64)> {
    let (imu, velocity) = (&input.imu, &input.velocity);
    let (Some(first), Some(last)) = (imu.time_s.first(), imu.time_s.last()) else {
        return Vec::new();
    };
    let rows = |time_s: &[f64], from_s: f64| {
        let start = time_s.partition_point(|&t| t < from_s);
        start
            ..time_s
                .partition_point(|&t| t < from_s + WINDOW_S)
                .max(start)
    };
    let count = ((last - first) / WINDOW_S) as usize;
    (0..count)
        .filter_map(|k| {
            let from_s = first + k as f64 * WINDOW_S;
            let readings = rows(imu.time_s, from_s);
            let straight = readings.clone().all(|i| {
                // A single reading's noise may pass the limit; a turn lasts.
                imu.rate_rad_s[i][2].abs() < 2.0 * STRAIGHT_RAD_S
            });
            let over = |values: &[[f64; 3]], axis: usize| {
                readings.clone().map(|i| values[i][axis]).sum::<f64>() / readings.len() as f64
            };
            let even = over(imu.force_m_s2, 0).abs() < EVEN_M_S2
                && over(imu.rate_rad_s, 2).abs() < STRAIGHT_RAD_S;
            let solved = rows(velocity.time_s, from_s + input.latency_s);
            let speeds: Vec<f64> = solved
                .map(|i| velocity.value[i])
                .filter(|v| v[0].is_finite())
                .map(|[east, north, _]| math::hypot(east, north))
                .collect();
            let speed = speeds.iter().sum::<f64>() / speeds.len() as f64;
            (!readings.is_empty() && straight && even && speed > SPEED_NEEDED_M_S)
                .then_some((from_s, speed))
        })
        .collect()
}
