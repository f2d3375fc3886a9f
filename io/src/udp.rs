//! Datagrams to and from one peer.

use std::io;
use std::net::{Ipv4Addr, SocketAddr, ToSocketAddrs as _, UdpSocket};

use anyhow::{Context, Result, anyhow};
use robot_session::{
    ReceiveOutcome, SendOutcome, Transport, Wait, is_lost_datagram, is_silence, is_unsendable,
};

use crate::tcp::{advise, warn_unless_loopback};

/// Opens a non-blocking socket for the datagrams of any peer; a port alone is one of this machine's loopback
/// address.
///
/// # Errors
/// If the address is invalid, in use, or not this machine's. The error contains advice.
pub fn bind(address: &str) -> Result<UdpSocket> {
    let port: Option<u16> = address.parse().ok();
    let bound = match port {
        Some(port) => UdpSocket::bind((Ipv4Addr::LOCALHOST, port)),
        None => UdpSocket::bind(address),
    };
    let socket = bound.map_err(|error| advise(address, error))?;
    socket.set_nonblocking(true)?;
    warn_unless_loopback(socket.local_addr()?);
    Ok(socket)
}

/// Opens a socket for the datagrams of one peer, whether it is there or not; those of others never arrive.
///
/// # Errors
/// If the address has no meaning.
pub fn connect(address: &str) -> Result<UdpSocket> {
    let what = || format!("cannot send to {address}");
    let place = address.to_socket_addrs().with_context(|| format!("{}: give HOST:PORT", what()))?.next();
    let place = place.ok_or_else(|| anyhow!("{}: the name has no address", what()))?;
    let any: SocketAddr = if place.is_ipv4() { ([0; 4], 0).into() } else { ([0; 16], 0).into() };
    let socket = UdpSocket::bind(any).with_context(what)?;
    socket.connect(place).with_context(what)?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}

/// The number of datagrams of other senders that are passed over before the session is looked after again.
const PASSED_OVER: usize = 64;

/// The datagrams of one peer. A lost datagram and a missing peer are not errors: the protocol resends.
#[derive(Debug)]
pub struct Datagrams {
    socket: UdpSocket,
    /// None where the socket is connected.
    peer: Option<SocketAddr>,
    /// The datagram that has made it the peer.
    first: Option<Vec<u8>>,
}

impl Datagrams {
    /// Creates a transport over a socket that is connected to the peer.
    pub fn connected(socket: UdpSocket) -> Self {
        Self { socket, peer: None, first: None }
    }

    /// Creates it over a socket that other senders can reach as well: their datagrams are skipped. `first` is read first.
    pub fn of(socket: UdpSocket, peer: SocketAddr, first: Vec<u8>) -> Self {
        Self { socket, peer: Some(peer), first: Some(first) }
    }

    /// Reads the next datagram of the peer, if there is one.
    fn read(&self, buffer: &mut [u8]) -> io::Result<Option<usize>> {
        for _ in 0..PASSED_OVER {
            match self.socket.recv_from(buffer) {
                Ok((length, from)) if self.peer.is_none_or(|peer| peer == from) => return Ok(Some(length)),
                Ok(_) => {}
                // The peer does not listen yet, or any more.
                Err(error) if is_lost_datagram(&error) => {}
                Err(error) if is_silence(&error) => return Ok(None),
                Err(error) => return Err(error),
            }
        }
        Ok(None)
    }
}

impl Transport for Datagrams {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        if let Some(first) = self.first.take() {
            let length = first.len().min(buffer.len());
            if let (Some(place), Some(bytes)) = (buffer.get_mut(..length), first.get(..length)) {
                place.copy_from_slice(bytes);
            }
            return Ok(ReceiveOutcome::Bytes(length));
        }
        let arrived = wait.readable(&self.socket)?.then(|| self.read(buffer)).transpose()?.flatten();
        Ok(arrived.map_or(ReceiveOutcome::Nothing, ReceiveOutcome::Bytes))
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        let sent = match self.peer {
            Some(peer) => self.socket.send_to(bytes, peer),
            None => self.socket.send(bytes),
        };
        match sent {
            Err(error) if is_unsendable(&error) => Err(error),
            // The datagram is as good as lost on its way.
            _ => Ok(SendOutcome::Buffered),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    const WAIT: Duration = Duration::from_secs(20);

    #[test]
    fn what_others_send_is_passed_over() {
        let socket = bind("127.0.0.1:0").unwrap();
        let place = socket.local_addr().unwrap();
        let mut peer = Datagrams::connected(connect(&place.to_string()).unwrap());
        let other = UdpSocket::bind("127.0.0.1:0").unwrap();
        let from = SocketAddr::from(([127, 0, 0, 1], peer.socket.local_addr().unwrap().port()));
        let mut end = Datagrams::of(socket, from, b"first".to_vec());
        for text in ["nobody", "nothing"] {
            other.send_to(text.as_bytes(), place).unwrap();
        }
        peer.send(b"second").unwrap();
        let mut buffer = [0; 64];
        for expected in [&b"first"[..], b"second"] {
            assert_eq!(
                end.receive(&mut buffer, Wait::limited(WAIT)).unwrap(),
                ReceiveOutcome::Bytes(expected.len())
            );
            assert_eq!(&buffer[..expected.len()], expected);
        }
        assert_eq!(end.receive(&mut buffer, Wait::limited(Duration::ZERO)).unwrap(), ReceiveOutcome::Nothing);
        // Nor does the peer receive from others.
        other.send_to(b"x", from).unwrap();
        end.send(b"answer").unwrap();
        assert_eq!(peer.receive(&mut buffer, Wait::limited(WAIT)).unwrap(), ReceiveOutcome::Bytes(6));
    }

    #[test]
    fn a_peer_that_is_not_there_is_silent() {
        let place = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let mut end = Datagrams::connected(connect(&place.to_string()).unwrap());
        for _ in 0..3 {
            end.send(b"hello?").unwrap();
            assert_eq!(
                end.receive(&mut [0; 9], Wait::limited(Duration::ZERO)).unwrap(),
                ReceiveOutcome::Nothing
            );
        }
    }

    /// A file is not a socket: to receive from it fails.
    #[cfg(unix)]
    #[test]
    fn a_socket_that_fails_is_an_error() {
        let file = std::os::fd::OwnedFd::from(tempfile::tempfile().unwrap());
        let end = Datagrams::connected(file.into());
        assert!(end.read(&mut [0; 9]).is_err());
    }

    #[test]
    fn a_port_in_use_is_an_error_with_advice() {
        let taken = bind("127.0.0.1:0").unwrap();
        let address = taken.local_addr().unwrap().to_string();
        let error = bind(&address).unwrap_err().to_string();
        assert!(error.contains("the port is in use; choose another"), "{error}");
    }
}
