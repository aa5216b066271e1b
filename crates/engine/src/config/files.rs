//! Files that a configuration names: on disk, attached to a log, or built in.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};

use model::sensors::Sensors;
use model::vehicle::Vehicle;
use store::Attachment;

use super::columns::GAVLAB_MAP;
use model::FileErrors;
use model::file::TOML_MAX;

/// Name of the built-in column map for MOOS logs.
pub const GAVLAB: &str = "gavlab.toml";

/// Name of the built-in DBC file.
pub const PROJECT_DBC: &str = "prowler.dbc";

/// End of the message about a file that a log does not have.
pub const NOT_ATTACHED: &str = " is not attached to the log";

/// Text of the built-in DBC file.
pub const PROJECT_DBC_TEXT: &str = include_str!("../../assets/prowler.dbc");

/// Kind of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// A DBC file.
    Dbc,
    /// A vehicle file.
    Vehicle,
    /// A sensors file.
    Sensors,
    /// A calibration file.
    Calibration,
    /// Values from identification that replace fields of the vehicle file.
    Overrides,
    /// A column map.
    Columns,
}

impl FileKind {
    const fn media_type(self) -> &'static str {
        match self {
            Self::Dbc => "text/plain",
            Self::Vehicle | Self::Sensors | Self::Calibration | Self::Overrides | Self::Columns => {
                "application/toml"
            }
        }
    }

    /// Largest file that is read, bytes.
    const fn bytes_max(self) -> usize {
        match self {
            Self::Dbc => wire::dbc::BYTES_MAX,
            _ => TOML_MAX,
        }
    }

    /// Text of the built-in file with this name.
    fn builtin(self, name: &str) -> Option<&'static str> {
        match self {
            Self::Dbc => (name == PROJECT_DBC).then_some(PROJECT_DBC_TEXT),
            Self::Vehicle => Vehicle::builtin_text(name),
            Self::Sensors => Sensors::builtin_text(name),
            Self::Calibration | Self::Overrides => None,
            Self::Columns => (name == GAVLAB).then_some(GAVLAB_MAP),
        }
    }

    /// Name of the attachment of the file `name` in a log. The name of a built-in file, or of another
    /// file without the extension, does not show the kind of the file, so that the kind is added.
    fn attached_name(self, name: &str) -> String {
        if self == Self::Dbc || name.ends_with(".toml") {
            name.to_owned()
        } else {
            format!("{name}.{}.toml", self.noun())
        }
    }

    /// The kind in names of files.
    pub(crate) const fn noun(self) -> &'static str {
        match self {
            Self::Dbc => "dbc",
            Self::Vehicle => "vehicle",
            Self::Sensors => "sensors",
            Self::Calibration => "calibration",
            Self::Overrides => "overrides",
            Self::Columns => "columns",
        }
    }

    /// Attachment of the file `name` in a log. In older logs the attachment has the name itself.
    fn find(self, name: &str, files: &BTreeMap<String, Vec<u8>>) -> Option<Vec<u8>> {
        let found = files.get(&self.attached_name(name));
        found.or_else(|| files.get(name)).cloned()
    }

    fn builtin_names(self) -> Vec<&'static str> {
        match self {
            Self::Dbc => vec![PROJECT_DBC],
            Self::Vehicle => Vehicle::builtin_names().collect(),
            Self::Sensors => Sensors::builtin_names().collect(),
            Self::Calibration | Self::Overrides => Vec::new(),
            Self::Columns => vec![GAVLAB],
        }
    }
}

/// Place of the files.
#[derive(Debug)]
enum Place {
    /// This directory.
    Disk(PathBuf),
    /// The attachments of a log.
    Attached(BTreeMap<String, Vec<u8>>),
}

/// Reads files once and keeps their texts, so that they can be attached to a log.
#[derive(Debug)]
pub struct Files {
    place: Place,
    given: Vec<GivenFile>,
    used: Vec<Used>,
}

/// A file that was read, with its name in the configuration.
#[derive(Debug)]
struct Used {
    name: String,
    kind: FileKind,
    text: String,
}

/// A file that was given as text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenFile {
    /// Its name in the configuration.
    pub name: String,
    /// Its kind.
    pub kind: FileKind,
    /// Its text.
    pub text: String,
}

/// A file that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}; {help}")]
pub struct FileProblem {
    /// Description of the problem.
    pub message: String,
    /// What to do about it.
    pub help: String,
}

impl Files {
    /// Files relative to `directory`.
    pub fn on_disk(directory: PathBuf) -> Self {
        Self {
            place: Place::Disk(directory),
            given: Vec::new(),
            used: Vec::new(),
        }
    }

