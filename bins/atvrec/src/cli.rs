//! The command line.

mod calibrate;
mod examples;
mod files;
mod identify;
mod import;
mod init;
mod logs;
mod number;

use std::path::{Path, PathBuf};

use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Args, Parser, Subcommand};
use sim::Manoeuvre;

pub use calibrate::{CalibrateArgs, CalibrateCommand, CgHeightArgs, MemberArgs};
pub use examples::EXAMPLES;
pub use files::{
    CheckFilesArgs, DrawArgs, GaugesArgs, MassArgs, NewArgs, SensorsCommand, ShowArgs,
    VehicleCommand,
};
pub use identify::{
    IdentifyArgs, IdentifyCommand, IdentifyHandlingArgs, IdentifyLatencyArgs, IdentifyMistakesArgs,
    InertiaArgs, JudgedRunArgs, OutputArgs, PendulumKind, RollCentreArgs, TyreArgs,
};
pub use import::{
    ImportAlogArgs, ImportCanArgs, ImportCommand, ImportCsvArgs, ImportGnssArgs, ImportInto,
    ImportRows, ImportVehicleArgs,
};
pub use init::InitArgs;
pub use logs::{
    Axis, CutArgs, EventsArgs, ExportArgs, InfoArgs, MergeArgs, RawFormat, RecoverArgs, ReplayArgs,
    ReplayChanges, ReportArgs, ScoreArgs, SplitArgs, UnitSystem, WideArgs,
};

const AFTER_HELP: &str = "\
Examples:
  atvrec demo                         record, replay and report a virtual drive
  atvrec init                         find the devices, write atvrec.toml
  atvrec check                        check atvrec.toml and the devices in it
  atvrec record                       record with atvrec.toml until Ctrl-C
  atvrec vehicle new -o vehicle.toml  write a template of a vehicle file
  atvrec replay drive.mcap --verify   repeat the estimate, compare bit by bit
  atvrec simulate --manoeuvre slow-sine -o sine.mcap
  atvrec report drive.mcap -o drive.html

Exit codes:
  0  success
  1  failure
  2  wrong usage or configuration
  3  finished, but data was lost";

