//! Cornering stiffness of each axle (section 2.4.5 of the thesis).
//!
//! Equation 2.31 divides the axle's force by its slip angle at each instant and averages:
//! `C_r = m V r / ((b/a + 1) alpha_r)`, `C_f = b C_r alpha_r / (a alpha_f)`. It lacks the minus sign
//! (a positive slip angle gives a negative force), takes the yaw and lateral velocities for
//! settled, and a steer angle that is off by two degrees makes `C_f` seem to grow with speed. Here
//! the forces are those of the motion,
//!
//! F_yf = ((b m a_y + I_z r' + M)/L - F_xf sin(delta))/cos(delta),
//! F_yr = (a m a_y - I_z r' - M)/L,
//!
//! with the rolling resistance F_xf of the front axle and a moment M of four parts, which on the
//! Prowler in a sine of 0.3 Hz change the front axle's force by so much:
//!
//! | part of M | source | front force |
//! |---|---|---|
//! | sum of n F_y | each tyre's pneumatic trail n, a sixth of the contact's length less what slides | 3 to 4 % |
//! | H phi' | spin momentum H = V sum(I_w/R_0) of the wheels, which roll with the body | 1 % |
//! | f (N_R - N_L) t/2 | rolling resistance of the more and the less loaded side | 1 % |
//! | (F_yR - F_yL) sin(delta) t/2 | side forces of the steered front tyres | 1 to 3 % |
//!
//! With all of them the forces of the independent simulator's `c_sine03` come out within 2.4 N RMS,
//! of 520 and 660. Where the wheels' loads are unknown, the loads' transfer follows from the vehicle
//! file and the first two parts are left out: C then holds the trail's effect, as a two-wheel
//! model's does. Where the roll angle is unknown (or zero in all rows), M, F_xf and the loads' transfer are zero: C is
//! the stiffness of the two-wheel model that moves as the vehicle did. The slip angles are those of the axles, against which a rolling body's centre of
//! gravity sways: v + (h - h_roll) phi' takes the place of v. The noisy slip angle is regressed on
//! the quiet force, with an offset:
//!
//! tan(alpha) = offset - (1/C) (g + tau g'), g = g(F).
//!
//! g(F) is the force that the axle's slip would make if the tyres were linear and stood under their
//! loads at rest: C tan(alpha) of two brush tyres of grip mu N and stiffness (C/2) (N/N_0)^n each.
//! tau takes up relaxation and delays between sensors. mu is the vehicle file's where the data
//! confirm it. Elsewhere 1/mu is found with the rest, from the data and from the file's value, which
//! then counts as one that may be off by all of itself, so that tyres without a curve are found as
//! such; noise may bring 1/mu below zero. Where the data contradict the file, F + q F^3 takes the
//! brush tyre's place if it leaves less.
//!
//! The deviations hold what noise does, what the grip's deviation does (10 % where the data confirm
//! it) and, to first order, what the vehicle file's other deviations do (trail 20 %, load's transfer
//! 5 %, sway 10 %, yaw inertia 3 %). The front offset less the rear one is what the steer angle reads too little; the sideslip angle's
//! own offset is common to both.

mod beside;
mod body;
mod curve;
mod offset;

use nalgebra::{DMatrix, DVector};

use super::Drive;
use super::drive::{series, span_of};
use super::signals::{slope, smooth, spread, stride};
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal, Span};
use crate::regression::{intervals_by_influence, wandering};

pub use beside::equation_2_31;
pub use body::Body;
pub use offset::of_vehicle;

use beside::{beside, recursive};
use body::{Instant, Loads};
use curve::{AxleFit, fit};

/// What is looked for, in the words of refusals.
const WHAT: &str = "cornering stiffness";
/// What helps where the manoeuvre does not.
const ADVICE: &str = "drive a slow sine (0.2 to 0.5 Hz) of 2 to 3 m/s^2 at 5 to 10 m/s for half a \
                      minute, such as the manoeuvre slow-sine";
/// Least usable data, s.
const DATA_MIN_S: f64 = 6.0;
/// Least standard deviation of the lateral acceleration, m/s^2.
const LATERAL_MIN_M_S2: f64 = 0.5;

