//! `atvrec identify`: identify parameters of the vehicle from logs of drives.

mod handling;
mod latency;
mod mistakes;
mod outputs;

use std::path::Path;

use anyhow::Context;
use engine::config::{TOML_MAX, read_text};
use engine::output::{Kind, Target};
use engine::{Config, Window, read_drive, read_swing, vehicle_file, vehicle_of};
use estimator::identification::inertia::Pendulum;
use estimator::identification::{Identified, Method, against, pressure, roll_centres, swing, tyre};
use store::Reader;

use crate::cli::{
    IdentifyArgs, IdentifyCommand, InertiaArgs, JudgedRunArgs, PendulumKind, RollCentreArgs,
    TyreArgs,
};
use crate::cmd::findings;
use crate::exit::{Outcome, UsageError};

use outputs::Outputs;

/// Axes of an inertial unit.
const AXES: [&str; 3] = ["x", "y", "z"];

/// What a command found.
struct Found {
    title: &'static str,
    vehicle: String,
    logs: Vec<String>,
    identified: Identified,
}

/// Runs the command.
pub fn run(command: &IdentifyCommand) -> anyhow::Result<Outcome> {
    let outputs = Outputs::check(command)?;
    let (found, output) = match command {
        IdentifyCommand::Cornering(args) => (in_drive(args, &Method::Cornering)?, &args.output),
        IdentifyCommand::Tyre(args) => (tyres(args)?, &args.shared.output),
        IdentifyCommand::RollPitch(args) => (in_drive(args, &Method::RollPitch)?, &args.output),
        IdentifyCommand::Inertia(args) => {
            let found = match args.pendulum {
                Some(kind) => pendulum(args, kind)?,
                None => in_drive(&args.shared, &Method::YawInertia)?,
            };
            (found, &args.shared.output)
        }
        IdentifyCommand::RollCentre(args) => (roll_centre(args)?, &args.output),
        IdentifyCommand::Understeer(args) => (in_drive(args, &Method::Understeer)?, &args.output),
        IdentifyCommand::Response(args) => {
            let method = Method::Response {
                step_min_rad: args.step_min_deg.to_radians(),
                window_s: args.window_s,
            };
            (in_drive(&args.shared, &method)?, &args.shared.output)
        }
        IdentifyCommand::Friction(args) => (in_drive(args, &Method::Friction)?, &args.output),
        IdentifyCommand::Slip(args) => (in_drive(args, &Method::Slip)?, &args.output),
        IdentifyCommand::Camber(args) => (in_drive(args, &Method::Camber)?, &args.output),
        IdentifyCommand::Aligning(args) => (in_drive(args, &Method::Aligning)?, &args.output),
        IdentifyCommand::Toe(args) => (in_drive(args, &Method::Toe)?, &args.output),
        IdentifyCommand::Handling(args) => return handling::run(args),
        IdentifyCommand::Latency(args) => return latency::run(args),
        IdentifyCommand::Mistakes(args) => return mistakes::run(args),
    };
    outputs.write(&found)?;
    findings::print(&found.identified.results, output.json)?;
    Ok(Outcome::Good)
}

/// Applies a method to the drive of the logs.
fn in_drive(args: &IdentifyArgs, method: &Method) -> anyhow::Result<Found> {
    let reader = Reader::open(&args.logs)?;
    let given = args.vehicle.as_deref().map(vehicle_file).transpose()?;
    let recorded = read_drive(&reader, given, window(args), method)?;
    Ok(Found {
        title: method.title(),
        vehicle: recorded.vehicle.name.clone(),
        logs: logs(args),
        identified: method.identify(&recorded, args.seed)?,
    })
}

