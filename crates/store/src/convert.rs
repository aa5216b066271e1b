//! Conversion between the types of `sample` and the messages of the log.

mod direct;
mod estimate;
mod limits;
mod road;
mod scene;
mod sensor;
mod terrain;

use std::sync::Arc;

use prost::{Message, Name};
use sample::{
    Estimate, ForceFrame, LogTime, Motion, NANOS_PER_SECOND, PerWheel, Rollover, Sample, SourceId,
    TyreForce,
};

use crate::error::MessageError;
use crate::proto::{atvrec as pb, foxglove};
use crate::wheels;
use crate::{ClockFit, Ground, Pose, Record, Stage, Truth, UtcOffset};
use estimate::{
    clock_fit_to_proto, event_from_proto, event_to_proto, forces_to_proto, ground_from_proto,
    ground_to_proto, health_from_proto, health_to_proto, log_from_proto, log_to_proto,
    motion_to_proto, parameters_from_proto, parameters_to_proto, rollover_from_proto,
    rollover_to_proto, transforms_from_proto, transforms_to_proto,
};
use limits::{limits_from_proto, limits_to_proto};
use road::{friction_from_proto, road_from_proto, road_to_proto};

pub(crate) use direct::{forces, motion};
use sensor::{decode_measurement, emit_sample};
use terrain::{terrain_from_proto, terrain_to_proto};

/// A message ready for its channel. Messages of a channel share its texts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Encoded {
    /// Topic of the channel.
    pub topic: Arc<str>,
    /// Name of its schema.
    pub schema: Arc<str>,
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
            topic: topic.into(),
            schema: M::full_name().into(),
            source: None,
            log_time: log,
            publish_time: publish,
            data: message.encode_to_vec(),
        }
    }
}

/// Topic of a message with a compiled schema, without its text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Topic {
    /// The text.
    Fixed(&'static str),
    /// `/<stage>/<name>`.
    Stage(Stage, &'static str),
    /// What is before the name of the source, and what is after it.
    Source(&'static str, &'static str),
}

impl Topic {
    /// The text, for a source of this name.
    pub(crate) fn text(self, source: &str) -> String {
        match self {
            Self::Fixed(text) => text.to_owned(),
            Self::Stage(stage, name) => format!("/{}/{name}", stage.name()),
            Self::Source(before, after) => format!("{before}{source}{after}"),
        }
    }
}

/// Channel of a message with a compiled schema, without texts that have to be made for each message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Address {
    pub topic: Topic,
    /// Package and name of the schema.
    pub schema: (&'static str, &'static str),
    pub source: Option<SourceId>,
}

impl Address {
    /// Full name of the schema.
    pub(crate) fn schema(&self) -> String {
        let (package, name) = self.schema;
        format!("{package}.{name}")
    }
}

/// A message that is not encoded yet.
pub(crate) struct Outgoing<'a> {
    pub address: Address,
    pub log_time: LogTime,
    pub publish_time: LogTime,
    pub body: &'a dyn Body,
}

/// Contents of a message.
pub(crate) trait Body {
    /// Appends the encoded contents.
    fn encode(&self, out: &mut Vec<u8>);
}

impl<M: Message> Body for M {
    fn encode(&self, out: &mut Vec<u8>) {
        self.encode_raw(out);
    }
}

/// Takes the messages of a record.
pub(crate) struct Emitter<'a> {
    source: Option<SourceId>,
    take: &'a mut dyn FnMut(Outgoing<'_>),
}

