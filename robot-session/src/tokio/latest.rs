//! The latest value of a link that sends one value after the other.

use core::time::Duration;

use ::tokio::sync::watch;

use super::Closed;
use crate::now;

/// The latest value of a link, while it may be used. Each clone waits independently.
#[derive(Debug, Clone)]
pub struct Latest<T>(watch::Receiver<Option<(T, Duration)>>);

/// The sender of the values. After the sender is dropped, there is no value.
#[derive(Debug)]
pub struct LatestSender<T>(watch::Sender<Option<(T, Duration)>>);

/// Returns the sender and the receiver of a value, which is absent at first.
pub fn latest<T>() -> (LatestSender<T>, Latest<T>) {
    let (source, latest) = watch::channel(None);
    (LatestSender(source), Latest(latest))
}

impl<T> LatestSender<T> {
    /// Sets a new value. It may be used until `until`, by the clock of [`now`]; with `None`, until the next value.
    pub fn set(&self, value: T, until: Option<Duration>) {
        self.0.send_replace(Some((value, until.unwrap_or(Duration::MAX))));
    }

    /// Removes the value.
    pub fn clear(&self) {
        self.0.send_if_modified(|value| value.take().is_some());
    }
}

impl<T> Drop for LatestSender<T> {
    fn drop(&mut self) {
        self.clear();
    }
}

impl<T: Clone> Latest<T> {
    /// Returns the latest value; `None` if there is none or it is too old, even if the task of the link is stuck or has
    /// ended.
    pub fn get(&self) -> Option<T> {
        let value = self.0.borrow();
        value.as_ref().filter(|(_, until)| now() < *until).map(|(value, _)| value.clone())
    }

    /// Waits for the next value, or for the end of the value: `None`. Of several values, returns the last. A value also ends
    /// with the task.
    ///
    /// # Errors
    /// The task of the link has ended.
    pub async fn next(&mut self) -> Result<Option<T>, Closed> {
        self.0.changed().await.map_err(|_| Closed)?;
        Ok(self.0.borrow_and_update().as_ref().map(|(value, _)| value.clone()))
    }
}
