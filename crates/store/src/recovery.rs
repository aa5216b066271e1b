//! Recovery of logs that were cut short or are damaged.

mod copy;
mod directory;

use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use mcap::records::op;
use sample::LogTime;

use crate::file::{final_path, lock, sync_directory};
use crate::reader::{Index, Lost, Missing, ScanOptions};
use crate::scan::{self, Ending, Scanner};
use crate::{Error, Result, journal};
use copy::{Saved, copy};
pub use directory::{companions, recover_directory, recover_each};

/// Name of the metadata record that describes a recovery.
pub(crate) const RECOVERED_METADATA: &str = "atvrec.recovered";

/// How logs are recovered.
#[derive(Clone, Debug)]
pub struct RecoverOptions {
    /// Return data that no checksum and no journal confirms, and mark the log.
    pub unchecked: bool,
    /// Bytes that a chunk may have when inflated, and any other record.
    pub max_chunk: u64,
    /// Stops the recovery when it is set; the log is unchanged then.
    pub stop: Option<Arc<AtomicBool>>,
}

impl Default for RecoverOptions {
    fn default() -> Self {
        Self {
            unchecked: false,
            max_chunk: scan::max_chunk(),
            stop: None,
        }
    }
}

/// Result of a recovery.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recovered {
    /// The whole log.
    pub path: PathBuf,
    /// It was complete and only got its name.
    pub was_whole: bool,
    /// It was cut before its first arrival, as just after a rotation, and was removed.
    pub was_empty: bool,
    /// Messages saved.
    pub messages: u64,
    /// Those of them that were in a chunk that was cut. They have no checksum, so only a recovery with
    /// `unchecked` returns them.
    pub messages_of_cut_chunk: u64,
    /// Arrivals that were in the journals only.
    pub arrivals_of_journal: u64,
    /// Data that is missing from the file.
    pub missing: Vec<Missing>,
    /// Data that could not be saved; `None` if everything was saved.
    pub loss: Option<Loss>,
    /// Path of the damaged original, if data could not be saved.
    pub original: Option<PathBuf>,
}

/// Data of a log that could not be saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Loss {
    /// Bytes of the file that are damaged, or that no checksum confirms.
    pub bytes: u64,
    /// Chunks in them, as far as they can be counted.
    pub chunks: u64,
    /// Log times of the last intact chunk before them and of the first one after them.
    pub span: Option<(LogTime, LogTime)>,
}

impl std::fmt::Display for Loss {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} bytes with {} chunks", self.bytes, self.chunks)?;
        match self.span {
            Some((from, to)) => write!(f, ", between the log times {from} s and {to} s"),
            None => Ok(()),
        }
    }
}

/// [`recover_with`] the defaults.
///
/// # Errors
/// As [`recover_with`].
pub fn recover(path: &Path) -> Result<Recovered> {
    recover_with(path, &RecoverOptions::default())
}

/// Repairs a log in place. It saves all chunks that their checksums confirm, anywhere in the file, and
/// the contents of the journals, writes summary and indexes, syncs and reads the new file, and replaces
/// the old file in one step. The result contains nothing that was not in the old file or its journals,
/// except counters of the saved data and a metadata record that describes the recovery.
///
/// If data could not be saved, the old file stays beside the new one, as `<log>.damaged`. An unfinished
/// log whose end is intact and which contains only repeated states is removed.
///
/// # Errors
/// If the file cannot be read, is no MCAP file, is being written, or the result cannot be written or
/// read again; the old file is unchanged then.
pub fn recover_with(path: &Path, options: &RecoverOptions) -> Result<Recovered> {
    if !std::fs::metadata(path)
        .map_err(Error::file("open", path))?
        .is_file()
    {
        return Err(Error::NoFile(path.to_owned()));
    }
    let file = File::open(path).map_err(Error::file("open", path))?;
    lock(&file, path)?;
    let target = final_path(path);
    let mut scan_options = ScanOptions {
        unchecked: options.unchecked,
        bound: options.max_chunk,
        stop: options.stop.clone(),
    };
    let index = Index::scan(path, &scan_options)?;
    if index.ending == Some(Ending::Closed) && index.lost == Lost::default() {
        return take_name(path, &target, &index);
    }
    if let Some(bytes) = index.lost.too_large {
        return Err(Error::TooLarge {
            path: path.to_owned(),
            bytes,
            bound: options.max_chunk,
        });
    }
    // Records that the checksum of the data section confirms are not unconfirmed.
    scan_options.unchecked = index.gives_unchecked;
    let needed = bytes_needed(&file, &target)?;
    let temporary = with_suffix(&target, ".recovering");
    check_room(path, needed)?;
    let outcome = rewrite(path, &temporary, &index, &scan_options, &target).and_then(|saved| {
        check_copy(path, &temporary, &saved, &scan_options)?;
        // The contents of a chunk that was begun are unknown.
        let cut_chunk = matches!(
            index.ending,
            Some(Ending::Cut {
                opcode: None | Some(op::CHUNK),
                ..
            })
        );
        if target != path && saved.is_empty() && saved.loss.is_none() && !cut_chunk {
            remove_empty(path, &temporary, &target)?;
            return Ok((saved, None, true));
        }
        let original = put_in_place(path, &temporary, &target, saved.loss.as_ref())?;
        Ok((saved, original, false))
    });
    let (saved, original, was_empty) = outcome.map_err(|error| {
        let _ = std::fs::remove_file(&temporary);
        if error.is_full_disk() {
            let path = path.to_owned();
            let free = free_bytes(&path).unwrap_or_default();
            return Error::NoRoom { path, needed, free };
        }
        error
    })?;
    Ok(Recovered {
        path: target,
        was_whole: false,
        was_empty,
        messages: saved.messages,
        messages_of_cut_chunk: saved.messages_of_cut_chunk,
        arrivals_of_journal: saved.arrivals_of_journal,
        missing: index.missing,
        loss: saved.loss,
        original,
    })
}

