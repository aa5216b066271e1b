//! Inertial unit, steering-wheel angle and speeds against each other.

use model::nalgebra::{Matrix4, Vector3, Vector4};
use sample::{STANDARD_GRAVITY_M_S2, Wheel};

use super::columns::Columns;
use super::line::{ACCELERATION_MIN_M_S2, Follows, Line, ROWS_MIN, unit_of};
use super::reference::{COURSE, FRONT_WHEELS, GYRO, REAR_WHEELS, Reference, STEER};
use super::{Judgement, Misfit};

/// How the subjects of the inertial unit begin.
pub const UNIT: &str = "inertial unit";
/// Subjects.
const GRAVITY: &str = "inertial unit, direction of gravity";
const AXES: &str = "inertial unit, forward and left axis";
const YAW: &str = "inertial unit, yaw rate";
const STEERING: &str = "steering-wheel angle";
const SPEED: &str = "wheel speeds against GNSS speed";

/// Angle of gravity from the z axis that a mounting, a load and springs explain, degrees.
pub const TILT_MAX_DEG: f64 = 5.0;
/// Angle that no vehicle has on any ground for minutes, degrees.
pub const TILT_CERTAIN_DEG: f64 = 30.0;
/// Length of the mean of the unit vectors of the course up to which the vehicle faced all directions.
const ONE_HEADING: f64 = 0.7;
/// Angle of a turned unit about z that is reported, degrees.
const TURN_MAX_DEG: f64 = 20.0;
/// Speed from which wheel speeds are compared with a speed, m/s.
const ROLLING_MIN_M_S: f64 = 3.0;
/// Ratio of wheel speed to vehicle speed that slip and tyre pressure explain.
const ROLLING: std::ops::Range<f64> = 0.88..1.13;
/// Ratio of specific force to acceleration, and of yaw rates, that the motion of the body explains.
const INERTIAL: std::ops::Range<f64> = 0.6..1.7;
/// Ratio of the steering-wheel angle to that of a vehicle that rolls without sideslip.
const STEER_RATIO: std::ops::Range<f64> = 0.4..4.0;

/// Lateral acceleration up to which a vehicle turns about as its wheels are steered, m/s^2.
const GENTLE_M_S2: f64 = 3.0;
/// Ratio to the expected size below which a signal does not change.
const STILL: f64 = 0.05;

/// Direction and size of gravity. Returns the angle of gravity from the z axis,
/// degrees; `None` if it is not known. A vehicle without an inertial unit stands on level ground.
pub fn gravity(columns: &Columns, reference: &Reference, judgement: &mut Judgement) -> Option<f64> {
    if !columns.force_m_s2[2].is_known() {
        return Some(0.0);
    }
    let force = [0, 1, 2].map(|axis: usize| columns.force_m_s2[axis].smoothed(columns.rows));
    let at = |row: usize| Vector3::new(force[0][row], force[1][row], force[2][row]);
    let steady = |row: &usize| reference.is_steady(*row) && at(*row).norm().is_finite();
    let rows: Vec<usize> = (0..columns.rows).filter(steady).collect();
    if rows.len() < ROWS_MIN {
        judgement.undecided(GRAVITY, "let the vehicle stand for 10 s on level ground");
        return None;
    }
    let mean = rows.iter().map(|row| at(*row)).sum::<Vector3<f64>>() / rows.len() as f64;
    let size = mean.norm() / STANDARD_GRAVITY_M_S2;
    if !(0.85..1.15).contains(&size) {
        let unit = unit_of(size, 1.1, &["g is taken", "taken for g"]);
        judgement.misfits.push(Misfit {
            subject: GRAVITY.to_owned(),
            found: format!("the mean specific force is {:.3} m/s^2 instead of 9.81 m/s^2", mean.norm()),
            cause: unit.unwrap_or("the unit or the scale of the specific force is wrong").to_owned(),
            remedy: "correct the unit of the signals of the roles acceleration, or the scale of the device".to_owned(),
        });
    }
    let raw_deg = math::acos((mean.z / mean.norm()).clamp(-1.0, 1.0)).to_degrees();
    let own = (raw_deg <= TILT_CERTAIN_DEG)
        .then(|| without_slope(&rows, at, reference))
        .flatten();
    let tilt_deg = own.map_or(raw_deg, |lean| {
        math::atan(math::hypot(lean[0], lean[1])).to_degrees()
    });
    if tilt_deg <= TILT_MAX_DEG {
        judgement
            .fits
            .push(format!("{GRAVITY}: {tilt_deg:.1} degrees from z"));
    } else if own.is_none() && raw_deg <= TILT_CERTAIN_DEG {
        judgement.undecided(
            GRAVITY,
            &format!(
                "gravity is {raw_deg:.0} degrees from z, because of the ground or of the mounting: let the \
                 vehicle stand on level ground, or drive a circle"
            ),
        );
    } else {
        let lean = own.map_or(mean / mean.norm(), |lean| {
            Vector3::new(lean[0], lean[1], 0.0)
        });
        judgement.misfits.push(turned(tilt_deg, lean));
    }
    Some(raw_deg)
}

