//! The command line.

mod examples;
mod files;
mod identify;
mod import;
mod init;
mod number;

use std::path::{Path, PathBuf};

use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Args, Parser, Subcommand, ValueEnum};
use sim::Manoeuvre;

pub use examples::EXAMPLES;
pub use files::{CheckFilesArgs, DrawArgs, NewArgs, SensorsCommand, ShowArgs, VehicleCommand};
pub use identify::{
    IdentifyArgs, IdentifyCommand, IdentifyHandlingArgs, InertiaArgs, OutputArgs, PendulumKind,
    RollCentreArgs,
};
pub use import::{ImportAlogArgs, ImportCommand, ImportCsvArgs, ImportInto, ImportVehicleArgs};
pub use init::InitArgs;

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
    /// Compare the estimates of a log with the truth or another log.
    Score(ScoreArgs),
    /// Record, replay and report a virtual drive, without hardware.
    Demo(DemoArgs),
    /// Run a virtual vehicle on pseudo-terminals and CAN, in real time.
    Virtual(VirtualArgs),
    /// Run a virtual vehicle at full speed and write its data to a log.
    Simulate(SimulateArgs),
    /// Write a topic of a log as a CSV or Parquet table.
    Export(ExportArgs),
    /// Show the contents of a log.
    Info(InfoArgs),
    /// Check a configuration, and what its devices send.
    ///
    /// The exit code is 0 if the configuration is valid and every device sends messages that are
    /// understood, 1 if a device is missing, silent or not understood, 2 if the configuration is wrong.
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

/// `atvrec report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Logs, in the order in which they were recorded.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Report to write (HTML); it needs no network.
    #[arg(short, long, default_value = "report.html", value_name = "FILE")]
    pub output: PathBuf,
    /// Leave out earlier data; seconds from the start of the log.
    #[arg(long = "from", value_name = "SECONDS", value_parser = number::moment_s, allow_negative_numbers = true)]
    pub from_s: Option<f64>,
    /// Leave out later data; seconds from the start of the log.
    #[arg(long = "to", value_name = "SECONDS", value_parser = number::moment_s, allow_negative_numbers = true)]
    pub to_s: Option<f64>,
    /// Show only 5 s around an event: its number in `atvrec events`, or the first one of a kind.
    #[arg(long, value_name = "EVENT", conflicts_with_all = ["from_s", "to_s"])]
    pub around: Option<String>,
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
    /// Topic to export; `atvrec info` lists the topics of a log.
    #[arg(short, long, value_name = "TOPIC")]
    pub topic: String,
    /// Table to write: .csv or .parquet. Without this option, CSV goes to standard output.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
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

/// `atvrec calibrate`.
#[derive(Debug, Subcommand)]
pub enum CalibrateCommand {
    /// Zero offsets of strain bridges and potentiometers, and faults of their channels, with the
    /// wheels hanging free.
    Zero(ZeroArgs),
    /// Preload, rate and friction of the springs, from three or more loads on four scales.
    Weight(WeightArgs),
    /// Steering maps, play and centre position, from turn plates.
    Steer(SteerArgs),
    /// Gains and wiring of the strain bridges, from known forces on each wheel.
    LoadRig(CalibrateArgs),
    /// Bias and misalignment of the inertial unit, from rest in two opposite headings and a drive.
    Imu(CalibrateArgs),
    /// Antenna positions and latencies of the GNSS receivers, from a drive with turns.
    Gnss(CalibrateArgs),
    /// Rolling radius of each wheel, from straight driving at constant speed with GNSS.
    WheelRadius(CalibrateArgs),
    /// Bias and axes of the hub accelerometers, from rest and a drive with braking and turns.
    Hub(CalibrateArgs),
}

impl CalibrateCommand {
    /// Arguments that all steps share.
    pub fn shared(&self) -> &CalibrateArgs {
        match self {
            Self::Zero(args) => &args.shared,
            Self::Weight(args) => &args.shared,
            Self::Steer(args) => &args.shared,
            Self::LoadRig(args)
            | Self::Imu(args)
            | Self::Gnss(args)
            | Self::WheelRadius(args)
            | Self::Hub(args) => args,
        }
    }
}

/// Arguments that all steps of `atvrec calibrate` share.
#[derive(Debug, Args)]
pub struct CalibrateArgs {
    /// Logs of the step, all of one vehicle.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Calibration file to write; values of other steps in it are kept.
    #[arg(short, long, default_value = "calibration.toml", value_name = "FILE")]
    pub output: PathBuf,
    /// Write a page with figures (HTML).
    #[arg(long, value_name = "FILE")]
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
    /// Arguments that all steps share.
    #[command(flatten)]
    pub shared: CalibrateArgs,
    /// Standard deviation of the weight of the hanging parts, as a fraction of the weight.
    #[arg(long, default_value = "0.02", value_name = "FRACTION", value_parser = number::fraction, allow_negative_numbers = true)]
    pub weight_sigma: f64,
}

/// `atvrec calibrate weight`.
#[derive(Debug, Args)]
pub struct WeightArgs {
    /// Arguments that all steps share.
    #[command(flatten)]
    pub shared: CalibrateArgs,
    /// Scale readings FL,FR,RL,RR in N (or "... kg"), once for each log, in the order of the logs.
    /// Without this option, the marks `scales FL FR RL RR` in the logs are used.
    #[arg(long, value_name = "LOADS")]
    pub scales: Vec<String>,
}

/// `atvrec calibrate steer`.
#[derive(Debug, Args)]
pub struct SteerArgs {
    /// Arguments that all steps share.
    #[command(flatten)]
    pub shared: CalibrateArgs,
    /// Standard deviation of a reading of a turn plate, degrees.
    #[arg(long, default_value = "0.1", value_name = "DEGREES", value_parser = number::angle_deg, allow_negative_numbers = true)]
    pub plate_sigma_deg: f64,
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
