//! Every call ends, whatever the peer, the disk and the task do.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the tests have pipes")]

use core::future::{Future, pending};
use core::pin::Pin;
use core::sync::atomic::{AtomicUsize, Ordering::SeqCst};
use core::task::{Context, Poll, Waker};
use core::time::Duration;
use std::collections::VecDeque;
use std::io;
use std::sync::Arc;

use robot_session::Session;
use robot_session::tokio::{
    Closed, Dial, GIVE_UP_AFTER, Handle, Link, Reconnect, Reply, Reports, Service, Task, spawn,
};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream, duplex};
use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep, timeout};

const LONG: Duration = Duration::from_secs(3600);
const S: Duration = Duration::from_secs(1);
const MS: Duration = Duration::from_millis(1);
const FAST: Reconnect = Reconnect { first: Duration::from_millis(5), longest: Duration::from_millis(50) };

/// Sends a byte for each call, and waits for one: 300 ms after the beginning of the connection, or the answer before.
#[derive(Default)]
struct Slow {
    unsent: usize,
    is_connected: bool,
    in_flight: bool,
    quiet_until: Duration,
    outcomes: VecDeque<bool>,
}

impl Session for Slow {
    type Event = bool;
    type Statistics = ();
    const MAX_INPUT: usize = 16;
    const MAX_TRANSMIT: usize = 1;

    fn handle_connected(&mut self, now: Duration) {
        (self.is_connected, self.quiet_until) = (true, now + 300 * MS);
    }

    fn handle_disconnected(&mut self, _: Duration) {
        self.is_connected = false;
        if core::mem::take(&mut self.in_flight) {
            self.outcomes.push_back(false);
        }
    }

    fn handle_input(&mut self, now: Duration, _: &[u8]) {
        if core::mem::take(&mut self.in_flight) {
            self.quiet_until = now + 300 * MS;
            self.outcomes.push_back(true);
        }
    }

    fn handle_timeout(&mut self, _: Duration) {}

    fn poll_event(&mut self) -> Option<bool> {
        self.outcomes.pop_front()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        self.poll_timeout().filter(|at| *at <= now)?;
        (out[0], self.in_flight) = (b'x', true);
        self.unsent -= 1;
        Some(1)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        (self.is_connected && !self.in_flight && self.unsent > 0).then_some(self.quiet_until)
    }

    fn statistics(&self) {}
}

/// The behaviour of the storage of the state.
#[derive(Clone, Copy)]
enum Disk {
    Works,
    Fails,
    Hangs,
    Takes(Duration),
}

struct Calls {
    replies: VecDeque<Reply<Outcome>>,
    disk: Disk,
}

/// Whether it was answered, or why it was not sent.
type Outcome = Result<bool, String>;

impl Service for Calls {
    type Session = Slow;
    type Call = Reply<Outcome>;
    type Event = bool;

    fn call(&mut self, session: &mut Slow, _: Duration, reply: Reply<Outcome>) {
        session.unsent += 1;
        self.replies.push_back(reply);
    }

    fn event(&mut self, _: &mut Slow, answered: bool, _: &mut Reports<'_, bool>) {
        drop(self.replies.pop_front().unwrap().send(Ok(answered)));
    }

    async fn keep(&mut self, _: &mut Slow) -> io::Result<()> {
        match self.disk {
            Disk::Works => Ok(()),
            Disk::Fails => Err(io::Error::other("the disk is full")),
            Disk::Hangs => pending().await,
            Disk::Takes(time) => {
                sleep(time).await;
                Ok(())
            }
        }
    }

    fn give_up(&mut self, session: &mut Slow, why: &Arc<io::Error>, _: &mut Reports<'_, bool>) {
        session.unsent -= self.replies.len();
        for reply in core::mem::take(&mut self.replies) {
            self.refuse(reply, why);
        }
    }

    fn refuse(&mut self, reply: Reply<Outcome>, why: &Arc<io::Error>) {
        let _ = reply.send(Err(why.to_string()));
    }
}

/// The behaviour of a peer on a connection.
#[derive(Clone, Copy, PartialEq)]
enum Peer {
    /// Answers each byte after this time.
    Answers(Duration),
    /// Answers one byte, and closes the connection.
    AnswersOnce,
    Silent,
    /// Closes the connection after this time.
    Closes(Duration),
    /// No attempt to connect ends.
    Absent,
}

