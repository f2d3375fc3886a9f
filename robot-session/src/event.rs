//! Events that wait for the caller.

/// The events of a session, oldest first, at most `N`.
///
/// An *outcome* is never dropped: a session begins only what it [has room](Self::has_room) to report. A *notice* takes the room
/// that outcomes leave; if there is none, the oldest notice is dropped and counted.
#[derive(Debug, Clone)]
pub struct EventQueue<E, const N: usize> {
    /// A ring: `len` slots from `first` on are `Some`.
    slots: [Option<Slot<E>>; N],
    first: usize,
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
        Self { slots: [const { None }; N], first: 0, len: 0, outcomes: 0, dropped: 0 }
    }

    /// Adds an outcome. It may take the place of a notice.
    ///
    /// # Errors
    /// The queue is full of outcomes: `event` is returned.
    #[inline]
    pub fn push_outcome(&mut self, event: E) -> Result<(), E> {
        if self.len == N && !self.drop_notice() {
            return Err(event);
        }
        self.append(event, false);
        Ok(())
    }

    /// Adds a notice; if the queue is full, the oldest notice is dropped, which may be this one.
    #[inline]
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
    #[inline]
    pub fn pop(&mut self) -> Option<E> {
        if self.len == 0 {
            return None;
        }
        let slot = self.slots.get_mut(self.first)?.take()?;
        self.first = Self::wrap(self.first + 1);
        self.len -= 1;
        self.outcomes -= usize::from(!slot.is_notice);
        Some(slot.event)
    }

    /// No event waits.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The notices that were dropped since the queue was made.
    pub const fn dropped_notices(&self) -> u64 {
        self.dropped
    }

    #[inline]
    fn append(&mut self, event: E, is_notice: bool) {
        if let Some(slot) = self.slots.get_mut(Self::wrap(self.first + self.len)) {
            *slot = Some(Slot { event, is_notice });
            self.len += 1;
            self.outcomes += usize::from(!is_notice);
        }
    }

    #[cold]
    fn drop_notice(&mut self) -> bool {
        let is_notice = |at: &usize| matches!(self.slots.get(*at), Some(Some(slot)) if slot.is_notice);
        let Some(oldest) = (0..self.len).find(|index| is_notice(&Self::wrap(self.first + index))) else {
            return false;
        };
        // It goes to the front, and the outcomes before it stay in their order.
        for index in (0..oldest).rev() {
            self.slots.swap(Self::wrap(self.first + index), Self::wrap(self.first + index + 1));
        }
        self.dropped = self.dropped.saturating_add(1);
        self.pop().is_some()
    }

    /// The slot of an index below `2 * N`.
    const fn wrap(index: usize) -> usize {
        if index < N { index } else { index - N }
    }
}

impl<E, const N: usize> Default for EventQueue<E, N> {
    fn default() -> Self {
        Self::new()
    }
}
