//! Logs of the layout before contract version 0, given in the present layout.
//!
//! That layout had a field for each of four wheels where the present one has a list of wheels, and the
//! frames of a CAN bus on `/can/<bus>/raw`. A channel of it is recognised by a field in its schema
//! that the present schema does not have. [`present`] and [`message`] are the only places that know
//! that layout: a reader gives its channels and messages as if they were written today.

use prost::{DecodeError, Message as _, Name as _};
use prost_types::FileDescriptorSet;
use sample::{Axle, Side, StrainChannel, Wheel};

use crate::Stage;
use crate::proto::atvrec as pb;
use crate::proto::atvrec::earlier as old;
use crate::reader::ChannelInfo;
use crate::schema;
use crate::wheels::{axle_number, position};

/// Messages that differ, each with a field that only the earlier layout has.
const CHANGED: [(&str, &str); 10] = [
    ("Deflection", "fl_counts"),
    ("Event", "two_wheel_lift_left"),
    ("Friction", "coefficient"),
    ("Motion", "slip_angle_rad"),
    ("Parameters", "front"),
    ("Rollover", "front_load_transfer_ratio"),
    ("Steer", "hand_wheel_rad"),
    ("Strain", "fl"),
    ("TyreForces", "fl"),
    ("WheelSpeed", "fl_rad_s"),
];

/// Gives a channel of the earlier layout the topic and the schema that it would have today.
pub(crate) fn present(channel: &mut ChannelInfo) {
    if channel.schema == pb::RawCan::full_name()
        && let Some(bus) = channel.topic.strip_prefix("/can/")
        && let Some(bus) = bus.strip_suffix("/raw")
    {
        channel.topic = format!("/raw/{bus}");
    }
    if channel.schema == pb::TyreForces::full_name()
        && is_of_contact_frame(channel)
        && let Some(stage) = Stage::from_topic(&channel.topic)
        && stage != Stage::Model
    {
        channel.topic = format!("/{}/contact_forces", stage.name());
    }
    if is_earlier(&channel.schema, &channel.schema_data) {
        channel.is_earlier = true;
        channel.schema_data = schema::descriptor_set(&channel.schema).into();
    }
}

/// Whether a channel of tyre forces is of a time when all forces were in the contact frame: its schema
/// has no moments.
fn is_of_contact_frame(channel: &ChannelInfo) -> bool {
    let name = pb::TyreForce::NAME;
    !has_field(&channel.schema_data, name, "moment_x_n_m").unwrap_or(true)
}

fn is_earlier(schema: &str, descriptors: &[u8]) -> bool {
    let name = schema.strip_prefix("atvrec.").unwrap_or_default();
    let Some((_, field)) = CHANGED.iter().find(|(message, _)| *message == name) else {
        return false;
    };
    has_field(descriptors, name, field).unwrap_or(false)
}

/// Whether a message of a schema has a field; `None` if the schema has no such message.
fn has_field(descriptors: &[u8], name: &str, field: &str) -> Option<bool> {
    let set = FileDescriptorSet::decode(descriptors).ok()?;
    let mut messages = set.file.iter().flat_map(|file| &file.message_type);
    let message = messages.find(|message| message.name() == name)?;
    Some(message.field.iter().any(|f| f.name() == field))
}

/// A message of a channel of the earlier layout, in the present layout.
pub(crate) fn message(schema: &str, data: &[u8]) -> Result<Vec<u8>, DecodeError> {
    Ok(match schema {
        "atvrec.Deflection" => deflection(data)?.encode_to_vec(),
        "atvrec.Event" => event(data)?.encode_to_vec(),
        "atvrec.Friction" => friction(data)?.encode_to_vec(),
        "atvrec.Motion" => motion(data)?.encode_to_vec(),
        "atvrec.Parameters" => parameters(data)?.encode_to_vec(),
        "atvrec.Rollover" => rollover(data)?.encode_to_vec(),
        "atvrec.Strain" => strain(data)?.encode_to_vec(),
        "atvrec.TyreForces" => tyre_forces(data)?.encode_to_vec(),
        "atvrec.WheelSpeed" => wheel_speed(data)?.encode_to_vec(),
        // The name of a field changed, the bytes did not.
        _ => data.to_vec(),
    })
}

