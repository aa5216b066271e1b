//! Output files of the program and of the Python package.
//!
//! An existing file is replaced only on request, and an input file never. An output has a temporary
//! name beside its target while it is written, and is renamed in one step when it is complete and
//! synced. A killed command leaves `NAME.partial-PID`, or `NAME.mcap.active` for a log.

mod device;
mod folder;
mod log_file;

use std::error::Error as StdError;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use store::{ACTIVE_SUFFIX, Options, Session, Writer};

use crate::{Error, Result};
use device::Device;
pub use folder::Folder;
pub use log_file::LogFile;

/// Cause of a failed write.
pub type WriteError = Box<dyn StdError + Send + Sync>;

/// Why a file cannot be an output.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TargetError {
    /// The extension belongs to another kind of file.
    #[error("{path} has the wrong extension for {kind}; use .{extensions}")]
    Extension {
        /// The output.
        path: PathBuf,
        /// Kind of the output.
        kind: &'static str,
        /// Extensions of the kind.
        extensions: String,
    },
    /// A log on a device.
    #[error("{path} is a device, but a log must be a regular file; use a name with .mcap")]
    Device {
        /// The output.
        path: PathBuf,
    },
    /// A block device.
    #[error("{path} is a block device (a disk); use the name of a file")]
    Disk {
        /// The output.
        path: PathBuf,
    },
    /// A directory.
    #[error("{path} is a directory; use the name of a file")]
    Directory {
        /// The output.
        path: PathBuf,
    },
    /// A file in the place of a folder.
    #[error("{path} is a file; use the name of a folder")]
    File {
        /// The output.
        path: PathBuf,
    },
    /// The folder contains other data.
    #[error(
        "{path} contains {entry}, which is not a part of a dataset; use a new folder, or one to which \
         only this command wrote"
    )]
    OtherData {
        /// The output.
        path: PathBuf,
        /// An entry of the folder.
        entry: PathBuf,
    },
    /// The dataset contains the run, which is not to be replaced.
    #[error(
        "{path} contains the run {run} already, in {place}; use another folder, or replace the run with \
         --force"
    )]
    RunExists {
        /// The output.
        path: PathBuf,
        /// The run.
        run: String,
        /// Where it is in the folder.
        place: PathBuf,
    },
    /// A file of that name exists and is not to be replaced.
    #[error("{path} exists already; use another name, or replace the file with --force")]
    Exists {
        /// The output.
        path: PathBuf,
    },
    /// The directory does not exist.
    #[error(
        "{path} cannot be written: the directory {directory} does not exist; create it, or use \
         another name"
    )]
    NoDirectory {
        /// The output.
        path: PathBuf,
        /// Its directory.
        directory: PathBuf,
    },
    /// The output is an input, possibly under another name.
    #[error(
        "{path} is the input {input} of this command and cannot be its output; use another name"
    )]
    Input {
        /// The output.
        path: PathBuf,
        /// The input.
        input: PathBuf,
    },
    /// An unfinished log of that name exists and is not to be replaced.
    #[error(
        "{path} exists: it is the unfinished log of a command that was killed or is still running; \
         recover it with `atvrec recover {path}`, replace it with --force, or use another name for \
         the output"
    )]
    Unfinished {
        /// The unfinished log.
        path: PathBuf,
    },
}

/// Kind of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A log.
    Log,
    /// A page of figures and tables.
    Page,
    /// Values in TOML.
    Toml,
    /// A table; the extension of its name decides on the format.
    Table {
        /// Whether the program can write Parquet.
        parquet: bool,
    },
    /// A manual page.
    Manual,
    /// A file with any name.
    Any,
}

