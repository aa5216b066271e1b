//! Bias and mounting of an inertial unit, from rest in two headings and from driving.
//!
//! With small turns (a, b, c) about x, y, z from body to sensor axes the unit reads
//!
//! f_s = f + (a, b, c) x f + bias, w_s = w + (a, b, c) x w + bias
//!
//! At rest the floor's slope changes its sign between two opposite headings and the mean is free of
//! it, but b g and the bias of f_x stay one number. A turn of the vehicle tells b and a by what the
//! roll and pitch gyros see of the yaw rate; braking and speeding up straight tell c by what f_y sees
//! of f_x. Body axes are those of the vehicle file: how the body stands on its springs at rest is
//! taken off.

use model::vehicle::Vehicle;
use nalgebra::{DMatrix, DVector, Matrix2x4, Matrix4, Vector4};
use sample::{PerWheel, STANDARD_GRAVITY_M_S2, Wheel};

use super::rest::{Signal, Stretch, mean};
use super::zero::axle_of;
use super::{Calibration, ImuCalibration};
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal, Series, Span};
use crate::regression::{Bootstrap, Fit, least_squares};

const WHAT: &str = "imu";
/// Length of the windows of the turning regression and of the straight one, s.
const TURN_WINDOW_S: f64 = 1.0;
const STRAIGHT_WINDOW_S: f64 = 0.4;
/// Windows before and after a straight one that must be straight too.
const STRAIGHT_AROUND: usize = 5;
/// Readings at each end of a window that its change is taken from.
const END_READINGS: usize = 10;
/// Yaw rate below which the vehicle drives straight, rad/s.
const STRAIGHT_RAD_S: f64 = 0.02;
/// Least yaw rate (rms), rad/s, and least acceleration (rms), m/s^2, that tell a mounting.
const YAW_RATE_NEEDED_RAD_S: f64 = 0.08;
const ACCELERATION_NEEDED_M_S2: f64 = 0.3;
/// Two headings must differ by this much, rad (150 degrees).
const HEADINGS_DIFFER_RAD: f64 = 2.6;
/// Least rest at a heading, s, and least driving, s.
const REST_NEEDED_S: f64 = 3.0;
const DRIVE_NEEDED_S: f64 = 20.0;
/// What springs and tyres leave open of the body's roll and pitch in turns, as a turn of the unit, rad:
/// the tyres give way under other forces than the springs, which lift in turns by the links' pull.
const LEAN_DOUBT_RAD: f64 = 5e-4;
/// Most that an accelerometer at rest may be from gravity, m/s^2.
const GRAVITY_WITHIN_M_S2: f64 = 1.0;

/// Readings of an inertial unit in its own axes.
#[derive(Clone, Copy, Debug, Default)]
pub struct ImuSignal<'a> {
    /// Instants, s, rising.
    pub time_s: &'a [f64],
    /// Specific force, m/s^2.
    pub force_m_s2: &'a [[f64; 3]],
    /// Angular rate, rad/s.
    pub rate_rad_s: &'a [[f64; 3]],
}

