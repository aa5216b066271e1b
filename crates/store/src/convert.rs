//! Conversion between the types of `sample` and the messages of the log.

mod direct;
mod estimate;
mod road;
mod scene;
mod sensor;

use prost::{Message, Name};
use sample::{
    ForceFrame, LogTime, Motion, NANOS_PER_SECOND, PerWheel, Road, Rollover, Sample, SourceId,
    TyreForce,
};

use crate::error::MessageError;
use crate::proto::{atvrec as pb, foxglove};
use crate::wheels;
use crate::{ClockFit, Ground, Pose, Record, Stage, Truth, UtcOffset};
use estimate::{
    clock_fit_to_proto, event_from_proto, event_to_proto, forces_from_proto, forces_to_proto,
    ground_from_proto, ground_to_proto, health_from_proto, health_to_proto, log_from_proto,
    log_to_proto, motion_from_proto, motion_to_proto, parameters_from_proto, parameters_to_proto,
    rollover_from_proto, rollover_to_proto, transforms_from_proto, transforms_to_proto,
};
use road::{road_from_proto, road_to_proto};
use sensor::{decode_measurement, encode_sample};

/// A message ready for its channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Encoded {
    /// Topic of the channel.
    pub topic: String,
    /// Name of its schema.
    pub schema: String,
    /// The source that the channel belongs to, where it belongs to one.
    pub source: Option<SourceId>,
    /// Log clock when it was recorded or computed.
    pub log_time: LogTime,
    /// Log clock when it was true.
    pub publish_time: LogTime,
    /// Contents, by the schema.
    pub data: Vec<u8>,
}

impl Encoded {
    pub(crate) fn new<M: Message + Name>(
        topic: String,
        log: LogTime,
        publish: LogTime,
        message: &M,
    ) -> Self {
        Self {
            topic,
            schema: M::full_name(),
            source: None,
            log_time: log,
            publish_time: publish,
            data: message.encode_to_vec(),
        }
    }
}

/// The messages of a record; those with run-time schemas (signals, controls) are not made here.
pub(crate) fn encode(record: &Record, name: &dyn Fn(SourceId) -> String) -> Vec<Encoded> {
    let source = match record {
        Record::Sample(sample) => Some(sample.source),
        Record::ClockFit(fit) => Some(fit.source),
        _ => None,
    };
    let mut messages = encode_record(record, name);
    for message in &mut messages {
        message.source = source;
    }
    messages
}

fn encode_record(record: &Record, name: &dyn Fn(SourceId) -> String) -> Vec<Encoded> {
    let one = |topic: String, time, message: &dyn Fn(String, LogTime) -> Encoded| {
        vec![message(topic, time)]
    };
    match record {
        Record::Sample(sample) => encode_sample(sample, &name(sample.source)),
        Record::Estimate(estimate) => {
            let (time, contact) = (estimate.time, ForceFrame::Contact);
            let mut messages = vec![motion_message(Stage::Estimate, time, &estimate.motion)];
            messages.extend(
                [ForceFrame::WheelCarrier, contact].map(|frame| {
                    forces_message(Stage::Estimate, time, frame, estimate.forces(frame))
                }),
            );
            messages.push(forces_message(
                Stage::Model,
                time,
                contact,
                &estimate.expected,
            ));
            if !estimate.rollover.load_transfer_ratio.is_nan() {
                messages.push(rollover_message(estimate.time, &estimate.rollover));
            }
            messages
        }
        Record::Truth(truth) => {
            let Truth {
                time,
                motion,
                carrier,
                contact,
                ground,
                pose,
                friction,
            } = &**truth;
            let mut messages = vec![motion_message(Stage::Truth, *time, motion)];
            for (frame, forces) in [
                (ForceFrame::WheelCarrier, carrier),
                (ForceFrame::Contact, contact),
            ] {
                let message = |forces| forces_message(Stage::Truth, *time, frame, forces);
                messages.extend(forces.as_ref().map(message));
            }
            messages.extend(ground.as_ref().map(|ground| ground_message(*time, ground)));
            messages.extend(pose.as_ref().map(|pose| pose_message(*time, pose)));
            messages.extend(friction.map(|friction| friction_message(*time, friction)));
            messages
        }
        Record::Motion {
            time,
            stage,
            motion,
        } => vec![motion_message(*stage, *time, motion)],
        Record::TyreForces {
            time,
            stage,
            frame,
            forces,
        } => vec![forces_message(*stage, *time, *frame, forces)],
        Record::Rollover { time, rollover } => vec![rollover_message(*time, rollover)],
        Record::Road { stage, road } => vec![road_message(*stage, road)],
        Record::Friction { time, coefficient } => vec![friction_message(*time, *coefficient)],
        Record::Ground { time, ground } => vec![ground_message(*time, ground)],
        Record::Pose { time, pose } => vec![pose_message(*time, pose)],
        Record::Parameters(parameters) => vec![Encoded::new(
            "/estimate/parameters".to_owned(),
            parameters.time,
            parameters.time,
            &parameters_to_proto(parameters),
        )],
        Record::Event(event) => vec![Encoded::new(
            "/estimate/events".to_owned(),
            event.time,
            event.onset,
            &event_to_proto(event),
        )],
        Record::Health(health) => one("/health".to_owned(), health.time, &|topic, time| {
            Encoded::new(topic, time, time, &health_to_proto(health))
        }),
        Record::ClockFit(fit) => one(
            format!("/clock_fit/{}", name(fit.source)),
            fit.time,
            &|topic, time| Encoded::new(topic, time, time, &clock_fit_to_proto(fit)),
        ),
        Record::UtcOffset(offset) => one("/utc_offset".to_owned(), offset.time, &|topic, time| {
            let message = pb::UtcOffset {
                offset_ns: offset.offset_ns,
                sigma_s: offset.sigma_s,
                source: u32::from(offset.source.0),
                leap_seconds: offset.leap_seconds,
            };
            Encoded::new(topic, time, time, &message)
        }),
        Record::Mark { time, text } => one("/mark".to_owned(), *time, &|topic, time| {
            Encoded::new(topic, time, time, &pb::Mark { text: text.clone() })
        }),
        Record::Log(log) => one("/log".to_owned(), log.time, &|topic, time| {
            Encoded::new(topic, time, time, &log_to_proto(log))
        }),
        Record::Transforms { time, transforms } => one("/tf".to_owned(), *time, &|topic, time| {
            Encoded::new(topic, time, time, &transforms_to_proto(time, transforms))
        }),
        Record::Scene(scene) => one("/scene".to_owned(), scene.time, &|topic, time| {
            Encoded::new(topic, time, time, &scene::to_proto(scene))
        }),
    }
}

