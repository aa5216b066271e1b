//! Reads a TOML table field by field and collects every problem instead of stopping at the first.

use std::fmt;
use std::ops::Range;

use sample::boundary::guarded;
use sample::text::printable;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A problem of a configuration file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Name of the file.
    pub file: String,
    /// Line, from 1; 0 for a problem of the whole file.
    pub line: usize,
    /// Column, from 1; 0 if only the line is known.
    pub column: usize,
    /// Dotted name of the field, such as `source.imu.baud`; empty for a problem of the whole file.
    pub field: String,
    /// Description with the value.
    pub message: String,
    /// What to do about it.
    pub help: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&printable(&self.file))?;
        if self.line > 0 {
            write!(f, ":{}", self.line)?;
        }
        if self.column > 0 {
            write!(f, ":{}", self.column)?;
        }
        f.write_str(": ")?;
        if !self.field.is_empty() {
            write!(f, "{}: ", printable(&self.field))?;
        }
        f.write_str(&printable(&self.message))?;
        if !self.help.is_empty() {
            write!(f, "\n    help: {}", printable(&self.help))?;
        }
        Ok(())
    }
}

/// All problems of a configuration.
#[derive(Debug, thiserror::Error)]
pub struct Problems(pub Vec<Problem>);

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for problem in &self.0 {
            writeln!(f, "{problem}")?;
        }
        match self.0.len() {
            1 => write!(f, "1 error in the configuration"),
            count => write!(f, "{count} errors in the configuration"),
        }
    }
}

/// Largest TOML text that is read, bytes.
pub const TOML_MAX: usize = 1 << 20;
/// Most problems of a file that are reported.
const PROBLEMS_MAX: usize = 100;

/// Collects the problems of a file.
pub struct Gatherer<'t> {
    file: &'t str,
    text: &'t str,
    problems: Vec<Problem>,
    /// Problems beyond [`PROBLEMS_MAX`].
    more: usize,
}

impl<'t> Gatherer<'t> {
    /// Collector for the file with the name `file` and the content `text`.
    pub fn new(file: &'t str, text: &'t str) -> Self {
        Self {
            file,
            text,
            problems: Vec::new(),
            more: 0,
        }
    }

    /// Adds a problem at `span` of the text.
    pub fn add(
        &mut self,
        span: &Range<usize>,
        field: &str,
        message: impl Into<String>,
        help: impl Into<String>,
    ) {
        if self.is_full() {
            self.more += 1;
            return;
        }
        let (line, column) = line_and_column(self.text, span.start);
        self.problems.push(Problem {
            file: self.file.to_owned(),
            line,
            column,
            field: field.to_owned(),
            message: message.into(),
            help: help.into(),
        });
    }

    /// Adds a problem that the TOML parser found.
    pub fn add_syntax(&mut self, error: &toml::de::Error) {
        let span = error.span().unwrap_or(0..0);
        self.add(&span, "", error.message(), "correct the TOML syntax");
    }

    /// Adds problems of another file.
    pub fn add_foreign(&mut self, problems: impl IntoIterator<Item = Problem>) {
        for problem in problems {
            if self.is_full() {
                self.more += 1;
            } else {
                self.problems.push(problem);
            }
        }
    }

    fn is_full(&self) -> bool {
        self.problems.len() >= PROBLEMS_MAX
    }

    /// Whether there is no problem so far.
    pub fn is_empty(&self) -> bool {
        self.problems.is_empty()
    }

    /// Problems in the order of the text.
    pub fn into_problems(mut self) -> Vec<Problem> {
        let own = self.file;
        self.problems.sort_by(|a, b| {
            let place = |p: &Problem| (p.file != own, p.file.clone(), p.line, p.column);
            place(a).cmp(&place(b))
        });
        if self.more > 0 {
            self.problems.push(Problem {
                file: own.to_owned(),
                line: 0,
                column: 0,
                field: String::new(),
                message: format!("{} more errors are not shown", self.more),
                help: "correct the errors above and check again".to_owned(),
            });
        }
        self.problems
    }
}

/// Parses a TOML text. Syntax errors, a text above [`TOML_MAX`] and a panic of the parser are problems.
pub fn parse<'t>(text: &'t str, gather: &mut Gatherer<'_>) -> Option<Spanned<DeTable<'t>>> {
    if text.len() > TOML_MAX {
        let message = format!(
            "the file has {} bytes, but the limit is {TOML_MAX}",
            text.len()
        );
        gather.add(&(0..0), "", message, "check the name of the file");
        return None;
    }
    match guarded(|| DeTable::parse_recoverable(text)) {
        Ok((table, syntax)) => {
            for error in &syntax {
                gather.add_syntax(error);
            }
            syntax.is_empty().then_some(table)
        }
        Err(panic) => {
            let message = format!("the TOML parser failed: {panic}");
            gather.add(&(0..0), "", message, "correct the TOML syntax");
            None
        }
    }
}

