//! Recovery of all unfinished logs of a directory, and the files that belong to a log.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use super::{RecoverOptions, Recovered, recover_with, with_suffix};
use crate::file::{
    ACTIVE_SUFFIX, DAMAGED_SUFFIX, UNRECOVERABLE_SUFFIX, active_path, is_same_file, lock,
    sync_directory,
};
use crate::reader::{Index, ScanOptions};
use crate::scan::Ending;
use crate::{Error, Result, journal};

const RECOVERING_SUFFIX: &str = ".recovering";

/// All results of [`recover_each`] with the defaults.
///
/// # Errors
/// If the directory cannot be read.
pub fn recover_directory(directory: &Path) -> Result<Vec<(PathBuf, Result<Recovered>)>> {
    Ok(recover_each(directory, RecoverOptions::default())?.collect())
}

/// Recovers the unfinished logs of a directory, one with each step of the iterator. Logs that another
/// process is writing are not changed. Journals of complete logs are removed. A file that recovery cannot
/// handle gets the ending [`UNRECOVERABLE_SUFFIX`] and is not tried again. The iterator ends when
/// [`RecoverOptions::stop`] is set; a further call continues.
///
/// # Errors
/// If the directory cannot be read.
pub fn recover_each(
    directory: &Path,
    options: RecoverOptions,
) -> Result<impl Iterator<Item = (PathBuf, Result<Recovered>)>> {
    let read = || Error::file("read the directory", directory);
    let mut unfinished = Vec::new();
    for entry in std::fs::read_dir(directory).map_err(read())? {
        let path = entry.map_err(read())?.path();
        if let Some(log) = journal::log_of(&path)
            && log.exists()
            && !active_path(&log).exists()
        {
            journal::remove(&log)?;
        }
        let name = path.as_os_str().to_string_lossy();
        if name.ends_with(&format!(".mcap{RECOVERING_SUFFIX}")) {
            // Only the next recovery depends on it.
            let _ = finish_killed(&path);
        }
        if name.ends_with(&format!(".mcap{ACTIVE_SUFFIX}")) {
            unfinished.push(path);
        }
    }
    unfinished.sort();
    let is_stopped = {
        let stop = options.stop.clone();
        move || {
            stop.as_ref()
                .is_some_and(|stop| stop.load(std::sync::atomic::Ordering::Relaxed))
        }
    };
    let results = unfinished.into_iter().map(move |path| {
        let result = recover_with(&path, &options).or_else(|error| set_aside(&path, error));
        (path, result)
    });
    Ok(results
        .take_while(move |_| !is_stopped())
        .filter(|(_, result)| !matches!(result, Err(Error::InUse(_)))))
}

/// The other files that belong to the log `path`: journals, damaged originals, and all other files whose
/// names begin with the name of the log, except the unfinished log itself.
#[must_use]
pub fn companions(path: &Path) -> Vec<PathBuf> {
    let Some(name) = path.file_name().and_then(OsStr::to_str) else {
        return Vec::new();
    };
    let entries = std::fs::read_dir(parent(path)).into_iter().flatten();
    let mut companions: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| {
            let rest = path.file_name().and_then(OsStr::to_str);
            rest.and_then(|rest| rest.strip_prefix(name))
                .is_some_and(|rest| rest.starts_with('.') && rest != ACTIVE_SUFFIX)
        })
        .collect();
    companions.sort();
    companions
}

/// The name under which the damaged original `path` of the log `target` is kept: a free one, unless a
/// recovery that was killed gave it one already.
pub(super) fn damaged_name(path: &Path, target: &Path) -> PathBuf {
    let mut names = std::iter::once(with_suffix(target, DAMAGED_SUFFIX))
        .chain((2..).map(|number| with_suffix(target, &format!(".{number}{DAMAGED_SUFFIX}"))));
    names
        .find(|name| !name.exists() || is_same_file(name, path))
        .unwrap_or_else(|| with_suffix(target, DAMAGED_SUFFIX))
}

fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Renames a file that another attempt would not recover either. Errors that may not be permanent are
/// returned.
fn set_aside(path: &Path, error: Error) -> Result<Recovered> {
    let lasts = matches!(
        error,
        Error::NoFile(_) | Error::NotMcap { .. } | Error::TooLarge { .. } | Error::NameTaken { .. }
    );
    if !lasts {
        return Err(error);
    }
    let mut names = std::iter::once(with_suffix(path, UNRECOVERABLE_SUFFIX))
        .chain((2..).map(|number| with_suffix(path, &format!(".{number}{UNRECOVERABLE_SUFFIX}"))));
    let Some(to) = names.find(|name| std::fs::symlink_metadata(name).is_err()) else {
        return Err(error);
    };
    std::fs::rename(path, &to).map_err(Error::file("set aside", path))?;
    sync_directory(&to)?;
    let cause = Box::new(error);
    Err(Error::SetAside { to, cause })
}

/// Completes a recovery that was killed. If it was killed between the two renames of a file system
/// without links, its result is complete and gets the name of the log. Otherwise the log still exists,
/// and the result is removed.
fn finish_killed(temporary: &Path) -> Result<()> {
    let name = temporary.as_os_str().to_string_lossy();
    let target = PathBuf::from(name.strip_suffix(RECOVERING_SUFFIX).unwrap_or(&name));
    let active = active_path(&target);
    let remove = || std::fs::remove_file(temporary).map_err(Error::file("remove", temporary));
    for log in [&target, &active] {
        if log.is_file() {
            let file = std::fs::File::open(log).map_err(Error::file("open", log))?;
            // Otherwise a recovery is running.
            lock(&file, log)?;
            return remove();
        }
    }
    if !with_suffix(&target, DAMAGED_SUFFIX).exists() {
        return Ok(());
    }
    let index = Index::scan(temporary, &ScanOptions::default())?;
    if index.ending == Some(Ending::Closed) {
        std::fs::rename(temporary, &target).map_err(Error::file("rename", temporary))?;
        sync_directory(&target)?;
    }
    Ok(())
}
