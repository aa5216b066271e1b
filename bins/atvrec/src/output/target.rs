//! Output files of the commands.
//!
//! An existing file is replaced only with `--force`, and an input file never. An output has a temporary
//! name beside its target while it is written, and is renamed in one step when it is complete and
//! synced. A killed command leaves `NAME.partial-PID`, or `NAME.mcap.active` for a log.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};

use anyhow::Context;
use engine::Entry;
use store::{ACTIVE_SUFFIX, Options, Session, Writer};

use crate::exit::UsageError;

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
    Table,
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
            #[cfg(feature = "formats")]
            Self::Table => "a table",
            #[cfg(not(feature = "formats"))]
            Self::Table => "a table (this build has no Parquet: feature formats)",
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
            #[cfg(feature = "formats")]
            Self::Table => &["csv", "parquet"],
            #[cfg(not(feature = "formats"))]
            Self::Table => &["csv"],
            Self::Manual => &["1"],
            Self::Any => &[],
        }
    }

    /// Whether the name must have an extension.
    const fn needs_extension(self) -> bool {
        matches!(self, Self::Table)
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

/// A target that is not a regular file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Device {
    StandardOutput,
    StandardError,
    /// A character device, FIFO or socket.
    Other,
}

impl Target {
    /// Checks an output before the command starts its work. `inputs` are all files that the command
    /// reads.
    ///
    /// # Errors
    /// [`UsageError`] if the extension is wrong, if the target is an input (also through a link), a
    /// directory or a disk, if it exists and `force` is not set, or if its directory does not exist.
    pub fn new<'p>(
        path: &Path,
        kind: Kind,
        force: bool,
        inputs: impl IntoIterator<Item = &'p Path>,
    ) -> anyhow::Result<Self> {
        let mut target = Self {
            path: path.to_owned(),
            resolved: path.canonicalize().unwrap_or_else(|_| path.to_owned()),
            device: None,
            force,
            inputs: inputs.into_iter().map(Path::to_owned).collect(),
        };
        target.device = target.find_device()?;
        if target.device.is_none() {
            target.check(kind)?;
        } else if kind == Kind::Log {
            return target
                .reject("is a device, but a log must be a regular file; use a name with .mcap");
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

    fn reject<T>(&self, reason: impl std::fmt::Display) -> anyhow::Result<T> {
        Err(UsageError(format!("{} {reason}", self.path.display())).into())
    }

    fn find_device(&self) -> anyhow::Result<Option<Device>> {
        match self.path.to_str() {
            Some("/dev/stdout" | "/dev/fd/1" | "/proc/self/fd/1") => {
                return Ok(Some(Device::StandardOutput));
            }
            Some("/dev/stderr" | "/dev/fd/2" | "/proc/self/fd/2") => {
                return Ok(Some(Device::StandardError));
            }
            _ => {}
        }
        let Ok(found) = std::fs::metadata(&self.path) else {
            return Ok(None);
        };
        let of = found.file_type();
        if of.is_block_device() {
            return self.reject("is a block device (a disk); use the name of a file");
        }
        let other = of.is_char_device() || of.is_fifo() || of.is_socket();
        Ok(other.then_some(Device::Other))
    }

    fn check(&self, kind: Kind) -> anyhow::Result<()> {
        self.check_extension(kind)?;
        self.check_inputs(&self.path)?;
        if self.resolved.is_dir() {
            return self.reject("is a directory; use the name of a file");
        }
        if !self.force && self.path.symlink_metadata().is_ok() {
            return self
                .reject("exists already; use another name, or replace the file with --force");
        }
        let directory = self.directory();
        if !directory.is_dir() {
            return self.reject(format_args!(
                "cannot be written: the directory {} does not exist; create it, or use another \
                 name",
                directory.display()
            ));
        }
        Ok(())
    }

    fn check_extension(&self, kind: Kind) -> anyhow::Result<()> {
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
        let allowed = extensions.join(" or .");
        self.reject(format_args!(
            "has the wrong extension for {}; use .{allowed}",
            kind.name()
        ))
    }

    /// Rejects a path that leads to an input, under any name.
    fn check_inputs(&self, path: &Path) -> anyhow::Result<()> {
        let Ok(found) = std::fs::metadata(path) else {
            return Ok(());
        };
        let is_same = |input: &&PathBuf| {
            std::fs::metadata(input)
                .is_ok_and(|other| (other.dev(), other.ino()) == (found.dev(), found.ino()))
        };
        match self.inputs.iter().find(is_same) {
            Some(input) => Err(UsageError(format!(
                "{} is the input {} of this command and cannot be its output; use another name",
                path.display(),
                input.display()
            ))
            .into()),
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
    pub fn write(&self, text: &str) -> anyhow::Result<()> {
        self.write_by(|mut file| Ok(file.write_all(text.as_bytes())?))
    }

    /// Calls `write` with a temporary file, then renames the file to the target.
    ///
    /// # Errors
    /// If `write` fails, if the disk fails, or if a file of that name was created meanwhile and
    /// `force` is not set. The temporary file is removed then.
    pub fn write_by(&self, write: impl FnOnce(File) -> anyhow::Result<()>) -> anyhow::Result<()> {
        let written = match self.device {
            Some(device) => self
                .open(device)
                .and_then(write)
                .or_else(ignore_closed_pipe),
            None => self.write_file(write),
        };
        written.with_context(|| format!("cannot write {}", self.path.display()))
    }

    fn open(&self, device: Device) -> anyhow::Result<File> {
        Ok(match device {
            Device::StandardOutput => {
                let mut output = std::io::stdout().lock();
                output.flush()?;
                output.as_fd().try_clone_to_owned()?.into()
            }
            Device::StandardError => std::io::stderr().as_fd().try_clone_to_owned()?.into(),
            Device::Other => OpenOptions::new().write(true).open(&self.path)?,
        })
    }

    fn write_file(&self, write: impl FnOnce(File) -> anyhow::Result<()>) -> anyhow::Result<()> {
        let partial = PartialFile::create(&self.resolved)?;
        write(partial.file.try_clone()?)?;
        partial.file.sync_all()?;
        partial.rename_to(&self.resolved, self.force)?;
        File::open(self.directory())?.sync_all()?;
        Ok(())
    }

    /// Creates the log.
    ///
    /// # Errors
    /// [`UsageError`] if an unfinished log of that name exists and `force` is not set; if the disk
    /// fails.
    pub fn log(&self, session: Session, options: Options) -> anyhow::Result<LogFile> {
        let mut active = self.resolved.clone().into_os_string();
        active.push(ACTIVE_SUFFIX);
        let active = PathBuf::from(active);
        self.remove_unfinished(&active)?;
        let writer = Writer::create(&self.resolved, session, options, 0)?;
        Ok(LogFile {
            writer: Some(writer),
            active,
            force: self.force,
        })
    }

    /// Removes the unfinished log of a command that was killed, if `force` is set.
    fn remove_unfinished(&self, active: &Path) -> anyhow::Result<()> {
        if active.symlink_metadata().is_err() {
            return Ok(());
        }
        self.check_inputs(active)?;
        if !self.force {
            return Err(UsageError(format!(
                "{0} exists: it is the unfinished log of a command that was killed or is still \
                 running; recover it with `atvrec recover {0}`, replace it with --force, or use \
                 another name for the output",
                active.display()
            ))
            .into());
        }
        let file =
            File::open(active).with_context(|| format!("cannot open {}", active.display()))?;
        if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
            return Err(store::Error::InUse(active.to_owned()).into());
        }
        std::fs::remove_file(active).with_context(|| format!("cannot remove {}", active.display()))
    }
}

/// Treats output that its reader has closed as success.
fn ignore_closed_pipe(error: anyhow::Error) -> anyhow::Result<()> {
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

/// A log that is being written; removed when it is dropped before it is finished.
pub struct LogFile {
    /// `None` after the log is finished.
    writer: Option<Writer>,
    active: PathBuf,
    force: bool,
}

impl LogFile {
    /// Appends an entry to the log.
    pub fn push(&mut self, entry: Entry) -> anyhow::Result<()> {
        let writer = self
            .writer
            .as_mut()
            .expect("only `finish` takes the writer, and it consumes the log");
        match entry {
            Entry::Arrival(arrival) => writer.push(arrival)?,
            Entry::Record(record) => writer.record(&record),
        }
        Ok(())
    }

    /// Closes the log and renames it to the target.
    ///
    /// # Errors
    /// If the disk fails, or if a file of that name was created meanwhile and `force` is not set. The
    /// log is removed then.
    pub fn finish(mut self) -> anyhow::Result<store::Finished> {
        let writer = self.writer.take().expect("`finish` consumes the log");
        let finished = if self.force {
            writer.finish_replacing()
        } else {
            writer.finish()
        };
        if finished.is_err() {
            self.remove();
        }
        Ok(finished?)
    }

    fn remove(&self) {
        // The first error is reported, not this one.
        let _ = std::fs::remove_file(&self.active);
    }
}

impl Drop for LogFile {
    fn drop(&mut self) {
        if self.writer.take().is_some() {
            self.remove();
        }
    }
}