/// Record vehicle sensors, estimate tyre forces, and repeat the estimate bit for bit from a log.
#[derive(Debug, Parser)]
#[command(name = "atvrec", version, after_help = AFTER_HELP, max_term_width = 100)]
pub struct Cli {
    /// Print more messages: -v for debug messages, -vv for all messages.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,
    /// Print errors only.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Largest uncompressed chunk, and largest other record, that is read from a log, in MB (2^20
    /// bytes). A log with a larger record is damaged, or was made to exhaust the memory.
    #[arg(
        long,
        global = true,
        hide_short_help = true,
        value_name = "MB",
        default_value_t = store::DEFAULT_MAX_CHUNK >> 20,
        value_parser = clap::value_parser!(u64).range(1..=1 << 20)
    )]
    pub max_chunk: u64,
    /// The command.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Find the devices of this computer and write a configuration for them.
    ///
    /// The command lists CAN interfaces and serial ports, listens to each of them, recognises what they
    /// send, and proposes roles for the signals of DBC files. It writes atvrec.toml, vehicle.toml and
    /// sensors.toml with comments. It does not change a device: a port that sends nothing is only asked
    /// whether it is an SLCAN adapter, whose bus is then read without acknowledging frames.
    Init(InitArgs),
    /// Record all configured sources and estimate tyre forces.
    Record(RecordArgs),
    /// Repeat the estimate from the raw data of a log.
    Replay(ReplayArgs),
    /// Write a self-contained HTML report of a log.
    Report(ReportArgs),
    /// List the events of a log, or write the seconds around each of them.
    Events(EventsArgs),
    /// Write a stretch of a log as a log.
    ///
    /// Its estimates depend on the data before it: `replay --verify` says so, and compares the rest.
    Cut(CutArgs),
    /// Write several logs as one: the parts of a run as they are, several runs by their log times, with
    /// estimates from all of their data.
    Merge(MergeArgs),
    /// Write a log as several ones, of equal duration or from mark to mark, as `cut` does.
    Split(SplitArgs),
    /// Compare the estimates of a log with the truth or another log.
    Score(ScoreArgs),
    /// Record, replay and report a virtual drive, without hardware.
    Demo(DemoArgs),
    /// Run a virtual vehicle on pseudo-terminals and CAN, in real time.
    Virtual(VirtualArgs),
    /// Run a virtual vehicle at full speed and write its data to a log.
    Simulate(SimulateArgs),
    /// Write a topic of a log as a CSV, Parquet or MAT table.
    Export(ExportArgs),
    /// Show the contents of a log.
    Info(InfoArgs),
    /// Check a configuration, and what its devices send or what a log contains.
    ///
    /// The exit code is 0 if the configuration is valid and every device sends messages that are
    /// understood, 1 if a device is missing, silent or not understood, 2 if the configuration is wrong.
    /// With `--with`, it is 1 if something in the log does not fit the configuration.
    Check(CheckArgs),
    /// Calibrate the sensors from workshop logs, step by step.
    ///
    /// Each step adds its values to one calibration file.
    #[command(subcommand)]
    Calibrate(CalibrateCommand),
    /// Recover logs that were cut short or damaged.
    Recover(RecoverArgs),
    /// Identify parameters of the vehicle from logs of drives.
    #[command(subcommand)]
    Identify(IdentifyCommand),
    /// Add a mark to the running recording.
    Mark(MarkArgs),
    /// Show the state of the running recorder: disk, sources, forces, outputs, last events.
    ///
    /// The exit code is 1 if the disk fails, or if there is no recorder.
    Status(StatusArgs),
    /// Show the running recorder in a browser, in Foxglove and in Lichtblick.
    ///
    /// It prints the address of the page. The process listens on the network; the recorder does not. By
    /// default, it listens on 127.0.0.1:8765, where this computer alone reaches it. The table [live] of
    /// the configuration sets address, token and certificate. The process also sends the datagrams of
    /// output.udp. Ctrl-C ends it, and the recorder records on.
    #[cfg(feature = "live")]
    Live(LiveArgs),
    /// Show the running recorder in the terminal, until the key q is pressed.
    #[cfg(feature = "live")]
    Top(TopArgs),
    /// Start writing logs in the running recorder.
    Start(ControlArgs),
    /// Stop writing logs in the running recorder.
    ///
    /// The command returns when the logs are closed. Sources and estimator continue.
    Stop(ControlArgs),
    /// Reload the configuration of the running recorder.
    ///
    /// A new run begins with the new configuration; no frame of an unchanged source is lost. A wrong
    /// configuration is rejected and changes nothing.
    Reload(ControlArgs),
    /// Bring up the CAN interfaces of the configuration.
    ///
    /// The command needs the capability CAP_NET_ADMIN.
    Link(LinkArgs),
    /// Write whether the computer's clock is synchronised to a file.
    ///
    /// For the service, whose recorder may not ask the kernel itself.
    ClockState(ClockStateArgs),
    /// Print, check and draw vehicle files.
    #[command(subcommand)]
    Vehicle(VehicleCommand),
    /// Print and check sensors files.
    #[command(subcommand)]
    Sensors(SensorsCommand),
    /// Import logs and project files of other formats.
    #[command(subcommand)]
    Import(ImportCommand),
    /// Print the completion script of a shell.
    Completions(CompletionsArgs),
    /// Write the manual pages, one for each command.
    Man(ManArgs),
}

/// Permission to replace output files.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct Replace {
    /// Replace output files that exist. An input file is never replaced.
    #[arg(long)]
    pub force: bool,
}