type Connecting = Pin<Box<dyn Future<Output = io::Result<DuplexStream>> + Send>>;
type Cell = (Handle<Calls>, Task<Calls, Dial<Box<dyn FnMut() -> Connecting + Send>>>, Arc<AtomicUsize>);

/// Returns a handle and its task, and the number of bytes that the peers get. The last peer stays.
fn cell(disk: Disk, peers: impl IntoIterator<Item = Peer>) -> Cell {
    let mut peers: VecDeque<_> = peers.into_iter().collect();
    let received = Arc::new(AtomicUsize::new(0));
    let counted = Arc::clone(&received);
    let dial = Dial(Box::new(move || {
        let peer = if peers.len() > 1 { peers.pop_front() } else { peers.front().copied() };
        let received = Arc::clone(&received);
        Box::pin(async move {
            let (near, far) = duplex(64);
            match peer.unwrap() {
                Peer::Absent => pending().await,
                peer => drop(tokio::spawn(serve(peer, far, received))),
            }
            Ok(near)
        }) as Connecting
    }) as Box<dyn FnMut() -> Connecting + Send>);
    let calls = Calls { replies: VecDeque::new(), disk };
    let (handle, task) = spawn(Slow::default(), calls, dial);
    (handle, task.reconnect(FAST), counted)
}

async fn serve(peer: Peer, mut pipe: DuplexStream, received: Arc<AtomicUsize>) {
    if let Peer::Closes(time) = peer {
        return sleep(time).await;
    }
    while let Ok(byte) = pipe.read_u8().await {
        received.fetch_add(1, SeqCst);
        if let Peer::Answers(time) = peer {
            sleep(time).await;
        }
        if peer != Peer::Silent {
            let _ = pipe.write_u8(byte).await;
        }
        if peer == Peer::AnswersOnce {
            return;
        }
    }
}

async fn ask(handle: &Handle<Calls>) -> Result<Outcome, Closed> {
    timeout(LONG, handle.call(|reply| reply)).await.expect("every call ends")
}

fn asking(handle: &Handle<Calls>) -> JoinHandle<Result<Outcome, Closed>> {
    let handle = handle.clone();
    tokio::spawn(async move { ask(&handle).await })
}

async fn timed<T>(future: impl Future<Output = T>) -> (T, Duration) {
    let begun = Instant::now();
    let value = timeout(LONG, future).await.expect("it ends");
    (value, begun.elapsed())
}

/// Asserts that a time is at most a connection and a pause later than expected.
fn assert_about(found: Duration, expected: Duration) {
    assert!((expected..expected + 260 * MS).contains(&found), "{found:?} is not {expected:?}");
}

#[tokio::test(start_paused = true)]
async fn a_call_waits_for_a_usable_connection_for_a_limited_time() {
    let closed = "the peer has closed the connection";
    for (peer, why) in [
        (Peer::Closes(Duration::ZERO), closed),
        (Peer::Closes(200 * MS), closed),
        (Peer::Absent, "there is no peer"),
    ] {
        let (handle, task, received) = cell(Disk::Works, [peer]);
        tokio::spawn(task.run());
        let (outcome, time) = timed(ask(&handle)).await;
        assert_eq!(outcome, Ok(Err(why.into())));
        assert_about(time, GIVE_UP_AFTER);
        assert_eq!(received.load(SeqCst), 0);
        // The next one has the whole time again.
        sleep(5 * S).await;
        let (outcome, time) = timed(ask(&handle)).await;
        assert_eq!(outcome, Ok(Err(why.into())));
        assert_about(time, GIVE_UP_AFTER - 5 * S);
    }
}

#[tokio::test(start_paused = true)]
async fn callers_beyond_the_room_for_calls_do_not_wait_longer() {
    let (handle, task, _) = cell(Disk::Works, [Peer::Absent]);
    tokio::spawn(task.run());
    let calls: Vec<_> = (0..100).map(|_| asking(&handle)).collect();
    let begun = Instant::now();
    for call in calls {
        assert_eq!(call.await.unwrap(), Ok(Err("there is no peer".into())));
    }
    assert_about(begun.elapsed(), GIVE_UP_AFTER);
}

