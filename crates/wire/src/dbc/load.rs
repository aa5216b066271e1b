//! From text to a [`Database`] that cannot be wrong.

use can_dbc::{
    AttributeDefinition, AttributeValue, AttributeValueType, Comment, Dbc, Message, MessageId,
    MultiplexIndicator, NumericValue, Signal, SignalExtendedValueType, ValueDescription, ValueType,
};

use super::bits::Field;
use super::text::{Lines, decode_text, syntax_error};
use super::{
    ByteOrder, Database, DbcError, Issue, MessageDef, RawKind, Selector, SignalDef, parameter_group,
};

/// Message that holds signals without a message; frames never carry it.
const ORPHANS: &str = "VECTOR__INDEPENDENT_SIG_MSG";
/// Longest data of one CAN FD frame, bytes.
const FRAME_BYTES_MAX: usize = 64;

pub fn load(file: &[u8]) -> Result<Database, DbcError> {
    let text = decode_text(file);
    let parsed = Dbc::try_from(text.as_ref()).map_err(|error| syntax_error(&text, &error))?;
    let mut loader = Loader {
        lines: Lines::scan(&text),
        parsed: &parsed,
        errors: Vec::new(),
        warnings: Vec::new(),
    };
    let database = loader.database();
    loader.check_references(&database);
    if loader.errors.is_empty() {
        loader.warnings.sort();
        Ok(Database {
            warnings: loader.warnings,
            ..database
        })
    } else {
        loader.errors.sort();
        Err(DbcError {
            issues: loader.errors,
        })
    }
}

struct Loader<'a> {
    lines: Lines,
    parsed: &'a Dbc,
    errors: Vec<Issue>,
    warnings: Vec<Issue>,
}

impl<'a> Loader<'a> {
    fn database(&mut self) -> Database {
        let mut database = Database::default();
        for message in &self.parsed.messages {
            if message.name == ORPHANS {
                continue;
            }
            let definition = self.message(message);
            let index = database.messages.len();
            let key = (definition.extended, definition.id);
            if let Some(earlier) = database.by_id.insert(key, index) {
                let other = &database.messages[earlier].name;
                let text = format!("has the same identifier as {other}");
                self.message_error(&message.name, text);
            }
            if definition.j1939 {
                let group = parameter_group(definition.id);
                database.by_group.entry(group).or_insert(index);
            }
            database.messages.push(definition);
        }
        database
    }

    fn message(&mut self, message: &Message) -> MessageDef {
        let (id, extended) = match message.id {
            MessageId::Standard(id) => (u32::from(id), false),
            MessageId::Extended(id) => (id, true),
        };
        self.check_identifier(message, id, extended);
        let size = usize::try_from(message.size).unwrap_or(usize::MAX);
        if size > FRAME_BYTES_MAX {
            let text = format!("has {size} bytes, more than one frame: only its start is decoded");
            self.message_warning(&message.name, text);
        }
        let format = self.frame_format(message.id);
        let fd = format.ends_with("_FD") || (size > 8 && size <= FRAME_BYTES_MAX);
        let mut signals: Vec<SignalDef> = Vec::with_capacity(message.signals.len());
        for signal in &message.signals {
            if signals.iter().any(|earlier| earlier.name == signal.name) {
                let text = "is there twice in this message".to_owned();
                self.signal_error(&message.name, &signal.name, text);
            }
            signals.extend(self.signal(message, signal, size));
        }
        if self.errors.is_empty() {
            self.select(message, &mut signals);
            self.check_overlap(message, &signals);
        }
        MessageDef {
            name: message.name.clone(),
            id,
            extended,
            fd,
            j1939: extended && format == "J1939PG",
            size,
            comment: self.message_comment(message.id),
            signals,
        }
    }