/// A log with stretches of rest in several headings, or a drive.
#[derive(Clone, Copy, Debug, Default)]
pub struct ImuLog<'a> {
    /// The unit's readings.
    pub imu: ImuSignal<'a>,
    /// Forward speed, m/s.
    pub speed_m_s: Signal<'a>,
    /// Roll and pitch of the body against the ground by the springs, rad, see [`lean_rad`]. Empty
    /// where there are no potentiometers; specific force stands in for them then, less well.
    pub lean_rad: [Signal<'a>; 2],
    /// Stretches of rest.
    pub rest: &'a [Stretch],
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct ImuFound {
    /// Biases and turns with their deviations.
    pub findings: Findings,
    /// What goes into the file; the place stays as it was.
    pub calibration: ImuCalibration,
}

/// Finds bias and misalignment. `rest_roll_pitch_rad` is how the body stands on its springs on level
/// ground (right side down, nose down), by the vehicle file.
///
/// # Errors
/// Too little rest, one heading only, no turns, no straight braking.
pub fn imu(
    logs: &[ImuLog<'_>],
    rest_roll_pitch_rad: [f64; 2],
    known: &Calibration,
) -> Result<ImuFound, Refusal> {
    let level = Level::find(logs).map_err(|refusal| refusal.of(WHAT))?;
    let turns = turns(logs, &level).map_err(|refusal| refusal.of(WHAT))?;
    let (roll, pitch) = (&turns.fits[0], &turns.fits[1]);
    let straight = straight(logs, &level)
        .or_else(|_| straight_within(logs, &level, 2.5 * STRAIGHT_RAD_S))
        .map_err(|refusal| refusal.of(WHAT))?;
    let [roll_0, pitch_0] = rest_roll_pitch_rad;
    // p_s = ... + (b - theta_0) r, q_s = ... - (a - phi_0) r.
    let (b_eff, a_eff) = (roll.coefficients[1], -pitch.coefficients[1]);
    let g = STANDARD_GRAVITY_M_S2;
    let misalignment = [
        a_eff + roll_0,
        b_eff + pitch_0,
        straight.fit.coefficients[1],
    ];
    let upright = a_eff.cos() * b_eff.cos() * level.slope_rad.cos();
    let bias = [
        level.force[0] - g * b_eff,
        level.force[1] + g * a_eff,
        level.force[2] - g * upright,
    ];
    let [about_x, about_y] = [pitch, roll].map(|fit| fit.sigma(1).hypot(LEAN_DOUBT_RAD));
    let bias_sigma = [
        level.force_sigma[0].hypot(g * about_y),
        level.force_sigma[1].hypot(g * about_x),
        level.force_sigma[2],
    ];
    let about_z = straight
        .interval
        .map_or(0.0, |[low, high]| (high - low) / 3.92);
    let sigma = [about_x, about_y, straight.fit.sigma(1).max(about_z)];
    let intervals = [
        turns.intervals[1]
            .map(|[low, high]| doubted([roll_0 - high, roll_0 - low], LEAN_DOUBT_RAD)),
        turns.intervals[0].map(|ends| doubted(ends.map(|end| end + pitch_0), LEAN_DOUBT_RAD)),
        straight.interval,
    ];
    let mut findings = Findings {
        what: "inertial unit".to_owned(),
        ..Findings::default()
    };
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let fit = [pitch, roll, &straight.fit][axis];
        let unit = ["rad/s", "rad/s", "m/s^2"][axis];
        findings.findings.push(Finding {
            name: format!("misalignment about {name}"),
            value: misalignment[axis],
            unit: "rad".to_owned(),
            sigma: sigma[axis],
            interval: intervals[axis],
            condition: fit.condition,
            excitation: Some(Excitation {
                rms: fit.excitation[1],
                unit: unit.to_owned(),
            }),
            whiteness: Some(fit.whiteness),
            span: [turns.span, turns.span, straight.span][axis],
        });
    }
    findings.findings.extend(level.findings(bias, bias_sigma));
    findings.beside = vec![
        ("floor slope".to_owned(), level.slope_rad, "rad".to_owned()),
        (
            "body roll at rest, by the vehicle file".to_owned(),
            roll_0,
            "rad".to_owned(),
        ),
        (
            "body pitch at rest, by the vehicle file".to_owned(),
            pitch_0,
            "rad".to_owned(),
        ),
    ];
    findings.figures = vec![turns.figure(), straight.figure()];
    Ok(ImuFound {
        findings,
        calibration: ImuCalibration {
            accel_bias_m_s2: bias,
            gyro_bias_rad_s: level.rate,
            misalignment_rad: Some(misalignment),
            ..known.imu
        },
    })
}

/// Roll (right side down) and pitch (nose down) of the body against flat ground by the compression
/// of its springs, rad: wheel travel is compression over the motion ratio i, and a tyre of stiffness
/// k_z gives way by i^2 k/k_z of it. `None` where the vehicle file has no motion ratio.
#[must_use]
pub fn lean_rad(vehicle: &Vehicle, compression_m: &PerWheel<f64>) -> Option<[f64; 2]> {
    let travel = |wheel: Wheel| {
        let axle = axle_of(vehicle, wheel);
        let strut = axle.strut.as_ref()?;
        let ratio = strut.motion_ratio?;
        let tyre = ratio * ratio * strut.stiffness_n_m / axle.tyre.vertical_stiffness_n_m;
        Some(compression_m[wheel] / ratio * (1.0 + tyre))
    };
    let [fl, fr, rl, rr] = Wheel::ALL.map(travel);
    let (fl, fr, rl, rr) = (fl?, fr?, rl?, rr?);
    let roll = 0.5 * ((fr - fl) / vehicle.front.track_m + (rr - rl) / vehicle.rear.track_m);
    let pitch = 0.5 * (fl + fr - rl - rr) / vehicle.wheelbase_m();
    Some([roll, pitch])
}

/// What all rests say together.
struct Level {
    /// Specific force without the floor's slope, sensor axes, m/s^2.
    force: [f64; 3],
    force_sigma: [f64; 3],
    /// Rate, sensor axes, rad/s.
    rate: [f64; 3],
    rate_sigma: [f64; 3],
    /// Lean at rest, rad: pots that are not zeroed yet, and the springs' own.
    lean: [f64; 2],
    slope_rad: f64,
    condition: f64,
    span: Span,
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
    fn find(logs: &[ImuLog<'_>]) -> Result<Self, Refusal> {
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
            .sum();
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
            let (sine, cosine) = still.heading_rad.sin_cos();
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
            slope_rad: solution[2].hypot(solution[3]) / STANDARD_GRAVITY_M_S2,
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

    fn findings(&self, bias: [f64; 3], bias_sigma: [f64; 3]) -> Vec<Finding> {
        let finding = |name: String, value: f64, sigma: f64, unit: &str| Finding {
            name,
            value,
            unit: unit.to_owned(),
            sigma,
            interval: Some([value - 1.96 * sigma, value + 1.96 * sigma]),
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

impl ImuSignal<'_> {
    fn rows(&self, from_s: f64, to_s: f64) -> std::ops::Range<usize> {
        let first = self.time_s.partition_point(|&time_s| time_s < from_s);
        let last = self.time_s.partition_point(|&time_s| time_s <= to_s);
        first..last.max(first)
    }
}

/// What the roll and pitch gyros see of the yaw rate.
struct Turns {
    /// Of the roll rate and of the pitch rate; columns as [`turn_row`] gives them.
    fits: [Fit; 2],
    design: DMatrix<f64>,
    intervals: [Option<[f64; 2]>; 2],
    span: Span,
}

fn turns(logs: &[ImuLog<'_>], level: &Level) -> Result<Turns, Refusal> {
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
    window: &std::ops::Range<usize>,
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
    fn figure(&self) -> Figure {
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

/// What f_y sees of f_x while the vehicle drives straight.
struct Straight {
    fit: Fit,
    design: DMatrix<f64>,
    interval: Option<[f64; 2]>,
    span: Span,
}

fn straight(logs: &[ImuLog<'_>], level: &Level) -> Result<Straight, Refusal> {
    straight_within(logs, level, STRAIGHT_RAD_S)
}

fn straight_within(
    logs: &[ImuLog<'_>],
    level: &Level,
    most_rad_s: f64,
) -> Result<Straight, Refusal> {
    let mut rows: Vec<[f64; 4]> = Vec::new();
    let mut span = Span::default();
    for log in logs {
        let imu = &log.imu;
        let over = |values: &[[f64; 3]], axis: usize, window: &std::ops::Range<usize>| {
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
            let force = [0, 1].map(|axis| over(imu.force_m_s2, axis, window));
            rows.push([force[1], 1.0, force[0], speed * yaw_rate]);
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
    fn figure(&self) -> Figure {
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

/// Bootstrap interval of the second coefficient.
fn interval(design: &DMatrix<f64>, response: &DVector<f64>, fit: &Fit) -> Option<[f64; 2]> {
    let bootstrap = Bootstrap::for_influence(&fit.influence, 1);
    let intervals = bootstrap.intervals(design.nrows(), |rows| {
        let design = DMatrix::from_fn(rows.len(), design.ncols(), |i, j| design[(rows[i], j)]);
        let response = DVector::from_fn(rows.len(), |i, _| response[rows[i]]);
        let normal = (design.transpose() * &design).try_inverse()?;
        Some(vec![(normal * design.transpose() * response)[1]])
    })?;
    intervals.first().copied()
}

/// A 95 % interval widened by a doubt of this deviation.
fn doubted([low, high]: [f64; 2], sigma: f64) -> [f64; 2] {
    let half = 0.5 * (high - low);
    let more = half.hypot(1.96 * sigma) - half;
    [low - more, high + more]
}

/// Windows of a log between its rests, gapless and of full length.
fn windows(log: &ImuLog<'_>, length_s: f64) -> Vec<std::ops::Range<usize>> {
    let imu = &log.imu;
    let count = imu
        .time_s
        .len()
        .min(imu.force_m_s2.len())
        .min(imu.rate_rad_s.len());
    let resting = |time_s: f64| {
        log.rest
            .iter()
            .any(|rest| (rest.from_s..=rest.to_s).contains(&time_s))
    };
    let mut windows = Vec::new();
    let mut start = 0;
    for k in 1..count {
        let gap = imu.time_s[k] - imu.time_s[k - 1] > 0.05 || resting(imu.time_s[k]);
        if gap || resting(imu.time_s[start]) {
            start = k;
        } else if imu.time_s[k] - imu.time_s[start] >= length_s {
            if k - start >= 2 * END_READINGS {
                windows.push(start..k);
            }
            start = k;
        }
    }
    windows
}

fn extend(span: &mut Span, from_s: f64, to_s: f64, rows: usize) {
    if span.rows == 0 {
        span.from_s = from_s;
    }
    span.to_s = to_s;
    span.used_s += to_s - from_s;
    span.rows += rows;
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
