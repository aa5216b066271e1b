//! Templates of vehicle and sensors files: a built-in file with the comment of each field. The comments
//! are those of the reference pages, from the JSON Schemas.

use std::fmt::Write;

use serde_json::Value;

use crate::cmd::comment;

/// Name of the table with the origin of each value, which belongs to the built-in vehicle alone.
const SOURCES: &str = "sources";

/// A built-in file with comments.
pub fn template(text: &str, schema: &str, header: &str) -> anyhow::Result<String> {
    let schema: Value = serde_json::from_str(schema)?;
    let (head, tables) = tables(text);
    let mut out = String::new();
    for line in header.lines() {
        comment(&mut out, line);
    }
    out.push('\n');
    let mut write = |name: &str, lines: &str| {
        let known = at(&schema, name);
        if let Some(meaning) = known["description"].as_str() {
            out.push('\n');
            comment(&mut out, meaning);
        }
        write_table(&mut out, name, lines, known);
    };
    write("", head);
    for (name, lines) in &tables {
        if *name != SOURCES {
            write(name, lines);
        }
    }
    write_absent_tables(&mut out, &schema, &tables);
    Ok(out)
}

/// The text before the first table, and each table with its lines.
fn tables(text: &str) -> (&str, Vec<(&str, &str)>) {
    let is_head = |line: &str| line.starts_with('[') && line.trim_end().ends_with(']');
    let mut starts = Vec::new();
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        if is_head(line) {
            starts.push((at, line));
        }
        at += line.len();
    }
    let ends = starts.iter().skip(1).map(|(at, _)| *at).chain([text.len()]);
    let tables = starts.iter().zip(ends);
    let tables = tables.map(|((start, line), end)| {
        let name = line.trim().trim_matches(['[', ']']);
        (name, &text[start + line.len()..end])
    });
    let first = starts.first().map_or(text.len(), |(at, _)| *at);
    (&text[..first], tables.collect())
}

/// Schema of a table.
fn at<'s>(schema: &'s Value, table: &str) -> &'s Value {
    let parts = table.split('.').filter(|part| !part.is_empty());
    parts.fold(schema, |at, part| {
        let found = &at["properties"][part];
        if found["items"]["properties"].is_object() {
            &found["items"]
        } else {
            found
        }
    })
}

fn write_table(out: &mut String, name: &str, lines: &str, schema: &Value) {
    if !name.is_empty() {
        let _ = writeln!(out, "[{name}]");
    }
    let mut present = Vec::new();
    for line in lines.lines().filter(|line| !line.trim().is_empty()) {
        let key = line.split_once('=').map(|(key, _)| key.trim());
        let meaning = key.and_then(|key| schema["properties"][key]["description"].as_str());
        if let (Some(meaning), Some(key)) = (meaning, key) {
            comment(out, meaning);
            present.push(key);
        }
        // The comments of the built-in file are about its own values.
        if !line.starts_with('#') {
            let _ = writeln!(out, "{line}");
        }
    }
    let fields = schema["properties"].as_object().into_iter().flatten();
    for (field, known) in fields.filter(|(field, _)| !present.contains(&field.as_str())) {
        let is_table = known["properties"].is_object() || known["items"]["properties"].is_object();
        if !is_table && field != SOURCES {
            let meaning = known["description"].as_str().unwrap_or_default();
            comment(out, &format!("{field} (optional): {meaning}"));
        }
    }
}

/// Optional tables that the built-in file does not have.
fn write_absent_tables(out: &mut String, schema: &Value, tables: &[(&str, &str)]) {
    let mut absent = Vec::new();
    find_tables(schema, "", &mut absent);
    absent.retain(|(name, _)| tables.iter().all(|(present, _)| present != name));
    // The fields of an absent table need no line of their own.
    let absent: Vec<_> = absent
        .iter()
        .filter(|(name, _)| {
            !absent
                .iter()
                .any(|(other, _)| name.starts_with(&format!("{other}.")))
        })
        .collect();
    if absent.is_empty() {
        return;
    }
    out.push('\n');
    comment(
        out,
        "Further tables, all optional; the reference has their fields:",
    );
    for (name, meaning) in absent {
        let is_list = schema["properties"][name]["items"].is_object();
        let (open, close) = if is_list { ("[[", "]]") } else { ("[", "]") };
        comment(out, &format!("{open}{name}{close} {meaning}"));
    }
}

fn find_tables(schema: &Value, name: &str, found: &mut Vec<(String, String)>) {
    for (field, known) in schema["properties"].as_object().into_iter().flatten() {
        let below = if known["items"].is_object() {
            &known["items"]
        } else {
            known
        };
        if !below["properties"].is_object() {
            continue;
        }
        let name = match name {
            "" => field.clone(),
            name => format!("{name}.{field}"),
        };
        let meaning = known["description"].as_str().unwrap_or_default();
        found.push((name.clone(), meaning.to_owned()));
        find_tables(below, &name, found);
    }
}

#[cfg(test)]
mod tests {
    use crate::cmd::files::{Files, SENSORS, VEHICLES};

    /// A template has the values of its file, and a comment above each of them.
    #[test]
    fn every_field_of_a_template_has_its_meaning() {
        let check = |files: &Files, name: &str| {
            let text = files.template(name).expect(name);
            let mut wanted: toml::Table =
                toml::from_str(&files.text(name).expect(name)).expect(name);
            wanted.remove(super::SOURCES);
            assert_eq!(
                toml::from_str::<toml::Table>(&text).expect(name),
                wanted,
                "{name}"
            );
            let lines: Vec<&str> = text.lines().collect();
            let mut fields = 0;
            for (before, line) in lines.iter().zip(&lines[1..]) {
                let is_value = !line.starts_with('#') && !line.is_empty();
                assert!(!is_value || before.starts_with('#'), "{name}: {line}");
                fields += usize::from(is_value && line.contains('='));
            }
            assert!(fields > 30, "{name}: {fields} fields");
        };
        for files in [&VEHICLES, &SENSORS] {
            assert!(files.is_builtin(files.default));
            for name in files.names() {
                check(files, name);
            }
        }
    }
}