    /// Files attached to a log.
    pub fn attached(attachments: &[Attachment]) -> Self {
        let files = attachments
            .iter()
            .map(|attachment| (attachment.name.clone(), attachment.data.clone()))
            .collect();
        Self {
            place: Place::Attached(files),
            given: Vec::new(),
            used: Vec::new(),
        }
    }

    /// Whether the files are the attachments of a log.
    pub(crate) const fn are_attached(&self) -> bool {
        matches!(self.place, Place::Attached(_))
    }

    /// With files that were given as text; they go before those of the same name elsewhere.
    pub(crate) fn with_given(mut self, given: Vec<GivenFile>) -> Self {
        self.given = given;
        self
    }

    /// Text of the file `name`. A file of the user has priority over a built-in file with the same
    /// name.
    pub fn read_text(&mut self, name: &str, kind: FileKind) -> Result<String, FileProblem> {
        let known = self
            .used
            .iter()
            .find(|file| file.name == name && file.kind == kind);
        if let Some(known) = known {
            return Ok(known.text.clone());
        }
        let text = self.load(name, kind)?;
        self.used.push(Used {
            name: name.to_owned(),
            kind,
            text: text.clone(),
        });
        Ok(text)
    }

    fn load(&self, name: &str, kind: FileKind) -> Result<String, FileProblem> {
        let mut given = self.given.iter();
        if let Some(given) = given.find(|file| file.name == name && file.kind == kind) {
            return Ok(given.text.clone());
        }
        let builtin = || kind.builtin(name).map(str::to_owned);
        let bytes = match &self.place {
            Place::Attached(files) => match kind.find(name, files) {
                Some(bytes) => bytes,
                None => return builtin().ok_or_else(|| not_attached(name)),
            },
            Place::Disk(directory) => {
                let path = directory.join(name);
                match read_bytes(&path, kind.bytes_max()) {
                    Ok(bytes) => bytes,
                    Err(error) => {
                        return builtin().ok_or_else(|| FileProblem {
                            message: format!("cannot read {}: {error}", path.display()),
                            help: unreadable_help(kind, directory),
                        });
                    }
                }
            }
        };
        let text = match kind {
            FileKind::Dbc => text_or_latin1(bytes),
            _ => String::from_utf8(bytes).map_err(|_| FileProblem {
                message: format!("{name} is not UTF-8 text"),
                help: "save the file as UTF-8".to_owned(),
            })?,
        };
        match (kind, &self.place) {
            (FileKind::Vehicle, Place::Disk(directory)) => {
                with_tyre_files(&text, &directory.join(name)).map_err(|errors| FileProblem {
                    message: errors.to_string(),
                    help: "correct the tyre property file".to_owned(),
                })
            }
            _ => Ok(text),
        }
    }

    /// All files that were read, as attachments of a log.
    pub fn into_used(self) -> Vec<Attachment> {
        let attach = |file: Used| Attachment {
            name: file.kind.attached_name(&file.name),
            media_type: file.kind.media_type().to_owned(),
            data: file.text.into_bytes(),
        };
        self.used.into_iter().map(attach).collect()
    }
}

/// Reads a regular file of at most `limit` bytes. Another kind of file, such as a FIFO, could block.
fn read_bytes(path: &Path, limit: usize) -> io::Result<Vec<u8>> {
    let reject = |text: String| Err(io::Error::new(ErrorKind::InvalidInput, text));
    if !std::fs::metadata(path)?.is_file() {
        return reject("it is not a regular file".to_owned());
    }
    let mut bytes = Vec::new();
    let read = File::open(path)?
        .take(limit as u64 + 1)
        .read_to_end(&mut bytes)?;
    if read > limit {
        return reject(format!("it is longer than {limit} bytes"));
    }
    Ok(bytes)
}

/// Reads a regular file of at most `limit` bytes as UTF-8.
///
/// # Errors
/// If the file cannot be read, is no regular file, is longer, or is not UTF-8.
pub fn read_text(path: &Path, limit: usize) -> io::Result<String> {
    String::from_utf8(read_bytes(path, limit)?)
        .map_err(|_| io::Error::new(ErrorKind::InvalidData, "it is not UTF-8 text"))
}

/// UTF-8, or Latin-1, in which each byte is a code point and which DBC files often have.
fn text_or_latin1(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes).unwrap_or_else(|error| {
        let bytes = error.as_bytes().iter();
        bytes.map(|byte| char::from(*byte)).collect()
    })
}

/// The text of the vehicle file `path` with the coefficients of the tyre property files that it names,
/// so that the text needs no other file.
///
/// # Errors
/// All mistakes of the property files, or that one cannot be read.
pub fn with_tyre_files(text: &str, path: &Path) -> Result<String, FileErrors> {
    let directory = path.parent().unwrap_or(Path::new(""));
    Vehicle::with_tyre_files(text, path, |name| {
        read_bytes(&directory.join(name), TOML_MAX)
            .map(text_or_latin1)
            .map_err(|error| error.to_string())
    })
}

