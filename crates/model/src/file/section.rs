//! Reads a table field by field.

use std::ops::{Range, RangeInclusive};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::{ErrorCollector, closest};

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
        number(value).filter(|number| number.is_finite())
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
        collector: &mut ErrorCollector<'_>,
    ) -> Option<Field<T>> {
        let value = self.take(key)?;
        let span = value.span();
        let name = self.field_name(key);
        match T::from_value(value.get_ref()) {
            Some(value) => Some(Field { value, span, name }),
            None => {
                collector.add(
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
        collector: &mut ErrorCollector<'_>,
    ) -> T {
        self.optional(key, collector)
            .map_or(default, |field| field.value)
    }

    /// A number within `range`, or `default`.
    pub fn number_in(
        &mut self,
        key: &'static str,
        range: RangeInclusive<f64>,
        default: f64,
        collector: &mut ErrorCollector<'_>,
    ) -> f64 {
        let Some(field) = self.optional::<f64>(key, collector) else {
            return default;
        };
        if range.contains(&field.value) {
            return field.value;
        }
        collector.add(
            &field.span,
            &field.name,
            format!("{} is out of range", field.value),
            format!("use a number from {} to {}", range.start(), range.end()),
        );
        default
    }

    /// A number within `range`, or `default`, under its name or under the `earlier` name of the field,
    /// which gives a warning.
    pub fn renamed_number_in(
        &mut self,
        [key, earlier]: [&'static str; 2],
        range: RangeInclusive<f64>,
        default: f64,
        collector: &mut ErrorCollector<'_>,
    ) -> f64 {
        let has = |name: &str| self.entries.iter().any(|(known, _, _)| known == name);
        if !has(earlier) {
            return self.number_in(key, range, default, collector);
        }
        if has(key) {
            let message = format!("both {key} and its earlier name {earlier} are set");
            let help = format!("remove {earlier}");
            collector.add(&self.span, &self.field_name(earlier), message, help);
        } else {
            let field = self.field_name(earlier);
            let message = format!("{earlier} is the earlier name of {key}");
            collector.warn(&self.span, &field, message, format!("write {key}"));
        }
        let value = self.number_in(earlier, range, default, collector);
        self.known.retain(|known| *known != earlier);
        self.take(key);
        value
    }

    /// The field `key`, whose absence is an error; `help` describes the value.
    pub fn required<T: FromValue>(
        &mut self,
        key: &'static str,
        help: &str,
        collector: &mut ErrorCollector<'_>,
    ) -> Option<Field<T>> {
        let missing = !self.entries.iter().any(|(name, _, _)| name == key);
        if missing {
            self.known.push(key);
            collector.add(&self.span, &self.field_name(key), "missing", help);
            return None;
        }
        self.optional(key, collector)
    }

    /// All fields as numbers, by their names in this section.
    pub fn into_numbers(mut self, collector: &mut ErrorCollector<'_>) -> Vec<(String, Field<f64>)> {
        let mut numbers = Vec::new();
        for (name, span, value) in std::mem::take(&mut self.entries) {
            let whole_name = self.field_name(&name);
            match f64::from_value(value.get_ref()) {
                Some(value) => {
                    let field = Field {
                        value,
                        span,
                        name: whole_name,
                    };
                    numbers.push((name, field));
                }
                None => {
                    let help = format!("write {name} = 1.0");
                    collector.add(&span, &whole_name, "a number is expected", help);
                }
            }
        }
        numbers
    }

    /// The sub-table `key`; an empty one if it is absent.
    pub fn section(
        &mut self,
        key: &'static str,
        collector: &mut ErrorCollector<'_>,
    ) -> Section<'t> {
        self.optional_section(key, collector)
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
        collector: &mut ErrorCollector<'_>,
    ) -> Option<Section<'t>> {
        let value = self.take(key)?;
        let name = self.field_name(key);
        Some(self.as_section(&name, value, collector))
    }

    /// The sub-table `key`, if it exists.
    pub fn present(
        &mut self,
        key: &'static str,
        collector: &mut ErrorCollector<'_>,
    ) -> Option<Section<'t>> {
        let name = self.field_name(key);
        let value = self.take(key)?;
        Some(self.as_section(&name, value, collector))
    }

    /// All sub-tables that were not read yet, with their names.
    pub fn into_sections(
        mut self,
        collector: &mut ErrorCollector<'_>,
    ) -> Vec<(Field<String>, Self)> {
        let entries = std::mem::take(&mut self.entries);
        entries
            .into_iter()
            .map(|(key, span, value)| {
                let name = self.field_name(&key);
                let section = self.as_section(&name, value, collector);
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
        collector: &mut ErrorCollector<'_>,
    ) -> Section<'t> {
        let span = value.span();
        match value.into_inner() {
            DeValue::Table(table) => Section::new(name, Spanned::new(span, table)),
            other => {
                collector.add(
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

    /// Leaves out the fields that were not read, where an earlier error makes them meaningless.
    pub(crate) fn forget(&mut self) {
        self.entries.clear();
    }

    /// Reports the fields that were not read as unknown.
    pub fn finish(self, collector: &mut ErrorCollector<'_>) {
        for (key, span, _) in &self.entries {
            if collector.count_if_full() {
                continue;
            }
            let help = match closest(key, &self.known) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("known fields: {}", self.known.join(", ")),
            };
            collector.add(span, &self.field_name(key), "unknown field", help);
        }
    }
}

/// A number, as an integer or a float.
pub(super) fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Float(float) => float.as_str().replace('_', "").parse().ok(),
        DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix())
            .ok()
            .map(|integer| integer as f64),
        _ => None,
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