/// An entry for each wheel that has a value.
fn listed<T, E>(values: [Option<T>; 4], entry: impl Fn(u32, String, T) -> E) -> Vec<E> {
    let each = Wheel::ALL.into_iter().zip(values);
    let each = each.filter_map(|(wheel, value)| {
        let (axle, side) = position(wheel);
        Some(entry(axle, side, value?))
    });
    each.collect()
}

fn each(wheels: Option<old::Wheels>) -> [f64; 4] {
    let w = wheels.unwrap_or_default();
    [w.fl, w.fr, w.rl, w.rr]
}

fn deflection(data: &[u8]) -> Result<pb::Deflection, DecodeError> {
    let old = old::Deflection::decode(data)?;
    let counts = [old.fl_counts, old.fr_counts, old.rl_counts, old.rr_counts];
    let mut message = pb::Deflection::decode(data)?;
    message.wheels = listed(counts, |axle, side, counts| pb::WheelDeflection {
        axle,
        side,
        deflection_m: None,
        raw_counts: i32::try_from(counts).ok(),
        valid: true,
        ..Default::default()
    });
    Ok(message)
}

fn strain(data: &[u8]) -> Result<pb::Strain, DecodeError> {
    let old = old::Strain::decode(data)?;
    let mut message = pb::Strain::decode(data)?;
    message.wheels = listed([old.fl, old.fr, old.rl, old.rr], |axle, side, corner| {
        let counts = [
            corner.upper_front_counts,
            corner.upper_rear_counts,
            corner.lower_front_counts,
            corner.lower_rear_counts,
            corner.tie_rod_counts,
            corner.lower_front_bending_counts,
            corner.lower_rear_bending_counts,
        ];
        let members = StrainChannel::ALL.into_iter().zip(counts);
        let members = members.filter_map(|(channel, counts)| {
            Some(pb::StrainMember {
                name: channel.name().to_owned(),
                strain: None,
                raw_counts: Some(i32::try_from(counts?).ok()?),
                valid: true,
                ..Default::default()
            })
        });
        pb::WheelStrain {
            axle,
            side,
            members: members.collect(),
        }
    });
    Ok(message)
}

fn wheel_speed(data: &[u8]) -> Result<pb::WheelSpeed, DecodeError> {
    let old = old::WheelSpeed::decode(data)?;
    let speeds = [old.fl_rad_s, old.fr_rad_s, old.rl_rad_s, old.rr_rad_s];
    let mut message = pb::WheelSpeed::decode(data)?;
    message.wheels = listed(speeds, |axle, side, angular_speed_rad_s| {
        pb::WheelAngularSpeed {
            axle,
            side,
            angular_speed_rad_s,
            valid: true,
        }
    });
    Ok(message)
}

fn motion(data: &[u8]) -> Result<pb::Motion, DecodeError> {
    let old = old::Motion::decode(data)?;
    let (steer, slip) = (each(old.steer_rad), each(old.slip_angle_rad));
    let both = std::array::from_fn(|i| Some((steer[i], slip[i])));
    let mut message = pb::Motion::decode(data)?;
    message.wheels = listed(both, |axle, side, (steer_rad, slip_angle_rad)| {
        pb::WheelMotion {
            axle,
            side,
            steer_rad,
            slip_angle_rad,
            ..pb::WheelMotion::default()
        }
    });
    Ok(message)
}

/// Whether two messages of tyre forces are the same but for the standard deviations. Those of logs whose
/// forces are all in the contact frame do not include the unknown normal of the ground.
#[must_use]
pub fn same_force_values(a: &[u8], b: &[u8]) -> bool {
    let values = |data: &[u8]| {
        let mut message = pb::TyreForces::decode(data).ok()?;
        for wheel in &mut message.wheels {
            (wheel.x_sigma_n, wheel.y_sigma_n, wheel.z_sigma_n) = (0.0, 0.0, 0.0);
        }
        Some(message.encode_to_vec())
    };
    values(a).is_some_and(|own| values(b) == Some(own))
}

