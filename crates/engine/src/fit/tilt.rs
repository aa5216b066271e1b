//! Signs of roll rate and pitch rate: their integrals against the tilt that the specific force shows.

use sample::STANDARD_GRAVITY_M_S2;

use super::columns::{Columns, INTERVAL_S};
use super::line::{Follows, Line};
use super::reference::Reference;
use super::{Judgement, Misfit};

/// Time constant of the high-pass of both angles, s: shorter than the drift of a gyro by its bias, longer than
/// a turn or a braking.
const HIGH_PASS_S: f64 = 5.0;
/// Least root mean square of the tilt that a sign is judged by, rad. The roll of a turn with 3 m/s^2 is about
/// twice as large.
const TILT_MIN_RAD: f64 = 0.01;

/// Lateral acceleration up to which a pitch is compared, m/s^2. At a sideslip angle of 3 degrees, the forward part of
/// the centripetal acceleration, which the change of the speed does not have, is half of [`TILT_MIN_RAD`].
const STRAIGHT_M_S2: f64 = 1.0;

/// An axis of the gyro.
struct Axis {
    subject: &'static str,
    role: &'static str,
    /// Axis of the specific force that shows the tilt.
    force: usize,
    /// Sign of the angle for a positive specific force.
    sign: f64,
    /// Which direction is positive.
    positive: &'static str,
    manoeuvre: &'static str,
}

/// Roll about x and pitch about y. The specific force is f = a + g u, where u points upward. With vehicle axes
/// x forward, y left and z up, a roll angle gives u_y = sin(roll), a pitch angle u_x = -sin(pitch).
const AXES: [Axis; 2] = [
    Axis {
        subject: "inertial unit, roll rate",
        role: "rate.x",
        force: 1,
        sign: 1.0,
        positive: "a roll that lifts the left side is positive",
        manoeuvre: "drive firm turns to both sides",
    },
    Axis {
        subject: "inertial unit, pitch rate",
        role: "rate.y",
        force: 0,
        sign: -1.0,
        positive: "a pitch that lowers the front is positive",
        manoeuvre: "speed up and brake firmly on a straight",
    },
];

/// Judges the signs of roll rate and pitch rate.
pub fn rates(columns: &Columns, reference: &Reference, judgement: &mut Judgement) {
    for (axis, own) in AXES.iter().enumerate() {
        if !columns.rate_rad_s[axis].is_known() || !columns.force_m_s2[own.force].is_known() {
            continue;
        }
        let Some(line) = line(columns, reference, axis) else {
            judgement.undecided(own.subject, own.manoeuvre);
            continue;
        };
        let found = format!(
            "its integral against the direction of gravity: correlation {:.2}",
            line.correlation
        );
        match line.follows() {
            Follows::Yes => judgement.fits.push(format!("{}: {found}", own.subject)),
            Follows::No => judgement.undecided(own.subject, own.manoeuvre),
            Follows::Reversed => judgement.misfits.push(Misfit {
                subject: own.subject.to_owned(),
                found,
                cause: format!("the sign is reversed; {}", own.positive),
                remedy: format!(
                    "write a minus before the signal of the role {}, or correct the axes of the device",
                    own.role
                ),
            }),
        }
    }
}

/// Integral of the rate about an axis against the tilt, both through a high-pass; `None` without enough tilt.
fn line(columns: &Columns, reference: &Reference, axis: usize) -> Option<Line> {
    let own = &AXES[axis];
    let acceleration = [&reference.longitudinal_m_s2, &reference.lateral_m_s2][own.force];
    let force = columns.force_m_s2[own.force].smoothed(columns.rows);
    let tilt = force
        .iter()
        .zip(acceleration)
        .map(|(force, acceleration)| own.sign * (force - acceleration) / STANDARD_GRAVITY_M_S2);
    let tilt: Vec<f64> = tilt.collect();
    let rate = columns.rate_rad_s[axis].smoothed(columns.rows);
    let is_used = |row: usize| axis == 0 || reference.lateral_m_s2[row].abs() <= STRAIGHT_M_S2;
    let steps = (0..columns.rows).map(|row| {
        if !is_used(row) {
            return [f64::NAN; 2];
        }
        let before = row.checked_sub(1).map_or(f64::NAN, |before| tilt[before]);
        [tilt[row] - before, rate[row] * INTERVAL_S]
    });
    let (mut of_tilt, mut of_rate) = (Vec::new(), Vec::new());
    let mut angles = [0.0; 2];
    for step in steps {
        let is_known = step.iter().all(|value| value.is_finite());
        for (angle, step) in angles.iter_mut().zip(step) {
            let step = if is_known { step } else { 0.0 };
            *angle = (1.0 - INTERVAL_S / HIGH_PASS_S) * *angle + step;
        }
        let [tilt, turned] = angles.map(|angle| if is_known { angle } else { f64::NAN });
        of_tilt.push(tilt);
        of_rate.push(turned);
    }
    Line::of(&of_tilt, &of_rate).filter(|line| line.expected_rms >= TILT_MIN_RAD)
}