impl Kind {
    const fn name(self) -> &'static str {
        match self {
            Self::Log => "a log (MCAP)",
            Self::Page => "an HTML page",
            Self::Toml => "a TOML file",
            Self::Table { parquet: true } => "a table",
            Self::Table { parquet: false } => {
                "a table (this build has no Parquet: feature formats)"
            }
            Self::Manual => "a manual page",
            Self::Any => "a file",
        }
    }

    /// Extensions of the kind, without the dot.
    const fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Log => &["mcap"],
            Self::Page => &["html", "htm"],
            Self::Toml => &["toml"],
            Self::Table { parquet: true } => &["csv", "parquet", "mat", "mf4", "gpx"],
            Self::Table { parquet: false } => &["csv", "mat", "mf4", "gpx"],
            Self::Manual => &["1", "5"],
            Self::Any => &[],
        }
    }

    /// Whether the name must have an extension.
    const fn needs_extension(self) -> bool {
        matches!(self, Self::Table { .. })
    }
}

/// An output that passed the checks.
#[derive(Clone, Debug)]
pub struct Target {
    /// Path from the command line.
    path: PathBuf,
    /// Path with links resolved.
    resolved: PathBuf,
    device: Option<Device>,
    force: bool,
    inputs: Vec<PathBuf>,
}

impl Target {
    /// Checks an output before the command starts its work. `inputs` are all files that the command
    /// reads.
    ///
    /// # Errors
    /// [`TargetError`] if the extension is wrong, if the target is an input (also through a link), a
    /// directory or a disk, if it exists and `force` is not set, or if its directory does not exist.
    pub fn new<'p>(
        path: &Path,
        kind: Kind,
        force: bool,
        inputs: impl IntoIterator<Item = &'p Path>,
    ) -> Result<Self> {
        let mut target = Self {
            path: path.to_owned(),
            resolved: path.canonicalize().unwrap_or_else(|_| path.to_owned()),
            device: None,
            force,
            inputs: inputs.into_iter().map(Path::to_owned).collect(),
        };
        target.device = Device::find(path)?;
        if target.device.is_none() {
            target.check(kind)?;
        } else if kind == Kind::Log {
            return Err(TargetError::Device { path: target.path }.into());
        }
        Ok(target)
    }

    /// Path from the command line.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the name has this extension.
    pub fn has_extension(&self, extension: &str) -> bool {
        let found = self.path.extension();
        found.is_some_and(|found| found.eq_ignore_ascii_case(extension))
    }

    fn check(&self, kind: Kind) -> Result<()> {
        self.check_extension(kind)?;
        self.check_inputs(&self.path)?;
        let path = self.path.clone();
        if self.resolved.is_dir() {
            return Err(TargetError::Directory { path }.into());
        }
        if !self.force && path.symlink_metadata().is_ok() {
            return Err(TargetError::Exists { path }.into());
        }
        let directory = self.directory().to_owned();
        if !directory.is_dir() {
            return Err(TargetError::NoDirectory { path, directory }.into());
        }
        Ok(())
    }

    fn check_extension(&self, kind: Kind) -> Result<()> {
        let extensions = kind.extensions();
        let is_valid = match self.path.extension() {
            _ if extensions.is_empty() => true,
            None => !kind.needs_extension(),
            Some(found) => extensions
                .iter()
                .any(|extension| found.eq_ignore_ascii_case(extension)),
        };
        if is_valid {
            return Ok(());
        }
        let error = TargetError::Extension {
            path: self.path.clone(),
            kind: kind.name(),
            extensions: extensions.join(" or ."),
        };
        Err(error.into())
    }

    /// Rejects a path that leads to an input, under any name.
    fn check_inputs(&self, path: &Path) -> Result<()> {
        match self
            .inputs
            .iter()
            .find(|input| store::is_same_file(path, input))
        {
            Some(input) => {
                let (path, input) = (path.to_owned(), input.clone());
                Err(TargetError::Input { path, input }.into())
            }
            None => Ok(()),
        }
    }

    fn directory(&self) -> &Path {
        match self.resolved.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        }
    }

    /// Writes a text.
    ///
    /// # Errors
    /// As [`Target::write_by`].
    pub fn write(&self, text: &str) -> Result<()> {
        self.write_by(|mut file| Ok(file.write_all(text.as_bytes())?))
    }

    /// Calls `write` with a temporary file, then renames the file to the target.
    ///
    /// # Errors
    /// If `write` fails, if the disk fails, or if a file of that name was created meanwhile and
    /// `force` is not set. The temporary file is removed then.
    pub fn write_by(
        &self,
        write: impl FnOnce(File) -> std::result::Result<(), WriteError>,
    ) -> Result<()> {
        let written = match self.device {
            Some(device) => device
                .open(&self.path)
                .map_err(WriteError::from)
                .and_then(write)
                .or_else(ignore_closed_pipe),
            None => self.write_file(write),
        };
        written.map_err(|source| Error::Write {
            path: self.path.clone(),
            source,
        })
    }

    fn write_file(
        &self,
        write: impl FnOnce(File) -> std::result::Result<(), WriteError>,
    ) -> std::result::Result<(), WriteError> {
        let partial = PartialFile::create(&self.resolved)?;
        write(partial.file.try_clone()?)?;
        partial.file.sync_all()?;
        partial.rename_to(&self.resolved, self.force)?;
        store::sync_folder(self.directory())?;
        Ok(())
    }

    /// Creates the log.
    ///
    /// # Errors
    /// [`TargetError`] if an unfinished log of that name exists and `force` is not set; if the disk
    /// fails.
    pub fn log(&self, session: Session, options: Options) -> Result<LogFile> {
        let mut active = self.resolved.clone().into_os_string();
        active.push(ACTIVE_SUFFIX);
        let active = PathBuf::from(active);
        self.remove_unfinished(&active)?;
        let writer = Writer::create(&self.resolved, session, options, 0)?;
        Ok(LogFile::start(writer, active, self.force))
    }

    /// Removes the unfinished log of a command that was killed, if `force` is set.
    fn remove_unfinished(&self, active: &Path) -> Result<()> {
        if active.symlink_metadata().is_err() {
            return Ok(());
        }
        self.check_inputs(active)?;
        if !self.force {
            let path = active.to_owned();
            return Err(TargetError::Unfinished { path }.into());
        }
        let failed = |action: &'static str| {
            move |cause| store::Error::File {
                action,
                path: active.to_owned(),
                cause,
            }
        };
        let file = File::open(active).map_err(failed("open"))?;
        if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
            return Err(store::Error::InUse(active.to_owned()).into());
        }
        Ok(std::fs::remove_file(active).map_err(failed("remove"))?)
    }
}