fn turned(tilt_deg: f64, lean: Vector3<f64>) -> Misfit {
    let axis = lean.iamax();
    let sign = if lean[axis] < 0.0 { "-" } else { "+" };
    let name = ["x", "y", "z"][axis];
    Misfit {
        subject: GRAVITY.to_owned(),
        found: format!("gravity is {tilt_deg:.0} degrees from the z axis, towards {sign}{name}"),
        cause: "the unit is mounted turned, or its roles are those of other axes".to_owned(),
        remedy: "mount the unit with x forward, y to the left and z up; on CAN, give the roles acceleration and \
                 rate the signals of these axes (a minus before a signal turns its sign); for less than 30 \
                 degrees, set imu.misalignment_rad of the sensors file or run `atvrec calibrate imu`"
            .to_owned(),
    }
}

/// Part of the lean that stays when the vehicle faces another way: f_x/g and f_y/g at the vehicle, without
/// the slope of the ground. `None` if the vehicle faced one direction only.
fn without_slope(
    rows: &[usize],
    at: impl Fn(usize) -> Vector3<f64>,
    reference: &Reference,
) -> Option<[f64; 2]> {
    let mut normal = Matrix4::zeros();
    let mut right = Vector4::zeros();
    let (mut east, mut north, mut count) = (0.0, 0.0, 0_usize);
    for &row in rows {
        let course = reference.course_rad[row];
        if !course.is_finite() {
            continue;
        }
        let (sin, cos) = math::sin_cos(course);
        (east, north, count) = (east + cos, north + sin, count + 1);
        let force = at(row) / STANDARD_GRAVITY_M_S2;
        let equations = [
            (Vector4::new(1.0, 0.0, cos, sin), force.x),
            (Vector4::new(0.0, 1.0, -sin, cos), force.y),
        ];
        for (line, value) in equations {
            normal += line * line.transpose();
            right += line * value;
        }
    }
    let one_heading = math::hypot(east, north) / count.max(1) as f64;
    if count < ROWS_MIN || one_heading > ONE_HEADING {
        return None;
    }
    let solution = normal.cholesky()?.solve(&right);
    Some([solution[0], solution[1]])
}

