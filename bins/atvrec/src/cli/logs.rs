//! Commands that read logs: `replay`, `report`, `events`, `cut`, `merge`, `split`, `score`, `info`, `export`,
//! `recover`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use store::align::Method;

use super::{Replace, number};

/// `atvrec replay`.
#[derive(Debug, Args)]
pub struct ReplayArgs {
    /// Logs, in the order in which they were recorded.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Write the raw data and the new estimate to this log.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Use this configuration instead of the one in the log.
    #[arg(short, long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Changes of the log's configuration.
    #[command(flatten)]
    pub changes: ReplayChanges,
    /// Write smoothed estimates too, on the topics /smoothed/... of the new log. A smoothed
    /// estimate also uses the data of at least ten seconds after its time.
    #[arg(long, requires = "output")]
    pub smooth: bool,
    /// Replay at this multiple of real time instead of at full speed.
    #[arg(long, value_name = "FACTOR", value_parser = number::rate, allow_negative_numbers = true)]
    pub rate: Option<f64>,
    /// Play the log to a browser, Foxglove and Lichtblick, with pause, position and speed, until the
    /// program is stopped. The speed at the beginning is --rate [default: 1].
    #[cfg(feature = "live")]
    #[arg(long, conflicts_with_all = ["output", "verify", "smooth", "json"])]
    pub live: bool,
    /// Address and port of the server with --live [default: 127.0.0.1:8765].
    #[cfg(feature = "live")]
    #[arg(long, value_name = "ADDRESS:PORT", requires = "live", value_parser = number::listen_address)]
    pub listen: Option<std::net::SocketAddr>,
    /// File with the token of the server with --live; needed on another address than loopback.
    #[cfg(feature = "live")]
    #[arg(long, value_name = "FILE", requires = "live")]
    pub token_file: Option<PathBuf>,
    /// Compare every message that was decoded or estimated while recording with the repeated one,
    /// bit by bit. The exit code is 1 if one differs.
    #[arg(long)]
    pub verify: bool,
    /// Print the result as JSON.
    #[arg(long)]
    pub json: bool,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// Changes that a replay makes to the log's configuration.
#[derive(Debug, Default, Args)]
#[group(multiple = true, conflicts_with = "config")]
pub struct ReplayChanges {
    /// Use this vehicle file.
    #[arg(long, value_name = "FILE")]
    pub vehicle: Option<PathBuf>,
    /// Apply these overrides (files of `identify -o`) to the vehicle file, after the overrides of
    /// the log's configuration.
    #[arg(long, value_name = "FILE", value_delimiter = ',')]
    pub overrides: Vec<PathBuf>,
    /// Use this sensors file.
    #[arg(long, value_name = "FILE")]
    pub sensors: Option<PathBuf>,
    /// Use this calibration file.
    #[arg(long, value_name = "FILE")]
    pub calibration: Option<PathBuf>,
    /// Payload of the vehicle file that is on the vehicle at the start, instead of those of the log;
    /// can be given several times.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub payload: Vec<String>,
    /// Ignore these inputs too, as if the sensors were not fitted: strain, deflection, imu,
    /// gnss_velocity, gnss_attitude, wheel_speed, steer, ground_speed,
    /// hub_acceleration.
    #[arg(long, value_name = "INPUT", value_delimiter = ',')]
    pub without: Vec<String>,
    /// Use these inputs, although the log's configuration ignores them.
    #[arg(long, value_name = "INPUT", value_delimiter = ',')]
    pub with: Vec<String>,
    /// Estimate the forces with this method: fusion or thesis.
    #[arg(long)]
    pub method: Option<String>,
}

/// Part of a log: `report` and `cut`.
#[derive(Debug, Args)]
pub struct StretchArgs {
    /// Leave out earlier data; seconds from the start of the log.
    #[arg(long = "from", value_name = "SECONDS", value_parser = number::moment_s, allow_negative_numbers = true)]
    pub from_s: Option<f64>,
    /// Leave out later data; seconds from the start of the log.
    #[arg(long = "to", value_name = "SECONDS", value_parser = number::moment_s, allow_negative_numbers = true)]
    pub to_s: Option<f64>,
    /// Only 5 s before and after an event (its number in `atvrec events`, or the first one of a kind) or
    /// the first mark with this text.
    #[arg(long, value_name = "EVENT|MARK", conflicts_with_all = ["from_s", "to_s"])]
    pub around: Option<String>,
}

impl StretchArgs {
    /// As the stretch of a log.
    pub fn of_log(&self) -> report::Stretch<'_> {
        report::Stretch {
            from_s: self.from_s,
            to_s: self.to_s,
            around: self.around.as_deref(),
        }
    }
}

