//! A serial device server: a line over TCP, for one client at a time.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::net::SocketAddr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::TrySendError;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use anyhow::{Context, Result};
use cellwire_sim::host::{Arrival, Listener, refuse};
use mio::net::TcpStream;
use mio::{Events, Interest, Poll, Token};

use super::{CARRIED, CHUNK, Chunk, Feed};
use cellwire_io::output::remark;
use cellwire_io::serial::READ_TIMEOUT;

const ARRIVALS: Token = Token(0);
const CLIENT: Token = Token(1);

/// The interval at which the line is checked while it is full, or carries data of a client that has disconnected.
const BUSY: Duration = Duration::from_millis(5);

/// So many chunks of a client, 16 MiB, are read without the line while another client waits: the end of a connection comes
/// after all that was sent.
const MAX_READ_AHEAD: usize = (16 << 20) / CHUNK;

/// The time for which a second client waits for the end of the first connection: on a busy computer that end is reported after
/// the arrival. Further clients are refused at once meanwhile.
const GRACE: Duration = Duration::from_millis(200);

/// Reads from the client, and refuses others.
pub(super) struct Server {
    listener: Listener,
    poll: Poll,
    events: Events,
    idle_timeout: Option<Duration>,
    shared: Shared,
    connection: Option<Connection>,
    /// A client that came while there is another one, with the time: it waits until the bytes of that one are carried, or is
    /// refused.
    next: Option<(TcpStream, SocketAddr, Duration)>,
    /// A client may wait to be accepted.
    has_arrivals: bool,
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
    /// The chunks that do not fit on the line yet.
    held: VecDeque<Chunk>,
    is_readable: bool,
    /// When it has left.
    left: Option<Duration>,
    /// When it last sent or took a byte, and how many it had taken then.
    active: (Duration, u64),
}

impl Server {
    /// Creates the server, and the writer to its client.
    pub(super) fn new(mut listener: Listener, idle_timeout: Option<Duration>) -> Result<(Self, Client)> {
        let poll = Poll::new().context("cannot wait for clients")?;
        poll.registry().register(&mut listener, ARRIVALS, Interest::READABLE)?;
        let shared = Shared::default();
        let client = Client(Arc::clone(&shared));
        let events = Events::with_capacity(16);
        let has_arrivals = true;
        let server =
            Self { listener, poll, events, idle_timeout, shared, connection: None, next: None, has_arrivals };
        Ok((server, client))
    }

    /// Forwards the client's bytes, with the time of each read, until the line is dropped.
    pub(super) fn run(mut self, feed: &Feed) {
        while feed.is_wanted() {
            let is_due = self.has_arrivals || self.next.is_some();
            let is_busy = is_due || self.connection.as_ref().is_some_and(Connection::is_busy);
            self.wait(if is_busy { BUSY } else { READ_TIMEOUT }, feed);
            self.accept(feed);
            let Some(connection) = &mut self.connection else { continue };
            let most = if self.next.is_some() { MAX_READ_AHEAD } else { 1 };
            let served =
                if feed.is_ended() { Err(None) } else { connection.serve(feed, self.idle_timeout, most) };
            let Err(why) = served else { continue };
            if let Some(why) = why {
                remark(&format!("the client {} is disconnected: {why}", connection.peer));
            }
            _ = connection.stream.stream.shutdown(std::net::Shutdown::Both);
            *lock(&self.shared) = None;
            self.connection = None;
            feed.leave();
        }
    }

    fn wait(&mut self, timeout: Duration, feed: &Feed) {
        if self.poll.poll(&mut self.events, Some(timeout)).is_err() {
            self.events.clear();
        }
        for event in &self.events {
            match (event.token(), &mut self.connection) {
                (CLIENT, Some(connection)) => {
                    connection.is_readable = true;
                    if event.is_read_closed() || event.is_error() {
                        connection.left.get_or_insert(feed.clock.now());
                    }
                }
                (CLIENT, None) => {}
                _ => self.has_arrivals = true,
            }
        }
    }