/// Line and column, both from 1, of a byte position.
pub fn line_and_column(text: &str, position: usize) -> (usize, usize) {
    let before = text.get(..position.min(text.len())).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
    (line, column)
}

/// Type of a field's value.
pub trait FromValue: Sized {
    /// Name of the type in messages, such as `a string`.
    const EXPECTED: &'static str;

    /// The value, if it is of this type.
    fn from_value(value: &DeValue<'_>) -> Option<Self>;
}

impl FromValue for String {
    const EXPECTED: &'static str = "a string";

    fn from_value(value: &DeValue<'_>) -> Option<Self> {
        value.as_str().map(str::to_owned)
    }
}

impl FromValue for bool {
    const EXPECTED: &'static str = "true or false";

    fn from_value(value: &DeValue<'_>) -> Option<Self> {
        match value {
            DeValue::Boolean(value) => Some(*value),
            _ => None,
        }
    }
}

impl FromValue for f64 {
    const EXPECTED: &'static str = "a number";

    fn from_value(value: &DeValue<'_>) -> Option<Self> {
        let number = match value {
            DeValue::Float(value) => value.as_str().parse().ok(),
            DeValue::Integer(value) if value.radix() == 10 => value.as_str().parse().ok(),
            _ => None,
        };
        number.filter(|number: &f64| number.is_finite())
    }
}

impl FromValue for u64 {
    const EXPECTED: &'static str = "an integer from 0 on";

    fn from_value(value: &DeValue<'_>) -> Option<Self> {
        match value {
            DeValue::Integer(value) => Self::from_str_radix(value.as_str(), value.radix()).ok(),
            _ => None,
        }
    }
}

impl FromValue for u32 {
    const EXPECTED: &'static str = "an integer from 0 on";

    fn from_value(value: &DeValue<'_>) -> Option<Self> {
        u64::from_value(value).and_then(|value| Self::try_from(value).ok())
    }
}

impl<T: FromValue> FromValue for Vec<T> {
    const EXPECTED: &'static str = "a list";

    fn from_value(value: &DeValue<'_>) -> Option<Self> {
        match value {
            DeValue::Array(items) => items
                .iter()
                .map(|item| T::from_value(item.get_ref()))
                .collect(),
            _ => None,
        }
    }
}

/// A number, or a list of numbers.
pub struct NumberOrList(pub Vec<f64>);

impl FromValue for NumberOrList {
    const EXPECTED: &'static str = "a number or a list of numbers";

    fn from_value(value: &DeValue<'_>) -> Option<Self> {
        let one = f64::from_value(value).map(|number| vec![number]);
        one.or_else(|| Vec::from_value(value)).map(Self)
    }
}

/// Value of a field with its place in the text.
#[derive(Clone, Debug)]
pub struct Field<T> {
    /// The value.
    pub value: T,
    /// Position in the text.
    pub span: Range<usize>,
    /// Dotted name.
    pub name: String,
}

/// A table whose fields are read one after another; fields that are never read are unknown.
pub struct Section<'t> {
    name: String,
    span: Range<usize>,
    entries: Vec<(String, Range<usize>, Spanned<DeValue<'t>>)>,
    known: Vec<&'static str>,
}

impl<'t> Section<'t> {
    /// Section with this name (empty at the top) and the fields of `table`.
    pub fn new(name: &str, table: Spanned<DeTable<'t>>) -> Self {
        let span = table.span();
        let mut entries: Vec<_> = table
            .into_inner()
            .into_iter()
            .map(|(key, value)| {
                let span = key.span();
                (key.into_inner().into_owned(), span, value)
            })
            .collect();
        entries.sort_by_key(|(_, span, _)| span.start);
        Self {
            name: name.to_owned(),
            span,
            entries,
            known: Vec::new(),
        }
    }

