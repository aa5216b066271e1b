//! The command line.

mod identify;
mod import;
mod number;

use std::path::{Path, PathBuf};

use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Args, Parser, Subcommand};
use sim::Manoeuvre;

pub use identify::{
    IdentifyArgs, IdentifyCommand, IdentifyHandlingArgs, InertiaArgs, PendulumKind, RollCentreArgs,
    TellArgs,
};
pub use import::{ImportAlogArgs, ImportCommand, ImportCsvArgs, ImportInto, ImportVehicleArgs};

const AFTER_HELP: &str = "\
Examples:
  atvrec demo                              a virtual drive, recorded, replayed and reported
  atvrec check                             look at atvrec.toml and at the devices it names
  atvrec record                            record with ./atvrec.toml until Ctrl-C
  atvrec replay drive.mcap --verify        make the estimate again and compare bit by bit
  atvrec simulate --manoeuvre slow-sine -o sine.mcap
  atvrec report drive.mcap -o drive.html

Exit codes: 0 good, 1 failed, 2 wrong usage or configuration, 3 finished with data loss.";

/// Records a vehicle's sensors, estimates its tyre forces while it records, and makes the same
/// estimate again from the recording.
#[derive(Debug, Parser)]
#[command(name = "atvrec", version, after_help = AFTER_HELP, max_term_width = 100)]
pub struct Cli {
    /// Say more: -v debug, -vv every detail.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,
    /// Say only what went wrong.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Largest chunk of a log when inflated, and largest other record, in MB (2^20 bytes). A log with a
    /// larger one is damaged or was made to exhaust memory.
    #[arg(
        long,
        global = true,
        hide_short_help = true,
        value_name = "MB",
        default_value_t = store::DEFAULT_MAX_CHUNK >> 20,
        value_parser = clap::value_parser!(u64).range(1..=1 << 20)
    )]
    pub max_chunk: u64,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The verbs.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Record all configured sources and estimate while recording.
    Record(RecordArgs),
    /// Make the estimate again from a log's raw bytes.
    Replay(ReplayArgs),
    /// Write a self-contained HTML report of a log.
    Report(ReportArgs),
    /// Compare the estimates of a log with its truth, or with another log's estimates.
    Score(ScoreArgs),
    /// Show the whole chain without hardware: virtual vehicle, record, replay, report.
    Demo(DemoArgs),
    /// Drive a virtual vehicle whose sensors speak on pseudo-terminals and CAN, in real time.
    Virtual(VirtualArgs),
    /// Drive a virtual vehicle at full speed straight into a log.
    Simulate(SimulateArgs),
    /// Write a topic of a log as a table: CSV or Parquet.
    Export(ExportArgs),
    /// Tell what a log holds.
    Info(InfoArgs),
    /// Look for errors in a configuration and for the devices that it names.
    ///
    /// Exits 0 if there is no error and every device answers, 1 if a device is missing or silent,
    /// 2 if the configuration is wrong.
    Check(CheckArgs),
    /// Find offsets, gains and mounting from workshop logs, step by step into one file.
    #[command(subcommand)]
    Calibrate(CalibrateCommand),
    /// Make cut-short logs whole.
    Recover(RecoverArgs),
    /// Find parameters of the vehicle in logs of drives.
    #[command(subcommand)]
    Identify(IdentifyCommand),
    /// Set a mark in the running recording.
    Mark(MarkArgs),
    /// Show how the running recorder does.
    Status(StatusArgs),
    /// Begin to write, until `stop`.
    Start(OrderArgs),
    /// End writing; sources and estimator go on.
    Stop(OrderArgs),
    /// Let the running recorder read its configuration again, without losing a frame.
    Reload(OrderArgs),
    /// Bring the configuration's CAN interfaces up; needs CAP_NET_ADMIN.
    Link(LinkArgs),
    /// Make logs and project files from others' formats.
    #[command(subcommand)]
    Import(ImportCommand),
    /// Print a completion script for a shell.
    Completions(CompletionsArgs),
    /// Write the manual pages, one for each command.
    Man(ManArgs),
}

