//! A server, and the reports to its observer.

use core::net::SocketAddr;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use core::time::Duration;
use std::io::{self, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};

use cellwire_sim::host::{Listener, Notice, Server};
use cellwire_sim::{Device, Peer, Settings as _, Simulator};
use socket2::{Domain, SockRef, Socket, Type};

use crate::gadget::{Gadget, Line};

pub(crate) const LIMIT: Duration = Duration::from_secs(20);
pub(crate) const MS: Duration = Duration::from_millis(1);

/// A server in a thread, which is stopped when this is dropped. Its clock advances only when it is set.
pub(crate) struct Host {
    address: SocketAddr,
    notices: Receiver<String>,
    /// The server waits for it with each notice.
    gate: Arc<Mutex<()>>,
    clock: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<io::Result<()>>>,
}

impl Host {
    pub(crate) fn new<D>(
        simulator: Simulator<D>,
        idle_timeout: Option<Duration>,
        listens: impl FnOnce(Listener) -> Listener,
    ) -> Self
    where
        D: Device<Session = Line> + Send + 'static,
    {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        // For clients that do not read: each connection has a small buffer.
        SockRef::from(&listener).set_send_buffer_size(4096).unwrap();
        let address = listener.local_addr().unwrap();
        let listener = listens(Listener::new(listener).unwrap());
        let (sender, notices) = channel();
        let (gate, clock, stop) = <(Arc<Mutex<()>>, Arc<AtomicU64>, Arc<AtomicBool>)>::default();
        let (opened, time, stopped) = (Arc::clone(&gate), Arc::clone(&clock), Arc::clone(&stop));
        let thread = thread::spawn(move || {
            let clock = move || Duration::from_millis(time.load(Ordering::Relaxed));
            let server = Server { idle_timeout, ..Server::new(listener, clock) };
            server.run(
                simulator,
                || !stopped.load(Ordering::Relaxed),
                |simulator, notice| {
                    drop(opened.lock());
                    let told = match notice {
                        Notice::Connected(peer) => {
                            let certificate = &simulator.device().session().certificate;
                            format!("{peer} connected{}", certificate.escape_ascii())
                        }
                        Notice::Refused(peer, why) => format!("{peer} refused: {why}"),
                        Notice::Received(_, bytes) => format!("received {}", bytes.escape_ascii()),
                        Notice::Sent(_, bytes) => format!("sent {}", bytes.escape_ascii()),
                        Notice::Disconnected(peer, ending) => format!("{peer} disconnected: {ending}"),
                        _ => return Ok(()),
                    };
                    // The test has seen enough.
                    let _ = sender.send(told);
                    Ok(())
                },
            )
        });
        Self { address, notices, gate, clock, stop, thread: Some(thread) }
    }

    /// Creates a host of a device that serves several clients.
    pub(crate) fn of(line: Line, idle_timeout: Option<Duration>) -> Self {
        Self::new(Simulator::new(Gadget { line, ..Gadget::default() }), idle_timeout, |listener| listener)
    }

    /// Connects a client with a small buffer.
    pub(crate) fn connect(&self) -> (TcpStream, String) {
        let client = Socket::new(Domain::IPV4, Type::STREAM, None).unwrap();
        client.set_recv_buffer_size(4096).unwrap();
        client.connect(&self.address.into()).unwrap();
        let client = TcpStream::from(client);
        client.set_read_timeout(Some(LIMIT)).unwrap();
        let name = client.local_addr().unwrap().to_string();
        (client, name)
    }

    pub(crate) fn next(&self) -> String {
        self.notices.recv_timeout(LIMIT).unwrap()
    }

    /// Returns the next bytes that are received, this many at least.
    pub(crate) fn received(&self, length: usize) -> String {
        let mut received = String::new();
        while received.len() < length {
            received.push_str(self.next().strip_prefix("received ").unwrap());
        }
        received
    }