/// `atvrec cut`.
#[derive(Debug, Args)]
#[group(skip)]
#[command(group = clap::ArgGroup::new("part").args(["from_s", "to_s", "around"]).required(true).multiple(true))]
pub struct CutArgs {
    /// Logs of a run: all parts that the stretch is in.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Part of the log.
    #[command(flatten)]
    pub stretch: StretchArgs,
    /// Log to write.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// `atvrec merge`.
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// Logs: parts of a run, or of several runs.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Log to write.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Give sources of later runs that have the name of another source a number: imu, imu_2.
    #[arg(long)]
    pub rename: bool,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// `atvrec split`.
#[derive(Debug, Args)]
#[group(skip)]
#[command(group = clap::ArgGroup::new("where").args(["every_s", "at_marks"]).required(true))]
pub struct SplitArgs {
    /// Logs of a run.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Begin a new log after this time.
    #[arg(long = "every", value_name = "SECONDS", value_parser = number::duration_s, allow_negative_numbers = true)]
    pub every_s: Option<f64>,
    /// Begin a new log at each mark.
    #[arg(long)]
    pub at_marks: bool,
    /// Directory of the new logs.
    #[arg(short = 'o', long = "output", value_name = "DIR")]
    pub directory: PathBuf,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// `atvrec report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Logs, in the order in which they were recorded.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Report to write (HTML); it needs no network.
    #[arg(short, long, default_value = "report.html", value_name = "FILE")]
    pub output: PathBuf,
    /// Part of the log.
    #[command(flatten)]
    pub stretch: StretchArgs,
    /// Draw the estimates of these logs of another run beside this one.
    #[arg(long, value_name = "LOG")]
    pub against: Vec<PathBuf>,
    /// Compare with the other run at the same time or at the same distance.
    #[arg(long, value_enum, default_value = "time", requires = "against")]
    pub by: Axis,
    /// Divide the drive into laps at a gate of 50 m: latitude and longitude in degrees, and perhaps the
    /// heading of travel from north. Several gates divide a lap.
    #[arg(long, value_name = "LAT,LON[,HEADING]", value_parser = number::gate, allow_hyphen_values = true)]
    pub gate: Vec<report::Gate>,
    /// Divide the drive into laps at the place where it began.
    #[arg(long, conflicts_with = "gate")]
    pub laps: bool,
    /// Abscissa of the figures when the page opens.
    #[arg(long, value_enum, default_value = "time")]
    pub axis: Axis,
    /// Picture of the ground below the track: PNG or JPEG with a world file (.pgw, .jgw, .wld) beside it,
    /// in degrees (EPSG:4326) or Web Mercator (EPSG:3857).
    #[arg(long, value_name = "PICTURE")]
    pub map: Option<PathBuf>,
    /// MBTiles file with raster tiles (PNG, JPEG, WebP) of a map, which are drawn below the track. The page
    /// contains at most 25 of them.
    #[arg(long, value_name = "FILE")]
    pub tiles: Option<PathBuf>,
    /// Units: si (N, m/s), metric (kN, km/h), us (lbf, mph); angles are in degrees.
    #[arg(long, value_enum, default_value = "si")]
    pub units: UnitSystem,
    /// Show the smoothed estimates of `replay --smooth` instead of the causal estimates.
    #[arg(long)]
    pub smoothed: bool,
    /// Keep single samples of all curves of a long drive.
    #[arg(long)]
    pub full: bool,
    /// Print the numbers behind the report as JSON, and write no page.
    #[arg(long)]
    pub json: bool,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// What two runs have in common at a point of comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Axis {
    /// Seconds since the start.
    Time,
    /// Metres since the start.
    Distance,
}

/// Units of a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum UnitSystem {
    /// N, m/s, m.
    Si,
    /// kN, km/h, m.
    Metric,
    /// lbf, mph, ft.
    Us,
}

