//! The wait of a transport, which ends when bytes arrive, at a time, or by a waker.

use core::net::Ipv4Addr;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::io;
use std::net::UdpSocket;
use std::sync::Arc;
use std::thread;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::AsFd;

/// The wait of a [`Transport`](crate::Transport): no longer than `limit`, and until its driver is [woken](Waker).
#[derive(Debug, Clone, Copy, Default)]
pub struct Wait<'a> {
    /// The longest time of the wait; `None` is without limit.
    pub limit: Option<Duration>,
    /// Whether the wait also ends when the socket can take bytes: the driver has more to send.
    pub room: bool,
    waker: Option<&'a Waker>,
}

impl<'a> Wait<'a> {
    pub(crate) fn new(limit: Option<Duration>, waker: Option<&'a Waker>, room: bool) -> Self {
        Self { limit, waker, room }
    }

    /// Returns a wait that ends only at its limit.
    #[must_use]
    pub fn limited(limit: Duration) -> Self {
        Self::new(Some(limit), None, false)
    }

    /// Returns the same wait, no longer than `limit`.
    #[must_use]
    pub fn at_most(self, limit: Duration) -> Self {
        Self { limit: Some(self.limit.map_or(limit, |own| own.min(limit))), ..self }
    }

    /// Waits until there is something to read, an end or an error, and returns whether there is. While the driver has bytes
    /// to send, the wait also ends when the socket can take them. The wait is exact, whereas a socket's own time limit is
    /// rounded up to 4 ms and more on many systems. A signal may end it early.
    ///
    /// # Errors
    /// The errors of the system.
    pub fn readable(self, socket: impl AsFd) -> io::Result<bool> {
        let room = if self.room { PollFlags::OUT } else { PollFlags::empty() };
        Ok(!self.poll(socket, PollFlags::IN | room)?.difference(PollFlags::OUT).is_empty())
    }

    /// Waits until the socket can take bytes, or has an error, and returns whether that is so.
    ///
    /// # Errors
    /// The errors of the system.
    pub fn writable(self, socket: impl AsFd) -> io::Result<bool> {
        Ok(!self.poll(socket, PollFlags::OUT)?.is_empty())
    }

    /// Returns the `flags` that the socket is ready for.
    #[cfg(not(windows))]
    fn poll(self, socket: impl AsFd, flags: PollFlags) -> io::Result<PollFlags> {
        self.poll_once(socket, flags)
    }

    /// Returns the `flags` that the socket is ready for. The system's own wait ends at a clock tick of up to 15.6 ms, a sleep
    /// ends on time. So the last part of a wait consists of short sleeps, with a check of the socket after each.
    #[cfg(windows)]
    fn poll(self, socket: impl AsFd, flags: PollFlags) -> io::Result<PollFlags> {
        const CLOCK: Duration = Duration::from_millis(16);
        const RECHECK_INTERVAL: Duration = Duration::from_micros(500);
        let end = self.limit.and_then(|limit| std::time::Instant::now().checked_add(limit));
        let left =
            || end.map_or(Duration::MAX, |end| end.saturating_duration_since(std::time::Instant::now()));
        loop {
            let rest = left();
            let limit = end.map(|_| rest.saturating_sub(CLOCK));
            let ready = Self { limit, ..self }.poll_once(socket.as_fd(), flags)?;
            let is_woken = self.waker.is_some_and(|Waker(waker)| waker.pending.load(Ordering::Acquire));
            if !ready.is_empty() || is_woken || rest.is_zero() {
                return Ok(ready);
            }
            if rest <= CLOCK {
                thread::sleep(left().min(RECHECK_INTERVAL));
            }
        }
    }

    fn poll_once(self, socket: impl AsFd, flags: PollFlags) -> io::Result<PollFlags> {
        // A limit that the system cannot express is as good as none.
        let limit = self.limit.and_then(|limit| Timespec::try_from(limit).ok());
        let of = PollFd::from_borrowed_fd;
        let socket = of(socket.as_fd(), flags);
        let (socket, outcome) = match self.waker {
            Some(Waker(waker)) => {
                let mut both = [socket, of(waker.socket.as_fd(), PollFlags::IN)];
                let outcome = poll(&mut both, limit.as_ref());
                let [socket, _] = both;
                (socket, outcome)
            }
            None => {
                let mut one = [socket];
                let outcome = poll(&mut one, limit.as_ref());
                let [socket] = one;
                (socket, outcome)
            }
        };
        match outcome {
            Ok(_) => Ok(socket.revents()),
            Err(rustix::io::Errno::INTR) => Ok(PollFlags::empty()),
            Err(error) => Err(error.into()),
        }
    }

    /// Waits without reading.
    ///
    /// # Errors
    /// The errors of the system.
    pub fn pause(self) -> io::Result<()> {
        match self.waker {
            Some(Waker(waker)) => Self::new(self.limit, None, false).readable(&waker.socket).map(drop),
            None => {
                thread::sleep(self.limit.unwrap_or(Duration::MAX));
                Ok(())
            }
        }
    }
}

/// Ends the wait of a [`Driver`](crate::Driver), from any thread: the hook of a queue, or the caller's own event. It never
/// blocks, and waking often before the driver has looked costs no more than waking once.
#[derive(Debug, Clone)]
pub struct Waker(Arc<Wakeup>);

#[derive(Debug)]
struct Wakeup {
    /// A socket connected to itself: a descriptor that any system can wait for, and that no other socket can send to.
    socket: UdpSocket,
    /// Whether a datagram is on its way.
    pending: AtomicBool,
}

impl Waker {
    pub(crate) fn new() -> io::Result<Self> {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
        socket.connect(socket.local_addr()?)?;
        socket.set_nonblocking(true)?;
        Ok(Self(Arc::new(Wakeup { socket, pending: AtomicBool::new(false) })))
    }

    /// Ends the wait of the driver, or its next one.
    pub fn wake(&self) {
        let Wakeup { socket, pending } = &*self.0;
        // One datagram fits: the socket has none from before. If the system fails, the next call tries again.
        if !pending.swap(true, Ordering::AcqRel) && socket.send(&[]).is_err() {
            pending.store(false, Ordering::Release);
        }
    }

    /// Returns whether the driver was woken since the last call.
    pub(crate) fn take(&self) -> bool {
        let Wakeup { socket, pending } = &*self.0;
        // A thread that wakes the driver after this read sends another datagram, or has made its change before `take`
        // returns.
        pending.load(Ordering::Acquire)
            && socket.recv(&mut []).is_ok()
            && pending.swap(false, Ordering::AcqRel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wake_that_was_taken_ends_no_wait() {
        let waker = Waker::new().unwrap();
        let ends = |limit| Wait::limited(limit).readable(&waker.0.socket).unwrap();
        assert!(!waker.take());
        for wakes in 1..4 {
            (0..wakes).for_each(|_| waker.wake());
            assert!(ends(Duration::from_secs(20)) && waker.take());
            assert!(!ends(Duration::ZERO) && !waker.take(), "however often, it is woken once");
        }
    }
}
