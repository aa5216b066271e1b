//! Values that the tests of a process share.

use std::collections::BTreeMap;
use std::sync::{Mutex, OnceLock, PoisonError};

/// Values by key. Each value is made once in a process, by the first test that needs it.
pub struct Once<K, V: 'static>(Mutex<BTreeMap<K, &'static OnceLock<V>>>);

impl<K: Ord, V> Once<K, V> {
    pub const fn new() -> Self {
        Self(Mutex::new(BTreeMap::new()))
    }

    /// The value of a key. While one test makes it, the others that need the same value wait, and
    /// those that need another do not.
    pub fn get_or_init(&self, key: K, make: impl FnOnce() -> V) -> &'static V {
        let cell: &'static OnceLock<V> = {
            let mut cells = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            cells
                .entry(key)
                .or_insert_with(|| Box::leak(Box::default()))
        };
        cell.get_or_init(make)
    }
}
