//! The loops over `embedded-io` and `embedded-io-async`.

use core::cell::{Cell, RefCell};
use core::convert::Infallible;
use core::future::pending;
use core::ops::ControlFlow;
use core::time::Duration;
use std::collections::VecDeque;
use std::io;

use crate::common::echo::{Echo, EchoEvent};
use crate::common::{Asker, Event};
use embedded_io::{ErrorType, ReadReady, WriteReady};
use robot_session::{Clock, EndReason, Session, embedded_io as blocking, embedded_io_async as waiting};
use tokio::io::{
    AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _, BufWriter, DuplexStream, ReadHalf,
    WriteHalf,
};
use tokio::sync::Notify;
use tokio::time::timeout;

const SHORT: Duration = Duration::from_millis(20);
const LONG: Duration = Duration::from_secs(20);

/// One half of tokio's pipe, and tokio's clock.
struct Half<T>(T);

impl<T> ErrorType for Half<T> {
    type Error = io::Error;
}

impl<T: AsyncRead + Unpin> embedded_io_async::Read for Half<T> {
    async fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.read(buffer).await
    }
}

impl<T: AsyncWrite + Unpin> embedded_io_async::Write for Half<T> {
    async fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes).await
    }

    async fn flush(&mut self) -> io::Result<()> {
        self.0.flush().await
    }
}

struct Process;

impl Clock for Process {
    fn now(&self) -> Duration {
        robot_session::now()
    }

    async fn sleep_until(&self, at: Duration) {
        assert_ne!(at, Duration::MAX, "the latest time of all is never");
        tokio::time::sleep(at.saturating_sub(self.now())).await;
    }
}

type Driver = waiting::Driver<Half<ReadHalf<DuplexStream>>, Half<WriteHalf<DuplexStream>>, Process, 64, 8>;

fn driver(room: usize) -> (Driver, DuplexStream) {
    let (near, far) = tokio::io::duplex(room);
    let (reader, writer) = tokio::io::split(near);
    (Driver::new(Half(reader), Half(writer), Process), far)
}

fn go_on<S, E>(_: &mut S, _: E) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Sends every byte back.
async fn mirror(mut far: DuplexStream) {
    let mut byte = [0];
    while far.read(&mut byte).await.unwrap() == 1 {
        far.write_all(&byte).await.unwrap();
    }
}

