//! `atvrec import vehicle`.

use anyhow::Context;

use crate::cli::ImportVehicleArgs;
use crate::exit::Outcome;

/// Writes a vehicle file from a simulator's parameters.
pub fn run(args: &ImportVehicleArgs) -> anyhow::Result<Outcome> {
    let text = std::fs::read_to_string(&args.input)
        .with_context(|| format!("cannot read {}", args.input.display()))?;
    let vehicle = sim::vehicle_from_truth_params(&text)
        .with_context(|| format!("{} is not usable", args.input.display()))?;
    std::fs::write(&args.output, vehicle.to_toml()?)
        .with_context(|| format!("cannot write {}", args.output.display()))?;
    println!("{}: {}", args.output.display(), vehicle.name);
    for warning in vehicle.warnings() {
        println!("  {warning}");
    }
    Ok(Outcome::Good)
}
