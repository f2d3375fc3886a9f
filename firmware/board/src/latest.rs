//! The newest of something, between the main loop and the session.

use core::cell::Cell;

use critical_section::Mutex;

use crate::session;

/// The newest value of something, from the main loop to the session or back.
pub struct Latest<T>(Mutex<Cell<Option<T>>>);

impl<T> Latest<T> {
    /// Creates an empty slot.
    pub const fn new() -> Self {
        Self(Mutex::new(Cell::new(None)))
    }

    /// Replaces the previous value, and triggers the session.
    pub fn set(&self, value: T) {
        critical_section::with(|cs| self.0.borrow(cs).set(Some(value)));
        session::wake();
    }

    /// Removes and returns the newest value.
    pub fn take(&self) -> Option<T> {
        critical_section::with(|cs| self.0.borrow(cs).take())
    }
}

impl<T> Default for Latest<T> {
    fn default() -> Self {
        Self::new()
    }
}
