//! An end under the drivers of microcontrollers, which must make no difference.

use core::cell::RefCell;
use core::convert::Infallible;
use core::future::{pending, poll_fn};
use core::ops::ControlFlow;
use core::pin::pin;
use core::task::{Context, Poll, Waker};
use core::time::Duration;

use cellwire_links::end::End;
use embedded_io::{ErrorType, ReadReady, WriteReady};
use robot_session::{Clock, Session, embedded_io as blocking, embedded_io_async as waiting};

/// At least what any end reads or writes at once.
const MOST: usize = 4096;

/// What a port has, and what goes through a driver: in order.
#[derive(Debug, Default)]
pub(super) struct Driven {
    /// What has come.
    pub(super) received: Vec<u8>,
    pub(super) done: Vec<Done>,
}

#[derive(Debug)]
pub(super) enum Done {
    Event(String),
    Sent(Vec<u8>),
}

impl Driven {
    /// What an end does at a time, under the loop over `embedded-io`.
    pub(super) fn poll(&mut self, end: &mut dyn End, now: Duration) {
        let shared = RefCell::new(self);
        let mut driver = blocking::Driver::<_, _, MOST, MOST>::new(Port(&shared), || now);
        let _ = driver.poll(&mut Dynamic(end), |_, event| note(&shared, event)).unwrap();
    }

    /// The same under the loop over `embedded-io-async`: woken, then until it waits.
    pub(super) fn turn(&mut self, end: &mut dyn End, now: Duration) {
        let shared = RefCell::new(self);
        let mut driver = waiting::Driver::<_, _, _, MOST, MOST>::new(Port(&shared), Port(&shared), Now(now));
        let mut woken = true;
        loop {
            let wake = poll_fn(|_| if core::mem::take(&mut woken) { Poll::Ready(()) } else { Poll::Pending });
            let mut session = Dynamic(end);
            let turn = pin!(driver.turn(&mut session, wake, |_, event| note(&shared, event)));
            if turn.poll(&mut Context::from_waker(Waker::noop())).is_pending() {
                return;
            }
        }
    }
}

fn note(shared: &RefCell<&mut Driven>, event: String) -> ControlFlow<()> {
    shared.borrow_mut().done.push(Done::Event(event));
    ControlFlow::Continue(())
}

struct Dynamic<'a>(&'a mut dyn End);

impl Session for Dynamic<'_> {
    type Event = String;
    type Statistics = ();

    const MAX_INPUT: usize = MOST;
    const MAX_TRANSMIT: usize = MOST;

    fn handle_connected(&mut self, now: Duration) {
        self.0.handle_connected(now);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.0.handle_disconnected(now);
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        self.0.handle_input(now, bytes);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.0.handle_timeout(now);
    }

    fn wants_input(&self) -> bool {
        self.0.wants_input()
    }

    fn poll_event(&mut self) -> Option<String> {
        self.0.poll_event()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        assert!(self.0.max_transmit() <= MOST);
        self.0.poll_transmit(now, out)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.0.poll_timeout()
    }

    fn statistics(&self) {}
}

/// It has room for everything.
struct Port<'a, 'b>(&'a RefCell<&'b mut Driven>);

impl ErrorType for Port<'_, '_> {
    type Error = Infallible;
}

impl ReadReady for Port<'_, '_> {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(!self.0.borrow().received.is_empty())
    }
}

impl embedded_io::Read for Port<'_, '_> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let received = core::mem::take(&mut self.0.borrow_mut().received);
        buffer[..received.len()].copy_from_slice(&received);
        Ok(received.len())
    }
}

impl WriteReady for Port<'_, '_> {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(true)
    }
}

impl embedded_io::Write for Port<'_, '_> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        self.0.borrow_mut().done.push(Done::Sent(bytes.into()));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl embedded_io_async::Read for Port<'_, '_> {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        match self.read_ready() {
            Ok(true) => embedded_io::Read::read(self, buffer),
            _ => pending().await,
        }
    }
}

impl embedded_io_async::Write for Port<'_, '_> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        embedded_io::Write::write(self, bytes)
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

struct Now(Duration);

impl Clock for Now {
    fn now(&self) -> Duration {
        self.0
    }

    async fn sleep_until(&self, at: Duration) {
        if at > self.0 {
            pending().await
        }
    }
}
