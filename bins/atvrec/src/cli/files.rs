//! `atvrec vehicle` and `atvrec sensors`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::Replace;

/// `atvrec vehicle`.
#[derive(Debug, Subcommand)]
pub enum VehicleCommand {
    /// Write a template of a vehicle file: a built-in file with the meaning of each field.
    ///
    /// Replace its values with those of your vehicle.
    New(NewArgs),
    /// Print a vehicle file, or list the built-in ones.
    Show(ShowArgs),
    /// Check vehicle files: errors, and values that are far from usual, with their probable unit.
    ///
    /// The exit code is 0 if the files have no errors, also if values are far from usual.
    Check(CheckFilesArgs),
    /// Draw the hard-points of a vehicle file with the linkage at bump, design and droop (SVG).
    ///
    /// The drawing has the left corner of each axle, or a whole solid axle, from the rear and from
    /// above, and curves over the travel of the wheel: camber, toe-in and motion ratio; of a solid
    /// axle steer in roll, lateral shift and motion ratio.
    Draw(DrawArgs),
    /// Mass, centre of gravity and moments of inertia from a list of components (CSV).
    ///
    /// The columns are name, mass_kg, x_m, y_m, z_m and, if a component is no point mass, its moments
    /// and product of inertia about its own centre of gravity: ixx_kg_m2, iyy_kg_m2, izz_kg_m2,
    /// ixz_kg_m2. Positions are forward and left of, and above, the point on the ground below the
    /// middle of the front axle; parts behind the front axle have a negative x_m.
    Mass(MassArgs),
}

/// `atvrec sensors`.
#[derive(Debug, Subcommand)]
pub enum SensorsCommand {
    /// Write a template of a sensors file: a built-in file with the meaning of each field.
    ///
    /// Replace its values with those of your sensors.
    New(NewArgs),
    /// Print a sensors file, or list the built-in ones.
    Show(ShowArgs),
    /// Check sensors files.
    Check(CheckFilesArgs),
}

/// Template to write.
#[derive(Debug, Args)]
pub struct NewArgs {
    /// Name of the built-in file whose values the template has [default: prowler or thesis-10bit].
    #[arg(value_name = "TEMPLATE")]
    pub template: Option<String>,
    /// File to write [default: vehicle.toml or sensors.toml].
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// What to print.
#[derive(Debug, Args)]
pub struct ShowArgs {
    /// Name of a built-in file, or path of a file; without it, the built-in files are listed.
    #[arg(value_name = "FILE")]
    pub file: Option<String>,
}

/// What to check.
#[derive(Debug, Args)]
pub struct CheckFilesArgs {
    /// Paths of files, or names of built-in ones.
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<String>,
}

/// `atvrec vehicle draw`.
#[derive(Debug, Args)]
pub struct DrawArgs {
    /// Path of a vehicle file, or the name of a built-in one.
    #[arg(value_name = "FILE")]
    pub file: String,
    /// Drawing to write.
    #[arg(short, long, default_value = "vehicle.svg", value_name = "FILE")]
    pub output: PathBuf,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}

/// `atvrec vehicle mass`.
#[derive(Debug, Args)]
pub struct MassArgs {
    /// List of components (CSV).
    #[arg(value_name = "COMPONENTS")]
    pub components: PathBuf,
    /// Path of a vehicle file, or the name of a built-in one: it gives the wheelbase, and the overrides
    /// are for it.
    #[arg(long, value_name = "FILE")]
    pub vehicle: String,
    /// Write overrides for the vehicle file to this TOML file.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}
