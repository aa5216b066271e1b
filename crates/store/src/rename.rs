//! Gives all parts of a run another name, so that a kill in the middle loses nothing.
//!
//! A small file `<old stem>.rename` contains the new stem before the first part is renamed, and is
//! removed after the last. [`finish_renames`] completes an interrupted rename.

use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use crate::file::{ACTIVE_SUFFIX, sync_directory};
use crate::{Error, Result};

/// Ending of the name of a file with the new stem of a run.
pub const RENAME_SUFFIX: &str = ".rename";
/// Longest stem, bytes.
const STEM_MAX: usize = 255;

/// Renames every file of a run in `directory`, parts and what belongs to them, from
/// `<stem>_…` to `<new_stem>_…`. Never replaces a file: one whose new name is taken keeps its old
/// one. If a part is unfinished or locked by another process, nothing is done, and the result is
/// `false`.
///
/// # Errors
/// If the directory cannot be read or written. [`finish_renames`] does the rest then.
pub fn rename_run(directory: &Path, stem: &str, new_stem: &str) -> Result<bool> {
    let files = files_of(directory, stem)?;
    let _locks = match lock_all(&files) {
        Some(locks) => locks,
        None => return Ok(false),
    };
    let intent = directory.join(format!("{stem}{RENAME_SUFFIX}"));
    let mut file = OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(true)
        .open(&intent)
        .map_err(Error::file("create", &intent))?;
    file.write_all(new_stem.as_bytes())
        .and_then(|()| file.write_all(b"\n"))
        .and_then(|()| file.sync_all())
        .map_err(Error::file("write", &intent))?;
    sync_directory(&intent)?;
    carry_out(&intent, &files, stem, new_stem)?;
    Ok(true)
}

/// Finishes the renames of a directory that a kill interrupted. An intent that cannot be read is
/// removed: the parts keep the names that they have.
///
/// # Errors
/// If the directory cannot be read or written.
pub fn finish_renames(directory: &Path) -> Result<()> {
    for entry in std::fs::read_dir(directory).map_err(Error::file("read", directory))? {
        let entry = entry.map_err(Error::file("read", directory))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let Some(stem) = name.strip_suffix(RENAME_SUFFIX) else {
            continue;
        };
        let intent = entry.path();
        let is_small = entry
            .metadata()
            .is_ok_and(|data| data.is_file() && data.len() <= STEM_MAX as u64 + 1);
        if !is_small {
            continue;
        }
        let text = std::fs::read(&intent).map_err(Error::file("read", &intent))?;
        match String::from_utf8(text).ok().as_deref().and_then(new_stem) {
            Some(new) => carry_out(&intent, &files_of(directory, stem)?, stem, new)?,
            None => std::fs::remove_file(&intent).map_err(Error::file("remove", &intent))?,
        }
    }
    Ok(())
}

/// The stem that an intent holds; `None` for one that was not written to its end.
fn new_stem(text: &str) -> Option<&str> {
    let stem = text.strip_suffix('\n')?;
    let is_plain = !stem.is_empty() && !stem.contains(['/', '\0', '\n']);
    is_plain.then_some(stem)
}

/// The files whose names begin with `<stem>_`, in order.
fn files_of(directory: &Path, stem: &str) -> Result<Vec<PathBuf>> {
    let start = format!("{stem}_");
    let mut files = Vec::new();
    for entry in std::fs::read_dir(directory).map_err(Error::file("read", directory))? {
        let entry = entry.map_err(Error::file("read", directory))?;
        if entry.file_name().to_string_lossy().starts_with(&start) {
            files.push(entry.path());
        }
    }
    files.sort();
    Ok(files)
}

/// Locks the parts; `None` if one is unfinished or locked by another process.
fn lock_all(files: &[PathBuf]) -> Option<Vec<File>> {
    let mut locks = Vec::new();
    for path in files {
        let name = path.to_string_lossy();
        if name.ends_with(ACTIVE_SUFFIX) || name.ends_with(".recovering") {
            return None;
        }
        if !name.ends_with(".mcap") || !path.is_file() {
            continue;
        }
        let file = File::open(path).ok()?;
        file.try_lock().ok()?;
        locks.push(file);
    }
    Some(locks)
}

fn carry_out(intent: &Path, files: &[PathBuf], stem: &str, new_stem: &str) -> Result<()> {
    for path in files {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let Some(rest) = name.strip_prefix(stem) else {
            continue;
        };
        let target = path.with_file_name(format!("{new_stem}{rest}"));
        match rename_new(path, &target) {
            Ok(()) => {}
            Err(error) if error.kind() == ErrorKind::AlreadyExists => tracing::warn!(
                file = %path.display(),
                taken = %target.display(),
                "the file keeps its name: the new name is taken"
            ),
            Err(error) => return Err(Error::file("rename", path)(error)),
        }
    }
    sync_directory(intent)?;
    std::fs::remove_file(intent).map_err(Error::file("remove", intent))?;
    sync_directory(intent)
}

