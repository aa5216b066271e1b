//! Cornering stiffness of each axle (section 2.4.5 of the thesis).
//!
//! Equation 2.31 divides the axle's force by its slip angle at each instant and averages:
//! `C_r = m V r / ((b/a + 1) alpha_r)`, `C_f = b C_r alpha_r / (a alpha_f)`. It lacks the minus sign
//! (a positive slip angle gives a negative force), takes the yaw and lateral velocities for
//! settled, and a steer angle that is off by two degrees makes `C_f` seem to grow with speed. Here
//! the forces are those of the motion,
//!
//! F_yf = ((b m a_y + I_z r' - M_z)/L - F_xf sin(delta))/cos(delta),
//! F_yr = (a m a_y - I_z r' + M_z)/L,
//!
//! with the rolling resistance F_xf = -f m g b/L of the front axle and M_z, the moment of what
//! differs between the sides: rolling resistance, -f times the roll moment on the ground, and the
//! steered front tyres' side forces, -(F_yR - F_yL) sin(delta) t/2 (all together 3 to 5 % of the
//! front axle's force on the Prowler). The slip angles are those of the axles, against which a rolling
//! body's centre of gravity sways: v + (m_s/m) h_1 phi' takes the place of v (2 % of C_f in a sine
//! of 0.3 Hz). The noisy slip angle is regressed on the quiet force, with an offset:
//!
//! alpha = offset - (1/C) (g(F) + tau F'),
//!
//! with F divided by ((1+x)^n + (1-x)^n)/2, what the load's transfer x between the axle's tyres
//! leaves of their stiffness when it grows with the load's power n (2 % at 3.4 m/s^2 on the
//! Prowler), so that C is the stiffness under the load at rest. tau takes up relaxation and delays between sensors, and g is the brush tyre's
//! 3 Q (1 - (1 - |F|/Q)^(1/3)) sgn F with the grip Q = mu F_z of the vehicle file. Where the data
//! contradict that grip, it is found with the rest, and F + F^3/Q^2 takes the brush tyre's place
//! if it leaves less.
//! The front offset less the rear one is what the steer angle reads too little; the sideslip angle's
//! own offset is common to both.

use model::chassis::four_wheel::Parameters;
use model::vehicle::Vehicle;
use nalgebra::{DMatrix, DVector};
use sample::STANDARD_GRAVITY_M_S2;

use super::Drive;
use super::drive::{series, span_of};
use super::signals::{mean, slope, smooth, spread, stride};
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal, Span};
use crate::regression::{self, Fit, Nonlinear, intervals_by_influence, nonlinear, wandering};

/// What is looked for, in the words of refusals.
const WHAT: &str = "cornering stiffness";
/// What helps where the manoeuvre does not.
const ADVICE: &str = "drive a slow sine (0.2 to 0.5 Hz) of 2 to 3 m/s^2 at 5 to 10 m/s for half a \
                      minute, such as the manoeuvre slow-sine";
/// Least usable data, s.
const DATA_MIN_S: f64 = 6.0;
/// Least standard deviation of the lateral acceleration, m/s^2.
const LATERAL_MIN_M_S2: f64 = 0.5;
/// The vehicle file's grip is believed until the data's lies this many deviations away,
const GRIP_SIGMAS: f64 = 3.0;
/// and its reciprocal by this part: what differs between an axle's two tyres bends the curve too.
const GRIP_APART: f64 = 0.4;
/// Slip angles below this are left out of equation 2.31's ratios, rad.
const RATIO_SLIP_MIN_RAD: f64 = 0.009;

