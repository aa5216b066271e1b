//! `atvrec import`: import logs and project files of other formats.
//!
//! An imported log is an ordinary log: the lines of the file are its raw data, and each line arrives at
//! the time in the file. Therefore it can be replayed, reported and scored like a recording.

mod alog;
mod can;
mod clock;
mod csv;
mod decode;
mod gnss;
mod log;
mod plausible;
mod run;
mod signals;
mod text;
mod truth;
mod vehicle;

use std::path::{Path, PathBuf};

use engine::Config;
use engine::config::{Meaning, Problems};
use model::file::Problem;
use sample::LogTime;
use wire::can_log::Format;

use crate::cli::{ImportCanArgs, ImportCommand, ImportInto, ImportRows};
use crate::exit::{Outcome, UsageError};
use crate::interrupt::Interrupt;
use engine::output::{Kind, Target};

/// Time zero of a file without a date: 2000-01-01 UTC, ns.
const START_DEFAULT_NS: u64 = 946_684_800_000_000_000;
/// End of the times of a log, ns.
const TIME_END_NS: u64 = u64::MAX / 2;
/// Most characters of a cell, and most names of columns, in a message.
const CHARS_MAX: usize = 60;
const NAMES_MAX: usize = 50;
/// Beginning of a time column from which it is UNIX time: 1980, ns.
const UNIX_TIME_FROM_NS: i128 = 315_532_800_000_000_000;

/// Runs the command.
pub fn run(command: &ImportCommand, quiet: bool) -> anyhow::Result<Outcome> {
    match command {
        ImportCommand::Vehicle(args) => vehicle::run(args),
        ImportCommand::Csv(args) => csv::run(args, quiet),
        ImportCommand::Alog(args) => alog::run(args, quiet),
        ImportCommand::Candump(args) => can::run(Format::Candump, args, quiet),
        ImportCommand::Asc(args) => can::run(Format::Asc, args, quiet),
        ImportCommand::Trc(args) => can::run(Format::Trc, args, quiet),
        ImportCommand::Blf(args) => can::run(Format::Blf, args, quiet),
        ImportCommand::Mf4(args) if args.columns.is_empty() => {
            if args.rows.split_gaps || args.rows.accept_units {
                let text =
                    "--split-gaps and --accept-units are for measured signals; add --columns MAP";
                return Err(UsageError(text.to_owned()).into());
            }
            can::run(Format::Mf4, &args.frames, quiet)
        }
        ImportCommand::Mf4(args) => {
            let ImportCanArgs { input, into, .. } = &args.frames;
            csv::convert((input, &args.columns), into, args.rows, quiet)
        }
        ImportCommand::Gnss(args) => gnss::run(args, quiet),
    }
}

/// A file that becomes a source of the log.
struct Table<'t> {
    /// Kind of source in the configuration.
    kind: &'static str,
    /// Path of the file.
    path: &'t Path,
    /// Name of its column map.
    columns: &'t str,
    /// Columns whose values are held, and for how many rows.
    held: Vec<(String, u32)>,
    /// What the map says.
    meaning: Meaning,
}

/// The outputs of an import.
struct Output<'p> {
    /// Log, if the import gives one run.
    log: Target,
    /// Arguments of the user.
    into: &'p ImportInto,
    /// Treatment of rows, if the input is a table.
    rows: Option<ImportRows>,
    /// Input files.
    inputs: Vec<&'p Path>,
    /// Nothing is shown while the import runs.
    quiet: bool,
    interrupt: Interrupt,
}

/// Checks the output; `tables` are the imported files and their column maps.
fn output<'p>(
    into: &'p ImportInto,
    rows: Option<ImportRows>,
    tables: impl IntoIterator<Item = &'p PathBuf>,
    quiet: bool,
) -> anyhow::Result<Output<'p>> {
    let named = [&into.vehicle, &into.sensors, &into.calibration];
    let mut inputs: Vec<&Path> = named.into_iter().flatten().map(Path::new).collect();
    inputs.extend(into.config.iter().chain(tables).map(|path| &**path));
    Ok(Output {
        log: Target::new(&into.output, Kind::Log, into.replace.force, inputs.clone())?,
        into,
        rows,
        inputs,
        quiet,
        interrupt: Interrupt::listen()?,
    })
}

/// Converts to a time of a log; `None` if it is out of range.
fn log_time(nanos: i128) -> Option<LogTime> {
    let time = u64::try_from(nanos).ok()?;
    (time < TIME_END_NS).then_some(LogTime(time))
}

/// Beginning of a text of the input, for a message.
fn shortened(text: &str) -> String {
    let mut shown: String = text.chars().take(CHARS_MAX).collect();
    if shown.len() < text.len() {
        shown.push_str("...");
    }
    shown
}

/// First names of a list, for a message.
fn listed(names: &[&str]) -> String {
    let shown: Vec<String> = names.iter().take(NAMES_MAX).map(|n| shortened(n)).collect();
    let more = names.len() - shown.len();
    let more = if more > 0 {
        format!(" and {more} more")
    } else {
        String::new()
    };
    shown.join(", ") + &more
}

