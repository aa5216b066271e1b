//! Work on a separate thread, in the order in which it is handed over.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

/// Items per batch.
const BATCH: usize = 512;
/// Most batches that wait.
const BATCHES: usize = 8;

/// A thread that takes items in batches. It may end early, after an error that is its result.
pub struct Behind<T, R> {
    /// `None` after the end.
    running: Option<Running<T, R>>,
    batch: Vec<T>,
}

struct Running<T, R> {
    sender: SyncSender<Vec<T>>,
    thread: JoinHandle<R>,
}

impl<T: Send + 'static, R: Send + 'static> Behind<T, R> {
    /// Starts the thread.
    pub fn start(work: impl FnOnce(Receiver<Vec<T>>) -> R + Send + 'static) -> Self {
        let (sender, receiver) = sync_channel(BATCHES);
        Self {
            running: Some(Running {
                sender,
                thread: std::thread::spawn(move || work(receiver)),
            }),
            batch: Vec::with_capacity(BATCH),
        }
    }

    /// Hands an item over; `false` if the thread has ended.
    pub fn push(&mut self, item: T) -> bool {
        self.batch.push(item);
        self.batch.len() < BATCH || self.send()
    }

    fn send(&mut self) -> bool {
        let batch = std::mem::replace(&mut self.batch, Vec::with_capacity(BATCH));
        let running = self.running.as_ref();
        running.is_some_and(|running| running.sender.send(batch).is_ok())
    }

    /// Hands over what waits and returns the result of the thread; `None` after the first call.
    pub fn finish(&mut self) -> Option<R> {
        if !self.batch.is_empty() {
            // If the thread has ended, its result says why.
            self.send();
        }
        let running = self.running.take()?;
        drop(running.sender);
        match running.thread.join() {
            Ok(result) => Some(result),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }
}

impl<T, R> Drop for Behind<T, R> {
    fn drop(&mut self) {
        if let Some(running) = self.running.take() {
            drop(running.sender);
            // A panic of the thread was reported when it occurred.
            let _ = running.thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_items_arrive_in_their_order() {
        let mut behind = Behind::start(|batches| batches.into_iter().flatten().collect());
        for number in 0..10_000 {
            assert!(behind.push(number));
        }
        let all: Option<Vec<i32>> = behind.finish();
        assert!(all.is_some_and(|all| all.into_iter().eq(0..10_000)));
        assert!(behind.finish().is_none());
    }

    #[test]
    fn a_thread_that_ends_early_takes_nothing_more() {
        let mut behind = Behind::start(|batches: Receiver<Vec<usize>>| batches.recv().is_ok());
        let taken = (0..BATCH * (BATCHES + 3)).take_while(|n| behind.push(*n));
        assert!(taken.count() < BATCH * (BATCHES + 3));
        assert_eq!(behind.finish(), Some(true));
    }
}
