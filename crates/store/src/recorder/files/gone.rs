//! Files that are deleted or renamed while they are being written.

use std::path::{Path, PathBuf};

use super::{Files, Sink};
use crate::file::{Presence, active_path};
use crate::recorder::GoneLog;
use crate::{Losses, Result};

/// The folder of the logs, at the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Folder {
    device: u64,
    inode: u64,
}

impl Folder {
    #[cfg(unix)]
    pub(super) fn of(path: &Path) -> Option<Self> {
        use std::os::unix::fs::MetadataExt;
        let found = std::fs::metadata(path)
            .ok()
            .filter(|found| found.is_dir())?;
        Some(Self {
            device: found.dev(),
            inode: found.ino(),
        })
    }

    #[cfg(not(unix))]
    pub(super) fn of(_: &Path) -> Option<Self> {
        None
    }
}

impl Files {
    /// Checks that the open file still has its name. If not, a new file takes the data in memory.
    pub(super) fn look_for_file(&mut self) {
        let Sink::Open(file) = &self.sink else {
            return;
        };
        let deleted = match file.writer.unfinished().presence() {
            Presence::Named => return,
            Presence::Moved => false,
            Presence::Deleted => true,
        };
        let (held, records) = (file.writer.counters().held.clone(), file.records);
        let path = file.writer.unfinished().active.clone();
        let done = if deleted { "deleted" } else { "renamed" };
        let reason = format!("{} was {done} while it was being written", path.display());
        self.summary.last_failure = Some(reason.clone());
        self.set_failing(reason);
        self.give_file_up(true);
        let mut lost = Losses::default();
        if deleted {
            lost = held.since(&self.fresh.losses);
            lost.records = records.saturating_sub(self.fresh.losses.records);
        }
        self.enter_gone(path, &lost, deleted);
        if deleted && Folder::of(&self.directory) != self.folder {
            self.count_closed_files();
        }
        self.shared.set_summary(&self.summary);
        self.retry();
    }

    fn enter_gone(&mut self, path: PathBuf, lost: &Losses, deleted: bool) {
        self.shared.ledger.enter_unwritten(lost);
        if deleted {
            tracing::error!(
                log = %path.display(),
                arrivals = lost.arrivals,
                "the log was deleted while it was being written; what it held is lost, and the \
                 recording continues in a new file"
            );
        } else {
            tracing::error!(
                log = %path.display(),
                "the log was renamed or moved while it was being written; the recording continues \
                 in a new file, and `atvrec recover` closes the old one where it lies now"
            );
        }
        self.summary.gone.push(GoneLog {
            path,
            arrivals: lost.arrivals,
            deleted,
        });
    }

    /// Counts the closed files of the run that were deleted with the folder.
    fn count_closed_files(&mut self) {
        let exists = |path: &Path| path.exists() || active_path(path).exists();
        let files = std::mem::take(&mut self.summary.files);
        for file in files {
            if exists(&file.path) {
                self.summary.files.push(file);
            } else {
                self.enter_gone(file.path, &file.counters.held, true);
            }
        }
    }

    /// Creates the folder of the logs again if it was deleted. If its disk is absent, too, the folder is
    /// not created: data in it would be below the mount point, on another disk.
    pub(super) fn make_folder(&mut self) {
        let Some(folder) = self.folder else { return };
        if self.directory.exists() {
            return;
        }
        let above = self.directory.ancestors().skip(1);
        let above = above.map(|path| {
            if path.as_os_str().is_empty() {
                Path::new(".")
            } else {
                path
            }
        });
        let Some(parent) = above.into_iter().find_map(Folder::of) else {
            return;
        };
        if parent.device != folder.device {
            return;
        }
        let made: Result<()> = std::fs::create_dir_all(&self.directory)
            .map_err(crate::Error::file("make again", &self.directory));
        match made {
            Ok(()) => {
                tracing::warn!(
                    folder = %self.directory.display(),
                    "the log folder was deleted; it is created again"
                );
                self.folder = Folder::of(&self.directory);
            }
            // The creation of the new file in it fails, which is reported.
            Err(error) => tracing::debug!(%error, "no log folder"),
        }
    }
}
