//! The polls of a task and of a driver: their order, their time, and no more of them than are needed.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the tests have pipes")]

use core::future::{Future, poll_fn};
use core::ops::ControlFlow;
use core::pin::{Pin, pin};
use core::sync::atomic::{AtomicUsize, Ordering::SeqCst};
use core::task::{Context, Poll, Waker};
use core::time::Duration;
use std::io;
use std::sync::{Arc, Mutex};

use crate::common::echo::Echo;
use crate::common::{Asker, Event};
use crate::reporting::Reporting;
use robot_session::tokio::{Connector, Dial, Driver, Handle, Reply, Reports, Service, spawn};
use robot_session::{EndReason, now};
use tokio::io::{
    AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _, DuplexStream, ReadBuf, duplex,
};
use tokio::task::yield_now;
use tokio::time::{advance, sleep, timeout};

const LONG: Duration = Duration::from_secs(3600);
const S: Duration = Duration::from_secs(1);

/// A pipe that takes four bytes at a time, and notes each poll: `r`, `w`, or `f` for a flush. To read bytes takes a second.
struct Noted {
    pipe: DuplexStream,
    /// The number of flushes that must wait after a write, and those that have waited since the last one.
    waits: usize,
    waited: usize,
    polls: Arc<Mutex<String>>,
}

fn noted() -> (Noted, DuplexStream, Arc<Mutex<String>>) {
    let ((pipe, far), polls) = (duplex(64), Arc::default());
    (Noted { pipe, waits: 0, waited: 0, polls: Arc::clone(&polls) }, far, polls)
}

impl AsyncRead for Noted {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        self.polls.lock().unwrap().push('r');
        let read = Pin::new(&mut self.pipe).poll_read(context, buffer);
        if read.is_ready() {
            // The time is over with the first poll.
            let _ = pin!(advance(S)).poll(&mut Context::from_waker(Waker::noop()));
        }
        read
    }
}

impl AsyncWrite for Noted {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        self.polls.lock().unwrap().push('w');
        self.waited = 0;
        Pin::new(&mut self.pipe).poll_write(context, &bytes[..bytes.len().min(4)])
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.polls.lock().unwrap().push('f');
        if self.waited == self.waits {
            return Poll::Ready(Ok(()));
        }
        self.waited += 1;
        context.waker().wake_by_ref();
        Poll::Pending
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}

/// Asks what it is called with. Each event is reported with the number of requests that were not sent before it.
struct Asking;

impl Service for Asking {
    type Session = Asker;
    type Call = &'static str;
    type Event = (Event, usize);

    fn call(&mut self, session: &mut Asker, _: Duration, text: &'static str) {
        session.requests.push_back(text.into());
    }

    fn event(&mut self, session: &mut Asker, event: Event, reports: &mut Reports<'_, (Event, usize)>) {
        reports.event((event, session.requests.len()));
    }

    fn refuse(&mut self, _: &'static str, why: &Arc<io::Error>) {
        panic!("{why}");
    }
}

/// Returns a connector for one connection.
fn once<T: AsyncRead + AsyncWrite + Unpin + Send + 'static>(pipe: T) -> impl Connector + 'static {
    let mut pipe = Some(pipe);
    Dial(move || {
        let pipe = pipe.take().ok_or_else(|| io::Error::other("no more pipes"));
        async { pipe }
    })
}

/// Makes a call whose outcome is an event.
async fn ask(handle: &Handle<Asking>, text: &'static str) {
    drop(handle.begin(|_: Reply<()>| text).await.unwrap());
}

fn answer(text: &str, unsent: usize) -> (Event, usize) {
    (Event::Answer(text.into()), unsent)
}

#[tokio::test(start_paused = true)]
async fn bytes_are_written_before_a_read_and_read_between_two_writes() {
    let (port, _far, polls) = noted();
    let (mut driver, mut session) = (Driver::new(port), Asker::new(&["1234567"]));
    let turn = pin!(driver.turn(&mut session, |_, _| ControlFlow::<()>::Continue(())));
    assert!(turn.poll(&mut Context::from_waker(Waker::noop())).is_pending(), "it waits for the answer");
    assert_eq!(*polls.lock().unwrap(), "wfrwfr");
}

