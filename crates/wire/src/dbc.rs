//! CAN databases: any DBC file, read at run time, decodes frames into named physical values and
//! encodes them again.
//!
//! A [`Database`] is checked as a whole when it is read: what cannot work is an error with line and
//! token, all of them at once, and what is odd but usable is a warning. [`Database::parse_usable`]
//! leaves out the messages with errors and names them. Decoding cannot fail and does not allocate: a
//! signal that the frame is too short for, or whose multiplexor selects another, is absent.

mod bits;
mod clean;
mod index;
mod load;
mod message;
mod select;
#[cfg(test)]
mod tests;
mod text;

use std::collections::BTreeMap;
use std::fmt;

use sample::text::printable;
use sample::{CanFrame, SignalFrame};

pub use bits::{ByteOrder, RawKind};
pub use load::{BYTES_MAX, SIGNALS_MAX};
pub use message::{EncodeError, MessageDef, Selector, SignalDef, SignalValue};

/// A DBC file, ready to decode frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Database {
    messages: Vec<MessageDef>,
    by_id: BTreeMap<(bool, u32), usize>,
    by_group: BTreeMap<u32, usize>,
    warnings: Vec<Issue>,
    left_out: Vec<LeftOut>,
}

/// A part of a DBC file that [`Database::parse_usable`] left out.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LeftOut {
    /// What is wrong with it.
    pub issue: Issue,
    /// The message that is left out; none for another part of the file.
    pub message: Option<String>,
}

/// Something wrong or odd in a DBC file.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Issue {
    /// Line, from 1.
    pub line: usize,
    /// The word that it is about.
    pub token: String,
    /// What is wrong with it, and what would be right.
    pub text: String,
}

impl fmt::Display for Issue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (token, text) = (printable(&self.token), printable(&self.text));
        write!(f, "line {}: `{token}` {text}", self.line)
    }
}

/// A DBC file that cannot be used: everything that is wrong with it, in order of lines.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", .issues.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
pub struct DbcError {
    /// What is wrong.
    pub issues: Vec<Issue>,
}

impl Database {
    /// Reads a DBC file. Text that is not UTF-8 is taken as Windows-1252, which most tools write.
    ///
    /// # Errors
    /// Everything that makes the file unusable, by line and token, at most 100 issues. A file of more
    /// than [`BYTES_MAX`] bytes is refused, and a message of more than [`SIGNALS_MAX`] signals.
    pub fn parse(file: &[u8]) -> Result<Self, DbcError> {
        let database = load::load(file)?;
        if database.left_out.is_empty() {
            return Ok(database);
        }
        let issues = database.left_out.into_iter().map(|part| part.issue);
        Err(DbcError {
            issues: load::limited(issues.collect()),
        })
    }

    /// Reads the usable parts of a DBC file. A message with an error is left out as a whole, so that
    /// no value of it is wrong; [`Database::left_out`] has it.
    ///
    /// # Errors
    /// A file that is too long, or that has no part that can be read.
    pub fn parse_usable(file: &[u8]) -> Result<Self, DbcError> {
        load::load(file)
    }

    /// What [`Database::parse_usable`] left out, in order of lines.
    #[must_use]
    pub fn left_out(&self) -> &[LeftOut] {
        &self.left_out
    }

    /// What is odd in the file, though it can be used.
    #[must_use]
    pub fn warnings(&self) -> &[Issue] {
        &self.warnings
    }

    /// All messages, in the file's order.
    #[must_use]
    pub fn messages(&self) -> &[MessageDef] {
        &self.messages
    }

    /// The message with this name, or with this name in its `BO_` line.
    #[must_use]
    pub fn by_name(&self, name: &str) -> Option<&MessageDef> {
        let own = self.messages.iter().find(|message| message.name == name);
        own.or_else(|| self.messages.iter().find(|m| m.short_name == name))
    }

    /// The message that frames with this identifier carry: the one with the very identifier, else
    /// the J1939 message of the same parameter group, whatever its priority and addresses.
    #[must_use]
    pub fn by_id(&self, id: u32, extended: bool) -> Option<&MessageDef> {
        self.position(id, extended)
            .map(|index| &self.messages[index])
    }

    /// Position in [`Database::messages`] of what [`Database::by_id`] gives.
    #[must_use]
    pub fn position(&self, id: u32, extended: bool) -> Option<usize> {
        let exact = self.by_id.get(&(extended, id));
        let group = || self.by_group.get(&parameter_group(id));
        exact.or_else(|| extended.then(group).flatten()).copied()
    }

    /// The message that this frame carries; none for remote and error frames.
    #[must_use]
    pub fn message_of(&self, frame: &CanFrame) -> Option<&MessageDef> {
        if frame.flags.error || frame.flags.remote {
            return None;
        }
        self.by_id(frame.id, frame.flags.extended)
    }

    /// Decodes a frame into names, values and units of its own; `None` if no message fits. Where
    /// frames are many, use [`Database::message_of`] and [`MessageDef::decode`].
    #[must_use]
    pub fn decode(&self, frame: &CanFrame) -> Option<SignalFrame> {
        let message = self.message_of(frame)?;
        let signals = message
            .decode(frame.bytes())
            .map(|value| sample::Signal {
                name: value.signal.name.as_str().into(),
                value: value.physical,
                unit: value.signal.unit.as_str().into(),
            })
            .collect();
        Some(SignalFrame {
            message: message.name.as_str().into(),
            id: frame.id,
            signals,
        })
    }
}

/// Parameter group number of a J1939 identifier (SAE J1939-21, 5.2): the two page bits, the PDU
/// format and, from format 240 on, the PDU-specific byte. Below 240 that byte is an address.
#[must_use]
pub const fn parameter_group(id: u32) -> u32 {
    let group = id >> 8 & 0x3_FFFF;
    if group & 0xFF00 < 0xF000 {
        group & 0x3_FF00
    } else {
        group
    }
}

/// Source address of a J1939 identifier (SAE J1939-21, 5.2): its low byte.
#[must_use]
pub const fn source_address(id: u32) -> u8 {
    id as u8
}
