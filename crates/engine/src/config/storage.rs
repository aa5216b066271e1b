//! `[storage]`: directory, limits and options of the logs.

use std::path::PathBuf;
use std::time::Duration;

use super::source::Source;
use super::trigger::Trigger;
use model::file::{ErrorCollector, Section};

/// Limits of the log directory, in bytes; `None` is no limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Limits {
    /// Largest size of all logs together.
    pub quota: Option<u64>,
    /// Smallest free space of the disk.
    pub keep_free: Option<u64>,
}

/// Directory, limits and options of the logs.
#[derive(Clone, Debug, PartialEq)]
pub struct Storage {
    /// Directory of the logs.
    pub directory: PathBuf,
    /// First part of the names of the logs; run number, start time and part number follow.
    pub name: String,
    /// Limits of the directory.
    pub limits: Limits,
    /// Triggers; `None` means that logs are always written.
    pub trigger: Option<Trigger>,
    /// Options of the writer.
    pub options: store::Options,
}

impl Storage {
    /// Reads the table.
    pub fn read(
        mut section: Section<'_>,
        sources: &[Source],
        collector: &mut ErrorCollector<'_>,
    ) -> Self {
        let defaults = store::Options::default();
        let directory = section.or("directory", "logs".to_owned(), collector);
        let name = section.optional::<String>("name", collector);
        if let Some(field) = &name
            && (field.value.is_empty() || field.value.contains(['/', '\0']))
        {
            collector.add(
                &field.span,
                &field.name,
                format!("\"{}\" cannot be the beginning of a file name", field.value),
                "use a name without /",
            );
        }
        let rotate_s = section.number_in("rotate_after_s", 0.0..=86_400.0, 600.0, collector);
        let rotate_mb = section.number_in("rotate_after_mb", 0.0..=1e6, 1024.0, collector);
        let sync_s = section.number_in("sync_interval_s", 0.01..=60.0, 0.5, collector);
        let raw_s = section.number_in("raw_interval_s", 0.001..=10.0, 1.0, collector);
        let decoded_s = section.number_in("decoded_interval_s", 0.001..=60.0, 0.5, collector);
        let stop_s = section.number_in("stop_within_s", 1.0..=3600.0, 20.0, collector);
        let level = section.number_in("compression_level", 0.0..=22.0, 0.0, collector);
        let quota_mb = section.number_in("quota_mb", 0.0..=1e9, 0.0, collector);
        let keep_free_mb = section.number_in("keep_free_mb", 0.0..=1e9, 0.0, collector);
        let trigger = section.present("trigger", collector);
        let trigger = trigger.map(|section| Trigger::read(section, sources, collector));
        section.finish(collector);
        let bytes = |mb: f64| (mb > 0.0).then_some((mb * 1_048_576.0) as u64);
        Self {
            limits: Limits {
                quota: bytes(quota_mb),
                keep_free: bytes(keep_free_mb),
            },
            directory: PathBuf::from(directory),
            trigger,
            name: name.map_or_else(|| "drive".to_owned(), |field| field.value),
            options: store::Options {
                raw_interval: Duration::from_secs_f64(raw_s),
                decoded_interval: Duration::from_secs_f64(decoded_s),
                stop_within: Duration::from_secs_f64(stop_s),
                compression_level: Some(level as u32),
                sync_interval: Duration::from_secs_f64(sync_s),
                rotate_after: (rotate_s > 0.0).then(|| Duration::from_secs_f64(rotate_s)),
                rotate_bytes: bytes(rotate_mb),
                ..defaults
            },
        }
    }
}
