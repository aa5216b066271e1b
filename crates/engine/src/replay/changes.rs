//! Changes that a replay makes to the configuration in the log.

use std::path::{Path, PathBuf};

use store::Attachment;
use toml::{Table, Value};

use crate::config::{ATTACHED_NAME, FileKind, GivenFile, TOML_MAX, read_text};
use crate::{Config, Error, Result};

/// Changes that a replay makes to the configuration in the log.
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// Vehicle file.
    pub vehicle: Option<FileSource>,
    /// Files of overrides, applied after those of the configuration.
    pub overrides: Vec<FileSource>,
    /// Sensors file.
    pub sensors: Option<FileSource>,
    /// Calibration file.
    pub calibration: Option<FileSource>,
    /// Inputs that are ignored in addition; names of `estimator.ignore`.
    pub without: Vec<String>,
    /// Inputs that are no longer ignored.
    pub with: Vec<String>,
    /// Payloads on the vehicle at the start, instead of those of the log.
    pub payload: Option<Vec<String>>,
    /// Method; value of `estimator.method`.
    pub method: Option<String>,
}

/// Source of the text of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FileSource {
    /// Path of a file, or name of a built-in file.
    Path(PathBuf),
    /// The text.
    Text(String),
}

impl From<PathBuf> for FileSource {
    fn from(path: PathBuf) -> Self {
        Self::Path(path)
    }
}

impl FileSource {
    /// The name of the file in a configuration. A text is added to the files that are given.
    pub(crate) fn name(&self, kind: FileKind, given: &mut Vec<GivenFile>) -> String {
        match self {
            Self::Path(path) => path.display().to_string(),
            Self::Text(text) => {
                let name = format!("{}.toml", kind.noun());
                given.push(GivenFile {
                    name: name.clone(),
                    kind,
                    text: text.clone(),
                });
                name
            }
        }
    }
}

impl Changes {
    /// The configuration in the attachments of a log, with the changes.
    ///
    /// # Errors
    /// If a file cannot be read, if the log does not ignore an input of [`Changes::with`], or if the
    /// changed configuration has errors.
    pub fn configuration(&self, attachments: Vec<Attachment>) -> Result<Config> {
        Config::from_attachments(&self.apply(attachments)?)
    }

    fn is_empty(&self) -> bool {
        let files = [&self.vehicle, &self.sensors, &self.calibration];
        files.into_iter().all(Option::is_none)
            && self.overrides.is_empty()
            && self.without.is_empty()
            && self.with.is_empty()
            && self.method.is_none()
            && self.payload.is_none()
    }

    /// The attachments with the changes: additional files, and a configuration that names them.
    fn apply(&self, mut attachments: Vec<Attachment>) -> Result<Vec<Attachment>> {
        let own = attachments.iter().position(|a| a.name == ATTACHED_NAME);
        let Some(own) = own.filter(|_| !self.is_empty()) else {
            return Ok(attachments);
        };
        let text = std::str::from_utf8(&attachments[own].data)?;
        let mut configuration: Table = text.parse().map_err(Error::AttachedConfiguration)?;
        let files = [
            ("file", "vehicle", &self.vehicle),
            ("sensors", "sensors", &self.sensors),
            ("calibration", "calibration", &self.calibration),
        ];
        for (key, kind, file) in files {
            let Some(file) = file else { continue };
            let name = attach(&mut attachments, file, kind)?;
            section(&mut configuration, "vehicle")?.insert(key.to_owned(), Value::String(name));
        }
        if let Some(names) = &self.payload {
            let names = Value::Array(names.iter().cloned().map(Value::String).collect());
            section(&mut configuration, "vehicle")?.insert("payload".to_owned(), names);
        }
        for (number, file) in self.overrides.iter().enumerate() {
            let name = attach(&mut attachments, file, &format!("overrides-{}", number + 1))?;
            list(section(&mut configuration, "vehicle")?, "overrides")?.push(Value::String(name));
        }
        let estimator = section(&mut configuration, "estimator")?;
        self.change_ignored(list(estimator, "ignore")?)?;
        if let Some(method) = &self.method {
            estimator.insert("method".to_owned(), Value::String(method.clone()));
        }
        let own = attachments.iter_mut().find(|a| a.name == ATTACHED_NAME);
        if let Some(own) = own {
            own.data = toml::to_string(&configuration)?.into_bytes();
        }
        Ok(attachments)
    }

    fn change_ignored(&self, ignored: &mut Vec<Value>) -> Result<()> {
        for input in &self.with {
            let is_same = |ignored: &Value| ignored.as_str() == Some(input);
            if !ignored.iter().any(is_same) {
                let names = ignored.iter().filter_map(Value::as_str);
                return Err(Error::NotIgnored {
                    input: input.clone(),
                    ignored: names.map(str::to_owned).collect(),
                });
            }
            ignored.retain(|ignored| !is_same(ignored));
        }
        ignored.extend(self.without.iter().cloned().map(Value::String));
        Ok(())
    }
}

/// Attaches a file, and replaces an attachment with the same name. A built-in file is not attached.
fn attach(attachments: &mut Vec<Attachment>, file: &FileSource, kind: &str) -> Result<String> {
    let (name, text) = match file {
        FileSource::Path(path) if !path.exists() && path.extension().is_none() => {
            return Ok(path.display().to_string());
        }
        FileSource::Path(path) => (file_name(path), read(path)?),
        FileSource::Text(text) => (format!("{kind}.toml"), text.clone()),
    };
    let name = format!("replay-{name}");
    attachments.retain(|attachment| attachment.name != name);
    attachments.push(Attachment {
        name: name.clone(),
        media_type: "application/toml".to_owned(),
        data: text.into_bytes(),
    });
    Ok(name)
}

fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

fn read(path: &Path) -> Result<String> {
    read_text(path, TOML_MAX).map_err(|source| Error::Unreadable {
        path: path.to_owned(),
        source,
    })
}

fn list<'a>(section: &'a mut Table, name: &'static str) -> Result<&'a mut Vec<Value>> {
    section
        .entry(name)
        .or_insert_with(|| Value::Array(Vec::new()))
        .as_array_mut()
        .ok_or(Error::NotA { name, what: "list" })
}

fn section<'a>(configuration: &'a mut Table, name: &'static str) -> Result<&'a mut Table> {
    configuration
        .entry(name)
        .or_insert_with(|| Value::Table(Table::new()))
        .as_table_mut()
        .ok_or(Error::NotA {
            name,
            what: "table",
        })
}