/// `atvrec record`.
#[derive(Debug, Args)]
pub struct RecordArgs {
    /// Configuration file.
    #[arg(short, long, default_value = "atvrec.toml", value_name = "FILE")]
    pub config: PathBuf,
    /// Write the logs to this directory instead of storage.directory of the configuration.
    #[arg(short, long, value_name = "DIR")]
    pub directory: Option<PathBuf>,
    /// Stop after this many seconds.
    #[arg(long = "for", value_name = "SECONDS", value_parser = number::duration_s, allow_negative_numbers = true)]
    pub duration_s: Option<f64>,
    /// Read from this file whether the computer's clock is synchronised, if the kernel does not say so.
    /// `atvrec clock-state` writes the file.
    #[arg(long, value_name = "FILE")]
    pub clock_state: Option<PathBuf>,
    /// Print the summary as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `atvrec demo`.
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Write all files to this directory [default: atvrec-demo, or the first of atvrec-demo-2,
    /// atvrec-demo-3, ... without a demonstration].
    #[arg(short, long, value_name = "DIR")]
    pub directory: Option<PathBuf>,
    /// Manoeuvre of the drive.
    #[arg(long, default_value = "trail", value_name = "NAME", value_parser = manoeuvres())]
    pub manoeuvre: String,
    /// Duration of the drive in real time.
    #[arg(long = "for", default_value = "25", value_name = "SECONDS", value_parser = number::duration_s, allow_negative_numbers = true)]
    pub duration_s: f64,
    /// Seed of the sensor noise.
    #[arg(long, default_value_t = 1, value_parser = number::seed, allow_negative_numbers = true)]
    pub seed: u64,
    /// Do not serve the live page.
    #[cfg(feature = "live")]
    #[arg(long)]
    pub no_live: bool,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// Drive of a virtual vehicle.
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
    /// Follow the motion in this truth file (Parquet or CSV) instead of a manoeuvre.
    #[arg(long, value_name = "FILE")]
    pub truth: Option<PathBuf>,
    /// Road of the manoeuvre: iso8608:A to iso8608:F (roughness, with the seed of --seed), or a road
    /// file (TOML; docs/roads.md). Without it, the manoeuvre has its own ground.
    #[arg(long, value_name = "ROAD", conflicts_with = "truth")]
    pub road: Option<String>,
    /// Vehicle file, or the name of a built-in vehicle.
    #[arg(long, default_value = "prowler", value_name = "FILE")]
    pub vehicle: String,
    /// Sensors file, or the name of a built-in sensor set.
    #[arg(long, default_value = "thesis-10bit", value_name = "FILE")]
    pub sensors: String,
    /// Payload of the vehicle file that is on the vehicle; can be given several times.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub payload: Vec<String>,
    /// Seed of the sensor noise, and of a road iso8608:CLASS; the same seed gives the same bytes.
    #[arg(long, default_value_t = 1, value_parser = number::seed, allow_negative_numbers = true)]
    pub seed: u64,
    /// File with more settings of the virtual vehicle (TOML): sensor errors, faults, delays.
    #[arg(long, value_name = "FILE")]
    pub options: Option<PathBuf>,
    /// Duration of the drive. Only mixed-driving continues after the manoeuvre's own duration.
    #[arg(long = "for", value_name = "SECONDS", value_parser = number::duration_s, allow_negative_numbers = true)]
    pub duration_s: Option<f64>,
}

impl DriveArgs {
    /// Inputs of the simulation.
    pub fn as_drive(&self) -> engine::Result<engine::Drive> {
        let course = match &self.truth {
            Some(path) => engine::Course::Truth(path.clone()),
            None => engine::Course::Manoeuvre(self.manoeuvre.clone().unwrap_or_default()),
        };
        let options = self.options.as_deref().map(engine::read_options);
        Ok(engine::Drive {
            course,
            road: self.road.clone(),
            vehicle: PathBuf::from(&self.vehicle).into(),
            sensors: PathBuf::from(&self.sensors).into(),
            payload: self.payload.clone(),
            seed: self.seed,
            options: options.transpose()?.unwrap_or_default(),
            duration_s: self.duration_s,
        })
    }
}

/// `atvrec virtual`.
#[derive(Debug, Args)]
pub struct VirtualArgs {
    /// Drive.
    #[command(flatten)]
    pub drive: DriveArgs,
    /// Create the links of the ports, and an atvrec.toml for them, in this directory.
    #[arg(short, long, default_value = "virtual-ports", value_name = "DIR")]
    pub directory: PathBuf,
    /// Send the CAN frames to this SocketCAN interface instead of SLCAN on a pseudo-terminal.
    #[arg(long, value_name = "INTERFACE")]
    pub can: Option<String>,
    /// Repeat the manoeuvre until the program is stopped. The vehicle and the clocks of its sensors begin
    /// anew each time, which the estimator takes for faults; `--for` drives some manoeuvres without such
    /// a jump.
    #[arg(long)]
    pub repeat: bool,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// `atvrec simulate`.
#[derive(Debug, Args)]
pub struct SimulateArgs {
    /// Drive.
    #[command(flatten)]
    pub drive: DriveArgs,
    /// Configuration of estimator and decoders; the sources are always those of the virtual vehicle.
    #[arg(short, long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Log to write, or an existing directory. In a directory, logs are rotated and removed as those
    /// of a recording.
    #[arg(short, long, value_name = "LOG|DIRECTORY")]
    pub output: PathBuf,
    /// Write the true calibration of the virtual vehicle to this file.
    #[arg(long, value_name = "FILE")]
    pub true_calibration: Option<PathBuf>,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// `atvrec check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// Configuration file [default: atvrec.toml].
    #[arg(value_name = "FILE")]
    pub file: Option<PathBuf>,
    /// The same as FILE; the option of `record`.
    #[arg(short, long, value_name = "FILE", conflicts_with = "file")]
    pub config: Option<PathBuf>,
    /// Check the file only, not the devices.
    #[arg(long)]
    pub no_devices: bool,
    /// Compare the configuration with this log of about a minute instead of listening to the devices:
    /// loads at rest, direction of gravity, signs, order of the wheels, units, roles without messages.
    /// Several files are the parts of one log.
    #[arg(long = "with", value_name = "LOG")]
    pub with_log: Vec<PathBuf>,
    /// Time in which each device must send data.
    #[arg(long, default_value = "2", value_name = "SECONDS", value_parser = number::listen_s, allow_negative_numbers = true)]
    pub listen_s: f64,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

impl CheckArgs {
    /// Path of the configuration.
    pub fn path(&self) -> &Path {
        let named = self.file.as_deref().or(self.config.as_deref());
        named.unwrap_or(Path::new("atvrec.toml"))
    }
}

/// Control socket of the running recorder.
#[derive(Debug, Args)]
pub struct SocketArgs {
    /// Configuration of the recorder [default: atvrec.toml, else /etc/atvrec/atvrec.toml].
    #[arg(short, long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Log directory of the recorder, if it was started with `record --directory`. It needs no
    /// configuration.
    #[arg(short, long, value_name = "DIR")]
    pub directory: Option<PathBuf>,
    /// Control socket of the recorder, if its configuration is not available.
    #[arg(long, value_name = "PATH", conflicts_with_all = ["config", "directory"])]
    pub socket: Option<PathBuf>,
}

/// `atvrec mark`.
#[derive(Debug, Args)]
pub struct MarkArgs {
    /// Text of the mark.
    pub text: String,
    /// Control socket.
    #[command(flatten)]
    pub socket: SocketArgs,
}

/// `atvrec start`, `atvrec stop` and `atvrec reload`.
#[derive(Debug, Args)]
pub struct ControlArgs {
    /// Control socket.
    #[command(flatten)]
    pub socket: SocketArgs,
}

/// `atvrec status`.
#[derive(Debug, Args)]
pub struct StatusArgs {
    /// Control socket.
    #[command(flatten)]
    pub socket: SocketArgs,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// `atvrec live`.
#[cfg(feature = "live")]
#[derive(Debug, Args)]
pub struct LiveArgs {
    /// Recorder.
    #[command(flatten)]
    pub socket: SocketArgs,
    /// Listen on this address and port instead of live.address of the configuration. Other addresses
    /// than those of loopback need a token.
    #[arg(long, value_name = "ADDRESS:PORT", value_parser = number::listen_address)]
    pub listen: Option<std::net::SocketAddr>,
    /// File with the token, instead of live.token_file of the configuration.
    #[arg(long, value_name = "FILE")]
    pub token_file: Option<PathBuf>,
}

/// `atvrec top`.
#[cfg(feature = "live")]
#[derive(Debug, Args)]
pub struct TopArgs {
    /// Recorder.
    #[command(flatten)]
    pub socket: SocketArgs,
    /// Show the state once and exit.
    #[arg(long)]
    pub once: bool,
}

/// `atvrec link`.
#[derive(Debug, Args)]
pub struct LinkArgs {
    /// Bring up only these interfaces. An interface without a source is ignored [default: all].
    #[arg(value_name = "INTERFACE")]
    pub interfaces: Vec<String>,
    /// Configuration file.
    #[arg(short, long, default_value = "atvrec.toml", value_name = "FILE")]
    pub config: PathBuf,
}

/// `atvrec clock-state`.
#[derive(Debug, Args)]
pub struct ClockStateArgs {
    /// File for the state; it is replaced.
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
}

/// `atvrec completions`.
#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// Shell.
    pub shell: clap_complete::Shell,
}

/// `atvrec man`.
#[derive(Debug, Args)]
pub struct ManArgs {
    /// Directory of the pages; it is created if it does not exist.
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
    fn the_definition_is_consistent() {
        Cli::command().debug_assert();
    }
}