/// Which rows are used, and how they are filtered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Cut-off of the low-pass that all signals go through, Hz.
    pub cutoff_hz: f64,
    /// Least speed, m/s.
    pub speed_min_m_s: f64,
    /// Greatest lateral acceleration, m/s^2.
    pub lateral_max_m_s2: f64,
    /// Greatest longitudinal acceleration, m/s^2.
    pub longitudinal_max_m_s2: f64,
    /// Standard deviation of a slip angle after the low-pass, rad; with the next, the ratio that
    /// total least squares needs.
    pub slip_sigma_rad: f64,
    /// Standard deviation of an axle's force after the low-pass, N.
    pub force_sigma_n: f64,
    /// Seed of the bootstrap.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            cutoff_hz: 2.0,
            speed_min_m_s: 3.0,
            lateral_max_m_s2: 2.5,
            longitudinal_max_m_s2: 1.5,
            slip_sigma_rad: 0.0025,
            force_sigma_n: 30.0,
            seed: 1,
        }
    }
}

/// Slip, force and loads of one axle, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
struct AxleRows {
    /// Tangent of the slip angle without its offset, and the offset.
    slip: Vec<f64>,
    force_n: Vec<f64>,
    force_rate_n_s: Vec<f64>,
    /// Loads of the left and the right wheel, parts of those at rest.
    load_parts: Vec<[f64; 2]>,
    /// Whether the vehicle is taken as a two-wheel model.
    two_wheel: bool,
}

/// Finds the cornering stiffness of both axles.
///
/// Findings: `cornering_stiffness_front`, `cornering_stiffness_rear` (of an axle, both tyres,
/// N/rad, at small slip), `steer_offset` (what the steer angle reads too much, rad) and
/// `sideslip_offset` (the rear axle's offset: what the sideslip angle reads too much, with rear
/// toe, rad).
///
/// # Errors
/// Missing signals, too little data, a manoeuvre that does not load the axles to and fro.
pub fn identify(drive: &Drive, body: &Body, options: &Options) -> Result<Findings, Refusal> {
    drive.require(
        WHAT,
        &[
            "speed",
            "sideslip",
            "yaw rate",
            "lateral acceleration",
            "steer angle",
        ],
    )?;
    let (rows, step) = usable(drive, body, options)?;
    let mut axles = axle_rows(drive, body, options, &rows, [0.0; 2]);
    let mut fits = [fit(body, 0, &axles[0])?, fit(body, 1, &axles[1])?];
    // The steer angle's offset turns the front axle's force a little, and a tangent is not linear.
    let offsets = fits.each_ref().map(|fit| fit.fit.coefficients[0]);
    axles = axle_rows(drive, body, options, &rows, offsets);
    fits = [fit(body, 0, &axles[0])?, fit(body, 1, &axles[1])?];
    let span = span_of(&rows, drive.dt_s, step);
    let doubt = doubt(&fits, body, |body| {
        axle_rows(drive, body, options, &rows, offsets)
    });
    let mut found = findings(&fits, &doubt, span, options);
    beside(&mut found, drive, body, options, &axles, &rows);
    for (fit, name) in fits.iter().zip(["front", "rear"]) {
        let grip_n = fit.grip_n();
        found.beside.push((
            format!("grip_of_{name}_{}_curve", fit.curve.name()),
            grip_n,
            "N".to_owned(),
        ));
    }
    found.figures = figures(body, &axles, &fits, span.used_s / span.rows as f64);
    Ok(found)
}

