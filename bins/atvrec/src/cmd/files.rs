//! `atvrec vehicle` and `atvrec sensors`: the built-in files as templates, checks, and a drawing.

use std::path::Path;

use anyhow::Context;
use engine::config::{TOML_MAX, read_text};
use engine::output::{Kind, Target};
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::text::printable;

use crate::cli::{CheckFilesArgs, DrawArgs, SensorsCommand, ShowArgs, VehicleCommand};
use crate::exit::{Outcome, UsageError};
use crate::messages;

/// A kind of file that has built-in examples.
pub struct Files {
    /// Name of the kind.
    pub kind: &'static str,
    builtin: fn(&str) -> Option<&'static str>,
    names: fn() -> Vec<&'static str>,
    /// Name and warnings of a text, and what is wrong with it.
    read: fn(&str, &str) -> anyhow::Result<Checked>,
}

/// Vehicle files.
pub const VEHICLES: Files = Files {
    kind: "vehicle",
    builtin: Vehicle::builtin_text,
    names: || Vehicle::builtin_names().collect(),
    read: |text, file| {
        let vehicle = Vehicle::from_toml(text, file)?;
        let warnings = vehicle.warnings();
        Ok((
            vehicle.name,
            warnings.iter().map(ToString::to_string).collect(),
        ))
    },
};

/// Sensors files.
pub const SENSORS: Files = Files {
    kind: "sensors",
    builtin: Sensors::builtin_text,
    names: || Sensors::builtin_names().collect(),
    read: |text, file| Ok((Sensors::from_toml(text, file)?.name, Vec::new())),
};

impl Files {
    /// Text of a built-in file or of a file.
    fn text(&self, file: &str) -> anyhow::Result<String> {
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
        self.text(name)
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
        VehicleCommand::Show(args) => VEHICLES.show(args),
        VehicleCommand::Check(args) => check(&VEHICLES, args),
        VehicleCommand::Draw(args) => draw(args),
    }
}

/// Runs `atvrec sensors`.
pub fn sensors(command: &SensorsCommand) -> anyhow::Result<Outcome> {
    match command {
        SensorsCommand::Show(args) => SENSORS.show(args),
        SensorsCommand::Check(args) => check(&SENSORS, args),
    }
}

/// Name and warnings of a file.
type Checked = (String, Vec<String>);

fn check(files: &Files, args: &CheckFilesArgs) -> anyhow::Result<Outcome> {
    let mut outcome = Outcome::Good;
    for file in &args.files {
        match (files.read)(&files.text(file)?, file) {
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
