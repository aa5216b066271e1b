//! The thread that takes commands from the queue.

use std::sync::mpsc::{Receiver, RecvTimeoutError};

use super::files::Files;
use super::{Command, RecorderSummary, Shared};

/// Passes the commands of the queue to the files of the run until the end.
pub(super) fn run(mut files: Files, queue: &Receiver<Command>, shared: &Shared) -> RecorderSummary {
    loop {
        match queue.recv_timeout(files.patience()) {
            Ok(Command::Arrivals(arrivals)) => {
                for arrival in arrivals {
                    shared.taken();
                    files.arrival(arrival);
                    if shared.has_given_up() {
                        return files.leave();
                    }
                }
            }
            Ok(Command::Records(records)) => {
                for record in records {
                    shared.taken();
                    files.record(&record);
                }
            }
            Ok(Command::Rotate) => {}
            Err(RecvTimeoutError::Timeout) => files.idle(),
            Ok(Command::Finish) | Err(RecvTimeoutError::Disconnected) => break,
        }
        files.write_journal();
        files.look_after_disk();
        if shared.has_given_up() {
            return files.leave();
        }
    }
    files.finish()
}
