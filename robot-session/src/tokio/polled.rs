//! The inputs that a task polls, each with a waker of its own.

use core::sync::atomic::{AtomicBool, Ordering};
use core::task::{Context, Waker};
use std::sync::Arc;
use std::task::Wake;

/// An input of a task. After it was pending it is polled again only when it has woken the task.
#[derive(Debug)]
pub(super) struct PolledInput {
    flag: Arc<Flag>,
    waker: Waker,
    is_pending: bool,
}

/// Wakes the task, and records which input has woken it.
#[derive(Debug)]
struct Flag {
    is_woken: AtomicBool,
    task: Waker,
}

impl Wake for Flag {
    fn wake(self: Arc<Self>) {
        self.wake_by_ref();
    }

    fn wake_by_ref(self: &Arc<Self>) {
        self.is_woken.store(true, Ordering::Release);
        self.task.wake_by_ref();
    }
}

impl PolledInput {
    /// Creates an input that is due, and wakes the task of `context`.
    pub(super) fn new(context: &Context<'_>) -> Self {
        let flag = Arc::new(Flag { is_woken: AtomicBool::new(false), task: context.waker().clone() });
        let waker = Waker::from(Arc::clone(&flag));
        Self { flag, waker, is_pending: false }
    }

    /// Returns whether it wakes the task of `context`.
    pub(super) fn wakes(&self, context: &Context<'_>) -> bool {
        self.flag.task.will_wake(context.waker())
    }

    /// Returns whether it is to be polled.
    #[inline]
    pub(super) fn is_due(&mut self) -> bool {
        let is_woken = &self.flag.is_woken;
        if is_woken.load(Ordering::Acquire) && is_woken.swap(false, Ordering::AcqRel) {
            self.is_pending = false;
        }
        !self.is_pending
    }

    /// Returns the context with which the input is polled.
    pub(super) fn context(&self) -> Context<'_> {
        Context::from_waker(&self.waker)
    }

    /// Wakes the task, as the input does.
    pub(super) fn wake(&self) {
        self.flag.wake_by_ref();
    }

    /// Records that it was pending when it was polled.
    pub(super) const fn set_pending(&mut self) {
        self.is_pending = true;
    }
}
