//! Errors of the engine.

use std::io;
use std::path::PathBuf;

use crate::config::{FileProblem, Problems};
use crate::output::{TargetError, WriteError};

/// Result of the engine.
pub type Result<T> = std::result::Result<T, Error>;

/// Error of a configuration, an engine, a replay or a simulation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The configuration has errors, or a file that it names has.
    #[error(transparent)]
    Configuration(#[from] Problems),
    /// The configuration cannot be read.
    #[error(
        "cannot read the configuration {path}: {cause}; `atvrec virtual` writes an example, \
         docs/configuration.md describes every field"
    )]
    ConfigurationUnreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        cause: io::Error,
    },
    /// The configuration has no field.
    #[error("the configuration {path} is empty (it has no field); nothing was changed")]
    ConfigurationEmpty {
        /// Path of the file.
        path: PathBuf,
    },
    /// A configuration without a vehicle is to be compared with a log.
    #[error(
        "the configuration has no vehicle, or its estimator is switched off, so that nothing can be compared \
         with the log; set file in the table [vehicle]"
    )]
    NoVehicleToJudge,
    /// A configuration is to be judged by forces that the vehicle file does not give.
    #[error(
        "the vehicle {0} has no linkages in its vehicle file, so that forces cannot be compared; use \
         `atvrec check --with LOG`"
    )]
    NoForcesToJudge(String),
    /// Latencies are to be found, but the configuration knows all of them.
    #[error(
        "the configuration states no uncertainty of a latency, so that none can be found; set latency_sigma_s in the \
         table of a source, such as latency_s = 0.0025 and latency_sigma_s = 0.0015 for 0 to 5 ms"
    )]
    NoUncertainLatency,
    /// A log gets an entry after an error.
    #[error("the log {0} takes no entry after an error")]
    LogClosed(PathBuf),
    /// The log has no configuration among its attachments.
    #[error("the log contains no configuration; give one with --config")]
    NoConfiguration,
    /// The log's configuration is not text.
    #[error("the configuration in the log is not UTF-8 text; give one with --config")]
    ConfigurationNotText(#[from] std::str::Utf8Error),
    /// The configuration in the log is not TOML.
    #[error(transparent)]
    AttachedConfiguration(toml::de::Error),
    /// A field of the configuration in the log has the wrong type.
    #[error(
        "{name} in the configuration of the log is not a {what}; give another one with --config"
    )]
    NotA {
        /// Name of the field.
        name: &'static str,
        /// Expected type.
        what: &'static str,
    },
    /// The changed configuration cannot be written.
    #[error(transparent)]
    Toml(#[from] toml::ser::Error),
    /// An input of `--with` is not ignored by the configuration in the log.
    #[error(
        "--with {input}: the configuration in the log does not ignore this input; {}",
        ignores(.ignored)
    )]
    NotIgnored {
        /// Name of the input.
        input: String,
        /// Inputs that the configuration in the log ignores.
        ignored: Vec<String>,
    },
    /// A file cannot be read.
    #[error("cannot read {path}")]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// A file that the configuration names cannot be read.
    #[error(transparent)]
    File(#[from] FileProblem),
    /// The configuration has other sources than the log.
    #[error(
        "the configuration does not contain the sources {} of the log with the same numbers; it must \
         contain all sources of the log", .0.join(", ")
    )]
    OtherSources(Vec<String>),
    /// A part of the run is missing, so that the log cannot be verified.
    #[error(
        "{0}, so that the state of the estimator at the start of the next part is unknown and the log \
         cannot be verified; give all parts of the run to `replay --verify`, from part 0 on"
    )]
    PartsMissing(store::Missing),
    /// A log has no data in a stretch of time.
    #[error(
        "the log has no data between {from_s:.3} s and {to_s:.3} s: it is {log_s:.3} s long; use other times"
    )]
    EmptyStretch {
        /// Begin, s from the start of the log.
        from_s: f64,
        /// End, s from the start of the log.
        to_s: f64,
        /// Length of the log, s.
        log_s: f64,
    },
    /// A run cannot be merged with others.
    #[error("the run {run} cannot be merged: this version cannot read its configuration")]
    NotMergeable {
        /// The run.
        run: String,
        /// Why.
        #[source]
        cause: Box<Error>,
    },
    /// Runs have sources of equal names.
    #[error(
        "several runs have the sources {}; --rename gives those of the later runs a number. They would be the \
         same sources if the runs followed each other and the configurations described them alike",
        .0.join(", ")
    )]
    EqualSources(Vec<String>),
    /// Runs have files of equal names and other contents.
    #[error(
        "the runs have different files of the name {0}, but a log contains one file of a name; give one of them \
         another name in the configuration of its recorder"
    )]
    OtherFiles(String),
    /// Runs have different vehicles.
    #[error("the runs have different vehicles, {} and {}; merge runs of one vehicle", .0[0], .0[1])]
    OtherVehicles([String; 2]),
    /// The road is of no class.
    #[error(
        "--road iso8608:{letter}: {letter:?} is not a class of ISO 8608; use A, B, C, D, E or F"
    )]
    RoadClass {
        /// The class asked for.
        letter: String,
    },
    /// The road file cannot be read.
    #[error("cannot read the road {path}; use iso8608:A to iso8608:F or the path of a road file")]
    RoadUnreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The options of the virtual vehicle cannot be read.
    #[error("cannot read the options {path}")]
    OptionsUnreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The options of the virtual vehicle are wrong.
    #[error("{path}: {cause}")]
    Options {
        /// Path of the file.
        path: PathBuf,
        /// Error of the TOML parser.
        cause: Box<toml::de::Error>,
    },
    /// The vehicle cannot perform the manoeuvre.
    #[error("the vehicle cannot perform the manoeuvre {manoeuvre}")]
    Manoeuvre {
        /// Name of the manoeuvre.
        manoeuvre: String,
        /// Why.
        source: Box<sim::SimError>,
    },
    /// Toe compliance for the motion of a file.
    #[error(
        "the options have the table toe, but the steer angles of the motion are those of {path}: remove \
             the table, or simulate a manoeuvre"
    )]
    ToeOfTruth {
        /// The file of the motion.
        path: PathBuf,
    },
    /// Tyre pressures for the motion of a file.
    #[error(
        "the options have tyre_pressure_pa, but the tyres of the motion are those of {path}: remove the field, or \
             simulate a manoeuvre"
    )]
    PressureOfTruth {
        /// The file of the motion.
        path: PathBuf,
    },
    /// Tyre pressures for tyres that do not depend on them.
    #[error(
        "the options have tyre_pressure_pa, but no tyre of {vehicle} depends on its pressure: add a table \
             [front.tyre.pressure] or [rear.tyre.pressure], or remove the field"
    )]
    NoPressureLaw {
        /// Name of the vehicle file.
        vehicle: String,
    },
    /// A vehicle, sensors or road file has errors.
    #[error(transparent)]
    VehicleFile(#[from] model::FileErrors),
    /// The configured decoder of a source is not possible.
    #[error(transparent)]
    Wire(#[from] wire::WireError),
    /// The estimator cannot be created.
    #[error(transparent)]
    Estimator(#[from] estimator::EstimatorError),
    /// The virtual vehicle cannot be created.
    #[error(transparent)]
    Simulation(#[from] sim::SimError),
    /// A file cannot be an output.
    #[error(transparent)]
    Target(#[from] TargetError),
    /// An output cannot be written.
    #[error("cannot write {path}")]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: WriteError,
    },
    /// The log's configuration names no vehicle.
    #[error(
        "the configuration in the log has no vehicle, so that nothing was estimated; write a log with estimates \
         by `atvrec replay --config FILE -o NEW`, with a configuration that has a vehicle and the roles of the \
         signals"
    )]
    NoVehicle,
    /// The configuration of a log has errors.
    #[error("{path}")]
    InLog {
        /// The log.
        path: PathBuf,
        /// What is wrong.
        source: Box<Error>,
    },
    /// The configuration of a log names no vehicle.
    #[error(
        "{0}: the configuration in the log has no vehicle; set one in [vehicle] and record again, or \
         write a new log with `atvrec replay --config`"
    )]
    NoVehicleIn(PathBuf),
    /// The configuration names no vehicle.
    #[error("the configuration names no vehicle; give one with --config, or import with --vehicle")]
    NoVehicleNamed,
    /// The log has no estimates.
    #[error(
        "the log has no {topic}, which is needed; replay the log with an estimator (--vehicle)"
    )]
    NoEstimates {
        /// The topic that is needed.
        topic: String,
        /// Why it cannot be read.
        source: Box<store::Error>,
    },
    /// A topic has no messages.
    #[error("{0} has no message; replay the log with an estimator")]
    Empty(String),
    /// No estimate lies between the given times.
    #[error(
        "there is no data between --from and --to: {topic} has {span_s:.1} s; choose times in it"
    )]
    EmptyWindow {
        /// The topic.
        topic: String,
        /// How long it is, s.
        span_s: f64,
    },
    /// A log cannot be read or written.
    #[error(transparent)]
    Log(#[from] store::Error),
}

impl From<estimator::finding::Refusal> for Error {
    fn from(refusal: estimator::finding::Refusal) -> Self {
        Self::Estimator(refusal.into())
    }
}

impl Error {
    /// Whether the error is in the user's input: a file, its name, or an option.
    #[must_use]
    pub const fn is_usage(&self) -> bool {
        match self {
            Self::Configuration(_)
            | Self::ConfigurationUnreadable { .. }
            | Self::NotIgnored { .. }
            | Self::Unreadable { .. }
            | Self::File(_)
            | Self::OtherSources(_)
            | Self::EqualSources(_)
            | Self::EmptyStretch { .. }
            | Self::NoVehicleNamed
            | Self::NoVehicleToJudge
            | Self::NoForcesToJudge(_)
            | Self::RoadClass { .. }
            | Self::RoadUnreadable { .. }
            | Self::VehicleFile(_)
            | Self::Options { .. }
            | Self::Target(_) => true,
            Self::InLog { source, .. } => source.is_usage(),
            _ => false,
        }
    }
}

fn ignores(names: &[String]) -> String {
    if names.is_empty() {
        "it ignores no input; remove the option".to_owned()
    } else {
        format!("it ignores {}", names.join(", "))
    }
}
