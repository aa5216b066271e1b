//! Output files of the commands.
//!
//! A file that exists is replaced only with `--force`, and an input never. An output has a temporary
//! name beside its target while it is written, and gets its own name, in one step, when it is whole
//! and synced. A killed command leaves `NAME.partial-PID`, or `NAME.mcap.active` of a log.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};

use anyhow::Context;
use engine::Entry;
use store::{ACTIVE_SUFFIX, Options, Session, Writer};

use crate::exit::UsageError;

/// What an output is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A log.
    Log,
    /// A page of figures and tables.
    Page,
    /// Values that a person may read and edit.
    Toml,
    /// A table; its ending decides on its form.
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
            Self::Page => "a page (HTML)",
            Self::Toml => "a TOML file",
            Self::Table => "a table",
            Self::Manual => "a manual page",
            Self::Any => "a file",
        }
    }

    /// Endings of names that fit, without the dot.
    const fn endings(self) -> &'static [&'static str] {
        match self {
            Self::Log => &["mcap"],
            Self::Page => &["html", "htm"],
            Self::Toml => &["toml"],
            Self::Table => &["csv", "parquet"],
            Self::Manual => &["1"],
            Self::Any => &[],
        }
    }

    /// Whether a name without an ending fits too.
    const fn needs_ending(self) -> bool {
        matches!(self, Self::Table)
    }
}

/// An output that may be written.
#[derive(Clone, Debug)]
pub struct Target {
    /// As the user named it.
    path: PathBuf,
    /// Where it is, with links resolved.
    place: PathBuf,
    device: Option<Device>,
    force: bool,
    inputs: Vec<PathBuf>,
}

/// A target that keeps no file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Device {
    StandardOutput,
    StandardError,
    /// A character device, FIFO or socket.
    Other,
}