/// Whether outputs may replace files.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct Replace {
    /// Replace output files that exist. An input is never replaced.
    #[arg(long)]
    pub force: bool,
}

/// `atvrec record`.
#[derive(Debug, Args)]
pub struct RecordArgs {
    /// Configuration.
    #[arg(short, long, default_value = "atvrec.toml", value_name = "FILE")]
    pub config: PathBuf,
    /// Write logs here instead of the configuration's storage.directory.
    #[arg(short, long, value_name = "DIR")]
    pub directory: Option<PathBuf>,
    /// Stop after this many seconds.
    #[arg(long = "for", value_name = "SECONDS", value_parser = number::duration_s, allow_negative_numbers = true)]
    pub duration_s: Option<f64>,
    /// Print the summary as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `atvrec replay`.
#[derive(Debug, Args)]
pub struct ReplayArgs {
    /// Logs, in the order in which they were recorded.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Write the raw bytes and the new estimate to this log.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Use this configuration instead of the one in the log.
    #[arg(short, long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// What to tell the estimator otherwise than while recording.
    #[command(flatten)]
    pub changes: ReplayChanges,
    /// Smooth too: estimates that also know the ten seconds and more after their instant, on
    /// /smoothed/... of the new log.
    #[arg(long, requires = "output")]
    pub smooth: bool,
    /// Replay at this multiple of real time instead of at full speed.
    #[arg(long, value_name = "FACTOR", value_parser = number::rate, allow_negative_numbers = true)]
    pub rate: Option<f64>,
    /// Compare with what was decoded and estimated while recording; exit 1 unless every message
    /// is bit-identical.
    #[arg(long)]
    pub verify: bool,
    /// Print the result as JSON.
    #[arg(long)]
    pub json: bool,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// What a replay tells the estimator in the place of what the log's configuration says.
#[derive(Debug, Default, Args)]
#[group(multiple = true, conflicts_with = "config")]
pub struct ReplayChanges {
    /// Take this vehicle file.
    #[arg(long, value_name = "FILE")]
    pub vehicle: Option<PathBuf>,
    /// Put what `identify -o` found into the vehicle file, after what the log's configuration names.
    #[arg(long, value_name = "FILE", value_delimiter = ',')]
    pub overrides: Vec<PathBuf>,
    /// Take this sensors file.
    #[arg(long, value_name = "FILE")]
    pub sensors: Option<PathBuf>,
    /// Take this calibration.
    #[arg(long, value_name = "FILE")]
    pub calibration: Option<PathBuf>,
    /// Leave these inputs out too, as if they were not fitted: strain, deflection, imu,
    /// gnss_velocity, gnss_attitude, wheel_speed, steer, ground_speed.
    #[arg(long, value_name = "INPUT", value_delimiter = ',')]
    pub without: Vec<String>,
    /// Take these inputs in, although the log's configuration ignores them.
    #[arg(long, value_name = "INPUT", value_delimiter = ',')]
    pub with: Vec<String>,
    /// Estimate forces by this method: fusion or thesis.
    #[arg(long)]
    pub method: Option<String>,
}

/// `atvrec report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Logs, in the order in which they were recorded.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// The report; it needs no network.
    #[arg(short, long, default_value = "report.html", value_name = "FILE")]
    pub output: PathBuf,
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
    /// Judge the smoothed estimates of `replay --smooth` instead of the causal ones.
    #[arg(long)]
    pub smoothed: bool,
    /// Tell only how large the filters' innovations are, which needs no truth.
    #[arg(long, conflicts_with_all = ["against", "smoothed"])]
    pub innovations: bool,
    /// Leave out the first seconds, while the estimator settles.
    #[arg(long = "from", default_value = "2", value_name = "SECONDS", value_parser = number::moment_s, allow_negative_numbers = true)]
    pub from_s: f64,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// `atvrec demo`.
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Put everything here; without it, atvrec-demo, or the first of atvrec-demo-2, -3, ... that
    /// holds no demonstration yet.
    #[arg(short, long, value_name = "DIR")]
    pub directory: Option<PathBuf>,
    /// Manoeuvre to drive.
    #[arg(long, default_value = "slow-sine", value_name = "NAME", value_parser = manoeuvres())]
    pub manoeuvre: String,
    /// Seconds to drive, in real time.
    #[arg(long = "for", default_value = "25", value_name = "SECONDS", value_parser = number::duration_s, allow_negative_numbers = true)]
    pub duration_s: f64,
    /// Seed of the sensors' noise.
    #[arg(long, default_value_t = 1, value_parser = number::seed, allow_negative_numbers = true)]
    pub seed: u64,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// What a virtual vehicle drives.
#[derive(Debug, Args)]
pub struct DriveArgs {
    /// Manoeuvre.
    #[arg(
        short,
        long,
        alias = "maneuver",
        value_name = "NAME",
        value_parser = manoeuvres(),
        required_unless_present = "truth",
        conflicts_with = "truth"
    )]
    pub manoeuvre: Option<String>,
    /// Follow a truth file (Parquet or CSV) instead.
    #[arg(long, value_name = "FILE")]
    pub truth: Option<PathBuf>,
    /// Vehicle file, or the name of one that ships with the program.
    #[arg(long, default_value = "prowler", value_name = "FILE")]
    pub vehicle: String,
    /// Sensors file, or the name of one that ships with the program.
    #[arg(long, default_value = "thesis-10bit", value_name = "FILE")]
    pub sensors: String,
    /// Seed of the sensors' noise; the same seed gives the same bytes.
    #[arg(long, default_value_t = 1, value_parser = number::seed, allow_negative_numbers = true)]
    pub seed: u64,
    /// Further settings of the virtual vehicle (TOML): hidden errors, faults, delays.
    #[arg(long, value_name = "FILE")]
    pub options: Option<PathBuf>,
    /// Drive for this long; beyond the manoeuvre's own duration only mixed-driving goes on.
    #[arg(long = "for", value_name = "SECONDS", value_parser = number::duration_s, allow_negative_numbers = true)]
    pub duration_s: Option<f64>,
}

