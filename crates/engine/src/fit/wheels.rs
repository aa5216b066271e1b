//! Which wheel each channel of a wheel belongs to, by what braking and cornering make of it.

use model::nalgebra::{SMatrix, Vector3};
use model::suspension::{ChannelKind, Corner, CornerStatics, motion_ratio};
use model::vehicle::Vehicle;
use sample::{PerWheel, StrainChannel, Wheel};

use super::columns::{Column, Columns};
use super::line::{Follows, Line, Reaction, reaction, unit_of};
use super::reference::{Reference, YAW_RATE_MIN_RAD_S};
use super::{Judgement, Misfit};

/// Axial channels.
const AXIAL: usize = 5;
/// Cosine of the angle between two reactions from which they agree.
const AGREES: f64 = 0.5;
/// Part of the largest reaction of a wheel's channels from which the sign of a channel is judged.
const STRONG: f64 = 0.35;
/// Ratio of a reaction to the expected one that the simple balance explains.
const SIZE: std::ops::Range<f64> = 0.25..4.0;

/// Load transfer: change of a wheel's force per m/s^2 of braking (negative) and per m/s^2 to the left, N.
fn force_n(vehicle: &Vehicle, wheel: Wheel) -> [Vector3<f64>; 2] {
    let (body, axle, split) = (
        &vehicle.body,
        vehicle.axle(wheel),
        vehicle.drivetrain.brake_split_front,
    );
    let length_m = vehicle.wheelbase_m();
    let (share, brake, end) = match wheel.is_front() {
        true => (body.cg_to_rear_axle_m / length_m, split, -1.0),
        false => (body.front_axle_to_cg_m / length_m, 1.0 - split, 1.0),
    };
    let moment = body.mass_kg * body.cg_height_m;
    let along = Vector3::new(
        0.5 * body.mass_kg * brake,
        0.0,
        end * 0.5 * moment / length_m,
    );
    let side = -wheel.side() * moment * share / axle.track_m;
    let across = Vector3::new(0.0, 0.5 * body.mass_kg * share, side);
    [along, across]
}

/// Reactions of the channels of a wheel: to braking and to cornering.
type Reactions = PerWheel<[Vec<Option<f64>>; 2]>;

fn measured<'c>(
    reference: &Reference,
    rows: usize,
    columns: impl Fn(Wheel) -> Vec<&'c Column>,
) -> Reactions {
    PerWheel::from_fn(|wheel| {
        let each = columns(wheel)
            .into_iter()
            .map(|column| match column.is_known() {
                true => reaction(
                    &column.smoothed(rows),
                    &reference.longitudinal_m_s2,
                    &reference.lateral_m_s2,
                ),
                false => Reaction::default(),
            });
        let (braking, cornering) = each
            .map(|reaction| (reaction.braking, reaction.cornering))
            .unzip();
        [braking, cornering]
    })
}

/// Order and signs of the spring potentiometers.
pub fn deflections(
    columns: &Columns,
    vehicle: &Vehicle,
    reference: &Reference,
    judgement: &mut Judgement,
) {
    let expected = |wheel: Wheel| {
        let strut = vehicle.axle(wheel).strut.as_ref()?;
        let ratio = motion_ratio(vehicle, wheel).ok().flatten()?;
        let stiffness = strut.stiffness_n_m * ratio;
        Some(force_n(vehicle, wheel).map(|force| vec![force.z / stiffness]))
    };
    let all = Wheel::ALL.map(expected);
    if all.iter().any(Option::is_none) || !columns.compression_m.0.iter().any(Column::is_known) {
        return;
    }
    let expected = PerWheel(all.map(Option::unwrap_or_default));
    let found = measured(reference, columns.rows, |wheel| {
        vec![&columns.compression_m[wheel]]
    });
    let group = Group {
        subject: "spring deflection",
        role: "deflection",
        unit_words: &["mm is taken", "m is taken", "inches"],
    };
    group.judge(&found, &expected, judgement);
}

