/// The hook that wakes a sleeping end: a function, such as one that unparks a thread or sets an event.
///
/// `wake` is called after the change that it reports. An end that looks once more after it was registered, and then
/// sleeps, misses nothing.
pub trait Wake {
    /// Wakes the other end's task. The reader is woken after each publication, each reset, and when the writer leaves; the
    /// writer after jobs were completed, also before their turn, or discarded, and when the reader leaves.
    fn wake(&self);
}

/// The end does not sleep.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoWake;

impl Wake for NoWake {
    #[inline(always)]
    fn wake(&self) {}
}

impl<F: Fn()> Wake for F {
    #[inline(always)]
    fn wake(&self) {
        self();
    }
}