/// Horizontal axes of the inertial unit, by braking and cornering.
pub fn horizontal_axes(columns: &Columns, reference: &Reference, judgement: &mut Judgement) {
    if !columns.force_m_s2[0].is_known() || !columns.force_m_s2[1].is_known() {
        return;
    }
    let expected = [&reference.longitudinal_m_s2, &reference.lateral_m_s2];
    let found = [0, 1].map(|axis: usize| columns.force_m_s2[axis].smoothed(columns.rows));
    let lines = [0, 1].map(|axis: usize| {
        let line = Line::of(expected[axis], &found[axis]);
        line.filter(|line| line.expected_rms >= ACCELERATION_MIN_M_S2)
    });
    for (line, manoeuvre) in lines.iter().zip([
        "speed up and brake on a straight",
        "drive turns to both sides",
    ]) {
        if line.is_none() {
            judgement.undecided(AXES, manoeuvre);
        }
    }
    let names = [
        "x (forward) against the change of the speed",
        "y (left) against speed times yaw rate",
    ];
    let follows = lines.map(|line| line.map(|line| line.follows()));
    let half_turn = follows == [Some(Follows::Reversed); 2];
    let all_follow = follows.iter().flatten().all(|f| *f == Follows::Yes);
    // Up to 45 degrees, both axes follow the motion, each with a part of the other.
    let is_turned = |angle: &f64| {
        half_turn
            || !follows.contains(&Some(Follows::Reversed))
                && angle.abs() > TURN_MAX_DEG
                && (!all_follow || lines.iter().all(Option::is_some))
    };
    let turned = turn_about_z(expected, &found, &lines).filter(is_turned);
    if turned.is_none() && all_follow {
        for (axis, line) in lines.iter().enumerate() {
            let Some(line) = line else { continue };
            judgement.ratio(
                AXES,
                names[axis],
                line.ratio,
                &INERTIAL,
                &["g is taken", "taken for g"],
                "the roles acceleration",
            );
        }
    } else if let Some(degrees) = turned {
        judgement.misfits.push(Misfit {
            subject: AXES.to_owned(),
            found: format!("the horizontal axes fit the motion if the unit is turned by {degrees:.0} degrees about z"),
            cause: "the unit is mounted turned about the vertical axis, or its roles are those of other axes".to_owned(),
            remedy: "mount the unit with x forward and y to the left, or correct the roles acceleration".to_owned(),
        });
    } else {
        for (axis, line) in lines
            .iter()
            .enumerate()
            .filter(|(axis, _)| follows[*axis] == Some(Follows::Reversed))
        {
            let correlation = line.map_or(f64::NAN, |line| line.correlation);
            judgement.misfits.push(Misfit {
                subject: AXES.to_owned(),
                found: format!("{}: correlation {correlation:.2}", names[axis]),
                cause: format!("the sign of {} is reversed, or the unit is mounted turned by half a turn", ["x", "y"][axis]),
                remedy: "mount the unit with x forward and y to the left, or write a minus before the signal of the role"
                    .to_owned(),
            });
        }
    }
}

/// Angle of the unit about z, degrees, that brings its readings nearest to the motion; `None` if they do not
/// fit at any angle.
fn turn_about_z(
    expected: [&Vec<f64>; 2],
    found: &[Vec<f64>; 2],
    lines: &[Option<Line>; 2],
) -> Option<f64> {
    if lines.iter().all(Option::is_none) {
        return None;
    }
    let rows = 0..found[0].len();
    let all = |row: usize| {
        [
            expected[0][row],
            expected[1][row],
            found[0][row],
            found[1][row],
        ]
    };
    let known: Vec<[f64; 4]> = rows
        .map(all)
        .filter(|row| row.iter().all(|v| v.is_finite()))
        .collect();
    let mean = |k: usize| known.iter().map(|row| row[k]).sum::<f64>() / known.len() as f64;
    let means = [0, 1, 2, 3].map(mean);
    let (mut along, mut across, mut squares) = (0.0, 0.0, [0.0; 2]);
    for row in &known {
        let [px, py, qx, qy]: [f64; 4] = std::array::from_fn(|k| row[k] - means[k]);
        along += px * qx + py * qy;
        across += py * qx - px * qy;
        squares = [
            squares[0] + px * px + py * py,
            squares[1] + qx * qx + qy * qy,
        ];
    }
    let agreement = math::hypot(along, across) / (squares[0] * squares[1]).sqrt();
    (agreement > 0.6).then(|| math::atan2(across, along).to_degrees())
}

