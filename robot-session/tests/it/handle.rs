//! A session in a task of its own: connections of every kind, and the outcomes of calls.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the tests have sockets")]

use core::future::Future;
use core::net::SocketAddr;
use core::sync::atomic::{AtomicUsize, Ordering};
use core::time::Duration;
use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::time::Instant;

use crate::common::echo::Echo;
use crate::common::{Asker, Event};
use crate::reporting::Reporting;
use robot_session::Session;
use robot_session::tokio::{
    Connector, Dial, Handle, Link, Listen, Reconnect, Reply, Reports, Service, Tcp, Udp, serve, spawn,
};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream};
use tokio::net::{TcpListener, TcpStream, UdpSocket};
use tokio::time::{sleep, timeout};

const LONG: Duration = Duration::from_secs(20);
const MS: Duration = Duration::from_millis(1);
const FAST: Reconnect = Reconnect { first: Duration::from_millis(5), longest: Duration::from_millis(20) };

/// Asks; an answer is `Ok`.
#[derive(Default)]
struct Asking(VecDeque<Reply<Result<String, String>>>);

#[derive(Debug)]
struct Ask(&'static str, Reply<Result<String, String>>);

impl Service for Asking {
    type Session = Asker;
    type Call = Ask;
    type Event = Event;

    fn has_room(&self, _: &Asker) -> bool {
        self.0.is_empty()
    }

    fn call(&mut self, session: &mut Asker, _: Duration, Ask(text, reply): Ask) {
        session.requests.push_back(text.into());
        self.0.push_back(reply);
    }

    fn event(&mut self, _: &mut Asker, event: Event, reports: &mut Reports<'_, Event>) {
        let outcome = match &event {
            Event::Answer(text) if text == "broken" => {
                reports.reconnect(io::Error::other("the peer makes no sense"));
                Ok(text.clone())
            }
            Event::Answer(text) => Ok(text.clone()),
            Event::NoAnswer(text) => Err(text.clone()),
            _ => return reports.event(event),
        };
        if self.0.pop_front().unwrap().send(outcome).is_err() {
            reports.event(event);
        }
    }

    fn refuse(&mut self, Ask(_, reply): Ask, why: &Arc<io::Error>) {
        let _ = reply.send(Err(why.to_string()));
    }
}

fn run<C: Connector + 'static>(connector: C) -> Handle<Asking> {
    let (handle, task) = spawn(Asker::new(&[]), Asking::default(), connector);
    tokio::spawn(task.reconnect(FAST).run());
    handle
}

async fn ask(handle: &Handle<Asking>, text: &'static str) -> Result<String, String> {
    timeout(LONG, handle.call(|reply| Ask(text, reply))).await.expect("an outcome").unwrap()
}

async fn echo(mut stream: TcpStream) {
    let mut bytes = [0; 16];
    while let Ok(length @ 1..) = stream.read(&mut bytes).await {
        if stream.write_all(&bytes[..length]).await.is_err() {
            return;
        }
    }
}

fn any() -> SocketAddr {
    SocketAddr::from(([127, 0, 0, 1], 0))
}

#[tokio::test]
async fn a_later_peer_takes_the_place_of_an_earlier_one() {
    let listen = Listen::bind(any()).await.unwrap();
    let address = listen.address().unwrap();
    let handle = run(listen);
    let mut silent = TcpStream::connect(address).await.unwrap();
    let unanswered = tokio::spawn({
        let handle = handle.clone();
        async move { ask(&handle, "one").await }
    });
    let mut line = [0; 4];
    silent.read_exact(&mut line).await.unwrap();
    assert_eq!(&line, b"one\n");
    tokio::spawn(echo(TcpStream::connect(address).await.unwrap()));
    assert_eq!(unanswered.await.unwrap(), Err("one".into()), "it ends with its connection");
    assert_eq!(silent.read(&mut line).await.unwrap_or(0), 0, "the first one is closed");
    assert_eq!(ask(&handle, "two").await, Ok("two".into()));
}

