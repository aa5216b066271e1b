//! From text to a [`Database`] that cannot be wrong.

use std::collections::{BTreeMap, HashSet};

use can_dbc::{
    Dbc, Message, NumericValue, Signal, SignalExtendedValueType, ValueDescription, ValueType,
};

use super::bits::Field;
use super::clean::{self, Clean};
use super::index::{Index, MessageKey, key};
use super::text::{Lines, decode_text};
use super::{
    ByteOrder, Database, DbcError, Issue, LeftOut, MessageDef, RawKind, SignalDef, parameter_group,
};

/// Message that holds signals without a message; frames never carry it.
const ORPHANS: &str = "VECTOR__INDEPENDENT_SIG_MSG";
/// `VFrameFormat` of J1939 messages, which may have several frames.
const J1939: &str = "J1939PG";
/// Longest data of one CAN FD frame, bytes.
const FRAME_BYTES_MAX: usize = 64;

/// Longest DBC file, bytes.
pub const BYTES_MAX: usize = 16 << 20;
/// Most signals of one message. Every frame is looked at for each of them.
pub const SIGNALS_MAX: usize = 4_096;
/// Longest message, bytes.
const MESSAGE_BYTES_MAX: usize = 65_535;
/// Most entries (messages, signals, comments, labels and all other sections) of one file.
const ENTRIES_MAX: usize = 400_000;
/// Most errors, and most warnings, that are reported one by one.
const ISSUES_MAX: usize = 100;
/// Most pairs of bits of one message that are compared in the search for overlaps.
const COMPARED_MAX: usize = 20_000_000;

pub fn load(file: &[u8]) -> Result<Database, DbcError> {
    if file.len() > BYTES_MAX {
        let text = format!("has {} bytes; a DBC file may have {BYTES_MAX}", file.len());
        return Err(whole_file(text));
    }
    let text = clean::clean(&decode_text(file));
    let lines = Lines::scan(&text.text);
    check_size(&text.text, &lines)?;
    let (parsed, left_out) = clean::parse(&text)?;
    let mut loader = Loader {
        text: &text,
        lines,
        parsed: &parsed,
        index: Index::new(&parsed),
        errors: Vec::new(),
        left_out,
        warnings: Vec::new(),
    };
    let mut database = loader.database();
    loader.check_references(&database);
    loader.rename(&mut database);
    let Loader {
        warnings,
        mut left_out,
        ..
    } = loader;
    left_out.sort();
    // Without a message, the file is of another kind.
    let has_message = !parsed.messages.is_empty() || left_out.iter().any(|p| p.message.is_some());
    if !has_message && !left_out.is_empty() {
        let issues = left_out.into_iter().map(|part| part.issue);
        return Err(DbcError {
            issues: limited(issues.collect()),
        });
    }
    Ok(Database {
        warnings: limited(warnings),
        left_out,
        ..database
    })
}

/// An error of no single line.
fn whole_file(text: String) -> DbcError {
    DbcError {
        issues: vec![Issue {
            line: 1,
            token: "file".to_owned(),
            text,
        }],
    }
}

/// Refuses what would cost the parser much memory, before it is called.
fn check_size(text: &str, lines: &Lines) -> Result<(), DbcError> {
    if let Some((message, line)) = &lines.crowded {
        return Err(DbcError {
            issues: vec![Issue {
                line: *line,
                token: message.clone(),
                text: format!("has more than {SIGNALS_MAX} signals; split the message"),
            }],
        });
    }
    let count = |signs: &[u8]| text.bytes().filter(|byte| signs.contains(byte)).count();
    // What separates entries, by how many of them a usual entry has.
    let entries = [
        count(b"\n"),
        count(b";"),
        count(b"\"") / 2,
        count(b",") / 2,
        count(b" \t") / 16,
    ];
    let entries = entries.into_iter().max().unwrap_or_default();
    if entries > ENTRIES_MAX {
        let text = format!("has about {entries} entries; a DBC file may have {ENTRIES_MAX}");
        return Err(whole_file(text));
    }
    Ok(())
}

/// The first issues in order of lines, and how many more there are.
pub(super) fn limited(mut issues: Vec<Issue>) -> Vec<Issue> {
    issues.sort();
    let more = issues.len().saturating_sub(ISSUES_MAX);
    if more > 0 {
        issues.truncate(ISSUES_MAX);
        issues.push(Issue {
            line: issues.last().map_or(1, |last| last.line),
            token: "…".to_owned(),
            text: format!("and {more} more issues"),
        });
    }
    issues
}

