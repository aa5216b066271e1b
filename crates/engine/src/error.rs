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
    /// A file that is named cannot be read.
    #[error(transparent)]
    File(#[from] FileProblem),
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
    /// A log cannot be read or written.
    #[error(transparent)]
    Log(#[from] store::Error),
}

impl Error {
    /// Whether what the user wrote is wrong: a file, its name, or an option.
    #[must_use]
    pub const fn is_usage(&self) -> bool {
        matches!(
            self,
            Self::Configuration(_)
                | Self::ConfigurationUnreadable { .. }
                | Self::File(_)
                | Self::Options { .. }
        )
    }
}