/// A listening end does not wait before it takes the next peer: the pause is for ends that dial.
#[tokio::test]
async fn a_peer_that_is_back_at_once_is_taken_at_once() {
    let listen = Listen::bind(any()).await.unwrap();
    let address = listen.address().unwrap();
    let (handle, task) = spawn(Asker::new(&[]), Asking::default(), listen);
    tokio::spawn(task.reconnect(Reconnect { first: LONG, longest: LONG }).run());
    for _ in 0..20 {
        let stream = TcpStream::connect(address).await.unwrap();
        timeout(LONG / 2, handle.connected()).await.unwrap().unwrap();
        drop(stream);
        let mut link = handle.link();
        link.wait_for(|link| matches!(link, Link::Failed(_))).await.unwrap();
    }
}

#[tokio::test]
async fn an_address_that_is_in_use_is_listened_at_when_it_is_free() {
    let other = std::net::TcpListener::bind(any()).unwrap();
    let address = other.local_addr().unwrap();
    let listen = Listen::at(address.to_string());
    assert_eq!(listen.address().unwrap_err().kind(), io::ErrorKind::NotConnected);
    let handle = run(listen);
    let mut link = handle.link();
    let link =
        timeout(LONG, link.wait_for(|link| matches!(link, Link::Failed(_)))).await.unwrap().unwrap().clone();
    let Link::Failed(why) = link else { unreachable!() };
    assert!(why.to_string().starts_with(&format!("cannot listen at {address}: ")), "{why}");
    drop(other);
    let stream = loop {
        match TcpStream::connect(address).await {
            Ok(stream) => break stream,
            Err(_) => sleep(MS).await,
        }
    };
    tokio::spawn(echo(stream));
    assert_eq!(ask(&handle, "one").await, Ok("one".into()));
}

/// Peers beyond the limit wait, and are served in the sequence in which they came.
#[tokio::test]
async fn a_listener_serves_so_many_peers_at_a_time() {
    async fn ask(peer: &mut TcpStream) {
        let mut answer = [0];
        peer.write_all(b"x").await.unwrap();
        timeout(LONG, peer.read_exact(&mut answer)).await.unwrap().unwrap();
        assert_eq!(&answer, b"x");
    }

    let listener = TcpListener::bind(any()).await.unwrap();
    let address = listener.local_addr().unwrap();
    let mut peers = VecDeque::new();
    for _ in 0..5 {
        peers.push_back(TcpStream::connect(address).await.unwrap());
    }
    let begun = Arc::new(AtomicUsize::new(0));
    let counted = Arc::clone(&begun);
    let session = move |_| {
        counted.fetch_add(1, Ordering::SeqCst);
        Echo::new(Duration::ZERO)
    };
    let serving = tokio::spawn(serve(listener, 2, session, |_, _, _| {}));
    for gone in 0..4 {
        ask(&mut peers[0]).await;
        ask(&mut peers[1]).await;
        assert_eq!(begun.load(Ordering::SeqCst), gone + 2);
        peers.pop_front();
    }
    serving.abort();
}

/// The second socket stands for a peer that was lost before it was accepted: no other error of the system ends the listener.
#[cfg(unix)]
#[tokio::test(start_paused = true)]
async fn a_listener_goes_on_until_it_is_none_any_more() {
    use socket2::{Domain, Socket, Type};
    let serving = |kind| {
        let socket = Socket::new(Domain::IPV4, kind, None).unwrap();
        socket.bind(&any().into()).unwrap();
        socket.set_nonblocking(true).unwrap();
        if kind == Type::DGRAM {
            socket.send_to(b"x", &socket.local_addr().unwrap()).unwrap();
        }
        let listener = TcpListener::from_std(std::os::fd::OwnedFd::from(socket).into()).unwrap();
        timeout(LONG, serve(listener, 1, |_| Echo::new(Duration::ZERO), |_, _, _| {}))
    };
    let error = serving(Type::STREAM).await.unwrap().unwrap_err();
    assert_eq!(error.kind(), io::ErrorKind::InvalidInput, "it does not listen");
    assert!(serving(Type::DGRAM).await.is_err(), "it is tried again and again");
}