impl Emitter<'_> {
    fn emit<M: Message + Name>(
        &mut self,
        topic: Topic,
        log_time: LogTime,
        publish_time: LogTime,
        body: &M,
    ) {
        let address = Address {
            topic,
            schema: (M::PACKAGE, M::NAME),
            source: self.source,
        };
        (self.take)(Outgoing {
            address,
            log_time,
            publish_time,
            body,
        });
    }

    /// Message of a topic that does not depend on a source.
    fn fixed<M: Message + Name>(&mut self, topic: &'static str, time: LogTime, body: &M) {
        self.emit(Topic::Fixed(topic), time, time, body);
    }

    fn motion(&mut self, stage: Stage, time: LogTime, motion: &Motion) {
        let topic = Topic::Stage(stage, "motion");
        self.emit(topic, time, time, &motion_to_proto(motion));
    }

    fn forces(
        &mut self,
        stage: Stage,
        time: LogTime,
        frame: ForceFrame,
        forces: &PerWheel<TyreForce>,
    ) {
        let topic = Topic::Stage(stage, forces_topic(stage, frame));
        self.emit(topic, time, time, &forces_to_proto(frame, forces));
    }

    fn rollover(&mut self, time: LogTime, rollover: &Rollover) {
        self.fixed("/estimate/rollover", time, &rollover_to_proto(rollover));
    }

    fn friction(&mut self, time: LogTime, coefficient: PerWheel<f64>) {
        let message = pb::Friction {
            wheels: wheels::entries(|wheel, axle, side| pb::WheelFriction {
                axle,
                side,
                coefficient: coefficient[wheel],
            }),
        };
        self.fixed("/truth/friction", time, &message);
    }

    fn ground(&mut self, time: LogTime, ground: &Ground) {
        self.fixed("/truth/ground", time, &ground_to_proto(ground));
    }

    fn pose(&mut self, time: LogTime, pose: &Pose) {
        let [east, north, up] = pose.position_enu_m;
        let message = pb::Pose {
            position_m: Some(pb::VectorEnu { east, north, up }),
            yaw_rad: pose.yaw_rad,
            pitch_rad: pose.pitch_rad,
            roll_rad: pose.roll_rad,
        };
        self.fixed("/truth/pose", time, &message);
    }

    fn estimate(&mut self, estimate: &Estimate) {
        let time = estimate.time;
        self.motion(Stage::Estimate, time, &estimate.motion);
        for frame in [ForceFrame::WheelCarrier, ForceFrame::Contact] {
            self.forces(Stage::Estimate, time, frame, estimate.forces(frame));
        }
        let contact = ForceFrame::Contact;
        self.forces(Stage::Model, time, contact, &estimate.expected);
        if !estimate.rollover.load_transfer_ratio.is_nan() {
            self.rollover(time, &estimate.rollover);
        }
    }

    fn truth(&mut self, truth: &Truth) {
        let time = truth.time;
        self.motion(Stage::Truth, time, &truth.motion);
        for (frame, forces) in [
            (ForceFrame::WheelCarrier, &truth.carrier),
            (ForceFrame::Contact, &truth.contact),
        ] {
            if let Some(forces) = forces {
                self.forces(Stage::Truth, time, frame, forces);
            }
        }
        if let Some(ground) = &truth.ground {
            self.ground(time, ground);
        }
        if let Some(pose) = &truth.pose {
            self.pose(time, pose);
        }
        if let Some(friction) = truth.friction {
            self.friction(time, friction);
        }
    }
}

