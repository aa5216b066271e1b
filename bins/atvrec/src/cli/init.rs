//! `atvrec init`.

use std::path::PathBuf;

use clap::Args;

use super::{Replace, number};

/// `atvrec init`.
#[derive(Debug, Args)]
pub struct InitArgs {
    /// Write the files into this directory; it is created if it does not exist.
    #[arg(short, long, default_value = ".", value_name = "DIR")]
    pub directory: PathBuf,
    /// Ask nothing: what the options do not say has its default.
    #[arg(short, long)]
    pub yes: bool,
    /// Vehicle: the name of a built-in vehicle, of which a template is written, or the path of a vehicle
    /// file [default: prowler].
    #[arg(long, value_name = "FILE")]
    pub vehicle: Option<String>,
    /// Sensors: the name of a built-in sensor set, of which a template is written, or the path of a
    /// sensors file [default: thesis-10bit].
    #[arg(long, value_name = "FILE")]
    pub sensors: Option<String>,
    /// Directory of the logs, relative to the configuration [default: logs].
    #[arg(long, value_name = "DIR")]
    pub storage: Option<PathBuf>,
    /// Listen to this serial port; can be given several times. With --port or --can, other devices are
    /// left out.
    #[arg(long = "port", value_name = "PATH")]
    pub ports: Vec<PathBuf>,
    /// Listen to this CAN interface; can be given several times.
    #[arg(long = "can", value_name = "INTERFACE")]
    pub can: Vec<String>,
    /// DBC file of a CAN bus; can be given several times. Each file is used for the bus whose frames it
    /// has.
    #[arg(long, value_name = "FILE")]
    pub dbc: Vec<PathBuf>,
    /// Bit rate of the CAN buses whose interfaces are down, and of SLCAN adapters. Without it, the bit
    /// rate of an SLCAN adapter is found by listening.
    #[arg(long, value_name = "BIT/S", value_parser = clap::value_parser!(u32).range(5_000..=1_000_000))]
    pub bitrate: Option<u32>,
    /// Time for which the command listens at each baud rate.
    #[arg(long = "seconds", default_value = "1.5", value_name = "SECONDS", value_parser = number::listen_s, allow_negative_numbers = true)]
    pub listen_s: f64,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}
