//! The queue of events that the caller has not polled yet.

/// The events of a session, oldest first, at most `N`.
///
/// An *outcome* is never dropped: a session begins a step only if it [has room](Self::has_room) to report its outcomes. A
/// *notice* uses the entries that outcomes leave free; if all are used, the oldest notice is dropped and counted.
#[derive(Debug, Clone)]
pub struct EventQueue<E, const N: usize> {
    /// A ring: `len` slots from `first` on are `Some`.
    slots: [Option<E>; N],
    /// Whether each slot has a notice: apart from the slots, so that each takes a byte.
    notices: [bool; N],
    first: usize,
    len: usize,
    /// The number of events that are outcomes.
    outcomes: usize,
    dropped: u64,
}

impl<E, const N: usize> EventQueue<E, N> {
    /// Creates an empty queue.
    pub const fn new() -> Self {
        Self { slots: [const { None }; N], notices: [false; N], first: 0, len: 0, outcomes: 0, dropped: 0 }
    }

    /// Adds an outcome. It may replace a notice.
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

    /// Returns whether this number of outcomes can be added.
    pub const fn has_room(&self, outcomes: usize) -> bool {
        N - self.outcomes >= outcomes
    }

    /// Removes and returns the oldest event.
    #[inline]
    pub fn pop(&mut self) -> Option<E> {
        if self.len == 0 {
            return None;
        }
        let event = self.slots.get_mut(self.first)?.take();
        self.outcomes -= usize::from(!self.is_notice(self.first));
        self.first = Self::wrap(self.first + 1);
        self.len -= 1;
        event
    }

    /// Returns whether the queue is empty.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns the number of notices dropped since the queue was created.
    pub const fn dropped_notices(&self) -> u64 {
        self.dropped
    }

    #[inline]
    fn append(&mut self, event: E, is_notice: bool) {
        let at = Self::wrap(self.first + self.len);
        if let (Some(slot), Some(notice)) = (self.slots.get_mut(at), self.notices.get_mut(at)) {
            (*slot, *notice) = (Some(event), is_notice);
            self.len += 1;
            self.outcomes += usize::from(!is_notice);
        }
    }

    #[cold]
    fn drop_notice(&mut self) -> bool {
        let is_notice = |index: &usize| self.is_notice(Self::wrap(self.first + index));
        let Some(oldest) = (0..self.len).find(is_notice) else { return false };
        // The outcome goes to the front, and the outcomes before it stay in their order.
        for index in (0..oldest).rev() {
            let (at, after) = (Self::wrap(self.first + index), Self::wrap(self.first + index + 1));
            self.slots.swap(at, after);
            self.notices.swap(at, after);
        }
        self.dropped = self.dropped.saturating_add(1);
        self.pop().is_some()
    }

    fn is_notice(&self, at: usize) -> bool {
        self.notices.get(at).is_some_and(|is_notice| *is_notice)
    }

    /// Returns the slot of an index below `2 * N`.
    const fn wrap(index: usize) -> usize {
        if index < N { index } else { index - N }
    }
}

impl<E, const N: usize> Default for EventQueue<E, N> {
    fn default() -> Self {
        Self::new()
    }
}

/// An [`EventQueue`] of any length.
pub trait Events: Default {
    /// The event type of the queue.
    type Event: core::fmt::Debug;

    /// Implements [`EventQueue::push_outcome`].
    ///
    /// # Errors
    /// The queue is full of outcomes: `event` is returned.
    fn push_outcome(&mut self, event: Self::Event) -> Result<(), Self::Event>;

    /// Implements [`EventQueue::push_notice`].
    fn push_notice(&mut self, event: Self::Event);

    /// Implements [`EventQueue::has_room`].
    fn has_room(&self, outcomes: usize) -> bool;

    /// Implements [`EventQueue::pop`].
    fn pop(&mut self) -> Option<Self::Event>;

    /// Implements [`EventQueue::dropped_notices`].
    fn dropped_notices(&self) -> u64;
}

impl<E: core::fmt::Debug, const N: usize> Events for EventQueue<E, N> {
    type Event = E;

    #[inline]
    fn push_outcome(&mut self, event: E) -> Result<(), E> {
        Self::push_outcome(self, event)
    }

    #[inline]
    fn push_notice(&mut self, event: E) {
        Self::push_notice(self, event);
    }

    #[inline]
    fn has_room(&self, outcomes: usize) -> bool {
        Self::has_room(self, outcomes)
    }

    #[inline]
    fn pop(&mut self) -> Option<E> {
        Self::pop(self)
    }

    fn dropped_notices(&self) -> u64 {
        Self::dropped_notices(self)
    }
}