/// What must be known of the vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Mass m, kg.
    pub mass_kg: f64,
    /// Front axle to centre of gravity a, m.
    pub front_axle_to_cg_m: f64,
    /// Centre of gravity to rear axle b, m.
    pub cg_to_rear_axle_m: f64,
    /// Yaw inertia I_z, kg m^2.
    pub yaw_inertia_kg_m2: f64,
    /// Height h of the centre of gravity, m.
    pub cg_height_m: f64,
    /// Sway (m_s/m) h_1 of the centre of gravity against the axles, m per rad of roll.
    pub sway_m: f64,
    /// Rolling resistance coefficient f of the tyres.
    pub rolling_resistance: f64,
    /// Grip mu F_z of the front and the rear axle at rest, N; infinite for tyres taken as linear.
    pub grip_n: [f64; 2],
    /// Power n with which a tyre's stiffness grows with its load, front and rear.
    pub load_exponent: [f64; 2],
    /// Front track t, m.
    pub front_track_m: f64,
    /// Lateral acceleration at which each axle's inner wheel would lift, m/s^2; infinite where
    /// the load's transfer is not to count.
    pub lift_m_s2: [f64; 2],
}

impl Body {
    /// An axle's slip angle times its stiffness in a steady turn, over the mass and the axle's
    /// share of it: nearly the lateral acceleration while that is small, more beyond, as the moment
    /// M_z, the load's transfer and the grip have it.
    pub(super) fn bent(&self, axle: usize, lateral_m_s2: f64, steer_rad: f64) -> f64 {
        let (a, b) = (self.front_axle_to_cg_m, self.cg_to_rear_axle_m);
        let carried_kg = self.mass_kg * [b, a][axle] / (a + b);
        let roll_n_m = self.mass_kg * lateral_m_s2 * self.cg_height_m;
        let turning = self.between_sides_n_m(lateral_m_s2, roll_n_m, steer_rad.sin()) / (a + b);
        let force_n = carried_kg * lateral_m_s2 + [turning, -turning][axle];
        let force_n = force_n / self.stiffness_left(axle, lateral_m_s2);
        Curve::Brush.at(force_n, self.grip_n[axle].recip()) / carried_kg
    }

    /// -M_z: what rolling resistance under the roll moment on the ground, and the steered front
    /// tyres' side forces, turn against the bend, N m.
    fn between_sides_n_m(&self, lateral_m_s2: f64, roll_n_m: f64, sin_steer: f64) -> f64 {
        let (a, b) = (self.front_axle_to_cg_m, self.cg_to_rear_axle_m);
        let transfer = (lateral_m_s2 / self.lift_m_s2[0]).clamp(-1.0, 1.0);
        let outer_n = b / (a + b) * self.mass_kg * lateral_m_s2 * self.load_exponent[0] * transfer;
        self.rolling_resistance * roll_n_m + outer_n * sin_steer * 0.5 * self.front_track_m
    }

    /// Part of an axle's stiffness at rest that the transfer of its load leaves.
    fn stiffness_left(&self, axle: usize, lateral_m_s2: f64) -> f64 {
        let transfer = (lateral_m_s2 / self.lift_m_s2[axle]).abs().min(1.0);
        let power = self.load_exponent[axle];
        if power == 0.0 {
            return 1.0;
        }
        0.5 * ((1.0 + transfer).powf(power) + (1.0 - transfer).powf(power))
    }

    /// What the vehicle file says.
    #[must_use]
    pub fn of(vehicle: &Vehicle) -> Self {
        let body = &vehicle.body;
        let (a, b) = (body.front_axle_to_cg_m, body.cg_to_rear_axle_m);
        let weight_n = body.mass_kg * STANDARD_GRAVITY_M_S2;
        Self {
            mass_kg: body.mass_kg,
            front_axle_to_cg_m: body.front_axle_to_cg_m,
            cg_to_rear_axle_m: body.cg_to_rear_axle_m,
            yaw_inertia_kg_m2: body.inertia_kg_m2[2],
            cg_height_m: body.cg_height_m,
            sway_m: vehicle.sprung().mass_kg / body.mass_kg * vehicle.roll_arm_m(),
            rolling_resistance: vehicle.front.tyre.rolling_resistance,
            grip_n: [
                vehicle.front.tyre.friction * weight_n * b / (a + b),
                vehicle.rear.tyre.friction * weight_n * a / (a + b),
            ],
            load_exponent: [
                vehicle.front.tyre.load_exponent,
                vehicle.rear.tyre.load_exponent,
            ],
            front_track_m: vehicle.front.track_m,
            lift_m_s2: Parameters::from_vehicle(vehicle).lift_m_s2(),
        }
    }
}

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