    /// Accepts one client at a time. A client that comes after the previous one has disconnected waits until the line is free.
    fn accept(&mut self, feed: &Feed) {
        let first = self.connection.as_ref().filter(|first| first.left.is_none()).map(|first| first.peer);
        if let Some((stream, peer, came)) = self.next.take() {
            match (&self.connection, first) {
                (None, _) => return self.connect(stream, peer, feed),
                (_, Some(first)) if feed.clock.now().saturating_sub(came) >= GRACE => {
                    return refuse_beside(first, &stream, peer);
                }
                _ => self.next = Some((stream, peer, came)),
            }
        }
        if !self.has_arrivals || self.connection.is_some() && first.is_none() {
            return;
        }
        match self.listener.accept() {
            Ok(Arrival::Client(stream, peer)) => match first {
                None => self.connect(stream.tcp, peer, feed),
                Some(first) if self.next.is_some() => refuse_beside(first, &stream.tcp, peer),
                Some(_) => self.next = Some((stream.tcp, peer, feed.clock.now())),
            },
            Ok(Arrival::Refused(peer, why)) => remark(&format!("refused the client {peer}: {why}")),
            Ok(Arrival::Nobody) => self.has_arrivals = false,
            // A client that could not be accepted for lack of resources is not reported again.
            Err(_) => {}
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
        let held = VecDeque::new();
        self.connection = Some(Connection { stream, peer, held, is_readable: true, left: None, active });
        feed.connect(true);
    }
}

fn refuse_beside(first: SocketAddr, stream: &TcpStream, peer: SocketAddr) {
    refuse(stream);
    remark(&format!("refused the client {peer}: {first} is connected"));
}

impl Connection {
    fn is_busy(&self) -> bool {
        !self.held.is_empty() || self.left.is_some()
    }

    /// Reads as many bytes as fit the line, and those of `most` chunks that wait for it. An error is the end of the connection,
    /// and its reason, unless the client has ended it and its bytes are carried.
    fn serve(
        &mut self,
        feed: &Feed,
        idle_timeout: Option<Duration>,
        most: usize,
    ) -> Result<(), Option<String>> {
        let now = feed.clock.now();
        if self.left.is_some_and(|left| now.saturating_sub(left) >= CARRIED) {
            return Err(Some(format!("it has left, and its data takes longer than {} s", CARRIED.as_secs())));
        }
        let taken = self.stream.taken.load(Ordering::Relaxed);
        if taken != self.active.1 {
            self.active = (now, taken);
        }
        loop {
            self.forward(feed);
            if !self.held.is_empty() {
                // It is the line that is slow.
                self.active.0 = now;
            }
            if !self.is_readable || self.held.len() >= most {
                break;
            }
            let mut buffer = [0; CHUNK];
            match (&self.stream.stream).read(&mut buffer) {
                Ok(length @ 1..) => {
                    self.active.0 = now;
                    let bytes = buffer.get(..length).unwrap_or_default().to_vec();
                    self.held.push_back((feed.clock.now(), bytes, feed.client.left.load(Ordering::Relaxed)));
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => self.is_readable = false,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                _ if self.held.is_empty() && feed.client.under_way.load(Ordering::Relaxed) == 0 => {
                    return Err(None);
                }
                _ => {
                    self.left.get_or_insert(now);
                    return Ok(());
                }
            }
        }
        match idle_timeout {
            Some(timeout) if now.saturating_sub(self.active.0) >= timeout => {
                Err(Some(format!("it is silent for {} s, see --idle-timeout", timeout.as_secs_f64())))
            }
            _ => Ok(()),
        }
    }

    /// Puts on the line as many chunks as it can take.
    fn forward(&mut self, feed: &Feed) {
        while let Some(chunk) = self.held.pop_front() {
            feed.client.under_way.fetch_add(1, Ordering::Relaxed);
            if let Err(TrySendError::Full(chunk) | TrySendError::Disconnected(chunk)) =
                feed.sender.try_send(chunk)
            {
                feed.client.under_way.fetch_sub(1, Ordering::Relaxed);
                return self.held.push_front(chunk);
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