/// The tyres of the logs, and their differences from those of another log or file.
fn tyres(args: &TyreArgs) -> anyhow::Result<Found> {
    let method = Method::Tyre(kinds(args.model.as_deref())?);
    let mut found = in_drive(&args.shared, &method)?;
    let Some(other) = &args.against else {
        return Ok(found);
    };
    let shown = other.display();
    let others = if other
        .extension()
        .is_some_and(|extension| extension == "toml")
    {
        let text = read_text(other, TOML_MAX).with_context(|| format!("cannot read {shown}"))?;
        against::results(&text).with_context(|| format!("cannot use {shown}"))?
    } else {
        let reader = Reader::open(std::slice::from_ref(other))?;
        // The other drive can be of a vehicle file that differs in its tyres.
        let recorded = read_drive(&reader, None, window(&args.shared), &method)?;
        let identified = method.identify(&recorded, args.shared.seed);
        identified
            .with_context(|| format!("cannot use {shown}"))?
            .results
    };
    let differences = against::differences(&found.identified.results, &others)?;
    let laws = pressure::laws(&found.identified.results, &others);
    found.identified.results.extend(differences);
    found.identified.extend(laws);
    Ok(found)
}

fn window(args: &IdentifyArgs) -> Window {
    Window {
        from_s: args.from_s,
        to_s: args.to_s,
    }
}

fn logs(args: &IdentifyArgs) -> Vec<String> {
    let paths = args.logs.iter();
    paths.map(|path| path.display().to_string()).collect()
}

fn kinds(name: Option<&str>) -> anyhow::Result<Vec<tyre::Kind>> {
    let Some(name) = name else {
        return Ok(tyre::Kind::ALL.to_vec());
    };
    let known = tyre::Kind::ALL.map(tyre::Kind::name).join(", ");
    tyre::Kind::ALL
        .into_iter()
        .find(|kind| kind.name() == name)
        .map(|kind| vec![kind])
        .ok_or_else(|| {
            UsageError(format!(
                "\"{name}\" is not a tyre model; use one of: {known}"
            ))
            .into()
        })
}

fn pendulum(args: &InertiaArgs, kind: PendulumKind) -> anyhow::Result<Found> {
    let needs = |value: Option<f64>, name: &str| {
        value.ok_or_else(|| UsageError(format!("this kind of pendulum needs --{name}")))
    };
    let shared = &args.shared;
    let reader = Reader::open(&shared.logs)?;
    let given = shared.vehicle.as_deref().map(vehicle_file).transpose()?;
    let vehicle = vehicle_of(&reader, given)?;
    let (rate_rad_s, dt_s) = read_swing(&reader, window(shared), &args.axis)?;
    let mass_kg = args.mass_kg.unwrap_or(vehicle.body.mass_kg);
    let hung = match kind {
        PendulumKind::Compound => Pendulum::Compound {
            mass_kg,
            distance_m: needs(args.arm_m, "arm-m")?,
        },
        PendulumKind::Wires => Pendulum::Wires {
            mass_kg,
            radius_m: needs(args.arm_m, "arm-m")?,
            length_m: needs(args.length_m, "length-m")?,
        },
        PendulumKind::Springs => Pendulum::Springs {
            stiffness_n_m_rad: needs(args.stiffness_n_m_rad, "stiffness-n-m-rad")?,
        },
    };
    let axis = AXES.iter().position(|axis| *axis == args.axis);
    let identified = swing(
        &vehicle,
        &rate_rad_s,
        dt_s,
        axis.unwrap_or(2),
        hung,
        args.fixture_kg_m2,
        shared.seed,
    )?;
    Ok(Found {
        title: Method::YawInertia.title(),
        vehicle: vehicle.name,
        logs: logs(shared),
        identified,
    })
}

fn roll_centre(args: &RollCentreArgs) -> anyhow::Result<Found> {
    let vehicle = vehicle_file(&args.vehicle)?;
    let identified = roll_centres(&vehicle)?;
    Ok(Found {
        title: "roll-centre",
        vehicle: vehicle.name,
        logs: Vec::new(),
        identified,
    })
}

/// The file that is to be written, if any, the log, and the configuration that is judged.
fn judged(
    args: &JudgedRunArgs,
    output: Option<&Path>,
) -> anyhow::Result<(Option<Target>, Reader, Config)> {
    let inputs = args.logs.iter().chain(&args.config).map(|path| &**path);
    let target = output
        .map(|path| Target::new(path, Kind::Toml, args.replace.force, inputs))
        .transpose()?;
    let reader = Reader::open(&args.logs)?;
    let config = match &args.config {
        Some(path) => Config::load(path)?,
        None => Config::from_attachments(&reader.attachments()?)?,
    };
    Ok((target, reader, config))
}
