//! `atvrec.toml`: parses the text into a configuration that is valid by construction.
//!
//! All errors of the file and of the files that it names are collected and reported together.

mod columns;
mod estimator;
mod files;
mod live;
mod output;
mod overrides;
mod proposal;
mod record;
mod roles;
mod source;
mod storage;
mod trigger;

use std::fmt;
use std::path::{Path, PathBuf};

use model::file::{ErrorCollector, Section};
use store::Attachment;

pub use columns::{AlogMap, Clock, CsvMap, GAVLAB_MAP, RowTime, Times, alog_map, csv_map};
pub use estimator::{Estimator, input, method};
pub(crate) use files::PROJECT_DBC_TEXT;
pub use files::{
    FileKind, FileProblem, Files, GAVLAB, GivenFile, NOT_ATTACHED, read_text, with_tyre_files,
};
pub use live::Live;
pub use model::file::{Problem, TOML_MAX, closest};
pub use output::{CanOutput, CanPort, Output, UdpOutput};
pub use proposal::{Proposed, propose};
pub(crate) use record::can_messages;
pub use roles::{ControlValue, Role, RoleOf, StrainUnit, Travel, WheelRate, is_bending};
pub use source::{CanMeaning, GnssMeaning, Meaning, Source, SyncFrame, device_name};
pub use storage::{Limits, Storage};
pub use trigger::{CanRule, Trigger};

use crate::{Error, Result};

/// All problems of a configuration.
#[derive(Debug, thiserror::Error)]
pub struct Problems(pub Vec<Problem>);

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for problem in &self.0 {
            writeln!(f, "{problem}")?;
        }
        match self.0.len() {
            1 => write!(f, "1 error in the configuration"),
            count => write!(f, "{count} errors in the configuration"),
        }
    }
}

/// Name of the configuration among a log's attachments.
pub const ATTACHED_NAME: &str = "atvrec.toml";

/// A resolved configuration.
#[derive(Clone, Debug)]
pub struct Config {
    /// All sources, in the order of their numbers.
    pub sources: Vec<Source>,
    /// Where and how logs are written.
    pub storage: Storage,
    /// Configuration of the estimator; `None` switches it off.
    pub estimator: Option<Estimator>,
    /// What is made of the estimates for viewers and controllers.
    pub output: Output,
    /// The live process.
    pub live: Live,
    /// Path of the control socket; `None` leaves the choice to the recorder.
    pub control: Option<PathBuf>,
    /// Text of the configuration and of every file that it names, which are attached to a log.
    pub attachments: Vec<Attachment>,
}

impl Config {
    /// Reads a configuration file.
    pub fn load(path: &Path) -> Result<Self> {
        let text = read_text(path, TOML_MAX).map_err(|cause| Error::ConfigurationUnreadable {
            path: path.to_owned(),
            cause,
        })?;
        let directory = path.parent().map(Path::to_owned).unwrap_or_default();
        let files = Files::on_disk(directory.clone());
        let mut config = Self::resolve(&path.display().to_string(), &text, files)?;
        config.storage.directory = directory.join(&config.storage.directory);
        config.control = config.control.map(|socket| directory.join(socket));
        config.live.look_from(&directory);
        config.output.look_from(&directory);
        for source in &mut config.sources {
            source.look_from(&directory);
        }
        Ok(config)
    }

    /// Reads a configuration file again for a running recorder.
    ///
    /// # Errors
    /// As [`Config::load`]. A file without any field is an error too: it is probably being written,
    /// and does not mean that all sources are to be stopped.
    pub fn load_again(path: &Path) -> Result<Self> {
        let config = Self::load(path)?;
        let written = config.attachments.first();
        let is_field = |line: &[u8]| {
            let line = line.trim_ascii();
            !line.is_empty() && !line.starts_with(b"#")
        };
        let lines = written.map(|own| own.data.split(|byte| *byte == b'\n'));
        if lines.is_some_and(|mut lines| lines.any(is_field)) {
            return Ok(config);
        }
        Err(Error::ConfigurationEmpty {
            path: path.to_owned(),
        })
    }