pub(super) struct Loader<'a> {
    text: &'a Clean,
    lines: Lines,
    parsed: &'a Dbc,
    pub(super) index: Index<'a>,
    /// Errors of the present message.
    errors: Vec<Issue>,
    left_out: Vec<LeftOut>,
    warnings: Vec<Issue>,
}

impl<'a> Loader<'a> {
    fn database(&mut self) -> Database {
        let mut database = Database::default();
        let mut names = BTreeMap::new();
        for message in &self.parsed.messages {
            if message.name == ORPHANS {
                continue;
            }
            let definition = self.message(message);
            let key = (definition.extended, definition.id);
            if let Some(other) = names.insert(key, message.name.as_str()) {
                let text = format!("has the same identifier as {}", self.text.name(other));
                self.message_error(&message.name, text);
            }
            if !self.errors.is_empty() {
                let name = self.text.name(&message.name);
                let errors = std::mem::take(&mut self.errors);
                self.left_out
                    .extend(errors.into_iter().map(|issue| LeftOut {
                        issue,
                        message: Some(name.clone()),
                    }));
                continue;
            }
            let index = database.messages.len();
            database.by_id.insert(key, index);
            if definition.j1939 {
                let group = parameter_group(definition.id);
                database.by_group.entry(group).or_insert(index);
            }
            database.messages.push(definition);
        }
        database
    }

    /// Gives messages and signals their long names, unless two would have the same name, and their
    /// letters outside of ASCII.
    fn rename(&self, database: &mut Database) {
        for message in &mut database.messages {
            let place = (message.extended, message.id);
            let written = std::mem::take(&mut message.short_name);
            let long = self.index.long_messages.get(&place).copied();
            message.short_name = self.text.name(&written);
            message.name = long_name(long, &message.short_name);
            for signal in &mut message.signals {
                let written = std::mem::take(&mut signal.short_name);
                let long = self.index.long_signals.get(&(place, &*written)).copied();
                signal.short_name = self.text.name(&written);
                signal.name = long_name(long, &signal.short_name);
            }
            let names: HashSet<&str> = message.signals.iter().map(|s| &*s.name).collect();
            if names.len() < message.signals.len() {
                for signal in &mut message.signals {
                    signal.name.clone_from(&signal.short_name);
                }
            }
        }
    }

