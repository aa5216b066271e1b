//! Replay and simulation in this process.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use engine::output::{Kind, LogFile, Target};
use engine::{
    Changes, Config, Course, Drive, Entry, FileSource, Replay, ReplayOptions, VirtualDrive,
};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use store::Reader;

use crate::calibration::Calibration;
use crate::estimates::Collected;
use crate::log::LogReader;
use crate::sensors::Sensors;
use crate::vehicle::Vehicle;
use crate::{errors, interrupt};

/// A vehicle, sensors or calibration: an object of the package, a file, or the name of one that ships
/// with the package.
#[derive(FromPyObject)]
pub enum File<'py> {
    Vehicle(Bound<'py, Vehicle>),
    Sensors(Bound<'py, Sensors>),
    Calibration(Bound<'py, Calibration>),
    Path(PathBuf),
}

impl File<'_> {
    /// What the engine reads.
    fn source(self, argument: &str) -> PyResult<FileSource> {
        let text = match (argument, &self) {
            ("vehicle", Self::Vehicle(vehicle)) => vehicle.get().to_toml()?,
            ("sensors", Self::Sensors(sensors)) => sensors.get().to_toml()?,
            ("calibration", Self::Calibration(calibration)) => calibration.get().to_toml()?,
            (_, Self::Path(path)) => return Ok(FileSource::Path(path.clone())),
            _ => {
                return Err(errors::argument(format!(
                    "{argument}: must be a file, or an object of the class for {argument}"
                )));
            }
        };
        Ok(FileSource::Text(text))
    }
}

/// An error of the engine, or what Python raised meanwhile.
enum Stop {
    Engine(engine::Error),
    Python(PyErr),
}

impl From<engine::Error> for Stop {
    fn from(error: engine::Error) -> Self {
        Self::Engine(error)
    }
}

impl From<Stop> for PyErr {
    fn from(stop: Stop) -> Self {
        match stop {
            Stop::Engine(error) => errors::engine(&error),
            Stop::Python(error) => error,
        }
    }
}

/// Estimates, parameters and events, as [`Collected::into_python`] gives them.
type Estimated<'py> = (Bound<'py, PyDict>, Bound<'py, PyDict>, Bound<'py, PyList>);

/// Replays a log: what `atvrec replay --json` prints, and the estimates where no log is written. What
/// Python users see is `atvrec.replay`.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub fn replay_log<'py>(
    py: Python<'py>,
    log: &LogReader,
    output: Option<PathBuf>,
    force: bool,
    config: Option<PathBuf>,
    vehicle: Option<File<'py>>,
    overrides: Vec<PathBuf>,
    sensors: Option<File<'py>>,
    calibration: Option<File<'py>>,
    payload: Option<Vec<String>>,
    without: Vec<String>,
    with_inputs: Vec<String>,
    method: Option<String>,
    smooth: bool,
    verify: bool,
    compress: bool,
) -> PyResult<(String, Option<Estimated<'py>>)> {
    let file = |name, file: Option<File<'py>>| file.map(|file| file.source(name)).transpose();
    let changes = Changes {
        vehicle: file("vehicle", vehicle)?,
        overrides: overrides.into_iter().map(Into::into).collect(),
        sensors: file("sensors", sensors)?,
        calibration: file("calibration", calibration)?,
        payload,
        without,
        with: with_inputs,
        method,
    };
    let job = Job {
        reader: Arc::clone(&log.reader),
        output: replay_target(
            &log.paths,
            output.as_deref(),
            force,
            config.as_deref(),
            &changes,
        )?,
        config,
        changes,
        options: ReplayOptions {
            smooth,
            verify,
            truth: output.is_some(),
            without_records: false,
        },
        compress,
    };
    let (json, collected) = py.detach(|| job.run())?;
    let estimated = collected
        .map(|collected| collected.into_python(py))
        .transpose()?;
    Ok((json, estimated))
}

fn replay_target(
    logs: &[PathBuf],
    output: Option<&Path>,
    force: bool,
    config: Option<&Path>,
    changes: &Changes,
) -> PyResult<Option<Target>> {
    let Some(output) = output else {
        return Ok(None);
    };
    let files = [&changes.vehicle, &changes.sensors, &changes.calibration];
    let files = files.into_iter().flatten().chain(&changes.overrides);
    let paths = files.filter_map(|file| match file {
        FileSource::Path(path) => Some(path.as_path()),
        FileSource::Text(_) => None,
    });
    let inputs = logs.iter().map(PathBuf::as_path).chain(config).chain(paths);
    let target = Target::new(output, Kind::Log, force, inputs);
    target.map(Some).map_err(|error| errors::engine(&error))
}

/// A replay that can be run without the GIL.
struct Job {
    reader: Arc<Reader>,
    output: Option<Target>,
    config: Option<PathBuf>,
    changes: Changes,
    options: ReplayOptions,
    /// Compress the chunks of the output.
    compress: bool,
}