fn not_attached(name: &str) -> FileProblem {
    FileProblem {
        message: format!("{name}{NOT_ATTACHED}"),
        help: "give a configuration with --config".to_owned(),
    }
}

fn unreadable_help(kind: FileKind, directory: &Path) -> String {
    let base = match directory.as_os_str().is_empty() {
        true => "the current directory".to_owned(),
        false => format!("the directory {}", directory.display()),
    };
    let names = kind.builtin_names();
    if names.is_empty() {
        format!("paths are relative to {base}")
    } else {
        let names = names.join(", ");
        format!("paths are relative to {base}; built-in files are: {names}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attached(name: &str, text: &str) -> Attachment {
        Attachment {
            name: name.to_owned(),
            media_type: "application/toml".to_owned(),
            data: text.as_bytes().to_vec(),
        }
    }

    #[test]
    fn attachments_of_new_and_of_older_logs_are_found() {
        let mut files = Files::on_disk(PathBuf::from("/nonexistent"));
        let own = files.read_text("prowler", FileKind::Vehicle);
        assert!(own.is_ok());
        assert!(files.read_text("thesis-10bit", FileKind::Sensors).is_ok());
        let written = files.into_used();
        let names: Vec<&str> = written.iter().map(|file| file.name.as_str()).collect();
        assert_eq!(names, ["prowler.vehicle.toml", "thesis-10bit.sensors.toml"]);
        let mut read = Files::attached(&written);
        assert_eq!(read.read_text("prowler", FileKind::Vehicle), own);

        let old = [attached("prowler", "of an older log")];
        let text = Files::attached(&old).read_text("prowler", FileKind::Vehicle);
        assert_eq!(text.as_deref(), Ok("of an older log"));
    }

    /// A log contains the tyre: the vehicle in its attachments needs no property file.
    #[test]
    fn a_vehicle_that_is_attached_to_a_log_contains_its_tyre() {
        let directory = tempfile::tempdir().expect("a directory");
        let own = Vehicle::builtin_text("prowler").expect("built in");
        let named = own.replace("[front.tyre]", "[front.tyre]\ntir = \"tyres/my.tir\"");
        // The fields of the vehicle file are those of another load.
        let named = named.replace("reference_load_n", "# reference_load_n");
        std::fs::write(directory.path().join("own.toml"), &named).expect("written");
        let read = || {
            let mut files = Files::on_disk(directory.path().to_owned());
            files
                .read_text("own.toml", FileKind::Vehicle)
                .map(|text| (text, files.into_used()))
        };
        let missing = read().expect_err("no property file").to_string();
        assert!(
            missing.contains("front.tyre.tir = \"tyres/my.tir\""),
            "{missing}"
        );
        std::fs::create_dir(directory.path().join("tyres")).expect("created");
        let tir = include_str!("../../../model/src/tyre/property/mf61.tir");
        // A comment in Latin-1.
        let tir = [tir.as_bytes(), b"! M\xfcnchen\n"].concat();
        std::fs::write(directory.path().join("tyres/my.tir"), tir).expect("written");
        let (text, attached) = read().expect("read");
        drop(directory);
        let again = Files::attached(&attached).read_text("own.toml", FileKind::Vehicle);
        assert_eq!(again.as_ref(), Ok(&text));
        // The rear axle still has its own fields.
        let text = text.replace("# reference_load_n", "reference_load_n");
        let at = text.find("reference_load_n").expect("the front's");
        let text = format!("{}# {}", &text[..at], &text[at..]);
        let vehicle = Vehicle::from_toml(&text, "own.toml").expect("a vehicle");
        assert!(vehicle.front.tyre.tir.is_some() && vehicle.rear.tyre.tir.is_none());
    }

    #[test]
    fn a_calibration_with_the_name_of_the_vehicle_is_a_different_file() {
        let directory = tempfile::tempdir().expect("a directory");
        std::fs::write(directory.path().join("prowler.toml"), "calibration").expect("written");
        let mut files = Files::on_disk(directory.path().to_owned());
        let vehicle = files
            .read_text("prowler", FileKind::Vehicle)
            .expect("built in");
        let calibration = files.read_text("prowler.toml", FileKind::Calibration);
        assert_eq!(calibration.as_deref(), Ok("calibration"));
        let mut read = Files::attached(&files.into_used());
        assert_eq!(read.read_text("prowler", FileKind::Vehicle), Ok(vehicle));
        assert_eq!(
            read.read_text("prowler.toml", FileKind::Calibration),
            calibration
        );
    }
}