impl DriveArgs {
    /// What the engine makes of it.
    pub fn as_drive(&self) -> engine::Result<engine::Drive> {
        let course = match &self.truth {
            Some(path) => engine::Course::Truth(path.clone()),
            None => engine::Course::Manoeuvre(self.manoeuvre.clone().unwrap_or_default()),
        };
        let options = self.options.as_deref().map(engine::read_options);
        Ok(engine::Drive {
            course,
            vehicle: self.vehicle.clone(),
            sensors: self.sensors.clone(),
            seed: self.seed,
            options: options.transpose()?.unwrap_or_default(),
            duration_s: self.duration_s,
        })
    }
}

/// `atvrec virtual`.
#[derive(Debug, Args)]
pub struct VirtualArgs {
    /// What to drive.
    #[command(flatten)]
    pub drive: DriveArgs,
    /// Make the ports' links and a fitting atvrec.toml here.
    #[arg(short, long, default_value = "virtual-ports", value_name = "DIR")]
    pub directory: PathBuf,
    /// Send the CAN frames to this SocketCAN interface instead of SLCAN on a pseudo-terminal.
    #[arg(long, value_name = "INTERFACE")]
    pub can: Option<String>,
    /// Start over when the manoeuvre ends.
    #[arg(long)]
    pub repeat: bool,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// `atvrec simulate`.
#[derive(Debug, Args)]
pub struct SimulateArgs {
    /// What to drive.
    #[command(flatten)]
    pub drive: DriveArgs,
    /// Estimator and decoder settings; sources are the virtual vehicle's own.
    #[arg(short, long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// The log to write; or a directory that is there, for files that are rotated and kept within
    /// limits as those of a recording.
    #[arg(short, long, value_name = "LOG|DIRECTORY")]
    pub output: PathBuf,
    /// Write the calibration that a perfect workshop would find to this file.
    #[arg(long, value_name = "FILE")]
    pub true_calibration: Option<PathBuf>,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
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

/// `atvrec export`.
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// Logs, in the order in which they were recorded.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// The topic; `atvrec info` lists them.
    #[arg(short, long, value_name = "TOPIC")]
    pub topic: String,
    /// The table, CSV or Parquet by the ending of its name; CSV on standard output without one.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Leave out what is earlier, in seconds from the log's start.
    #[arg(long = "from", value_name = "SECONDS", value_parser = number::moment_s, allow_negative_numbers = true)]
    pub from_s: Option<f64>,
    /// Leave out what is later, in seconds from the log's start.
    #[arg(long = "to", value_name = "SECONDS", value_parser = number::moment_s, allow_negative_numbers = true)]
    pub to_s: Option<f64>,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// `atvrec check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// Configuration; `atvrec.toml` if none is named.
    #[arg(value_name = "FILE")]
    pub file: Option<PathBuf>,
    /// The same as FILE, as `record` takes it.
    #[arg(short, long, value_name = "FILE", conflicts_with = "file")]
    pub config: Option<PathBuf>,
    /// Look at the file only, not at the devices.
    #[arg(long)]
    pub no_devices: bool,
    /// Listen to each device for this long.
    #[arg(long, default_value = "2", value_name = "SECONDS", value_parser = number::listen_s, allow_negative_numbers = true)]
    pub listen_s: f64,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

impl CheckArgs {
    /// The configuration that is meant.
    pub fn path(&self) -> &Path {
        let named = self.file.as_deref().or(self.config.as_deref());
        named.unwrap_or(Path::new("atvrec.toml"))
    }
}

/// `atvrec calibrate`.
#[derive(Debug, Subcommand)]
pub enum CalibrateCommand {
    /// Zeros of strain bridges and potentiometers, and what is wrong with a channel, from wheels
    /// that hang free.
    Zero(ZeroArgs),
    /// Preload, rate and friction of the springs, from three loads or more on four scales.
    Weight(WeightArgs),
    /// Steering maps, play and centre, from turn plates.
    Steer(SteerArgs),
    /// Gains and wiring of the strain bridges, from known forces on each wheel.
    LoadRig(CalibrateArgs),
    /// Bias and misalignment of the inertial unit, from rest in two opposite headings and driving.
    Imu(CalibrateArgs),
    /// Antenna places and latencies of the receivers, from a drive with turns.
    Gnss(CalibrateArgs),
    /// Rolling radius of each wheel, from straight and even driving with GNSS.
    WheelRadius(CalibrateArgs),
}

impl CalibrateCommand {
    /// What all steps take.
    pub fn shared(&self) -> &CalibrateArgs {
        match self {
            Self::Zero(args) => &args.shared,
            Self::Weight(args) => &args.shared,
            Self::Steer(args) => &args.shared,
            Self::LoadRig(args) | Self::Imu(args) | Self::Gnss(args) | Self::WheelRadius(args) => {
                args
            }
        }
    }
}

/// What all steps of `atvrec calibrate` take.
#[derive(Debug, Args)]
pub struct CalibrateArgs {
    /// Logs of the step, all of one vehicle.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Calibration file; what other steps wrote is kept.
    #[arg(short, long, default_value = "calibration.toml", value_name = "FILE")]
    pub output: PathBuf,
    /// Write a page with figures.
    #[arg(long, value_name = "HTML")]
    pub report: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// `atvrec calibrate zero`.
#[derive(Debug, Args)]
pub struct ZeroArgs {
    /// What all steps take.
    #[command(flatten)]
    pub shared: CalibrateArgs,
    /// How well the weight of the hanging parts is known: standard deviation as a part of it.
    #[arg(long, default_value = "0.02", value_name = "PART", value_parser = number::part, allow_negative_numbers = true)]
    pub weight_sigma: f64,
}

/// `atvrec calibrate weight`.
#[derive(Debug, Args)]
pub struct WeightArgs {
    /// What all steps take.
    #[command(flatten)]
    pub shared: CalibrateArgs,
    /// Scales FL,FR,RL,RR in N (or "... kg"), once for each log in the logs' order; without it the
    /// logs' marks `scales FL FR RL RR` are taken.
    #[arg(long, value_name = "LOADS")]
    pub scales: Vec<String>,
}

/// `atvrec calibrate steer`.
#[derive(Debug, Args)]
pub struct SteerArgs {
    /// What all steps take.
    #[command(flatten)]
    pub shared: CalibrateArgs,
    /// How well a plate is read, degrees.
    #[arg(long, default_value = "0.1", value_name = "DEGREES", value_parser = number::angle_deg, allow_negative_numbers = true)]
    pub plate_sigma_deg: f64,
}

const RECOVER_HELP: &str = "\
Recovery saves every chunk whose checksum is right, wherever it stands in the file, and the arrivals
that the journals beside an unfinished log hold. Bytes at the end of a log that a kill cut are no loss
if the journals hold their arrivals. If anything else is lost, the original stays as LOG.damaged beside
the recovered log, the loss is printed and written into the log (metadata atvrec.recovered), and the
exit code is 3.

An unfinished log of a directory that cannot be recovered (another kind of file, a directory, a chunk
above --max-chunk) is renamed to NAME.unrecoverable and not tried again. If the disk has no room for the
recovered copy, nothing is changed.";

/// `atvrec recover`.
#[derive(Debug, Args)]
#[command(after_help = RECOVER_HELP)]
pub struct RecoverArgs {
    /// Logs, or directories whose unfinished logs (`*.active`) are meant.
    #[arg(required = true, value_name = "PATH")]
    pub paths: Vec<PathBuf>,
    /// Save records too that no checksum confirms: the beginning of a chunk that was cut, chunks
    /// without a checksum, messages outside of chunks. The recovered log is marked as unchecked.
    #[arg(long)]
    pub unchecked: bool,
}

/// Where the running recorder listens.
#[derive(Debug, Args)]
pub struct SocketArgs {
    /// Configuration of the recorder [default: atvrec.toml, else /etc/atvrec/atvrec.toml].
    #[arg(short, long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Storage directory of the recorder, if `record --directory` replaced the configuration's.
    #[arg(short, long, value_name = "DIR")]
    pub directory: Option<PathBuf>,
    /// Its control socket, if the configuration is not at hand.
    #[arg(long, value_name = "PATH", conflicts_with_all = ["config", "directory"])]
    pub socket: Option<PathBuf>,
}

/// `atvrec mark`.
#[derive(Debug, Args)]
pub struct MarkArgs {
    /// Text of the mark.
    pub text: String,
    /// Where the recorder listens.
    #[command(flatten)]
    pub socket: SocketArgs,
}

/// `atvrec start`, `atvrec stop` and `atvrec reload`.
#[derive(Debug, Args)]
pub struct OrderArgs {
    /// Where the recorder listens.
    #[command(flatten)]
    pub socket: SocketArgs,
}

/// `atvrec status`.
#[derive(Debug, Args)]
pub struct StatusArgs {
    /// Where the recorder listens.
    #[command(flatten)]
    pub socket: SocketArgs,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// `atvrec link`.
#[derive(Debug, Args)]
pub struct LinkArgs {
    /// Only these; one that no source reads is left alone.
    #[arg(value_name = "INTERFACE")]
    pub interfaces: Vec<String>,
    /// Configuration.
    #[arg(short, long, default_value = "atvrec.toml", value_name = "FILE")]
    pub config: PathBuf,
}

/// `atvrec completions`.
#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// The shell.
    pub shell: clap_complete::Shell,
}

/// `atvrec man`.
#[derive(Debug, Args)]
pub struct ManArgs {
    /// Where to; it is made if it is not there.
    #[arg(value_name = "DIR")]
    pub directory: PathBuf,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

fn manoeuvres() -> PossibleValuesParser {
    let value = |one: Manoeuvre| PossibleValue::new(one.name()).help(one.description());
    PossibleValuesParser::new(Manoeuvre::ALL.map(value))
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_definition_is_sound() {
        Cli::command().debug_assert();
    }
}
