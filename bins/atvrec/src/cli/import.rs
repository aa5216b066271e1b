//! `atvrec import`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::Replace;

/// `atvrec import`.
#[derive(Debug, Subcommand)]
pub enum ImportCommand {
    /// A vehicle file from a multi-body simulator's params.json.
    Vehicle(ImportVehicleArgs),
    /// A log from delimited text; a column map says what the columns are.
    Csv(ImportCsvArgs),
    /// A log from a MOOS .alog file.
    Alog(ImportAlogArgs),
}

/// `atvrec import csv`.
#[derive(Debug, Args)]
pub struct ImportCsvArgs {
    /// Files of one drive, with times of one clock.
    #[arg(required = true, value_name = "FILE.csv")]
    pub input: Vec<PathBuf>,
    /// What the columns mean; one map for all files, or one for each (docs/import.md).
    #[arg(long, required = true, value_name = "MAP.toml")]
    pub columns: Vec<PathBuf>,
    /// What to make.
    #[command(flatten)]
    pub into: ImportInto,
}

/// `atvrec import alog`.
#[derive(Debug, Args)]
pub struct ImportAlogArgs {
    /// The file.
    #[arg(value_name = "FILE.alog")]
    pub input: PathBuf,
    /// What the variables mean; without it, the names of Auburn's GAVLab.
    #[arg(long, value_name = "MAP.toml")]
    pub columns: Option<PathBuf>,
    /// What to make.
    #[command(flatten)]
    pub into: ImportInto,
}

/// The log that an import makes.
#[derive(Debug, Args)]
pub struct ImportInto {
    /// Vehicle file, or the name of one that ships with the program; without it nothing is
    /// estimated.
    #[arg(long, value_name = "FILE", conflicts_with = "config")]
    pub vehicle: Option<String>,
    /// Sensors file, or the name of one that ships with the program.
    #[arg(long, value_name = "FILE", requires = "vehicle")]
    pub sensors: Option<String>,
    /// Calibration file.
    #[arg(long, value_name = "FILE", requires = "vehicle")]
    pub calibration: Option<String>,
    /// Use this configuration; it must have the imported sources.
    #[arg(short, long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// The log to write.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Make a run of its own, NAME-1.mcap, NAME-2.mcap, ..., of the rows on each side of a gap over
    /// 1 h, which is an error otherwise.
    #[arg(long)]
    pub split_gaps: bool,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// `atvrec import vehicle`.
#[derive(Debug, Args)]
pub struct ImportVehicleArgs {
    /// The simulator's parameters.
    #[arg(value_name = "PARAMS.json")]
    pub input: PathBuf,
    /// The vehicle file to write.
    #[arg(short, long, default_value = "vehicle.toml", value_name = "FILE")]
    pub output: PathBuf,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}