    fn check_identifier(&mut self, message: &Message, id: u32, extended: bool) {
        // The parser cuts identifiers to their low bits, so what is written is looked at.
        let written = self.lines.messages.get(&message.name);
        let written = written.map_or(u64::from(message.id.raw()), |(_, id)| *id);
        let fits = if extended {
            written == u64::from(id) | 1 << 31
        } else {
            written <= 0x7FF
        };
        if !fits {
            let text = format!(
                "has identifier {written}: 11-bit identifiers end at 2047, and 29-bit ones have \
                 2147483648 added"
            );
            self.message_error(&message.name, text);
        }
    }

    fn signal(&mut self, message: &Message, signal: &Signal, size: usize) -> Option<SignalDef> {
        let order = match signal.byte_order {
            can_dbc::ByteOrder::LittleEndian => ByteOrder::Little,
            can_dbc::ByteOrder::BigEndian => ByteOrder::Big,
        };
        let Some(field) = Field::new(order, signal.start_bit, signal.size) else {
            let text = format!(
                "has start bit {} and {} bits; a signal has 1 to 64 bits",
                signal.start_bit, signal.size
            );
            self.signal_error(&message.name, &signal.name, text);
            return None;
        };
        if field.bytes_needed() > size {
            let text = format!(
                "needs {} bytes, but {} has {size}",
                field.bytes_needed(),
                message.name
            );
            self.signal_error(&message.name, &signal.name, text);
        }
        let (low, high) = (number(signal.min), number(signal.max));
        let numbers = [signal.factor, signal.offset, low, high];
        if signal.factor == 0.0 || numbers.iter().any(|number| !number.is_finite()) {
            let text = format!(
                "has factor {} and offset {}, range {low} to {high}: all must be finite, and the \
                 factor not 0",
                signal.factor, signal.offset
            );
            self.signal_error(&message.name, &signal.name, text);
        }
        Some(SignalDef {
            name: signal.name.clone(),
            unit: signal.unit.clone(),
            comment: self.signal_comment(message.id, &signal.name),
            kind: self.kind(message, signal),
            factor: signal.factor,
            offset: signal.offset,
            range: (low != high).then_some((low, high)),
            selector: None,
            labels: self.labels(message.id, &signal.name),
            field,
        })
    }

    fn kind(&mut self, message: &Message, signal: &Signal) -> RawKind {
        let integer = match signal.value_type {
            ValueType::Signed => RawKind::Signed,
            ValueType::Unsigned => RawKind::Unsigned,
        };
        let extended = self
            .parsed
            .extended_value_type_for_signal(message.id, &signal.name);
        let (kind, width) = match extended {
            None | Some(SignalExtendedValueType::SignedOrUnsignedInteger) => return integer,
            Some(SignalExtendedValueType::IEEEfloat32Bit) => (RawKind::Float, 32),
            Some(SignalExtendedValueType::IEEEdouble64bit) => (RawKind::Double, 64),
        };
        if signal.size != width {
            let text = format!(
                "is floating-point with {width} bits by SIG_VALTYPE_, but has {} bits",
                signal.size
            );
            self.signal_error(&message.name, &signal.name, text);
        }
        kind
    }

    /// Gives the multiplexed signals of a message their selectors.
    fn select(&mut self, message: &Message, signals: &mut [SignalDef]) {
        let extended: Vec<_> = self
            .parsed
            .extended_multiplex
            .iter()
            .filter(|entry| entry.message_id == message.id)
            .collect();
        let switches: Vec<usize> = (0..message.signals.len())
            .filter(|index| {
                message.signals[*index].multiplexer_indicator == MultiplexIndicator::Multiplexor
            })
            .collect();
        for (index, signal) in message.signals.iter().enumerate() {
            let entry = extended
                .iter()
                .find(|entry| entry.signal_name == signal.name);
            let selector = if let Some(entry) = entry {
                let name = &entry.multiplexor_signal_name;
                let Some(multiplexor) = signals.iter().position(|s| s.name == *name) else {
                    let text = format!("is selected by {name}, which the message does not have");
                    self.signal_error(&message.name, &signal.name, text);
                    continue;
                };
                let values = entry.mappings.iter().map(|m| m.min_value..=m.max_value);
                Selector {
                    multiplexor,
                    values: values.collect(),
                }
            } else {
                let (MultiplexIndicator::MultiplexedSignal(value)
                | MultiplexIndicator::MultiplexorAndMultiplexedSignal(value)) =
                    signal.multiplexer_indicator
                else {
                    continue;
                };
                let [multiplexor] = switches[..] else {
                    let text = format!(
                        "is multiplexed, but its message has {} multiplexors marked M; say which \
                         one selects it with SG_MUL_VAL_",
                        switches.len()
                    );
                    self.signal_error(&message.name, &signal.name, text);
                    continue;
                };
                Selector {
                    multiplexor,
                    values: vec![value..=value],
                }
            };
            signals[index].selector = Some(selector);
        }
        self.check_multiplexors(message, signals);
    }

