//! A session under the drivers of microcontrollers, which must make no difference.

use core::cell::RefCell;
use core::convert::Infallible;
use core::future::{pending, poll_fn};
use core::ops::ControlFlow;
use core::pin::pin;
use core::task::{Context, Poll, Waker};
use core::time::Duration;
use std::vec::Vec;

use embedded_io::{ErrorType, ReadReady, WriteReady};

use crate::{Clock, Session, embedded_io as blocking, embedded_io_async as waiting};

/// The size of a driver's buffers.
pub(super) const BUFFER_LEN: usize = 4096;

/// The bytes for a port, and the events and transmissions of a driver, in sequence.
pub(super) struct Driven<E> {
    /// The bytes that have arrived and are not read yet.
    pub(super) received: Vec<u8>,
    pub(super) done: Vec<DriverOutput<E>>,
}

impl<E> Default for Driven<E> {
    fn default() -> Self {
        Self { received: Vec::new(), done: Vec::new() }
    }
}

pub(super) enum DriverOutput<E> {
    Event(E),
    Sent(Vec<u8>),
}

impl<E> Driven<E> {
    /// Does the work that the session has at `now`, with the loop over `embedded-io`.
    pub(super) fn poll(&mut self, session: &mut impl Session<Event = E>, now: Duration) {
        let shared = RefCell::new(self);
        let mut driver = blocking::Driver::<_, _, BUFFER_LEN, BUFFER_LEN>::new(Port(&shared), || now);
        let _ = driver.poll(session, |_, event| note(&shared, event)).unwrap();
    }

    /// As [`poll`](Self::poll), under the loop over `embedded-io-async`: woken, then until it waits.
    pub(super) fn turn(&mut self, session: &mut impl Session<Event = E>, now: Duration) {
        let shared = RefCell::new(self);
        let mut driver = waiting::Driver::<_, _, _, BUFFER_LEN, BUFFER_LEN>::new(
            Port(&shared),
            Port(&shared),
            FixedClock(now),
        );
        let mut woken = true;
        loop {
            let wake = poll_fn(|_| if core::mem::take(&mut woken) { Poll::Ready(()) } else { Poll::Pending });
            let turn = pin!(driver.turn(session, wake, |_, event| note(&shared, event)));
            if turn.poll(&mut Context::from_waker(Waker::noop())).is_pending() {
                return;
            }
        }
    }
}

fn note<E>(shared: &RefCell<&mut Driven<E>>, event: E) -> ControlFlow<()> {
    shared.borrow_mut().done.push(DriverOutput::Event(event));
    ControlFlow::Continue(())
}

/// A port that takes every byte.
struct Port<'a, 'b, E>(&'a RefCell<&'b mut Driven<E>>);

impl<E> ErrorType for Port<'_, '_, E> {
    type Error = Infallible;
}

impl<E> ReadReady for Port<'_, '_, E> {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(!self.0.borrow().received.is_empty())
    }
}

impl<E> embedded_io::Read for Port<'_, '_, E> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let received = core::mem::take(&mut self.0.borrow_mut().received);
        buffer[..received.len()].copy_from_slice(&received);
        Ok(received.len())
    }
}

impl<E> WriteReady for Port<'_, '_, E> {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(true)
    }
}

impl<E> embedded_io::Write for Port<'_, '_, E> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        self.0.borrow_mut().done.push(DriverOutput::Sent(bytes.into()));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl<E> embedded_io_async::Read for Port<'_, '_, E> {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        match self.read_ready() {
            Ok(true) => embedded_io::Read::read(self, buffer),
            _ => pending().await,
        }
    }
}

impl<E> embedded_io_async::Write for Port<'_, '_, E> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        embedded_io::Write::write(self, bytes)
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

struct FixedClock(Duration);

impl Clock for FixedClock {
    fn now(&self) -> Duration {
        self.0
    }

    async fn sleep_until(&self, at: Duration) {
        if at > self.0 {
            pending().await
        }
    }
}