/// `atvrec events`.
#[derive(Debug, Args)]
pub struct EventsArgs {
    /// Logs, in the order in which they were recorded.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Write 5 s before and after each event to this directory, as a log and as JSON.
    #[arg(long, value_name = "DIR", num_args = 0..=1, default_missing_value = "events")]
    pub snapshot: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// `atvrec score`.
#[derive(Debug, Args)]
pub struct ScoreArgs {
    /// Logs, in the order in which they were recorded.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Compare with the estimates of these logs of the same drive instead of with the truth.
    #[arg(long, value_name = "LOG")]
    pub against: Vec<PathBuf>,
    /// Score the smoothed estimates of `replay --smooth` instead of the causal estimates.
    #[arg(long)]
    pub smoothed: bool,
    /// Print only the statistics of the filters' innovations, which need no truth.
    #[arg(long, conflicts_with_all = ["against", "smoothed"])]
    pub innovations: bool,
    /// Score three simple methods on the same samples, too: deflection alone, the thesis's statics,
    /// the vehicle model alone.
    #[arg(long, conflicts_with_all = ["against", "innovations"])]
    pub methods: bool,
    /// Compare the forces after a low-pass, too: Butterworth of fourth order with this corner, forward
    /// and backward, estimate and truth alike.
    #[arg(long = "low-pass", value_name = "HZ", value_parser = number::low_pass_hz, conflicts_with_all = ["against", "innovations"], allow_negative_numbers = true)]
    pub low_pass_hz: Option<f64>,
    /// Ignore the first seconds, in which the estimator converges.
    #[arg(long = "from", default_value = "2", value_name = "SECONDS", value_parser = number::moment_s, allow_negative_numbers = true)]
    pub from_s: f64,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// `atvrec info`.
#[derive(Debug, Args)]
pub struct InfoArgs {
    /// Logs.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// Format of raw data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum RawFormat {
    /// Text of candump (can-utils).
    Candump,
    /// Text log of Vector's tools.
    Asc,
    /// Bytes of a source, as they arrived.
    Bytes,
}

/// `atvrec export`.
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// Logs, in the order in which they were recorded.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Topic to export; `atvrec info` lists the topics of a log. Can be given several times with --wide and
    /// for a .mf4 or .gpx file.
    #[arg(short, long, value_name = "TOPIC")]
    pub topic: Vec<String>,
    /// Export all topics as a dataset of Parquet files in the folders vehicle=/date=/run=/topic= of the
    /// folder DIR. The logs may be of several runs, and the folder may contain other runs. Raw data and the
    /// topics for pictures (/tf, /scene) are not exported.
    #[arg(long, requires = "output", conflicts_with_all = ["topic", "raw", "wide", "ros2"])]
    pub all: bool,
    /// One table of several topics.
    #[command(flatten)]
    pub wide: WideArgs,
    /// Export inertial data, positions, velocities, motion and tyre forces as a ROS 2 bag with MCAP storage:
    /// to a file with .mcap, or to a folder with metadata.yaml.
    #[arg(long, requires = "output", conflicts_with_all = ["topic", "raw", "wide"])]
    pub ros2: bool,
    /// Export what the sources sent instead of a topic: the CAN frames, or the bytes of one source.
    #[arg(long, value_enum, value_name = "FORMAT", conflicts_with = "topic")]
    pub raw: Option<RawFormat>,
    /// With --raw, export this source only; can be given several times for CAN frames.
    #[arg(long, value_name = "NAME", requires = "raw")]
    pub source: Vec<String>,
    /// File to write. A topic: .csv, .parquet or .mat. All or the given topics: .mf4, a channel group for
    /// each. Positions of the receivers: .gpx. With --raw: any name. With --all: a folder. Without this
    /// option, text or bytes go to standard output.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Compress the data of a .mf4 file.
    #[arg(long, requires = "output", conflicts_with_all = ["all", "raw", "ros2"])]
    pub compress: bool,
    /// Ignore earlier data; seconds from the start of the log.
    #[arg(long = "from", value_name = "SECONDS", value_parser = number::moment_s, allow_negative_numbers = true)]
    pub from_s: Option<f64>,
    /// Ignore later data; seconds from the start of the log.
    #[arg(long = "to", value_name = "SECONDS", value_parser = number::moment_s, allow_negative_numbers = true)]
    pub to_s: Option<f64>,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// One table of several topics.
#[derive(Clone, Copy, Debug, Args)]
pub struct WideArgs {
    /// Export the given topics, or all topics that are in the log, as one table at one rate (.csv or
    /// .parquet). A gap is empty.
    #[arg(long, conflicts_with = "raw")]
    pub wide: bool,
    /// Rate of the table with --wide [default: 100].
    #[arg(long = "rate", value_name = "HZ", requires = "wide", value_parser = number::rate_hz, allow_negative_numbers = true)]
    pub rate_hz: Option<f64>,
    /// How --wide computes a value at a time: previous (the last value), linear (interpolation; texts, truth
    /// values and names of values as previous) or nearest [default: previous].
    #[arg(long, value_name = "METHOD", requires = "wide")]
    pub method: Option<Method>,
    /// Longest interval between two values of a column that is no gap, s [default: three times the median
    /// interval of the column, at most 5].
    #[arg(long = "max-gap", value_name = "SECONDS", requires = "wide", value_parser = number::gap_s, allow_negative_numbers = true)]
    pub max_gap_s: Option<f64>,
}

// A paragraph is one line: it is wrapped where it is printed.
const RECOVER_HELP: &str = "\
Recovery saves every chunk with a correct checksum, at any position in the file, and the arrivals in \
the journals of an unfinished log. If a kill cut the end of a log, nothing is lost as long as the \
journals contain the arrivals of that end.

If anything is lost, the original is kept as LOG.damaged beside the recovered log, the loss is printed \
and written into the recovered log (metadata atvrec.recovered), and the exit code is 3.

In a directory, an unfinished log that cannot be recovered (not a log, a directory, a chunk above \
--max-chunk) is renamed to NAME.unrecoverable and is not tried again. If the disk has no space for \
the recovered copy, nothing is changed.";

/// `atvrec recover`.
#[derive(Debug, Args)]
#[command(after_help = RECOVER_HELP)]
pub struct RecoverArgs {
    /// Logs, or directories; in a directory, the unfinished logs (`*.active`) are recovered.
    #[arg(required = true, value_name = "PATH")]
    pub paths: Vec<PathBuf>,
    /// Save also records that no checksum confirms: the beginning of a chunk that was cut, chunks
    /// without a checksum, messages outside of chunks. The recovered log is marked as unchecked.
    #[arg(long)]
    pub unchecked: bool,
}