    /// Multiplexors must be integers and must not select each other in a ring.
    fn check_multiplexors(&mut self, message: &Message, signals: &mut [SignalDef]) {
        for index in 0..signals.len() {
            let Some(selector) = &signals[index].selector else {
                continue;
            };
            let multiplexor = &signals[selector.multiplexor];
            if matches!(multiplexor.kind, RawKind::Float | RawKind::Double) {
                let text = "is floating-point and cannot be a multiplexor".to_owned();
                let name = multiplexor.name.clone();
                self.signal_error(&message.name, &name, text);
            }
            let mut at = index;
            for _ in 0..signals.len() {
                let Some(next) = &signals[at].selector else {
                    break;
                };
                at = next.multiplexor;
                if at == index {
                    let text = "selects itself through its multiplexors".to_owned();
                    let name = signals[index].name.clone();
                    self.signal_error(&message.name, &name, text);
                    break;
                }
            }
        }
    }

    /// Warns of bits that two signals claim which can be in the same frame.
    fn check_overlap(&mut self, message: &Message, signals: &[SignalDef]) {
        let masks: Vec<_> = signals
            .iter()
            .map(|signal| signal.field.mask_bytes())
            .collect();
        for (index, signal) in signals.iter().enumerate() {
            for (other, mask) in signals[..index].iter().zip(&masks) {
                let mut shared = masks[index].iter().zip(mask).map(|(a, b)| a & b);
                if let Some(byte) = shared.position(|bits| bits != 0)
                    && !exclude_each_other(signal, other)
                {
                    let text = format!("overlaps {} in byte {byte}", other.name);
                    self.signal_warning(&message.name, &signal.name, text);
                }
            }
        }
    }

    /// Warns of attributes and labels that name what does not exist.
    fn check_references(&mut self, database: &Database) {
        let has = |id: MessageId, name: &str| {
            let (extended, id) = match id {
                MessageId::Standard(id) => (false, u32::from(id)),
                MessageId::Extended(id) => (true, id),
            };
            let index = database.by_id.get(&(extended, id));
            index.is_some_and(|index| database.messages[*index].position(name).is_some())
        };
        let parsed = self.parsed;
        let types = parsed.signal_extended_value_type_list.iter();
        let types = types.map(|entry| ("SIG_VALTYPE_", entry.message_id, &entry.signal_name));
        let selectors = parsed.extended_multiplex.iter();
        let selectors =
            selectors.map(|entry| ("SG_MUL_VAL_", entry.message_id, &entry.signal_name));
        let labels = parsed
            .value_descriptions
            .iter()
            .filter_map(|entry| match entry {
                ValueDescription::Signal {
                    message_id, name, ..
                } => Some(("VAL_", *message_id, name)),
                ValueDescription::EnvironmentVariable { .. } => None,
            });
        for (section, id, name) in types.chain(selectors).chain(labels) {
            let orphan = parsed
                .messages
                .iter()
                .any(|message| message.id == id && message.name == ORPHANS);
            if !orphan && !has(id, name) {
                self.warnings.push(Issue {
                    line: 1,
                    token: name.clone(),
                    text: format!(
                        "is named in {section} {}, which has no such signal",
                        id.raw()
                    ),
                });
            }
        }
    }

