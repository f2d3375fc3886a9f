//! The host of a device at a TCP address: one loop for all clients; no client waits for another.

use core::time::Duration;
use std::io::{self, ErrorKind, Read, Write};
use std::net::Shutdown;

use mio::event::Event;
use mio::{Events, Interest, Poll, Token};
use robot_session::{Step, Steps};
use slab::Slab;

use super::carrier::Carrier;
use super::{Arrival, ConnectionEnd, HostedSession, Listener, MAX_CLIENTS, Notice, Request, refuse};

/// A client whose requests do not end takes turns with the others after this many reads.
const READS: usize = 16;

/// When the system has no resources for a client, the next try is this much later.
const RETRY: Duration = Duration::from_millis(100);

/// When more bytes wait for a client that does not read, the next message without a request closes the connection.
const MAX_UNSENT: usize = 64 * 1024;

const ARRIVALS: Token = Token(usize::MAX);

/// Serves a device over TCP: [several clients](HostedSession::another) at once, or the newest.
#[derive(Debug)]
pub struct Server<C> {
    /// The listener at which the clients arrive.
    pub listener: Listener,
    /// The clock of the sessions.
    pub clock: C,
    /// The time after which a client that neither sends nor takes a byte is disconnected; `None`: never.
    pub idle_timeout: Option<Duration>,
    /// The interval at which the sessions are called even if no bytes arrive and no deadline has passed, because another thread
    /// may have changed them; also the longest time until the server stops. `None`: they are not.
    pub look: Option<Duration>,
}

impl<C: Fn() -> Duration> Server<C> {
    /// Creates a server without time limits, which polls its sessions when something is due.
    pub const fn new(listener: Listener, clock: C) -> Self {
        Self { listener, clock, idle_timeout: None, look: None }
    }