    pub(crate) fn set_clock(&self, now: Duration) {
        self.clock.store(now.as_millis().try_into().unwrap(), Ordering::Relaxed);
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // A test that fails does not wait for a server that may hang.
        if !thread::panicking() {
            drop(TcpStream::connect(self.address)); // wakes it
            self.thread.take().unwrap().join().unwrap().unwrap();
        }
    }
}

#[test]
fn the_observer_is_told_who_comes_what_arrives_and_who_goes() {
    let host = Host::of(Line::default(), None);
    let (mut first, a) = host.connect();
    assert_eq!(host.next(), format!("{a} connected"));
    let (second, b) = host.connect();
    assert_eq!(host.next(), format!("{b} connected"), "this device serves several");
    first.write_all(b"AB").unwrap();
    assert_eq!(host.next(), "received AB");
    drop(second);
    assert_eq!(host.next(), format!("{b} disconnected: the client closed the connection"));
}

#[test]
fn a_new_client_replaces_the_one_before_if_the_device_serves_one() {
    let line = Line::sending(&[(Duration::ZERO, "CD")]);
    let host = Host::new(Peer(line).simulator().unwrap(), None, |listener| listener);
    let (mut first, a) = host.connect();
    first.read_exact(&mut [0; 2]).unwrap();
    assert_eq!([host.next(), host.next()], [format!("{a} connected"), "sent CD".to_owned()]);
    let (_second, b) = host.connect();
    assert_eq!(host.next(), format!("{a} disconnected: another client has connected"));
    assert_eq!(host.next(), format!("{b} connected"));
    assert_eq!(first.read(&mut [0]).unwrap(), 0);
}

#[test]
fn a_silent_client_is_disconnected() {
    let host = Host::of(Line::default(), Some(100 * MS));
    let (mut client, name) = host.connect();
    assert_eq!(host.next(), format!("{name} connected"));
    let (_second, other) = host.connect();
    assert_eq!(host.next(), format!("{other} connected"), "it is not disconnected before its time");
    host.set_clock(100 * MS);
    assert_eq!(client.read(&mut [0]).unwrap(), 0);
    assert_eq!(host.next(), format!("{name} disconnected: the client sends nothing for 0.1 s"));
}

/// Both are one event: no other tells of the rest.
#[test]
fn what_a_client_has_sent_is_read_to_its_end() {
    let host = Host::of(Line::default(), None);
    for sent in ["AB", &"CDEFGHIJ".repeat(100)] {
        let held = host.gate.lock().unwrap();
        let (mut client, name) = host.connect();
        client.write_all(sent.as_bytes()).unwrap();
        if sent == "AB" {
            client.shutdown(std::net::Shutdown::Write).unwrap();
        }
        drop(held);
        assert_eq!(host.next(), format!("{name} connected"));
        assert_eq!(host.received(sent.len()), sent);
        drop(client);
        assert_eq!(host.next(), format!("{name} disconnected: the client closed the connection"));
    }
}

#[test]
fn a_frozen_device_does_not_read() {
    let simulator = Simulator::new(Gadget::default());
    simulator.faults().freeze(50 * MS);
    let host = Host::new(simulator, None, |listener| listener);
    let (mut first, a) = host.connect();
    assert_eq!(host.next(), format!("{a} connected"));
    first.write_all(b"AB").unwrap();
    let (_second, b) = host.connect();
    assert_eq!(host.next(), format!("{b} connected"), "the bytes that came before are not read");
    host.set_clock(50 * MS);
    assert_eq!(host.next(), "received AB");
}

/// A line whose messages fill the buffers of the system and then those of the server.
pub(crate) fn much(count: usize) -> Line {
    const TEXT: &str = "0123456789012345678901234567890123456789012345678901234567890123";
    Line { sends: core::iter::repeat_n((Duration::ZERO, TEXT), count).collect(), ..Line::default() }
}