    /// Text of the configuration file.
    ///
    /// # Errors
    /// If it is not known, or is no text.
    pub fn text(&self) -> Result<&str> {
        let own = self
            .attachments
            .iter()
            .find(|file| file.name == ATTACHED_NAME);
        Ok(std::str::from_utf8(
            &own.ok_or(Error::NoConfiguration)?.data,
        )?)
    }

    /// What the configuration leaves out or uses though it is odd: parts of DBC files, and values of the
    /// vehicle file.
    pub fn warnings(&self) -> impl Iterator<Item = String> {
        let buses = self
            .sources
            .iter()
            .filter_map(|source| match &source.meaning {
                Meaning::Can(can) => Some(&can.warnings),
                _ => None,
            });
        let vehicle = self
            .estimator
            .iter()
            .flat_map(|estimator| estimator.vehicle.warnings());
        let of_vehicle = vehicle.map(|warning| format!("vehicle file: {warning}"));
        buses.flatten().map(ToString::to_string).chain(of_vehicle)
    }

    /// Reads the configuration in the attachments of a log.
    pub fn from_attachments(attachments: &[Attachment]) -> Result<Self> {
        let attached = attachments
            .iter()
            .find(|attachment| attachment.name == ATTACHED_NAME)
            .ok_or(Error::NoConfiguration)?;
        let text = std::str::from_utf8(&attached.data)?;
        let files = Files::attached(attachments);
        Ok(Self::resolve(ATTACHED_NAME, text, files)?)
    }

    /// Reads a configuration that the program has created; names in it are files in `directory` or
    /// built-in files.
    pub fn from_text(text: &str, directory: &Path) -> Result<Self> {
        Self::from_files(text, Files::on_disk(directory.to_owned()))
    }

    /// The same; names in it are those of `files`.
    pub(crate) fn from_files(text: &str, files: Files) -> Result<Self> {
        Ok(Self::resolve(ATTACHED_NAME, text, files)?)
    }

    fn resolve(name: &str, text: &str, mut files: Files) -> std::result::Result<Self, Problems> {
        let mut collector = ErrorCollector::new(name, text);
        let Some(table) = collector.parse() else {
            return Err(Problems(collector.into_problems()));
        };
        let mut top = Section::new("", table);
        let sources = top.section("source", &mut collector);
        let sources = source::read_all(sources, &mut files, &mut collector);
        let mut storage = Storage::read(
            top.section("storage", &mut collector),
            &sources,
            &mut collector,
        );
        let section = top.section("record", &mut collector);
        storage.options.left_out = record::left_out(section, &sources, &mut collector);
        let vehicle = top.section("vehicle", &mut collector);
        let section = top.section("estimator", &mut collector);
        let estimator = estimator::read(section, vehicle, &mut files, &mut collector);
        source::check_units(&sources, estimator.as_ref(), &mut collector);
        let section = top.section("output", &mut collector);
        let output = Output::read(section, &sources, &mut collector);
        let live = Live::read(top.section("live", &mut collector), &mut collector);
        let mut control = top.section("control", &mut collector);
        let socket = control.optional::<String>("socket", &mut collector);
        control.finish(&mut collector);
        top.finish(&mut collector);
        if !collector.is_empty() {
            return Err(Problems(collector.into_problems()));
        }
        if !files.are_attached() {
            for warning in collector.take_warnings() {
                tracing::warn!("{warning}");
            }
        }
        let mut attachments = vec![Attachment {
            name: ATTACHED_NAME.to_owned(),
            media_type: "application/toml".to_owned(),
            data: text.as_bytes().to_vec(),
        }];
        attachments.extend(files.into_used());
        Ok(Self {
            sources,
            storage,
            estimator,
            output,
            live,
            control: socket.map(|field| PathBuf::from(field.value)),
            attachments,
        })
    }
}
