//! Reads a log on a separate thread, in parallel with the decoding and estimating of a replay.

use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;

/// Items per batch.
const BATCH: usize = 1024;
/// Most batches that are read ahead.
const BATCHES: usize = 8;

/// Items of a log, in order, in batches, and a result after the last.
pub struct ReadAhead<T, R> {
    batches: Receiver<store::Result<Vec<T>>>,
    reading: JoinHandle<R>,
}

impl<T: Send + 'static, R: Send + 'static> ReadAhead<T, R> {
    /// Starts the thread. `end` makes the result.
    pub fn start<I: Iterator<Item = store::Result<T>> + Send + 'static>(
        mut items: I,
        end: impl FnOnce(I) -> R + Send + 'static,
    ) -> Self {
        let (sender, batches) = sync_channel(BATCHES);
        let reading = std::thread::spawn(move || {
            loop {
                let batch: store::Result<Vec<T>> = items.by_ref().take(BATCH).collect();
                let last = batch.as_ref().is_ok_and(Vec::is_empty) || batch.is_err();
                if sender.send(batch).is_err() || last {
                    return end(items);
                }
            }
        });
        Self { batches, reading }
    }

    /// The next batch; `None` at the end, and after an error.
    pub fn next(&self) -> Option<store::Result<Vec<T>>> {
        self.batches.recv().ok()
    }

    /// The result.
    pub fn finish(self) -> R
    where
        R: Default,
    {
        drop(self.batches);
        self.reading.join().unwrap_or_default()
    }
}
