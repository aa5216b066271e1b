//! `atvrec import vehicle`: convert the parameters of a simulator to a vehicle file.

use anyhow::Context;
use engine::config::{TOML_MAX, read_text};
use sample::text::printable;

use crate::cli::ImportVehicleArgs;
use crate::exit::Outcome;
use crate::output::target::{Kind, Target};

/// Runs the command.
pub fn run(args: &ImportVehicleArgs) -> anyhow::Result<Outcome> {
    let inputs = [&*args.input];
    let target = Target::new(&args.output, Kind::Toml, args.replace.force, inputs)?;
    let text = read_text(&args.input, TOML_MAX)
        .with_context(|| format!("cannot read {}", args.input.display()))?;
    let vehicle = sim::vehicle_from_truth_params(&text).with_context(|| {
        format!(
            "{} is not a valid params.json of the simulator",
            args.input.display()
        )
    })?;
    target.write(&vehicle.to_toml()?)?;
    println!("{}: {}", args.output.display(), printable(&vehicle.name));
    for warning in vehicle.warnings() {
        println!("  {}", printable(&warning.to_string()));
    }
    Ok(Outcome::Good)
}