fn motion_message(stage: Stage, time: LogTime, motion: &Motion) -> Encoded {
    let topic = format!("/{}/motion", stage.name());
    Encoded::new(topic, time, time, &motion_to_proto(motion))
}

/// Last element of the topic of forces in a frame.
const fn forces_topic(stage: Stage, frame: ForceFrame) -> &'static str {
    match (stage, frame) {
        // The vehicle model knows the contact frame alone.
        (Stage::Model, _) | (_, ForceFrame::WheelCarrier) => "tyre_forces",
        (_, ForceFrame::Contact) => "contact_forces",
    }
}

fn forces_message(
    stage: Stage,
    time: LogTime,
    frame: ForceFrame,
    forces: &PerWheel<TyreForce>,
) -> Encoded {
    let topic = format!("/{}/{}", stage.name(), forces_topic(stage, frame));
    Encoded::new(topic, time, time, &forces_to_proto(frame, forces))
}

fn rollover_message(time: LogTime, rollover: &Rollover) -> Encoded {
    let topic = "/estimate/rollover".to_owned();
    Encoded::new(topic, time, time, &rollover_to_proto(rollover))
}

fn road_message(stage: Stage, road: &Road) -> Encoded {
    let topic = format!("/{}/road", stage.name());
    Encoded::new(topic, road.time, road.time, &road_to_proto(road))
}

fn friction_message(time: LogTime, coefficient: PerWheel<f64>) -> Encoded {
    let message = pb::Friction {
        wheels: wheels::entries(|wheel, axle, side| pb::WheelFriction {
            axle,
            side,
            coefficient: coefficient[wheel],
        }),
    };
    Encoded::new("/truth/friction".to_owned(), time, time, &message)
}

fn ground_message(time: LogTime, ground: &Ground) -> Encoded {
    let topic = "/truth/ground".to_owned();
    Encoded::new(topic, time, time, &ground_to_proto(ground))
}

fn pose_message(time: LogTime, pose: &Pose) -> Encoded {
    let [east, north, up] = pose.position_enu_m;
    let message = pb::Pose {
        position_m: Some(pb::VectorEnu { east, north, up }),
        yaw_rad: pose.yaw_rad,
        pitch_rad: pose.pitch_rad,
        roll_rad: pose.roll_rad,
    };
    Encoded::new("/truth/pose".to_owned(), time, time, &message)
}