/// Rows within the limits, thinned to what the low-pass leaves, and the thinning.
fn usable(drive: &Drive, body: &Body, options: &Options) -> Result<(Vec<usize>, usize), Refusal> {
    let dt_s = drive.dt_s;
    let step = stride(dt_s, options.cutoff_hz);
    let lateral = smooth(&drive.lateral_m_s2, dt_s, options.cutoff_hz);
    let all = axle_rows(
        drive,
        body,
        options,
        &(0..drive.rows()).collect::<Vec<_>>(),
        [0.0; 2],
    );
    let longitudinal = |row: usize| drive.longitudinal_m_s2.get(row).copied().unwrap_or(0.0);
    let rows: Vec<usize> = (0..drive.rows())
        .step_by(step)
        .filter(|&row| {
            drive.speed_m_s[row] >= options.speed_min_m_s
                && lateral[row].abs() <= options.lateral_max_m_s2
                && longitudinal(row).abs() <= options.longitudinal_max_m_s2
                && all.iter().all(|axle| {
                    (axle.slip[row] + axle.force_n[row] + axle.force_rate_n_s[row]).is_finite()
                })
        })
        .collect();
    let found_s = rows.len() as f64 * step as f64 * dt_s;
    if found_s < DATA_MIN_S {
        return Err(Refusal::TooShort {
            what: WHAT.to_owned(),
            found_s,
            needed_s: DATA_MIN_S,
            help: ADVICE.to_owned(),
        });
    }
    let used: Vec<f64> = rows.iter().map(|&row| lateral[row]).collect();
    let found = spread(&used);
    if found < LATERAL_MIN_M_S2 {
        return Err(Refusal::NotExcited {
            what: WHAT.to_owned(),
            quantity: "the lateral acceleration's standard deviation".to_owned(),
            found,
            needed: LATERAL_MIN_M_S2,
            unit: "m/s^2".to_owned(),
            help: ADVICE.to_owned(),
        });
    }
    Ok((rows, step))
}

/// Slip angles and forces of both axles at the given rows, after the low-pass; the offsets of the
/// slip angles are known so far.
fn axle_rows(
    drive: &Drive,
    body: &Body,
    options: &Options,
    rows: &[usize],
    offsets_rad: [f64; 2],
) -> [AxleRows; 2] {
    let instants = instants(drive, options, offsets_rad[1] - offsets_rad[0]);
    let forces_n: Vec<[f64; 2]> = instants.iter().map(|now| body.axle_forces_n(now)).collect();
    let (dt_s, cut) = (drive.dt_s, options.cutoff_hz);
    let pick = |values: &[f64]| -> Vec<f64> { rows.iter().map(|&row| values[row]).collect() };
    [0, 1].map(|axle| {
        let slip: Vec<f64> = (0..drive.rows())
            .map(|row| {
                let angle_rad = slip_rad(drive, body, axle, row, instants[row].roll_rate_rad_s);
                offsets_rad[axle] + math::tan(angle_rad - offsets_rad[axle])
            })
            .collect();
        let force: Vec<f64> = forces_n.iter().map(|forces| forces[axle]).collect();
        let [left, right] = [0, 1].map(|side| {
            let parts = instants.iter().map(|now| body.load_parts(axle, now)[side]);
            pick(&smooth(&parts.collect::<Vec<f64>>(), dt_s, cut))
        });
        AxleRows {
            slip: pick(&smooth(&slip, dt_s, cut)),
            force_rate_n_s: pick(&slope(&force, dt_s, cut)),
            force_n: pick(&smooth(&force, dt_s, cut)),
            load_parts: left.into_iter().zip(right).map(<[f64; 2]>::from).collect(),
            two_wheel: instants
                .iter()
                .all(|now| matches!(now.loads, Loads::TwoWheel)),
        }
    })
}

/// The motion of all rows, the steer angle freed of an offset.
fn instants(drive: &Drive, options: &Options, steer_offset_rad: f64) -> Vec<Instant> {
    let cut = 2.0 * options.cutoff_hz;
    let yaw_acceleration = slope(&drive.yaw_rate_rad_s, drive.dt_s, cut);
    // A body that leans is never upright in every row.
    let upright = drive
        .roll_rad
        .iter()
        .all(|roll| !roll.is_finite() || *roll == 0.0);
    let roll = if upright {
        vec![0.0; drive.rows()]
    } else {
        drive.roll_rad.clone()
    };
    let roll_rate = slope(&roll, drive.dt_s, cut);
    let loads_n = &drive.loads_n.0;
    let loaded = loads_n
        .iter()
        .all(|load| load.iter().any(|n| n.is_finite()));
    let loads = |row: usize| match (upright, loaded) {
        (true, _) => Loads::TwoWheel,
        (false, true) => Loads::Known(loads_n.each_ref().map(|load| load[row])),
        (false, false) => Loads::ByTransfer,
    };
    (0..drive.rows())
        .map(|row| Instant {
            speed_m_s: drive.speed_m_s[row],
            lateral_m_s2: drive.lateral_m_s2[row],
            yaw_acceleration_rad_s2: yaw_acceleration[row],
            roll_rad: roll[row],
            roll_rate_rad_s: roll_rate[row],
            steer_rad: drive.steer_rad[row] - steer_offset_rad,
            loads: loads(row),
        })
        .collect()
}

