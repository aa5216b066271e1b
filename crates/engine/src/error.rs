//! What the engine refuses.

use std::io;
use std::path::PathBuf;

use crate::config::{FileProblem, Problems};

/// A result of the engine.
pub type Result<T> = std::result::Result<T, Error>;

/// Why a configuration, an engine, a replay or a simulation is refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The configuration has errors, or a file that it names has.
    #[error(transparent)]
    Configuration(#[from] Problems),
    /// The configuration cannot be read.
    #[error(
        "cannot read the configuration {path}; `atvrec virtual` writes one to begin with, \
         docs/configuration.md explains every field"
    )]
    ConfigurationUnreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The configuration has no field.
    #[error("the configuration {path} is empty; nothing was changed")]
    ConfigurationEmpty {
        /// The file.
        path: PathBuf,
    },
    /// The log has no configuration among its attachments.
    #[error("the log carries no configuration; give one with --config")]
    NoConfiguration,
    /// The log's configuration is not text.
    #[error("the log's configuration is not UTF-8; give one with --config")]
    ConfigurationNotText(#[from] std::str::Utf8Error),
    /// The log's configuration is not TOML.
    #[error(transparent)]
    AttachedConfiguration(toml::de::Error),
    /// A part of the log's configuration that is to be changed is not what it should be.
    #[error("{name} is no {what} in the log's configuration")]
    NotA {
        /// Name of the part.
        name: &'static str,
        /// What it should be.
        what: &'static str,
    },
    /// The changed configuration cannot be written.
    #[error(transparent)]
    Toml(#[from] toml::ser::Error),
    /// An input that is to be ignored no longer is not ignored.
    #[error(
        "--with {input}: the log's configuration does not ignore that; {}", ignores(.ignored)
    )]
    NotIgnored {
        /// The input.
        input: String,
        /// What the log's configuration ignores.
        ignored: Vec<String>,
    },
    /// A file cannot be read.
    #[error("cannot read {path}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file that is named cannot be read.
    #[error(transparent)]
    File(#[from] FileProblem),
    /// The configuration has other sources than the log.
    #[error(
        "the configuration does not have the log's sources {} in the same order; \
         name all sources of the log in it", .0.join(", ")
    )]
    OtherSources(Vec<String>),
    /// A part of the run is not there.
    #[error(
        "{0}: the state of the estimator at the beginning of the next part is unknown, so that the \
         log cannot be verified; give all parts of the run"
    )]
    PartsMissing(store::Missing),
    /// The options of the virtual vehicle cannot be read.
    #[error("cannot read the options {path}")]
    OptionsUnreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The options of the virtual vehicle are wrong.
    #[error("{path}: {cause}")]
    Options {
        /// The file.
        path: PathBuf,
        /// What the TOML reader says.
        cause: Box<toml::de::Error>,
    },
    /// The vehicle cannot do the manoeuvre.
    #[error("cannot drive {manoeuvre}")]
    Manoeuvre {
        /// Name of the manoeuvre.
        manoeuvre: String,
        /// Why.
        source: Box<sim::SimError>,
    },
    /// A vehicle or sensors file has errors.
    #[error(transparent)]
    VehicleFile(#[from] model::FileErrors),
    /// The bytes of a source cannot be decoded as the configuration says.
    #[error(transparent)]
    Wire(#[from] wire::WireError),
    /// No estimator can be made.
    #[error(transparent)]
    Estimator(#[from] estimator::EstimatorError),
    /// No virtual vehicle can be made.
    #[error(transparent)]
    Simulation(#[from] sim::SimError),
    /// The log's configuration names no vehicle.
    #[error("the log's configuration names no vehicle, so nothing was estimated")]
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
        "{0}: the log's configuration names no vehicle; name one in [vehicle] and record again, or \
         make the log anew with `atvrec replay --config`"
    )]
    NoVehicleIn(PathBuf),
    /// The configuration names no vehicle.
    #[error("the configuration names no vehicle; give one with --config, or import with --vehicle")]
    NoVehicleNamed,
    /// The log has no estimates.
    #[error("{topic} is needed; was the estimator switched off? replay with a vehicle")]
    NoEstimates {
        /// The topic that is needed.
        topic: String,
        /// Why it cannot be read.
        source: Box<store::Error>,
    },
    /// A topic has no messages.
    #[error("{0} is empty")]
    Empty(String),
    /// No estimate lies between the given times.
    #[error("nothing lies between --from and --to: {topic} spans {span_s:.1} s")]
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
    /// Whether what the user wrote is wrong: a file, its name, or an option.
    #[must_use]
    pub const fn is_usage(&self) -> bool {
        match self {
            Self::Configuration(_)
            | Self::ConfigurationUnreadable { .. }
            | Self::NotIgnored { .. }
            | Self::Unreadable { .. }
            | Self::File(_)
            | Self::OtherSources(_)
            | Self::NoVehicleNamed
            | Self::Options { .. } => true,
            Self::InLog { source, .. } => source.is_usage(),
            _ => false,
        }
    }
}

fn ignores(names: &[String]) -> String {
    if names.is_empty() {
        "it ignores nothing".to_owned()
    } else {
        format!("it ignores {}", names.join(", "))
    }
}
