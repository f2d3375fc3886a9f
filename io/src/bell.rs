//! A signal that ends the wait of a thread, for example for a queue.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// A signal that any thread may send, and for which one thread waits. A signal before the wait ends the next wait.
#[derive(Debug, Clone, Default)]
pub struct Bell(Arc<(Mutex<bool>, Condvar)>);

impl Bell {
    /// Ends the wait, or the next one.
    pub fn ring(&self) {
        *self.rung() = true;
        self.0.1.notify_one();
    }

    /// Waits until it is rung.
    pub fn wait(&self) {
        let waited = self.0.1.wait_while(self.rung(), |rung| !*rung);
        *waited.unwrap_or_else(PoisonError::into_inner) = false;
    }

    /// Waits until it is rung, no longer than `limit`.
    pub fn wait_for(&self, limit: Duration) {
        let waited = self.0.1.wait_timeout_while(self.rung(), limit, |rung| !*rung);
        *waited.unwrap_or_else(PoisonError::into_inner).0 = false;
    }

    fn rung(&self) -> MutexGuard<'_, bool> {
        self.0.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
