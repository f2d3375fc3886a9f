//! The end of a task, and the outcomes of its calls.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the tests have pipes")]

use core::future::Future;
use core::pin::pin;
use core::sync::atomic::{AtomicUsize, Ordering};
use core::task::{Context, Poll, Waker};
use core::time::Duration;
use std::io;
use std::sync::Arc;

use crate::common::{Asker, Event};
use robot_session::tokio::{
    Closed, Connector, Dial, Handle, Link, Reconnect, Reply, Reports, Service, Task, spawn,
};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream};
use tokio::time::{sleep, timeout};

const LONG: Duration = Duration::from_secs(3600);
const MS: Duration = Duration::from_millis(1);

/// Asks one thing after the other; it does not survive the question "panic".
#[derive(Default)]
struct Asking(Option<Reply<Result<String, String>>>);

#[derive(Debug)]
struct Ask(&'static str, Reply<Result<String, String>>);

impl Service for Asking {
    type Session = Asker;
    type Call = Ask;
    type Event = Event;

    fn has_room(&self, _: &Asker) -> bool {
        self.0.is_none()
    }

    fn call(&mut self, session: &mut Asker, _: Duration, Ask(text, reply): Ask) {
        assert_ne!(text, "panic");
        session.requests.push_back(text.into());
        self.0 = Some(reply);
    }

    fn event(&mut self, _: &mut Asker, event: Event, reports: &mut Reports<'_, Event>) {
        let outcome = match event {
            Event::Answer(text) => Ok(text),
            Event::NoAnswer(text) => Err(text),
            event => return reports.event(event),
        };
        drop(self.0.take().unwrap().send(outcome));
    }

    fn refuse(&mut self, Ask(_, reply): Ask, why: &Arc<io::Error>) {
        let _ = reply.send(Err(why.to_string()));
    }
}

type Asked = Result<Result<String, String>, Closed>;

async fn ask(handle: &Handle<Asking>, text: &'static str) -> Asked {
    timeout(LONG, handle.call(|reply| Ask(text, reply))).await.expect("every call ends")
}

fn asking<C: Connector>(connector: C) -> (Handle<Asking>, Task<Asking, C>) {
    spawn(Asker::new(&[]), Asking::default(), connector)
}

/// Answers every line with itself.
async fn echo(mut pipe: DuplexStream) {
    while let Ok(byte) = pipe.read_u8().await {
        if pipe.write_u8(byte).await.is_err() {
            return;
        }
    }
}

fn echoing() -> impl Connector<Transport = DuplexStream> + 'static {
    Dial(|| {
        let (near, far) = tokio::io::duplex(64);
        tokio::spawn(echo(far));
        async { Ok(near) }
    })
}

/// A call that a sleeping task leaves to its caller panics in the task too.
#[tokio::test(start_paused = true)]
async fn a_panic_of_the_service_ends_the_task_and_not_its_caller() {
    let (handle, task) = asking(echoing());
    let task = tokio::spawn(task.run());
    // From the second on, the task sleeps and its timer is set.
    for _ in 0..3 {
        assert_eq!(ask(&handle, "one").await, Ok(Ok("one".into())));
    }
    let panicking = handle.begin(|reply| Ask("panic", reply)).await.unwrap();
    let waiting = handle.begin(|reply| Ask("two", reply)).await.unwrap();
    assert_eq!(timeout(LONG, panicking).await, Ok(Err(Closed)));
    assert!(task.await.unwrap_err().is_panic());
    assert_eq!(timeout(LONG, waiting).await, Ok(Err(Closed)));
    assert_eq!(ask(&handle, "three").await, Err(Closed));
}

/// The task is not polled between the call and the read at the peer's end.
#[tokio::test(start_paused = true)]
async fn a_caller_sends_its_request_itself_while_the_task_sleeps() {
    let (near, mut far) = tokio::io::duplex(64);
    let mut pipes = vec![near];
    let (handle, task) = asking(Dial(move || {
        let pipe = pipes.pop().ok_or_else(|| io::Error::other("no more pipes"));
        async { pipe }
    }));
    tokio::spawn(task.run());
    handle.connected().await.unwrap();
    tokio::task::yield_now().await;
    let answer = handle.begin(|reply| Ask("one", reply)).await.unwrap();
    let mut line = [0; 4];
    assert_eq!(far.read(&mut line).now_or_never(), Some(4));
    assert_eq!(&line, b"one\n");
    far.write_all(&line).await.unwrap();
    assert_eq!(timeout(LONG, answer).await.unwrap(), Ok(Ok("one".into())));
}

trait NowOrNever: Future {
    /// Returns the value of a future that is ready at once.
    fn now_or_never<T>(self) -> Option<T>
    where
        Self: Future<Output = io::Result<T>> + Sized,
    {
        let mut context = Context::from_waker(Waker::noop());
        match pin!(self).poll(&mut context) {
            Poll::Ready(value) => Some(value.unwrap()),
            Poll::Pending => None,
        }
    }
}

impl<F: Future> NowOrNever for F {}

/// Checks that the state is `Ended`, and that waits for a connection and calls return at once with `Closed`.
async fn assert_ended(handle: &Handle<Asking>) {
    assert!(matches!(&*handle.link().borrow(), Link::Ended), "{handle:?}");
    assert_eq!(timeout(LONG, handle.connected()).await, Ok(Err(Closed)));
    assert_eq!(ask(handle, "one").await, Err(Closed));
    assert_eq!(timeout(LONG, handle.shutdown()).await, Ok(()));
}