/// Writes all intact data of `input` and of its `journals` as a finished log to `output`, like
/// [`recover`], but without files. Returns the number of messages.
///
/// # Errors
/// If `input` does not begin like MCAP and has no intact chunk, or if reading or writing fails.
pub fn salvage<R: Read + Seek, W: Write>(
    mut input: R,
    journals: &[&[u8]],
    output: W,
) -> Result<u64> {
    let mut options = ScanOptions::default();
    let journal = journal::parse(journals.iter().copied());
    let scanner = Scanner::new(&mut input).map_err(Error::Sink)?;
    let path = Path::new("the input");
    let index = Index::scan_all(scanner, path, &options, &journal.channels)?;
    options.unchecked = index.gives_unchecked;
    let scanner = Scanner::new(&mut input).map_err(Error::Sink)?;
    Ok(copy(scanner, output, &index, journal, &options, false)?.messages)
}

/// Gives a complete log its name.
fn take_name(path: &Path, target: &Path, index: &Index) -> Result<Recovered> {
    if target != path {
        check_name(path, path, target)?;
        std::fs::rename(path, target).map_err(Error::file("give its final name to", path))?;
        sync_directory(target)?;
    }
    journal::remove(target)?;
    Ok(Recovered {
        path: target.to_owned(),
        was_whole: true,
        was_empty: false,
        messages: index.counts.values().sum(),
        messages_of_cut_chunk: 0,
        arrivals_of_journal: 0,
        missing: Vec::new(),
        loss: None,
        original: None,
    })
}

/// Another file with the log's name is the result of a recovery that was killed; any other file is not
/// changed.
fn check_name(path: &Path, new: &Path, target: &Path) -> Result<()> {
    if !target.exists() || same_bytes(new, target).map_err(Error::file("read", target))? {
        return Ok(());
    }
    Err(Error::NameTaken {
        path: path.to_owned(),
        existing: target.to_owned(),
    })
}

fn same_bytes(one: &Path, other: &Path) -> std::io::Result<bool> {
    let mut files = [File::open(one)?, File::open(other)?];
    if files[0].metadata()?.len() != files[1].metadata()?.len() {
        return Ok(false);
    }
    let [first, second] = &mut files;
    let (mut a, mut b) = (Vec::new(), Vec::new());
    loop {
        a.clear();
        b.clear();
        first.take(1 << 16).read_to_end(&mut a)?;
        second.take(1 << 16).read_to_end(&mut b)?;
        if a != b {
            return Ok(false);
        }
        if a.is_empty() {
            return Ok(true);
        }
    }
}

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    name.into()
}

