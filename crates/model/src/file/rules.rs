//! Reads files under rules, as vehicle and sensors files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use sample::boundary::guarded;
use serde::de::DeserializeOwned;
use toml::de::{DeTable, DeValue};

use super::section::number;
use super::{ErrorCollector, FileErrors, Problem, Unparsed, closest, line_and_column, parse};
use crate::tyre::{Entry, Tir};

/// Which numbers a field admits.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Range {
    /// Any finite number.
    Finite,
    /// Greater than zero and at most this.
    Positive(f64),
    /// Zero or greater and at most this.
    NonNegative(f64),
    /// Between these, both included.
    Within(f64, f64),
}

impl Range {
    fn complaint(self, value: f64) -> Option<String> {
        if !value.is_finite() {
            return Some("is not a finite number".into());
        }
        match self {
            Self::Positive(_) if value <= 0.0 => Some("must be greater than 0".into()),
            Self::NonNegative(_) if value < 0.0 => Some("must not be negative".into()),
            Self::Positive(most) | Self::NonNegative(most) if value > most => {
                Some(format!("is more than {most}, which no vehicle has"))
            }
            Self::Within(least, most) if !(least..=most).contains(&value) => {
                Some(format!("must lie between {least} and {most}"))
            }
            _ => None,
        }
    }
}

/// What a field holds.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Kind {
    Table,
    Texts,
    Text,
    Flag,
    Number(Range),
    Integer(i64, i64),
    Vector(usize, Range),
    Pairs,
    Choice(&'static [&'static str]),
    /// One to all of these, each once.
    Choices(&'static [&'static str]),
    /// An array of tables, each under the rules of the table with the array's name.
    Tables,
    /// A tyre property file: its name, or its coefficients as a table.
    TyreFile,
}

/// One field of a file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rule {
    /// Dotted name.
    pub field: &'static str,
    /// What it holds.
    pub kind: Kind,
    /// Whether it must be there when its table is.
    pub required: bool,
    /// Field of the same table that gives a required field, too.
    pub unless: Option<&'static str>,
}

/// A field that must be there, or another one that gives its value.
pub(crate) const fn must_unless(field: &'static str, kind: Kind, other: &'static str) -> Rule {
    Rule {
        unless: Some(other),
        ..must(field, kind)
    }
}

/// A field that must be there.
pub(crate) const fn must(field: &'static str, kind: Kind) -> Rule {
    Rule {
        field,
        kind,
        required: true,
        unless: None,
    }
}

/// A field that may be left out.
pub(crate) const fn may(field: &'static str, kind: Kind) -> Rule {
    Rule {
        field,
        kind,
        required: false,
        unless: None,
    }
}

/// Rules of one table of a file. The same rules may hold for several tables, as for both axles.
pub(crate) struct TableRules {
    /// Dotted names of the tables, empty for the top of the file.
    pub tables: &'static [&'static str],
    /// The fields in them.
    pub rules: &'static [Rule],
}

/// A file that was read, with the line of each of its fields.
pub(crate) struct Checked<T> {
    /// What the file says.
    pub value: T,
    /// Line of each field.
    lines: BTreeMap<String, usize>,
    path: PathBuf,
    problems: Vec<Problem>,
}

impl<T> Checked<T> {
    /// Notes a mistake that shows only between fields.
    pub fn note(&mut self, field: &str, value: String, message: String, remedy: String) {
        self.problems.push(Problem {
            file: self.path.display().to_string(),
            line: line_of(&self.lines, field),
            column: 0,
            field: field.to_owned(),
            value,
            message,
            help: remedy,
        });
    }

    /// What was read, made into something else.
    pub fn map<U>(self, make: impl FnOnce(T) -> U) -> Checked<U> {
        Checked {
            value: make(self.value),
            lines: self.lines,
            path: self.path,
            problems: self.problems,
        }
    }