#[tokio::test]
async fn a_session_runs_until_its_handler_breaks() {
    let (mut driver, far) = driver(64);
    tokio::spawn(mirror(far));
    let (mut session, mut seen) = (Asker::new(&["one", "two"]), Vec::new());
    let handler = |_: &mut Asker, event: Event| {
        seen.push(event.clone());
        if event == Event::Answer("two".into()) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    assert_eq!(driver.drive(&mut session, handler).await.unwrap(), EndReason::ByHandler(()));
    let answers = ["one", "two"].map(|text| Event::Answer(text.into()));
    assert_eq!(seen, [&[Event::Connected][..], &answers, &[Event::Disconnected]].concat());
}

#[tokio::test]
async fn the_end_of_the_stream_and_a_timeout_are_seen() {
    let (mut driver, far) = driver(64);
    let mut session = Asker::new(&["one"]);
    session.timeout = SHORT;
    let turn = driver.turn(&mut session, pending(), |_, event| ControlFlow::Break(event)).await.unwrap();
    assert_eq!(turn, ControlFlow::Break(EndReason::ByHandler(Event::NoAnswer("one".into()))));
    drop(far);
    assert_eq!(
        driver.turn(&mut session, pending(), go_on).await.unwrap(),
        ControlFlow::Break(EndReason::ByPeer)
    );
}

/// The pipe takes three bytes at a time, and every future is dropped as soon as it waits.
#[tokio::test]
async fn a_dropped_turn_loses_nothing() {
    let (mut driver, mut far) = driver(3);
    let mut session = Asker::new(&["1234567", "second"]);
    let (mut arrived, mut dropped) = (Vec::new(), 0);
    while !arrived.ends_with(b"second\n") {
        let turn = driver.turn(&mut session, pending(), go_on);
        if timeout(Duration::ZERO, turn).await.is_err() {
            dropped += 1;
        }
        let mut bytes = [0; 3];
        if let Ok(length) = timeout(Duration::from_millis(1), far.read(&mut bytes)).await {
            arrived.extend(&bytes[..length.unwrap()]);
        }
        if arrived == b"1234567\n" && session.requests.len() == 1 {
            far.write_all(b"ok\n").await.unwrap();
        }
        assert!(dropped < 1000, "{arrived:?}");
    }
    assert_eq!(arrived, b"1234567\nsecond\n");
    assert!(dropped > 3, "{dropped}");
}

/// The port keeps up to 64 bytes until it is flushed.
#[tokio::test]
async fn what_a_port_holds_is_flushed() {
    let (near, mut far) = tokio::io::duplex(64);
    let (reader, writer) = tokio::io::split(near);
    let writer = BufWriter::with_capacity(64, writer);
    let mut driver = waiting::Driver::<_, _, _, 64, 8>::new(Half(reader), Half(writer), Process);
    let mut session = Asker::new(&["one"]);
    assert!(timeout(SHORT, driver.turn(&mut session, pending(), go_on)).await.is_err(), "it waits");
    let mut arrived = [0; 4];
    timeout(SHORT, far.read_exact(&mut arrived)).await.expect("the bytes stay in the port").unwrap();
    assert_eq!(&arrived, b"one\n");
}

#[tokio::test]
async fn a_wake_ends_the_wait_and_the_next_turn_does_not_wait() {
    let (mut driver, _far) = driver(64);
    let (mut session, notify) = (Asker::new(&[]), Notify::new());
    for _ in 1..4 {
        notify.notify_one();
        for _ in 0..2 {
            let turn = timeout(LONG, driver.turn(&mut session, notify.notified(), go_on)).await;
            assert!(turn.unwrap().unwrap().is_continue());
        }
        let turn = timeout(SHORT, driver.turn(&mut session, notify.notified(), go_on)).await;
        assert!(turn.is_err(), "it is woken once");
    }
}

#[tokio::test]
async fn what_a_session_does_not_want_yet_stays_in_the_port() {
    let (mut driver, mut far) = driver(64);
    let mut session = Echo::new(3 * SHORT);
    session.handle_connected(driver.clock().now());
    far.write_all(b"ab").await.unwrap();
    assert!(driver.turn(&mut session, pending(), go_on).await.unwrap().is_continue());
    assert!(!session.wants_input());
    far.write_all(b"cd").await.unwrap();
    let begin = driver.clock().now();
    assert!(driver.turn(&mut session, pending(), go_on).await.unwrap().is_continue());
    assert!(driver.clock().now() - begin >= 2 * SHORT, "it waits for the deadline");
    let mut byte = [0; 2];
    assert_eq!(driver.reader_mut().0.read(&mut byte).await.unwrap(), 2);
    assert_eq!(&byte, b"cd");
    let mut session = Echo::new(Duration::MAX);
    session.handle_connected(driver.clock().now());
    far.write_all(b"ef").await.unwrap();
    assert!(driver.turn(&mut session, pending(), go_on).await.unwrap().is_continue());
    let turn = timeout(SHORT, driver.turn(&mut session, pending(), go_on)).await;
    assert!(turn.is_err(), "it is never due");
}

/// One end of the line, which never waits.
struct Port<'a>(&'a RefCell<Line>);

/// The bytes to be read, and the bytes sent.
#[derive(Default)]
struct Line {
    received: VecDeque<u8>,
    sent: Vec<u8>,
    /// The number of bytes that the line takes.
    room: usize,
    is_closed: bool,
    /// Whether the line takes nothing any more, and reports that.
    is_full: bool,
}

impl ErrorType for Port<'_> {
    type Error = Infallible;
}