/// Names of the files as sources: their stems with only the characters that a topic can contain.
fn source_names(paths: &[PathBuf]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for path in paths {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let mut name: String = stem
            .chars()
            .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
            .collect();
        if name.is_empty() {
            name.push_str("table");
        }
        let base = name.clone();
        let mut number = 2;
        while names.contains(&name) {
            name = format!("{base}_{number}");
            number += 1;
        }
        names.push(name);
    }
    names
}

/// Refuses a column map from which measurements cannot be made.
fn refuse(contradictions: Vec<Problem>) -> anyhow::Result<()> {
    if contradictions.is_empty() {
        return Ok(());
    }
    Err(Problems(contradictions).into())
}

/// Checks that a source of the user's configuration reads the imported file as its column map says.
fn check_source(config: &Config, path: &Path, name: &str, table: &Table<'_>) -> anyhow::Result<()> {
    let path = path.display();
    let kind = table.kind;
    let Some(source) = config.sources.iter().find(|s| s.spec.name == *name) else {
        return Err(UsageError(format!(
            "{path} has no source {name}; add a table [source.{name}] with kind, device and columns"
        ))
        .into());
    };
    let same = match (&source.meaning, &table.meaning) {
        (Meaning::Csv(found), Meaning::Csv(given)) => found.format == given.format,
        (Meaning::Alog(found), Meaning::Alog(given)) => found == given,
        _ => {
            return Err(UsageError(format!(
                "{path}: source.{name} must be of kind {kind}, because {} is imported into it; set kind = \
                 \"{kind}\", or give another name to the file",
                table.path.display()
            ))
            .into());
        }
    };
    if same {
        return Ok(());
    }
    Err(UsageError(format!(
        "{path}: the column map of source.{name} differs from {}; name the same file in columns",
        table.columns
    ))
    .into())
}

/// Configuration of the log: the user's file, or one with these tables and this vehicle.
fn configuration(
    names: &[String],
    tables: &[Table<'_>],
    into: &ImportInto,
) -> anyhow::Result<Config> {
    if let Some(path) = &into.config {
        let config = Config::load(path)?;
        for (name, table) in names.iter().zip(tables) {
            check_source(&config, path, name, table)?;
        }
        return Ok(config);
    }
    let mut text = String::new();
    for (name, table) in names.iter().zip(tables) {
        let file = table.path.file_name().unwrap_or_default().to_string_lossy();
        text.push_str(&format!(
            "[source.{name}]\nkind = \"{}\"\ndevice = {}\ncolumns = {}\nsilent_after_s = 0\n",
            table.kind,
            quoted(&format!("imported/{name}/{file}")),
            quoted(table.columns),
        ));
        if !table.held.is_empty() {
            text.push_str(&format!("[source.{name}.held_rows]\n"));
            for (column, rows) in &table.held {
                text.push_str(&format!("{} = {rows}\n", quoted(column)));
            }
        }
        text.push('\n');
    }
    configuration_of(text, into)
}

/// The configuration with these sources and the vehicle of the arguments.
fn configuration_of(mut text: String, into: &ImportInto) -> anyhow::Result<Config> {
    if let Some(vehicle) = &into.vehicle {
        text.push_str(&format!("[vehicle]\nfile = {}\n", quoted(vehicle)));
        for (key, value) in [
            ("sensors", &into.sensors),
            ("calibration", &into.calibration),
        ] {
            if let Some(value) = value {
                text.push_str(&format!("{key} = {}\n", quoted(value)));
            }
        }
    }
    let options = [
        ("vehicle.file", "--vehicle"),
        ("vehicle.sensors", "--sensors"),
        ("vehicle.calibration", "--calibration"),
    ];
    let config = Config::from_text(&text, Path::new("."))
        .map_err(|error| super::name_options(error, &options))?;
    super::tell_scope(&config);
    Ok(config)
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// Errors of rows, of which the first ones are reported together.
#[derive(Default)]
struct RowErrors {
    texts: Vec<String>,
    count: usize,
}

impl RowErrors {
    const TEXTS_MAX: usize = 10;

    fn add(&mut self, text: impl FnOnce() -> String) {
        self.count += 1;
        if self.texts.len() < Self::TEXTS_MAX {
            self.texts.push(text());
        }
    }

    fn finish(self) -> anyhow::Result<()> {
        if self.count == 0 {
            return Ok(());
        }
        let more = self.count - self.texts.len();
        let mut text = self.texts.join("\n");
        if more > 0 {
            text.push_str(&format!("\nand {more} more errors"));
        }
        Err(UsageError(text).into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_parts_of_topics_and_differ() {
        let paths = ["a/drive 1.csv", "b/drive 1.csv", ".csv"].map(PathBuf::from);
        assert_eq!(source_names(&paths), ["drive_1", "drive_1_2", "_csv"]);
    }
}
