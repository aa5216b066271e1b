use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use sample::{Arrival, LogTime};

use crate::journal;
use crate::log_writer::{Latched, Pending};
use crate::proto::atvrec as pb;
use crate::{Encoded, Error, LogWriter, Losses, Options, Record, Result, Session, WriteCounters};

/// Ending of the name of an unfinished log.
pub const ACTIVE_SUFFIX: &str = ".active";

/// Added to the name of an unfinished log that recovery cannot handle.
pub const UNRECOVERABLE_SUFFIX: &str = ".unrecoverable";

/// Added to the name of a damaged original that is kept.
pub const DAMAGED_SUFFIX: &str = ".damaged";

/// Ending of the name of a file that states the losses of a log.
pub const LOSSES_SUFFIX: &str = ".losses";

/// Path of a part of a run: `<directory>/<stem>_<part>.mcap`.
#[must_use]
pub fn part_path(directory: &Path, stem: &str, part: u32) -> PathBuf {
    directory.join(format!("{stem}_{part:04}.mcap"))
}

/// Writes one log file. Until it is whole its name ends in [`ACTIVE_SUFFIX`].
pub struct Writer {
    log: LogWriter<CountingFile>,
    unfinished: Unfinished,
    bytes: Arc<AtomicU64>,
}

/// A closed log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finished {
    /// Where it is.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// Counts of the data in it.
    pub counters: WriteCounters,
}

/// A file with its unfinished name.
pub(crate) struct Unfinished {
    pub file: File,
    pub active: PathBuf,
    pub path: PathBuf,
}

/// Where the file that is being written is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    not(unix),
    allow(dead_code, reason = "other systems do not tell that a file was moved")
)]
pub(crate) enum Presence {
    /// Under its name.
    Named,
    /// Under another name, or in a folder that was moved.
    Moved,
    /// Deleted: its bytes are lost when it is closed.
    Deleted,
}

impl Unfinished {
    /// Whether the name still refers to the file. If the system cannot tell, the file counts as present:
    /// the next write or sync reports the error.
    pub(crate) fn presence(&self) -> Presence {
        #[cfg(unix)]
        {
            use std::os::unix::fs::MetadataExt;
            let Ok(file) = self.file.metadata() else {
                return Presence::Named;
            };
            if file.nlink() == 0 {
                return Presence::Deleted;
            }
            match std::fs::metadata(&self.active) {
                Ok(named) if (named.dev(), named.ino()) != (file.dev(), file.ino()) => {
                    return Presence::Moved;
                }
                Err(cause)
                    if matches!(cause.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) =>
                {
                    return Presence::Moved;
                }
                _ => {}
            }
        }
        Presence::Named
    }

    /// Removes an empty file.
    pub(crate) fn discard(self) -> Result<()> {
        std::fs::remove_file(&self.active).map_err(Error::file("remove", &self.active))?;
        journal::remove(&self.path)
    }

    /// Syncs the file, gives it its final name by `rename`, and syncs the directory.
    fn finish(self, rename: impl FnOnce(&Path, &Path) -> std::io::Result<()>) -> Result<PathBuf> {
        self.sync()?;
        rename(&self.active, &self.path)
            .map_err(Error::file("give its final name to", &self.active))?;
        sync_directory(&self.path)?;
        journal::remove(&self.path)?;
        Ok(self.path)
    }

    /// Syncs the file. After a failure the system considers the data written although it did not reach
    /// the disk, so a second attempt proves nothing.
    pub(crate) fn sync(&self) -> Result<()> {
        sync(&self.file).map_err(Error::file("sync", &self.active))
    }

    /// Gives the file its final name and syncs the directory; may be tried again.
    pub(crate) fn give_name(&self) -> Result<()> {
        match std::fs::rename(&self.active, &self.path) {
            Err(cause) if cause.kind() == ErrorKind::NotFound && self.path.is_file() => Ok(()),
            renamed => renamed,
        }
        .map_err(Error::file("give its final name to", &self.active))?;
        sync_directory(&self.path)?;
        journal::remove(&self.path)
    }
}

