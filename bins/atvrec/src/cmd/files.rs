//! `atvrec vehicle` and `atvrec sensors`: the built-in files as templates, checks, drawings, and what a vehicle file
//! gives without a drive.

mod gauges;
mod mass;
mod template;

use std::path::Path;

use anyhow::Context;
use engine::config::{TOML_MAX, read_text, with_tyre_files};
use engine::output::{Kind, Target};
use model::FileErrors;
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::text::printable;

use crate::cli::{CheckFilesArgs, DrawArgs, NewArgs, SensorsCommand, ShowArgs, VehicleCommand};
use crate::exit::{Outcome, UsageError};
use crate::messages;

/// A kind of file that has built-in examples.
pub struct Files {
    /// Name of the kind.
    pub kind: &'static str,
    builtin: fn(&str) -> Option<&'static str>,
    /// Adds to a text what other files contain.
    complete: fn(&str, &Path) -> Result<String, FileErrors>,
    names: fn() -> Vec<&'static str>,
    /// Name and warnings of a text, and what is wrong with it.
    read: fn(&str, &str) -> anyhow::Result<Checked>,
    /// Name of the built-in file that is the template, if no other one is named.
    pub default: &'static str,
    /// JSON Schema of the kind, with the meaning of each field.
    schema: &'static str,
    /// Beginning of a template.
    header: &'static str,
}

const VEHICLE_HEADER: &str = "\
Template of a vehicle file. The values are those of a built-in vehicle: replace each of them.
Units are SI. Axes: x forward, y to the left, z up. The manual page atvrec-vehicle(5) describes the frame of each point.
What to measure first:
1. masses: each wheel on a scale, with and without driver and load; they give mass_kg and the axle distances of [body]
2. track widths, and the height of the centre of gravity
3. hard-points of the left corners of both axles, from the ground below the middle of the axle
4. springs, dampers and stops of [front.strut] and [rear.strut]
5. steering: turns of the steering wheel against the angles of the road wheels
6. tyres: radius and vertical stiffness
Then: `atvrec vehicle check FILE` names values that are far from usual, and `atvrec vehicle draw FILE` shows a mistyped coordinate.
";

const SENSORS_HEADER: &str = "\
Template of a sensors file. The values are those of a built-in sensor set: replace each of them.
Units are SI. The manual page atvrec-sensors(5) describes each field.
What to find out first:
1. strain: diameters of the tubes, wiring of the bridges, gauge factor, excitation, gain resistor, bits of the converter
2. rates: how often each device sends; `atvrec check` compares them with the rates that arrive
3. positions of the inertial unit and of the antennas, from the centre of gravity without payload
4. noise: from the data sheets, or from a recording at rest
Then: `atvrec sensors check FILE`.
";

/// Vehicle files.
pub const VEHICLES: Files = Files {
    kind: "vehicle",
    builtin: Vehicle::builtin_text,
    complete: with_tyre_files,
    names: || Vehicle::builtin_names().collect(),
    read: |text, file| {
        let vehicle = Vehicle::from_toml(text, file)?;
        let warnings = vehicle.warnings();
        Ok((
            vehicle.name,
            warnings.iter().map(ToString::to_string).collect(),
        ))
    },
    default: "prowler",
    schema: include_str!("../../../../docs/vehicle-file.schema.json"),
    header: VEHICLE_HEADER,
};

/// Sensors files.
pub const SENSORS: Files = Files {
    kind: "sensors",
    builtin: Sensors::builtin_text,
    complete: |text, _| Ok(text.to_owned()),
    names: || Sensors::builtin_names().collect(),
    read: |text, file| Ok((Sensors::from_toml(text, file)?.name, Vec::new())),
    default: "thesis-10bit",
    schema: include_str!("../../../../docs/sensors-file.schema.json"),
    header: SENSORS_HEADER,
};

impl Files {
    /// Text of a built-in file or of a file, with what other files contain.
    fn text(&self, file: &str) -> anyhow::Result<String> {
        Ok((self.complete)(&self.own_text(file)?, Path::new(file))?)
    }

    /// Text of a built-in file or of a file.
    fn own_text(&self, file: &str) -> anyhow::Result<String> {
        if let Some(text) = (self.builtin)(file) {
            return Ok(text.to_owned());
        }
        let path = Path::new(file);
        if !path.exists() {
            return Err(UsageError(format!(
                "{file} is neither a file nor the name of a built-in {} file; the built-in ones are {}",
                self.kind,
                (self.names)().join(", ")
            ))
            .into());
        }
        read_text(path, TOML_MAX).with_context(|| format!("cannot read {}", path.display()))
    }