impl embedded_io::Read for Port<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let received = &mut self.0.borrow_mut().received;
        let length = buffer.len().min(received.len());
        buffer.iter_mut().zip(received.drain(..length)).for_each(|(to, byte)| *to = byte);
        Ok(length)
    }
}

impl ReadReady for Port<'_> {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        let line = self.0.borrow();
        Ok(line.is_closed || !line.received.is_empty())
    }
}

impl embedded_io::Write for Port<'_> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let mut line = self.0.borrow_mut();
        let length = bytes.len().min(line.room);
        line.room -= length;
        line.sent.extend(&bytes[..length]);
        Ok(length)
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        panic!("an interrupt does not wait until all is sent")
    }
}

impl WriteReady for Port<'_> {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        let line = self.0.borrow();
        Ok(line.is_closed || line.is_full || line.room > 0)
    }
}

#[test]
fn a_poll_goes_on_as_far_as_it_can_and_says_when_it_must_be_called_again() {
    let (line, now) = (RefCell::new(Line::default()), Cell::new(Duration::ZERO));
    let mut driver = blocking::Driver::<_, _, 2, 8>::new(Port(&line), || now.get());
    let (mut session, mut seen) = (Asker::new(&["1234567", "one"]), Vec::new());
    session.timeout = Duration::from_secs(2);
    let mut poll = |session: &mut Asker| {
        let note = |_: &mut Asker, event| {
            seen.push(event);
            ControlFlow::<()>::Continue(())
        };
        driver.poll(session, note).unwrap().continue_value().unwrap()
    };
    // The port takes three bytes at a time, and the deadline holds meanwhile.
    for sent in [&b""[..], b"123", b"123456"] {
        assert_eq!(poll(&mut session), Some(Duration::from_secs(2)));
        assert_eq!(line.borrow().sent, sent);
        line.borrow_mut().room = 3;
    }
    assert_eq!(poll(&mut session), Some(Duration::from_secs(2)));
    assert_eq!((&line.borrow().sent[..], line.borrow().room), (&b"1234567\n"[..], 1));
    // An answer comes whole, though the driver reads two bytes at once, and the next request follows in the same call.
    line.borrow_mut().received.extend(b"1234567\n");
    line.borrow_mut().room = 4;
    now.set(Duration::from_secs(1));
    assert_eq!(poll(&mut session), Some(Duration::from_secs(3)));
    assert_eq!(line.borrow().sent, b"1234567\none\n");
    // The time of the session is over before anything has come.
    now.set(Duration::from_secs(3));
    assert_eq!(poll(&mut session), None);
    assert_eq!(seen, [Event::Answer("1234567".into()), Event::NoAnswer("one".into())]);
}

#[test]
fn what_the_session_works_with_is_looked_at_in_every_poll() {
    /// Counts the checks of its inputs.
    struct Looker(u32);

    impl Session for Looker {
        type Event = ();
        type Statistics = u32;
        const MAX_INPUT: usize = 1;
        const MAX_TRANSMIT: usize = 1;
        fn handle_connected(&mut self, _: Duration) {}
        fn handle_disconnected(&mut self, _: Duration) {}
        fn handle_input(&mut self, _: Duration, _: &[u8]) {}
        fn handle_timeout(&mut self, _: Duration) {
            self.0 += 1;
        }
        fn poll_event(&mut self) -> Option<()> {
            None
        }
        fn poll_transmit(&mut self, _: Duration, _: &mut [u8]) -> Option<usize> {
            None
        }
        fn poll_timeout(&self) -> Option<Duration> {
            None
        }
        fn statistics(&self) -> u32 {
            self.0
        }
    }

    let line = RefCell::new(Line::default());
    let mut driver = blocking::Driver::<_, _, 1, 1>::new(Port(&line), || Duration::ZERO);
    let mut session = Looker(0);
    for looked in [1, 2] {
        let turn = driver.poll(&mut session, |_, ()| ControlFlow::<()>::Continue(())).unwrap();
        assert_eq!(turn, ControlFlow::Continue(None));
        assert!(session.statistics() >= looked);
        session.0 = looked;
    }
}