#[tokio::test(start_paused = true)]
async fn a_call_that_was_given_up_is_not_sent_later() {
    let peers = [Peer::Closes(Duration::ZERO); 40].into_iter().chain([Peer::Answers(MS)]);
    let (handle, task, received) = cell(Disk::Works, peers);
    tokio::spawn(task.give_up_after(S).run());
    assert!(ask(&handle).await.unwrap().is_err());
    let mut outcome = ask(&handle).await;
    while outcome == Ok(Err("the peer has closed the connection".into())) {
        outcome = ask(&handle).await;
    }
    assert_eq!((outcome, received.load(SeqCst)), (Ok(Ok(true)), 1));
}

#[tokio::test(start_paused = true)]
async fn without_a_limit_a_call_waits() {
    let (handle, task, _) = cell(Disk::Works, [Peer::Closes(Duration::ZERO)]);
    tokio::spawn(task.give_up_after(Duration::MAX).run());
    assert!(timeout(100 * S, handle.call(|reply| reply)).await.is_err());
}

/// The task does not keep its processor busy.
#[tokio::test(start_paused = true)]
async fn with_a_limit_of_zero_a_call_fails_soon() {
    let (handle, task, _) = cell(Disk::Works, [Peer::Absent]);
    tokio::spawn(task.give_up_after(Duration::ZERO).run());
    let (outcome, time) = timed(ask(&handle)).await;
    assert_eq!(outcome, Ok(Err("there is no peer".into())));
    assert!(time < 50 * MS, "{time:?}");
    let runtime = tokio::runtime::Handle::current().metrics();
    let before = runtime.worker_park_count(0);
    sleep(S).await;
    let parked = runtime.worker_park_count(0) - before;
    assert!(parked < 300, "the task was woken {parked} times");
}

/// With a peer that closes each connection after its answer, twenty calls take longer than the limit.
#[tokio::test(start_paused = true)]
async fn a_connection_on_which_something_was_sent_gives_calls_their_time_again() {
    let (handle, task, _) = cell(Disk::Works, [Peer::AnswersOnce]);
    let pause = Reconnect { first: 3 * S, longest: 3 * S };
    tokio::spawn(task.reconnect(pause).run());
    let calls: Vec<_> = (0..20).map(|_| asking(&handle)).collect();
    let begun = Instant::now();
    for call in calls {
        assert_eq!(call.await.unwrap(), Ok(Ok(true)));
    }
    assert!(begun.elapsed() > 30 * S, "{:?}", begun.elapsed());
}

#[tokio::test(start_paused = true)]
async fn the_limit_begins_when_a_usable_connection_is_lost() {
    let (handle, task, _) = cell(Disk::Works, [Peer::AnswersOnce, Peer::Absent]);
    tokio::spawn(task.run());
    sleep(100 * S).await;
    // The first caller sends its byte itself, as the task sleeps.
    let ((first, second), time) = timed(async { tokio::join!(ask(&handle), ask(&handle)) }).await;
    assert_eq!(first, Ok(Ok(true)));
    assert_eq!(second, Ok(Err("the peer has closed the connection".into())));
    assert_about(time, GIVE_UP_AFTER);
    sleep(5 * S).await;
    let (outcome, time) = timed(ask(&handle)).await;
    assert_eq!(outcome, Ok(Err("the peer has closed the connection".into())));
    assert_about(time, GIVE_UP_AFTER - 5 * S);
}