    fn message(&mut self, message: &Message) -> MessageDef {
        let (extended, id) = key(message.id);
        self.check_identifier(message, id, extended);
        let size = usize::try_from(message.size).unwrap_or(usize::MAX);
        if size > MESSAGE_BYTES_MAX {
            let text = format!("has {size} bytes; a message may have {MESSAGE_BYTES_MAX}");
            self.message_error(&message.name, text);
        } else if size > FRAME_BYTES_MAX && self.index.frame_format((extended, id)) != J1939 {
            let text = format!("has {size} bytes, more than one frame: only its start is decoded");
            self.message_warning(&message.name, text);
        }
        let format = self.index.frame_format((extended, id));
        let fd = format.ends_with("_FD") || (size > 8 && size <= FRAME_BYTES_MAX);
        let mut signals: Vec<SignalDef> = Vec::with_capacity(message.signals.len());
        let mut names = HashSet::with_capacity(message.signals.len());
        for signal in &message.signals {
            if !names.insert(signal.name.as_str()) {
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
            short_name: message.name.clone(),
            id,
            extended,
            fd,
            j1939: extended && format == J1939,
            size,
            comment: self
                .index
                .message_comments
                .get(&(extended, id))
                .copied()
                .unwrap_or_default()
                .to_owned(),
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
        let place = (key(message.id), signal.name.as_str());
        let labels = self.index.labels.get(&place).copied().unwrap_or_default();
        let labels = labels
            .iter()
            .map(|entry| (entry.id, entry.description.clone()))
            .collect();
        let comment = self
            .index
            .signal_comments
            .get(&place)
            .copied()
            .unwrap_or_default();
        Some(SignalDef {
            name: signal.name.clone(),
            short_name: signal.name.clone(),
            unit: signal.unit.clone(),
            comment: comment.to_owned(),
            kind: self.kind(message, signal),
            factor: signal.factor,
            offset: signal.offset,
            range: (low != high).then_some((low, high)),
            selector: None,
            labels,
            field,
        })
    }

    fn kind(&mut self, message: &Message, signal: &Signal) -> RawKind {
        let integer = match signal.value_type {
            ValueType::Signed => RawKind::Signed,
            ValueType::Unsigned => RawKind::Unsigned,
        };
        let place = (key(message.id), signal.name.as_str());
        let extended = self.index.types.get(&place).copied();
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

    /// Warns of bits that two signals claim which can be in the same frame.
    fn check_overlap(&mut self, message: &Message, signals: &[SignalDef]) {
        // By each bit of a frame: the signals that have it, in the file's order.
        let mut owners: Vec<Vec<usize>> = vec![Vec::new(); 8 * FRAME_BYTES_MAX];
        let mut compared = 0;
        for (index, signal) in signals.iter().enumerate() {
            let mut shared: Vec<(usize, usize)> = Vec::new();
            for (byte, mask) in signal.field.mask_bytes().into_iter().enumerate() {
                for bit in (0..8).filter(|bit| mask >> bit & 1 != 0) {
                    let Some(others) = owners.get_mut(8 * byte + bit) else {
                        continue;
                    };
                    compared += others.len();
                    shared.extend(others.iter().map(|other| (*other, byte)));
                    others.push(index);
                }
            }
            shared.sort_unstable();
            shared.dedup_by_key(|(other, _)| *other);
            for (other, byte) in shared {
                if !exclude_each_other(signal, &signals[other]) {
                    let text = format!("overlaps {} in byte {byte}", signals[other].name);
                    self.signal_warning(&message.name, &signal.name, text);
                }
            }
            if compared > COMPARED_MAX || self.warnings.len() > 10 * ISSUES_MAX {
                return;
            }
        }
    }

    /// Warns of attributes and labels that name what does not exist.
    fn check_references(&mut self, database: &Database) {
        let known: HashSet<(MessageKey, &str)> = database
            .messages
            .iter()
            .flat_map(|message| {
                let own = (message.extended, message.id);
                message
                    .signals
                    .iter()
                    .map(move |signal| (own, signal.name.as_str()))
            })
            .collect();
        let orphans: HashSet<MessageKey> = self
            .parsed
            .messages
            .iter()
            .filter(|message| message.name == ORPHANS)
            .map(|message| key(message.id))
            .collect();
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
            let place = (key(id), name.as_str());
            if !orphans.contains(&place.0) && !known.contains(&place) {
                self.warnings.push(Issue {
                    line: 1,
                    token: self.text.name(name),
                    text: format!(
                        "is named in {section} {}, which has no such signal",
                        id.raw()
                    ),
                });
            }
        }
    }

    fn message_error(&mut self, message: &str, text: String) {
        let issue = self.message_issue(message, text);
        self.errors.push(issue);
    }

    fn message_warning(&mut self, message: &str, text: String) {
        let issue = self.message_issue(message, text);
        self.warnings.push(issue);
    }

    pub(super) fn signal_error(&mut self, message: &str, signal: &str, text: String) {
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
            token: self.text.name(message),
            text,
        }
    }

    fn signal_issue(&self, message: &str, signal: &str, text: String) -> Issue {
        let key = (message.to_owned(), signal.to_owned());
        Issue {
            line: self.lines.signals.get(&key).copied().unwrap_or(1),
            token: self.text.name(signal),
            text,
        }
    }
}

/// Whether one multiplexor never selects both signals at once.
fn exclude_each_other(one: &SignalDef, other: &SignalDef) -> bool {
    let (Some(one), Some(other)) = (&one.selector, &other.selector) else {
        return false;
    };
    if one.multiplexor != other.multiplexor {
        return true;
    }
    // Both lists are in order and without overlaps in themselves.
    let (mut a, mut b) = (one.values.iter().peekable(), other.values.iter().peekable());
    while let (Some(left), Some(right)) = (a.peek(), b.peek()) {
        if left.end() < right.start() {
            a.next();
        } else if right.end() < left.start() {
            b.next();
        } else {
            return false;
        }
    }
    true
}

/// The long name if the file has one that is no shorter name with blanks or nothing in it.
fn long_name(long: Option<&str>, short: &str) -> String {
    let is_name = |name: &&str| {
        let letters = |c: char| c.is_alphanumeric() || c == '_';
        !name.is_empty() && name.chars().all(letters)
    };
    long.filter(is_name).unwrap_or(short).to_owned()
}

fn number(value: NumericValue) -> f64 {
    match value {
        NumericValue::Uint(value) => value as f64,
        NumericValue::Int(value) => value as f64,
        NumericValue::Double(value) => value,
    }
}