    /// The file, or all that is wrong with it.
    pub fn finish(self) -> Result<T, FileErrors> {
        if self.problems.is_empty() {
            Ok(self.value)
        } else {
            Err(FileErrors::sorted(self.path, self.problems))
        }
    }
}

/// Reads a file under rules.
pub(crate) fn read<T: DeserializeOwned>(
    text: &str,
    path: &Path,
    sections: &[TableRules],
) -> Result<Checked<T>, FileErrors> {
    let name = path.display().to_string();
    let refuse = |collector| Err(FileErrors::of(path, collector));
    let mut collector = ErrorCollector::new(&name, text);
    let parsed = parse(text).and_then(|table| {
        let value = guarded(|| toml::from_str(text)).map_err(|panic| Unparsed::panic(&panic))?;
        Ok((table, value))
    });
    let (document, value) = match parsed {
        Ok(parsed) => parsed,
        Err(unparsed) => {
            add_unparsed(&mut collector, text, unparsed);
            return refuse(collector);
        }
    };
    let mut walk = Walk {
        text,
        sections,
        lines: BTreeMap::new(),
        collector: &mut collector,
    };
    walk.table("", document.get_ref());
    let lines = walk.lines;
    if !collector.is_empty() {
        return refuse(collector);
    }
    match value {
        Ok(value) => Ok(Checked {
            value,
            lines,
            path: path.to_owned(),
            problems: Vec::new(),
        }),
        Err(error) => {
            add_syntax(&mut collector, text, &error);
            refuse(collector)
        }
    }
}

fn add_unparsed(collector: &mut ErrorCollector<'_>, text: &str, unparsed: Unparsed) {
    match unparsed {
        Unparsed::Syntax(errors) => {
            for error in &errors {
                add_syntax(collector, text, error);
            }
        }
        Unparsed::Whole(message, help) => {
            collector.add_at(0, "syntax", "", message, help.to_owned());
        }
    }
}

fn add_syntax(collector: &mut ErrorCollector<'_>, text: &str, error: &toml::de::Error) {
    let span = error.span();
    let line = span
        .as_ref()
        .map_or(0, |span| line_and_column(text, span.start).0);
    let written = span.and_then(|span| text.get(span)).unwrap_or_default();
    let value = written.lines().next().unwrap_or_default();
    let (message, help) = (error.message().to_owned(), "correct the TOML".to_owned());
    collector.add_at(line, "syntax", value, message, help);
}

/// Line of a field, or of the nearest table around it.
fn line_of(lines: &BTreeMap<String, usize>, field: &str) -> usize {
    let mut name = field;
    loop {
        if let Some(line) = lines.get(name) {
            return *line;
        }
        match name.rsplit_once('.') {
            Some((table, _)) => name = table,
            None => return 0,
        }
    }
}

struct Walk<'a, 't> {
    text: &'a str,
    sections: &'a [TableRules],
    lines: BTreeMap<String, usize>,
    collector: &'a mut ErrorCollector<'t>,
}

