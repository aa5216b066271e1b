//! The text of a DBC file: its encoding, and where things stand in it.

use std::borrow::Cow;
use std::collections::BTreeMap;

use pest::error::LineColLocation;

use super::{DbcError, Issue, SIGNALS_MAX};

pub fn decode_text(file: &[u8]) -> Cow<'_, str> {
    let file = file.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(file);
    match std::str::from_utf8(file) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => can_dbc::decode_cp1252(file).unwrap_or_else(|| String::from_utf8_lossy(file)),
    }
}

pub fn syntax_error(text: &str, error: &can_dbc::DbcError) -> DbcError {
    let issue = match error {
        can_dbc::DbcError::Pest(error) => {
            let (line, column) = match error.line_col {
                LineColLocation::Pos(at) => at,
                LineColLocation::Span(from, _) => from,
            };
            Issue {
                line,
                token: token_at(text, line, column),
                text: format!("cannot be read (column {column})"),
            }
        }
        other => Issue {
            line: 1,
            token: String::new(),
            text: format!("cannot be read: {other}"),
        },
    };
    DbcError {
        issues: vec![issue],
    }
}

/// The word at a place in the text, for messages.
fn token_at(text: &str, line: usize, column: usize) -> String {
    let line = text.lines().nth(line.saturating_sub(1)).unwrap_or_default();
    let rest: String = line.chars().skip(column.saturating_sub(1)).collect();
    let word = rest.split_whitespace().next().unwrap_or("end of line");
    word.chars().take(40).collect()
}

/// Where messages and signals stand in the text.
pub struct Lines {
    /// By name: line, and identifier as it is written.
    pub messages: BTreeMap<String, (usize, u64)>,
    /// By message and signal name.
    pub signals: BTreeMap<(String, String), usize>,
    /// The first message with more than [`SIGNALS_MAX`] signals, and the line of the first one that
    /// is too many.
    pub crowded: Option<(String, usize)>,
}

impl Lines {
    pub fn scan(text: &str) -> Self {
        let mut lines = Self {
            messages: BTreeMap::new(),
            signals: BTreeMap::new(),
            crowded: None,
        };
        let mut message = String::new();
        let mut count = 0;
        for (index, line) in text.lines().enumerate() {
            let mut words = line.split([' ', '\t', ':']).filter(|word| !word.is_empty());
            match words.next() {
                Some("BO_") => {
                    let id = words.next().and_then(|id| id.parse().ok());
                    if let (Some(id), Some(name)) = (id, words.next()) {
                        name.clone_into(&mut message);
                        count = 0;
                        let place = (index + 1, id);
                        lines.messages.entry(message.clone()).or_insert(place);
                    }
                }
                Some("SG_") => {
                    count += 1;
                    if count > SIGNALS_MAX {
                        lines.crowded = Some((message, index + 1));
                        return lines;
                    }
                    if let Some(name) = words.next() {
                        let key = (message.clone(), name.to_owned());
                        lines.signals.entry(key).or_insert(index + 1);
                    }
                }
                _ => {}
            }
        }
        lines
    }
}