impl Target {
    /// Checks an output before the command does its work. `inputs` are all files that the command
    /// reads.
    ///
    /// # Errors
    /// [`UsageError`] if the name's ending does not fit, the target is an input (also by a link), a
    /// directory or a disk, exists without `force`, or its directory is missing.
    pub fn new<'p>(
        path: &Path,
        kind: Kind,
        force: bool,
        inputs: impl IntoIterator<Item = &'p Path>,
    ) -> anyhow::Result<Self> {
        let mut target = Self {
            path: path.to_owned(),
            place: path.canonicalize().unwrap_or_else(|_| path.to_owned()),
            device: None,
            force,
            inputs: inputs.into_iter().map(Path::to_owned).collect(),
        };
        target.device = target.find_device()?;
        if target.device.is_none() {
            target.check(kind)?;
        } else if kind == Kind::Log {
            return target
                .refuse("is a device; a log needs a file of its own: name one that ends in .mcap");
        }
        Ok(target)
    }

    /// As the user named it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the name ends in `.ending`.
    pub fn has_ending(&self, ending: &str) -> bool {
        let found = self.path.extension();
        found.is_some_and(|found| found.eq_ignore_ascii_case(ending))
    }

    fn refuse<T>(&self, why: impl std::fmt::Display) -> anyhow::Result<T> {
        Err(UsageError(format!("{} {why}", self.path.display())).into())
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
            return self.refuse("is a disk, not a file; name a file");
        }
        let other = of.is_char_device() || of.is_fifo() || of.is_socket();
        Ok(other.then_some(Device::Other))
    }

    fn check(&self, kind: Kind) -> anyhow::Result<()> {
        self.check_ending(kind)?;
        self.check_inputs(&self.path)?;
        if self.place.is_dir() {
            return self.refuse("is a directory; name a file");
        }
        if !self.force && self.path.symlink_metadata().is_ok() {
            return self
                .refuse("exists already; name another file, or replace this one with --force");
        }
        let directory = self.directory();
        if !directory.is_dir() {
            return self.refuse(format_args!(
                "cannot be written: there is no directory {}; make it, or name another file",
                directory.display()
            ));
        }
        Ok(())
    }

    fn check_ending(&self, kind: Kind) -> anyhow::Result<()> {
        let endings = kind.endings();
        let fits = match self.path.extension() {
            _ if endings.is_empty() => true,
            None => !kind.needs_ending(),
            Some(found) => endings
                .iter()
                .any(|ending| found.eq_ignore_ascii_case(ending)),
        };
        if fits {
            return Ok(());
        }
        let fitting = endings.join(" or .");
        self.refuse(format_args!(
            "is not a fitting name for {}; end it in .{fitting}",
            kind.name()
        ))
    }

    /// Refuses a path that leads to an input, by whatever name.
    fn check_inputs(&self, path: &Path) -> anyhow::Result<()> {
        let Ok(found) = std::fs::metadata(path) else {
            return Ok(());
        };
        let is_it = |input: &&PathBuf| {
            std::fs::metadata(input)
                .is_ok_and(|other| (other.dev(), other.ino()) == (found.dev(), found.ino()))
        };
        match self.inputs.iter().find(is_it) {
            Some(input) => Err(UsageError(format!(
                "{} is the input {} of this command and cannot be its output; name another file",
                path.display(),
                input.display()
            ))
            .into()),
            None => Ok(()),
        }
    }

    fn directory(&self) -> &Path {
        match self.place.parent() {
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

    /// Lets `write` fill a file, then gives it its name.
    ///
    /// # Errors
    /// If `write` fails, the disk refuses, or a file of that name has come meanwhile and is not to
    /// be replaced. What was written is removed then.
    pub fn write_by(&self, write: impl FnOnce(File) -> anyhow::Result<()>) -> anyhow::Result<()> {
        let written = match self.device {
            Some(device) => self.open(device).and_then(write).or_else(reader_left),
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
        let partial = Partial::create(&self.place)?;
        write(partial.file.try_clone()?)?;
        partial.file.sync_all()?;
        partial.give_name(&self.place, self.force)?;
        File::open(self.directory())?.sync_all()?;
        Ok(())
    }

    /// Begins a log.
    ///
    /// # Errors
    /// [`UsageError`] if an unfinished log of that name is there and is not to be replaced; if the
    /// disk refuses.
    pub fn log(&self, session: Session, options: Options) -> anyhow::Result<LogFile> {
        let mut active = self.place.clone().into_os_string();
        active.push(ACTIVE_SUFFIX);
        let active = PathBuf::from(active);
        self.make_room(&active)?;
        let writer = Writer::create(&self.place, session, options, 0)?;
        Ok(LogFile {
            writer: Some(writer),
            active,
            force: self.force,
        })
    }

    /// Deals with the unfinished log of a command that was killed.
    fn make_room(&self, active: &Path) -> anyhow::Result<()> {
        if active.symlink_metadata().is_err() {
            return Ok(());
        }
        self.check_inputs(active)?;
        if !self.force {
            return Err(UsageError(format!(
                "{0} is there: the unfinished log of a command that was stopped, or that still runs; \
                 make it whole with `atvrec recover {0}`, replace it with --force, or name another \
                 output",
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

/// Takes it for success that nobody reads any more.
fn reader_left(error: anyhow::Error) -> anyhow::Result<()> {
    match error.downcast_ref::<std::io::Error>() {
        Some(cause) if cause.kind() == ErrorKind::BrokenPipe => Ok(()),
        _ => Err(error),
    }
}

/// A file that is being written under a temporary name; removed unless it gets its own.
struct Partial {
    file: File,
    path: Option<PathBuf>,
}

impl Partial {
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

    fn give_name(mut self, target: &Path, replace: bool) -> std::io::Result<()> {
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

impl Drop for Partial {
    fn drop(&mut self) {
        if let Some(path) = &self.path {
            // The reason for the failure is the message that counts.
            let _ = std::fs::remove_file(path);
        }
    }
}

/// A log that is being written; removed unless it is finished.
pub struct LogFile {
    /// Until it is finished.
    writer: Option<Writer>,
    active: PathBuf,
    force: bool,
}

impl LogFile {
    /// Takes what goes into the log.
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

    /// Closes the log and gives it its name.
    ///
    /// # Errors
    /// If the disk refuses, or a file of that name has come meanwhile and is not to be replaced. The
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
        // The reason for the failure is the message that counts.
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
