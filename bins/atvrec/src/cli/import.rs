//! `atvrec import`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::Replace;

/// `atvrec import`.
#[derive(Debug, Subcommand)]
pub enum ImportCommand {
    /// Convert the params.json of a multi-body simulator to a vehicle file.
    Vehicle(ImportVehicleArgs),
    /// Convert delimited text to a log; a column map assigns the columns to quantities.
    Csv(ImportCsvArgs),
    /// Convert a MOOS .alog file to a log.
    Alog(ImportAlogArgs),
    /// Convert a log of candump (can-utils) to a log.
    Candump(ImportCanArgs),
    /// Convert an ASC log of Vector's tools to a log.
    Asc(ImportCanArgs),
    /// Convert a TRC log of PEAK-System's tools to a log.
    Trc(ImportCanArgs),
    /// Convert a BLF log of Vector's tools to a log.
    Blf(ImportCanArgs),
    /// Convert an MF4 file with CAN frames to a log; with a column map, one with measured signals.
    Mf4(ImportMf4Args),
    /// Convert the raw output of a GNSS receiver (NovAtel, SBF, UBX, NMEA) to a log.
    Gnss(ImportGnssArgs),
}

/// `atvrec import csv`.
#[derive(Debug, Args)]
pub struct ImportCsvArgs {
    /// Files of one drive; the times in all files must be of the same clock.
    #[arg(required = true, value_name = "FILE.csv")]
    pub input: Vec<PathBuf>,
    /// Column map: one for all files, or one for each file (see docs/import.md).
    #[arg(long, required = true, value_name = "MAP.toml")]
    pub columns: Vec<PathBuf>,
    /// Log to write.
    #[command(flatten)]
    pub into: ImportInto,
    /// Treatment of the rows.
    #[command(flatten)]
    pub rows: ImportRows,
}

/// `atvrec import alog`.
#[derive(Debug, Args)]
pub struct ImportAlogArgs {
    /// File to convert.
    #[arg(value_name = "FILE.alog")]
    pub input: PathBuf,
    /// Map of the variables [default: the variable names of Auburn's GAVLab].
    #[arg(long, value_name = "MAP.toml")]
    pub columns: Option<PathBuf>,
    /// Log to write.
    #[command(flatten)]
    pub into: ImportInto,
    /// Treatment of the lines.
    #[command(flatten)]
    pub rows: ImportRows,
}

/// `atvrec import gnss`.
#[derive(Debug, Args)]
pub struct ImportGnssArgs {
    /// File with what the receiver sent.
    #[arg(value_name = "FILE")]
    pub input: PathBuf,
    /// Log to write.
    #[command(flatten)]
    pub into: ImportInto,
}

/// Log that an import writes.
#[derive(Debug, Args)]
pub struct ImportInto {
    /// Vehicle file, or the name of a built-in vehicle. Without a vehicle, nothing is estimated.
    #[arg(long, value_name = "FILE", conflicts_with = "config")]
    pub vehicle: Option<String>,
    /// Sensors file, or the name of a built-in sensor set.
    #[arg(long, value_name = "FILE", requires = "vehicle")]
    pub sensors: Option<String>,
    /// Calibration file.
    #[arg(long, value_name = "FILE", requires = "vehicle")]
    pub calibration: Option<String>,
    /// Configuration file; it must contain the imported sources.
    #[arg(short, long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Log to write.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// Treatment of the rows of a table.
#[derive(Clone, Copy, Debug, Args)]
pub struct ImportRows {
    /// Write one run for the rows on each side of a gap of more than 1 h: NAME-1.mcap,
    /// NAME-2.mcap, ... Without this option, such a gap is an error.
    #[arg(long)]
    pub split_gaps: bool,
    /// Import values whose units cannot be right. Without this option, they are an error.
    #[arg(long)]
    pub accept_units: bool,
}

/// `atvrec import candump`, `asc`, `trc`, `blf` and `mf4`.
#[derive(Debug, Args)]
pub struct ImportCanArgs {
    /// Logs of one drive; the times in all logs must be of the same clock.
    #[arg(required = true, value_name = "FILE")]
    pub input: Vec<PathBuf>,
    /// DBC file of all buses on which it knows an identifier, or of the bus with this name; can be
    /// given several times. Without DBC file, the log has raw frames only.
    #[arg(long, value_name = "[BUS=]FILE", conflicts_with = "config")]
    pub dbc: Vec<String>,
    /// Log to write.
    #[command(flatten)]
    pub into: ImportInto,
}

/// `atvrec import mf4`.
#[derive(Debug, Args)]
pub struct ImportMf4Args {
    /// Files and log.
    #[command(flatten)]
    pub frames: ImportCanArgs,
    /// Column map of the measured signals: one for all files, or one for each file (see
    /// docs/import.md). Without a map, the CAN frames of the files are imported.
    #[arg(long, value_name = "MAP.toml", conflicts_with = "dbc")]
    pub columns: Vec<PathBuf>,
    /// Treatment of the rows of measured signals.
    #[command(flatten)]
    pub rows: ImportRows,
}

/// `atvrec import vehicle`.
#[derive(Debug, Args)]
pub struct ImportVehicleArgs {
    /// Parameters of the simulator.
    #[arg(value_name = "PARAMS.json")]
    pub input: PathBuf,
    /// Vehicle file to write.
    #[arg(short, long, default_value = "vehicle.toml", value_name = "FILE")]
    pub output: PathBuf,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}