/// Whether a health report is that of a version that does not count late messages, and has otherwise the
/// counters of `new`.
pub fn same_health_without_late(old: &[u8], new: &[u8]) -> bool {
    let Ok(mut health) = pb::Health::decode(new) else {
        return false;
    };
    for source in &mut health.sources {
        (source.late, source.too_late) = (0, 0);
    }
    health.encode_to_vec() == old
}

fn tyre_forces(data: &[u8]) -> Result<pb::TyreForces, DecodeError> {
    let old = old::TyreForces::decode(data)?;
    let mut message = pb::TyreForces {
        frame: pb::ForceFrame::Contact.into(),
        wheels: Vec::new(),
    };
    message.wheels = listed([old.fl, old.fr, old.rl, old.rr], |axle, side, force| {
        pb::TyreForce {
            axle,
            side,
            ..force
        }
    });
    Ok(message)
}

fn rollover(data: &[u8]) -> Result<pb::Rollover, DecodeError> {
    let old = old::Rollover::decode(data)?;
    let axles = [
        (Axle::Front, old.front_load_transfer_ratio),
        (Axle::Rear, old.rear_load_transfer_ratio),
    ];
    let mut message = pb::Rollover::decode(data)?;
    message.axles = axles
        .map(|(axle, load_transfer_ratio)| pb::AxleLoadTransfer {
            axle: axle_number(axle),
            load_transfer_ratio,
        })
        .into();
    let times = each(old.time_to_lift_s).map(Some);
    message.wheels = listed(times, |axle, side, time_to_lift_s| pb::WheelLiftTime {
        axle,
        side,
        time_to_lift_s,
    });
    Ok(message)
}

fn parameters(data: &[u8]) -> Result<pb::Parameters, DecodeError> {
    let old = old::Parameters::decode(data)?;
    let axles = [(Axle::Front, old.front), (Axle::Rear, old.rear)];
    let axles = axles.into_iter().filter_map(|(axle, grip)| {
        Some(pb::AxleGrip {
            axle: axle_number(axle),
            ..grip?
        })
    });
    let mut message = pb::Parameters::decode(data)?;
    message.axles = axles.collect();
    Ok(message)
}

fn friction(data: &[u8]) -> Result<pb::Friction, DecodeError> {
    let coefficients = each(old::Friction::decode(data)?.coefficient).map(Some);
    let wheels = listed(coefficients, |axle, side, coefficient| pb::WheelFriction {
        axle,
        side,
        coefficient,
    });
    Ok(pb::Friction { wheels })
}

fn event(data: &[u8]) -> Result<pb::Event, DecodeError> {
    use old::event::Kind as Old;
    use pb::event::Kind;
    let mut message = pb::Event::decode(data)?;
    let side = |left| {
        let side = if left { Side::Left } else { Side::Right };
        side.name().to_owned()
    };
    match (old::Event::decode(data)?.kind, &mut message.kind) {
        (Some(Old::LiftWarning(old)), Some(Kind::LiftWarning(warning))) => {
            (warning.axle, warning.side) = wheel(old.wheel);
        }
        (Some(Old::TwoWheelLiftWarning(old)), Some(Kind::TwoWheelLiftWarning(warning))) => {
            warning.side = side(old.left);
        }
        (Some(Old::SurfaceChange(old)), Some(Kind::SurfaceChange(change))) => {
            change.axle = axle_number(if old.rear { Axle::Rear } else { Axle::Front });
        }
        (_, Some(Kind::SensorFault(channel))) if channel == "hand wheel" => {
            "steering wheel".clone_into(channel);
        }
        (Some(Old::Lift(old)), kind) => {
            let (axle, side) = wheel(old);
            *kind = Some(Kind::Lift(pb::WheelPosition { axle, side }));
        }
        (Some(Old::Touchdown(old)), kind) => {
            let (axle, side) = wheel(old);
            *kind = Some(Kind::Touchdown(pb::WheelPosition { axle, side }));
        }
        (Some(Old::TwoWheelLiftLeft(left)), kind) => {
            let side = side(left);
            *kind = Some(Kind::TwoWheelLift(pb::TwoWheelLift { side }));
        }
        _ => {}
    }
    Ok(message)
}