impl Job {
    fn run(self) -> Result<(String, Option<Collected>), Stop> {
        let config = match &self.config {
            Some(path) => Config::load(path)?,
            None => {
                let attachments = self.reader.attachments().map_err(engine::Error::from)?;
                self.changes.configuration(attachments)?
            }
        };
        let replay = Replay::new(&self.reader, &config, self.options)?;
        let mut sink = match &self.output {
            Some(target) => {
                let mut options = replay.log_options().clone();
                if !self.compress {
                    options.compression_level = None;
                }
                Sink::Log(Box::new(target.log(replay.session().clone(), options)?))
            }
            None => Sink::Memory(Collected::default()),
        };
        let mut interrupt = interrupt::Watch::default();
        let done = replay.run(|entry| {
            interrupt.check().map_err(Stop::Python)?;
            sink.push(entry)
        })?;
        let json = done.to_json().to_string();
        match sink {
            Sink::Log(log) => {
                log.finish()?;
                Ok((json, None))
            }
            Sink::Memory(collected) => Ok((json, Some(collected))),
        }
    }
}

/// What records go to.
enum Sink {
    Log(Box<LogFile>),
    Memory(Collected),
}

impl Sink {
    fn push(&mut self, entry: Entry) -> Result<(), Stop> {
        match (self, entry) {
            (Self::Log(log), entry) => log.push(entry)?,
            (Self::Memory(collected), Entry::Record(record)) => collected.record(record),
            (Self::Memory(_), Entry::Arrival(_)) => {}
        }
        Ok(())
    }
}

/// Duration, s, name of the drive, arrivals, and decoded messages.
type Simulated = (f64, String, u64, u64);

/// Drives a virtual vehicle and writes the log: seconds, name of the drive, arrivals, and decoded
/// messages. What Python users see is `atvrec.simulate`.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub fn simulate_log(
    py: Python<'_>,
    manoeuvre: Option<String>,
    truth: Option<PathBuf>,
    road: Option<String>,
    output: PathBuf,
    force: bool,
    vehicle: File<'_>,
    sensors: File<'_>,
    payload: Vec<String>,
    seed: u64,
    options: Option<PathBuf>,
    duration_s: Option<f64>,
    config: Option<PathBuf>,
    true_calibration: Option<PathBuf>,
) -> PyResult<Simulated> {
    let course = match (manoeuvre, truth) {
        (Some(name), None) => Course::Manoeuvre(name),
        (None, Some(path)) => Course::Truth(path),
        (None, None) | (Some(_), Some(_)) => {
            return Err(errors::argument(
                "manoeuvre and truth: give one of them, the name of a manoeuvre or a truth file",
            ));
        }
    };
    if let (Some(road), Course::Truth(path)) = (&road, &course) {
        return Err(errors::argument(format!(
            "road = {road:?}: the motion of {} has its own ground; leave out road",
            path.display()
        )));
    }
    let simulation = Simulation {
        course,
        road,
        vehicle: vehicle.source("vehicle")?,
        sensors: sensors.source("sensors")?,
        payload,
        seed,
        options,
        duration_s,
        config,
    };
    let target = |path: &Path, kind| {
        let target = Target::new(path, kind, force, simulation.inputs());
        target.map_err(|error| errors::engine(&error))
    };
    let log = target(&output, Kind::Log)?;
    let calibration = true_calibration
        .map(|path| target(&path, Kind::Toml))
        .transpose()?;
    Ok(py.detach(move || simulation.run(&log, calibration.as_ref()))?)
}

/// A simulation that can be run without the GIL.
struct Simulation {
    course: Course,
    road: Option<String>,
    vehicle: FileSource,
    sensors: FileSource,
    payload: Vec<String>,
    seed: u64,
    options: Option<PathBuf>,
    duration_s: Option<f64>,
    config: Option<PathBuf>,
}

impl Simulation {
    /// The files that it reads.
    fn inputs(&self) -> impl Iterator<Item = &Path> {
        let truth = match &self.course {
            Course::Truth(path) => Some(path),
            Course::Manoeuvre(_) => None,
        };
        let sources = [&self.vehicle, &self.sensors].map(|file| match file {
            FileSource::Path(path) => Some(path),
            FileSource::Text(_) => None,
        });
        let files = [truth, self.options.as_ref(), self.config.as_ref()];
        let files = files.into_iter().chain(sources).flatten();
        let road = self.road.iter().map(Path::new);
        files.map(PathBuf::as_path).chain(road)
    }

    fn run(self, log: &Target, calibration: Option<&Target>) -> Result<Simulated, Stop> {
        let options = self.options.as_deref().map(engine::read_options);
        let mut simulated = VirtualDrive::new(&Drive {
            course: self.course,
            road: self.road,
            vehicle: self.vehicle,
            sensors: self.sensors,
            payload: self.payload,
            seed: self.seed,
            options: options.transpose()?.unwrap_or_default(),
            duration_s: self.duration_s,
        })?;
        let config = match &self.config {
            Some(path) => Config::load(path)?,
            None => simulated.config()?,
        };
        let mut log = log.log(simulated.session(&config), config.storage.options.clone())?;
        if let Some(target) = calibration {
            let text = simulated.true_calibration.to_toml();
            target.write(&text.map_err(engine::Error::from)?)?;
        }
        let mut interrupt = interrupt::Watch::default();
        let arrivals = engine::simulate(&mut simulated, &config, |entry| {
            interrupt.check().map_err(Stop::Python)?;
            Ok::<_, Stop>(log.push(entry)?)
        })?;
        let messages = log.finish()?.counters.messages;
        Ok((simulated.duration_s(), simulated.drive, arrivals, messages))
    }
}

/// Names of the manoeuvres of the virtual vehicle.
#[pyfunction]
pub fn manoeuvres() -> Vec<&'static str> {
    sim::Manoeuvre::ALL
        .iter()
        .map(|manoeuvre| manoeuvre.name())
        .collect()
}