/// The answer is read in the same poll in which the rest of the request is written.
#[tokio::test(start_paused = true)]
async fn an_input_has_its_own_time_and_its_event_comes_before_more_bytes() {
    let (port, mut far, polls) = noted();
    let (handle, task) = spawn(Asker::new(&["1234567", "two"]), Asking, once(port));
    let mut events = handle.events();
    far.write_all(b"ok\n").await.unwrap();
    let begin = now();
    tokio::spawn(task.run());
    assert_eq!(events.recv().await.unwrap(), (Event::Connected, 2));
    assert_eq!(events.recv().await.unwrap(), answer("ok", 1));
    assert_eq!(*polls.lock().unwrap(), "wfrwfwfr", "the last ones are for the next request");
    assert_eq!(events.recv().await.unwrap(), (Event::NoAnswer("two".into()), 0));
    let took = now() - begin;
    assert!((21 * S..22 * S).contains(&took), "20 s after its answer: {took:?}");
}

#[tokio::test(start_paused = true)]
async fn an_input_that_was_pending_is_polled_again_only_when_it_has_woken_the_task() {
    let (port, mut far, polls) = noted();
    let (handle, task) = spawn(Asker::new(&[]), Asking, once(port));
    tokio::spawn(task.run());
    handle.connected().await.unwrap();
    let take = || core::mem::take(&mut *polls.lock().unwrap());
    for _ in 0..2 {
        far.write_all(b"noise\n").await.unwrap();
        timeout(S / 2, core::future::pending::<()>()).await.unwrap_err();
        assert!(take().ends_with("rr"), "the bytes, and none");
        for _ in 0..3 {
            handle.waker().wake();
            yield_now().await;
        }
        assert_eq!(take(), "");
    }
}

/// From the second call on, the timer ends in time for its deadline.
#[tokio::test(start_paused = true)]
async fn a_task_sleeps_on_while_callers_send_their_requests() {
    let (pipe, mut far) = duplex(64);
    let (handle, task) = spawn(Asker::new(&[]), Asking, once(pipe));
    let (polls, mut events) = (Arc::new(AtomicUsize::new(0)), handle.events());
    let (counted, mut running) = (Arc::clone(&polls), Box::pin(task.run()));
    tokio::spawn(poll_fn(move |context| {
        counted.fetch_add(1, SeqCst);
        running.as_mut().poll(context).map(drop)
    }));
    assert_eq!(events.recv().await.unwrap().0, Event::Connected);
    let mut line = [0; 4];
    for number in 0..4 {
        yield_now().await;
        let before = polls.load(SeqCst);
        ask(&handle, "one").await;
        yield_now().await;
        assert_eq!(polls.load(SeqCst) - before, usize::from(number == 0), "for its first deadline");
        far.read_exact(&mut line).await.unwrap();
        far.write_all(&line).await.unwrap();
        assert_eq!(events.recv().await.unwrap(), answer("one", 0));
        advance(S).await;
    }
}

/// The timer was never set, or has ended since while nothing was due.
#[tokio::test(start_paused = true)]
async fn the_deadline_of_a_request_that_its_caller_has_sent_is_met() {
    for answered in 0..2 {
        let (pipe, mut far) = duplex(64);
        let (handle, task) = spawn(Asker::new(&[]), Asking, once(pipe));
        let mut events = handle.events();
        tokio::spawn(task.run());
        assert_eq!(events.recv().await.unwrap().0, Event::Connected);
        for _ in 0..answered {
            ask(&handle, "one").await;
            yield_now().await;
            far.write_all(b"one\n").await.unwrap();
            assert_eq!(events.recv().await.unwrap(), answer("one", 0));
            sleep(100 * S).await;
        }
        yield_now().await;
        let begin = now();
        ask(&handle, "two").await;
        let event = timeout(LONG, events.recv()).await.unwrap().unwrap();
        assert_eq!(event, (Event::NoAnswer("two".into()), 0));
        assert!((20 * S..21 * S).contains(&(now() - begin)), "{:?}", now() - begin);
    }
}

/// The port takes four bytes at a time; the timer is set from the first request on.
#[tokio::test(start_paused = true)]
async fn the_rest_of_a_request_that_its_caller_has_begun_is_sent_at_once() {
    let (port, mut far, _) = noted();
    let (handle, task) = spawn(Asker::new(&[]), Asking, once(port));
    let mut events = handle.events();
    tokio::spawn(task.stall(LONG).run());
    assert_eq!(events.recv().await.unwrap().0, Event::Connected);
    for _ in 0..2 {
        yield_now().await;
        ask(&handle, "1234567").await;
        let mut line = [0; 8];
        timeout(S, far.read_exact(&mut line)).await.unwrap().unwrap();
        far.write_all(&line).await.unwrap();
        assert_eq!(events.recv().await.unwrap(), answer("1234567", 0));
    }
}

