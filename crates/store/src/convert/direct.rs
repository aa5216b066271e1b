//! Motions, tyre forces, friction, roads and ground from the bytes of their messages.
//!
//! A log has a dozen such messages each hundredth of a second, and the generated types allocate a list and
//! four texts for each. The functions here take the messages of the present layout with the wheels of two
//! axles. For any other message they return `None`: the generated types then find its meaning or its
//! error.

use prost::Message as _;
use prost::encoding::decode_varint;
use sample::{
    ForceFrame, LogTime, Motion, PerWheel, Road, RoadPlane, RoadRoughness, TyreForce, Wheel,
};

use super::estimate::{force_frame, force_source, forces_from_proto, motion_from_proto};
use super::road::road_unknown;
use crate::error::MessageError;
use crate::proto::atvrec as pb;
use crate::wheels::wheel_of;
use crate::{Ground, WheelGround};

/// Sets the motion of a message.
pub(crate) fn motion(data: &[u8], motion: &mut Motion) -> Result<(), MessageError> {
    if direct_motion(data, motion).is_none() {
        *motion = motion_from_proto(&pb::Motion::decode(data)?);
    }
    Ok(())
}

/// Sets the tyre forces of a message, and returns their frame.
pub(crate) fn forces(
    data: &[u8],
    forces: &mut PerWheel<TyreForce>,
) -> Result<ForceFrame, MessageError> {
    if let Some(frame) = direct_forces(data, forces) {
        return Ok(frame);
    }
    let (frame, found) = forces_from_proto(&pb::TyreForces::decode(data)?);
    *forces = found;
    Ok(frame)
}

/// A field's value, by its wire type.
enum Value<'a> {
    Varint(u64),
    F64(f64),
    Bytes(&'a [u8]),
}

/// The number and the value of the next field.
#[expect(
    clippy::inline_always,
    reason = "a call of its own takes longer than most fields"
)]
#[inline(always)]
fn next<'a>(rest: &mut &'a [u8]) -> Option<(u64, Value<'a>)> {
    let key = varint(rest)?;
    let value = match key & 7 {
        1 => {
            let (bytes, after) = rest.split_first_chunk()?;
            *rest = after;
            Value::F64(f64::from_le_bytes(*bytes))
        }
        0 => Value::Varint(varint(rest)?),
        2 => {
            let length = usize::try_from(varint(rest)?).ok()?;
            let (bytes, after) = rest.split_at_checked(length)?;
            *rest = after;
            Value::Bytes(bytes)
        }
        _ => return None,
    };
    Some((key >> 3, value))
}

#[inline]
fn varint(rest: &mut &[u8]) -> Option<u64> {
    match rest.split_first()? {
        (first @ 0..0x80, after) => {
            *rest = after;
            Some((*first).into())
        }
        _ => decode_varint(rest).ok(),
    }
}

/// Numbers of consecutive fields of less than 16 from `first` on, as far as they come in order. A field that
/// is absent keeps its value.
#[expect(
    clippy::inline_always,
    reason = "the number of values is known where it is called"
)]
#[inline(always)]
fn numbers(rest: &mut &[u8], first: u8, values: &mut [f64]) {
    let key = |number: u8| number << 3 | 1;
    // Most messages have all of them.
    if let Some((all, after)) = rest.split_at_checked(FIELD * values.len()) {
        let (fields, _) = all.as_chunks::<FIELD>();
        if (first..)
            .zip(fields)
            .all(|(number, field)| field[0] == key(number))
        {
            for (value, [_, bytes @ ..]) in values.iter_mut().zip(fields) {
                *value = f64::from_le_bytes(*bytes);
            }
            *rest = after;
            return;
        }
    }
    for (number, value) in (first..).zip(values) {
        if let Some(([found, bytes @ ..], after)) = rest.split_first_chunk::<FIELD>()
            && *found == key(number)
        {
            *value = f64::from_le_bytes(*bytes);
            *rest = after;
        }
    }
}

/// Bytes of a number with its key.
const FIELD: usize = 9;

/// As `motion_from_proto` of the decoded message, into `motion`. What it is after `None` does not matter.
fn direct_motion(mut rest: &[u8], motion: &mut Motion) -> Option<()> {
    // Fields 1 to 14, of which 10 to 12 are no numbers.
    let mut numbers = [0.0; 14];
    let mut acceleration_m_s2 = [0.0; 3];
    let mut wheels = [[f64::NAN; 4]; 4];
    self::numbers(&mut rest, 1, &mut numbers[..9]);
    while !rest.is_empty() {
        match next(&mut rest)? {
            (number @ (1..=9 | 13 | 14), Value::F64(value)) => numbers[number as usize - 1] = value,
            (10, Value::Bytes(vector)) => set_vector(vector, &mut acceleration_m_s2)?,
            (15, Value::Bytes(entry)) => {
                let (wheel, values) = wheel_motion(entry)?;
                wheels[wheel.index()] = values;
            }
            _ => return None,
        }
    }
    let [
        vx,
        vy,
        beta,
        beta_sigma,
        roll,
        pitch,
        p,
        q,
        r,
        _,
        _,
        _,
        bank,
        grade,
    ] = numbers;
    let per_wheel = |place: usize| PerWheel(wheels.map(|values| values[place]));
    *motion = Motion {
        velocity_x_m_s: vx,
        velocity_y_m_s: vy,
        sideslip_rad: beta,
        sideslip_sigma_rad: beta_sigma,
        roll_rad: roll,
        pitch_rad: pitch,
        rate_rad_s: [p, q, r],
        acceleration_m_s2,
        steer_rad: per_wheel(0),
        slip_angle_rad: per_wheel(1),
        longitudinal_slip: per_wheel(2),
        longitudinal_slip_sigma: per_wheel(3),
        bank_rad: bank,
        grade_rad: grade,
    };
    Some(())
}