/// Order and signs of the strain channels, of the axles whose linkage is known.
pub fn strains(
    columns: &Columns,
    vehicle: &Vehicle,
    reference: &Reference,
    judgement: &mut Judgement,
) {
    let gains = Wheel::ALL.map(|wheel| gains(vehicle, wheel));
    let is_known = columns.strain.0.iter().flatten().any(Column::is_known);
    if gains.iter().all(Option::is_none) || !is_known {
        return;
    }
    let expected = PerWheel::from_fn(|wheel| {
        let Some((gain, _)) = &gains[wheel.index()] else {
            return [Vec::new(), Vec::new()];
        };
        force_n(vehicle, wheel).map(|force| (gain * force).iter().copied().collect())
    });
    let found = measured(reference, columns.rows, |wheel| {
        columns.strain[wheel].iter().take(AXIAL).collect()
    });
    let group = Group {
        subject: "strain",
        role: "strain",
        unit_words: &["kN"],
    };
    let turned = group.judge(&found, &expected, judgement);
    for wheel in Wheel::ALL
        .into_iter()
        .filter(|wheel| !turned.contains(wheel))
    {
        channels(
            vehicle,
            wheel,
            &found[wheel][1],
            &expected[wheel][1],
            judgement,
        );
    }
}

/// Signs of the channels of one wheel.
fn channels(
    vehicle: &Vehicle,
    wheel: Wheel,
    found: &[Option<f64>],
    expected: &[f64],
    judgement: &mut Judgement,
) {
    let largest = expected
        .iter()
        .fold(0.0_f64, |largest, value| largest.max(value.abs()));
    for (channel, (found, expected)) in StrainChannel::ALL
        .into_iter()
        .zip(found.iter().zip(expected))
    {
        let Some(found) = found.filter(|_| expected.abs() > STRONG * largest) else {
            continue;
        };
        if found * expected < 0.0 && found.abs() > STRONG * expected.abs() {
            let corner = wheel.abbreviation();
            let name = vehicle.channel_name(wheel, channel);
            judgement.misfits.push(Misfit {
                subject: format!("strain {corner} {name}"),
                found: format!("{found:+.0} N per m/s^2 to the left, {expected:+.0} expected"),
                cause: "the bridge is wired with the opposite sign, or the channel is that of another member".to_owned(),
                remedy: format!(
                    "run `atvrec calibrate load-rig`, set a negative gain_per_count, or correct the role strain.{corner}.{name}"
                ),
            });
        }
    }
}

/// Member forces for one newton of F_x, F_y and F_z at the contact, and those without a force; `None` without
/// a linkage.
pub fn gains(
    vehicle: &Vehicle,
    wheel: Wheel,
) -> Option<(SMatrix<f64, AXIAL, 3>, SMatrix<f64, AXIAL, 1>)> {
    let corner = Corner::of(vehicle, wheel).ok()?;
    let axle = vehicle.axle(wheel);
    let pose = corner.pose(corner.design_strut_length_m(), 0.0).ok()?;
    let (load_n, kind) = (vehicle.static_load_n(wheel), ChannelKind::BallNormal);
    let statics = CornerStatics::standing(&corner, &pose, axle, Vector3::z(), load_n, kind).ok()?;
    let mut gains: SMatrix<f64, 6, 3> = statics.force_gains();
    let outboard = match wheel.is_front() {
        true => vehicle.drivetrain.front_brake_outboard,
        false => vehicle.drivetrain.rear_brake_outboard,
    };
    if !outboard {
        // The half-shaft holds the torque of the wheel, so that F_x acts at the height of the hub.
        let height_m = axle.tyre.unloaded_radius_m - load_n / axle.tyre.vertical_stiffness_n_m;
        let moment = statics.moment_gains().column(1) * height_m;
        let along = gains.column(0) + moment;
        gains.set_column(0, &along);
    }
    let offset = statics.members_offset.fixed_rows::<AXIAL>(0).into_owned();
    Some((gains.fixed_rows::<AXIAL>(0).into_owned(), offset))
}

/// Channels of one kind at the four wheels.
struct Group {
    subject: &'static str,
    /// Table of the roles.
    role: &'static str,
    unit_words: &'static [&'static str],
}

