//! Channels whose fields are known at run time only: messages of a DBC, values of a controller.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::sync::Arc;

use prost::Message as _;
use prost::encoding::WireType;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};
use sample::{Measurement, Sample, Signal, SourceId};

use crate::ChannelInfo;
use crate::convert::Body;

/// Signal with the identifier of each frame of a J1939 message.
pub const CAN_ID: &str = "j1939_can_id";
/// Signal with the source address of each frame of a J1939 message.
pub const SOURCE_ADDRESS: &str = "j1939_source_address";

/// Field numbers below this one have a key of one byte.
const ONE_BYTE_KEYS: u32 = 16;

/// A message whose signals are known at run time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DynamicMessage {
    /// Topic of its channel.
    pub topic: String,
    /// Its name, as in the DBC.
    pub name: String,
    /// Its CAN identifier, if all of its frames have the same one.
    pub can_id: Option<u32>,
    /// Its J1939 parameter group number; the identifier and the source address of each frame are
    /// then signals.
    pub parameter_group: Option<u32>,
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
    /// Names of raw values.
    pub labels: Vec<(i64, String)>,
}

impl DynamicMessage {
    /// A J1939 message of `bus`, whose frames have several identifiers: each frame also carries
    /// [`CAN_ID`] and [`SOURCE_ADDRESS`].
    #[must_use]
    pub fn j1939(bus: &str, name: &str, group: u32, mut signals: Vec<SignalSchema>) -> Self {
        signals.extend([CAN_ID, SOURCE_ADDRESS].map(|name| SignalSchema {
            name: name.to_owned(),
            unit: String::new(),
            labels: Vec::new(),
        }));
        Self {
            can_id: None,
            parameter_group: Some(group),
            ..Self::can(bus, name, 0, signals)
        }
    }

    /// A CAN message of `bus`, for its channel `/can/<bus>/<name>`.
    #[must_use]
    pub fn can(bus: &str, name: &str, can_id: u32, signals: Vec<SignalSchema>) -> Self {
        Self {
            topic: format!("/can/{bus}/{name}"),
            name: name.to_owned(),
            can_id: Some(can_id),
            parameter_group: None,
            signals,
        }
    }

    /// The channel of a log with this message.
    #[must_use]
    pub fn channel(&self, source: SourceId) -> ChannelInfo {
        ChannelInfo {
            topic: self.topic.clone(),
            schema: self.schema_name(),
            schema_data: self.descriptor_set().into(),
            message_encoding: "protobuf".to_owned(),
            source: Some(source),
            metadata: self.metadata(),
            is_earlier: false,
        }
    }

    /// Names of the fields, in the order of the signals: unique protobuf identifiers.
    fn fields(&self) -> Vec<String> {
        let mut known = BTreeSet::new();
        let unique = |signal: &SignalSchema| {
            let name = identifier(&signal.name);
            let numbered = (2..).map(|n| format!("{name}_{n}"));
            let mut names = std::iter::once(name.clone()).chain(numbered);
            // The numbers do not end.
            let free = names.find(|name| !known.contains(name)).unwrap_or_default();
            known.insert(free.clone());
            free
        };
        self.signals.iter().map(unique).collect()
    }

    pub(crate) fn schema_name(&self) -> String {
        format!("atvrec.signals.{}", identifier(&self.name))
    }

    /// What the channel's metadata has: `can_id` or `j1939_pgn`, and by field name `unit.`, `values.`
    /// (names of raw values, a JSON object) and `name.` where the field has another name.
    pub(crate) fn metadata(&self) -> BTreeMap<String, String> {
        let mut metadata = BTreeMap::new();
        metadata.extend(self.can_id.map(|id| ("can_id".to_owned(), id.to_string())));
        let group = self.parameter_group;
        metadata.extend(group.map(|group| ("j1939_pgn".to_owned(), group.to_string())));
        for (signal, field) in self.signals.iter().zip(self.fields()) {
            if !signal.unit.is_empty() {
                metadata.insert(format!("unit.{field}"), signal.unit.clone());
            }
            if !signal.labels.is_empty() {
                metadata.insert(format!("values.{field}"), json_object(&signal.labels));
            }
            if signal.name != field {
                metadata.insert(format!("name.{field}"), signal.name.clone());
            }
        }
        metadata
    }