/// Writes the data of a file to the disk itself. A file system that became read-only after an error
/// reports success for each sync and writes nothing: this is an error here.
pub(crate) fn sync(file: &File) -> std::io::Result<()> {
    file.sync_data()?;
    #[cfg(unix)]
    {
        use rustix::fs::{StatVfsMountFlags, fstatvfs};
        if fstatvfs(file)?.f_flag.contains(StatVfsMountFlags::RDONLY) {
            return Err(rustix::io::Errno::ROFS.into());
        }
    }
    Ok(())
}

/// Syncs the directory entry of a file.
pub(crate) fn sync_directory(path: &Path) -> Result<()> {
    let directory = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    sync_folder(directory).map_err(Error::file("sync the directory", directory))
}

/// Writes the entries of a directory to the disk. Systems other than Unix have no such operation.
///
/// # Errors
/// The error of the operating system. A file system that cannot sync a directory is no error.
#[cfg_attr(not(unix), allow(clippy::unnecessary_wraps, unused_variables))]
pub fn sync_folder(directory: &Path) -> std::io::Result<()> {
    #[cfg(unix)]
    match File::open(directory)?.sync_all() {
        Err(error) if error.kind() == ErrorKind::InvalidInput => {}
        result => return result,
    }
    Ok(())
}

/// Whether both names are of the same file.
#[must_use]
pub fn is_same_file(one: &Path, other: &Path) -> bool {
    #[cfg(unix)]
    let identity = |path| {
        use std::os::unix::fs::MetadataExt as _;
        let metadata = std::fs::metadata(path).ok()?;
        Some((metadata.dev(), metadata.ino()))
    };
    #[cfg(not(unix))]
    let identity = |path: &Path| path.canonicalize().ok();
    identity(one).is_some_and(|found| identity(other) == Some(found))
}

/// The name that a log gets when it is whole.
pub(crate) fn final_path(path: &Path) -> PathBuf {
    let name = path.as_os_str().to_string_lossy();
    name.strip_suffix(UNRECOVERABLE_SUFFIX)
        .unwrap_or(&name)
        .strip_suffix(ACTIVE_SUFFIX)
        .map_or_else(|| path.to_owned(), PathBuf::from)
}

/// Path of the file that states what was lost where the log `path` cannot: `<log>.mcap.losses`,
/// for the finished and the unfinished name of a log alike.
#[must_use]
pub fn losses_path(path: &Path) -> PathBuf {
    let mut name = final_path(path).into_os_string();
    name.push(LOSSES_SUFFIX);
    name.into()
}

/// `path` with [`ACTIVE_SUFFIX`] behind it.
pub(crate) fn active_path(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(ACTIVE_SUFFIX);
    name.into()
}

/// Locks a log, so that other processes know that it is being written.
pub(crate) fn lock(file: &File, path: &Path) -> Result<()> {
    match file.try_lock() {
        Ok(()) => Ok(()),
        Err(TryLockError::WouldBlock) => Err(Error::InUse(path.to_owned())),
        Err(TryLockError::Error(cause)) => Err(Error::file("lock", path)(cause)),
    }
}

pub(crate) struct CountingFile {
    file: File,
    bytes: Arc<AtomicU64>,
    #[cfg(test)]
    active: PathBuf,
}

