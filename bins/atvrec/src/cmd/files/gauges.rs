//! `atvrec vehicle gauges`: stress and strain at the gauges under loads on the wheels.

use std::path::Path;

use anyhow::Context;
use engine::output::{Kind, Target};
use engine::sensors_file;
use model::suspension::{Gauge, GaugeLoad, GaugeTable, gauges};
use model::vehicle::Vehicle;
use report::drawing::{LoadedCorner, stresses};
use sample::Wheel;
use sample::text::printable;
use serde_json::{Value, json};

use super::VEHICLES;
use crate::cli::GaugesArgs;
use crate::exit::Outcome;

/// Pa in a MPa.
const MEGA: f64 = 1e6;

/// Runs the command.
pub fn run(args: &GaugesArgs) -> anyhow::Result<Outcome> {
    let vehicle = Vehicle::from_toml(&VEHICLES.text(&args.file)?, &args.file)?;
    let sensors = sensors_file(&args.sensors)?;
    let loads = if args.loads.is_empty() {
        let load = |wheel| (wheel, [0.0, 0.0, vehicle.static_load_n(wheel)]);
        Wheel::ALL.map(load).to_vec()
    } else {
        args.loads.clone()
    };
    let target = |path: &std::path::PathBuf| {
        let inputs = [Path::new(&args.file), Path::new(&args.sensors)];
        Target::new(path, Kind::Any, args.replace.force, inputs)
    };
    let output = args.output.as_ref().map(target).transpose()?;
    let mut tables: Vec<(Wheel, [f64; 3], GaugeTable)> = Vec::new();
    for (wheel, force_n) in loads {
        let load = GaugeLoad {
            wheel,
            force_n,
            compression_m: args.compression_m,
            axial_distance_m: args.axial_distance_m,
        };
        let table = gauges(&vehicle, &sensors, &load)
            .with_context(|| format!("cannot find the stresses of {wheel}"))?;
        tables.push((wheel, force_n, table));
    }
    if args.json {
        println!(
            "{:#}",
            json!({ "loads": documents(&vehicle, &tables, args) })
        );
    } else {
        for (wheel, force_n, table) in &tables {
            print(&vehicle, *wheel, *force_n, table, args.limit_um_m);
        }
    }
    if let Some(output) = output {
        let drawn: Vec<LoadedCorner<'_>> = tables
            .iter()
            .map(|(wheel, force_n, table)| LoadedCorner {
                wheel: *wheel,
                force_n: *force_n,
                table,
            })
            .collect();
        output.write(&stresses(&vehicle, &drawn))?;
        if !args.json {
            let name = printable(&vehicle.name);
            println!(
                "{}: {name}",
                args.output.as_deref().unwrap_or(Path::new("")).display()
            );
        }
    }
    Ok(Outcome::Good)
}

fn documents(
    vehicle: &Vehicle,
    tables: &[(Wheel, [f64; 3], GaugeTable)],
    args: &GaugesArgs,
) -> Vec<Value> {
    let gauge = |wheel: Wheel, gauge: &Gauge| {
        json!({
            "channel": vehicle.channel_name(wheel, gauge.channel),
            "distance_m": gauge.distance_m,
            "tension_n": gauge.tension_n,
            "moment_n_m": gauge.moment_n_m,
            "axial_stress_pa": gauge.axial_stress_pa,
            "bending_stress_pa": gauge.bending_stress_pa,
            "strain": gauge.strain,
            "part_of_limit": gauge.strain / (args.limit_um_m / MEGA),
            "counts": gauge.counts,
            "part_of_range": gauge.part_of_range,
        })
    };
    let document = |(wheel, force_n, table): &(Wheel, [f64; 3], GaugeTable)| {
        let gauges: Vec<Value> = table.gauges.iter().map(|of| gauge(*wheel, of)).collect();
        json!({ "wheel": wheel.abbreviation(), "force_n": force_n, "gauges": gauges })
    };
    tables.iter().map(document).collect()
}

fn print(vehicle: &Vehicle, wheel: Wheel, force_n: [f64; 3], table: &GaugeTable, limit_um_m: f64) {
    let [x, y, z] = force_n;
    println!("{wheel}: F_x {x:.0} N, F_y {y:.0} N, F_z {z:.0} N");
    println!(
        "  {:<20}{:>8}{:>10}{:>9}{:>9}{:>9}{:>9}{:>9}{:>10}{:>9}",
        "", "at", "tension", "moment", "axial", "bending", "strain", "limit", "counts", "range"
    );
    println!(
        "  {:<20}{:>8}{:>10}{:>9}{:>9}{:>9}{:>9}{:>9}{:>10}{:>9}",
        "channel", "mm", "N", "N m", "MPa", "MPa", "um/m", "%", "", "%"
    );
    for gauge in &table.gauges {
        let strain_um_m = MEGA * gauge.strain;
        println!(
            "  {:<20}{:>8.0}{:>10.0}{:>9.1}{:>9.1}{:>9.1}{strain_um_m:>9.0}{:>9.1}{:>10.1}{:>9.1}",
            vehicle.channel_name(wheel, gauge.channel),
            1e3 * gauge.distance_m,
            gauge.tension_n,
            gauge.moment_n_m,
            gauge.axial_stress_pa / MEGA,
            gauge.bending_stress_pa / MEGA,
            100.0 * strain_um_m / limit_um_m,
            gauge.counts,
            100.0 * gauge.part_of_range,
        );
    }
    for gauge in &table.gauges {
        let name = vehicle.channel_name(wheel, gauge.channel);
        if gauge.strain > limit_um_m / MEGA {
            println!(
                "  warning: {name}: the strain is above the limit of {limit_um_m:.0} um/m; move the gauge, or use one \
                 with a larger limit"
            );
        }
        if gauge.part_of_range > 1.0 {
            println!(
                "  warning: {name}: the counts are beyond the range of the converter; use a larger gain resistor"
            );
        }
    }
}
