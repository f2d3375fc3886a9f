//! The connectors: the options of their connections, and the names of their peers.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the tests have sockets")]

use core::net::SocketAddr;
use core::time::Duration;
use std::io;

use robot_session::tokio::{Connector, Dial, Listen, Tcp, Udp};
use socket2::SockRef;
use tokio::io::{DuplexStream, duplex};
use tokio::net::TcpStream;

const MS: Duration = Duration::from_millis(1);

fn any() -> SocketAddr {
    SocketAddr::from(([127, 0, 0, 1], 0))
}

/// The system of a peer that accepts nobody answers no more than the first.
#[cfg(target_os = "linux")]
#[tokio::test(start_paused = true)]
async fn an_attempt_takes_no_longer_than_it_may() {
    use socket2::{Domain, Socket, Type};
    let socket = || Socket::new(Domain::IPV4, Type::STREAM, None).unwrap();
    let listener = socket();
    listener.bind(&any().into()).unwrap();
    listener.listen(0).unwrap();
    let address = listener.local_addr().unwrap();
    let first = [socket(), socket(), socket()];
    for peer in &first {
        peer.set_nonblocking(true).unwrap();
        let _ = peer.connect(&address);
    }
    let dial = Tcp::new(address.as_socket().unwrap().to_string());
    for (mut dial, most) in [(dial.clone(), 5000 * MS), (dial.timeout(300 * MS), 300 * MS)] {
        let begun = tokio::time::Instant::now();
        let error = dial.connect().await.unwrap_err();
        assert_eq!((error.kind(), begun.elapsed()), (io::ErrorKind::TimedOut, most));
    }
}

#[tokio::test]
async fn every_connection_sends_at_once_and_notices_a_peer_without_power() {
    let mut listen = Listen::bind(any()).await.unwrap();
    let mut dial = Tcp::new(listen.address().unwrap().to_string());
    dial.discard_after(3000 * MS);
    listen.discard_after(3000 * MS);
    let (dialled, accepted) = tokio::join!(dial.connect(), listen.connect());
    for stream in [dialled.unwrap(), accepted.unwrap()] {
        assert!(stream.nodelay().unwrap());
        assert!(SockRef::from(&stream).keepalive().unwrap());
        #[cfg(target_os = "linux")]
        assert_eq!(rustix::net::sockopt::tcp_user_timeout(&stream), Ok(3000), "what is not acknowledged");
    }
}

#[tokio::test]
async fn a_connector_names_its_peer_if_it_is_known() {
    assert_eq!(Dial(async || Ok::<DuplexStream, _>(duplex(1).0)).peer(), None);
    let robot = "robot.local:502";
    assert_eq!(Tcp::new(robot).peer().unwrap(), robot);
    assert_eq!(Udp::new(any(), robot).peer().unwrap(), robot);
    let mut listen = Listen::bind(any()).await.unwrap();
    assert_eq!(listen.peer(), None);
    let peer = TcpStream::connect(listen.address().unwrap()).await.unwrap();
    drop(listen.connect().await.unwrap());
    assert_eq!(listen.peer().unwrap(), peer.local_addr().unwrap().to_string());
}
