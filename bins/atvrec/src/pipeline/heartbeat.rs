//! Heartbeats of the threads, from which the watchdog of the service manager is notified.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::Duration;

/// Period of the notifications to the service manager.
const PERIOD: Duration = Duration::from_millis(500);

/// Additional stop time that the service manager grants with each progress of the files.
const STOP_EXTENSION: Duration = Duration::from_secs(10);

/// Count of the steps of a thread. Ticks of the stream cause steps even if every device is silent.
#[derive(Debug, Default)]
pub struct Heartbeat(AtomicU64);

impl Heartbeat {
    /// Counts a step.
    pub fn beat(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

/// Heartbeats of all threads that must make progress. A thread that has ended normally has dropped
/// its heartbeat.
#[derive(Clone, Debug, Default)]
pub struct Heartbeats(Arc<Mutex<Vec<Named>>>);

type Named = (&'static str, Weak<Heartbeat>);

impl Heartbeats {
    /// Adds the heartbeat of a thread.
    pub fn add(&self, name: &'static str) -> Arc<Heartbeat> {
        let heartbeat = Arc::new(Heartbeat::default());
        self.lock().push((name, Arc::downgrade(&heartbeat)));
        heartbeat
    }

    /// Notifies the watchdog as long as every thread makes progress.
    pub async fn watch(self) {
        let mut interval = tokio::time::interval(PERIOD);
        let mut last = HashMap::new();
        loop {
            interval.tick().await;
            match self.stalled(&mut last) {
                None => notify(&[sd_notify::NotifyState::Watchdog]),
                Some(name) => tracing::debug!(name, "a thread makes no progress"),
            }
        }
    }

    /// Name of a thread without a step since the counts in `last`.
    fn stalled(&self, last: &mut HashMap<usize, u64>) -> Option<&'static str> {
        let mut stalled = None;
        self.lock().retain(|(name, heartbeat)| {
            let Some(heartbeat) = heartbeat.upgrade() else {
                return false;
            };
            let count = heartbeat.0.load(Ordering::Relaxed);
            if last.insert(Arc::as_ptr(&heartbeat) as usize, count) == Some(count) {
                stalled = Some(*name);
            }
            true
        });
        stalled
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Named>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Requests more stop time from the service manager as long as the files make progress.
pub async fn extend_stop(files: Vec<store::Progress>) {
    let mut interval = tokio::time::interval(PERIOD);
    let mut before = None;
    loop {
        interval.tick().await;
        let steps: u64 = files.iter().map(store::Progress::steps).sum();
        if before.replace(steps) != Some(steps) {
            let time = STOP_EXTENSION.as_micros();
            let time = u32::try_from(time).unwrap_or(u32::MAX);
            notify(&[sd_notify::NotifyState::ExtendTimeoutUsec(time)]);
        }
    }
}

/// Notifies the service manager, if there is one.
pub fn notify(states: &[sd_notify::NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(states) {
        tracing::debug!(%error, "cannot notify the service manager");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_stalled_thread_is_found() {
        let heartbeats = Heartbeats::default();
        let (first, second) = (heartbeats.add("first"), heartbeats.add("second"));
        let mut last = HashMap::new();
        assert_eq!(heartbeats.stalled(&mut last), None);
        first.beat();
        assert_eq!(heartbeats.stalled(&mut last), Some("second"));
        first.beat();
        second.beat();
        assert_eq!(heartbeats.stalled(&mut last), None);
        drop(second);
        first.beat();
        assert_eq!(heartbeats.stalled(&mut last), None);
    }
}
