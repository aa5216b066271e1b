//! `atvrec vehicle mass`: mass, centre of gravity and inertia from a list of components.

use std::path::Path;

use engine::output::{Kind, Target};
use model::vehicle::{MassProperties, Vehicle};
use serde::Deserialize;
use serde_json::json;
use toml::{Table, Value};

use super::VEHICLES;
use crate::cli::MassArgs;
use crate::cmd::{overrides, table};
use crate::exit::{Outcome, UsageError};

/// Columns that every list has.
const COLUMNS: [&str; 5] = ["name", "mass_kg", "x_m", "y_m", "z_m"];
/// Columns that a list may have: inertia of a component about its own centre of gravity.
const INERTIA: [&str; 4] = ["ixx_kg_m2", "iyy_kg_m2", "izz_kg_m2", "ixz_kg_m2"];

/// A row of the list.
#[derive(Debug, Deserialize)]
struct Row {
    name: String,
    mass_kg: Option<f64>,
    x_m: Option<f64>,
    y_m: Option<f64>,
    z_m: Option<f64>,
    #[serde(default)]
    ixx_kg_m2: Option<f64>,
    #[serde(default)]
    iyy_kg_m2: Option<f64>,
    #[serde(default)]
    izz_kg_m2: Option<f64>,
    #[serde(default)]
    ixz_kg_m2: Option<f64>,
}

impl Row {
    /// The component, or what is wrong with it.
    fn component(&self) -> Result<MassProperties, String> {
        let needed = |value: Option<f64>, column: &str| match value {
            Some(value) if value.is_finite() => Ok(value),
            Some(value) => Err(format!("{column} = {value}: must be a finite number")),
            None => Err(format!("{column} is missing")),
        };
        let mass_kg = needed(self.mass_kg, "mass_kg")?;
        if mass_kg <= 0.0 {
            return Err(format!("mass_kg = {mass_kg}: must be above 0"));
        }
        let cg_m = [
            needed(self.x_m, "x_m")?,
            needed(self.y_m, "y_m")?,
            needed(self.z_m, "z_m")?,
        ];
        if cg_m[2] < 0.0 {
            let z_m = cg_m[2];
            return Err(format!("z_m = {z_m}: is below the ground; z is upward"));
        }
        let own = [self.ixx_kg_m2, self.iyy_kg_m2, self.izz_kg_m2].map(Option::unwrap_or_default);
        let ixz_kg_m2 = self.ixz_kg_m2.unwrap_or_default();
        for (column, value) in INERTIA.iter().zip(own) {
            if !value.is_finite() || value < 0.0 {
                return Err(format!(
                    "{column} = {value}: must be a number that is not negative"
                ));
            }
        }
        let [xx, yy, zz] = own;
        // Of no body, the largest moment is above the sum of the others.
        if xx.max(yy).max(zz) > 0.5 * (xx + yy + zz) * (1.0 + 1e-9) {
            return Err(format!(
                "moments of inertia {xx}, {yy}, {zz} kg m^2: no body has one that is above the sum of the \
                 two others"
            ));
        }
        Ok(MassProperties {
            mass_kg,
            cg_m,
            moments_kg_m2: own,
            products_kg_m2: [0.0, 0.0, ixz_kg_m2],
        })
    }
}

/// Runs the command.
pub fn run(args: &MassArgs) -> anyhow::Result<Outcome> {
    let vehicle = Vehicle::from_toml(&VEHICLES.text(&args.vehicle)?, &args.vehicle)?;
    let (whole, count) = read(&args.components)?;
    let fields = fields(&whole, &vehicle, args)?;
    if args.json {
        let numbers = json!({
            "components": count,
            "cg_m": whole.cg_m,
            "mass_kg": whole.mass_kg,
            "moments_kg_m2": whole.moments_kg_m2,
            "products_kg_m2": whole.products_kg_m2,
            "overrides": fields,
        });
        println!("{numbers:#}");
    } else {
        print(&whole, &vehicle, count);
    }
    if let Some(output) = &args.output {
        let inputs = [args.components.as_path(), Path::new(&args.vehicle)];
        let target = Target::new(output, Kind::Toml, args.replace.force, inputs)?;
        let text = overrides::text("vehicle mass", &vehicle.name, &args.components, &fields)?;
        target.write(&text)?;
        if !args.json {
            println!("{}: overrides of [body]", output.display());
        }
    }
    Ok(Outcome::Good)
}

