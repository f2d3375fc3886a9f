//! A running device, called from other threads.

use core::fmt;
use core::time::Duration;
use std::collections::VecDeque;
use std::sync::mpsc::sync_channel;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::Simulator;
use crate::device::{Device, ExecutedWork};
use crate::faults::Faults;

/// The number of executed commands that are stored for [`Remote::executed`].
const STORED: usize = 10_000;

/// A device that another thread runs: its faults, calls that its thread executes, and the commands that it has executed.
///
/// [`Simulator::remote`] makes one. Clones reach the same device.
pub struct Remote<D: Device>(Arc<Inner<D>>);

struct Inner<D: Device> {
    faults: Faults,
    calls: Mutex<VecDeque<Slot<D>>>,
    executed: Mutex<ExecutedLog<D::Work>>,
}

/// An executed command, and its index among all that the device has executed.
pub type IndexedWork<W> = (u64, ExecutedWork<W>);

/// A call; `None` once it has begun, or its caller has given up.
type Slot<D> = Arc<Mutex<Option<Call<D>>>>;

type Call<D> = Box<dyn FnOnce(&mut Simulator<D>) + Send>;

struct ExecutedLog<W> {
    /// The number of all executed commands.
    total: u64,
    /// The last of them.
    last: VecDeque<ExecutedWork<W>>,
}

impl<D: Device> Remote<D> {
    pub(super) fn new(faults: Faults) -> Self {
        let executed = Mutex::new(ExecutedLog { total: 0, last: VecDeque::new() });
        Self(Arc::new(Inner { faults, calls: Mutex::default(), executed }))
    }

    /// Returns the faults of the device.
    pub fn faults(&self) -> &Faults {
        &self.0.faults
    }

    /// Calls `call` in the thread of the device, between two messages, and returns its result. Faults that were requested at
    /// once before have happened by then. `None` if the thread has not begun the call within this time: the call is
    /// withdrawn.
    pub fn call<R: Send + 'static>(
        &self,
        within: Duration,
        call: impl FnOnce(&mut Simulator<D>) -> R + Send + 'static,
    ) -> Option<R> {
        let (sender, result) = sync_channel(1);
        // The caller waits for the result, and is not gone.
        let call: Call<D> = Box::new(move |simulator| _ = sender.send(call(simulator)));
        let slot: Slot<D> = Arc::new(Mutex::new(Some(call)));
        lock(&self.0.calls).push_back(Arc::clone(&slot));
        result.recv_timeout(within).ok().or_else(|| match lock(&slot).take() {
            Some(_) => None,
            None => result.recv().ok(),
        })
    }

    /// Returns the number of commands that the device has executed, and up to `most` of the commands with their indices,
    /// from index `from` on. The last 10 000 are stored.
    pub fn executed(&self, from: u64, most: usize) -> (u64, Vec<IndexedWork<D::Work>>) {
        let stored = lock(&self.0.executed);
        let dropped = stored.total.saturating_sub(stored.last.len() as u64);
        let skipped = usize::try_from(from.saturating_sub(dropped)).unwrap_or(usize::MAX);
        let indexed = (dropped..).zip(stored.last.iter().cloned());
        (stored.total, indexed.skip(skipped).take(most).collect())
    }

    /// Stores executed commands.
    pub(super) fn store<'a>(&self, executed: impl Iterator<Item = &'a ExecutedWork<D::Work>>)
    where
        D::Work: 'a,
    {
        let mut stored = lock(&self.0.executed);
        for done in executed {
            stored.total += 1;
            if stored.last.len() >= STORED {
                stored.last.pop_front();
            }
            stored.last.push_back(done.clone());
        }
    }

    /// Removes and returns the next call.
    pub(super) fn next(&self) -> Option<Call<D>> {
        loop {
            let next = lock(&self.0.calls).pop_front();
            let call = lock(&*next?).take();
            if call.is_some() {
                return call;
            }
        }
    }
}

impl<D: Device> Clone for Remote<D> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<D: Device> fmt::Debug for Remote<D> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Remote").field("faults", &self.0.faults).finish_non_exhaustive()
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
