//! `atvrec calibrate member`: gains of the bridges of one member, from a table of a bench.

use std::path::Path;

use anyhow::Context;
use engine::output::{Kind, Target};
use engine::{sensors_file, vehicle_file};
use estimator::calibration::member::{Bench, BenchLoad, member};
use sample::{StrainChannel, Wheel};
use serde::Deserialize;

use super::known;
use crate::cli::MemberArgs;
use crate::cmd::{findings, table};
use crate::exit::{Outcome, UsageError};

/// Columns that every table has.
const COLUMNS: [&str; 1] = ["load_n"];
/// Columns that a table may have.
const OPTIONAL: [&str; 4] = [
    "axial_counts",
    "moment_n_m",
    "bending_counts",
    "temperature_c",
];

/// A row of the table.
#[derive(Debug, Deserialize)]
struct Row {
    load_n: f64,
    #[serde(default)]
    moment_n_m: Option<f64>,
    #[serde(default)]
    axial_counts: Option<f64>,
    #[serde(default)]
    bending_counts: Option<f64>,
    #[serde(default)]
    temperature_c: Option<f64>,
}

/// Runs the command.
pub fn run(args: &MemberArgs) -> anyhow::Result<Outcome> {
    let (vehicle, sensors) = (vehicle_file(&args.vehicle)?, sensors_file(&args.sensors)?);
    let inputs = || {
        [
            args.bench.as_path(),
            Path::new(&args.vehicle),
            Path::new(&args.sensors),
        ]
    };
    // The values of other steps in the file are kept, so that `--force` is not needed.
    let output = Target::new(&args.output, Kind::Toml, true, inputs())?;
    let page = args.report.as_deref();
    let page = page.map(|path| Target::new(path, Kind::Page, args.replace.force, inputs()));
    let page = page.transpose()?;
    let bench = Bench {
        wheel: Wheel::from_abbreviation(&args.wheel).context("no wheel is given")?,
        member: StrainChannel::from_name(&args.member).context("no member is given")?,
        load_sigma: args.load_sigma,
    };
    let known = known(&args.output, &vehicle.name)?;
    let found = member(&vehicle, &sensors, &known, &rows(&args.bench)?, &bench)
        .with_context(|| format!("cannot use {}", args.bench.display()))?;
    output.write(&found.calibration.to_toml()?)?;
    let results = [found.findings];
    if let Some(page) = page {
        let facts = vec![
            ("vehicle".to_owned(), vehicle.name.clone()),
            ("sensors".to_owned(), sensors.name.clone()),
            ("bench".to_owned(), args.bench.display().to_string()),
        ];
        page.write(&findings::page("Calibration: member", facts, &results))?;
    }
    findings::print(&results, args.json)?;
    if !args.json {
        println!("wrote {}", args.output.display());
    }
    Ok(Outcome::Good)
}

fn rows(path: &Path) -> anyhow::Result<Vec<BenchLoad>> {
    let rows = table::rows::<Row>(path, &COLUMNS, &OPTIONAL)?;
    rows.into_iter()
        .enumerate()
        .map(|(number, row)| {
            let row = row.map_err(|error| {
                UsageError(format!("{}: row {}: {error}", path.display(), number + 1))
            })?;
            Ok(BenchLoad {
                load_n: row.load_n,
                moment_n_m: row.moment_n_m.unwrap_or_default(),
                axial_counts: row.axial_counts,
                bending_counts: row.bending_counts,
                temperature_c: row.temperature_c,
            })
        })
        .collect()
}
