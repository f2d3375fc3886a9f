//! A controller on this machine's network.

use core::net::SocketAddr;
use core::task::Poll;
use core::time::Duration;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::thread;
use std::time::Instant;

use crate::host::{Host, Motion, Socket};

/// The most that is received at once (thesis, section 9.5).
const PACKET: usize = 4096;
const FAILED: i32 = -1;

/// Sockets of this machine, its clock, and an arm that is where it is sent at once.
#[derive(Debug)]
pub struct TcpHost {
    epoch: Instant,
    stream: Option<TcpStream>,
    port: u16,
    socket: i32,
    broken: bool,
    path: Vec<Motion>,
    /// The commands to the arm between one `BREAK` and the next.
    pub drawn: Vec<Vec<Motion>>,
    /// The printed lines.
    pub printed: Vec<String>,
    /// The number of packets sent.
    pub packets: u64,
    /// The number of opened connections.
    pub connections: u64,
}

impl TcpHost {
    /// Creates the network of a controller that is switched on now.
    #[expect(clippy::disallowed_methods, reason = "it is the clock")]
    pub fn new() -> Self {
        Self {
            epoch: Instant::now(),
            stream: None,
            port: 0,
            socket: 0,
            broken: false,
            path: Vec::new(),
            drawn: Vec::new(),
            printed: Vec::new(),
            packets: 0,
            connections: 0,
        }
    }

    fn fail(&mut self) -> i32 {
        self.broken = true;
        FAILED
    }
}

impl Default for TcpHost {
    fn default() -> Self {
        Self::new()
    }
}

impl Host for TcpHost {
    fn now(&self) -> Duration {
        self.epoch.elapsed()
    }

    fn connect(&mut self, _: Duration, timeout: Duration, ip: [u8; 4], port: u16) -> Poll<i32> {
        let address = SocketAddr::from((ip, port));
        let opened = TcpStream::connect_timeout(&address, timeout).and_then(|stream| {
            stream.set_nodelay(true)?;
            stream.set_nonblocking(true)?;
            Ok(stream)
        });
        let Ok(stream) = opened else { return Poll::Ready(FAILED) };
        (self.stream, self.port, self.broken) = (Some(stream), port, false);
        self.socket += 1;
        self.connections += 1;
        Poll::Ready(self.socket)
    }

    #[expect(clippy::disallowed_methods, reason = "a full buffer of the system is waited for")]
    fn send(&mut self, since: Duration, timeout: Duration, _: i32, strings: &[&[u8]]) -> Poll<i32> {
        let packet = strings.concat();
        let mut rest = packet.as_slice();
        while !rest.is_empty() {
            let written = self.stream.as_mut().map(|stream| stream.write(rest));
            match written {
                Some(Ok(length)) if length > 0 => rest = rest.get(length..).unwrap_or_default(),
                Some(Err(error)) if error.kind() == ErrorKind::WouldBlock && self.now() < since + timeout => {
                    thread::sleep(Duration::from_millis(1));
                }
                _ => return Poll::Ready(self.fail()),
            }
        }
        self.packets += 1;
        Poll::Ready(0)
    }

    fn receive(
        &mut self,
        since: Duration,
        timeout: Duration,
        _: i32,
        longest: usize,
    ) -> Poll<(i32, Vec<Vec<u8>>)> {
        let mut packet = [0; PACKET];
        match self.stream.as_mut().map(|stream| stream.read(&mut packet)) {
            Some(Ok(length)) if length > 0 => {
                let bytes = packet.get(..length).unwrap_or_default();
                Poll::Ready((0, bytes.chunks(longest.max(1)).map(<[u8]>::to_vec).collect()))
            }
            Some(Err(error)) if error.kind() == ErrorKind::WouldBlock => {
                if self.now() < since + timeout {
                    return Poll::Pending;
                }
                Poll::Ready((FAILED, Vec::new()))
            }
            _ => Poll::Ready((self.fail(), Vec::new())),
        }
    }

    fn close(&mut self, _: i32) -> i32 {
        self.stream = None;
        0
    }

    fn sockets(&mut self) -> Vec<Socket> {
        let error = if self.broken { FAILED } else { 0 };
        let open = self.stream.iter();
        open.map(|_| Socket { port: self.port, id: self.socket, error }).collect()
    }

    fn give(&mut self, motion: Motion) -> Poll<()> {
        self.path.push(motion);
        Poll::Ready(())
    }

    fn arrived(&mut self) -> Poll<()> {
        self.drawn.push(core::mem::take(&mut self.path));
        Poll::Ready(())
    }

    fn print(&mut self, _: usize, line: &str) {
        self.printed.push(line.into());
    }
}
