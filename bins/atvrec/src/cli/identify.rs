//! `atvrec identify`.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use super::{Replace, number};

/// `atvrec identify`.
#[derive(Debug, Subcommand)]
pub enum IdentifyCommand {
    /// Cornering stiffness of both axles and the steer angle's offset (slow sine steer).
    Cornering(IdentifyArgs),
    /// A tyre model from measured force and slip (up to the limit of grip).
    Tyre(TyreArgs),
    /// Roll and pitch stiffness by regression and by formula (slow sine steer; braking).
    RollPitch(IdentifyArgs),
    /// Moments of inertia: by formula, from the yaw of a drive, or from a pendulum's record.
    Inertia(InertiaArgs),
    /// Roll centres from the vehicle file's hard-points.
    RollCentre(RollCentreArgs),
    /// Understeer, sideslip and roll gradient (ISO 4138, constant radius).
    Understeer(IdentifyArgs),
    /// Step and frequency response to the steering wheel (ISO 7401).
    Response(ResponseArgs),
    /// Friction between tyres and ground (up to the limit of grip).
    Friction(IdentifyArgs),
    /// Tyres, yaw inertia, gains and offsets for the sideslip of a car without suspension sensors.
    Handling(IdentifyHandlingArgs),
}

/// What all of `atvrec identify` take.
#[derive(Debug, Args)]
pub struct IdentifyArgs {
    /// Logs of one run, in the order in which they were recorded.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Where and how results are told.
    #[command(flatten)]
    pub tell: TellArgs,
    /// Leave out what was before this time, s from the log's first estimate.
    #[arg(long = "from", default_value = "2", value_name = "SECONDS", value_parser = number::moment_s, allow_negative_numbers = true)]
    pub from_s: f64,
    /// Leave out what was after this time, s from the log's first estimate.
    #[arg(long = "to", value_name = "SECONDS", value_parser = number::moment_s, allow_negative_numbers = true)]
    pub to_s: Option<f64>,
    /// Vehicle file instead of the log's; a vehicle of another name is refused.
    #[arg(long, value_name = "FILE")]
    pub vehicle: Option<String>,
    /// Seed of the bootstrap.
    #[arg(long, default_value_t = 1, value_parser = number::seed, allow_negative_numbers = true)]
    pub seed: u64,
}

/// Where and how results are told.
#[derive(Debug, Args)]
pub struct TellArgs {
    /// Write the results, and overrides for the vehicle file, to this TOML file.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Write a page with the figures; it needs no network.
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
    /// What all take.
    #[command(flatten)]
    pub shared: IdentifyArgs,
    /// Tyre model; without one all are fitted, and the best of those that a vehicle file holds
    /// (fiala) gives the overrides.
    #[arg(long, value_name = "NAME")]
    pub model: Option<String>,
}

/// `atvrec identify inertia`.
#[derive(Debug, Args)]
pub struct InertiaArgs {
    /// What all take.
    #[command(flatten)]
    pub shared: IdentifyArgs,
    /// The log is a pendulum's record.
    #[arg(long, value_enum, value_name = "KIND")]
    pub pendulum: Option<PendulumKind>,
    /// Axis of the inertial unit about which it swings: x, y or z.
    #[arg(long, default_value = "z", value_name = "AXIS", value_parser = ["x", "y", "z"])]
    pub axis: String,
    /// Mass of what swings, kg; without it, the vehicle file's.
    #[arg(long, value_name = "KG", value_parser = number::mass_kg, allow_negative_numbers = true)]
    pub mass_kg: Option<f64>,
    /// compound: centre of gravity below the pivot, m. wires: radius of the wires, m.
    #[arg(long, value_name = "M", value_parser = number::length_m, allow_negative_numbers = true)]
    pub arm_m: Option<f64>,
    /// wires: their length, m.
    #[arg(long, value_name = "M", value_parser = number::length_m, allow_negative_numbers = true)]
    pub length_m: Option<f64>,
    /// springs: stiffness about the axis, N m/rad.
    #[arg(long, value_name = "NM_RAD", value_parser = number::stiffness_n_m_rad, allow_negative_numbers = true)]
    pub stiffness_n_m_rad: Option<f64>,
    /// Inertia of platform and fixings, kg m^2.
    #[arg(long, default_value = "0", value_name = "KG_M2", value_parser = number::inertia_kg_m2, allow_negative_numbers = true)]
    pub fixture_kg_m2: f64,
}

/// How the vehicle hangs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PendulumKind {
    /// As a whole about a pivot above it.
    Compound,
    /// On wires, turning about the vertical.
    Wires,
    /// Against springs.
    Springs,
}

/// `atvrec identify roll-centre`.
#[derive(Debug, Args)]
pub struct RollCentreArgs {
    /// Vehicle file, or the name of one that ships with the program.
    #[arg(value_name = "VEHICLE")]
    pub vehicle: String,
    /// Where and how results are told.
    #[command(flatten)]
    pub tell: TellArgs,
}

/// `atvrec identify response`.
#[derive(Debug, Args)]
pub struct ResponseArgs {
    /// What all take.
    #[command(flatten)]
    pub shared: IdentifyArgs,
    /// Least step at the road wheels, degrees.
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
    /// Use the drive up to here only, s from its start.
    #[arg(long = "until", value_name = "SECONDS", value_parser = number::moment_s, allow_negative_numbers = true)]
    pub until_s: Option<f64>,
    /// Use this configuration instead of the one in the log.
    #[arg(short, long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Write calibration.toml here, with an atvrec.toml for `replay --config` and all files that it
    /// names.
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}