fn rewrite(
    path: &Path,
    temporary: &Path,
    index: &Index,
    options: &ScanOptions,
    target: &Path,
) -> Result<Saved> {
    let output = OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(true)
        .open(temporary)
        .map_err(Error::file("create", temporary))?;
    let mut scanner = Scanner::open(path)?;
    scanner.stop_at(options.stop.clone());
    let journal = journal::read(target)?;
    let is_active = target != path;
    let copied = copy(scanner, &output, index, journal, options, is_active);
    let saved = copied.map_err(|error| match error {
        Error::Sink(cause) if scan::is_stop(&cause) => Error::Stopped(path.to_owned()),
        other => other.at(temporary),
    })?;
    output.sync_all().map_err(Error::file("sync", temporary))?;
    Ok(saved)
}

/// Reads the copy in full and compares all its checksums.
fn check_copy(path: &Path, temporary: &Path, saved: &Saved, options: &ScanOptions) -> Result<()> {
    let options = ScanOptions {
        unchecked: false,
        // A chunk may be larger by the definitions that were missing in it.
        bound: options.bound.saturating_mul(2),
        stop: options.stop.clone(),
    };
    let copy = Index::scan(temporary, &options)?;
    let messages: u64 = copy.counts.values().sum();
    let what = if copy.ending != Some(Ending::Closed) || copy.lost != Lost::default() {
        copy.missing
            .first()
            .map_or_else(String::new, Missing::without_path)
    } else if messages != saved.messages {
        format!(
            "{messages} messages are in it, {} were written",
            saved.messages
        )
    } else {
        return Ok(());
    };
    Err(Error::NotVerified {
        path: path.to_owned(),
        what,
    })
}

/// Gives the copy the name of the log. If data is lost, gives the original another name, and returns it.
/// If this is killed at any point, the next recovery ends with the same files.
fn put_in_place(
    path: &Path,
    temporary: &Path,
    target: &Path,
    loss: Option<&Loss>,
) -> Result<Option<PathBuf>> {
    let named = |cause| Error::file("replace", target)(cause);
    let Some(_) = loss else {
        if target != path {
            check_name(path, temporary, target)?;
        }
        std::fs::rename(temporary, target).map_err(named)?;
        sync_directory(target)?;
        if target != path {
            std::fs::remove_file(path).map_err(Error::file("remove", path))?;
        }
        journal::remove(target)?;
        sync_directory(target)?;
        return Ok(None);
    };
    let kept = directory::damaged_name(path, target);
    if target == path {
        // A link, so that the log always has a file; not every file system has links.
        let linked = kept.exists() || std::fs::hard_link(path, &kept).is_ok();
        if !linked {
            std::fs::rename(path, &kept).map_err(Error::file("rename", path))?;
        }
        std::fs::rename(temporary, target).map_err(named)?;
    } else {
        check_name(path, temporary, target)?;
        std::fs::rename(temporary, target).map_err(named)?;
        std::fs::rename(path, &kept).map_err(Error::file("rename", path))?;
    }
    journal::keep_damaged(target)?;
    sync_directory(target)?;
    Ok(Some(kept))
}

/// Removes an unfinished log without data.
fn remove_empty(path: &Path, temporary: &Path, target: &Path) -> Result<()> {
    std::fs::remove_file(temporary).map_err(Error::file("remove", temporary))?;
    std::fs::remove_file(path).map_err(Error::file("remove", path))?;
    sync_directory(target)?;
    journal::remove(target)
}

/// Largest expected size of the copy of a log, bytes: recovery writes the same chunks again, with
/// indexes and a summary.
fn bytes_needed(file: &File, target: &Path) -> Result<u64> {
    let metadata = file.metadata().map_err(Error::file("read", target))?;
    let mut bytes = metadata.len();
    #[cfg(unix)]
    {
        // Holes of a sparse file are not copied.
        use std::os::unix::fs::MetadataExt as _;
        bytes = bytes.min(metadata.blocks().saturating_mul(512));
    }
    for journal in journal::paths(target) {
        bytes += std::fs::metadata(journal).map_or(0, |metadata| metadata.len());
    }
    Ok(bytes + bytes / 16 + (1 << 16))
}

fn check_room(path: &Path, needed: u64) -> Result<()> {
    match free_bytes(path) {
        Some(free) if free < needed => Err(Error::NoRoom {
            path: path.to_owned(),
            needed,
            free,
        }),
        _ => Ok(()),
    }
}

/// Free bytes on the disk of a file, if the system knows.
fn free_bytes(path: &Path) -> Option<u64> {
    #[cfg(unix)]
    {
        let disk = rustix::fs::statvfs(path).ok()?;
        Some(disk.f_bavail.saturating_mul(disk.f_frsize))
    }
    #[cfg(not(unix))]
    {
        let _ = path;
        None
    }
}
