//! The place of a task's connection while the task sleeps.

use core::task::{Context, Waker};
use std::boxed::Box;
use std::sync::{Mutex, MutexGuard, PoisonError};

use ::tokio::sync::mpsc;

use super::Service;
use super::connection::Connection;

/// Contains the connection of a task while the task sleeps: a caller then makes its call and sends the bytes itself.
pub(super) struct Slot<S: Service>(Mutex<Contents<S>>);

struct Contents<S: Service> {
    connection: Option<Box<Connection<S>>>,
    /// The task, if it was woken while a caller had the connection.
    task: Option<Waker>,
    /// Whether the task serves a connection. If not, a connection that a caller returns is dropped.
    is_open: bool,
}

impl<S: Service> Default for Slot<S> {
    fn default() -> Self {
        Self(Mutex::new(Contents { connection: None, task: None, is_open: false }))
    }
}

impl<S: Service> Slot<S> {
    /// Lends the connection to a caller, unless other calls wait in the channel.
    pub(super) fn borrow(&self, calls: &mpsc::Sender<S::Call>) -> Option<Borrowed<'_, S>> {
        if calls.capacity() < calls.max_capacity() {
            return None;
        }
        let connection = self.contents().connection.take()?;
        Some(Borrowed { slot: self, connection: Some(connection) })
    }

    /// Returns the connection to its task. If a caller has it, the task is woken when the caller returns it.
    pub(super) fn take(&self, context: &Context<'_>) -> Option<Box<Connection<S>>> {
        let mut contents = self.contents();
        let connection = contents.connection.take();
        if connection.is_none() {
            contents.task = Some(context.waker().clone());
        }
        connection
    }

    /// Puts the connection back.
    pub(super) fn put(&self, connection: Box<Connection<S>>) {
        let mut contents = self.contents();
        if !contents.is_open {
            drop(contents);
            drop(connection);
            return;
        }
        contents.connection = Some(connection);
        if let Some(task) = contents.task.take() {
            drop(contents);
            task.wake();
        }
    }

    /// Opens the slot for a connection, until the value that is returned is dropped.
    pub(super) fn open(&self) -> Open<'_, S> {
        self.contents().is_open = true;
        Open(self)
    }

    fn contents(&self) -> MutexGuard<'_, Contents<S>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A connection that a caller has. It returns to the slot even if the caller panics.
pub(super) struct Borrowed<'a, S: Service> {
    slot: &'a Slot<S>,
    connection: Option<Box<Connection<S>>>,
}

impl<S: Service> Borrowed<'_, S> {
    /// [`Connection::call`].
    pub(super) fn call(&mut self, call: S::Call) -> Result<(), S::Call> {
        match &mut self.connection {
            Some(connection) => connection.call(call),
            None => Err(call),
        }
    }
}

impl<S: Service> Drop for Borrowed<'_, S> {
    fn drop(&mut self) {
        if let Some(connection) = self.connection.take() {
            self.slot.put(connection);
        }
    }
}

/// An open slot. When the task stops serving the connection, even if its future is dropped, the connection is dropped too.
pub(super) struct Open<'a, S: Service>(&'a Slot<S>);

impl<S: Service> Drop for Open<'_, S> {
    fn drop(&mut self) {
        let mut contents = self.0.contents();
        contents.is_open = false;
        let connection = contents.connection.take();
        drop(contents);
        drop(connection);
    }
}
