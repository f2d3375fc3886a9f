//! A TCP connection to a peer that may not read.

use std::io::{self, ErrorKind, Read as _, Write as _};
use std::net::{Shutdown, TcpStream};
use std::time::Duration;

use robot_session::{ReceiveOutcome, SendOutcome, Transport, Wait, is_silence};

/// The number of bytes that may wait for a peer that does not read, beside those that the system buffers.
const UNSENT: usize = 64 * 1024;

/// While bytes wait, the peer is asked this often whether it reads again.
const RETRY: Duration = Duration::from_millis(5);

/// A connection whose [`send`](Transport::send) never waits for the peer.
#[derive(Debug)]
pub struct Stream {
    stream: TcpStream,
    unsent: Vec<u8>,
}

impl Stream {
    /// Sends and receives over `stream`, which blocks.
    pub fn new(stream: TcpStream) -> Self {
        Self { stream, unsent: Vec::new() }
    }

    /// Ends the connection, before another takes its place.
    pub fn close(&mut self) {
        let _ = self.stream.shutdown(Shutdown::Both);
    }

    /// Returns whether there are bytes to read at once, or the connection has ended.
    pub fn is_waiting(&self) -> bool {
        Wait::limited(Duration::ZERO).readable(&self.stream).unwrap_or(true)
    }

    fn flush(&mut self) -> io::Result<()> {
        if self.unsent.is_empty() {
            return Ok(());
        }
        self.stream.set_nonblocking(true)?;
        let outcome = loop {
            match self.stream.write(&self.unsent) {
                Ok(length) => drop(self.unsent.drain(..length)),
                Err(error) => break Err(error),
            }
            if self.unsent.is_empty() {
                break Ok(());
            }
        };
        self.stream.set_nonblocking(false)?;
        outcome.or_else(|error| if is_silence(&error) { Ok(()) } else { Err(error) })
    }
}

impl Transport for Stream {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        self.flush()?;
        let wait = if self.unsent.is_empty() { wait } else { wait.at_most(RETRY) };
        if !wait.readable(&self.stream)? {
            return Ok(ReceiveOutcome::Nothing);
        }
        match self.stream.read(buffer) {
            Ok(0) => Ok(ReceiveOutcome::Closed),
            Ok(length) => Ok(ReceiveOutcome::Bytes(length)),
            Err(error) if is_silence(&error) => Ok(ReceiveOutcome::Nothing),
            Err(error) => Err(error),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        if self.unsent.len() + bytes.len() > UNSENT {
            return Err(io::Error::new(ErrorKind::TimedOut, "the peer does not read"));
        }
        self.unsent.extend_from_slice(bytes);
        self.flush()?;
        Ok(SendOutcome::Buffered)
    }

    fn discard_after(&mut self, after: Duration) -> io::Result<()> {
        self.stream.discard_after(after)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;
    use crate::tcp;

    #[test]
    fn a_peer_that_does_not_read_is_an_error_and_no_wait() {
        let listener = tcp::listen("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let mut stream = Stream::new(tcp::connect(&address, tcp::Dialing::default()).unwrap());
        let mut peer = listener.accept().unwrap().0;
        let packet: Vec<u8> = (0..=250).cycle().take(4096).collect();
        let mut sent = 0;
        let error = loop {
            match stream.send(&packet) {
                Ok(_) => sent += packet.len(),
                Err(error) => break error,
            }
            assert!(stream.unsent.len() <= UNSENT);
        };
        assert_eq!(error.to_string(), "the peer does not read");
        // There is room for a part of the packet, to the last byte.
        let room = UNSENT - stream.unsent.len();
        assert!(room < packet.len(), "{room}");
        assert!(stream.send(&packet[..=room]).is_err());
        stream.send(&packet[..room]).unwrap();
        sent += room;
        // The peer reads after all: no accepted bytes are lost or out of order.
        let reader = std::thread::spawn(move || {
            let mut received = vec![0; sent];
            peer.read_exact(&mut received).unwrap();
            (peer, received)
        });
        while !stream.unsent.is_empty() {
            assert_eq!(stream.receive(&mut [0; 9], Wait::limited(RETRY)).unwrap(), ReceiveOutcome::Nothing);
        }
        let (_peer, received) = reader.join().unwrap();
        assert!(received.chunks(packet.len()).all(|chunk| packet.starts_with(chunk)));
    }
}