/// All components together, and their number.
fn read(path: &Path) -> anyhow::Result<(MassProperties, usize)> {
    let shown = path.display();
    let usage = |text: String| anyhow::Error::from(UsageError(text));
    let (mut whole, mut count): (Option<MassProperties>, usize) = (None, 0);
    let mut problems = Vec::new();
    for (number, row) in table::rows::<Row>(path, &COLUMNS, &INERTIA)?
        .into_iter()
        .enumerate()
    {
        let place = format!("component {}", number + 1);
        let found = row
            .map_err(|error| format!("{place}: {error}"))
            .and_then(|row| {
                let named = |problem| format!("{place} ({}): {problem}", row.name);
                row.component().map_err(named)
            });
        match found {
            Ok(part) => {
                count += 1;
                whole = Some(whole.map_or(part, |whole| whole.with(&part)));
            }
            Err(problem) => problems.push(problem),
        }
    }
    if !problems.is_empty() {
        return Err(usage(format!("{shown}: {}", problems.join("; "))));
    }
    let whole = whole.ok_or_else(|| usage(format!("{shown}: has no component")))?;
    Ok((whole, count))
}

/// Fields of the vehicle file.
fn fields(whole: &MassProperties, vehicle: &Vehicle, args: &MassArgs) -> anyhow::Result<Table> {
    let [x_m, y_m, z_m] = whole.cg_m;
    let wheelbase_m = vehicle.wheelbase_m();
    if !(-wheelbase_m..=0.0).contains(&x_m) {
        return Err(UsageError(format!(
            "{}: the centre of gravity is at x = {x_m:.3} m, not between the axles (0 to -{wheelbase_m:.3} \
             m); x is forward from the front axle, so that parts behind it have a negative x_m",
            args.components.display()
        ))
        .into());
    }
    let list = whole.moments_kg_m2.map(Value::Float).to_vec();
    Ok(Table::from_iter([
        ("body.mass_kg".to_owned(), Value::Float(whole.mass_kg)),
        ("body.front_axle_to_cg_m".to_owned(), Value::Float(-x_m)),
        (
            "body.cg_to_rear_axle_m".to_owned(),
            Value::Float(wheelbase_m + x_m),
        ),
        ("body.cg_y_m".to_owned(), Value::Float(y_m)),
        ("body.cg_height_m".to_owned(), Value::Float(z_m)),
        ("body.inertia_kg_m2".to_owned(), Value::Array(list)),
        (
            "body.inertia_xz_kg_m2".to_owned(),
            Value::Float(whole.products_kg_m2[2]),
        ),
    ]))
}

fn print(whole: &MassProperties, vehicle: &Vehicle, count: usize) {
    let [x_m, y_m, z_m] = whole.cg_m;
    let [roll, pitch, yaw] = whole.moments_kg_m2;
    let in_front = (vehicle.wheelbase_m() + x_m) / vehicle.wheelbase_m();
    println!("components              {count}");
    println!("mass                    {:.2} kg", whole.mass_kg);
    println!(
        "centre of gravity       {:.4} m behind the front axle, {y_m:.4} m left, {z_m:.4} m high",
        -x_m
    );
    println!("static load in front    {:.1} %", 100.0 * in_front);
    println!("moments of inertia      {roll:.2} (roll) {pitch:.2} (pitch) {yaw:.2} (yaw) kg m^2");
    println!(
        "product of inertia I_xz {:.2} kg m^2",
        whole.products_kg_m2[2]
    );
    let file = vehicle.mass_properties();
    println!(
        "the vehicle file has    {:.2} kg, {:.4} m high",
        file.mass_kg, file.cg_m[2]
    );
}
