//! The thread that syncs, so that no other thread waits for the disk.

use std::fs::File;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, OnceLock};
use std::thread::JoinHandle;
use std::time::Duration;

use sample::Arrival;

use super::Shared;
use crate::file::{Presence, Unfinished, sync};
use crate::{Error, Result};

/// A job of the syncing thread.
pub(crate) enum Job {
    /// Sync this log and its journals from now on.
    Watch(Watched),
    /// Close the handles of the log that is synced: a disk that is in use cannot be unmounted.
    Forget,
    /// Sync this log, which is complete, and give it its name. Then sync the log that follows.
    Leave(Box<ClosedLog>, Option<Watched>),
    /// Answer when all jobs before this one are done.
    Settle(Sender<()>),
}

/// A log that is being written.
pub(crate) struct Watched {
    /// The log, then its journals.
    pub files: Vec<File>,
    pub groups: Arc<Groups>,
}

impl Watched {
    /// Syncs it; `false`, with a message, if the disk fails.
    fn sync(&self) -> bool {
        let written = self.groups.written.load(Ordering::Acquire);
        match self.files.iter().try_for_each(sync) {
            Ok(()) => {
                self.groups.synced.store(written, Ordering::Release);
                true
            }
            Err(error) => {
                tracing::error!(%error, "cannot sync the log");
                self.groups.refuse(format!("cannot sync the log: {error}"));
                false
            }
        }
    }
}

/// A log to which nothing more is written.
pub(crate) struct ClosedLog {
    pub file: Unfinished,
    /// It has its summary, so it can get its name.
    pub whole: bool,
    pub groups: Arc<Groups>,
    /// Arrivals in it that may not have reached the disk.
    pub kept: Vec<Arrival>,
}

impl ClosedLog {
    fn sync(&self) -> std::result::Result<(), String> {
        // The system reports each failure only once.
        match self.groups.refused() {
            Some(reason) => Err(reason.to_owned()),
            None => self.file.sync().map_err(|error| error.to_string()),
        }
    }
}

/// Arrivals of a closed log that did not reach the disk.
pub(crate) struct UnsyncedData {
    pub reason: String,
    pub arrivals: Vec<Arrival>,
}

/// Groups of raw data in a log.
#[derive(Default)]
pub(crate) struct Groups {
    /// Written to the operating system.
    pub written: AtomicU64,
    /// Those of them that have reached the disk.
    pub synced: AtomicU64,
    refused: OnceLock<String>,
}

impl Groups {
    /// The error of the last sync, if it failed.
    pub(crate) fn refused(&self) -> Option<&str> {
        self.refused.get().map(String::as_str)
    }

    pub(crate) fn refuse(&self, reason: String) {
        self.refused.get_or_init(|| reason);
    }
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
            tracing::error!("the thread that syncs the log has ended");
        }
    }

    /// Waits until all jobs so far are done.
    pub(crate) fn wait_for_jobs(&self) {
        let (done, wait) = channel();
        self.send(Job::Settle(done));
        // There is no answer if the thread has ended, which was reported.
        let _ = wait.recv();
    }

    /// Waits until everything is on the disk, and returns the files that could not be finished.
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
                closed.broken = false;
                watched = Some(log);
            }
            Ok(Job::Forget) => watched = None,
            Ok(Job::Leave(log, next)) => {
                // After a power cut, a later group must not be on the disk without an earlier one.
                let synced = closed.take(*log, shared);
                watched = next.filter(|next| synced && next.sync());
                closed.give_names();
                shared.synced();
                continue;
            }
            Ok(Job::Settle(done)) => {
                // The receiver may have stopped waiting.
                let _ = done.send(());
                continue;
            }
            Err(RecvTimeoutError::Timeout) => closed.give_names(),
            Err(RecvTimeoutError::Disconnected) => {
                closed.give_names();
                return closed.unfinished();
            }
        }
        watched = watched.filter(Watched::sync);
        shared.synced();
    }
}

/// Closed files that do not have their names yet.
#[derive(Default)]
struct Closed {
    /// On the disk; the rename is tried again.
    nameless: Vec<Unfinished>,
    /// Perhaps not on the disk; left to the next recovery.
    unsynced: Vec<PathBuf>,
    /// One did not reach the disk, so the arrivals of all later files are returned, too.
    broken: bool,
    last_failure: String,
}

impl Closed {
    /// Syncs a log. If the disk fails, returns its arrivals to the files of the run, and `false`.
    fn take(&mut self, log: ClosedLog, shared: &Shared) -> bool {
        let synced = if self.broken {
            Err("the log before it did not reach the disk".to_owned())
        } else {
            log.sync()
        };
        let Err(reason) = synced else {
            self.nameless.extend(log.whole.then_some(log.file));
            return true;
        };
        tracing::error!(reason, "a closed log did not reach the disk");
        self.broken = true;
        if log.whole {
            self.unsynced.push(log.file.active);
        }
        shared.return_unsynced(reason, log.kept);
        false
    }

    fn give_names(&mut self) {
        let last_failure = &mut self.last_failure;
        self.nameless.retain(|file| match file.give_name() {
            Ok(()) => false,
            // The files of the run handle deleted files.
            Err(_) if file.presence() == Presence::Deleted => false,
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