impl Walk<'_, '_> {
    fn rules(&self, table: &str) -> impl Iterator<Item = &'static Rule> + use<> {
        // `payload[0]` is under the rules of `payload`.
        let table = table.split('[').next().unwrap_or_default();
        self.sections
            .iter()
            .filter(|section| section.tables.contains(&table))
            .map(|section| section.rules)
            .collect::<Vec<_>>()
            .into_iter()
            .flatten()
    }

    fn problem(&mut self, field: &str, value: &str, message: String, remedy: String) {
        let line = line_of(&self.lines, field);
        self.collector
            .add_at(line, field, value.trim(), message, remedy);
    }

    fn table(&mut self, name: &str, table: &DeTable<'_>) {
        for (key, value) in table {
            if self.collector.is_full() {
                return;
            }
            let field = join(name, key.get_ref());
            let (line, _) = line_and_column(self.text, key.span().start);
            self.lines.insert(field.clone(), line);
            let rule = self.rules(name).find(|rule| rule.field == key.get_ref());
            let Some(rule) = rule else {
                let known: Vec<_> = self.rules(name).map(|rule| rule.field).collect();
                self.problem(
                    &field,
                    "",
                    "no such field".into(),
                    remedy_of_unknown(key.get_ref(), &known),
                );
                continue;
            };
            let written = self.text.get(value.span()).unwrap_or_default().to_owned();
            self.field(&field, rule.kind, value.get_ref(), &written);
        }
        for rule in self.rules(name) {
            let has = |field: &str| table.keys().any(|key| key.get_ref() == field);
            if rule.required && !has(rule.field) && !rule.unless.is_some_and(has) {
                let field = join(name, rule.field);
                self.problem(
                    &field,
                    "",
                    "is missing".into(),
                    format!("add {}", wanted(rule.kind)),
                );
            }
        }
    }

    fn field(&mut self, field: &str, kind: Kind, value: &DeValue<'_>, written: &str) {
        let complaint = match (kind, value) {
            (Kind::Table, DeValue::Table(table)) => {
                self.table(field, table);
                None
            }
            (Kind::Texts, DeValue::Table(table)) => (!table.values().all(|v| v.get_ref().is_str()))
                .then(|| "must hold texts only".to_owned()),
            (Kind::Text, DeValue::String(_)) | (Kind::Flag, DeValue::Boolean(_)) => None,
            (Kind::Number(range), value) => match number(value) {
                Some(number) => range.complaint(number),
                None => Some("is not a number".into()),
            },
            (Kind::Integer(least, most), DeValue::Integer(_)) => match number(value) {
                Some(number) if (least as f64..=most as f64).contains(&number) => None,
                _ => Some(format!("must lie between {least} and {most}")),
            },
            (Kind::Vector(length, range), DeValue::Array(items)) => {
                let numbers: Option<Vec<f64>> = items.iter().map(|i| number(i.get_ref())).collect();
                match numbers {
                    Some(numbers) if numbers.len() == length => {
                        numbers.iter().find_map(|n| range.complaint(*n))
                    }
                    _ => Some(format!("is not {length} numbers")),
                }
            }
            (Kind::Pairs, DeValue::Array(items)) => pairs_complaint(items),
            (Kind::Choice(choices), DeValue::String(text)) => (!choices.contains(&text.as_ref()))
                .then(|| "is not one of the kinds known".to_owned()),
            (Kind::Choices(choices), DeValue::Array(items)) => choices_complaint(items, choices),
            (Kind::Tables, DeValue::Array(items)) => {
                let mut wrong = None;
                for (number, item) in items.iter().enumerate() {
                    match item.get_ref() {
                        DeValue::Table(table) => self.table(&format!("{field}[{number}]"), table),
                        other => {
                            wrong = Some(format!("holds an entry of type {}", other.type_str()));
                        }
                    }
                }
                wrong
            }
            (Kind::TyreFile, value) => tyre_complaint(value),
            _ => Some(format!("is of the wrong type ({})", value.type_str())),
        };
        if let Some(message) = complaint {
            let shown = written.lines().next().unwrap_or_default();
            self.problem(field, shown, message, format!("give {}", wanted(kind)));
        }
    }
}

/// What is wrong with the coefficients of a tyre property file.
fn tyre_complaint(value: &DeValue<'_>) -> Option<String> {
    let DeValue::Table(table) = value else {
        return Some(match value {
            DeValue::String(_) => "is the name of a file that was not read".to_owned(),
            other => format!("is of the wrong type ({})", other.type_str()),
        });
    };
    let mut entries = BTreeMap::new();
    for (name, value) in table {
        let entry = match (value.get_ref(), number(value.get_ref())) {
            (DeValue::String(text), _) => Entry::Text(text.to_string()),
            (DeValue::Integer(_), Some(number)) => Entry::Whole(number as i64),
            (_, Some(number)) => Entry::Number(number),
            (_, None) => return Some(format!("has {}, which is not a number", name.get_ref())),
        };
        entries.insert(name.get_ref().to_string(), entry);
    }
    Tir::try_from(entries)
        .err()
        .map(|fault| format!("is no tyre: {fault}"))
}

