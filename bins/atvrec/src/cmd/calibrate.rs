//! `atvrec calibrate`: calibrate the sensors from workshop logs. Each step is a command and adds its
//! values to one calibration file.

mod cg_height;
mod member;

use std::path::Path;

use anyhow::{Context, ensure};
use engine::config::{TOML_MAX, read_text};
use engine::read_recording;
use estimator::Calibration;
use estimator::calibration::{Recording, Step};

use crate::cli::{CalibrateArgs, CalibrateCommand};
use crate::cmd::findings;
use crate::exit::Outcome;
use engine::output::{Kind, Target};

/// Runs the command.
pub fn run(command: &CalibrateCommand) -> anyhow::Result<Outcome> {
    let (Some(args), Some(step)) = (command.shared(), step(command)) else {
        return match command {
            CalibrateCommand::CgHeight(args) => cg_height::run(args),
            CalibrateCommand::Member(args) => member::run(args),
            _ => Err(anyhow::anyhow!("internal error: a step without logs")),
        };
    };
    let inputs = || args.logs.iter().map(|log| &**log);
    // The values of other steps in the file are kept, so that `--force` is not needed.
    let output = Target::new(&args.output, Kind::Toml, true, inputs())?;
    let page = args.report.as_ref();
    let page = page.map(|path| Target::new(path, Kind::Page, args.replace.force, inputs()));
    let page = page.transpose()?;
    let recordings = read(args)?;
    let first = recordings.first().context("no log is given")?;
    let known = known(&args.output, &first.vehicle.name)?;
    let found = step
        .calibrate(&recordings, &known)
        .with_context(|| format!("calibrate {}", step.title()))?;
    output.write(&found.calibration.to_toml()?)?;
    if let Some(page) = page {
        let title = format!("Calibration: {}", step.title());
        page.write(&findings::page(&title, facts(&recordings), &found.findings))?;
    }
    findings::print(&found.findings, args.json)?;
    if !args.json {
        println!("wrote {}", args.output.display());
    }
    Ok(Outcome::Good)
}

/// The step, if it reads logs.
fn step(command: &CalibrateCommand) -> Option<Step> {
    Some(match command {
        CalibrateCommand::CgHeight(_) | CalibrateCommand::Member(_) => return None,
        CalibrateCommand::Zero(args) => Step::Zero {
            weight_sigma: args.weight_sigma,
        },
        CalibrateCommand::Imu(_) => Step::Imu,
        CalibrateCommand::Gnss(_) => Step::Gnss,
        CalibrateCommand::Weight(args) => Step::Weight {
            scales: args.scales.clone(),
        },
        CalibrateCommand::LoadRig(_) => Step::LoadRig,
        CalibrateCommand::Steer(args) => Step::Steer {
            plate_sigma_rad: args.plate_sigma_deg.to_radians(),
        },
        CalibrateCommand::WheelRadius(_) => Step::WheelRadius,
        CalibrateCommand::Hub(_) => Step::Hub,
        CalibrateCommand::Temperature(_) => Step::Temperature,
    })
}

fn read(args: &CalibrateArgs) -> engine::Result<Vec<Recording>> {
    args.logs.iter().map(|path| read_recording(path)).collect()
}

fn facts(recordings: &[Recording]) -> Vec<(String, String)> {
    let first = &recordings[0];
    let logs: Vec<&str> = recordings.iter().map(|r| r.name.as_str()).collect();
    vec![
        ("vehicle".to_owned(), first.vehicle.name.clone()),
        ("sensors".to_owned(), first.sensors.name.clone()),
        ("logs".to_owned(), logs.join(", ")),
    ]
}

/// Calibration of the earlier steps; the nominal calibration if there is no file yet.
fn known(path: &Path, vehicle: &str) -> anyhow::Result<Calibration> {
    let text = match read_text(path, TOML_MAX) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            return Ok(Calibration::nominal(vehicle));
        }
        Err(error) => {
            return Err(error).with_context(|| format!("cannot read {}", path.display()));
        }
    };
    let known = Calibration::from_toml(&text)
        .with_context(|| format!("cannot use {}; the file is not changed", path.display()))?;
    ensure!(
        known.vehicle == vehicle,
        "{} is the calibration of vehicle \"{}\", but this step is for vehicle \"{vehicle}\"; the file \
         is not changed; choose another file with --output",
        path.display(),
        known.vehicle,
    );
    Ok(known)
}
