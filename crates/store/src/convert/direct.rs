//! Motions, tyre forces, roads and ground from the bytes of their messages.
//!
//! A log has a dozen such messages each hundredth of a second, and the generated types allocate a list and
//! four texts for each. The functions here take the messages of the present layout with the wheels of two
//! axles. For any other message they return `None`: the generated types then find its meaning or its
//! error.

use prost::encoding::decode_varint;
use sample::{
    ForceFrame, LogTime, Motion, PerWheel, Road, RoadPlane, RoadRoughness, TyreForce, Wheel,
};

use super::estimate::{force_frame, force_source};
use super::road::road_unknown;
use crate::wheels::wheel_of;
use crate::{Ground, WheelGround};

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
fn numbers(rest: &mut &[u8], first: u8, values: &mut [f64]) {
    for (number, value) in (first..).zip(values) {
        if let Some(([key, bytes @ ..], after)) = rest.split_first_chunk::<9>()
            && *key == number << 3 | 1
        {
            *value = f64::from_le_bytes(*bytes);
            *rest = after;
        }
    }
}

/// As `motion_from_proto` of the decoded message.
pub(super) fn motion(mut rest: &[u8]) -> Option<Motion> {
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
    Some(Motion {
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
    })
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

/// As `forces_from_proto` of the decoded message.
pub(super) fn forces(mut rest: &[u8]) -> Option<(ForceFrame, PerWheel<TyreForce>)> {
    let mut frame = 0;
    let mut forces = PerWheel([TyreForce::default(); 4]);
    while !rest.is_empty() {
        match next(&mut rest)? {
            (5, Value::Varint(number)) => frame = number as i32,
            (6, Value::Bytes(entry)) => {
                let (wheel, force) = wheel_force(entry)?;
                forces[wheel] = force;
            }
            _ => return None,
        }
    }
    Some((force_frame(frame), forces))
}

fn wheel_force(mut rest: &[u8]) -> Option<(Wheel, TyreForce)> {
    let (mut axle, mut side, mut source) = (0, &[][..], 0);
    let (mut forces, mut moments) = ([[0.0; 3]; 2], [[f64::NAN; 3]; 2]);
    numbers(&mut rest, 1, forces.as_flattened_mut());
    while !rest.is_empty() {
        match next(&mut rest)? {
            (number @ 1..=6, Value::F64(value)) => {
                forces.as_flattened_mut()[number as usize - 1] = value;
            }
            (number @ 10..=15, Value::F64(value)) => {
                moments.as_flattened_mut()[number as usize - 10] = value;
            }
            (7, Value::Varint(number)) => source = number as i32,
            (8, Value::Varint(number)) => axle = number as u32,
            (9, Value::Bytes(name)) => {
                side = name;
                numbers(&mut rest, 10, moments.as_flattened_mut());
            }
            _ => return None,
        }
    }
    let ([force_n, sigma_n], [moment_n_m, moment_sigma_n_m]) = (forces, moments);
    let force = TyreForce {
        force_n,
        sigma_n,
        moment_n_m,
        moment_sigma_n_m,
        source: force_source(source),
    };
    Some((wheel_of(axle, side)?, force))
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
    let mut ground_height_m = None;
    while !rest.is_empty() {
        match next(&mut rest)? {
            (1, Value::Varint(number)) => axle = number as u32,
            (2, Value::Bytes(name)) => side = name,
            (number @ 3..=6, Value::Bytes(vector)) => {
                let place = number as usize - 3;
                set_vector(vector, vectors[place].get_or_insert_default())?;
            }
            (7, Value::F64(value)) => ground_height_m = Some(value),
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
    };
    Some((wheel_of(axle, side)?, ground))
}

#[cfg(test)]
mod tests {
    use prost::Message as _;

    use super::super::estimate::{forces_from_proto, ground_from_proto, motion_from_proto};
    use super::super::road::road_from_proto;
    use super::*;
    use crate::proto::atvrec as pb;

    fn entry(axle: u32, side: &str, base: f64) -> pb::TyreForce {
        let side = side.to_owned();
        pb::TyreForce {
            axle,
            side,
            x_n: base,
            z_n: base + 2.0,
            x_sigma_n: f64::NAN,
            z_sigma_n: -0.5,
            moment_x_n_m: Some(0.0),
            moment_z_sigma_n_m: Some(base),
            source: pb::ForceSource::Fusion.into(),
            ..pb::TyreForce::default()
        }
    }

    fn same_forces(data: &[u8]) -> bool {
        let decoded = pb::TyreForces::decode(data).map(|message| forces_from_proto(&message));
        match (forces(data), decoded) {
            (None, _) => false,
            (found, decoded) => format!("{found:?}") == format!("{:?}", decoded.ok()),
        }
    }

    #[test]
    fn forces_are_those_of_the_generated_type() {
        let mut message = pb::TyreForces {
            frame: pb::ForceFrame::WheelCarrier.into(),
            wheels: [(1, "left"), (2, "right"), (1, "right"), (1, "left")]
                .into_iter()
                .zip([1.0, 1e300, -3.0, 4.5])
                .map(|((axle, side), base)| entry(axle, side, base))
                .collect(),
        };
        let whole = message.encode_to_vec();
        assert!(same_forces(&whole) && same_forces(&[]));
        for end in 0..whole.len() {
            // A cut message has fewer entries, or is none.
            let cut = &whole[..end];
            let is_whole = pb::TyreForces::decode(cut).is_ok();
            assert_eq!(forces(cut).is_some(), is_whole, "{end}");
            assert!(!is_whole || same_forces(cut), "{end}");
        }
        message.wheels.push(entry(3, "left", 1.0));
        assert!(forces(&message.encode_to_vec()).is_none());
    }

    #[test]
    fn a_motion_is_that_of_the_generated_type() {
        let wheel = |axle, side: &str, slip| pb::WheelMotion {
            axle,
            side: side.to_owned(),
            steer_rad: 0.25,
            longitudinal_slip: slip,
            ..pb::WheelMotion::default()
        };
        let message = pb::Motion {
            velocity_x_m_s: 12.5,
            yaw_rate_rad_s: f64::NAN,
            acceleration_m_s2: Some(pb::Vector3 {
                y: 4.0,
                ..pb::Vector3::default()
            }),
            wheels: vec![wheel(1, "right", Some(0.0)), wheel(2, "left", None)],
            grade_rad: -0.125,
            ..pb::Motion::default()
        };
        let whole = message.encode_to_vec();
        for end in 0..=whole.len() {
            let cut = &whole[..end];
            let decoded = pb::Motion::decode(cut).map(|message| motion_from_proto(&message));
            assert_eq!(format!("{:?}", motion(cut)), format!("{:?}", decoded.ok()));
        }
    }

    #[test]
    fn a_road_and_a_ground_are_those_of_the_generated_types() {
        let side = |left| if left { "left" } else { "right" }.to_owned();
        let road = pb::Road {
            unknown: pb::RoadUnknown::Slow.into(),
            wheels: [(1, true), (2, false)]
                .map(|(axle, left)| pb::WheelRoad {
                    axle,
                    side: side(left),
                    height_m: f64::from(axle) - 1.0,
                    height_sigma_m: 0.25,
                })
                .into(),
            grade_rad: Some(0.0),
            warp_sigma_m: Some(2.0),
            roughness: Some(pb::RoadRoughness {
                class: "B".to_owned(),
                gd_n0_low_m3: 1e-6,
                distance_m: 80.0,
                ..pb::RoadRoughness::default()
            }),
            iri_right_m_km: Some(3.5),
            ..pb::Road::default()
        };
        let vector = |x| Some(pb::Vector3 { x, y: 0.0, z: 1.0 });
        let ground = pb::Ground {
            wheels: vec![pb::WheelGround {
                axle: 2,
                side: side(true),
                normal: vector(0.5),
                unsprung_inertia_n: vector(f64::NAN),
                ground_height_m: Some(0.0),
                ..pb::WheelGround::default()
            }],
            road_class: Some("C".to_owned()),
        };
        let time = LogTime(7);
        let [road, ground] = [road.encode_to_vec(), ground.encode_to_vec()];
        for end in 0..=road.len() {
            let decoded = pb::Road::decode(&road[..end]).map(|road| road_from_proto(time, &road));
            let found = super::road(time, &road[..end]);
            assert_eq!(format!("{found:?}"), format!("{:?}", decoded.ok()));
        }
        for end in 0..=ground.len() {
            let decoded = pb::Ground::decode(&ground[..end]).map(ground_from_proto);
            let found = super::ground(&ground[..end]);
            assert_eq!(format!("{found:?}"), format!("{:?}", decoded.ok()));
        }
    }
}