#[tokio::test]
async fn datagrams_go_to_a_peer_that_comes_later() {
    let socket = UdpSocket::bind(any()).await.unwrap();
    let peer = socket.local_addr().unwrap();
    drop(socket);
    let handle = run(Udp::new(any(), peer.to_string()));
    let mut events = handle.events();
    // The peer is absent: that is not an error of a datagram.
    let lost = tokio::spawn({
        let handle = handle.clone();
        async move { handle.call(|reply| Ask("lost", reply)).await }
    });
    sleep(100 * MS).await;
    let socket = UdpSocket::bind(peer).await.unwrap();
    lost.abort();
    tokio::spawn(async move {
        let mut bytes = [0; 16];
        loop {
            let (length, from) = socket.recv_from(&mut bytes).await.unwrap();
            socket.send_to(&[], from).await.unwrap(); // an empty one is ignored
            socket.send_to(&bytes[..length], from).await.unwrap();
        }
    });
    // The session sends one request after the other, and has no answer to the first.
    handle.shutdown().await;
    let reported: Vec<_> = core::iter::from_fn(|| events.try_recv().ok()).collect();
    let lost = Event::NoAnswer("lost".into());
    assert_eq!(
        reported,
        [Event::Connected, lost, Event::Disconnected],
        "whoever has gone is told by an event"
    );
    let handle = run(Udp::new(any(), peer.to_string()));
    assert_eq!(ask(&handle, "two").await, Ok("two".into()));
}

const RECONNECT: Reconnect =
    Reconnect { first: Duration::from_millis(10), longest: Duration::from_millis(160) };
const NO_ROBOT: &str = "no such robot";

#[tokio::test(start_paused = true)]
async fn attempts_come_less_and_less_often_and_calls_fail_with_them() {
    let attempts = Arc::new(AtomicUsize::new(0));
    let counted = Arc::clone(&attempts);
    let dial = Dial(move || {
        counted.fetch_add(1, Ordering::SeqCst);
        async { Err::<DuplexStream, _>(io::Error::other(NO_ROBOT)) }
    });
    let (handle, task) = spawn(Asker::new(&[]), Asking::default(), dial);
    let task = tokio::spawn(task.reconnect(RECONNECT).run());
    for _ in 0..10 {
        assert_eq!(ask(&handle, "one").await, Err(NO_ROBOT.into()));
    }
    attempts.store(0, Ordering::SeqCst);
    assert!(timeout(100_000 * MS, handle.connected()).await.is_err());
    // Half of the longest delay at least, and all of it at most: 120 ms on average.
    let attempts = attempts.load(Ordering::SeqCst);
    assert!((780..=890).contains(&attempts), "{attempts}");
    assert!(matches!(&*handle.link().borrow(), Link::Failed(why) if why.to_string() == NO_ROBOT));
    // Without a handle there is nothing more to do.
    drop(handle);
    let session = timeout(LONG, task).await.unwrap().unwrap();
    assert_eq!(session.statistics(), 0);
}

/// Returns the number of connections in 100 s, when each ends after this time.
async fn connections(life: Duration) -> usize {
    let attempts = Arc::new(AtomicUsize::new(0));
    let counted = Arc::clone(&attempts);
    let dial = Dial(move || {
        counted.fetch_add(1, Ordering::SeqCst);
        let (near, far) = tokio::io::duplex(64);
        tokio::spawn(async move {
            sleep(life).await;
            drop(far);
        });
        async { Ok(near) }
    });
    let (handle, task) = spawn(Asker::new(&[]), Asking::default(), dial);
    tokio::spawn(task.reconnect(RECONNECT).run());
    sleep(100_000 * MS).await;
    drop(handle);
    attempts.load(Ordering::SeqCst)
}

#[tokio::test(start_paused = true)]
async fn a_connection_that_lasts_is_replaced_at_once_and_one_that_does_not_with_delay() {
    let short = connections(Duration::ZERO).await;
    assert!((780..=890).contains(&short), "{short}");
    let long = connections(1000 * MS).await;
    assert!((99..=100).contains(&long), "{long}");
}