/// Axle 0 for a number that is no wheel, which is an error where the event is read.
fn wheel(number: i32) -> (u32, String) {
    let index = usize::try_from(number.wrapping_sub(1)).ok();
    let wheel = index.and_then(|index| Wheel::ALL.get(index));
    wheel.map_or_else(Default::default, |wheel| position(*wheel))
}

#[cfg(test)]
mod tests {
    use sample::{EventKind, LogTime, SourceId};

    use super::*;
    use crate::Record;
    use crate::convert::{self, Envelope};

    /// The kind that an event of the earlier layout is read as. `now` has what both layouts share.
    fn read(now: pb::event::Kind, before: old::event::Kind) -> Option<EventKind> {
        let shared = pb::Event {
            onset_ns: 5,
            kind: Some(now),
            ..pb::Event::default()
        };
        let kind = Some(before);
        let data = [shared.encode_to_vec(), old::Event { kind }.encode_to_vec()].concat();
        let envelope = Envelope {
            topic: "/estimate/events",
            schema: "atvrec.Event",
            source: SourceId(0),
            log_time: LogTime(7),
            publish_time: LogTime(5),
        };
        let data = message("atvrec.Event", &data).expect("an event");
        match convert::decode(&envelope, &data).ok()? {
            Some(Record::Event(event)) => Some(event.kind),
            _ => None,
        }
    }

    #[test]
    fn events_of_the_earlier_layout_keep_their_wheel() {
        use old::event::Kind as Old;
        use pb::event::Kind;
        let none = || Kind::FilterReset(pb::FilterReset {});
        let wheel = old::Wheel::Rl.into();
        assert_eq!(
            read(none(), Old::Lift(wheel)),
            Some(EventKind::Lift(Wheel::RearLeft))
        );
        assert_eq!(
            read(none(), Old::Touchdown(old::Wheel::Fr.into())),
            Some(EventKind::Touchdown(Wheel::FrontRight))
        );
        assert_eq!(read(none(), Old::Lift(i32::MIN)), None);
        assert_eq!(
            read(none(), Old::TwoWheelLiftLeft(false)),
            Some(EventKind::TwoWheelLift(Side::Right))
        );
        let warning = pb::LiftWarning {
            lead_time_s: 0.5,
            ..pb::LiftWarning::default()
        };
        assert_eq!(
            read(
                Kind::LiftWarning(warning),
                Old::LiftWarning(old::LiftWarning { wheel })
            ),
            Some(EventKind::LiftWarning(Wheel::RearLeft, 0.5))
        );
        let warning = pb::TwoWheelLiftWarning {
            lead_time_s: 0.25,
            ..pb::TwoWheelLiftWarning::default()
        };
        assert_eq!(
            read(
                Kind::TwoWheelLiftWarning(warning),
                Old::TwoWheelLiftWarning(old::TwoWheelLiftWarning { left: true })
            ),
            Some(EventKind::TwoWheelLiftWarning(Side::Left, 0.25))
        );
        let change = pb::SurfaceChange {
            lateral_force_ratio: 0.75,
            ..pb::SurfaceChange::default()
        };
        assert_eq!(
            read(
                Kind::SurfaceChange(change),
                Old::SurfaceChange(old::SurfaceChange { rear: true })
            ),
            Some(EventKind::SurfaceChange(Axle::Rear, 0.75))
        );
    }

    #[test]
    fn a_channel_of_the_present_layout_stays_as_it_is() {
        for (message, _) in CHANGED {
            let schema = format!("atvrec.{message}");
            let descriptors = schema::descriptor_set(&schema);
            assert!(!is_earlier(&schema, &descriptors), "{schema}");
        }
        assert!(!is_earlier("atvrec.Motion", b"no descriptors"));
        assert!(
            message("atvrec.Strain", &[0x0a, 0x05]).is_err(),
            "a cut message"
        );
    }
}