fn set_vector(mut rest: &[u8], vector: &mut [f64; 3]) -> Option<()> {
    numbers(&mut rest, 1, vector);
    while !rest.is_empty() {
        match next(&mut rest)? {
            (number @ 1..=3, Value::F64(value)) => vector[number as usize - 1] = value,
            _ => return None,
        }
    }
    Some(())
}

/// Steer and slip angle, longitudinal slip and its standard deviation of a wheel.
fn wheel_motion(mut rest: &[u8]) -> Option<(Wheel, [f64; 4])> {
    let (mut axle, mut side) = (0, &[][..]);
    let mut values = [0.0, 0.0, f64::NAN, f64::NAN];
    while !rest.is_empty() {
        match next(&mut rest)? {
            (1, Value::Varint(number)) => axle = number as u32,
            (2, Value::Bytes(name)) => {
                side = name;
                numbers(&mut rest, 3, &mut values);
            }
            (number @ 3..=6, Value::F64(value)) => values[number as usize - 3] = value,
            _ => return None,
        }
    }
    Some((wheel_of(axle, side)?, values))
}

/// As `forces_from_proto` of the decoded message, into `forces`. What they are after `None` does not matter.
/// Wheels in another order than `Wheel::ALL` are `None`.
fn direct_forces(mut rest: &[u8], forces: &mut PerWheel<TyreForce>) -> Option<ForceFrame> {
    let mut frame = 0;
    let mut wheels = Wheel::ALL.into_iter();
    while !rest.is_empty() {
        match next(&mut rest)? {
            (5, Value::Varint(number)) => frame = number as i32,
            (6, Value::Bytes(entry)) => {
                let wheel = wheels.next()?;
                set_force(entry, wheel, &mut forces[wheel])?;
            }
            _ => return None,
        }
    }
    for wheel in wheels {
        forces[wheel] = TyreForce::default();
    }
    Some(force_frame(frame))
}

/// Sets the force of a wheel. `None` if it is that of another wheel. The values are written where they stay:
/// the processor waits when it copies an array whose numbers were just stored.
fn set_force(mut rest: &[u8], wheel: Wheel, force: &mut TyreForce) -> Option<()> {
    let (mut axle, mut side) = (0, &[][..]);
    force.source = force_source(0);
    force.force_n = [0.0; 3];
    force.sigma_n = [0.0; 3];
    force.moment_n_m = [f64::NAN; 3];
    force.moment_sigma_n_m = [f64::NAN; 3];
    numbers(&mut rest, 1, &mut force.force_n);
    numbers(&mut rest, 4, &mut force.sigma_n);
    while !rest.is_empty() {
        match next(&mut rest)? {
            (number @ 1..=3, Value::F64(value)) => force.force_n[number as usize - 1] = value,
            (number @ 4..=6, Value::F64(value)) => force.sigma_n[number as usize - 4] = value,
            (number @ 10..=12, Value::F64(value)) => {
                force.moment_n_m[number as usize - 10] = value;
            }
            (number @ 13..=15, Value::F64(value)) => {
                force.moment_sigma_n_m[number as usize - 13] = value;
            }
            (7, Value::Varint(number)) => force.source = force_source(number as i32),
            (8, Value::Varint(number)) => axle = number as u32,
            (9, Value::Bytes(name)) => {
                side = name;
                numbers(&mut rest, 10, &mut force.moment_n_m);
                numbers(&mut rest, 13, &mut force.moment_sigma_n_m);
            }
            _ => return None,
        }
    }
    (wheel_of(axle, side)? == wheel).then_some(())
}

