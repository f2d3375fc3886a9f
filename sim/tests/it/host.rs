//! A server, and the reports to its observer.

use core::net::SocketAddr;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::io::{self, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::thread::{self, JoinHandle};
use std::time::Instant;

use cellwire_sim::host::{Listener, Notice, Server};
use cellwire_sim::{Peer, Settings as _, Simulator};

use crate::gadget::{Gadget, Line};

const S: Duration = Duration::from_secs(1);

/// A server in a thread, which is stopped when this is dropped.
struct Host {
    address: SocketAddr,
    notices: Receiver<String>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<io::Result<()>>>,
}

impl Host {
    fn new<D>(simulator: Simulator<D>, idle_timeout: Option<Duration>) -> Self
    where
        D: cellwire_sim::Device + Send + 'static,
    {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let (listener, begun) = (Listener::new(listener).unwrap(), Instant::now());
        let look = Some(Duration::from_millis(5));
        let (sender, notices) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = thread::spawn(move || {
            let server = Server { idle_timeout, look, ..Server::new(listener, move || begun.elapsed()) };
            server.run(
                simulator,
                || !stopped.load(Ordering::Relaxed),
                |_, notice| {
                    let told = match notice {
                        Notice::Connected(peer) => format!("{peer} connected"),
                        Notice::Refused(peer, why) => format!("{peer} refused: {why}"),
                        Notice::Received(_, bytes) => format!("received {bytes:?}"),
                        Notice::Sent(_, bytes) => format!("sent {bytes:?}"),
                        Notice::Disconnected(peer, ending) => format!("{peer} disconnected: {ending}"),
                        _ => return Ok(()),
                    };
                    // The test has seen enough.
                    let _ = sender.send(told);
                    Ok(())
                },
            )
        });
        Self { address, notices, stop, thread: Some(thread) }
    }

    fn connect(&self) -> (TcpStream, String) {
        let client = TcpStream::connect(self.address).unwrap();
        client.set_read_timeout(Some(20 * S)).unwrap();
        let name = client.local_addr().unwrap().to_string();
        (client, name)
    }

    fn next(&self) -> String {
        self.notices.recv_timeout(20 * S).unwrap()
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap().unwrap();
    }
}

#[test]
fn the_observer_is_told_who_comes_what_arrives_and_who_goes() {
    let host = Host::new(Simulator::new(Gadget::default()), None);
    let ((mut first, a), (second, b)) = (host.connect(), host.connect());
    let mut both = [host.next(), host.next()];
    both.sort();
    let mut expected = [format!("{a} connected"), format!("{b} connected")];
    expected.sort();
    assert_eq!(both, expected, "this device serves several");
    first.write_all(b"AB").unwrap();
    assert_eq!(host.next(), "received [65, 66]");
    drop(second);
    assert_eq!(host.next(), format!("{b} disconnected: the client closed the connection"));
}

#[test]
fn a_new_client_replaces_the_one_before_if_the_device_serves_one() {
    let line = Line::sending(&[(Duration::ZERO, "CD")]);
    let host = Host::new(Peer(line).simulator().unwrap(), None);
    let (mut first, a) = host.connect();
    first.read_exact(&mut [0; 2]).unwrap();
    assert_eq!([host.next(), host.next()], [format!("{a} connected"), "sent [67, 68]".to_owned()]);
    let (_second, b) = host.connect();
    assert_eq!(host.next(), format!("{a} disconnected: another client has connected"));
    assert_eq!(host.next(), format!("{b} connected"));
    assert_eq!(first.read(&mut [0]).unwrap(), 0);
}

#[test]
fn a_silent_client_is_disconnected() {
    let host = Host::new(Simulator::new(Gadget::default()), Some(Duration::from_millis(200)));
    let (mut client, name) = host.connect();
    assert_eq!(host.next(), format!("{name} connected"));
    assert_eq!(client.read(&mut [0]).unwrap(), 0);
    assert_eq!(host.next(), format!("{name} disconnected: the client sends nothing for 0.2 s"));
}