    /// Serves while `goes_on`. A client that does not read its replies stops the reading of its requests, and does not stop
    /// another client.
    ///
    /// # Errors
    /// The system cannot wait for events; the errors of `observe`.
    pub fn run<S: HostedSession, E: From<io::Error>>(
        self,
        session: S,
        goes_on: impl Fn() -> bool,
        observe: impl FnMut(&mut S, Notice<'_, S::Event>) -> Result<(), E>,
    ) -> Result<(), E> {
        let poll = Poll::new()?;
        let (input, out) = (vec![0; S::MAX_INPUT], vec![0; S::MAX_TRANSMIT]);
        let (first, clients, busy) = (Some(session), Slab::new(), Vec::new());
        let mut serving =
            ServerLoop { server: self, poll, first, clients, busy, due: None, input, out, observe };
        serving.poll.registry().register(&mut serving.server.listener, ARRIVALS, Interest::READABLE)?;
        serving.run(goes_on)
    }
}

struct ServerLoop<C, S, H> {
    server: Server<C>,
    poll: Poll,
    /// The session without a connection; `None` while it has one because it serves only the newest client.
    first: Option<S>,
    clients: Slab<Client<S>>,
    /// The clients with more to read, of which no further event comes.
    busy: Vec<usize>,
    /// A time not after the earliest deadline.
    due: Option<Duration>,
    input: Vec<u8>,
    out: Vec<u8>,
    observe: H,
}

struct Client<S> {
    stream: Carrier,
    peer: String,
    session: S,
    /// The session is the only one of its device.
    is_first: bool,
    /// The bytes of the session that the system has not accepted yet.
    unsent: Vec<u8>,
    /// There may be bytes to read: an event reports them once.
    is_readable: bool,
    /// The client has ended its side: the end is there to read, and no event will follow.
    is_ended: bool,
    /// The time at which the client last sent or took a byte.
    active: Duration,
}

/// The end of a connection: its reason, or the failure of the observer, which ends the server.
enum Stop<E> {
    Connection(ConnectionEnd),
    Server(E),
}

impl<E> From<ConnectionEnd> for Stop<E> {
    fn from(ending: ConnectionEnd) -> Self {
        Self::Connection(ending)
    }
}

impl<C, S, H, E> ServerLoop<C, S, H>
where
    C: Fn() -> Duration,
    S: HostedSession,
    E: From<io::Error>,
    H: FnMut(&mut S, Notice<'_, S::Event>) -> Result<(), E>,
{
    fn run(&mut self, goes_on: impl Fn() -> bool) -> Result<(), E> {
        let mut events = Events::with_capacity(256);
        let mut now = (self.server.clock)();
        self.look(now)?;
        while goes_on() {
            let wait = match self.due {
                _ if !self.busy.is_empty() => Some(Duration::ZERO),
                // A wait that is longer by the last turn is harmless, and saves a reading of the clock.
                due => due.map(|due| due.saturating_sub(now)),
            };
            match self.poll.poll(&mut events, wait) {
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                outcome => outcome?,
            }
            now = (self.server.clock)();
            for key in core::mem::take(&mut self.busy) {
                self.serve(key, now)?;
            }
            let mut has_arrivals = false;
            for event in &events {
                match event.token() {
                    ARRIVALS => has_arrivals = true,
                    Token(key) => self.wake(key, event, now)?,
                }
            }
            if has_arrivals {
                self.accept(now)?;
            }
            if self.due.is_some_and(|due| due <= now) {
                self.due = None;
                self.look(now)?;
            }
        }
        self.close_all(now, &ConnectionEnd::Stopped)
    }

    /// Does everything that is due.
    fn look(&mut self, now: Duration) -> Result<(), E> {
        if let Some(look) = self.server.look {
            self.wait_until(now + look);
        }
        self.accept(now)?;
        self.time_out(now)
    }

    /// Calls the session that has no connection.
    fn advance(&mut self, now: Duration) -> Result<(), E> {
        let Some(first) = &mut self.first else { return Ok(()) };
        first.handle_timeout(now);
        while let Some(event) = first.poll_event() {
            (self.observe)(first, Notice::Event("", event))?;
        }
        (self.observe)(first, Notice::Settled)?;
        if let Some(due) = first.poll_timeout() {
            self.wait_until(due);
        }
        Ok(())
    }

    fn accept(&mut self, now: Duration) -> Result<(), E> {
        loop {
            self.advance(now)?;
            let device =
                self.first.as_ref().or(self.clients.iter().next().map(|(_, client)| &client.session));
            if device.is_some_and(|device| !device.accepts(now)) {
                self.wait_until(now + RETRY);
                return Ok(());
            }
            match self.server.listener.accept() {
                Ok(Arrival::Client(stream, peer)) => self.connect(stream, peer.to_string(), now)?,
                Ok(Arrival::Refused(peer, why)) => self.refuse(&peer.to_string(), &why)?,
                Ok(Arrival::Nobody) => {
                    if let Some(time) = self.server.listener.handshake_time() {
                        self.wait_until(now + time + RETRY);
                    }
                    return Ok(());
                }
                Err(_) => {
                    self.wait_until(now + RETRY);
                    return Ok(());
                }
            }
        }
    }

    fn refuse(&mut self, peer: &str, why: &str) -> Result<(), E> {
        let first =
            self.first.as_mut().or(self.clients.iter_mut().next().map(|(_, client)| &mut client.session));
        first.map_or(Ok(()), |session| (self.observe)(session, Notice::Refused(peer, why)))
    }

    fn connect(&mut self, mut stream: Carrier, peer: String, now: Duration) -> Result<(), E> {
        let another = match self.first.as_ref().map(HostedSession::another) {
            Some(Some(another)) if self.clients.len() < MAX_CLIENTS => Some(another),
            Some(Some(_)) => {
                refuse(&stream.tcp);
                return self.refuse(&peer, "the maximum of clients is connected");
            }
            Some(None) => None,
            None => {
                self.close_all(now, &ConnectionEnd::Replaced)?;
                None
            }
        };
        let key = self.clients.vacant_key();
        let interest = Interest::READABLE | Interest::WRITABLE;
        if let Err(error) = self.poll.registry().register(&mut stream.tcp, Token(key), interest) {
            refuse(&stream.tcp);
            return self.refuse(&peer, &error.to_string());
        }
        let is_first = another.is_none();
        let Some(mut session) = another.or_else(|| self.first.take()) else { return Ok(()) };
        session.handle_connected(now);
        if let Some(certificate) = stream.certificate() {
            session.secured(certificate);
        }
        // Bytes may have come with the end of the handshake.
        let (unsent, is_readable, is_ended) = (Vec::new(), stream.keeps_bytes(), false);
        let mut client =
            Client { stream, peer, session, is_first, unsent, is_readable, is_ended, active: now };
        (self.observe)(&mut client.session, Notice::Connected(&client.peer))?;
        self.clients.insert(client);
        if let Some(timeout) = self.server.idle_timeout {
            self.wait_until(now.saturating_add(timeout));
        }
        self.serve(key, now)
    }

    fn wake(&mut self, key: usize, event: &Event, now: Duration) -> Result<(), E> {
        let Some(client) = self.clients.get_mut(key) else { return Ok(()) };
        client.is_readable |= event.is_readable() || event.is_error();
        client.is_ended |= event.is_read_closed() || event.is_error();
        self.serve(key, now)
    }

    /// Reads the bytes of a client and answers them, as far as the client takes the answers.
    fn serve(&mut self, key: usize, now: Duration) -> Result<(), E> {
        let Some(client) = self.clients.get_mut(key) else { return Ok(()) };
        let served = client.serve(&mut self.input, &mut self.out, now, &mut self.observe);
        (self.observe)(&mut client.session, Notice::Settled)?;
        match served {
            Ok(true) => self.busy.push(key),
            Ok(false) => {}
            Err(Stop::Connection(ending)) => return self.close(key, now, &ending),
            Err(Stop::Server(error)) => return Err(error),
        }
        if let Some(due) = client.session.poll_timeout() {
            self.wait_until(due);
        }
        Ok(())
    }

    fn time_out(&mut self, now: Duration) -> Result<(), E> {
        let keys: Vec<usize> = self.clients.iter().map(|(key, _)| key).collect();
        for key in keys {
            let Some(client) = self.clients.get_mut(key) else { continue };
            client.session.handle_timeout(now);
            if let Some(time) = self.server.idle_timeout {
                let end = client.active.saturating_add(time);
                if end <= now {
                    let reads = client.unsent.is_empty();
                    self.close(key, now, &ConnectionEnd::Idle { time, reads })?;
                    continue;
                }
                self.wait_until(end);
            }
            self.serve(key, now)?;
        }
        Ok(())
    }

    fn wait_until(&mut self, at: Duration) {
        self.due = Some(self.due.map_or(at, |due| due.min(at)));
    }

    fn close_all(&mut self, now: Duration, ending: &ConnectionEnd) -> Result<(), E> {
        let keys: Vec<usize> = self.clients.iter().map(|(key, _)| key).collect();
        keys.into_iter().try_for_each(|key| self.close(key, now, ending))
    }

    fn close(&mut self, key: usize, now: Duration, ending: &ConnectionEnd) -> Result<(), E> {
        let Some(mut client) = self.clients.try_remove(key) else { return Ok(()) };
        // Earlier replies are sent, as far as the system accepts them.
        _ = client.stream.write(&client.unsent);
        client.stream.end();
        _ = client.stream.tcp.shutdown(Shutdown::Both);
        _ = self.poll.registry().deregister(&mut client.stream.tcp);
        let Client { mut session, peer, is_first, .. } = client;
        session.handle_disconnected(now);
        while let Some(event) = session.poll_event() {
            (self.observe)(&mut session, Notice::Event(&peer, event))?;
        }
        (self.observe)(&mut session, Notice::Settled)?;
        (self.observe)(&mut session, Notice::Disconnected(&peer, ending))?;
        if is_first {
            self.first = Some(session);
            self.advance(now)?;
        }
        Ok(())
    }
}

impl<S: HostedSession> Client<S> {
    /// Returns whether there is more to read.
    fn serve<E>(
        &mut self,
        input: &mut [u8],
        out: &mut [u8],
        now: Duration,
        observe: &mut impl FnMut(&mut S, Notice<'_, S::Event>) -> Result<(), E>,
    ) -> Result<bool, Stop<E>> {
        self.settle(out, now, observe)?;
        for _ in 0..READS {
            self.flush(now)?;
            if !self.is_readable || !self.unsent.is_empty() || !self.session.wants_input() {
                return Ok(false);
            }
            match self.stream.read(input) {
                Ok(0) => return Err(ConnectionEnd::ByPeer.into()),
                Ok(length) => {
                    // On Unix, bytes after a read that did not fill its buffer are an event again; an end that was reported
                    // is not. On Windows there is no event until a read would have to wait.
                    let is_filled = length == input.len() || self.stream.keeps_bytes();
                    self.is_readable = is_filled || self.is_ended || cfg!(windows);
                    self.active = now;
                    let bytes = input.get(..length).unwrap_or_default();
                    observe(&mut self.session, Notice::Received(now, bytes)).map_err(Stop::Server)?;
                    self.session.handle_input(now, bytes);
                    self.settle(out, now, observe)?;
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => self.is_readable = false,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(ConnectionEnd::from(error).into()),
            }
        }
        self.flush(now)?;
        Ok(self.unsent.is_empty())
    }

    fn settle<E>(
        &mut self,
        out: &mut [u8],
        now: Duration,
        observe: &mut impl FnMut(&mut S, Notice<'_, S::Event>) -> Result<(), E>,
    ) -> Result<(), Stop<E>> {
        let Self { session, unsent, peer, .. } = self;
        let (mut steps, waits) = (Steps::NEW, unsent.len());
        loop {
            match steps.next(session, now, out) {
                Step::Event(event) => {
                    let request = S::request(&event);
                    observe(session, Notice::Event(peer, event)).map_err(Stop::Server)?;
                    if let Some(Request::Close(why)) = request {
                        return Err(ConnectionEnd::ByDevice(why).into());
                    }
                }
                Step::Write(bytes) => {
                    observe(session, Notice::Sent(now, bytes)).map_err(Stop::Server)?;
                    if waits > MAX_UNSENT {
                        return Err(ConnectionEnd::Stalled.into());
                    }
                    unsent.extend_from_slice(bytes);
                }
                Step::Wait { .. } => return Ok(()),
            }
        }
    }

    /// Sends the bytes that the system accepts.
    fn flush(&mut self, now: Duration) -> Result<(), ConnectionEnd> {
        while !self.unsent.is_empty() {
            match self.stream.write(&self.unsent) {
                Ok(length) => {
                    self.unsent.drain(..length);
                    self.active = now;
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(self.stream.flush()?)
    }
}
