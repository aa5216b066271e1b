//! Folders whose entries appear when all of them are complete.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use super::TargetError;
use crate::{Error, Result};

/// How the name of the temporary folder begins. Readers of datasets ignore names with a dot in front.
const PARTIAL: &str = ".atvrec-partial-";

/// A folder in which complete files and folders appear. They are written in a hidden temporary folder
/// inside of it, which is removed when this value is dropped. A killed command leaves the temporary folder.
pub struct Folder {
    path: PathBuf,
    partial: PathBuf,
    is_new: bool,
}

impl Folder {
    /// Opens a folder, or creates it. `is_own` tells which names may be in it.
    ///
    /// # Errors
    /// [`TargetError`] if it is a file, if its parent does not exist, or if it contains other data; if it
    /// cannot be created.
    pub fn open(path: &Path, is_own: impl Fn(&OsStr) -> bool) -> Result<Self> {
        let is_new = match fs::metadata(path) {
            Ok(found) if found.is_dir() => false,
            Ok(_) => {
                let path = path.to_owned();
                return Err(TargetError::File { path }.into());
            }
            Err(_) => true,
        };
        if is_new {
            let parent = path.parent().filter(|parent| *parent != Path::new(""));
            if let Some(directory) = parent.filter(|parent| !parent.is_dir()) {
                return Err(TargetError::NoDirectory {
                    path: path.to_owned(),
                    directory: directory.to_owned(),
                }
                .into());
            }
        } else if let Some(entry) = other_data(path, is_own).map_err(failed(path))? {
            let path = path.to_owned();
            return Err(TargetError::OtherData { path, entry }.into());
        }
        let partial = path.join(format!("{PARTIAL}{}", std::process::id()));
        let folder = Self {
            path: path.to_owned(),
            partial,
            is_new,
        };
        // A killed command with the same number may have left one.
        let _ = fs::remove_dir_all(&folder.partial);
        fs::create_dir_all(&folder.partial).map_err(failed(path))?;
        Ok(folder)
    }

    /// The temporary folder.
    pub fn partial(&self) -> &Path {
        &self.partial
    }

    /// Moves `from`, a path in the temporary folder, to `to`, a path in the folder. `replaced`, a path in the
    /// folder, is removed.
    ///
    /// # Errors
    /// If the disk fails, or if `to` was created meanwhile. `replaced` is still there then.
    pub fn publish(&self, from: &Path, to: &Path, replaced: Option<&Path>) -> Result<()> {
        let (from, to) = (self.partial.join(from), self.path.join(to));
        let replaced = replaced.map(|path| self.path.join(path));
        let aside = self.partial.join("replaced");
        let publish = || -> std::io::Result<()> {
            sync(&from)?;
            let parent = to.parent().unwrap_or(&self.path);
            fs::create_dir_all(parent)?;
            if let Some(replaced) = &replaced {
                fs::rename(replaced, &aside)?;
            }
            if let Err(error) = store::rename_without_replacing(&from, &to) {
                if let Some(replaced) = &replaced {
                    fs::rename(&aside, replaced)?;
                }
                return Err(error);
            }
            store::sync_folder(parent)?;
            match replaced {
                Some(_) if aside.is_dir() => fs::remove_dir_all(&aside),
                Some(_) => fs::remove_file(&aside),
                None => Ok(()),
            }
        };
        publish().map_err(failed(&to))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // The first error is reported, not one of these. A folder with other entries stays.
        let _ = fs::remove_dir_all(&self.partial);
        if self.is_new {
            let _ = fs::remove_dir(&self.path);
        }
    }
}

/// The first entry that may not be in the folder.
fn other_data(path: &Path, is_own: impl Fn(&OsStr) -> bool) -> std::io::Result<Option<PathBuf>> {
    for entry in fs::read_dir(path)? {
        let name = entry?.file_name();
        let is_partial = name.to_string_lossy().starts_with(PARTIAL);
        if !is_partial && !is_own(&name) {
            return Ok(Some(name.into()));
        }
    }
    Ok(None)
}

/// Syncs all files below a path.
fn sync(path: &Path) -> std::io::Result<()> {
    if path.is_dir() {
        for entry in fs::read_dir(path)? {
            sync(&entry?.path())?;
        }
        return store::sync_folder(path);
    }
    File::open(path)?.sync_all()
}

fn failed(path: &Path) -> impl Fn(std::io::Error) -> Error {
    let path = path.to_owned();
    move |cause| Error::Write {
        path: path.clone(),
        source: cause.into(),
    }
}