impl Write for CountingFile {
    fn write(&mut self, data: &[u8]) -> std::io::Result<usize> {
        #[cfg(test)]
        hung::wait(&self.active);
        let written = self.file.write(data)?;
        self.bytes.fetch_add(written as u64, Ordering::Relaxed);
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

impl Writer {
    /// Begins the log `path`, as part `part` of its run.
    ///
    /// # Errors
    /// If the file cannot be made or written, or an unfinished log of that name is there: recover
    /// it first.
    pub fn create(path: &Path, session: Session, options: Options, part: u32) -> Result<Self> {
        let active = active_path(path);
        let file = OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(&active)
            .map_err(Error::file("create", &active))?;
        lock(&file, &active)?;
        let handle = file
            .try_clone()
            .map_err(Error::file("open again", &active))?;
        let bytes = Arc::new(AtomicU64::new(0));
        let sink = CountingFile {
            file,
            bytes: Arc::clone(&bytes),
            #[cfg(test)]
            active: active.clone(),
        };
        let log = LogWriter::new(sink, session, options, part)
            .map_err(|error| error.at(&active))
            .and_then(|log| sync_directory(&active).map(|()| log))
            .inspect_err(|_| {
                // It contains no data.
                let _ = std::fs::remove_file(&active);
            })?;
        Ok(Self {
            log,
            unfinished: Unfinished {
                file: handle,
                active,
                path: path.to_owned(),
            },
            bytes,
        })
    }

    /// Takes the next arrival of the ordered stream; see [`LogWriter::push`].
    ///
    /// # Errors
    /// If the disk refuses bytes.
    pub fn push(&mut self, arrival: Arrival) -> Result<()> {
        self.log
            .push(arrival)
            .map_err(|error| error.at(&self.unfinished.active))
    }

    /// Takes a decoded record; see [`LogWriter::record`].
    pub fn record(&mut self, record: &Record) {
        self.log.record(record);
    }

    /// Takes an encoded message of another log; see [`LogWriter::message`].
    pub fn message(&mut self, message: &Encoded) {
        self.log.message(message);
    }

    /// Writes what is due at `now`; see [`LogWriter::flush_due`].
    ///
    /// # Errors
    /// If the disk refuses bytes.
    pub fn flush_due(&mut self, now: LogTime) -> Result<()> {
        self.log
            .flush_due(now)
            .map_err(|error| error.at(&self.unfinished.active))
    }

    /// Writes everything to the operating system.
    ///
    /// # Errors
    /// If the disk refuses bytes.
    pub fn flush(&mut self) -> Result<()> {
        self.log
            .flush()
            .map_err(|error| error.at(&self.unfinished.active))
    }

    /// Writes everything to the disk itself.
    ///
    /// # Errors
    /// If the disk refuses.
    pub fn sync(&mut self) -> Result<()> {
        self.flush()?;
        self.unfinished.sync()
    }

    /// Bytes written so far.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Where the log will be when it is whole.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.unfinished.path
    }

    /// Counts of the data in the log so far.
    #[must_use]
    pub fn counters(&self) -> &WriteCounters {
        self.log.counters()
    }

    /// Closes the log with its counters, statistics and indexes, syncs it and gives it its name.
    /// A file of that name is not replaced.
    ///
    /// # Errors
    /// If the disk refuses or a file of that name exists; the unfinished file then remains and can
    /// be recovered.
    pub fn finish(self) -> Result<Finished> {
        self.finish_by(crate::rename_without_replacing)
    }

    /// As [`finish`](Self::finish), but replaces a file of that name.
    ///
    /// # Errors
    /// If the disk refuses; the unfinished file then remains and can be recovered.
    pub fn finish_replacing(self) -> Result<Finished> {
        self.finish_by(|from, to| std::fs::rename(from, to))
    }

    fn finish_by(
        self,
        rename: impl FnOnce(&Path, &Path) -> std::io::Result<()>,
    ) -> Result<Finished> {
        let counters = self.log.counters().clone();
        let bytes = Arc::clone(&self.bytes);
        let (file, closed) = self.close();
        closed?;
        let path = file.finish(rename)?;
        Ok(Finished {
            path,
            bytes: bytes.load(Ordering::Relaxed),
            counters,
        })
    }

    /// Closes the log, if the disk allows it, and leaves its unfinished name.
    pub(crate) fn close(self) -> (Unfinished, Result<()>) {
        let finished = self.log.finish(&BTreeMap::new());
        let closed = finished
            .map(drop)
            .map_err(|error| error.at(&self.unfinished.active));
        (self.unfinished, closed)
    }

    /// States the losses on the way to this file.
    pub(crate) fn state_losses(&mut self, losses: &Losses) {
        self.log.state_losses(losses);
    }

    pub(crate) fn keep_unsynced(&mut self) {
        self.log.keep_unsynced();
    }

    pub(crate) fn take_unsynced(&mut self) -> Vec<Arrival> {
        self.log.take_unsynced()
    }

    pub(crate) fn reached_disk(&mut self, groups: u64) {
        self.log.reached_disk(groups);
    }

    pub(crate) fn decoded_is_due(&self, now: LogTime) -> bool {
        self.log.decoded_is_due(now)
    }

    pub(crate) fn has_decoded(&self) -> bool {
        self.log.has_decoded()
    }

    pub(crate) fn drop_decoded(&mut self) {
        self.log.drop_decoded();
    }

    pub(crate) fn flush_raw(&mut self) -> Result<()> {
        self.log
            .flush_raw()
            .map_err(|error| error.at(&self.unfinished.active))
    }

    /// The file under its unfinished name.
    pub(crate) fn unfinished(&self) -> &Unfinished {
        &self.unfinished
    }

    pub(crate) fn take_new_channels(&mut self) -> Vec<pb::JournalChannel> {
        self.log.take_new_channels()
    }

    pub(crate) fn group(&self) -> &[Arrival] {
        self.log.group()
    }

    pub(crate) fn groups(&self) -> u64 {
        self.log.groups()
    }

    pub(crate) fn last_log_time(&self) -> Option<LogTime> {
        self.log.last_log_time()
    }

    pub(crate) fn latched(&self) -> &Latched {
        self.log.latched()
    }

    pub(crate) fn continue_from(&mut self, latched: Latched, pending: Pending) -> Result<()> {
        self.log
            .continue_from(latched, pending)
            .map_err(|error| error.at(&self.unfinished.active))
    }

    pub(crate) fn abandon(self) -> (Pending, Latched, Unfinished) {
        let (pending, latched) = self.log.abandon();
        (pending, latched, self.unfinished)
    }

    pub(crate) fn handle(&self) -> Result<File> {
        self.unfinished
            .file
            .try_clone()
            .map_err(Error::file("open again", &self.unfinished.active))
    }
}

/// Folders whose disk does not respond, for tests.
#[cfg(test)]
pub(crate) mod hung {
    use std::path::{Path, PathBuf};
    use std::sync::Mutex;