fn choices_complaint(items: &toml::de::DeArray<'_>, choices: &[&str]) -> Option<String> {
    let mut chosen = Vec::new();
    for item in items {
        let text = item.get_ref().as_str().filter(|t| choices.contains(t));
        match text {
            Some(text) if !chosen.contains(&text) => chosen.push(text),
            Some(text) => return Some(format!("has {text} twice")),
            None => return Some("has an entry that is not one of the kinds known".to_owned()),
        }
    }
    chosen.is_empty().then(|| "is empty".to_owned())
}

fn pairs_complaint(items: &toml::de::DeArray<'_>) -> Option<String> {
    let mut last = f64::NEG_INFINITY;
    for item in items {
        let pair = item.get_ref().as_array()?;
        let numbers: Vec<f64> = pair.iter().filter_map(|i| number(i.get_ref())).collect();
        let [from, to] = numbers[..] else {
            return Some("is not made of pairs of numbers".into());
        };
        if !from.is_finite() || !to.is_finite() || from <= last {
            return Some("must be finite, its first column ascending".into());
        }
        last = from;
    }
    (items.len() == 1).then(|| "needs two pairs at least".to_owned())
}

fn wanted(kind: Kind) -> String {
    match kind {
        Kind::Table => "a table".into(),
        Kind::Texts => "a table of texts".into(),
        Kind::Text => "a text in quotes".into(),
        Kind::Flag => "true or false".into(),
        Kind::Number(_) => "a number in the unit that the field's name ends with".into(),
        Kind::Integer(least, most) => format!("a whole number from {least} to {most}"),
        Kind::Vector(length, _) => {
            format!("{length} numbers in the unit that the field's name ends with")
        }
        Kind::Pairs => "pairs such as [[-1.0, -0.1], [1.0, 0.1]]".into(),
        Kind::Choice(choices) => format!("one of {}", choices.join(", ")),
        Kind::Choices(choices) => format!("an array of some of {}", choices.join(", ")),
        Kind::Tables => "an array of tables".into(),
        Kind::TyreFile => "the name of a .tir file beside the vehicle file".into(),
    }
}

fn join(table: &str, field: &str) -> String {
    if table.is_empty() {
        field.to_owned()
    } else {
        format!("{table}.{field}")
    }
}

/// What to do about an unknown field.
fn remedy_of_unknown(name: &str, known: &[&str]) -> String {
    let stem = |full: &str| full.split('_').next().unwrap_or_default().to_owned();
    // Units belong to names: "mass" and "mass_lb" mean "mass_kg".
    let same_stem = || {
        let mut alike = known.iter().filter(|other| stem(other) == stem(name));
        alike.next().filter(|_| alike.next().is_none()).copied()
    };
    match closest(name, known).or_else(same_stem) {
        Some(best) => format!("did you mean {best}? Units belong to the name"),
        None => format!("remove it; known here: {}", known.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_misspelt_name_and_one_in_another_unit_are_recognised() {
        let known = [
            "mass_kg",
            "cg_height_m",
            "front_axle_to_cg_m",
            "cg_to_rear_axle_m",
        ];
        assert_eq!(closest("mas_kg", &known), Some("mass_kg"));
        assert_eq!(closest("cg_hieght_m", &known), Some("cg_height_m"));
        assert_eq!(closest("colour", &known), None);
        let remedy = |name| remedy_of_unknown(name, &known);
        assert!(
            remedy("mass_lb").starts_with("did you mean mass_kg?"),
            "{}",
            remedy("mass_lb")
        );
        assert!(
            remedy("mass").starts_with("did you mean mass_kg?"),
            "{}",
            remedy("mass")
        );
        assert!(
            remedy("colour").starts_with("remove it"),
            "{}",
            remedy("colour")
        );
    }
}