/// Renames a file unless the new name is taken.
fn rename_new(from: &Path, to: &Path) -> std::io::Result<()> {
    #[cfg(unix)]
    {
        use rustix::fs::{CWD, RenameFlags, renameat_with};
        use rustix::io::Errno;
        match renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE) {
            // A file system without this flag.
            Err(Errno::INVAL | Errno::NOSYS | Errno::OPNOTSUPP) => {}
            result => return Ok(result?),
        }
    }
    if to.symlink_metadata().is_ok() {
        return Err(ErrorKind::AlreadyExists.into());
    }
    std::fs::rename(from, to)
}

#[cfg(test)]
mod tests {
    use super::*;

    const OLD: &str = "drive-r000007-20020101T000005Z-unsynced";
    const NEW: &str = "drive-r000007-20261121T140500Z";

    fn write(directory: &Path, name: &str) {
        std::fs::write(directory.join(name), name).expect("written");
    }

    fn names(directory: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(directory).expect("a directory");
        let names = entries.map(|entry| entry.expect("an entry").file_name());
        let mut names: Vec<_> = names
            .map(|name| name.to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    fn run(directory: &Path) {
        for rest in [
            "_0000.mcap",
            "_0001.mcap",
            "_0001.mcap.damaged",
            "_0002.mcap",
        ] {
            write(directory, &format!("{OLD}{rest}"));
        }
        write(directory, "drive-r000007_0000.mcap");
    }

    fn renamed() -> Vec<String> {
        vec![
            format!("{NEW}_0000.mcap"),
            format!("{NEW}_0001.mcap"),
            format!("{NEW}_0001.mcap.damaged"),
            format!("{NEW}_0002.mcap"),
            "drive-r000007_0000.mcap".to_owned(),
        ]
    }

    #[test]
    fn all_files_of_a_run_and_no_other_get_the_new_name() {
        let directory = tempfile::tempdir().expect("a directory");
        run(directory.path());
        assert!(rename_run(directory.path(), OLD, NEW).expect("renamed"));
        assert_eq!(names(directory.path()), renamed());
    }

    #[test]
    fn a_kill_between_two_renames_is_made_good() {
        for done in 0..4 {
            let directory = tempfile::tempdir().expect("a directory");
            run(directory.path());
            write(directory.path(), &format!("{OLD}{RENAME_SUFFIX}"));
            let intent = directory.path().join(format!("{OLD}{RENAME_SUFFIX}"));
            std::fs::write(intent, format!("{NEW}\n")).expect("written");
            for path in files_of(directory.path(), OLD)
                .expect("listed")
                .iter()
                .take(done)
            {
                let name = path.to_string_lossy().replace(OLD, NEW);
                std::fs::rename(path, name).expect("renamed");
            }
            finish_renames(directory.path()).expect("finished");
            assert_eq!(names(directory.path()), renamed(), "after {done} renames");
        }
    }

    #[test]
    fn an_intent_that_was_cut_renames_nothing() {
        for text in ["", "drive-r0000", "../x\n"] {
            let directory = tempfile::tempdir().expect("a directory");
            run(directory.path());
            let before = names(directory.path());
            let intent = directory.path().join(format!("{OLD}{RENAME_SUFFIX}"));
            std::fs::write(intent, text).expect("written");
            finish_renames(directory.path()).expect("finished");
            assert_eq!(names(directory.path()), before);
        }
    }

    #[test]
    fn no_file_is_replaced() {
        let directory = tempfile::tempdir().expect("a directory");
        run(directory.path());
        let taken = directory.path().join(format!("{NEW}_0001.mcap"));
        std::fs::write(&taken, "another").expect("written");
        rename_run(directory.path(), OLD, NEW).expect("renamed");
        assert_eq!(std::fs::read(&taken).expect("read"), b"another");
        assert!(directory.path().join(format!("{OLD}_0001.mcap")).exists());
        assert!(directory.path().join(format!("{NEW}_0002.mcap")).exists());
    }

    #[test]
    fn a_run_with_an_unfinished_or_locked_part_waits() {
        let directory = tempfile::tempdir().expect("a directory");
        run(directory.path());
        let part = directory.path().join(format!("{OLD}_0002.mcap"));
        let lock = File::open(&part).expect("opened");
        lock.lock().expect("locked");
        assert!(!rename_run(directory.path(), OLD, NEW).expect("looked at"));
        drop(lock);
        std::fs::rename(&part, crate::file::active_path(&part)).expect("renamed");
        assert!(!rename_run(directory.path(), OLD, NEW).expect("looked at"));
        assert!(directory.path().join(format!("{OLD}_0000.mcap")).exists());
    }
}
