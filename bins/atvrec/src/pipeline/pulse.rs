//! What the service manager's watchdog is fed with: the progress of the threads themselves.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::Duration;

/// The service manager hears of progress this often.
const PERIOD: Duration = Duration::from_millis(500);

/// With each progress of the files the service manager waits this much longer for the end.
const STOP_EXTENSION: Duration = Duration::from_secs(10);

/// Steps that a thread has done. Ticks give it some even if every device is silent.
#[derive(Debug, Default)]
pub struct Pulse(AtomicU64);

impl Pulse {
    /// Another step is done.
    pub fn beat(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

/// All threads that must go on. One that ended in good order has dropped its pulse.
#[derive(Clone, Debug, Default)]
pub struct Pulses(Arc<Mutex<Vec<Named>>>);

type Named = (&'static str, Weak<Pulse>);

impl Pulses {
    /// The pulse of a further thread.
    pub fn add(&self, name: &'static str) -> Arc<Pulse> {
        let pulse = Arc::new(Pulse::default());
        self.lock().push((name, Arc::downgrade(&pulse)));
        pulse
    }

    /// Tells the service manager that all is well as long as every thread goes on.
    pub async fn watch(self) {
        let mut interval = tokio::time::interval(PERIOD);
        let mut last = HashMap::new();
        loop {
            interval.tick().await;
            match self.standing(&mut last) {
                None => notify(&[sd_notify::NotifyState::Watchdog]),
                Some(name) => tracing::debug!(name, "no progress"),
            }
        }
    }

    /// A thread that has done nothing since `last`, if there is one.
    fn standing(&self, last: &mut HashMap<usize, u64>) -> Option<&'static str> {
        let mut standing = None;
        self.lock().retain(|(name, pulse)| {
            let Some(pulse) = pulse.upgrade() else {
                return false;
            };
            let count = pulse.0.load(Ordering::Relaxed);
            if last.insert(Arc::as_ptr(&pulse) as usize, count) == Some(count) {
                standing = Some(*name);
            }
            true
        });
        standing
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Named>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Asks the service manager for more time to stop, as long as the files make progress.
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

/// Tells the service manager, if there is one.
pub fn notify(states: &[sd_notify::NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(states) {
        tracing::debug!(%error, "the service manager was not told");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_thread_that_stands_still_is_enough() {
        let pulses = Pulses::default();
        let (first, second) = (pulses.add("first"), pulses.add("second"));
        let mut last = HashMap::new();
        assert_eq!(pulses.standing(&mut last), None);
        first.beat();
        assert_eq!(pulses.standing(&mut last), Some("second"));
        first.beat();
        second.beat();
        assert_eq!(pulses.standing(&mut last), None);
        drop(second);
        first.beat();
        assert_eq!(pulses.standing(&mut last), None);
    }
}
