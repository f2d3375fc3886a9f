//! Events that wait for the caller.

/// The events of a session, oldest first, at most `N`.
///
/// An *outcome* is never dropped: a session begins only what it [has room](Self::has_room) to report. A *notice* takes the room
/// that outcomes leave; if there is none, the oldest notice is dropped and counted.
#[derive(Debug, Clone)]
pub struct EventQueue<E, const N: usize> {
    /// The first `len` are `Some`.
    slots: [Option<Slot<E>>; N],
    len: usize,
    /// How many of them are outcomes.
    outcomes: usize,
    dropped: u64,
}

#[derive(Debug, Clone)]
struct Slot<E> {
    event: E,
    is_notice: bool,
}

impl<E, const N: usize> EventQueue<E, N> {
    /// An empty queue.
    pub const fn new() -> Self {
        Self { slots: [const { None }; N], len: 0, outcomes: 0, dropped: 0 }
    }

    /// Adds an outcome. It may take the place of a notice.
    ///
    /// # Errors
    /// The queue is full of outcomes: `event` is returned.
    pub fn push_outcome(&mut self, event: E) -> Result<(), E> {
        if self.len == N && !self.drop_notice() {
            return Err(event);
        }
        self.append(event, false);
        Ok(())
    }

    /// Adds a notice; if the queue is full, the oldest notice is dropped, which may be this one.
    pub fn push_notice(&mut self, event: E) {
        if self.len == N && !self.drop_notice() {
            self.dropped = self.dropped.saturating_add(1);
            return;
        }
        self.append(event, true);
    }

    /// Whether so many outcomes can be added.
    pub const fn has_room(&self, outcomes: usize) -> bool {
        N - self.outcomes >= outcomes
    }

    /// The oldest event.
    pub fn pop(&mut self) -> Option<E> {
        self.remove(0)
    }

    /// No event waits.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The notices that were dropped since the queue was made.
    pub const fn dropped_notices(&self) -> u64 {
        self.dropped
    }

    fn append(&mut self, event: E, is_notice: bool) {
        if let Some(slot) = self.slots.get_mut(self.len) {
            *slot = Some(Slot { event, is_notice });
            self.len += 1;
            self.outcomes += usize::from(!is_notice);
        }
    }

    fn drop_notice(&mut self) -> bool {
        let oldest = self.slots.iter().position(|slot| slot.as_ref().is_some_and(|slot| slot.is_notice));
        let Some(oldest) = oldest else { return false };
        self.dropped = self.dropped.saturating_add(1);
        self.remove(oldest).is_some()
    }

    fn remove(&mut self, at: usize) -> Option<E> {
        let slot = self.slots.get_mut(at)?.take()?;
        self.slots.get_mut(at..self.len)?.rotate_left(1);
        self.len -= 1;
        self.outcomes -= usize::from(!slot.is_notice);
        Some(slot.event)
    }
}

impl<E, const N: usize> Default for EventQueue<E, N> {
    fn default() -> Self {
        Self::new()
    }
}
