//! UDP sockets under the loop for std and under that for tokio.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the tests have sockets")]

use core::net::Ipv4Addr;
use core::ops::ControlFlow;
use core::time::Duration;
use std::io::{self, ErrorKind};
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::thread;

use crate::common::{Asker, Event};
use robot_session::{Driver, ReceiveOutcome, SendOutcome, Transport, Wait, is_lost_datagram, is_unsendable};

const LONG: Duration = Duration::from_secs(20);

#[test]
fn a_datagram_comes_whole_and_a_peer_that_is_not_there_is_silent() {
    let here = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let place = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap().local_addr().unwrap();
    here.connect(place).unwrap();
    let (mut driver, mut session, mut seen) = (Driver::new(here), Asker::new(&["one"]), Vec::new());
    session.timeout = Duration::from_millis(50);
    let mut turn = |session: &mut Asker| {
        let note = |_: &mut Asker, event| {
            seen.push(event);
            ControlFlow::<()>::Continue(())
        };
        assert!(driver.turn(session, Some(Duration::from_secs(5)), note).unwrap().is_continue());
        seen.len()
    };
    while turn(&mut session) < 1 {}
    let peer = UdpSocket::bind(place).unwrap();
    session.requests.push_back("two".into());
    session.timeout = Duration::from_secs(20);
    let answer = thread::spawn(move || {
        let mut line = [0; 9];
        let (length, from) = peer.recv_from(&mut line).unwrap();
        peer.send_to(&line[..length], from).unwrap();
    });
    while turn(&mut session) < 2 {}
    answer.join().unwrap();
    assert_eq!(seen, [Event::NoAnswer("one".into()), Event::Answer("two".into())]);
}

/// Windows reports a datagram that is too long as an error, other systems truncate it.
#[test]
fn a_datagram_that_is_too_long_is_not_the_end_of_the_socket() {
    let mut here = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let peer = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    here.connect(peer.local_addr().unwrap()).unwrap();
    peer.connect(here.local_addr().unwrap()).unwrap();
    peer.send(&[1; 100]).unwrap();
    peer.send(&[2; 9]).unwrap();
    let mut buffer = [0; 10];
    let wait = Wait::limited(Duration::from_secs(20));
    while here.receive(&mut buffer, wait).unwrap() != ReceiveOutcome::Bytes(9) {}
    assert_eq!(buffer[..9], [2; 9]);
    let kinds = [ErrorKind::ConnectionReset, ErrorKind::ConnectionRefused, ErrorKind::NotConnected];
    assert_eq!(kinds.map(|kind| is_lost_datagram(&kind.into())), [true, true, false]);
    assert_eq!(is_lost_datagram(&io::Error::from_raw_os_error(10040)), cfg!(windows), "its own number");
}

/// Otherwise a socket that nobody has connected would be as silent as a missing peer.
#[test]
fn what_no_socket_can_send_is_an_error() {
    let mut here = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    assert!(is_unsendable(&Transport::send(&mut here, &[1]).unwrap_err()), "it is not connected");
    here.connect(here.local_addr().unwrap()).unwrap();
    assert!(is_unsendable(&Transport::send(&mut here, &[1; 70_000]).unwrap_err()), "it is too long");
    assert_eq!(Transport::send(&mut here, &[1]).unwrap(), SendOutcome::Buffered);
    // After the first one the system knows that nobody is there.
    let nobody = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap().local_addr().unwrap();
    here.connect(nobody).unwrap();
    for _ in 0..3 {
        assert_eq!(Transport::send(&mut here, &[1]).unwrap(), SendOutcome::Buffered);
    }
    let kinds = [ErrorKind::InvalidInput, ErrorKind::NotConnected, ErrorKind::ConnectionRefused];
    assert_eq!(kinds.map(|kind| is_unsendable(&kind.into())), [true, true, false]);
}

/// Returns a socket that returns an error for every read, because it is not a datagram socket.
#[cfg(unix)]
fn no_datagrams() -> (UdpSocket, TcpStream) {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let peer = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    (UdpSocket::from(std::os::fd::OwnedFd::from(listener)), peer)
}

#[cfg(unix)]
#[test]
fn an_error_of_a_socket_itself_is_no_lost_datagram() {
    let (mut socket, _peer) = no_datagrams();
    let error = socket.receive(&mut [0; 8], Wait::limited(LONG)).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::NotConnected);
}

#[cfg(feature = "tokio")]
mod with_tokio {
    use robot_session::tokio::{Connector as _, Datagrams, Udp, UdpListen};
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
    use tokio::time::timeout;

    use super::*;

    #[tokio::test]
    async fn a_lost_datagram_and_an_empty_one_are_skipped_by_a_read() {
        let place = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap().local_addr().unwrap();
        let mut here = Udp::new((Ipv4Addr::LOCALHOST, 0).into(), place.to_string()).connect().await.unwrap();
        let address = here.local_addr().unwrap();
        assert_eq!(here.write(b"lost").await.unwrap(), 4, "nobody is there");
        let peer = UdpSocket::bind(place).unwrap();
        peer.send_to(&[], address).unwrap();
        peer.send_to(b"found", address).unwrap();
        let mut buffer = [0; 16];
        assert_eq!(timeout(LONG, here.read(&mut buffer)).await.unwrap().unwrap(), 5);
        assert_eq!(&buffer[..5], b"found");
    }

    /// A robot that sends first: its port is not known before.
    #[tokio::test]
    async fn the_sender_of_the_first_datagram_that_is_accepted_is_the_peer() {
        let place = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let address = place.local_addr().unwrap();
        let mut listen = UdpListen::at(address.to_string(), |first: &[u8]| first.starts_with(b"robot"));
        // Another socket has the port.
        let error = listen.connect().await.unwrap_err();
        let why = format!("cannot listen at {address}: ");
        assert!(error.kind() == ErrorKind::AddrInUse && error.to_string().starts_with(&why), "{error}");
        drop(place);
        let stranger = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let robots = [(), ()].map(|()| UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap());
        for robot in robots {
            let sent = [(&stranger, "noise"), (&robot, "robot 1"), (&stranger, "robot"), (&robot, "2")];
            // The connector listens from its first poll on.
            let sends = async {
                for (from, bytes) in sent {
                    from.send_to(bytes.as_bytes(), address).unwrap();
                }
            };
            let (here, ()) = tokio::join!(timeout(LONG, listen.connect()), sends);
            let mut here = here.unwrap().unwrap();
            assert_eq!(listen.peer(), Some(robot.local_addr().unwrap().to_string()));
            let mut buffer = [0; 16];
            for expected in ["robot 1", "2"] {
                let length = timeout(LONG, here.read(&mut buffer)).await.unwrap().unwrap();
                assert_eq!(&buffer[..length], expected.as_bytes());
            }
            assert_eq!(here.write(b"answer").await.unwrap(), 6);
            assert_eq!(robot.recv(&mut buffer).unwrap(), 6);
        }
    }

    #[cfg(unix)]
    #[tokio::test]
    async fn an_error_of_a_socket_itself_ends_a_read() {
        let (socket, _peer) = no_datagrams();
        socket.set_nonblocking(true).unwrap();
        let mut here = Datagrams::from(tokio::net::UdpSocket::from_std(socket).unwrap());
        let error = timeout(LONG, here.read(&mut [0; 8])).await.unwrap().unwrap_err();
        assert_eq!(error.kind(), ErrorKind::NotConnected);
    }
}