/// Cosine of two reactions over the channels that are known; `None` without one.
fn cosine(found: &[Option<f64>], expected: &[f64]) -> Option<f64> {
    let pairs = found
        .iter()
        .zip(expected)
        .filter_map(|(found, expected)| Some(((*found)?, *expected)));
    let sums = pairs.fold([0.0; 3], |[ff, ee, fe], (f, e)| {
        [ff + f * f, ee + e * e, fe + f * e]
    });
    let [ff, ee, fe] = sums;
    (ff * ee > 0.0).then(|| fe / (ff * ee).sqrt())
}

/// Ratio of the sizes of two reactions.
fn size(found: &[Option<f64>], expected: &[f64]) -> Option<f64> {
    let pairs = found
        .iter()
        .zip(expected)
        .filter_map(|(found, expected)| Some(((*found)?, *expected)));
    let [ff, ee] = pairs.fold([0.0; 2], |[ff, ee], (f, e)| [ff + f * f, ee + e * e]);
    (ee > 0.0).then(|| (ff / ee).sqrt())
}

/// Whether a wheel's channels fit the own side and the own axle; `None` where that is not decided.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Place {
    side: Option<bool>,
    axle: Option<bool>,
}

impl Group {
    /// Judges order, signs and sizes. Returns the wheels whose channels do not fit.
    fn judge(
        &self,
        found: &Reactions,
        expected: &PerWheel<[Vec<f64>; 2]>,
        judgement: &mut Judgement,
    ) -> Vec<Wheel> {
        let places = PerWheel::from_fn(|wheel| place(wheel, &found[wheel], expected));
        if Wheel::ALL.iter().all(|wheel| places[*wheel].side.is_none()) {
            judgement.undecided(self.subject, "drive turns to both sides on firm ground");
        }
        if Wheel::ALL.iter().all(|wheel| places[*wheel].axle.is_none()) {
            judgement.undecided(self.subject, "brake firmly on a straight");
        }
        let wrong = self.order(&places, judgement);
        for wheel in Wheel::ALL {
            let ratio = size(&found[wheel][1], &expected[wheel][1]);
            let Some(ratio) = ratio.filter(|ratio| !SIZE.contains(ratio)) else {
                continue;
            };
            let corner = wheel.abbreviation();
            let cause = unit_of(ratio, 1.6, self.unit_words);
            judgement.misfits.push(Misfit {
                subject: format!("{} {corner}", self.subject),
                found: format!("its reaction to cornering is {ratio:.3} of the expected one"),
                cause: cause
                    .unwrap_or("the gain or the unit is wrong, or the sensor is loose")
                    .to_owned(),
                remedy: format!(
                    "correct the unit of the role {}.{corner}, or the chain in the sensors file",
                    self.role
                ),
            });
        }
        if wrong.is_empty() && Wheel::ALL.iter().any(|wheel| places[*wheel].side.is_some()) {
            judgement
                .fits
                .push(format!("{}: order and signs of the wheels", self.subject));
        }
        wrong
    }

    fn order(&self, places: &PerWheel<Place>, judgement: &mut Judgement) -> Vec<Wheel> {
        let appears = PerWheel::from_fn(|wheel| {
            let Place { side, axle } = places[wheel];
            apparent(wheel, side == Some(false), axle == Some(false))
        });
        let wrong: Vec<Wheel> = Wheel::ALL
            .into_iter()
            .filter(|wheel| appears[*wheel] != *wheel)
            .collect();
        if wrong.is_empty() {
            return wrong;
        }
        let names = |wheels: &[Wheel]| {
            wheels
                .iter()
                .map(|wheel| wheel.abbreviation())
                .collect::<Vec<_>>()
                .join(", ")
        };
        let list: Vec<String> = wrong
            .iter()
            .map(|wheel| {
                format!(
                    "{} reacts as {}",
                    wheel.abbreviation(),
                    appears[*wheel].abbreviation()
                )
            })
            .collect();
        let mutual = |wheel: &Wheel| appears[appears[*wheel]] == *wheel;
        let all_sides = wrong.len() == 4
            && Wheel::ALL
                .iter()
                .all(|wheel| places[*wheel].side == Some(false));
        let cause = if all_sides {
            "the signs of all four are reversed, or left and right are exchanged on both axles"
                .to_owned()
        } else if wrong.iter().all(mutual) {
            format!("the channels of {} are exchanged", names(&wrong))
        } else if wrong.len() == 1 {
            format!("the sign of {} is reversed", names(&wrong))
        } else {
            format!(
                "the channels of {} are exchanged, or their signs are reversed",
                names(&wrong)
            )
        };
        judgement.misfits.push(Misfit {
            subject: format!("{}, order of the wheels", self.subject),
            found: list.join("; "),
            cause,
            remedy: format!(
                "correct the roles {} of these wheels; press one corner after the other and watch the values of \
                 `atvrec check`",
                self.role
            ),
        });
        wrong
    }
}

