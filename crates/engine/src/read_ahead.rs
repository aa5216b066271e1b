//! Reads a log on a separate thread, in parallel with the decoding and estimating of a replay.

use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;

use sample::Arrival;
use store::{ArrivalIter, Missing};

/// Arrivals per batch.
const BATCH: usize = 1024;
/// Most batches that are read ahead.
const BATCHES: usize = 8;

/// The arrivals of a log, in order, in batches.
pub struct ReadAhead {
    batches: Receiver<store::Result<Vec<Arrival>>>,
    reading: JoinHandle<Vec<Missing>>,
}

impl ReadAhead {
    /// Starts the thread.
    pub fn start(mut arrivals: ArrivalIter) -> Self {
        let (sender, batches) = sync_channel(BATCHES);
        let reading = std::thread::spawn(move || {
            loop {
                let batch: store::Result<Vec<Arrival>> = arrivals.by_ref().take(BATCH).collect();
                let last = batch.as_ref().is_ok_and(Vec::is_empty) || batch.is_err();
                if sender.send(batch).is_err() || last {
                    return arrivals.missing();
                }
            }
        });
        Self { batches, reading }
    }

    /// The next batch; `None` at the end, and after an error.
    pub fn next(&self) -> Option<store::Result<Vec<Arrival>>> {
        self.batches.recv().ok()
    }

    /// Losses and faults of the log.
    pub fn missing(self) -> Vec<Missing> {
        drop(self.batches);
        self.reading.join().unwrap_or_default()
    }
}
