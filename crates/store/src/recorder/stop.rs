//! The end of a run within a bounded time, also if the disk does not respond.

use std::path::PathBuf;
use std::sync::PoisonError;
use std::sync::mpsc::{RecvTimeoutError, TrySendError, sync_channel};
use std::time::{Duration, Instant};

use super::{Command, DiskState, Recorder, RecorderSummary, losses_file};
use crate::file::active_path;
use crate::{Error, Result, Session};

/// Interval between two attempts to enqueue a command in a full queue.
const QUEUE_PAUSE: Duration = Duration::from_millis(5);
/// Largest part of the time to stop that is reserved for the file that states the losses.
const RESERVE: Duration = Duration::from_secs(1);

/// The instant `within` from now.
pub(super) fn deadline(within: Duration) -> Instant {
    Instant::now() + within
}

fn left(until: Instant) -> Duration {
    until.saturating_duration_since(Instant::now())
}

impl Recorder {
    /// Ends the run until `deadline`; `None` if it has ended before.
    pub(super) fn stop(&mut self, deadline: Instant) -> Option<Result<RecorderSummary>> {
        let ended = self.ended.take()?;
        let ended = ended.into_inner().unwrap_or_else(PoisonError::into_inner);
        let reserve = RESERVE.min(left(deadline) / 4);
        let give_up_at = deadline.checked_sub(reserve).unwrap_or(deadline);
        let mut finish = Command::Finish;
        loop {
            match self.commands.try_send(finish) {
                Err(TrySendError::Full(again)) if !left(give_up_at).is_zero() => {
                    finish = again;
                    std::thread::sleep(QUEUE_PAUSE);
                }
                _ => break,
            }
        }
        match ended.recv_timeout(left(give_up_at)) {
            Ok(summary) => return Some(Ok(summary)),
            Err(RecvTimeoutError::Disconnected) => return Some(Err(Error::WriterGone)),
            Err(RecvTimeoutError::Timeout) => {}
        }
        let lost = self.shared.give_up();
        let mut summary = self.shared.summary();
        if let DiskState::Writing(path) = self.shared.state() {
            summary.unfinished.push(active_path(&path));
        }
        let reason = format!(
            "the disk did not take {} arrivals and {} records before the time to stop was over",
            lost.arrivals, lost.records
        );
        tracing::error!(
            arrivals = lost.arrivals,
            records = lost.records,
            "the disk was too slow: the files were not closed within the time to stop \
             (storage.stop_within_s), and what was not written is lost"
        );
        summary.losses = self.shared.ledger.losses();
        summary.cut_off = Some(reason.clone());
        let beside = summary.unfinished.last().cloned();
        let beside = beside.or_else(|| summary.files.last().map(|file| file.path.clone()));
        self.state_beside(beside, &reason, deadline);
        Some(Ok(summary))
    }

    /// Writes the losses that no log states to a file beside `log`. A thread of its own does this,
    /// because the disk may not respond.
    fn state_beside(&self, log: Option<PathBuf>, reason: &str, deadline: Instant) {
        let losses = self.shared.ledger.losses().since(&self.shared.stated());
        let Some(log) = log.filter(|_| !losses.is_empty()) else {
            return;
        };
        let (done, wait) = sync_channel(1);
        let (session, reason, path): (Session, _, _) =
            (self.session.clone(), reason.to_owned(), log.clone());
        let thread = std::thread::Builder::new().name("store-losses".to_owned());
        let started = thread.spawn(move || {
            // The receiver may have stopped waiting.
            let _ = done.send(losses_file::write(&path, &session, &losses, &reason));
        });
        let written = started.is_ok().then(|| wait.recv_timeout(left(deadline)));
        match written {
            Some(Ok(Ok(()))) => {}
            Some(Ok(Err(error))) => {
                tracing::error!(%error, "cannot write the file with the losses")
            }
            _ => tracing::error!(
                log = %log.display(),
                "cannot write the file with the losses: the disk does not respond"
            ),
        }
    }
}