/// Passes the messages of a record to `take`; those with run-time schemas (signals, controls) are not
/// made here.
pub(crate) fn encode(
    record: &Record,
    name: &dyn Fn(SourceId) -> String,
    take: &mut dyn FnMut(Outgoing<'_>),
) {
    let source = match record {
        Record::Sample(sample) => Some(sample.source),
        Record::ClockFit(fit) => Some(fit.source),
        _ => None,
    };
    let mut to = Emitter { source, take };
    match record {
        Record::Sample(sample) => emit_sample(sample, name, &mut to),
        Record::Estimate(estimate) => to.estimate(estimate),
        Record::Truth(truth) => to.truth(truth),
        Record::Motion {
            time,
            stage,
            motion,
        } => to.motion(*stage, *time, motion),
        Record::TyreForces {
            time,
            stage,
            frame,
            forces,
        } => to.forces(*stage, *time, *frame, forces),
        Record::Rollover { time, rollover } => to.rollover(*time, rollover),
        Record::Road { stage, road } => {
            let (topic, time) = (Topic::Stage(*stage, "road"), road.time);
            to.emit(topic, time, time, &road_to_proto(road));
        }
        Record::Limits(limits) => {
            let message = limits_to_proto(limits);
            to.fixed("/estimate/limits", limits.time, &message);
        }
        Record::Terrain(terrain) => {
            let message = terrain_to_proto(terrain);
            to.fixed("/estimate/terrain", terrain.time, &message);
        }
        Record::Friction { time, coefficient } => to.friction(*time, *coefficient),
        Record::Ground { time, ground } => to.ground(*time, ground),
        Record::Pose { time, pose } => to.pose(*time, pose),
        Record::Event(event) => {
            let topic = Topic::Fixed("/estimate/events");
            to.emit(topic, event.time, event.onset, &event_to_proto(event));
        }
        other => emit_rare(other, &mut to),
    }
}

/// Messages of at most some records a second, or of none.
fn emit_rare(record: &Record, to: &mut Emitter<'_>) {
    match record {
        Record::Parameters(parameters) => {
            let message = parameters_to_proto(parameters);
            to.fixed("/estimate/parameters", parameters.time, &message);
        }
        Record::Health(health) => to.fixed("/health", health.time, &health_to_proto(health)),
        Record::ClockFit(fit) => {
            let topic = Topic::Source("/clock_fit/", "");
            to.emit(topic, fit.time, fit.time, &clock_fit_to_proto(fit));
        }
        Record::UtcOffset(offset) => {
            let message = pb::UtcOffset {
                offset_ns: offset.offset_ns,
                sigma_s: offset.sigma_s,
                source: u32::from(offset.source.0),
                leap_seconds: offset.leap_seconds,
            };
            to.fixed("/utc_offset", offset.time, &message);
        }
        Record::Mark { time, text } => to.fixed("/mark", *time, &pb::Mark { text: text.clone() }),
        Record::Log(log) => to.fixed("/log", log.time, &log_to_proto(log)),
        Record::Transforms { time, transforms } => {
            to.fixed("/tf", *time, &transforms_to_proto(*time, transforms));
        }
        Record::Scene(scene) => to.fixed("/scene", scene.time, &scene::to_proto(scene)),
        _ => {}
    }
}

/// Last element of the topic of forces in a frame.
const fn forces_topic(stage: Stage, frame: ForceFrame) -> &'static str {
    match (stage, frame) {
        // The vehicle model knows the contact frame alone.
        (Stage::Model, _) | (_, ForceFrame::WheelCarrier) => "tyre_forces",
        (_, ForceFrame::Contact) => "contact_forces",
    }
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

/// The rollover of a message.
pub(crate) fn rollover(data: &[u8]) -> Result<Rollover, MessageError> {
    Ok(rollover_from_proto(&pb::Rollover::decode(data)?))
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
        "atvrec.Motion" => {
            let mut found = Box::new(Motion::UNKNOWN);
            motion(data, &mut found)?;
            Record::Motion {
                time,
                stage,
                motion: found,
            }
        }
        "atvrec.TyreForces" => {
            let mut found = Box::new(PerWheel([TyreForce::default(); 4]));
            Record::TyreForces {
                time,
                stage,
                frame: forces(data, &mut found)?,
                forces: found,
            }
        }
        "atvrec.Rollover" => Record::Rollover {
            time,
            rollover: rollover(data)?,
        },
        "atvrec.Road" => Record::Road {
            stage,
            road: Box::new(match direct::road(time, data) {
                Some(road) => road,
                None => road_from_proto(time, &pb::Road::decode(data)?),
            }),
        },
        "atvrec.Limits" => Record::Limits(Box::new(limits_from_proto(
            time,
            &pb::Limits::decode(data)?,
        ))),
        "atvrec.Terrain" => Record::Terrain(terrain_from_proto(time, &pb::Terrain::decode(data)?)),
        "atvrec.Friction" => Record::Friction {
            time,
            coefficient: match direct::friction(data) {
                Some(coefficient) => coefficient,
                None => friction_from_proto(&pb::Friction::decode(data)?),
            },
        },
        "atvrec.Ground" => Record::Ground {
            time,
            ground: Box::new(match direct::ground(data) {
                Some(ground) => ground,
                None => ground_from_proto(pb::Ground::decode(data)?),
            }),
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