    static FOLDERS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

    pub(crate) fn hang(folder: &Path) {
        FOLDERS.lock().unwrap().push(folder.to_owned());
    }

    pub(crate) fn release(folder: &Path) {
        FOLDERS.lock().unwrap().retain(|hung| hung != folder);
    }

    pub(super) fn wait(path: &Path) {
        let hangs = || {
            let folders = FOLDERS.lock().unwrap();
            folders.iter().any(|hung| path.starts_with(hung))
        };
        while hangs() {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    /// A file on a file system that is mounted read-only, if there is one.
    fn on_read_only() -> Option<File> {
        let mounts = std::fs::read_to_string("/proc/mounts").ok()?;
        let read_only = mounts.lines().filter_map(|line| {
            let mut words = line.split(' ').skip(1);
            let (place, options) = (words.next()?, words.nth(1)?);
            options.split(',').any(|o| o == "ro").then_some(place)
        });
        let entries = read_only.filter_map(|place| std::fs::read_dir(place).ok());
        let mut files = entries.flatten().flatten().map(|entry| entry.path());
        let file = files.find(|path| path.is_file())?;
        File::open(file).ok()
    }

    #[test]
    fn a_sync_that_cannot_have_written_is_refused() {
        sync(&tempfile::tempfile().unwrap()).unwrap();
        match on_read_only() {
            Some(file) => {
                let refusal = sync(&file).unwrap_err();
                assert_eq!(refusal.kind(), ErrorKind::ReadOnlyFilesystem);
            }
            None => testkit::report("left out, no file on a read-only file system"),
        }
    }
}
