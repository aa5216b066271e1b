//! Commands, one per file.

pub mod calibrate;
pub mod check;
pub mod clock_state;
pub mod completions;
pub mod control;
pub mod cut;
pub mod demo;
pub mod events;
pub mod export;
pub mod files;
pub mod findings;
pub mod identify;
pub mod import;
pub mod info;
pub mod init;
pub mod link;
#[cfg(feature = "live")]
pub mod live;
pub mod man;
pub mod merge;
mod origin;
mod overrides;
pub mod record;
pub mod recover;
pub mod replay;
pub mod report;
pub mod score;
pub mod simulate;
pub mod split;
mod table;
#[cfg(feature = "live")]
pub mod top;
pub mod virtual_;

use std::path::Path;

use engine::config::NOT_ATTACHED;
use engine::{Config, scope};
use sample::text::printable;
use store::Info;

use crate::exit::UsageError;

/// Refuses a configuration without a source: there is nothing to listen to.
pub fn require_sources(path: &Path, config: &Config) -> anyhow::Result<()> {
    if config.sources.is_empty() {
        return Err(UsageError(format!(
            "{} has no source; add a table [source.<name>] with kind and device for each device \
             (docs/configuration.md has an example of each kind)",
            path.display()
        ))
        .into());
    }
    Ok(())
}

/// Tells what is not estimated with a configuration, and why.
pub fn tell_scope(config: &Config) {
    for line in scope::limits(config) {
        tracing::warn!("{line}");
    }
}

/// Refuses a time after the end of a log.
pub fn check_from(from_s: Option<f64>, info: &Info) -> anyhow::Result<()> {
    let duration_s = info
        .span
        .map_or(0.0, |(first, last)| last.seconds_since(first));
    match from_s {
        Some(from_s) if from_s > duration_s => Err(UsageError(format!(
            "--from {from_s} s is after the end of the log, which is at {duration_s:.3} s; use a smaller \
             value"
        ))
        .into()),
        _ => Ok(()),
    }
}

/// Names the options of the command line, in the place of fields of a configuration that the program has
/// written: pairs of a field and its option.
pub fn name_options(error: engine::Error, options: &[(&str, &str)]) -> engine::Error {
    let engine::Error::Configuration(mut problems) = error else {
        return error;
    };
    for problem in &mut problems.0 {
        let is_field = |(field, _): &&(&str, &str)| problem.field == *field;
        let Some((_, option)) = options.iter().find(is_field) else {
            continue;
        };
        (*option).clone_into(&mut problem.file);
        (problem.line, problem.column) = (0, 0);
        problem.field.clear();
        if let Some(name) = problem.message.strip_suffix(NOT_ATTACHED) {
            problem.message = format!("{name} is neither a file nor the name of a built-in one");
            "give the path of a file; --help lists what is built in".clone_into(&mut problem.help);
        }
    }
    engine::Error::Configuration(problems)
}

/// Adds a comment to a TOML text, in lines of at most 100 characters.
fn comment(text: &mut String, line: &str) {
    let mut width = 0;
    for word in printable(line).split_whitespace() {
        if width == 0 || width + word.len() + 1 > 100 {
            text.push_str(if width == 0 { "#" } else { "\n#" });
            width = 1;
        }
        text.push(' ');
        text.push_str(word);
        width += word.len() + 1;
    }
    text.push('\n');
}
