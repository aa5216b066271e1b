//! `atvrec calibrate cg-height`: height of the centre of gravity, from a table of scales.

use std::path::Path;

use engine::output::{Kind, Target};
use engine::vehicle_file;
use estimator::calibration::cg_height::{Options, Reading, cg_height};
use estimator::finding::Findings;
use sample::Axle;
use serde::Deserialize;
use toml::{Table, Value};

use crate::cli::CgHeightArgs;
use crate::cmd::{findings, overrides, table};
use crate::exit::{Outcome, UsageError};

/// Columns of the table.
const COLUMNS: [&str; 4] = ["raised", "lift_m", "front_kg", "rear_kg"];

/// A row of the table.
#[derive(Debug, Deserialize)]
struct Row {
    raised: String,
    lift_m: f64,
    front_kg: f64,
    rear_kg: f64,
}

/// Runs the command.
pub fn run(args: &CgHeightArgs) -> anyhow::Result<Outcome> {
    let vehicle = vehicle_file(&args.vehicle)?;
    let inputs = || [args.readings.as_path(), Path::new(&args.vehicle)];
    let target = |path, kind| Target::new(path, kind, args.replace.force, inputs());
    let output = args
        .output
        .as_deref()
        .map(|path| target(path, Kind::Toml))
        .transpose()?;
    let page = args
        .report
        .as_deref()
        .map(|path| target(path, Kind::Page))
        .transpose()?;
    let options = Options {
        locked: args.locked,
        scale_sigma_kg: args.scale_sigma_kg,
        lift_sigma_m: args.lift_sigma_m,
    };
    let found = cg_height(&vehicle, &readings(&args.readings)?, &options)?;
    if let Some(output) = output {
        let fields = fields(&found, vehicle.wheelbase_m());
        let text = overrides::text(
            "calibrate cg-height",
            &vehicle.name,
            &args.readings,
            &fields,
        )?;
        output.write(&text)?;
    }
    let results = [found];
    if let Some(page) = page {
        let facts = vec![
            ("vehicle".to_owned(), vehicle.name.clone()),
            ("readings".to_owned(), args.readings.display().to_string()),
        ];
        page.write(&findings::page("Calibration: cg-height", facts, &results))?;
    }
    findings::print(&results, args.json)?;
    Ok(Outcome::Good)
}

/// Fields of the vehicle file.
fn fields(found: &Findings, wheelbase_m: f64) -> Table {
    let [height_m, _] = found.value("cg_height");
    let [front_m, _] = found.value("front_axle_to_cg");
    Table::from_iter([
        ("body.cg_height_m".to_owned(), Value::Float(height_m)),
        ("body.front_axle_to_cg_m".to_owned(), Value::Float(front_m)),
        (
            "body.cg_to_rear_axle_m".to_owned(),
            Value::Float(wheelbase_m - front_m),
        ),
    ])
}

fn readings(path: &Path) -> anyhow::Result<Vec<Reading>> {
    let shown = path.display();
    let usage = |text: String| anyhow::Error::from(UsageError(text));
    let mut readings = Vec::new();
    for (number, row) in table::rows::<Row>(path, &COLUMNS, &[])?
        .into_iter()
        .enumerate()
    {
        let row = row.map_err(|error| usage(format!("{shown}: row {}: {error}", number + 1)))?;
        let raised = match row.raised.as_str() {
            "none" | "" => None,
            "front" => Some(Axle::Front),
            "rear" => Some(Axle::Rear),
            other => {
                return Err(usage(format!(
                    "{shown}: row {}: raised = {other:?}: must be none, front or rear",
                    number + 1
                )));
            }
        };
        readings.push(Reading {
            raised,
            lift_m: row.lift_m,
            axle_kg: [row.front_kg, row.rear_kg],
        });
    }
    Ok(readings)
}