    /// The schema: each signal an optional double, numbered in order.
    pub(crate) fn descriptor_set(&self) -> Vec<u8> {
        let field = self
            .signals
            .iter()
            .zip(self.fields())
            .zip(field_numbers())
            .map(|((_, field), number)| FieldDescriptorProto {
                // Without it, the JSON names of `a_b` and `aB` would be the same.
                json_name: Some(field.clone()),
                name: Some(field),
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

    /// Whether these signals are the first ones of the schema, in its order.
    pub(crate) fn begins_with(&self, signals: &[Signal]) -> bool {
        signals.len() <= self.signals.len()
            && (signals.iter().zip(&self.signals))
                .all(|(signal, known)| *signal.name == *known.name)
    }

    /// Adds signals that are not known yet; `true` if there were any.
    pub(crate) fn extend(&mut self, signals: &[Signal]) -> bool {
        if self.begins_with(signals) {
            return false;
        }
        let before = self.signals.len();
        for signal in signals {
            if !self.signals.iter().any(|known| known.name == *signal.name) {
                self.signals.push(SignalSchema {
                    name: signal.name.to_string(),
                    unit: signal.unit.to_string(),
                    labels: Vec::new(),
                });
            }
        }
        self.signals.len() > before
    }

    fn encode(&self, signals: &[Signal], bytes: &mut Vec<u8>) {
        for signal in signals {
            let position = self.signals.iter().position(|s| s.name == *signal.name);
            if let Some(number) = position.and_then(|p| field_numbers().nth(p)) {
                prost::encoding::double::encode(number, &signal.value, bytes);
            }
        }
    }
}

/// Signals that are the first ones of their schema, in its order.
pub(crate) struct InOrder<'a>(pub &'a [Signal]);

impl Body for InOrder<'_> {
    fn encode(&self, out: &mut Vec<u8>) {
        for (signal, number) in self.0.iter().zip(field_numbers()) {
            if number >= ONE_BYTE_KEYS {
                prost::encoding::double::encode(number, &signal.value, out);
                continue;
            }
            let mut field = [(number << 3 | WireType::SixtyFourBit as u32) as u8; 9];
            field[1..].copy_from_slice(&signal.value.to_le_bytes());
            out.extend_from_slice(&field);
        }
    }
}

/// Values of a sample whose fields are known at run time only.
pub(crate) struct Values<'a> {
    /// Name of the CAN message; empty for a controller.
    pub message: &'a str,
    /// The same, as frames share it.
    pub name: Option<&'a Arc<str>>,
    can_id: Option<u32>,
    pub signals: &'a [Signal],
}

impl<'a> Values<'a> {
    /// `None` for samples with compiled schemas.
    pub(crate) fn of(sample: &'a Sample) -> Option<Self> {
        match &sample.measurement {
            Measurement::Signals(frame) => Some(Self {
                message: &frame.message,
                name: Some(&frame.message),
                can_id: Some(frame.id),
                signals: &frame.signals,
            }),
            Measurement::Control(control) => Some(Self {
                message: "",
                name: None,
                can_id: None,
                signals: &control.values,
            }),
            _ => None,
        }
    }

    /// Source of a CAN message and address of its shared name.
    pub(crate) fn plan_key(&self, source: SourceId) -> Option<(SourceId, usize)> {
        self.name.map(|name| (source, Arc::as_ptr(name).addr()))
    }

    /// Topic, for a source of this name.
    pub(crate) fn topic(&self, source: &str) -> String {
        match self.message {
            "" => format!("/control/{source}"),
            message => format!("/can/{source}/{message}"),
        }
    }

    /// Schema without signals.
    pub(crate) fn schema(&self, topic: &str, source: &str) -> DynamicMessage {
        let name = match self.message {
            "" => source,
            message => message,
        };
        DynamicMessage {
            topic: topic.to_owned(),
            name: name.to_owned(),
            can_id: self.can_id,
            parameter_group: None,
            signals: Vec::new(),
        }
    }
}

/// Signals of one message and their schema.
pub(crate) struct Frame<'a> {
    pub message: &'a DynamicMessage,
    pub signals: &'a [Signal],
}

impl Body for Frame<'_> {
    fn encode(&self, out: &mut Vec<u8>) {
        self.message.encode(self.signals, out);
    }
}

/// Field numbers in order, without those that protobuf keeps for itself.
fn field_numbers() -> impl Iterator<Item = u32> {
    (1..19_000).chain(20_000..536_870_912)
}

