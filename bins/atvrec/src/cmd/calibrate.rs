//! `atvrec calibrate`: calibrate the sensors from workshop logs. Each step is a command and adds its
//! values to one calibration file.

mod gnss;
mod imu;
mod marked;
mod recording;
mod zero;

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use engine::config::{TOML_MAX, read_text};
use estimator::Calibration;

use crate::cli::{CalibrateArgs, CalibrateCommand};
use crate::cmd::findings;
use crate::exit::Outcome;
use crate::output::target::{Kind, Target};

use recording::Recording;

/// Logs of a step, and the calibration so far.
pub struct Bench {
    /// Logs, at least one, all of one vehicle.
    pub recordings: Vec<Recording>,
    /// Calibration of the earlier steps, to which the step adds its values.
    pub calibration: Calibration,
}

/// Runs the command.
pub fn run(command: &CalibrateCommand) -> anyhow::Result<Outcome> {
    let args = command.shared();
    let inputs = || args.logs.iter().map(|log| &**log);
    // The values of other steps in the file are kept, so that `--force` is not needed.
    let output = Target::new(&args.output, Kind::Toml, true, inputs())?;
    let page = args.report.as_ref();
    let page = page.map(|path| Target::new(path, Kind::Page, args.replace.force, inputs()));
    let page = page.transpose()?;
    let mut bench = Bench::set_up(args)?;
    let (title, results) = match command {
        CalibrateCommand::Zero(own) => ("zero", zero::run(own, &mut bench)),
        CalibrateCommand::Imu(_) => ("imu", imu::run(&mut bench)),
        CalibrateCommand::Gnss(_) => ("gnss", gnss::run(&mut bench)),
        CalibrateCommand::Weight(own) => ("weight", marked::weigh(own, &mut bench)),
        CalibrateCommand::LoadRig(_) => ("load-rig", marked::rig(&mut bench)),
        CalibrateCommand::Steer(own) => ("steer", marked::plates(own, &mut bench)),
        CalibrateCommand::WheelRadius(_) => ("wheel-radius", gnss::wheels(&mut bench)),
    };
    let results = results.with_context(|| format!("calibrate {title}"))?;
    output.write(&bench.calibration.to_toml()?)?;
    if let Some(page) = page {
        let title = format!("Calibration: {title}");
        page.write(&findings::page(&title, bench.facts(), &results))?;
    }
    findings::print(&results, args.json)?;
    if !args.json {
        println!("wrote {}", args.output.display());
    }
    Ok(Outcome::Good)
}

impl Bench {
    fn set_up(args: &CalibrateArgs) -> anyhow::Result<Self> {
        let recordings: Vec<Recording> = args
            .logs
            .iter()
            .map(|path| Recording::read(path))
            .collect::<anyhow::Result<_>>()?;
        let first = recordings.first().context("no log is given")?;
        let name = first.vehicle.name.clone();
        for other in &recordings {
            ensure!(
                other.vehicle.name == name && other.sensors == first.sensors,
                "{} is a log of vehicle \"{}\" with sensors \"{}\", but {} is a log of vehicle \
                 \"{name}\" with sensors \"{}\"; give logs of one vehicle",
                other.path.display(),
                other.vehicle.name,
                other.sensors.name,
                first.path.display(),
                first.sensors.name,
            );
        }
        let calibration = known(&args.output, &name)?;
        Ok(Self {
            recordings,
            calibration,
        })
    }

    fn facts(&self) -> Vec<(String, String)> {
        let first = &self.recordings[0];
        let logs: Vec<String> = self
            .recordings
            .iter()
            .map(|r| r.path.display().to_string())
            .collect();
        vec![
            ("vehicle".to_owned(), first.vehicle.name.clone()),
            ("sensors".to_owned(), first.sensors.name.clone()),
            ("logs".to_owned(), logs.join(", ")),
        ]
    }
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
        "{} is the calibration of vehicle \"{}\", but the log is of vehicle \"{vehicle}\"; the file \
         is not changed; choose another file with --output",
        path.display(),
        known.vehicle,
    );
    Ok(known)
}

/// The only log of a step that takes one.
fn one_log<'a>(recordings: &'a [Recording], step: &str) -> anyhow::Result<&'a Recording> {
    let paths: Vec<&PathBuf> = recordings.iter().map(|r| &r.path).collect();
    match recordings {
        [one] => Ok(one),
        _ => anyhow::bail!(
            "the step {step} needs one log, but {} were given: {paths:?}",
            recordings.len()
        ),
    }
}