#[test]
fn a_poll_ends_with_the_handler_or_the_connection() {
    let line =
        RefCell::new(Line { room: 8, received: b"one\n".iter().copied().collect(), ..Line::default() });
    let mut driver = blocking::Driver::<_, _, 64, 8>::new(Port(&line), || Duration::ZERO);
    let mut session = Asker::new(&["one", "two"]);
    let turn = driver.poll(&mut session, |_, event| ControlFlow::Break(event)).unwrap();
    assert_eq!(turn, ControlFlow::Break(EndReason::ByHandler(Event::Answer("one".into()))));
    *line.borrow_mut() = Line { is_closed: true, ..Line::default() };
    assert_eq!(
        driver.poll(&mut session, go_on).unwrap(),
        ControlFlow::Break(EndReason::ByPeer),
        "it takes nothing"
    );
    let mut session = Asker::new(&[]);
    assert_eq!(
        blocking::Driver::<_, _, 64, 8>::new(Port(&line), || Duration::ZERO)
            .poll(&mut session, go_on)
            .unwrap(),
        ControlFlow::Break(EndReason::ByPeer),
        "it brings nothing"
    );
    // A port that takes nothing is closed, and at once: there is no wait until it counts as stalled.
    *line.borrow_mut() = Line { is_full: true, ..Line::default() };
    let time = Cell::new(Duration::ZERO);
    let clock = || time.replace(time.get() + Duration::from_secs(1));
    let turn =
        blocking::Driver::<_, _, 64, 8>::new(Port(&line), clock).poll(&mut Asker::new(&["one"]), go_on);
    assert_eq!(turn.unwrap(), ControlFlow::Break(EndReason::ByPeer), "it takes nothing");
}

#[test]
fn a_port_counts_as_stalled_after_the_time_that_it_is_given() {
    let (line, now) = (RefCell::new(Line::default()), Cell::new(Duration::ZERO));
    let driver = || blocking::Driver::<_, _, 2, 8>::new(Port(&line), || now.get());
    for (mut driver, stall) in [(driver().stall(SHORT), SHORT), (driver(), robot_session::STALL)] {
        let mut session = Asker::new(&["one"]);
        session.timeout = LONG;
        now.set(Duration::ZERO);
        assert_eq!(driver.poll(&mut session, go_on).unwrap(), ControlFlow::Continue(Some(stall)));
        now.set(stall - Duration::from_nanos(1));
        assert_eq!(driver.poll(&mut session, go_on).unwrap(), ControlFlow::Continue(Some(stall)));
        now.set(stall);
        assert_eq!(driver.poll(&mut session, go_on).unwrap(), ControlFlow::Break(EndReason::Stalled));
    }
}

#[test]
fn without_a_wish_for_input_bytes_stay_in_the_line() {
    let requests: Vec<u8> = (0..=250).cycle().take(1000).collect();
    let (line, now) = (RefCell::new(Line::default()), Cell::new(Duration::ZERO));
    let mut driver = blocking::Driver::<_, _, 32, 1>::new(Port(&line), || now.get());
    let mut session = Echo::new(Duration::from_millis(1));
    session.handle_connected(now.get());
    line.borrow_mut().received.extend(&requests);
    let mut polls = 0;
    while line.borrow().sent.len() < requests.len() {
        line.borrow_mut().room = 1;
        let check = |_: &mut Echo, event| {
            assert!(matches!(event, EchoEvent::Answered(_)), "{event:?}");
            ControlFlow::<()>::Continue(())
        };
        let turn = driver.poll(&mut session, check).unwrap();
        now.set(turn.continue_value().unwrap().unwrap_or(now.get()));
        polls += 1;
        assert!(polls < 3000);
    }
    assert_eq!(line.borrow().sent, requests);
}