/// As `road_from_proto` of the decoded message.
pub(super) fn road(time: LogTime, mut rest: &[u8]) -> Option<Road> {
    let mut unknown = 0;
    // Fields 3 to 11, of which 9 is no number.
    let mut values = [f64::NAN; 9];
    let mut wheels = [[f64::NAN; 2]; 4];
    let mut roughness = None;
    while !rest.is_empty() {
        match next(&mut rest)? {
            (1, Value::Varint(number)) => unknown = number as i32,
            (2, Value::Bytes(entry)) => {
                let (wheel, heights) = wheel_numbers(entry)?;
                wheels[wheel.index()] = heights;
            }
            (number @ (3..=8 | 10 | 11), Value::F64(value)) => values[number as usize - 3] = value,
            (9, Value::Bytes(entry)) => set_roughness(entry, roughness.get_or_insert_default())?,
            _ => return None,
        }
    }
    let per_wheel = |place: usize| PerWheel(wheels.map(|values| values[place]));
    let [
        bank,
        bank_sigma,
        grade,
        grade_sigma,
        warp,
        warp_sigma,
        _,
        left,
        right,
    ] = values;
    Some(Road {
        time,
        unknown: road_unknown(unknown),
        height_m: per_wheel(0),
        height_sigma_m: per_wheel(1),
        plane: RoadPlane {
            bank_rad: bank,
            bank_sigma_rad: bank_sigma,
            grade_rad: grade,
            grade_sigma_rad: grade_sigma,
            warp_m: warp,
            warp_sigma_m: warp_sigma,
        },
        roughness: roughness.map(
            |[gd_n0_m3, low, high, waviness, distance_m]: [Option<f64>; 5]| RoadRoughness {
                gd_n0_m3: gd_n0_m3.unwrap_or_default(),
                bounds_m3: [low, high].map(Option::unwrap_or_default),
                waviness: waviness.unwrap_or(f64::NAN),
                distance_m: distance_m.unwrap_or_default(),
            },
        ),
        iri_m_km: [left, right],
    })
}

/// Axle, side and two numbers of a wheel; a number that is absent is zero.
fn wheel_numbers(mut rest: &[u8]) -> Option<(Wheel, [f64; 2])> {
    let (mut axle, mut side) = (0, &[][..]);
    let mut values = [0.0; 2];
    while !rest.is_empty() {
        match next(&mut rest)? {
            (1, Value::Varint(number)) => axle = number as u32,
            (2, Value::Bytes(name)) => side = name,
            (number @ (3 | 4), Value::F64(value)) => values[number as usize - 3] = value,
            _ => return None,
        }
    }
    Some((wheel_of(axle, side)?, values))
}

/// Sets the numbers of a roughness, fields 4 to 8; the classes follow from them.
fn set_roughness(mut rest: &[u8], values: &mut [Option<f64>; 5]) -> Option<()> {
    while !rest.is_empty() {
        match next(&mut rest)? {
            (1..=3, Value::Bytes(class)) => std::str::from_utf8(class).ok().map(|_| ())?,
            (number @ 4..=8, Value::F64(value)) => values[number as usize - 4] = Some(value),
            _ => return None,
        }
    }
    Some(())
}

/// The friction coefficient of each wheel, `NaN` where the message has none.
pub(super) fn friction(mut rest: &[u8]) -> Option<PerWheel<f64>> {
    let mut coefficient = PerWheel([f64::NAN; 4]);
    while !rest.is_empty() {
        let (2, Value::Bytes(entry)) = next(&mut rest)? else {
            return None;
        };
        let (wheel, [value, _]) = wheel_numbers(entry)?;
        coefficient[wheel] = value;
    }
    Some(coefficient)
}

/// As `ground_from_proto` of the decoded message.
pub(super) fn ground(mut rest: &[u8]) -> Option<Ground> {
    let mut ground = Ground {
        wheels: PerWheel([WheelGround::default(); 4]),
        road_class: None,
    };
    while !rest.is_empty() {
        match next(&mut rest)? {
            (1, Value::Bytes(entry)) => {
                let (wheel, found) = wheel_ground(entry)?;
                ground.wheels[wheel] = found;
            }
            (2, Value::Bytes(class)) => {
                ground.road_class = Some(std::str::from_utf8(class).ok()?.to_owned());
            }
            _ => return None,
        }
    }
    Some(ground)
}

fn wheel_ground(mut rest: &[u8]) -> Option<(Wheel, WheelGround)> {
    let (mut axle, mut side) = (0, &[][..]);
    let mut vectors: [Option<[f64; 3]>; 4] = [None; 4];
    let (mut ground_height_m, mut strut_length_m) = (None, None);
    while !rest.is_empty() {
        match next(&mut rest)? {
            (1, Value::Varint(number)) => axle = number as u32,
            (2, Value::Bytes(name)) => side = name,
            (number @ 3..=6, Value::Bytes(vector)) => {
                let place = number as usize - 3;
                set_vector(vector, vectors[place].get_or_insert_default())?;
            }
            (7, Value::F64(value)) => ground_height_m = Some(value),
            (8, Value::F64(value)) => strut_length_m = Some(value),
            _ => return None,
        }
    }
    let [
        normal,
        spindle,
        centre_acceleration_m_s2,
        unsprung_inertia_n,
    ] = vectors;
    let [normal_body, spindle_body] = [normal, spindle].map(|v| v.unwrap_or([f64::NAN; 3]));
    let ground = WheelGround {
        normal_body,
        spindle_body,
        centre_acceleration_m_s2,
        unsprung_inertia_n,
        ground_height_m,
        strut_length_m,
    };
    Some((wheel_of(axle, side)?, ground))
}

#[cfg(test)]
mod tests;
