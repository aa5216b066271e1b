//! `atvrec vehicle` and `atvrec sensors`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::{Replace, number};

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
    /// Stress and strain at each gauge under loads on the wheels, and the counts that they make.
    ///
    /// The forces of the members are those of the linkage, and each member is a beam between its joints. The
    /// table shows which load uses how much of the limit of the gauges and of the range of the converter, and the
    /// drawing (SVG) the stress along each member: gauges belong where it is large and changes little. Without
    /// --load, each wheel has its static load.
    Gauges(GaugesArgs),
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

/// `atvrec vehicle gauges`.
#[derive(Debug, Args)]
pub struct GaugesArgs {
    /// Path of a vehicle file, or the name of a built-in one.
    #[arg(value_name = "FILE")]
    pub file: String,
    /// Path of a sensors file, or the name of a built-in one: it gives tubes, bridges and converter.
    #[arg(long, value_name = "FILE")]
    pub sensors: String,
    /// Force of the ground on a tyre at its contact point: wheel, forward, left and up, N, as in FL,0,800,1800.
    /// Repeat the option for more loads.
    #[arg(long = "load", value_name = "LOAD", value_parser = number::wheel_load, allow_hyphen_values = true)]
    pub loads: Vec<(sample::Wheel, [f64; 3])>,
    /// Compression of the struts from their design length, m.
    #[arg(long, default_value = "0", value_name = "M", value_parser = number::compression_m, allow_negative_numbers = true)]
    pub compression_m: f64,
    /// Distance of the axial gauges from the outer joint along the member, m [default: that of the bending
    /// bridges, or 0.1].
    #[arg(long, value_name = "M", value_parser = number::length_m, allow_negative_numbers = true)]
    pub axial_distance_m: Option<f64>,
    /// Largest strain of a gauge, um/m: that up to which its data sheet states a fatigue life.
    #[arg(long, default_value = "1500", value_name = "UM_M", value_parser = number::strain_um_m, allow_negative_numbers = true)]
    pub limit_um_m: f64,
    /// Drawing to write (SVG).
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
    /// Whether outputs may replace files.
    #[command(flatten)]
    pub replace: Replace,
}
