//! What a replay tells the estimator otherwise than the log's own configuration.

use std::path::Path;

use anyhow::Context;
use engine::config::{ATTACHED_NAME, TOML_MAX, read_text};
use store::Attachment;
use toml::{Table, Value};

use crate::cli::ReplayChanges;
use crate::exit::UsageError;

/// The attachments with the changes: files beside the others, and a configuration that names them.
pub fn apply(
    changes: &ReplayChanges,
    mut attachments: Vec<Attachment>,
) -> anyhow::Result<Vec<Attachment>> {
    let files = [
        ("file", &changes.vehicle),
        ("sensors", &changes.sensors),
        ("calibration", &changes.calibration),
    ];
    let changed = files.iter().any(|(_, path)| path.is_some())
        || !changes.overrides.is_empty()
        || !changes.without.is_empty()
        || !changes.with.is_empty()
        || changes.method.is_some();
    let own = attachments.iter().position(|a| a.name == ATTACHED_NAME);
    let Some(own) = own.filter(|_| changed) else {
        return Ok(attachments);
    };
    let text = String::from_utf8(attachments[own].data.clone())?;
    let mut configuration: Table = text.parse()?;
    for (key, path) in files {
        let Some(path) = path else { continue };
        let name = attach(&mut attachments, path)?;
        section(&mut configuration, "vehicle")?.insert(key.to_owned(), Value::String(name));
    }
    for path in &changes.overrides {
        let name = attach(&mut attachments, path)?;
        list(section(&mut configuration, "vehicle")?, "overrides")?.push(Value::String(name));
    }
    let estimator = section(&mut configuration, "estimator")?;
    let ignored = list(estimator, "ignore")?;
    for input in &changes.with {
        let is_it = |ignored: &Value| ignored.as_str() == Some(input);
        if !ignored.iter().any(is_it) {
            let names: Vec<&str> = ignored.iter().filter_map(Value::as_str).collect();
            let help = match names[..] {
                [] => "it ignores nothing".to_owned(),
                _ => format!("it ignores {}", names.join(", ")),
            };
            return Err(UsageError(format!(
                "--with {input}: the log's configuration does not ignore that; {help}"
            ))
            .into());
        }
        ignored.retain(|ignored| !is_it(ignored));
    }
    ignored.extend(changes.without.iter().cloned().map(Value::String));
    if let Some(method) = &changes.method {
        estimator.insert("method".to_owned(), Value::String(method.clone()));
    }
    attachments[own].data = toml::to_string(&configuration)?.into_bytes();
    Ok(attachments)
}

/// Attaches a file in the place of one of the same name; the program's own need no file.
fn attach(attachments: &mut Vec<Attachment>, path: &Path) -> anyhow::Result<String> {
    if !path.exists() && path.extension().is_none() {
        return Ok(path.display().to_string());
    }
    let data = read_text(path, TOML_MAX)
        .with_context(|| UsageError(format!("cannot read {}", path.display())))?
        .into_bytes();
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let name = format!("replay-{name}");
    attachments.retain(|attachment| attachment.name != name);
    attachments.push(Attachment {
        name: name.clone(),
        media_type: "application/toml".to_owned(),
        data,
    });
    Ok(name)
}

fn list<'a>(section: &'a mut Table, name: &str) -> anyhow::Result<&'a mut Vec<Value>> {
    section
        .entry(name)
        .or_insert_with(|| Value::Array(Vec::new()))
        .as_array_mut()
        .with_context(|| format!("{name} is no list in the log's configuration"))
}

fn section<'a>(configuration: &'a mut Table, name: &str) -> anyhow::Result<&'a mut Table> {
    configuration
        .entry(name)
        .or_insert_with(|| Value::Table(Table::new()))
        .as_table_mut()
        .with_context(|| format!("{name} is no table of the log's configuration"))
}