    /// The file's `VFrameFormat` of a message, by name; empty if there is none.
    fn frame_format(&self, id: MessageId) -> &'a str {
        const NAME: &str = "VFrameFormat";
        let value = self.parsed.resolved_message_attribute(id, NAME);
        let index = match value {
            Some(AttributeValue::String(text)) => return text,
            Some(AttributeValue::Uint(index)) => usize::try_from(*index).ok(),
            Some(AttributeValue::Int(index)) => usize::try_from(*index).ok(),
            Some(AttributeValue::Double(_)) | None => None,
        };
        let names = self
            .parsed
            .attribute_definitions
            .iter()
            .find_map(|entry| match entry {
                AttributeDefinition::Message(name, AttributeValueType::Enum(names))
                    if name == NAME =>
                {
                    Some(names)
                }
                _ => None,
            });
        index
            .zip(names)
            .and_then(|(index, names)| names.get(index))
            .map_or("", String::as_str)
    }

    fn message_comment(&self, wanted: MessageId) -> String {
        let found = self.parsed.comments.iter().find_map(|entry| match entry {
            Comment::Message { id, comment } if *id == wanted => Some(comment),
            _ => None,
        });
        found.cloned().unwrap_or_default()
    }

    fn signal_comment(&self, id: MessageId, signal: &str) -> String {
        let found = self.parsed.comments.iter().find_map(|entry| match entry {
            Comment::Signal {
                message_id,
                name,
                comment,
            } if *message_id == id && name == signal => Some(comment),
            _ => None,
        });
        found.cloned().unwrap_or_default()
    }

    fn labels(&self, id: MessageId, signal: &str) -> Vec<(i64, String)> {
        let found = self
            .parsed
            .value_descriptions
            .iter()
            .find_map(|entry| match entry {
                ValueDescription::Signal {
                    message_id,
                    name,
                    value_descriptions,
                } if *message_id == id && name == signal => Some(value_descriptions),
                _ => None,
            });
        let entries = found.map_or(&[][..], Vec::as_slice).iter();
        entries
            .map(|entry| (entry.id, entry.description.clone()))
            .collect()
    }

    fn message_error(&mut self, message: &str, text: String) {
        let issue = self.message_issue(message, text);
        self.errors.push(issue);
    }

    fn message_warning(&mut self, message: &str, text: String) {
        let issue = self.message_issue(message, text);
        self.warnings.push(issue);
    }

    fn signal_error(&mut self, message: &str, signal: &str, text: String) {
        let issue = self.signal_issue(message, signal, text);
        self.errors.push(issue);
    }

    fn signal_warning(&mut self, message: &str, signal: &str, text: String) {
        let issue = self.signal_issue(message, signal, text);
        self.warnings.push(issue);
    }

    fn message_issue(&self, message: &str, text: String) -> Issue {
        Issue {
            line: self.lines.messages.get(message).map_or(1, |place| place.0),
            token: message.to_owned(),
            text,
        }
    }

    fn signal_issue(&self, message: &str, signal: &str, text: String) -> Issue {
        let key = (message.to_owned(), signal.to_owned());
        Issue {
            line: self.lines.signals.get(&key).copied().unwrap_or(1),
            token: signal.to_owned(),
            text,
        }
    }
}

/// Whether one multiplexor never selects both signals at once.
fn exclude_each_other(one: &SignalDef, other: &SignalDef) -> bool {
    let (Some(one), Some(other)) = (&one.selector, &other.selector) else {
        return false;
    };
    one.multiplexor != other.multiplexor
        || !one.values.iter().any(|a| {
            let overlaps =
                |b: &std::ops::RangeInclusive<u64>| a.start() <= b.end() && b.start() <= a.end();
            other.values.iter().any(overlaps)
        })
}

fn number(value: NumericValue) -> f64 {
    match value {
        NumericValue::Uint(value) => value as f64,
        NumericValue::Int(value) => value as f64,
        NumericValue::Double(value) => value,
    }
}