/// An axle's slip angle as measured.
fn slip_rad(drive: &Drive, body: &Body, axle: usize, row: usize, roll_rate_rad_s: f64) -> f64 {
    let ahead_m = [body.front_axle_to_cg_m, -body.cg_to_rear_axle_m][axle];
    let steer_rad = [drive.steer_rad[row], 0.0][axle];
    let (sin, cos) = math::sin_cos(drive.sideslip_rad[row]);
    let speed_m_s = drive.speed_m_s[row];
    let across_m_s =
        speed_m_s * sin + body.sway_m * roll_rate_rad_s + ahead_m * drive.yaw_rate_rad_s[row];
    math::atan2(across_m_s, speed_m_s * cos) - steer_rad
}

/// Stiffness front, stiffness rear, steer offset, sideslip offset of the two axles' coefficients.
fn parameters(front: &[f64], rear: &[f64]) -> Vec<f64> {
    vec![
        front[1].recip(),
        rear[1].recip(),
        rear[0] - front[0],
        rear[0],
    ]
}

const NAMES: [(&str, &str); 4] = [
    ("cornering_stiffness_front", "N/rad"),
    ("cornering_stiffness_rear", "N/rad"),
    ("steer_offset", "rad"),
    ("sideslip_offset", "rad"),
];

/// Covariance that the vehicle file's own doubts bring into the coefficients of both axles.
fn doubt(
    fits: &[AxleFit; 2],
    body: &Body,
    rows_of: impl Fn(&Body) -> [AxleRows; 2],
) -> DMatrix<f64> {
    let size = fits.iter().map(|fit| fit.fit.coefficients.len()).sum();
    let mut sum = DMatrix::zeros(size, size);
    for body in body.varied() {
        let rows = rows_of(&body);
        let [front, rear] = [0, 1].map(|axle| fits[axle].moved(&body, axle, &rows[axle]));
        let moved = DVector::from_iterator(size, front.iter().chain(rear.iter()).copied());
        sum += &moved * moved.transpose();
    }
    // The two axles' tyres differ from the file's in their own ways.
    let mut first = 0;
    for fit in fits {
        let width = fit.fit.coefficients.len();
        let mut own = sum.view_mut((first, first), (width, width));
        for moved in &fit.moved_by_grip {
            own += moved * moved.transpose();
        }
        first += width;
    }
    sum
}

fn findings(fits: &[AxleFit; 2], doubt: &DMatrix<f64>, span: Span, options: &Options) -> Findings {
    let width = fits.each_ref().map(|fit| fit.fit.coefficients.len());
    let stacked: Vec<f64> = fits
        .iter()
        .flat_map(|fit| fit.fit.coefficients.clone())
        .collect();
    let both = DMatrix::from_fn(span.rows, width[0] + width[1], |row, j| {
        if j < width[0] {
            fits[0].fit.influence[(row, j)]
        } else {
            fits[1].fit.influence[(row, j - width[0])]
        }
    });
    let parameters = |coefficients: &[f64]| {
        let (front, rear) = coefficients.split_at(width[0]);
        parameters(front, rear)
    };
    let values = parameters(&stacked);
    let jacobian = DMatrix::from_fn(4, stacked.len(), |i, j| {
        let (offset_front, offset_rear) = (j == 0, j == width[0]);
        let slope = [1, width[0] + 1];
        match i {
            0 | 1 => f64::from(j == slope[i]) * -values[i].powi(2),
            2 => f64::from(offset_rear) - f64::from(offset_front),
            _ => f64::from(offset_rear),
        }
    });
    let joint = joint_covariance(fits) + doubt;
    let covariance = &jacobian * &joint * jacobian.transpose();
    let intervals = intervals_by_influence(&both, &stacked, &joint, options.seed, parameters);
    let findings = NAMES
        .iter()
        .enumerate()
        .map(|(j, (name, unit))| {
            let fit = &fits[if j == 0 || j == 2 { 0 } else { 1 }].fit;
            Finding {
                name: (*name).to_owned(),
                value: values[j],
                unit: (*unit).to_owned(),
                sigma: covariance[(j, j)].max(0.0).sqrt(),
                interval: intervals.as_ref().map(|intervals| intervals[j]),
                condition: fit.condition,
                excitation: (j < 2).then(|| Excitation {
                    rms: fit.excitation[1],
                    unit: "N".to_owned(),
                }),
                whiteness: Some(fit.whiteness),
                span,
            }
        })
        .collect();
    Findings {
        what: WHAT.to_owned(),
        findings,
        covariance: (0..4)
            .map(|i| (0..4).map(|j| covariance[(i, j)]).collect())
            .collect(),
        ..Findings::default()
    }
}

