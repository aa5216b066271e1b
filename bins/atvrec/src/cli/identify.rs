//! `atvrec identify`.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use super::{Replace, number};

/// `atvrec identify`.
#[derive(Debug, Subcommand)]
pub enum IdentifyCommand {
    /// Cornering stiffness of both axles and offset of the steer angle (slow sine steer).
    Cornering(IdentifyArgs),
    /// Parameters of a tyre model from measured force and slip (up to the limit of grip).
    Tyre(TyreArgs),
    /// Roll and pitch stiffness by regression and by formula (slow sine steer; braking).
    RollPitch(IdentifyArgs),
    /// Moments of inertia: by formula, from the yaw of a drive, or from a pendulum test.
    Inertia(InertiaArgs),
    /// Roll centres from the hard-points of a vehicle file.
    RollCentre(RollCentreArgs),
    /// Understeer gradient, sideslip gradient and roll gradient (ISO 4138, constant radius).
    Understeer(IdentifyArgs),
    /// Step response and frequency response to the steering wheel (ISO 7401).
    Response(ResponseArgs),
    /// Friction coefficient between tyres and ground (up to the limit of grip).
    Friction(IdentifyArgs),
    /// Mistakes of the configuration: offsets, gains, exchanged plugs, load, inertial unit.
    ///
    /// The raw data is estimated again. Each mistake is compared with "all is as configured"; the ratio of their
    /// likelihoods over the drive decides.
    Mistakes(IdentifyMistakesArgs),
    /// Latencies of messages: time from the sampling to the stamp.
    ///
    /// The raw data is estimated again. The latencies that the configuration gives a latency_sigma_s are found from
    /// what the readings of each message lag behind the others.
    Latency(IdentifyLatencyArgs),
    /// Longitudinal stiffness of the tyres (a start with much throttle and hard braking).
    Slip(IdentifyArgs),
    /// Camber stiffness of the tyres (turns and side slopes on even ground).
    ///
    /// Roll inclines the wheels in proportion to the lateral force, so that turns alone do not separate the camber
    /// thrust from the slip. Slow tight turns and side slopes do. Rough ground is refused.
    Camber(IdentifyArgs),
    /// Pneumatic trail and aligning moment of the tyres (turns to both sides).
    Aligning(IdentifyArgs),
    /// Toe compliance and play of the front wheels (turns to both sides, with sensors of the wheels' angles).
    ///
    /// The roles steer_left and steer_right are the measured angles. Their difference from the angles that steering
    /// wheel and linkage give is compared with the lateral forces.
    Toe(IdentifyArgs),
    /// Tyre parameters, yaw inertia, gains and offsets for a car without suspension sensors.
    ///
    /// The result is for the estimate of the sideslip angle.
    Handling(IdentifyHandlingArgs),
}

/// Arguments that most kinds of `atvrec identify` share.
#[derive(Debug, Args)]
pub struct IdentifyArgs {
    /// Logs of one run, in the order in which they were recorded.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Output of the results.
    #[command(flatten)]
    pub output: OutputArgs,
    /// Ignore data before this time, s from the first estimate of the log.
    #[arg(long = "from", default_value = "2", value_name = "SECONDS", value_parser = number::moment_s, allow_negative_numbers = true)]
    pub from_s: f64,
    /// Ignore data after this time, s from the first estimate of the log.
    #[arg(long = "to", value_name = "SECONDS", value_parser = number::moment_s, allow_negative_numbers = true)]
    pub to_s: Option<f64>,
    /// Vehicle file to use instead of the log's; it must be of the same vehicle (same name).
    #[arg(long, value_name = "FILE")]
    pub vehicle: Option<String>,
    /// Seed of the bootstrap that gives the confidence intervals.
    #[arg(long, default_value_t = 1, value_parser = number::seed, allow_negative_numbers = true)]
    pub seed: u64,
}

