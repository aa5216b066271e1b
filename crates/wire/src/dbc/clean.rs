//! What the parser of DBC files does not take, though other tools write it: sections and comments that
//! it does not know, and letters outside of ASCII in names; and statements with errors.

use std::ops::Range;

use can_dbc::Dbc;
use sample::boundary::guarded;

use super::text::syntax_error;
use super::{DbcError, Issue, LeftOut};

/// Keywords of the statements that the parser knows.
const KNOWN: [&str; 23] = [
    "NS_",
    "BS_",
    "BU_",
    "BO_",
    "SG_",
    "CM_",
    "BA_",
    "EV_",
    "VAL_",
    "VAL_TABLE_",
    "BA_DEF_",
    "BA_DEF_DEF_",
    "BA_DEF_REL_",
    "BA_DEF_DEF_REL_",
    "BA_REL_",
    "BO_TX_BU_",
    "SIG_GROUP_",
    "SIG_VALTYPE_",
    "SG_MUL_VAL_",
    "ENVVAR_DATA_",
    "BU_SG_REL_",
    "BU_BO_REL_",
    "BU_EV_REL_",
];

/// Longest unknown statement that is skipped, bytes.
const STATEMENT_MAX: usize = 1 << 12;

/// A text with the same lines that the parser takes.
pub struct Clean {
    pub text: String,
    /// Whether names have letters outside of ASCII, which are written as `_u00e4_`.
    has_letters: bool,
}

impl Clean {
    /// The name in the file of a name in the text.
    pub fn name(&self, name: &str) -> String {
        if self.has_letters {
            restored(name)
        } else {
            name.to_owned()
        }
    }
}

/// Replaces what the parser does not take, if there is any, outside of quoted texts.
pub fn clean(text: &str) -> Clean {
    let mut out = String::with_capacity(text.len());
    let mut has_letters = false;
    let mut quoted = false;
    let mut rest = text;
    while let Some(letter) = rest.chars().next() {
        let at_start = out.is_empty() || out.ends_with('\n');
        let length = match letter {
            '(' if !quoted && rest.starts_with("(*") => {
                let end = rest.find("*)").map_or(rest.len(), |end| end + 2);
                blank(&mut out, &rest[..end]);
                end
            }
            'A'..='Z' if !quoted && at_start => {
                let length = unknown_statement(rest);
                blank(&mut out, &rest[..length]);
                length
            }
            _ => 0,
        };
        if length > 0 {
            rest = &rest[length..];
            continue;
        }
        quoted ^= letter == '"';
        if quoted || letter.is_ascii() {
            out.push(letter);
        } else if letter.is_alphanumeric() {
            has_letters = true;
            out.push_str(&format!("_u{:04x}_", u32::from(letter)));
        } else {
            out.push(' ');
        }
        rest = &rest[letter.len_utf8()..];
    }
    Clean {
        text: out,
        has_letters,
    }
}

fn blank(out: &mut String, text: &str) {
    out.extend(
        text.chars()
            .map(|letter| if letter == '\n' { '\n' } else { ' ' }),
    );
}

/// Length of the statement at the start of `text` if its keyword is unknown, up to its semicolon;
/// otherwise 0.
fn unknown_statement(text: &str) -> usize {
    let word = keyword(text);
    if word.is_empty() || KNOWN.contains(&word) {
        return 0;
    }
    let mut quoted = false;
    let end = text.bytes().take(STATEMENT_MAX).position(|letter| {
        quoted ^= letter == b'"';
        letter == b';' && !quoted
    });
    end.map_or(0, |end| end + 1)
}

/// The keyword at the start of a line: capitals and underscores, the last of them an
/// underscore, or `FILTER`.
fn keyword(line: &str) -> &str {
    let end = line
        .find(|letter: char| !(letter.is_ascii_uppercase() || letter == '_'))
        .unwrap_or(line.len());
    let word = &line[..end];
    let ends = !line[end..].starts_with(|letter: char| letter.is_ascii_alphanumeric());
    if (word.ends_with('_') || word == "FILTER") && ends {
        word
    } else {
        ""
    }
}

