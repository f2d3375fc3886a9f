//! The latest value of a link that brings one after the other.

use core::time::Duration;

use ::tokio::sync::watch;

use super::Closed;
use crate::now;

/// The latest value of a link, while it may be used. Every clone waits for itself.
#[derive(Debug, Clone)]
pub struct Latest<T>(watch::Receiver<Option<(T, Duration)>>);

/// The sender of the values. When it is dropped, there is no value any more.
#[derive(Debug)]
pub struct Source<T>(watch::Sender<Option<(T, Duration)>>);

/// A value, which is none yet, and its source.
pub fn latest<T>() -> (Source<T>, Latest<T>) {
    let (source, latest) = watch::channel(None);
    (Source(source), Latest(latest))
}

impl<T> Source<T> {
    /// A new value, which may be used until then, with the clock of [`now`]; without a time until the next one.
    pub fn set(&self, value: T, until: Option<Duration>) {
        self.0.send_replace(Some((value, until.unwrap_or(Duration::MAX))));
    }

    /// There is no value that may be used.
    pub fn clear(&self) {
        self.0.send_if_modified(|value| value.take().is_some());
    }
}

impl<T> Drop for Source<T> {
    fn drop(&mut self) {
        self.clear();
    }
}

impl<T: Clone> Latest<T> {
    /// The latest value; `None` when there is none, or it is too old, even if the task of the link does nothing any more or has ended.
    pub fn get(&self) -> Option<T> {
        let value = self.0.borrow();
        value.as_ref().filter(|(_, until)| now() < *until).map(|(value, _)| value.clone())
    }

    /// Waits for the next value, or for its end: `None`. Of several the last. At the end of the task a value ends too.
    ///
    /// # Errors
    /// The task of the link has ended.
    pub async fn next(&mut self) -> Result<Option<T>, Closed> {
        self.0.changed().await.map_err(|_| Closed)?;
        Ok(self.0.borrow_and_update().as_ref().map(|(value, _)| value.clone()))
    }
}