/// Run whose configuration is judged, and how the result is written.
#[derive(Debug, Args)]
pub struct JudgedRunArgs {
    /// Logs of one run, in the order in which they were recorded.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Use this configuration instead of the one in the log.
    #[arg(short, long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// `atvrec identify latency`.
#[derive(Debug, Args)]
pub struct IdentifyLatencyArgs {
    /// The run.
    #[command(flatten)]
    pub run: JudgedRunArgs,
    /// Write the configuration with the latencies to this TOML file.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
}

/// `atvrec identify mistakes`.
#[derive(Debug, Args)]
pub struct IdentifyMistakesArgs {
    /// The run.
    #[command(flatten)]
    pub run: JudgedRunArgs,
    /// Write the corrected calibration to this TOML file. What a calibration cannot contain is in its comments.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
}

/// Output of the results.
#[derive(Debug, Args)]
pub struct OutputArgs {
    /// Write the results, and overrides for the vehicle file, to this TOML file.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Write a page with the figures (HTML); it needs no network.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// `atvrec identify tyre`.
#[derive(Debug, Args)]
pub struct TyreArgs {
    /// Shared arguments.
    #[command(flatten)]
    pub shared: IdentifyArgs,
    /// Tyre model to fit. Without this option all models are fitted, and the best model that a
    /// vehicle file can contain (fiala) gives the overrides.
    #[arg(long, value_name = "NAME")]
    pub model: Option<String>,
    /// Compare the tyres with those of another log, or of a file that `identify tyre -o` wrote. The differences
    /// have intervals, and a sentence says whether the tyres differ.
    #[arg(long, value_name = "LOG|FILE")]
    pub against: Option<PathBuf>,
}

/// `atvrec identify inertia`.
#[derive(Debug, Args)]
pub struct InertiaArgs {
    /// Shared arguments.
    #[command(flatten)]
    pub shared: IdentifyArgs,
    /// Kind of pendulum test that the log recorded.
    #[arg(long, value_enum, value_name = "KIND")]
    pub pendulum: Option<PendulumKind>,
    /// Axis of the inertial unit about which the pendulum swings: x, y or z.
    #[arg(long, default_value = "z", value_name = "AXIS", value_parser = ["x", "y", "z"])]
    pub axis: String,
    /// Mass that swings, kg [default: the mass in the vehicle file].
    #[arg(long, value_name = "KG", value_parser = number::mass_kg, allow_negative_numbers = true)]
    pub mass_kg: Option<f64>,
    /// compound: distance from the pivot down to the centre of gravity, m. wires: distance of the
    /// wires from the axis, m.
    #[arg(long, value_name = "M", value_parser = number::length_m, allow_negative_numbers = true)]
    pub arm_m: Option<f64>,
    /// wires: length of the wires, m.
    #[arg(long, value_name = "M", value_parser = number::length_m, allow_negative_numbers = true)]
    pub length_m: Option<f64>,
    /// springs: rotational stiffness about the axis, N m/rad.
    #[arg(long, value_name = "NM_RAD", value_parser = number::stiffness_n_m_rad, allow_negative_numbers = true)]
    pub stiffness_n_m_rad: Option<f64>,
    /// Moment of inertia of the platform and the fixings, kg m^2.
    #[arg(long, default_value = "0", value_name = "KG_M2", value_parser = number::inertia_kg_m2, allow_negative_numbers = true)]
    pub fixture_kg_m2: f64,
}

/// Kind of a pendulum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PendulumKind {
    /// The vehicle swings about a pivot above it.
    Compound,
    /// The vehicle hangs on wires and turns about the vertical axis.
    Wires,
    /// The vehicle turns about an axis against springs.
    Springs,
}

/// `atvrec identify roll-centre`.
#[derive(Debug, Args)]
pub struct RollCentreArgs {
    /// Vehicle file, or the name of a built-in vehicle.
    #[arg(value_name = "VEHICLE")]
    pub vehicle: String,
    /// Output of the results.
    #[command(flatten)]
    pub output: OutputArgs,
}

/// `atvrec identify response`.
#[derive(Debug, Args)]
pub struct ResponseArgs {
    /// Shared arguments.
    #[command(flatten)]
    pub shared: IdentifyArgs,
    /// Smallest step of the steer angle at the road wheels, degrees.
    #[arg(long, default_value = "1.5", value_name = "DEG", value_parser = number::angle_deg, allow_negative_numbers = true)]
    pub step_min_deg: f64,
    /// Length of a window of the frequency response, s.
    #[arg(long, default_value = "10", value_name = "SECONDS", value_parser = number::window_s, allow_negative_numbers = true)]
    pub window_s: f64,
}

/// `atvrec identify handling`.
#[derive(Debug, Args)]
pub struct IdentifyHandlingArgs {
    /// Logs, in the order in which they were recorded.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Use the data up to this time only, s from the start of the drive.
    #[arg(long = "until", value_name = "SECONDS", value_parser = number::moment_s, allow_negative_numbers = true)]
    pub until_s: Option<f64>,
    /// Use this configuration instead of the one in the log.
    #[arg(short, long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Write calibration.toml to this directory, with an atvrec.toml for `replay --config` and all
    /// files that the atvrec.toml names.
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}