/// Slip angle and force of one axle, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
struct AxleRows {
    slip_rad: Vec<f64>,
    force_n: Vec<f64>,
    force_rate_n_s: Vec<f64>,
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
    let mut axles = axle_rows(drive, body, options, &rows, 0.0);
    let [grip_front, grip_rear] = body.grip_n;
    let mut fits = [fit(&axles[0], grip_front)?, fit(&axles[1], grip_rear)?];
    // The steer angle's offset turns the front axle's force a little.
    let steer_offset = fits[1].fit.coefficients[0] - fits[0].fit.coefficients[0];
    axles = axle_rows(drive, body, options, &rows, steer_offset);
    fits = [fit(&axles[0], grip_front)?, fit(&axles[1], grip_rear)?];
    let span = span_of(&rows, drive.dt_s, step);
    let mut found = findings(&fits, span, options);
    beside(&mut found, drive, body, options, &axles, &rows);
    for (fit, name) in fits.iter().zip(["front", "rear"]) {
        let grip_n = fit.grip_inverse.abs().recip();
        found.beside.push((
            format!("grip_of_{name}_{}_curve", fit.curve.name()),
            grip_n,
            "N".to_owned(),
        ));
    }
    found.figures = figures(&axles, &fits, span.used_s / span.rows as f64);
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
        0.0,
    );
    let longitudinal = |row: usize| drive.longitudinal_m_s2.get(row).copied().unwrap_or(0.0);
    let rows: Vec<usize> = (0..drive.rows())
        .step_by(step)
        .filter(|&row| {
            drive.speed_m_s[row] >= options.speed_min_m_s
                && lateral[row].abs() <= options.lateral_max_m_s2
                && longitudinal(row).abs() <= options.longitudinal_max_m_s2
                && all.iter().all(|axle| {
                    (axle.slip_rad[row] + axle.force_n[row] + axle.force_rate_n_s[row]).is_finite()
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

/// Slip angles and forces of both axles at the given rows, after the low-pass.
fn axle_rows(
    drive: &Drive,
    body: &Body,
    options: &Options,
    rows: &[usize],
    steer_offset_rad: f64,
) -> [AxleRows; 2] {
    let (a, b) = (body.front_axle_to_cg_m, body.cg_to_rear_axle_m);
    let length = a + b;
    let yaw_dot = slope(&drive.yaw_rate_rad_s, drive.dt_s, 2.0 * options.cutoff_hz);
    let ahead = [a, -b];
    let known = drive.roll_rad.iter().any(|roll| roll.is_finite());
    let roll = if known {
        drive.roll_rad.clone()
    } else {
        vec![0.0; drive.rows()]
    };
    let roll_rate = slope(&roll, drive.dt_s, 2.0 * options.cutoff_hz);
    let resistance_n = body.rolling_resistance * body.mass_kg * STANDARD_GRAVITY_M_S2 * b / length;
    [0, 1].map(|axle| {
        let steer = |row: usize| {
            if axle == 0 { drive.steer_rad[row] } else { 0.0 }
        };
        let slip: Vec<f64> = (0..drive.rows())
            .map(|row| {
                let (sin, cos) = drive.sideslip_rad[row].sin_cos();
                let speed = drive.speed_m_s[row];
                let across = speed * sin
                    + body.sway_m * roll_rate[row]
                    + ahead[axle] * drive.yaw_rate_rad_s[row];
                across.atan2(speed * cos) - steer(row)
            })
            .collect();
        let force: Vec<f64> = (0..drive.rows())
            .map(|row| {
                let lateral = body.mass_kg * drive.lateral_m_s2[row];
                let swayed = body.mass_kg * STANDARD_GRAVITY_M_S2 * body.sway_m * roll[row];
                let roll_n_m = lateral * body.cg_height_m + swayed;
                let (sin, cos) = (drive.steer_rad[row] - steer_offset_rad).sin_cos();
                let dragged = body.between_sides_n_m(drive.lateral_m_s2[row], roll_n_m, sin);
                let yaw = body.yaw_inertia_kg_m2 * yaw_dot[row] + dragged;
                let force = if axle == 0 {
                    ((b * lateral + yaw) / length + resistance_n * sin) / cos
                } else {
                    (a * lateral - yaw) / length
                };
                force / body.stiffness_left(axle, drive.lateral_m_s2[row])
            })
            .collect();
        let cut = options.cutoff_hz;
        let slip = smooth(&slip, drive.dt_s, cut);
        let rate = slope(&force, drive.dt_s, cut);
        let force = smooth(&force, drive.dt_s, cut);
        let pick = |values: &[f64]| rows.iter().map(|&row| values[row]).collect();
        AxleRows {
            slip_rad: pick(&slip),
            force_n: pick(&force),
            force_rate_n_s: pick(&rate),
        }
    })
}

/// How slip grows with force, beyond proportion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Curve {
    Brush,
    Cubic,
}

impl Curve {
    fn name(self) -> &'static str {
        match self {
            Self::Brush => "brush",
            Self::Cubic => "cubic",
        }
    }

    /// g(F) with the grip's reciprocal, 1/N.
    fn at(self, force_n: f64, grip_inverse: f64) -> f64 {
        let part = force_n.abs() * grip_inverse.abs();
        match self {
            Self::Brush if part > 1e-6 => {
                // Beyond 98 % of the grip the slip angle says nothing.
                let root = (1.0 - part.min(0.98)).cbrt();
                force_n * 3.0 * (1.0 - root) / part
            }
            Self::Cubic => force_n * (1.0 + part * part),
            Self::Brush => force_n,
        }
    }
}

/// One axle's fit: offset, 1/C, tau/C and, where it was found, the grip's reciprocal.
struct AxleFit {
    curve: Curve,
    /// Reciprocal of the grip, 1/N.
    grip_inverse: f64,
    fit: Fit,
}

impl AxleFit {
    fn stiffness_n_rad(&self) -> f64 {
        self.fit.coefficients[1].recip()
    }

    fn slip_rad(&self, force_n: f64) -> f64 {
        self.fit.coefficients[0]
            - self.fit.coefficients[1] * self.curve.at(force_n, self.grip_inverse)
    }
}

fn fit(axle: &AxleRows, grip_n: f64) -> Result<AxleFit, Refusal> {
    let told = |refusal: Refusal| refusal.of(WHAT).advise(ADVICE);
    let given = grip_n.recip();
    let believed = fit_given(axle, given).map_err(told)?;
    let mut best = AxleFit {
        curve: Curve::Brush,
        grip_inverse: given,
        fit: believed,
    };
    let start = best.fit.coefficients.clone();
    if start[1] > 0.0
        && let Ok(free) = fit_free(axle, Curve::Brush, &start)
        && (free.coefficients[3].abs() - given).abs()
            > (GRIP_SIGMAS * free.sigma(3)).max(GRIP_APART * given)
    {
        best = AxleFit {
            curve: Curve::Brush,
            grip_inverse: free.coefficients[3],
            fit: free,
        };
        if let Ok(cubic) = fit_free(axle, Curve::Cubic, &start)
            && cubic.residual_rms() < best.fit.residual_rms()
        {
            best = AxleFit {
                curve: Curve::Cubic,
                grip_inverse: cubic.coefficients[3],
                fit: cubic,
            };
        }
    }
    if best.fit.coefficients[1] > 0.0 {
        return Ok(best);
    }
    Err(Refusal::Value {
        what: WHAT.to_owned(),
        name: "slip angle over force".to_owned(),
        value: -best.fit.coefficients[1],
        expected: "a slip angle that falls as the force grows; look at the signs of steer angle, \
                   sideslip and acceleration"
            .to_owned(),
    })
}

/// Offset, 1/C and tau/C under a grip that is given.
fn fit_given(axle: &AxleRows, grip_inverse: f64) -> Result<Fit, Refusal> {
    let design = DMatrix::from_fn(axle.slip_rad.len(), 3, |i, j| match j {
        0 => 1.0,
        1 => -Curve::Brush.at(axle.force_n[i], grip_inverse),
        _ => -axle.force_rate_n_s[i],
    });
    regression::least_squares(&design, &DVector::from_column_slice(&axle.slip_rad))
}

/// Offset, 1/C, tau/C and the grip's reciprocal.
fn fit_free(axle: &AxleRows, curve: Curve, start: &[f64]) -> Result<Fit, Refusal> {
    let most = axle
        .force_n
        .iter()
        .fold(1.0_f64, |most, f| most.max(f.abs()));
    let problem = Nonlinear {
        start: vec![start[0], start[1], start[2], 0.5 / most],
        scale: vec![1e-3, start[1], start[1] * 0.1, 0.1 / most],
        iterations: 60,
    };
    nonlinear(&problem, |c| {
        (0..axle.slip_rad.len())
            .map(|row| {
                let pull =
                    c[1] * curve.at(axle.force_n[row], c[3]) + c[2] * axle.force_rate_n_s[row];
                axle.slip_rad[row] - c[0] + pull
            })
            .collect()
    })
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

fn findings(fits: &[AxleFit; 2], span: Span, options: &Options) -> Findings {
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
    let joint = joint_covariance(fits);
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

/// Other methods' values, and what the fits say beside.
fn beside(
    found: &mut Findings,
    drive: &Drive,
    body: &Body,
    options: &Options,
    axles: &[AxleRows; 2],
    rows: &[usize],
) {
    let mut add = |name: &str, value: f64, unit: &str| {
        found.beside.push((name.to_owned(), value, unit.to_owned()));
    };
    let [front, rear] = equation_2_31(drive, body, rows);
    add("equation_2_31_front", front, "N/rad");
    add("equation_2_31_rear", rear, "N/rad");
    for (axle, name) in axles.iter().zip(["front", "rear"]) {
        let [by_force, by_total] = linear_methods(axle, options);
        add(&format!("force_on_slip_{name}"), by_force, "N/rad");
        add(&format!("total_least_squares_{name}"), by_total, "N/rad");
        let last = recursive(axle).last().copied().unwrap_or(f64::NAN);
        add(&format!("recursive_{name}"), last, "N/rad");
    }
}

/// Equation 2.31 of the thesis with its missing sign: the mean over the rows of force over slip
/// angle, front and rear, N/rad, both from m V r, the slip angles by small angles. Rows whose slip
/// angle is below half a degree are left out.
#[must_use]
pub fn equation_2_31(drive: &Drive, body: &Body, rows: &[usize]) -> [f64; 2] {
    let (a, b) = (body.front_axle_to_cg_m, body.cg_to_rear_axle_m);
    let (mut front, mut rear) = (Vec::new(), Vec::new());
    for &row in rows {
        let (speed, rate) = (drive.speed_m_s[row], drive.yaw_rate_rad_s[row]);
        let slip_front = drive.sideslip_rad[row] + a * rate / speed - drive.steer_rad[row];
        let slip_rear = drive.sideslip_rad[row] - b * rate / speed;
        let load = -body.mass_kg * speed * rate / (b / a + 1.0);
        if slip_rear.abs() > RATIO_SLIP_MIN_RAD {
            rear.push(load / slip_rear);
        }
        if slip_front.abs() > RATIO_SLIP_MIN_RAD {
            front.push(b / a * load / slip_front);
        }
    }
    [mean(front), mean(rear)]
}

/// Least squares of force on slip angle, and total least squares, both linear with an offset.
fn linear_methods(axle: &AxleRows, options: &Options) -> [f64; 2] {
    let n = axle.slip_rad.len();
    let design = DMatrix::from_fn(n, 2, |i, j| if j == 0 { 1.0 } else { -axle.slip_rad[i] });
    let response = DVector::from_column_slice(&axle.force_n);
    let slope = |fit: Result<Fit, Refusal>| fit.map_or(f64::NAN, |fit| fit.coefficients[1]);
    let errors = DMatrix::from_diagonal(&DVector::from_vec(vec![
        0.0,
        options.slip_sigma_rad.powi(2),
        options.force_sigma_n.powi(2),
    ]));
    [
        slope(regression::least_squares(&design, &response)),
        slope(regression::total(&design, &response, &errors)),
    ]
}

/// Recursive least squares of slip angle on force with an offset: the stiffness after each row,
/// N/rad. Rows are forgotten over `MEMORY` rows; a row whose force lies near the mean of those
/// before teaches nothing of the slope, and is left out so that the memory does not fade on a
/// straight.
#[must_use]
fn recursive(axle: &AxleRows) -> Vec<f64> {
    const MEMORY: f64 = 200.0;
    /// Least distance from the mean force, part of the force's standard deviation.
    const GATE: f64 = 0.5;
    let spread_n = spread(&axle.force_n);
    let forget = 1.0 - 1.0 / MEMORY;
    // Weighted sums: 1, F, F^2, alpha, F alpha.
    let mut sums = [0.0_f64; 5];
    let mut stiffness = f64::NAN;
    let rows = axle.force_n.iter().zip(&axle.slip_rad);
    rows.map(|(&force, &slip)| {
        let middle = if sums[0] > 0.0 {
            sums[1] / sums[0]
        } else {
            0.0
        };
        if (force - middle).abs() >= GATE * spread_n {
            let row = [1.0, force, force * force, slip, force * slip];
            for (sum, value) in sums.iter_mut().zip(row) {
                *sum = *sum * forget + value;
            }
            let [n, f, ff, s, fs] = sums;
            let moved = ff - f * f / n;
            if n > 10.0 && moved > n * (GATE * spread_n).powi(2) {
                stiffness = -moved / (fs - f * s / n);
            }
        }
        stiffness
    })
    .collect()
}

fn figures(axles: &[AxleRows; 2], fits: &[AxleFit; 2], step_s: f64) -> Vec<Figure> {
    let mut figures = Vec::new();
    for ((axle, fit), name) in axles.iter().zip(fits).zip(["front", "rear"]) {
        let degrees = |values: &[f64]| values.iter().map(|v| v.to_degrees()).collect();
        let most = axle
            .force_n
            .iter()
            .fold(0.0_f64, |most, f| most.max(f.abs()));
        let line: Vec<f64> = (-50..=50).map(|i| f64::from(i) / 50.0 * most).collect();
        let slips: Vec<f64> = line.iter().map(|force| fit.slip_rad(*force)).collect();
        figures.push(Figure {
            title: format!(
                "Force of the {name} axle against its slip angle: {:.0} N/rad ({} curve)",
                fit.stiffness_n_rad(),
                fit.curve.name()
            ),
            x_label: "slip angle as measured (°)".to_owned(),
            y_label: "lateral force (N)".to_owned(),
            series: vec![
                series(
                    "measured",
                    false,
                    degrees(&axle.slip_rad),
                    axle.force_n.clone(),
                ),
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