fn restored(name: &str) -> String {
    let mut out = String::with_capacity(name.len());
    let mut rest = name;
    while let Some(at) = rest.find("_u") {
        let (before, from) = rest.split_at(at);
        out.push_str(before);
        let code = from[2..].find('_').map(|end| &from[2..2 + end]);
        let letter = code
            .filter(|code| code.len() >= 4)
            .and_then(|code| u32::from_str_radix(code, 16).ok())
            .and_then(char::from_u32);
        let length = match (letter, code) {
            (Some(letter), Some(code)) => {
                out.push(letter);
                code.len() + 3
            }
            _ => {
                out.push_str("_u");
                2
            }
        };
        rest = &from[length..];
    }
    out.push_str(rest);
    out
}

/// Parses a text. Statements with errors are left out, a message with all of its signals.
pub fn parse(text: &Clean) -> Result<(Dbc, Vec<LeftOut>), DbcError> {
    let error = match parse_all(&text.text) {
        Ok(dbc) => return Ok((dbc, Vec::new())),
        Err(error) => error,
    };
    let mut usable = text.text.clone().into_bytes();
    let mut left_out = Vec::new();
    for statement in statements(&text.text) {
        let own = &text.text[statement.range.clone()];
        let Err(problem) = parse_all(own) else {
            continue;
        };
        for byte in &mut usable[statement.range.clone()] {
            if !matches!(byte, b'\n' | b'\r') {
                *byte = b' ';
            }
        }
        let issues = problem.issues.into_iter().map(|issue| Issue {
            line: issue.line + statement.line,
            ..issue
        });
        let message = statement.message.map(|name| text.name(name));
        left_out.extend(issues.map(|issue| LeftOut {
            issue,
            message: message.clone(),
        }));
    }
    // All bytes of a character were replaced, or none.
    let usable = String::from_utf8_lossy(&usable);
    match parse_all(&usable) {
        Ok(dbc) if !left_out.is_empty() => Ok((dbc, left_out)),
        _ => Err(error),
    }
}

fn parse_all(text: &str) -> Result<Dbc, DbcError> {
    match guarded(|| Dbc::try_from(text)) {
        Ok(Ok(dbc)) => Ok(dbc),
        Ok(Err(error)) => Err(syntax_error(text, &error)),
        Err(panic) => Err(DbcError {
            issues: vec![Issue {
                line: 1,
                token: "file".to_owned(),
                text: format!("cannot be read: the parser failed: {panic}"),
            }],
        }),
    }
}

/// A statement of a file.
struct Statement<'t> {
    range: Range<usize>,
    /// Lines before it.
    line: usize,
    /// Name of a message.
    message: Option<&'t str>,
}

/// The statements of a text, each from the line of its keyword to the line before the next one. Signals
/// belong to their message.
fn statements(text: &str) -> Vec<Statement<'_>> {
    let mut statements: Vec<Statement<'_>> = Vec::new();
    let mut at = 0;
    for (number, line) in text.split_inclusive('\n').enumerate() {
        let first = line.split_whitespace().next().unwrap_or_default();
        let word = keyword(first);
        let begins = !word.is_empty() && line.starts_with(word) && word != "SG_"
            || line.starts_with("VERSION")
            || word == "BO_" && line.trim_start().starts_with("BO_ ");
        if begins || statements.is_empty() {
            let mut words = line.split([' ', '\t', ':']).filter(|word| !word.is_empty());
            let name = || words.nth(2).map(str::trim);
            statements.push(Statement {
                range: at..at,
                line: number,
                message: (word == "BO_").then(name).flatten(),
            });
        }
        at += line.len();
        if let Some(last) = statements.last_mut() {
            last.range.end = at;
        }
    }
    statements
}