/// `value` as a smaller type.
pub(crate) fn narrow<T, N>(field: &'static str, value: T) -> Result<N, MessageError>
where
    T: Copy + Into<i128>,
    N: TryFrom<T>,
{
    N::try_from(value).map_err(|_| MessageError::Range {
        field,
        value: value.into(),
    })
}

/// A value, absent where it is not a number.
fn some(value: f64) -> Option<f64> {
    (!value.is_nan()).then_some(value)
}

/// A value, `NaN` where it is absent.
fn nan(value: Option<f64>) -> f64 {
    value.unwrap_or(f64::NAN)
}

fn vector(v: [f64; 3]) -> pb::Vector3 {
    let [x, y, z] = v;
    pb::Vector3 { x, y, z }
}

fn array(v: Option<pb::Vector3>) -> [f64; 3] {
    let v = v.unwrap_or_default();
    [v.x, v.y, v.z]
}

fn enu_array(v: pb::VectorEnu) -> [f64; 3] {
    [v.east, v.north, v.up]
}

fn timestamp(time: LogTime) -> prost_types::Timestamp {
    let second = NANOS_PER_SECOND as u64;
    prost_types::Timestamp {
        seconds: (time.0 / second) as i64,
        nanos: (time.0 % second) as i32,
    }
}

/// Properties of a message from its channel.
pub(crate) struct Envelope<'a> {
    pub topic: &'a str,
    pub schema: &'a str,
    /// The source that the channel belongs to.
    pub source: SourceId,
    pub log_time: LogTime,
    pub publish_time: LogTime,
}

/// The record of a message; `None` for schemas that are derived (`foxglove.LocationFix`,
/// `foxglove.SceneUpdate`), raw or
/// foreign.
pub(crate) fn decode(envelope: &Envelope<'_>, data: &[u8]) -> Result<Option<Record>, MessageError> {
    let time = envelope.log_time;
    if let Some((measurement, device_time)) = decode_measurement(envelope.schema, data)? {
        return Ok(Some(Record::Sample(Sample {
            source: envelope.source,
            log_time: time,
            valid_time: envelope.publish_time,
            device_time,
            measurement,
        })));
    }
    let stage = Stage::from_topic(envelope.topic).unwrap_or(Stage::Estimate);
    Ok(Some(match envelope.schema {
        "atvrec.Motion" => Record::Motion {
            time,
            stage,
            motion: match direct::motion(data) {
                Some(motion) => motion,
                None => motion_from_proto(&pb::Motion::decode(data)?),
            },
        },
        "atvrec.TyreForces" => {
            let (frame, forces) = match direct::forces(data) {
                Some(found) => found,
                None => forces_from_proto(&pb::TyreForces::decode(data)?),
            };
            Record::TyreForces {
                time,
                stage,
                frame,
                forces,
            }
        }
        "atvrec.Rollover" => Record::Rollover {
            time,
            rollover: rollover_from_proto(&pb::Rollover::decode(data)?),
        },
        "atvrec.Road" => Record::Road {
            stage,
            road: road_from_proto(time, &pb::Road::decode(data)?),
        },
        "atvrec.Friction" => {
            let friction = pb::Friction::decode(data)?;
            let coefficient = wheels::per_wheel(&friction.wheels, f64::NAN, |w| w.coefficient);
            Record::Friction { time, coefficient }
        }
        "atvrec.Ground" => Record::Ground {
            time,
            ground: ground_from_proto(pb::Ground::decode(data)?),
        },
        "atvrec.Pose" => {
            let pose = pb::Pose::decode(data)?;
            let pose = Pose {
                position_enu_m: enu_array(pose.position_m.unwrap_or_default()),
                yaw_rad: pose.yaw_rad,
                pitch_rad: pose.pitch_rad,
                roll_rad: pose.roll_rad,
            };
            Record::Pose { time, pose }
        }
        "atvrec.Parameters" => Record::Parameters(Box::new(parameters_from_proto(
            time,
            pb::Parameters::decode(data)?,
        ))),
        "atvrec.Event" => Record::Event(event_from_proto(time, pb::Event::decode(data)?)?),
        "atvrec.Health" => Record::Health(health_from_proto(time, pb::Health::decode(data)?)?),
        "atvrec.ClockFit" => {
            let fit = pb::ClockFit::decode(data)?;
            Record::ClockFit(ClockFit {
                source: envelope.source,
                time,
                offset_s: fit.offset_s,
                drift_ppm: fit.drift_ppm,
                residual_sigma_s: fit.residual_sigma_s,
                count: fit.count,
                steps: fit.steps,
            })
        }
        "atvrec.UtcOffset" => {
            let offset = pb::UtcOffset::decode(data)?;
            Record::UtcOffset(UtcOffset {
                time,
                offset_ns: offset.offset_ns,
                sigma_s: offset.sigma_s,
                source: SourceId(narrow("source", offset.source)?),
                leap_seconds: offset.leap_seconds,
            })
        }
        "atvrec.Mark" => Record::Mark {
            time,
            text: pb::Mark::decode(data)?.text,
        },
        "foxglove.Log" => Record::Log(log_from_proto(time, foxglove::Log::decode(data)?)),
        "foxglove.FrameTransforms" => Record::Transforms {
            time,
            transforms: transforms_from_proto(foxglove::FrameTransforms::decode(data)?),
        },
        _ => return Ok(None),
    }))
}