/// The timer is set from the first request on.
#[tokio::test(start_paused = true)]
async fn a_request_that_its_caller_has_sent_is_flushed_until_it_is_out_and_no_more() {
    let (mut port, mut far, polls) = noted();
    port.waits = 2;
    let (handle, task) = spawn(Asker::new(&[]), Asking, once(port));
    let mut events = handle.events();
    tokio::spawn(task.run());
    assert_eq!(events.recv().await.unwrap().0, Event::Connected);
    for _ in 0..2 {
        yield_now().await;
        polls.lock().unwrap().clear();
        ask(&handle, "one").await;
        sleep(S).await;
        assert_eq!(polls.lock().unwrap().matches('f').count(), 3);
        far.write_all(b"one\n").await.unwrap();
        assert_eq!(events.recv().await.unwrap(), answer("one", 0));
    }
}

/// The inputs wake the task in which it runs now.
#[tokio::test(start_paused = true)]
async fn a_session_goes_on_in_another_task() {
    let (pipe, mut far) = duplex(64);
    let (handle, task) = spawn(Asker::new(&["one", "two"]), Asking, once(pipe));
    let (mut running, mut events) = (Box::pin(task.run()), handle.events());
    assert!(timeout(S, &mut running).await.is_err());
    tokio::spawn(running);
    yield_now().await;
    for text in ["one\n", "two\n"] {
        far.write_all(text.as_bytes()).await.unwrap();
    }
    assert_eq!(events.recv().await.unwrap().0, Event::Connected);
    assert_eq!(timeout(S, events.recv()).await.unwrap().unwrap(), answer("one", 1));
}

#[tokio::test(start_paused = true)]
async fn a_call_that_waits_in_the_channel_comes_before_a_later_one() {
    let (pipe, mut far) = duplex(64);
    let (handle, task) = spawn(Asker::new(&[]), Asking, once(pipe));
    tokio::spawn(task.run());
    handle.connected().await.unwrap();
    yield_now().await;
    assert!(handle.try_call("one"));
    ask(&handle, "two").await;
    let mut line = [0; 4];
    for text in ["one\n", "two\n"] {
        far.read_exact(&mut line).await.unwrap();
        assert_eq!(&line, text.as_bytes());
        far.write_all(&line).await.unwrap();
    }
}

#[tokio::test(start_paused = true)]
async fn after_a_deadline_another_one_ends_a_turn_and_one_that_is_never_does_not() {
    let (pipe, _far) = duplex(64);
    let (mut driver, mut session) = (Driver::new(pipe), Asker::new(&["one", "two", "three"]));
    session.timeout = S;
    for text in ["one", "two"] {
        let begin = now();
        let turn = timeout(LONG, driver.turn(&mut session, |_, event| ControlFlow::Break(event)));
        let ended = EndReason::ByHandler(Event::NoAnswer(text.into()));
        assert_eq!(turn.await.unwrap().unwrap(), ControlFlow::Break(ended));
        assert!((S..2 * S).contains(&(now() - begin)), "{:?}", now() - begin);
    }
    session.timeout = Duration::MAX;
    let turn = driver.turn(&mut session, |_, event| ControlFlow::Break(event));
    assert!(timeout(LONG, turn).await.is_err());
}

#[tokio::test(start_paused = true)]
async fn what_a_session_does_not_want_yet_stays_in_its_pipe() {
    let (pipe, mut far) = duplex(4);
    let (handle, task) = spawn(Echo::new(S), Reporting::NEW, once(pipe));
    tokio::spawn(task.run());
    far.write_all(b"abcd").await.unwrap();
    handle.connected().await.unwrap();
    yield_now().await;
    far.write_all(b"efgh").await.unwrap();
    let more = timeout(S / 2, far.write_u8(b'i'));
    assert!(more.await.is_err(), "the pipe is full");
    let mut answers = [0; 8];
    far.read_exact(&mut answers).await.unwrap();
    assert_eq!(&answers, b"abcdefgh");
}