/// Treats output that its reader has closed as success.
fn ignore_closed_pipe(error: WriteError) -> std::result::Result<(), WriteError> {
    match error.downcast_ref::<std::io::Error>() {
        Some(cause) if cause.kind() == ErrorKind::BrokenPipe => Ok(()),
        _ => Err(error),
    }
}

/// A file with a temporary name; removed when it is dropped before it is renamed.
struct PartialFile {
    file: File,
    path: Option<PathBuf>,
}

impl PartialFile {
    fn create(target: &Path) -> std::io::Result<Self> {
        for number in 0_u32.. {
            let mut name = target.file_name().unwrap_or_default().to_owned();
            name.push(format!(".partial-{}", std::process::id()));
            if number > 0 {
                name.push(format!("-{number}"));
            }
            let path = target.with_file_name(name);
            match OpenOptions::new().write(true).create_new(true).open(&path) {
                Ok(file) => {
                    return Ok(Self {
                        file,
                        path: Some(path),
                    });
                }
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
        Err(ErrorKind::AlreadyExists.into())
    }

    fn rename_to(mut self, target: &Path, replace: bool) -> std::io::Result<()> {
        let Some(path) = &self.path else {
            return Ok(());
        };
        if replace {
            std::fs::rename(path, target)?;
        } else {
            store::rename_without_replacing(path, target)?;
        }
        self.path = None;
        Ok(())
    }
}

impl Drop for PartialFile {
    fn drop(&mut self) {
        if let Some(path) = &self.path {
            // The first error is reported, not this one.
            let _ = std::fs::remove_file(path);
        }
    }
}
