//! A serial device server: a line over TCP, for one client at a time.

use std::io::{ErrorKind, Read, Write};
use std::net::SocketAddr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::TrySendError;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use anyhow::{Context, Result};
use mio::net::TcpStream;
use mio::{Events, Interest, Poll, Token};

use super::{CHUNK, Chunk, Feed};
use crate::io::listener::{Arrival, Listener, refuse};
use crate::io::output::remark;
use crate::io::serial::READ_TIMEOUT;

const ARRIVALS: Token = Token(0);
const CLIENT: Token = Token(1);

/// While the line is full, it is asked so often whether it has room.
const FULL: Duration = Duration::from_millis(5);

/// Reads from the client, and refuses others.
pub(super) struct Server {
    listener: Listener,
    poll: Poll,
    idle_timeout: Option<Duration>,
    shared: Shared,
    connection: Option<Connection>,
}

/// The client's stream, for the reader and the writer.
type Shared = Arc<Mutex<Option<Arc<Stream>>>>;

struct Stream {
    stream: TcpStream,
    /// Bytes that the client has taken.
    taken: AtomicU64,
}

struct Connection {
    stream: Arc<Stream>,
    peer: SocketAddr,
    /// What the line has no room for yet.
    held: Option<Chunk>,
    is_readable: bool,
    /// When it last sent or took a byte, and how many it had taken then.
    active: (Duration, u64),
}

impl Server {
    /// The server, and the writer to its client.
    pub(super) fn new(mut listener: Listener, idle_timeout: Option<Duration>) -> Result<(Self, Client)> {
        let poll = Poll::new().context("cannot wait for clients")?;
        poll.registry().register(&mut listener, ARRIVALS, Interest::READABLE)?;
        let shared = Shared::default();
        let client = Client(Arc::clone(&shared));
        Ok((Self { listener, poll, idle_timeout, shared, connection: None }, client))
    }

    /// Forwards what the client sends, with the time at which it was read, until the line is dropped.
    pub(super) fn run(mut self, feed: &Feed) {
        let mut events = Events::with_capacity(16);
        while feed.is_wanted() {
            let is_full = self.connection.as_ref().is_some_and(|connection| connection.held.is_some());
            let wait = if is_full { FULL } else { READ_TIMEOUT };
            if self.poll.poll(&mut events, Some(wait)).is_err() {
                events.clear();
            }
            let is_readable = events.iter().any(|event| event.token() == CLIENT);
            // Also without an event: an arrival that there was no room for is not reported again.
            self.accept(feed);
            let Some(connection) = &mut self.connection else { continue };
            connection.is_readable |= is_readable;
            if let Err(why) = connection.read(feed, self.idle_timeout) {
                if let Some(why) = why {
                    remark(&format!("the client {} is disconnected: {why}", connection.peer));
                }
                _ = connection.stream.stream.shutdown(std::net::Shutdown::Both);
                *lock(&self.shared) = None;
                self.connection = None;
                feed.connected.store(false, Ordering::Relaxed);
            }
        }
    }

    fn accept(&mut self, feed: &Feed) {
        loop {
            match self.listener.accept() {
                Ok(Arrival::Client(stream, peer)) => match &self.connection {
                    Some(first) => {
                        refuse(&stream);
                        remark(&format!("refused the client {peer}: {} is on the line", first.peer));
                    }
                    None => self.connect(stream, peer, feed),
                },
                Ok(Arrival::Refused(peer)) => {
                    remark(&format!("refused the client {peer}: no descriptor is free, see ulimit -n"));
                }
                Ok(Arrival::Nobody) | Err(_) => return,
            }
        }
    }

    fn connect(&mut self, mut stream: TcpStream, peer: SocketAddr, feed: &Feed) {
        if let Err(error) = self.poll.registry().register(&mut stream, CLIENT, Interest::READABLE) {
            refuse(&stream);
            return remark(&format!("refused the client {peer}: {error}"));
        }
        let stream = Arc::new(Stream { stream, taken: AtomicU64::new(0) });
        *lock(&self.shared) = Some(Arc::clone(&stream));
        let active = (feed.clock.now(), 0);
        self.connection = Some(Connection { stream, peer, held: None, is_readable: true, active });
        feed.connected.store(true, Ordering::Relaxed);
    }
}

impl Connection {
    /// Reads what the line has room for. An error is the end of the connection, and why, unless the client has ended it.
    fn read(&mut self, feed: &Feed, idle_timeout: Option<Duration>) -> Result<(), Option<String>> {
        let now = feed.clock.now();
        let taken = self.stream.taken.load(Ordering::Relaxed);
        if taken != self.active.1 {
            self.active = (now, taken);
        }
        loop {
            if let Some(chunk) = self.held.take() {
                match feed.sender.try_send(chunk) {
                    Ok(()) => {}
                    Err(TrySendError::Full(chunk)) => {
                        // It is the line that is slow.
                        (self.held, self.active.0) = (Some(chunk), now);
                        return Ok(());
                    }
                    Err(TrySendError::Disconnected(_)) => return Ok(()),
                }
            }
            if !self.is_readable {
                return match idle_timeout {
                    Some(timeout) if now.saturating_sub(self.active.0) >= timeout => {
                        Err(Some(format!("it is silent for {} s, see --idle-timeout", timeout.as_secs_f64())))
                    }
                    _ => Ok(()),
                };
            }
            let mut buffer = [0; CHUNK];
            match (&self.stream.stream).read(&mut buffer) {
                Ok(0) => return Err(None),
                Ok(length) => {
                    self.active.0 = now;
                    self.held = Some((feed.clock.now(), buffer.get(..length).unwrap_or_default().to_vec()));
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => self.is_readable = false,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return Err(None),
            }
        }
    }
}

/// Writes to the client, as much as it takes.
pub(super) struct Client(Shared);

impl Write for Client {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let stream = lock(&self.0).clone();
        let Some(stream) = stream else { return Ok(bytes.len()) };
        let length = (&stream.stream).write(bytes)?;
        stream.taken.fetch_add(length as u64, Ordering::Relaxed);
        Ok(length)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
