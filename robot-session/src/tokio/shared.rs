//! The state that the handles and their task share.

use core::sync::atomic::{AtomicBool, Ordering};
use core::task::{Context, Waker};
use std::boxed::Box;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use ::tokio::runtime;
use ::tokio::sync::{mpsc, watch};
use ::tokio::task::try_id;

use super::connection::Connection;
use super::service::Service;

/// The state that the handles and their task share.
///
/// While the task sleeps, its connection is here: a caller then makes its call and sends the bytes itself.
pub(super) struct Shared<S: Service> {
    contents: Mutex<SharedState<S>>,
    /// Whether new calls are refused: the task is to end.
    is_ending: AtomicBool,
    /// Each [`Reply`](super::Reply) owns a clone.
    in_progress: Arc<()>,
    /// The runtime of the task. A caller without a runtime enters it for the work that it does in place of the task.
    runtime: OnceLock<runtime::Handle>,
}

struct SharedState<S: Service> {
    /// The task's ends of its channels, until it runs.
    unrun: Option<TaskChannels<S>>,
    connection: Option<Box<Connection<S>>>,
    /// The task, if it was woken while a caller had the connection.
    task: Option<Waker>,
    /// Whether the task serves a connection. If not, a connection that a caller returns is dropped.
    is_open: bool,
    /// The reason for which a caller gives the connection up.
    unusable: Option<io::Error>,
}

/// The task's ends of the channels to the handles. If they are dropped, all calls in the channel end.
pub(super) struct TaskChannels<S: Service> {
    pub(super) calls: mpsc::Receiver<S::Call>,
    pub(super) link: LinkState,
}

/// The state of a [`Handle`](super::Handle)'s connection.
#[derive(Debug, Clone, Default)]
pub enum Link {
    /// The first connection is being made.
    #[default]
    Connecting,
    /// There is a connection. It does not show that the device runs: only the first reply of the device does.
    Connected,
    /// The last attempt has failed, or the last connection is lost, for this reason. Another attempt follows.
    Failed(Arc<io::Error>),
    /// The task has ended, and no connection follows: it was shut down, its future was dropped, or it has panicked.
    Ended,
}

/// The state of the connection, as the handles see it. When it is dropped, the task has ended.
pub(super) struct LinkState(watch::Sender<Link>);

impl LinkState {
    pub(super) fn new() -> (Self, watch::Receiver<Link>) {
        let (sender, receiver) = watch::channel(Link::Connecting);
        (Self(sender), receiver)
    }

    pub(super) fn set(&self, link: Link) {
        self.0.send_replace(link);
    }
}

impl Drop for LinkState {
    fn drop(&mut self) {
        self.set(Link::Ended);
    }
}

impl<S: Service> Shared<S> {
    /// Returns the state of a task that does not run yet.
    pub(super) fn new(unrun: TaskChannels<S>) -> Self {
        let contents =
            SharedState { unrun: Some(unrun), connection: None, task: None, is_open: false, unusable: None };
        Self {
            contents: Mutex::new(contents),
            is_ending: AtomicBool::new(false),
            in_progress: Arc::new(()),
            runtime: OnceLock::new(),
        }
    }

    /// Removes and returns the task's ends of its channels, if it does not run yet.
    pub(super) fn take_unrun(&self) -> Option<TaskChannels<S>> {
        self.contents().unrun.take()
    }

    /// Returns the owner of a reply: until it is dropped, a call is in progress.
    pub(super) fn begin_call(&self) -> Arc<()> {
        Arc::clone(&self.in_progress)
    }

    /// Refuses all calls from now on.
    pub(super) fn end(&self) {
        self.is_ending.store(true, Ordering::Release);
    }

    /// Returns whether new calls are refused.
    pub(super) fn is_ending(&self) -> bool {
        self.is_ending.load(Ordering::Acquire)
    }

    /// Returns whether new calls are refused, and all others have ended.
    pub(super) fn is_finished(&self) -> bool {
        self.is_ending() && Arc::strong_count(&self.in_progress) == 1
    }

    /// Gives up the connection that the task serves, if it serves one.
    pub(super) fn give_up(&self, why: io::Error) {
        let mut contents = self.contents();
        if contents.is_open {
            contents.unusable.get_or_insert(why);
        }
    }

    /// Lends the connection to a caller, unless other calls wait in the channel.
    pub(super) fn borrow(&self, calls: &mpsc::Sender<S::Call>) -> Option<BorrowedConnection<'_, S>> {
        if calls.capacity() < calls.max_capacity() {
            return None;
        }
        let connection = self.contents().connection.take()?;
        Some(BorrowedConnection { shared: self, connection: Some(connection) })
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

    /// Removes and returns the reason for which a caller has given the connection up.
    pub(super) fn take_unusable(&self) -> Option<io::Error> {
        self.contents().unusable.take()
    }

    /// Opens the place of the connection, until the value that is returned is dropped.
    pub(super) fn open(&self) -> OpenGuard<'_, S> {
        self.runtime.get_or_init(runtime::Handle::current);
        self.contents().is_open = true;
        OpenGuard(self)
    }

    fn contents(&self) -> MutexGuard<'_, SharedState<S>> {
        self.contents.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A connection that a caller has. It is put back even if the caller panics.
pub(super) struct BorrowedConnection<'a, S: Service> {
    shared: &'a Shared<S>,
    connection: Option<Box<Connection<S>>>,
}

impl<S: Service> BorrowedConnection<'_, S> {
    /// Implements [`Connection::call`].
    pub(super) fn call(&mut self, call: S::Call) -> Result<(), S::Call> {
        let Some(connection) = &mut self.connection else { return Err(call) };
        // Checking whether the caller is a task costs nothing; entering a runtime costs as much as the rest of this.
        let entered = self.shared.runtime.get().filter(|_| try_id().is_none());
        let _entered = entered.map(runtime::Handle::enter);
        connection.call(call)
    }
}

impl<S: Service> Drop for BorrowedConnection<'_, S> {
    fn drop(&mut self) {
        if let Some(connection) = self.connection.take() {
            self.shared.put(connection);
        }
    }
}

/// The place of a connection that the task serves. When the task stops serving the connection, even if its future is
/// dropped, the connection is dropped too.
pub(super) struct OpenGuard<'a, S: Service>(&'a Shared<S>);

impl<S: Service> Drop for OpenGuard<'_, S> {
    fn drop(&mut self) {
        let mut contents = self.0.contents();
        (contents.is_open, contents.unusable) = (false, None);
        let connection = contents.connection.take();
        drop(contents);
        drop(connection);
    }
}