#[tokio::test(start_paused = true)]
async fn a_call_whose_state_cannot_be_stored_ends() {
    // The task sends the first byte; later, while it sleeps, the caller does.
    for (asleep, quiet) in [(Duration::ZERO, 300 * MS), (S, Duration::ZERO)] {
        for (disk, time, why) in [
            (Disk::Fails, quiet, "the disk is full"),
            (Disk::Hangs, quiet + 2 * S, "the state was not stored in time"),
        ] {
            let (handle, task, received) = cell(disk, [Peer::Answers(MS)]);
            tokio::spawn(task.stall(2 * S).run());
            sleep(asleep).await;
            let (outcome, took) = timed(ask(&handle)).await;
            assert_eq!(outcome, Ok(Ok(false)), "its bytes were to be sent");
            assert_about(took, time);
            assert!(matches!(&*handle.link().borrow(), Link::Failed(error) if error.to_string() == why));
            assert_eq!(received.load(SeqCst), 0);
            assert_about(timed(handle.shutdown()).await.1, Duration::ZERO);
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_shutdown_waits_a_second_for_the_state_to_be_stored() {
    for (takes, expected) in [(500 * MS, 500 * MS), (2 * S, S), (LONG, S)] {
        let (handle, task, received) = cell(Disk::Takes(takes), [Peer::Answers(MS)]);
        tokio::spawn(task.stall(LONG).run());
        let call = asking(&handle);
        sleep(300 * MS + 5 * MS).await;
        let (_, time) = timed(handle.shutdown()).await;
        assert_about(time + 5 * MS, expected);
        assert_eq!(call.await.unwrap(), Ok(Ok(false)), "its bytes were to be sent");
        assert_eq!(received.load(SeqCst), 0);
    }
}

#[tokio::test(start_paused = true)]
async fn calls_in_progress_end_before_a_task_that_is_to_end() {
    let (handle, task, received) = cell(Disk::Works, [Peer::Answers(2 * S)]);
    let task = tokio::spawn(task.run());
    let calls = [asking(&handle), asking(&handle)];
    sleep(S).await;
    let ending = tokio::spawn({
        let handle = handle.clone();
        async move { timed(handle.shutdown_after(60 * S)).await.1 }
    });
    sleep(MS).await;
    assert_eq!(timed(ask(&handle)).await, (Err(Closed), Duration::ZERO), "it is a new one");
    assert!(matches!(&*handle.link().borrow(), Link::Connected));
    for call in calls {
        assert_eq!(call.await.unwrap(), Ok(Ok(true)));
    }
    assert_about(ending.await.unwrap(), 3600 * MS);
    assert_eq!(received.load(SeqCst), 2);
    assert!(task.is_finished() && matches!(&*handle.link().borrow(), Link::Ended));
}

#[tokio::test(start_paused = true)]
async fn a_task_that_is_to_end_does_so_in_time() {
    for peer in [Peer::Silent, Peer::Absent, Peer::Closes(100 * MS)] {
        let (handle, task, _) = cell(Disk::Works, [peer]);
        tokio::spawn(task.run());
        let call = asking(&handle);
        sleep(S).await;
        // The earliest of several counts, and a future that is dropped counts too.
        assert!(timeout(MS, handle.shutdown_after(5 * S)).await.is_err());
        let (_, time) = timed(handle.shutdown_after(LONG)).await;
        assert_about(time + MS, 5 * S);
        let lost = if peer == Peer::Silent { Ok(Ok(false)) } else { Err(Closed) };
        let outcome = call.await.unwrap();
        let is_refused = matches!(&outcome, Ok(Err(why)) if why.contains("has ended"));
        assert!(outcome == lost || is_refused, "{outcome:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_task_without_calls_ends_at_once() {
    for peer in [Peer::Silent, Peer::Absent, Peer::Closes(100 * MS)] {
        let (handle, task, _) = cell(Disk::Works, [peer]);
        tokio::spawn(task.run());
        sleep(S).await;
        assert_about(timed(handle.shutdown_after(LONG)).await.1, Duration::ZERO);
    }
    let (handle, task, _) = cell(Disk::Works, [Peer::Silent]);
    tokio::spawn(task.run());
    let call = asking(&handle);
    sleep(S).await;
    assert!(timeout(S, handle.shutdown_after(LONG)).await.is_err());
    assert_about(timed(handle.shutdown()).await.1, Duration::ZERO);
    assert_eq!(call.await.unwrap(), Ok(Ok(false)));
}

/// The caller makes the call itself while the task sleeps, and storing the state needs the runtime of the task.
#[test]
fn a_caller_may_be_without_a_runtime() {
    let (handle, task, received) = cell(Disk::Takes(MS), [Peer::Answers(MS)]);
    drop(task.thread().unwrap());
    for _ in 0..3 {
        let mut call = Box::pin(handle.call(|reply| reply));
        let mut context = Context::from_waker(Waker::noop());
        let outcome = loop {
            match call.as_mut().poll(&mut context) {
                Poll::Ready(outcome) => break outcome,
                Poll::Pending => std::thread::sleep(MS),
            }
        };
        assert_eq!(outcome, Ok(Ok(true)));
        // The next byte is due at once, by its caller.
        std::thread::sleep(310 * MS);
    }
    assert_eq!(received.load(SeqCst), 3);
}