    /// Dotted name of the field `key` of this section.
    pub fn field_name(&self, key: &str) -> String {
        if self.name.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.name)
        }
    }

    /// Position of the section in the text.
    pub fn span(&self) -> Range<usize> {
        self.span.clone()
    }

    fn take(&mut self, key: &'static str) -> Option<Spanned<DeValue<'t>>> {
        self.known.push(key);
        let at = self.entries.iter().position(|(name, _, _)| name == key)?;
        Some(self.entries.remove(at).2)
    }

    /// The field `key`, if it exists and has the right type.
    pub fn optional<T: FromValue>(
        &mut self,
        key: &'static str,
        gather: &mut Gatherer<'_>,
    ) -> Option<Field<T>> {
        let value = self.take(key)?;
        let span = value.span();
        let name = self.field_name(key);
        match T::from_value(value.get_ref()) {
            Some(value) => Some(Field { value, span, name }),
            None => {
                gather.add(
                    &span,
                    &name,
                    format!(
                        "found {}, but {} is expected",
                        describe(value.get_ref()),
                        T::EXPECTED
                    ),
                    format!("write {} = {}", key, example_of(T::EXPECTED)),
                );
                None
            }
        }
    }

    /// The value of the field `key`, or `default` if it is absent or wrong.
    pub fn or<T: FromValue>(
        &mut self,
        key: &'static str,
        default: T,
        gather: &mut Gatherer<'_>,
    ) -> T {
        self.optional(key, gather)
            .map_or(default, |field| field.value)
    }

    /// A number within `range`, or `default`.
    pub fn number_in(
        &mut self,
        key: &'static str,
        range: std::ops::RangeInclusive<f64>,
        default: f64,
        gather: &mut Gatherer<'_>,
    ) -> f64 {
        let Some(field) = self.optional::<f64>(key, gather) else {
            return default;
        };
        if range.contains(&field.value) {
            return field.value;
        }
        gather.add(
            &field.span,
            &field.name,
            format!("{} is out of range", field.value),
            format!("use a number from {} to {}", range.start(), range.end()),
        );
        default
    }

    /// The field `key`, whose absence is an error; `help` describes the value.
    pub fn required<T: FromValue>(
        &mut self,
        key: &'static str,
        help: &str,
        gather: &mut Gatherer<'_>,
    ) -> Option<Field<T>> {
        let missing = !self.entries.iter().any(|(name, _, _)| name == key);
        if missing {
            self.known.push(key);
            gather.add(&self.span, &self.field_name(key), "missing", help);
            return None;
        }
        self.optional(key, gather)
    }

    /// The sub-table `key`; an empty one if it is absent.
    pub fn section(&mut self, key: &'static str, gather: &mut Gatherer<'_>) -> Section<'t> {
        self.optional_section(key, gather)
            .unwrap_or_else(|| Section {
                name: self.field_name(key),
                span: self.span.clone(),
                entries: Vec::new(),
                known: Vec::new(),
            })
    }

    /// The sub-table `key`, if it exists.
    pub fn optional_section(
        &mut self,
        key: &'static str,
        gather: &mut Gatherer<'_>,
    ) -> Option<Section<'t>> {
        let value = self.take(key)?;
        let name = self.field_name(key);
        Some(self.as_section(&name, value, gather))
    }

    /// The sub-table `key`, if it exists.
    pub fn present(&mut self, key: &'static str, gather: &mut Gatherer<'_>) -> Option<Section<'t>> {
        let name = self.field_name(key);
        let value = self.take(key)?;
        Some(self.as_section(&name, value, gather))
    }

    /// All sub-tables that were not read yet, with their names.
    pub fn into_sections(mut self, gather: &mut Gatherer<'_>) -> Vec<(Field<String>, Self)> {
        let entries = std::mem::take(&mut self.entries);
        entries
            .into_iter()
            .map(|(key, span, value)| {
                let name = self.field_name(&key);
                let section = self.as_section(&name, value, gather);
                let field = Field {
                    value: key,
                    span,
                    name,
                };
                (field, section)
            })
            .collect()
    }

    fn as_section(
        &self,
        name: &str,
        value: Spanned<DeValue<'t>>,
        gather: &mut Gatherer<'_>,
    ) -> Section<'t> {
        let span = value.span();
        match value.into_inner() {
            DeValue::Table(table) => Section::new(name, Spanned::new(span, table)),
            other => {
                gather.add(
                    &span,
                    name,
                    format!("found {}, but a table is expected", describe(&other)),
                    format!("write a table [{name}]"),
                );
                Section {
                    name: name.to_owned(),
                    span,
                    entries: Vec::new(),
                    known: Vec::new(),
                }
            }
        }
    }

    /// Reports the fields that were not read as unknown.
    pub fn finish(self, gather: &mut Gatherer<'_>) {
        for (key, span, _) in &self.entries {
            if gather.is_full() {
                gather.more += 1;
                continue;
            }
            let help = match closest(key, &self.known) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("known fields: {}", self.known.join(", ")),
            };
            gather.add(span, &self.field_name(key), "unknown field", help);
        }
    }
}

/// Description of a value for messages.
fn describe(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("the string \"{text}\""),
        DeValue::Integer(number) => format!("the number {number}"),
        DeValue::Float(number) => format!("the number {number}"),
        DeValue::Boolean(value) => format!("`{value}`"),
        DeValue::Datetime(date) => format!("the date {date}"),
        DeValue::Array(_) => "a list".to_owned(),
        DeValue::Table(_) => "a table".to_owned(),
    }
}

fn example_of(expected: &str) -> &'static str {
    match expected {
        "a string" => "\"...\"",
        "true or false" => "true",
        "a list" => "[...]",
        _ => "<number>, without quotes",
    }
}

/// The known name that is most similar to `word`, if it is similar enough.
pub fn closest<'k>(word: &str, known: &[&'k str]) -> Option<&'k str> {
    known
        .iter()
        .map(|name| (edit_distance(word, name), *name))
        .filter(|(distance, name)| *distance <= 1 + name.len() / 4)
        .min()
        .map(|(_, name)| name)
}

/// Levenshtein distance in characters.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, cb) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(ca != *cb);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests;