fn place(wheel: Wheel, found: &[Vec<Option<f64>>; 2], expected: &PerWheel<[Vec<f64>; 2]>) -> Place {
    let decided = |cosine: f64| (cosine.abs() > AGREES).then_some(cosine > 0.0);
    let side = cosine(&found[1], &expected[wheel][1]).and_then(decided);
    let other = apparent(wheel, side == Some(false), true);
    let own = apparent(wheel, side == Some(false), false);
    let like = |wheel: Wheel| cosine(&found[0], &expected[wheel][0]);
    let axle = match (like(own), like(other)) {
        (Some(own), _) if own > AGREES => Some(true),
        (Some(own), Some(other)) if other > AGREES && own < 0.0 => Some(false),
        _ => None,
    };
    Place { side, axle }
}

/// The wheel on the other side or the other axle.
fn apparent(wheel: Wheel, other_side: bool, other_axle: bool) -> Wheel {
    Wheel::ALL[wheel.index() ^ usize::from(other_side) ^ (2 * usize::from(other_axle))]
}

/// Sides of the wheel speeds: the outer wheel of a bend runs faster.
pub fn speed_sides(
    columns: &Columns,
    vehicle: &Vehicle,
    reference: &Reference,
    judgement: &mut Judgement,
) {
    let Some(chosen) = reference.chosen.map(|chosen| &reference.yaw_rates[chosen]) else {
        return;
    };
    let rows = columns.rows;
    let mut sides = PerWheel([None; 4]);
    for wheel in Wheel::ALL {
        let speed = columns.wheel_rad_s[wheel].smoothed(rows);
        let more: Vec<f64> = (0..rows)
            .map(|row| speed[row] * reference.radius_m[wheel] - reference.rolling_m_s[row])
            .collect();
        let half_m = 0.5 * vehicle.axle(wheel).track_m;
        let expected: Vec<f64> = chosen
            .value
            .iter()
            .map(|rate| -wheel.side() * half_m * rate)
            .collect();
        let line = Line::of(&expected, &more)
            .filter(|line| line.expected_rms > half_m * YAW_RATE_MIN_RAD_S);
        sides[wheel] = line.map(|line| line.follows());
    }
    let wrong: Vec<Wheel> = Wheel::ALL
        .into_iter()
        .filter(|wheel| sides[*wheel] == Some(Follows::Reversed))
        .collect();
    let names: Vec<&str> = wrong.iter().map(|wheel| wheel.abbreviation()).collect();
    if !wrong.is_empty() {
        judgement.misfits.push(Misfit {
            subject: "wheel speeds, order of the wheels".to_owned(),
            found: format!("{}: faster on the inner side of turns", names.join(", ")),
            cause: match wrong[..] {
                [_, _] => format!("the channels of {} are exchanged", names.join(" and ")),
                _ => "left and right are exchanged".to_owned(),
            },
            remedy: "correct the roles wheel_speed of these wheels; turn one wheel by hand and watch the values of \
                     `atvrec check`"
                .to_owned(),
        });
    } else if sides.0.contains(&Some(Follows::Yes)) {
        judgement
            .fits
            .push("wheel speeds: left and right".to_owned());
    }
}