    /// Whether this is the name of a built-in file.
    pub fn is_builtin(&self, name: &str) -> bool {
        (self.builtin)(name).is_some()
    }

    /// Names of the built-in files.
    pub fn names(&self) -> Vec<&'static str> {
        (self.names)()
    }

    /// Usual name of a file of this kind.
    pub fn file_name(&self) -> String {
        format!("{}.toml", self.kind)
    }

    /// Refuses a file that cannot be read or has an error.
    pub fn check(&self, file: &str) -> anyhow::Result<()> {
        (self.read)(&self.text(file)?, file).map(drop)
    }

    /// A built-in file as a template.
    pub fn template(&self, name: &str) -> anyhow::Result<String> {
        template::template(&self.text(name)?, self.schema, self.header)
    }

    fn new_file(&self, args: &NewArgs) -> anyhow::Result<Outcome> {
        let name = args.template.as_deref().unwrap_or(self.default);
        if !self.is_builtin(name) {
            return Err(UsageError(format!(
                "{name} is not the name of a built-in {} file; the built-in ones are {}",
                self.kind,
                self.names().join(", ")
            ))
            .into());
        }
        let output = args
            .output
            .clone()
            .unwrap_or_else(|| self.file_name().into());
        let target = Target::new(&output, Kind::Toml, args.replace.force, [Path::new(name)])?;
        target.write(&self.template(name)?)?;
        println!(
            "{}: template of a {} file, with the values of {name}",
            output.display(),
            self.kind
        );
        Ok(Outcome::Good)
    }

    fn show(&self, args: &ShowArgs) -> anyhow::Result<Outcome> {
        if let Some(file) = &args.file {
            print!("{}", self.text(file)?);
        } else {
            for name in (self.names)() {
                let text = (self.builtin)(name).unwrap_or_default();
                let title =
                    toml::from_str::<Titled>(text).map_or_else(|_| String::new(), |t| t.name);
                println!("{name:<32} {title}");
            }
        }
        Ok(Outcome::Good)
    }
}

/// The name in a file.
#[derive(serde::Deserialize)]
struct Titled {
    name: String,
}

/// Runs `atvrec vehicle`.
pub fn vehicle(command: &VehicleCommand) -> anyhow::Result<Outcome> {
    match command {
        VehicleCommand::New(args) => VEHICLES.new_file(args),
        VehicleCommand::Show(args) => VEHICLES.show(args),
        VehicleCommand::Check(args) => check(&VEHICLES, args),
        VehicleCommand::Draw(args) => draw(args),
        VehicleCommand::Mass(args) => mass::run(args),
        VehicleCommand::Gauges(args) => gauges::run(args),
    }
}

/// Runs `atvrec sensors`.
pub fn sensors(command: &SensorsCommand) -> anyhow::Result<Outcome> {
    match command {
        SensorsCommand::New(args) => SENSORS.new_file(args),
        SensorsCommand::Show(args) => SENSORS.show(args),
        SensorsCommand::Check(args) => check(&SENSORS, args),
    }
}

/// Name and warnings of a file.
type Checked = (String, Vec<String>);

fn check(files: &Files, args: &CheckFilesArgs) -> anyhow::Result<Outcome> {
    let mut outcome = Outcome::Good;
    for file in &args.files {
        let text = files.own_text(file)?;
        let complete = (files.complete)(&text, Path::new(file));
        let read = complete.map_err(anyhow::Error::from);
        match read.and_then(|text| (files.read)(&text, file)) {
            Ok((name, warnings)) => {
                println!("{file}: {}, no errors", printable(&name));
                for warning in warnings {
                    println!("warning: {}", printable(&warning));
                }
            }
            Err(error) => {
                messages::failed(&error);
                outcome = Outcome::Failed;
            }
        }
    }
    Ok(outcome)
}

fn draw(args: &DrawArgs) -> anyhow::Result<Outcome> {
    let inputs = [Path::new(&args.file)];
    let target = Target::new(&args.output, Kind::Any, args.replace.force, inputs)?;
    let vehicle = Vehicle::from_toml(&VEHICLES.text(&args.file)?, &args.file)?;
    target.write(&report::drawing::linkages(&vehicle)?)?;
    println!("{}: {}", args.output.display(), printable(&vehicle.name));
    Ok(Outcome::Good)
}
