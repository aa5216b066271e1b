//! The sections of a DBC file by what they refer to, so that loading takes time in proportion to the
//! file.

use std::collections::HashMap;

use can_dbc::{
    AttributeDefinition, AttributeValue, AttributeValueType, Comment, Dbc, ExtendedMultiplex,
    MessageId, SignalExtendedValueType, ValDescription, ValueDescription,
};

/// A signal: identifier of its message and name.
type SignalKey<'a> = (MessageKey, &'a str);
/// An identifier: whether it has 29 bits, and its bits.
pub type MessageKey = (bool, u32);

/// Attribute with the frame format of a message.
const FRAME_FORMAT: &str = "VFrameFormat";
/// Attributes with names of more than 32 characters.
const LONG_MESSAGE: &str = "SystemMessageLongSymbol";
const LONG_SIGNAL: &str = "SystemSignalLongSymbol";

pub const fn key(id: MessageId) -> MessageKey {
    match id {
        MessageId::Standard(id) => (false, id as u32),
        MessageId::Extended(id) => (true, id),
    }
}

/// What the file says of messages and signals. Where it says something twice, the first counts.
#[derive(Default)]
pub struct Index<'a> {
    pub message_comments: HashMap<MessageKey, &'a str>,
    pub signal_comments: HashMap<SignalKey<'a>, &'a str>,
    pub labels: HashMap<SignalKey<'a>, &'a [ValDescription]>,
    pub types: HashMap<SignalKey<'a>, &'a SignalExtendedValueType>,
    pub selectors: HashMap<SignalKey<'a>, &'a ExtendedMultiplex>,
    /// Names of more than 32 characters.
    pub long_messages: HashMap<MessageKey, &'a str>,
    pub long_signals: HashMap<SignalKey<'a>, &'a str>,
    frame_formats: HashMap<MessageKey, &'a str>,
    default_format: &'a str,
}

impl<'a> Index<'a> {
    pub fn new(parsed: &'a Dbc) -> Self {
        let mut index = Self::default();
        for entry in &parsed.comments {
            match entry {
                Comment::Message { id, comment } => {
                    index.message_comments.entry(key(*id)).or_insert(comment);
                }
                Comment::Signal {
                    message_id,
                    name,
                    comment,
                } => {
                    let signal = (key(*message_id), name.as_str());
                    index.signal_comments.entry(signal).or_insert(comment);
                }
                _ => {}
            }
        }
        for entry in &parsed.value_descriptions {
            if let ValueDescription::Signal {
                message_id,
                name,
                value_descriptions,
            } = entry
            {
                let signal = (key(*message_id), name.as_str());
                index.labels.entry(signal).or_insert(value_descriptions);
            }
        }
        for entry in &parsed.signal_extended_value_type_list {
            let signal = (key(entry.message_id), entry.signal_name.as_str());
            let value_type = &entry.signal_extended_value_type;
            index.types.entry(signal).or_insert(value_type);
        }
        for entry in &parsed.extended_multiplex {
            let signal = (key(entry.message_id), entry.signal_name.as_str());
            index.selectors.entry(signal).or_insert(entry);
        }
        index.read_formats(parsed);
        index.read_long_names(parsed);
        index
    }

    fn read_long_names(&mut self, parsed: &'a Dbc) {
        for entry in &parsed.attribute_values_message {
            if let (LONG_MESSAGE, AttributeValue::String(name)) = (&*entry.name, &entry.value) {
                self.long_messages.insert(key(entry.message_id), name);
            }
        }
        for entry in &parsed.attribute_values_signal {
            if let (LONG_SIGNAL, AttributeValue::String(name)) = (&*entry.name, &entry.value) {
                let signal = (key(entry.message_id), entry.signal_name.as_str());
                self.long_signals.insert(signal, name);
            }
        }
    }

    fn read_formats(&mut self, parsed: &'a Dbc) {
        let definition = parsed.attribute_definitions.iter().find_map(|entry| {
            let AttributeDefinition::Message(name, AttributeValueType::Enum(names)) = entry else {
                return None;
            };
            (name == FRAME_FORMAT).then_some(names.as_slice())
        });
        let names = definition.unwrap_or_default();
        for entry in &parsed.attribute_values_message {
            if entry.name == FRAME_FORMAT {
                let format = format_name(&entry.value, names);
                let message = key(entry.message_id);
                self.frame_formats.entry(message).or_insert(format);
            }
        }
        let default = parsed.attribute_default(FRAME_FORMAT);
        self.default_format = default.map_or("", |value| format_name(value, names));
    }

    /// The file's `VFrameFormat` of a message, by name; empty if there is none.
    pub fn frame_format(&self, message: MessageKey) -> &'a str {
        let own = self.frame_formats.get(&message);
        own.copied().unwrap_or(self.default_format)
    }
}

fn format_name<'a>(value: &'a AttributeValue, names: &'a [String]) -> &'a str {
    let index = match value {
        AttributeValue::String(text) => return text,
        AttributeValue::Uint(index) => usize::try_from(*index).ok(),
        AttributeValue::Int(index) => usize::try_from(*index).ok(),
        AttributeValue::Double(_) => None,
    };
    let name = index.and_then(|index| names.get(index));
    name.map_or("", String::as_str)
}
