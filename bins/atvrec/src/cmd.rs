//! Commands, one per file.

pub mod calibrate;
pub mod check;
pub mod completions;
pub mod control;
pub mod demo;
pub mod export;
pub mod findings;
pub mod identify;
pub mod import;
pub mod info;
pub mod link;
pub mod man;
pub mod record;
pub mod recover;
pub mod replay;
pub mod report;
pub mod score;
pub mod simulate;
pub mod virtual_;

use std::path::Path;

use engine::{Config, scope};

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