#[tokio::test(start_paused = true)]
async fn a_peer_that_reads_nothing_is_given_up() {
    let mut open = Vec::new();
    let dial = Dial(move || {
        let (near, far) = tokio::io::duplex(4);
        open.push(far);
        async { Ok(near) }
    });
    let (handle, task) = spawn(Asker::new(&[]), Asking::default(), dial);
    tokio::spawn(task.stall(100 * MS).reconnect(RECONNECT).run());
    let _outcome = handle.begin(|reply| Ask("1234567", reply)).await.unwrap();
    let mut link = handle.link();
    let failed = link.wait_for(|link| matches!(link, Link::Failed(_)));
    let failed = timeout(200 * MS, failed).await.unwrap().unwrap().clone();
    assert!(matches!(failed, Link::Failed(why) if why.to_string() == "the peer does not read"));
}

#[tokio::test(start_paused = true)]
async fn a_peer_that_reads_slowly_is_kept() {
    let dial = Dial(|| {
        let (near, mut far) = tokio::io::duplex(4);
        tokio::spawn(async move {
            while far.read_u8().await.is_ok() {
                sleep(60 * MS).await;
            }
        });
        async { Ok(near) }
    });
    let (handle, task) = spawn(Asker::new(&["1234567"]), Asking::default(), dial);
    tokio::spawn(task.stall(100 * MS).run());
    let mut link = handle.link();
    let failed = link.wait_for(|link| matches!(link, Link::Failed(_)));
    assert!(timeout(1000 * MS, failed).await.is_err());
}

#[tokio::test]
async fn a_peer_that_makes_no_sense_is_connected_again() {
    let listener = TcpListener::bind(any()).await.unwrap();
    let handle = run(Tcp::new(listener.local_addr().unwrap().to_string()));
    let connections = Arc::new(AtomicUsize::new(0));
    let counted = Arc::clone(&connections);
    tokio::spawn(async move {
        loop {
            let (stream, _) = listener.accept().await.unwrap();
            counted.fetch_add(1, Ordering::SeqCst);
            tokio::spawn(echo(stream));
        }
    });
    assert_eq!(ask(&handle, "one").await, Ok("one".into()));
    assert_eq!(ask(&handle, "broken").await, Ok("broken".into()));
    assert_eq!(ask(&handle, "two").await, Ok("two".into()));
    assert_eq!(connections.load(Ordering::SeqCst), 2);
}

/// Calls are made in the sequence in which they came. Calls to a peer that does not read wait until the connection ends.
#[tokio::test]
async fn calls_are_made_in_the_order_in_which_they_came() {
    let (near, far) = tokio::io::duplex(4);
    let mut pipes = vec![near];
    let handle = run(Dial(move || {
        let pipe = pipes.pop().ok_or_else(|| io::Error::other("no more pipes"));
        async { pipe }
    }));
    handle.connected().await.unwrap();
    let calls = ["a", "b", "c", "d", "e", "f"].map(|text| {
        let handle = handle.clone();
        Box::pin(async move { handle.call(|reply| Ask(text, reply)).await })
    });
    let mut calls: Vec<_> = calls.into_iter().map(tokio::spawn).collect();
    let mut far = far;
    for text in ["a", "b", "c", "d"] {
        let mut line = [0; 2];
        timeout(LONG, far.read_exact(&mut line)).await.unwrap().unwrap();
        assert_eq!(&line[..1], text.as_bytes());
        far.write_all(&line).await.unwrap();
        assert_eq!(calls.remove(0).await.unwrap().unwrap(), Ok(text.into()));
    }
    drop(far);
    for call in calls {
        let outcome = timeout(LONG, call).await.unwrap().unwrap();
        assert!(matches!(outcome, Ok(Err(_))), "{outcome:?}");
    }
}