#[tokio::test(start_paused = true)]
async fn a_task_that_has_ended_says_so() {
    let (handle, task) = asking(echoing());
    let task = tokio::spawn(task.run());
    handle.connected().await.unwrap();
    handle.shutdown().await;
    assert_ended(&handle).await;
    drop(task.await.unwrap());

    let (handle, task) = asking(echoing());
    let task = tokio::spawn(task.run());
    handle.connected().await.unwrap();
    let unanswered = handle.begin(|reply| Ask("one", reply)).await.unwrap();
    task.abort();
    assert!(task.await.unwrap_err().is_cancelled());
    assert_eq!(unanswered.await.map(drop), Err(Closed));
    assert_ended(&handle).await;

    let (handle, task) = asking(echoing());
    let task = tokio::spawn(task.run());
    assert_eq!(ask(&handle, "panic").await, Err(Closed));
    assert!(task.await.unwrap_err().is_panic());
    assert_ended(&handle).await;

    let (handle, task) = asking(echoing());
    let waiting = handle.begin(|reply| Ask("one", reply)).await.unwrap();
    drop(task);
    assert_eq!(waiting.await.map(drop), Err(Closed));
    assert_ended(&handle).await;
}

#[tokio::test(start_paused = true)]
async fn a_task_that_nobody_runs_is_shut_down() {
    let (handle, task) = asking(echoing());
    let waiting = handle.begin(|reply| Ask("one", reply)).await.unwrap();
    timeout(LONG, handle.shutdown()).await.unwrap();
    assert_eq!(waiting.await.map(drop), Err(Closed));
    assert_ended(&handle).await;
    drop(timeout(LONG, task.run()).await.unwrap());
}

/// Returns the number of connections in 100 s if each is given up after 20 ms by its caller.
async fn given_up(peer_speaks: bool) -> usize {
    let attempts = Arc::new(AtomicUsize::new(0));
    let counted = Arc::clone(&attempts);
    let dial = Dial(move || {
        counted.fetch_add(1, Ordering::SeqCst);
        let (near, mut far) = tokio::io::duplex(64);
        tokio::spawn(async move {
            if peer_speaks {
                far.write_all(b"one\n").await.unwrap();
            }
            while far.read_u8().await.is_ok() {}
        });
        async { Ok(near) }
    });
    let pause = Reconnect { first: 10 * MS, longest: 160 * MS };
    let (handle, task) = spawn(Asker::new(&[]), Asking::default(), dial);
    tokio::spawn(task.reconnect(pause).run());
    let giving_up = async {
        loop {
            handle.connected().await.unwrap();
            sleep(20 * MS).await;
            handle.reconnect(io::Error::other("given up"));
            let mut link = handle.link();
            let failed = link.wait_for(|link| matches!(link, Link::Failed(_))).await.unwrap();
            assert!(matches!(&*failed, Link::Failed(why) if why.to_string() == "given up"));
        }
    };
    assert!(timeout(100_000 * MS, giving_up).await.is_err());
    attempts.load(Ordering::SeqCst)
}

#[tokio::test(start_paused = true)]
async fn a_connection_that_its_caller_gives_up_is_replaced_with_delay_if_the_peer_was_silent() {
    // A pause of 120 ms on average, after 20 ms.
    let silent = given_up(false).await;
    assert!((650..=760).contains(&silent), "{silent}");
    // A pause of 7.5 ms, but the timer counts whole milliseconds.
    let speaking = given_up(true).await;
    assert!((3200..=3800).contains(&speaking), "{speaking}");
}

/// Asks each peer something, and then finds it to be wrong.
struct Wrong;

impl Service for Wrong {
    type Session = Asker;
    type Call = Reply<String>;
    type Event = ();

    fn has_room(&self, _: &Asker) -> bool {
        false
    }

    fn call(&mut self, _: &mut Asker, _: Duration, _: Reply<String>) {
        panic!("it has no room");
    }

    fn event(&mut self, session: &mut Asker, event: Event, reports: &mut Reports<'_, ()>) {
        match event {
            Event::Connected => session.requests.push_back("name".into()),
            Event::Answer(_) => reports.reconnect(io::Error::other("another robot")),
            Event::NoAnswer(_) | Event::Disconnected => {}
        }
    }

    fn refuse(&mut self, reply: Reply<String>, why: &Arc<io::Error>) {
        let _ = reply.send(why.to_string());
    }
}

#[tokio::test(start_paused = true)]
async fn a_peer_that_is_soon_found_to_be_wrong_gives_calls_no_more_time() {
    let limit = 1000 * MS;
    for (answers_after, is_usable) in [(200 * MS, false), (limit - MS, false), (limit, true)] {
        let dial = Dial(move || {
            let (near, mut far) = tokio::io::duplex(64);
            tokio::spawn(async move {
                far.read_exact(&mut [0; 5]).await.unwrap();
                sleep(answers_after).await;
                let _ = far.write_all(b"other\n").await;
                far.read_u8().await
            });
            async { Ok(near) }
        });
        let (handle, task) = spawn(Asker::new(&[]), Wrong, dial);
        tokio::spawn(task.give_up_after(limit).run());
        let outcome = timeout(10 * limit, handle.call(|reply| reply)).await;
        assert_eq!(outcome.is_err(), is_usable, "{answers_after:?}");
        assert!(outcome.is_err() || outcome == Ok(Ok("another robot".into())));
    }
}