/// Signs and units of yaw rate, steering-wheel angle and wheel-speed differences.
pub fn yaw_rates(reference: &Reference, unit_stands: bool, judgement: &mut Judgement) {
    let known = |name: &str| reference.yaw_rates.iter().any(|rate| rate.name == name);
    let Some(chosen) = reference.chosen.map(|chosen| &reference.yaw_rates[chosen]) else {
        for (name, subject) in [(GYRO, YAW), (STEER, STEERING)] {
            if known(name) {
                judgement.undecided(subject, "drive turns to both sides, faster than 2 m/s");
            }
        }
        return;
    };
    for rate in &reference.yaw_rates {
        let subject = match rate.name {
            GYRO => YAW,
            STEER => STEERING,
            COURSE => "course of the GNSS receiver",
            // The order of the wheels is judged for each wheel.
            FRONT_WHEELS | REAR_WHEELS => continue,
            _ => rate.name,
        };
        if rate.name == chosen.name || rate.name == GYRO && !unit_stands {
            continue;
        }
        // Near the limit of friction, a vehicle turns less than its wheels are steered.
        let gentle: Vec<f64> = (chosen.value.iter().zip(&reference.lateral_m_s2))
            .map(|(rate, lateral)| {
                if lateral.abs() > GENTLE_M_S2 {
                    f64::NAN
                } else {
                    *rate
                }
            })
            .collect();
        let expected = if rate.name == STEER {
            &gentle
        } else {
            &chosen.value
        };
        let line = Line::through_zero(expected, &rate.value);
        let Some(line) = line else { continue };
        let (ratio, correlation) = (line.ratio, line.correlation);
        let against = format!("against the {}", chosen.name);
        match line.follows() {
            Follows::Yes if rate.name == STEER => {
                judgement.ratio(subject, &against, ratio, &STEER_RATIO, &["radians", "degrees"], "the role steer, or steering.ratio of the vehicle file");
            }
            Follows::Yes => {
                judgement.ratio(subject, &against, ratio, &INERTIAL, &["radians", "degrees"], "the role rate.z");
            }
            Follows::Reversed => judgement.misfits.push(Misfit {
                subject: subject.to_owned(),
                found: format!("{against}: correlation {correlation:.2}"),
                cause: "the sign is reversed; left turns are positive".to_owned(),
                remedy: format!(
                    "write a minus before the signal of the role, or turn the device{}",
                    if chosen.name == COURSE { "" } else { "; without a GNSS receiver, the sign of the other sensor can be wrong instead" }
                ),
            }),
            // On a slope and at high lateral acceleration, a vehicle is steered otherwise than it turns.
            Follows::No if rate.name == STEER && ratio > STILL => {
                judgement.undecided(subject, "drive slow turns to both sides on level, firm ground");
            }
            Follows::No => judgement.misfits.push(Misfit {
                subject: subject.to_owned(),
                found: format!("{against}: correlation {correlation:.2}"),
                cause: "the signal is that of another quantity or axis, or the sensor is loose".to_owned(),
                remedy: "correct the role, and compare the values that `atvrec check` prints while the vehicle turns".to_owned(),
            }),
        }
    }
}

/// Sizes of the wheel speeds against the GNSS speed.
pub fn wheel_speeds(columns: &Columns, reference: &Reference, judgement: &mut Judgement) {
    if reference.gnss_speed_m_s.is_empty()
        || !columns.wheel_rad_s.0.iter().any(|wheel| wheel.is_known())
    {
        return;
    }
    let mut ratios = Vec::new();
    for wheel in Wheel::ALL {
        let speeds = columns.wheel_rad_s[wheel].smoothed(columns.rows);
        let pairs = reference.gnss_speed_m_s.iter().zip(&speeds);
        let moving = pairs.filter(|(speed, wheel)| **speed > ROLLING_MIN_M_S && wheel.is_finite());
        let mut each: Vec<f64> = moving
            .map(|(speed, turn)| turn.abs() * reference.radius_m[wheel] / speed)
            .collect();
        if each.len() >= ROWS_MIN {
            each.sort_by(f64::total_cmp);
            ratios.push((wheel, each[each.len() / 2]));
        }
    }
    if ratios.is_empty() {
        judgement.undecided(SPEED, "drive faster than 3 m/s for 10 s");
    }
    for (wheel, ratio) in ratios {
        let corner = wheel.abbreviation();
        if ROLLING.contains(&ratio) {
            judgement.fits.push(format!(
                "wheel speed {corner}: {ratio:.3} of the GNSS speed"
            ));
            continue;
        }
        let radius_m = reference.radius_m[wheel];
        let words = ["km/h", "mph", "revolutions", "degrees", "radians"];
        let cause = match unit_of(ratio, 1.1, &words) {
            Some(unit) => unit.to_owned(),
            None if ratio < 0.1 => "the wheel does not turn in the recording: the sensor is not connected, or the role is that of another signal".to_owned(),
            None => format!("the radius of {radius_m:.3} m is wrong ({:.3} m fits), or the number of teeth", radius_m / ratio),
        };
        judgement.misfits.push(Misfit {
            subject: format!("wheel speed {corner}"),
            found: format!("{ratio:.3} of the GNSS speed"),
            cause,
            remedy: format!("correct the unit of the signal of the role wheel_speed.{corner}, or tyre.unloaded_radius_m of the vehicle file"),
        });
    }
}