/// Names of values as a JSON object. The first name of a value counts.
fn json_object(labels: &[(i64, String)]) -> String {
    let mut text = String::from("{");
    let mut known = BTreeSet::new();
    for (value, label) in labels.iter().filter(|(value, _)| known.insert(*value)) {
        let comma = if text.len() > 1 { "," } else { "" };
        // Writing into a String cannot fail.
        let _ = write!(text, "{comma}\"{value}\":\"");
        for letter in label.chars() {
            let _ = match letter {
                '"' | '\\' => write!(text, "\\{letter}"),
                '\0'..'\u{20}' => write!(text, "\\u{:04x}", u32::from(letter)),
                _ => write!(text, "{letter}"),
            };
        }
        text.push('"');
    }
    text.push('}');
    text
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
/// doubles) and the metadata of its channel.
pub(crate) fn decode(
    schema: &[u8],
    metadata: &BTreeMap<String, String>,
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
        let of = |key: &str| metadata.get(&format!("{key}.{}", field.name())).cloned();
        let name = of("name").unwrap_or_else(|| field.name().to_owned());
        let unit = of("unit").unwrap_or_default();
        signals.push(Signal {
            name: name.into(),
            value,
            unit: unit.into(),
        });
    }
    Ok(signals)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn signal(name: &str, labels: &[(i64, &str)]) -> SignalSchema {
        SignalSchema {
            name: name.to_owned(),
            unit: "m".to_owned(),
            labels: labels.iter().map(|(v, l)| (*v, (*l).to_owned())).collect(),
        }
    }

    /// The first signals of a schema, with keys of one and of two bytes.
    #[test]
    fn signals_in_order_are_encoded_as_any_others() {
        let names: Vec<String> = (0..20).map(|n| format!("s{n}")).collect();
        let schemas = names.iter().map(|name| signal(name, &[])).collect();
        let message = DynamicMessage::can("x", "M", 256, schemas);
        let values: Vec<Signal> = (names.iter().zip(1..))
            .map(|(name, value)| Signal {
                name: name.as_str().into(),
                value: f64::from(value) / 3.0,
                unit: "m".into(),
            })
            .collect();
        for count in [0, 1, 15, 16, 20] {
            let (mut found, mut expected) = (Vec::new(), Vec::new());
            InOrder(&values[..count]).encode(&mut found);
            message.encode(&values[..count], &mut expected);
            assert_eq!(found, expected);
        }
    }

    /// JSON names by default would be `aB` twice; protobuf libraries refuse such a schema.
    #[test]
    fn every_field_has_a_name_and_a_json_name_of_its_own() {
        let signals = ["a_b", "aB", "größe", "gr__e", "gr__e_2"].map(|name| signal(name, &[]));
        let message = DynamicMessage::can("x", "M", 256, signals.into());
        let set = FileDescriptorSet::decode(&*message.descriptor_set()).expect("a schema");
        let fields = &set.file[0].message_type[0].field;
        let names: Vec<&str> = fields.iter().map(|field| field.name()).collect();
        assert_eq!(names, ["a_b", "aB", "gr__e", "gr__e_2", "gr__e_2_2"]);
        assert!(fields.iter().all(|field| field.json_name() == field.name()));
        let values: Vec<Signal> = message
            .signals
            .iter()
            .zip(1..)
            .map(|(signal, value)| Signal {
                name: signal.name.as_str().into(),
                value: f64::from(value),
                unit: "m".into(),
            })
            .collect();
        let mut data = Vec::new();
        message.encode(&values, &mut data);
        let read = decode(&message.descriptor_set(), &message.metadata(), &data);
        assert_eq!(read.expect("decodes"), values);
    }

    #[test]
    fn value_tables_are_json_in_the_metadata() {
        let labels = [(0, "off"), (1, "a \"b\"\n"), (-1, "\\"), (0, "again")];
        let message = DynamicMessage::can("x", "M", 256, vec![signal("s", &labels)]);
        let metadata = message.metadata();
        assert_eq!(metadata["can_id"], "256");
        let expected = r#"{"0":"off","1":"a \"b\"\u000a","-1":"\\"}"#;
        assert_eq!(metadata["values.s"], expected);
        let message = DynamicMessage::j1939("x", "M", 0xFEF4, vec![signal("s", &[])]);
        assert_eq!(message.metadata()["j1939_pgn"], "65268");
        assert!(!message.metadata().contains_key("can_id"));
        assert_eq!(message.signals[2].name, SOURCE_ADDRESS);
    }
}