/// Covariance of the front axle's coefficients and the rear's.
///
/// The sideslip angle's error wanders through both slip angles alike and leaves their difference,
/// which is what the steer angle's offset hangs on; an autoregression of each axle's residuals
/// lets it leave only nearly. So the front's are taken as the rear's less a difference that wanders
/// in its own way: l_f' e_f = l_f' e_r - l_f' (e_r - e_f).
fn joint_covariance([front, rear]: &[AxleFit; 2]) -> DMatrix<f64> {
    let (left, right) = (&front.fit.leverage, &rear.fit.leverage);
    let (rows, wide, narrow) = (left.nrows(), left.ncols(), right.ncols());
    let both = DMatrix::from_fn(rows, wide + narrow, |row, j| {
        if j < wide {
            left[(row, j)]
        } else {
            right[(row, j - wide)]
        }
    });
    let pairs = rear.fit.residuals.iter().zip(&front.fit.residuals);
    let apart: Vec<f64> = pairs.map(|(rear, front)| rear - front).collect();
    let parts = wandering(&[(&both, &rear.fit.residuals), (left, &apart)]);
    let own = wide + narrow;
    let turn = DMatrix::from_fn(own, own + wide, |i, j| {
        f64::from(i == j) - f64::from(i < wide && j == own + i)
    });
    &turn * parts * turn.transpose()
}

fn figures(body: &Body, axles: &[AxleRows; 2], fits: &[AxleFit; 2], step_s: f64) -> Vec<Figure> {
    let mut figures = Vec::new();
    for (i, name) in ["front", "rear"].into_iter().enumerate() {
        let (axle, fit) = (&axles[i], &fits[i]);
        let degrees = |values: &[f64]| values.iter().map(|v| math::atan(*v).to_degrees()).collect();
        let most = axle
            .force_n
            .iter()
            .fold(0.0_f64, |most, f| most.max(f.abs()));
        let line: Vec<f64> = (-50..=50).map(|i| f64::from(i) / 50.0 * most).collect();
        let slips: Vec<f64> = line.iter().map(|force| fit.slip(body, i, *force)).collect();
        figures.push(Figure {
            title: format!(
                "Force of the {name} axle against its slip angle: {:.0} N/rad ({} curve)",
                fit.stiffness_n_rad(),
                fit.curve.name()
            ),
            x_label: "slip angle as measured (°)".to_owned(),
            y_label: "lateral force (N)".to_owned(),
            series: vec![
                series("measured", false, degrees(&axle.slip), axle.force_n.clone()),
                series("fit", true, degrees(&slips), line),
            ],
        });
    }
    let time = |n: usize| (0..n).map(|i| i as f64 * step_s).collect::<Vec<_>>();
    let recursion = |axle: usize| recursive(&axles[axle]);
    let [front, rear] = [recursion(0), recursion(1)];
    figures.push(Figure {
        title: "Recursive least squares with gate".to_owned(),
        x_label: "time of the used data (s)".to_owned(),
        y_label: "cornering stiffness of the axle (N/rad)".to_owned(),
        series: vec![
            series("front", true, time(front.len()), front),
            series("rear", true, time(rear.len()), rear),
        ],
    });
    figures
}