#[tokio::test]
async fn a_call_that_waits_when_a_connection_is_lost_is_made_on_the_next_one() {
    let (near, mut far) = tokio::io::duplex(64);
    let (next, mut far_of_next) = tokio::io::duplex(64);
    let mut pipes = vec![next, near];
    let handle = run(Dial(move || {
        let pipe = pipes.pop().ok_or_else(|| io::Error::other("no more pipes"));
        async { pipe }
    }));
    let first = handle.begin(|reply| Ask("one", reply)).await.unwrap();
    let second = handle.begin(|reply| Ask("two", reply)).await.unwrap();
    let mut line = [0; 4];
    timeout(LONG, far.read_exact(&mut line)).await.unwrap().unwrap();
    drop(far);
    assert_eq!(timeout(LONG, first).await.unwrap(), Ok(Err("one".into())));
    timeout(LONG, far_of_next.read_exact(&mut line)).await.unwrap().unwrap();
    far_of_next.write_all(&line).await.unwrap();
    assert_eq!(timeout(LONG, second).await.unwrap(), Ok(Ok("two".into())));
}

/// Reports the number that its caller has set, when it is looked at.
struct Looks(Arc<AtomicUsize>, usize);

impl Session for Looks {
    type Event = usize;
    type Statistics = ();
    const MAX_INPUT: usize = 1;
    const MAX_TRANSMIT: usize = 1;
    fn handle_connected(&mut self, _: Duration) {}
    fn handle_disconnected(&mut self, _: Duration) {}
    fn handle_input(&mut self, _: Duration, _: &[u8]) {}
    fn handle_timeout(&mut self, _: Duration) {}
    fn poll_event(&mut self) -> Option<usize> {
        let set = self.0.load(Ordering::SeqCst);
        (core::mem::replace(&mut self.1, set) != set).then_some(set)
    }
    fn poll_transmit(&mut self, _: Duration, _: &mut [u8]) -> Option<usize> {
        None
    }
    fn poll_timeout(&self) -> Option<Duration> {
        None
    }
    fn statistics(&self) {}
}

#[tokio::test(start_paused = true)]
async fn a_wake_makes_the_session_look_at_what_is_neither_bytes_nor_time() {
    let set = Arc::new(AtomicUsize::new(0));
    let (near, _far) = tokio::io::duplex(4);
    let mut pipes = vec![near];
    let dial = Dial(move || {
        let pipe = pipes.pop().ok_or_else(|| io::Error::other("no more pipes"));
        async { pipe }
    });
    let (handle, task) = spawn(Looks(Arc::clone(&set), 0), Reporting::NEW, dial);
    tokio::spawn(task.run());
    handle.connected().await.unwrap();
    let mut events = handle.events();
    for value in [1, 2] {
        set.store(value, Ordering::SeqCst);
        assert!(timeout(LONG, events.recv()).await.is_err(), "nothing makes it look");
        handle.waker().wake();
        assert_eq!(timeout(LONG, events.recv()).await.unwrap(), Ok(value));
    }
}

#[tokio::test]
async fn a_handle_and_its_task_show_what_they_are_about() {
    let (handle, task) = spawn(Asker::new(&[]), Asking::default(), Tcp::new("127.0.0.1:1"));
    assert_eq!(format!("{handle:?}"), "Handle { link: Connecting, .. }");
    assert_eq!(
        format!("{:?}", task.reconnect(FAST)),
        "Task { reconnect: Reconnect { first: 5ms, longest: 20ms }, .. }"
    );
    let ask = |reply| {
        let call = Ask("one", reply);
        assert_eq!(format!("{call:?}"), r#"Ask("one", Reply)"#);
        call
    };
    let closed = handle.begin(ask).await.unwrap_err();
    assert_eq!(closed.to_string(), "the task of the session has ended");
}

/// The call is only polled, and never waits for a runtime of its caller.
#[test]
fn a_thread_ends_with_the_last_handle() {
    let (handle, task) = spawn(Asker::new(&[]), Asking::default(), Tcp::new("127.0.0.1:1"));
    let thread = task.reconnect(FAST).thread().unwrap();
    let mut call = Box::pin(handle.call(|reply| Ask("one", reply)));
    let mut context = core::task::Context::from_waker(core::task::Waker::noop());
    let begun = Instant::now();
    while call.as_mut().poll(&mut context).is_pending() {
        assert!(begun.elapsed() < LONG);
        std::thread::sleep(MS);
    }
    drop(call);
    drop(handle);
    drop(thread.join().unwrap());
}
