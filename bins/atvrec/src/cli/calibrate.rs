//! `atvrec calibrate`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::{Replace, number};

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
    /// Drift of zeros and gains of the strain bridges with temperature, from logs at rest in which the
    /// temperature of the bridges changes by 8 K or more.
    Temperature(CalibrateArgs),
    /// Height of the centre of gravity, from scales under the axles, level and with one axle raised.
    ///
    /// The table (CSV) has a row for each position of the vehicle, with the columns raised (none,
    /// front or rear), lift_m (height of the ground below the raised wheels above that below the
    /// others), front_kg and rear_kg. The wheels must roll freely.
    CgHeight(CgHeightArgs),
    /// Gains, zeros, hysteresis and drift of the strain bridges of one member, from known loads on a bench.
    ///
    /// The table (CSV) has a row for each step, in the order in which the loads were put on and taken off,
    /// with the columns load_n (tension of the member, N), axial_counts (mean of the axial bridge) and, if
    /// they were measured, moment_n_m (bending moment at the gauges, N m), bending_counts (mean of the
    /// bending bridge) and temperature_c (temperature at the gauges).
    Member(MemberArgs),
}

impl CalibrateCommand {
    /// Arguments that all steps share which read logs.
    pub fn shared(&self) -> Option<&CalibrateArgs> {
        Some(match self {
            Self::CgHeight(_) | Self::Member(_) => return None,
            Self::Zero(args) => &args.shared,
            Self::Weight(args) => &args.shared,
            Self::Steer(args) => &args.shared,
            Self::LoadRig(args)
            | Self::Imu(args)
            | Self::Gnss(args)
            | Self::WheelRadius(args)
            | Self::Hub(args)
            | Self::Temperature(args) => args,
        })
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

/// `atvrec calibrate cg-height`.
#[derive(Debug, Args)]
pub struct CgHeightArgs {
    /// Table of the readings (CSV).
    #[arg(value_name = "READINGS")]
    pub readings: PathBuf,
    /// Path of a vehicle file, or the name of a built-in one: it gives wheelbase, tyres and springs, and
    /// the overrides are for it.
    #[arg(long, value_name = "FILE")]
    pub vehicle: String,
    /// The springs were held at their length of the level vehicle.
    #[arg(long)]
    pub locked: bool,
    /// Standard deviation of the reading of an axle, kg.
    #[arg(long, default_value = "0.5", value_name = "KG", value_parser = number::mass_kg, allow_negative_numbers = true)]
    pub scale_sigma_kg: f64,
    /// Standard deviation of the lift, m.
    #[arg(long, default_value = "0.002", value_name = "M", value_parser = number::length_m, allow_negative_numbers = true)]
    pub lift_sigma_m: f64,
    /// Write overrides for the vehicle file to this TOML file.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Write a page with the figure (HTML).
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// `atvrec calibrate member`.
#[derive(Debug, Args)]
pub struct MemberArgs {
    /// Table of the bench (CSV).
    #[arg(value_name = "BENCH")]
    pub bench: PathBuf,
    /// Path of a vehicle file, or the name of a built-in one: the calibration is for it.
    #[arg(long, value_name = "FILE")]
    pub vehicle: String,
    /// Path of a sensors file, or the name of a built-in one: it gives the expected gains and the range of the
    /// counts.
    #[arg(long, value_name = "FILE")]
    pub sensors: String,
    /// Corner of the member.
    #[arg(long, value_name = "WHEEL", value_parser = ["FL", "FR", "RL", "RR"], ignore_case = true)]
    pub wheel: String,
    /// Member, by the name of its axial channel.
    #[arg(long, value_name = "MEMBER", value_parser = ["upper_front", "upper_rear", "lower_front", "lower_rear", "tie_rod", "strut_side_x", "strut_side_y"])]
    pub member: String,
    /// Standard deviation of the loads, as a fraction of each load, the same in all rows.
    #[arg(long, default_value = "0.002", value_name = "FRACTION", value_parser = number::fraction, allow_negative_numbers = true)]
    pub load_sigma: f64,
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
