//! The thread that waits for the disk, so that nobody else does.

use std::fs::File;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use super::Shared;
use crate::file::Unfinished;
use crate::{Error, Result};

/// What the syncing thread is asked to do.
pub(crate) enum Job {
    /// From now on sync this log and its journals.
    Watch(Watched),
    /// The log that is watched is given up: a disk that is in use cannot be unmounted.
    Forget,
    /// This file is closed: sync it and give it its name.
    Finish(Unfinished),
}

/// A log that is being written.
pub(crate) struct Watched {
    /// The log, then its journals.
    pub files: Vec<File>,
    pub groups: Arc<Groups>,
}

impl Watched {
    /// Syncs it; `false`, and told, if the disk refuses.
    fn sync(&self, shared: &Shared) -> bool {
        let written = self.groups.written.load(Ordering::Acquire);
        match self.files.iter().try_for_each(File::sync_data) {
            Ok(()) => {
                self.groups.synced.store(written, Ordering::Release);
                true
            }
            Err(error) => {
                report(shared, &format!("cannot sync the log: {error}"));
                false
            }
        }
    }
}

/// Groups of raw data in a log.
#[derive(Default)]
pub(crate) struct Groups {
    /// Handed to the operating system.
    pub written: AtomicU64,
    /// Those of them that have reached the disk.
    pub synced: AtomicU64,
}

/// The syncing thread.
pub(crate) struct Syncer {
    jobs: Sender<Job>,
    thread: JoinHandle<Vec<PathBuf>>,
}

impl Syncer {
    pub(crate) fn start(interval: Duration, shared: Arc<Shared>) -> Result<Self> {
        let (jobs, queue) = channel();
        let thread = std::thread::Builder::new()
            .name("store-sync".to_owned())
            .spawn(move || run(&queue, interval, &shared))
            .map_err(Error::file("start a thread for", ".".as_ref()))?;
        Ok(Self { jobs, thread })
    }

    pub(crate) fn send(&self, job: Job) {
        if self.jobs.send(job).is_err() {
            tracing::error!("the thread that syncs the log is gone");
        }
    }

    /// Waits until all is on the disk; gives the files that could not be finished.
    pub(crate) fn finish(self) -> Vec<PathBuf> {
        drop(self.jobs);
        self.thread.join().unwrap_or_default()
    }
}

fn run(queue: &Receiver<Job>, interval: Duration, shared: &Shared) -> Vec<PathBuf> {
    let mut watched: Option<Watched> = None;
    let mut closed = Closed::default();
    loop {
        match queue.recv_timeout(interval) {
            Ok(Job::Watch(log)) => {
                // A power cut must not leave what came later without what came before.
                if let Some(before) = watched.replace(log) {
                    before.sync(shared);
                }
            }
            Ok(Job::Forget) => watched = None,
            Ok(Job::Finish(file)) => {
                closed.take(file);
                continue;
            }
            Err(RecvTimeoutError::Timeout) => closed.give_names(),
            Err(RecvTimeoutError::Disconnected) => {
                closed.give_names();
                return closed.unfinished();
            }
        }
        watched = watched.filter(|log| log.sync(shared));
    }
}

/// Closed files that do not bear their names yet. The file that is being written goes on whatever
/// becomes of them.
#[derive(Default)]
struct Closed {
    /// On the disk; the name is tried again and again.
    nameless: Vec<Unfinished>,
    /// Not known to be on the disk; left to the next recovery.
    unsynced: Vec<PathBuf>,
    last_failure: String,
}

impl Closed {
    fn take(&mut self, file: Unfinished) {
        match file.sync() {
            Ok(()) => self.nameless.push(file),
            Err(error) => {
                tracing::error!(%error, "a closed log did not reach the disk");
                self.unsynced.push(file.active);
            }
        }
        self.give_names();
    }

    fn give_names(&mut self) {
        let last_failure = &mut self.last_failure;
        self.nameless.retain(|file| match file.give_name() {
            Ok(()) => false,
            Err(error) => {
                let reason = error.to_string();
                if reason != *last_failure {
                    tracing::error!(reason, "a closed log does not have its name yet");
                }
                *last_failure = reason;
                true
            }
        });
    }

    fn unfinished(self) -> Vec<PathBuf> {
        let nameless = self.nameless.into_iter().map(|file| file.active);
        self.unsynced.into_iter().chain(nameless).collect()
    }
}

fn report(shared: &Shared, reason: &str) {
    tracing::error!(reason, "the log did not reach the disk");
    *shared
        .sync_failed
        .lock()
        .unwrap_or_else(PoisonError::into_inner) = Some(reason.to_owned());
}
