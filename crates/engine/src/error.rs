//! Errors of the engine.

use std::io;
use std::path::PathBuf;

use crate::config::{FileProblem, Problems};

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
        "cannot read the configuration {path}; `atvrec virtual` writes an example, \
         docs/configuration.md describes every field"
    )]
    ConfigurationUnreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The configuration has no field.
    #[error("the configuration {path} is empty (it has no field); nothing was changed")]
    ConfigurationEmpty {
        /// Path of the file.
        path: PathBuf,
    },
    /// The log has no configuration among its attachments.
    #[error("the log contains no configuration; give one with --config")]
    NoConfiguration,
    /// The log's configuration is not text.
    #[error("the configuration in the log is not UTF-8 text; give one with --config")]
    ConfigurationNotText(#[from] std::str::Utf8Error),
    /// A file that is named cannot be read.
    #[error(transparent)]
    File(#[from] FileProblem),
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
    /// A vehicle or sensors file has errors.
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
    /// A log cannot be read or written.
    #[error(transparent)]
    Log(#[from] store::Error),
}

impl Error {
    /// Whether the error is in the user's input: a file, its name, or an option.
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
