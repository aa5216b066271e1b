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

mod lean;
mod level;
mod straight;
mod turns;
pub(super) mod windows;

use model::vehicle::Vehicle;
use nalgebra::{DMatrix, DVector, Vector3};
use sample::{PerWheel, STANDARD_GRAVITY_M_S2, Wheel};

pub use self::lean::{Lean, Leaning};
use self::level::Level;
use self::straight::straight;
use self::turns::turns;
use super::rest::{Signal, Stretch};
use super::{Calibration, ImuCalibration};
use crate::finding::{Excitation, Finding, Findings, Refusal};
use crate::regression::{Bootstrap, Fit};
use crate::statistics::SIGMAS_95;

const WHAT: &str = "imu";
/// What springs and tyres leave open of the body's roll and pitch in turns, as a turn of the unit,
/// rad: rolling resistance and the potentiometers' rounding are a part of it.
const LEAN_DOUBT_RAD: f64 = 3e-4;

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

impl ImuSignal<'_> {
    /// Specific force at the centre of gravity along x and y, m/s^2, as a unit at `position_m`
    /// reads it next to an instant; 0 without readings.
    ///
    /// f = f_s - w' x d - w x (w x d), the acceleration w' of the rates w over a tenth of a second.
    #[must_use]
    pub fn force_near(&self, time_s: f64, position_m: [f64; 3]) -> [f64; 2] {
        const AROUND: usize = 5;
        let count = self.time_s.len().min(self.force_m_s2.len());
        let count = count.min(self.rate_rad_s.len());
        let Some(last) = count.checked_sub(1) else {
            return [0.0; 2];
        };
        let next = self.time_s.partition_point(|&known_s| known_s < time_s);
        let row = next.min(last);
        let (before, after) = (row.saturating_sub(AROUND), (row + AROUND).min(last));
        let [force, rate, start, end] = [
            self.force_m_s2[row],
            self.rate_rad_s[row],
            self.rate_rad_s[before],
            self.rate_rad_s[after],
        ]
        .map(Vector3::from);
        let span_s = self.time_s[after] - self.time_s[before];
        let change = if span_s > 0.0 {
            (end - start) / span_s
        } else {
            Vector3::zeros()
        };
        let arm = Vector3::from(position_m);
        let force = force - change.cross(&arm) - rate.cross(&rate.cross(&arm));
        [force.x, force.y]
    }
}

/// A log with stretches of rest in several headings, or a drive.
#[derive(Clone, Copy, Debug, Default)]
pub struct ImuLog<'a> {
    /// The unit's readings.
    pub imu: ImuSignal<'a>,
    /// Forward speed, m/s.
    pub speed_m_s: Signal<'a>,
    /// Roll and pitch of the body against the ground by the springs, rad, see [`Lean`]. Empty
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
    // Each needs a little of the other: the turn about z by itself is good enough for the gyros.
    let refused = |refusal: Refusal| refusal.of(WHAT);
    let alone = straight(logs, &level, [0.0; 2]);
    let about_z_rad = alone.map_or(0.0, |straight| straight.fit.coefficients[1]);
    let turns = turns(logs, &level, about_z_rad).map_err(refused)?;
    let (roll, pitch) = (&turns.fits[0], &turns.fits[1]);
    // p_s = ... + (b - theta_0) r, q_s = ... - (a - phi_0) r.
    let (b_eff, a_eff) = (roll.coefficients[1], -pitch.coefficients[1]);
    let straight = straight(logs, &level, [a_eff, b_eff]).map_err(refused)?;
    let [roll_0, pitch_0] = rest_roll_pitch_rad;
    let misalignment = [
        a_eff + roll_0,
        b_eff + pitch_0,
        straight.fit.coefficients[1],
    ];
    // The turns follow each other, z last.
    let (sine, cosine) = math::sin_cos(misalignment[2]);
    let across = [b_eff * cosine + a_eff * sine, a_eff * cosine - b_eff * sine];
    let g = STANDARD_GRAVITY_M_S2;
    let upright = math::cos(a_eff) * math::cos(b_eff) * math::cos(level.slope_rad);
    let bias = [
        level.force[0] - g * across[0],
        level.force[1] + g * across[1],
        level.force[2] - g * upright,
    ];
    let [about_x, about_y] = [pitch, roll].map(|fit| math::hypot(fit.sigma(1), LEAN_DOUBT_RAD));
    let bias_sigma = [
        math::hypot(level.force_sigma[0], g * about_y),
        math::hypot(level.force_sigma[1], g * about_x),
        level.force_sigma[2],
    ];
    let sigma = [about_x, about_y, straight.fit.sigma(1)];
    let intervals = [
        turns.intervals[1]
            .map(|[low, high]| widened([roll_0 - high, roll_0 - low], LEAN_DOUBT_RAD)),
        turns.intervals[0].map(|ends| widened(ends.map(|end| end + pitch_0), LEAN_DOUBT_RAD)),
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
    findings.notes.push(scale_refusal(&level).to_string());
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

/// Why scale factors are not looked for: rest leaves gravity on z, one number with the bias of z.
fn scale_refusal(level: &Level) -> Refusal {
    Refusal::NotExcited {
        what: "scale factors".to_owned(),
        quantity: "change of gravity along an axis between the headings at rest".to_owned(),
        found: 2.0 * STANDARD_GRAVITY_M_S2 * math::sin(level.slope_rad),
        needed: STANDARD_GRAVITY_M_S2,
        unit: "m/s^2".to_owned(),
        help: "they are taken as 1; only the unit on its sides would tell them from its biases"
            .to_owned(),
    }
}

/// Roll (right side down) and pitch (nose down) of the body against flat ground by the compression
/// of its springs, rad: wheel travel is compression over the motion ratio i, and a tyre of stiffness
/// k_z gives way by i^2 k/k_z of it. `None` where the vehicle file has no motion ratio.
#[must_use]
pub fn lean_rad(vehicle: &Vehicle, compression_m: &PerWheel<f64>) -> Option<[f64; 2]> {
    let travel = |wheel: Wheel| {
        let axle = vehicle.axle(wheel);
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
fn widened([low, high]: [f64; 2], sigma: f64) -> [f64; 2] {
    let half = 0.5 * (high - low);
    let more = math::hypot(half, SIGMAS_95 * sigma) - half;
    [low - more, high + more]
}
