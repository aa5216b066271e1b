//! What a replay tells the estimator otherwise than the log's own configuration.

use std::path::Path;

use anyhow::Context;
use store::Attachment;
use toml::{Table, Value};

use crate::cli::ReplayChanges;
use crate::config::ATTACHED_NAME;
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
        || !changes.without.is_empty()
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
    let estimator = section(&mut configuration, "estimator")?;
    if !changes.without.is_empty() {
        let left_out = estimator
            .entry("ignore")
            .or_insert_with(|| Value::Array(Vec::new()));
        if let Value::Array(left_out) = left_out {
            left_out.extend(changes.without.iter().cloned().map(Value::String));
        }
    }
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
    let data = std::fs::read(path)
        .with_context(|| UsageError(format!("cannot read {}", path.display())))?;
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

fn section<'a>(configuration: &'a mut Table, name: &str) -> anyhow::Result<&'a mut Table> {
    configuration
        .entry(name)
        .or_insert_with(|| Value::Table(Table::new()))
        .as_table_mut()
        .with_context(|| format!("{name} is no table of the log's configuration"))
}
