//! The same board under Embassy: its UART by `embedded-io-async`, and the clock of `embassy-time`.

use core::cell::RefCell;
use core::convert::Infallible;
use core::future::poll_fn;
use core::task::{Poll, Waker};
use core::time::Duration;

use critical_section::Mutex;
use embassy_sync::waitqueue::AtomicWaker;
use embassy_time::{Instant, Timer};
use embassy_time_driver::Driver;
use embassy_time_queue_utils::Queue;
use embedded_io::{ErrorType, ReadReady as _, WriteReady as _};
use embedded_io_async::{Read, Write};
use robot_session::Clock;

use crate::{Uart, alarm, now};

static RECEIVED: AtomicWaker = AtomicWaker::new();
static SENT: AtomicWaker = AtomicWaker::new();

/// Handles the interrupt below those of the UART and of the alarm: wakes the tasks.
pub(crate) fn interrupt() {
    RECEIVED.wake();
    SENT.wake();
    TIMERS.expire();
}

/// The clock of `embassy-time`, for a driver of `robot-session`.
#[derive(Debug, Clone, Copy)]
pub struct EmbassyClock;

impl Clock for EmbassyClock {
    fn now(&self) -> Duration {
        now()
    }

    async fn sleep_until(&self, at: Duration) {
        Timer::at(Instant::from_micros(micros(at).saturating_add(1))).await;
    }
}

/// Returns whole microseconds, up to the longest time of `embassy-time`.
fn micros(time: Duration) -> u64 {
    time.as_secs().saturating_mul(1_000_000).saturating_add(u64::from(time.subsec_micros()))
}

/// The queue of wakers with the times for which they wait.
struct Timers(Mutex<RefCell<Queue>>);

embassy_time_driver::time_driver_impl!(static TIMERS: Timers = Timers(Mutex::new(RefCell::new(Queue::new()))));

impl Driver for Timers {
    fn now(&self) -> u64 {
        micros(now())
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        if critical_section::with(|cs| self.0.borrow_ref_mut(cs).schedule_wake(at, waker)) {
            self.expire();
        }
    }
}

impl Timers {
    /// Wakes whose time has come, and sets the alarm for the next one.
    fn expire(&self) {
        critical_section::with(|cs| {
            let next = self.0.borrow_ref_mut(cs).next_expiration(micros(now()));
            let at = (next < u64::MAX).then(|| Duration::from_micros(next));
            alarm::set(|times| times.session = at);
        });
    }
}

/// The half of the UART that reads.
#[derive(Debug)]
pub struct Receiver(Uart);

/// The half that writes.
#[derive(Debug)]
pub struct Sender(Uart);

impl Uart {
    /// Splits the port into both halves: a driver waits for both at once.
    pub fn split(self) -> (Receiver, Sender) {
        (Receiver(self), Sender(Self::new()))
    }
}

impl ErrorType for Receiver {
    type Error = Infallible;
}

impl ErrorType for Sender {
    type Error = Infallible;
}

impl Read for Receiver {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        poll_fn(|context| {
            RECEIVED.register(context.waker());
            match self.0.read_ready() {
                Ok(true) => Poll::Ready(embedded_io::Read::read(&mut self.0, buffer)),
                _ => Poll::Pending,
            }
        })
        .await
    }
}

impl Write for Sender {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        poll_fn(|context| {
            SENT.register(context.waker());
            match self.0.write_ready() {
                Ok(true) => Poll::Ready(embedded_io::Write::write(&mut self.0, bytes)),
                _ => Poll::Pending,
            }
        })
        .await
    }

    /// Waits until the UART has taken everything.
    async fn flush(&mut self) -> Result<(), Infallible> {
        poll_fn(|context| {
            SENT.register(context.waker());
            if self.0.is_sent() { Poll::Ready(Ok(())) } else { Poll::Pending }
        })
        .await
    }
}

/// Waits for something, a second at most: then the watchdog is to be fed.
pub async fn wait_or_second(something: impl Future<Output = ()>) {
    let _ = embassy_time::with_timeout(embassy_time::Duration::from_secs(1), something).await;
}
