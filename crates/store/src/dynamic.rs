//! Channels whose fields are known at run time only: messages of a DBC, values of a controller.

use std::collections::BTreeMap;

use prost::Message as _;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};
use sample::{Measurement, Sample, Signal};

use crate::convert::Encoded;

/// A message whose signals are known at run time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DynamicMessage {
    /// Topic of its channel.
    pub topic: String,
    /// Its name, as in the DBC.
    pub name: String,
    /// Its CAN identifier, if it is a CAN message.
    pub can_id: Option<u32>,
    /// All signals that it may carry.
    pub signals: Vec<SignalSchema>,
}

/// A signal of a [`DynamicMessage`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SignalSchema {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: String,
}

impl DynamicMessage {
    /// A CAN message of `bus`, for its channel `/can/<bus>/<name>`.
    #[must_use]
    pub fn can(bus: &str, name: &str, can_id: u32, signals: Vec<SignalSchema>) -> Self {
        Self {
            topic: format!("/can/{bus}/{name}"),
            name: name.to_owned(),
            can_id: Some(can_id),
            signals,
        }
    }

    pub(crate) fn schema_name(&self) -> String {
        format!("atvrec.signals.{}", identifier(&self.name))
    }

    /// Identifier, and units by field name, kept in the channel's metadata.
    pub(crate) fn metadata(&self) -> BTreeMap<String, String> {
        let id = self.can_id.map(|id| ("can_id".to_owned(), id.to_string()));
        let units = self
            .signals
            .iter()
            .filter(|signal| !signal.unit.is_empty())
            .map(|signal| {
                (
                    format!("unit.{}", identifier(&signal.name)),
                    signal.unit.clone(),
                )
            });
        units.chain(id).collect()
    }

    /// The schema: each signal an optional double, numbered in order.
    pub(crate) fn descriptor_set(&self) -> Vec<u8> {
        let field = self
            .signals
            .iter()
            .zip(field_numbers())
            .map(|(signal, number)| FieldDescriptorProto {
                name: Some(identifier(&signal.name)),
                number: Some(number as i32),
                label: Some(Label::Optional.into()),
                r#type: Some(Type::Double.into()),
                ..FieldDescriptorProto::default()
            })
            .collect();
        // Without a `syntax` the file is proto2, in which an optional field knows its absence.
        let file = FileDescriptorProto {
            name: Some(format!("atvrec/signals/{}.proto", identifier(&self.name))),
            package: Some("atvrec.signals".to_owned()),
            message_type: vec![DescriptorProto {
                name: Some(identifier(&self.name)),
                field,
                ..DescriptorProto::default()
            }],
            ..FileDescriptorProto::default()
        };
        FileDescriptorSet { file: vec![file] }.encode_to_vec()
    }

    /// Adds signals that are not known yet; `true` if there were any.
    pub(crate) fn extend(&mut self, signals: &[Signal]) -> bool {
        let before = self.signals.len();
        for signal in signals {
            if !self.signals.iter().any(|known| known.name == signal.name) {
                self.signals.push(SignalSchema {
                    name: signal.name.clone(),
                    unit: signal.unit.clone(),
                });
            }
        }
        self.signals.len() > before
    }

    pub(crate) fn encode(&self, signals: &[Signal]) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(10 * signals.len());
        for signal in signals {
            let position = self.signals.iter().position(|s| s.name == signal.name);
            if let Some(number) = position.and_then(|p| field_numbers().nth(p)) {
                prost::encoding::double::encode(number, &signal.value, &mut bytes);
            }
        }
        bytes
    }
}

/// Message of a sample whose fields are known at run time only, and whether its schema has new fields;
/// `None` for other samples. `known` has the messages by topic.
pub(crate) fn encode(
    known: &mut BTreeMap<String, DynamicMessage>,
    sample: &Sample,
    source: &str,
) -> Option<(Encoded, bool)> {
    let (topic, name, can_id, signals): (String, &str, Option<u32>, &[Signal]) =
        match &sample.measurement {
            Measurement::Signals(frame) => (
                format!("/can/{source}/{}", frame.message),
                &frame.message,
                Some(frame.id),
                &frame.signals,
            ),
            Measurement::Control(control) => {
                (format!("/control/{source}"), source, None, &control.values)
            }
            _ => return None,
        };
    let message = known
        .entry(topic.clone())
        .or_insert_with(|| DynamicMessage {
            topic: topic.clone(),
            name: name.to_owned(),
            can_id,
            signals: Vec::new(),
        });
    let grew = message.extend(signals);
    let encoded = Encoded {
        schema: message.schema_name(),
        source: Some(sample.source),
        log_time: sample.log_time,
        publish_time: sample.valid_time,
        data: message.encode(signals),
        topic,
    };
    Some((encoded, grew))
}

/// Field numbers in order, without those that protobuf keeps for itself.
fn field_numbers() -> impl Iterator<Item = u32> {
    (1..19_000).chain(20_000..536_870_912)
}

/// `name` as a protobuf identifier.
fn identifier(name: &str) -> String {
    let mut text: String = name
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
        .collect();
    if !text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') {
        text.insert(0, '_');
    }
    text
}

/// Signals of a message by its schema (a serialized `FileDescriptorSet` with one message of
/// doubles) and the units of its channel.
pub(crate) fn decode(
    schema: &[u8],
    units: &BTreeMap<String, String>,
    data: &[u8],
) -> Result<Vec<Signal>, prost::DecodeError> {
    let set = FileDescriptorSet::decode(schema)?;
    let fields: BTreeMap<u32, &FieldDescriptorProto> = set
        .file
        .iter()
        .flat_map(|file| &file.message_type)
        .flat_map(|message| &message.field)
        .map(|field| (field.number() as u32, field))
        .collect();
    let mut rest = data;
    let mut signals = Vec::new();
    let context = prost::encoding::DecodeContext::default();
    while !rest.is_empty() {
        let (tag, wire_type) = prost::encoding::decode_key(&mut rest)?;
        let Some(field) = fields.get(&tag) else {
            prost::encoding::skip_field(wire_type, tag, &mut rest, context.clone())?;
            continue;
        };
        let mut value = 0.0;
        prost::encoding::double::merge(wire_type, &mut value, &mut rest, context.clone())?;
        let name = field.name().to_owned();
        let unit = units
            .get(&format!("unit.{name}"))
            .cloned()
            .unwrap_or_default();
        signals.push(Signal { name, value, unit });
    }
    Ok(signals)
}
