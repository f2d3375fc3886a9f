//! Serves sessions over TCP: one loop for all clients, in which none waits for another.

use core::ops::ControlFlow;
use core::time::Duration;
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr};
use std::path::PathBuf;

use anyhow::{Context, Result};
use mio::event::Event;
use mio::net::TcpStream;
use mio::{Events, Interest, Poll, Token};
use robot_session::{Session, Step, Steps};
use slab::Slab;

use cellwire_io::clock::Clock;
use cellwire_io::listener::{Arrival, Listener, refuse};
use cellwire_io::trace::{Trace, Way};

/// How many clients are served at once; others are refused.
pub const MOST_CLIENTS: usize = 1000;

/// A client whose requests do not end takes turns with the others after this many reads.
const READS: usize = 16;

/// When the system has no room for a client, the next try is this much later.
const RETRY: Duration = Duration::from_millis(100);

const ARRIVALS: Token = Token(usize::MAX);

/// What happens to the clients.
#[derive(Debug)]
pub enum Notice<'a, E> {
    /// A client is served.
    Connected(SocketAddr),
    /// A client is not served, and its connection is closed.
    Refused(SocketAddr, &'a str),
    /// An event of its session; what the handler breaks with is why the connection is to be closed.
    Event(SocketAddr, E),
    /// Its connection has ended, and why.
    Disconnected(SocketAddr, &'a str),
    /// Its bytes were written there.
    Traced(PathBuf),
    /// The time, before clients are accepted and at each [look](Service::look). If the handler breaks, no client is accepted now.
    Look(Duration),
}

/// How clients are served.
#[derive(Debug)]
pub struct Service<'a> {
    /// The time of the sessions and the trace.
    pub clock: Clock,
    /// What keeps the bytes of the sessions.
    pub trace: &'a Trace,
    /// A client that neither sends nor takes a byte for this long is disconnected.
    pub idle_timeout: Option<Duration>,
    /// The interval at which sessions are called even if nothing arrives and nothing is due: something else may have changed them.
    pub look: Option<Duration>,
}

impl Service<'_> {
    /// Serves until the listener fails: each client with a session that `open` makes. A session is given as many bytes at once as
    /// it may send at once; what a client does not read stops the reading of its requests, and nothing else.
    ///
    /// # Errors
    /// When the system cannot wait for events, or `open` fails.
    pub fn run<S: Session>(
        &self,
        listener: Listener,
        open: impl FnMut() -> Result<S>,
        handle: impl FnMut(Notice<'_, S::Event>) -> ControlFlow<String>,
    ) -> Result<()> {
        let poll = Poll::new().context("cannot wait for clients")?;
        let mut serving = Serving {
            service: self,
            listener,
            poll,
            clients: Slab::new(),
            busy: Vec::new(),
            due: None,
            input: vec![0; S::MAX_TRANSMIT],
            out: vec![0; S::MAX_TRANSMIT],
            open,
            handle,
        };
        serving.poll.registry().register(&mut serving.listener, ARRIVALS, Interest::READABLE)?;
        serving.due = self.look.map(|look| self.clock.now() + look);
        serving.run()
    }
}

struct Serving<'a, S, O, H> {
    service: &'a Service<'a>,
    listener: Listener,
    poll: Poll,
    clients: Slab<Client<S>>,
    /// Those with more to read, without a further event.
    busy: Vec<usize>,
    /// The earliest time at which something is due, or earlier.
    due: Option<Duration>,
    input: Vec<u8>,
    out: Vec<u8>,
    open: O,
    handle: H,
}

struct Client<S> {
    stream: TcpStream,
    peer: SocketAddr,
    session: S,
    /// Of what the session has sent, what the system has not taken yet.
    unsent: Vec<u8>,
    /// Something may be there to read: an event reports it once.
    is_readable: bool,
    /// The client has ended its side: the end is there to read, and no event will follow.
    is_ended: bool,
    /// When it last sent or took a byte.
    active: Duration,
}

impl<S, O, H> Serving<'_, S, O, H>
where
    S: Session,
    O: FnMut() -> Result<S>,
    H: FnMut(Notice<'_, S::Event>) -> ControlFlow<String>,
{
    fn run(&mut self) -> Result<()> {
        let mut events = Events::with_capacity(256);
        let mut now = self.service.clock.now();
        loop {
            let wait = match self.due {
                _ if !self.busy.is_empty() => Some(Duration::ZERO),
                // A wait that is longer by the last turn is no harm, and saves a look at the clock.
                due => due.map(|due| due.saturating_sub(now)),
            };
            match self.poll.poll(&mut events, wait) {
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                outcome => outcome.context("cannot wait for clients")?,
            }
            now = self.service.clock.now();
            for key in core::mem::take(&mut self.busy) {
                self.serve(key, now);
            }
            for event in &events {
                match event.token() {
                    ARRIVALS => self.accept(now)?,
                    Token(key) => self.wake(key, event, now),
                }
            }
            if self.due.is_some_and(|due| due <= now) {
                self.due = None;
                self.accept(now)?;
                self.time_out(now);
            }
        }
    }

    fn accept(&mut self, now: Duration) -> Result<()> {
        loop {
            if (self.handle)(Notice::Look(now)).is_break() {
                self.wait_until(now + RETRY);
                return Ok(());
            }
            let (mut stream, peer) = match self.listener.accept() {
                Ok(Arrival::Nobody) => return Ok(()),
                Ok(Arrival::Client(stream, peer)) => (stream, peer),
                Ok(Arrival::Refused(peer)) => {
                    _ = (self.handle)(Notice::Refused(peer, "too many open files, see ulimit -n"));
                    continue;
                }
                Err(_) => {
                    self.wait_until(now + RETRY);
                    return Ok(());
                }
            };
            if self.clients.len() >= MOST_CLIENTS {
                refuse(&stream);
                _ = (self.handle)(Notice::Refused(peer, "the maximum of clients is connected"));
                continue;
            }
            let entry = self.clients.vacant_entry();
            let interest = Interest::READABLE | Interest::WRITABLE;
            if let Err(error) = self.poll.registry().register(&mut stream, Token(entry.key()), interest) {
                refuse(&stream);
                _ = (self.handle)(Notice::Refused(peer, &error.to_string()));
                continue;
            }
            let mut session = (self.open)()?;
            session.handle_connected(now);
            entry.insert(Client {
                stream,
                peer,
                session,
                unsent: Vec::new(),
                is_readable: false,
                is_ended: false,
                active: now,
            });
            _ = (self.handle)(Notice::Connected(peer));
            if let Some(timeout) = self.service.idle_timeout {
                self.wait_until(now.saturating_add(timeout));
            }
        }
    }

    fn wake(&mut self, key: usize, event: &Event, now: Duration) {
        let Some(client) = self.clients.get_mut(key) else { return };
        client.is_readable |= event.is_readable() || event.is_error();
        client.is_ended |= event.is_read_closed() || event.is_error();
        self.serve(key, now);
    }

    /// Reads what a client has sent and answers it, as far as the client takes the answers.
    fn serve(&mut self, key: usize, now: Duration) {
        let Some(client) = self.clients.get_mut(key) else { return };
        let mut turn = Turn { service: self.service, handle: &mut self.handle, now };
        match client.serve(&mut self.input, &mut self.out, &mut turn) {
            Ok(true) => self.busy.push(key),
            Ok(false) => {}
            Err(why) => return self.close(key, now, &why),
        }
        if let Some(due) = client.session.poll_timeout() {
            self.wait_until(due);
        }
    }

    fn time_out(&mut self, now: Duration) {
        if let Some(look) = self.service.look {
            self.wait_until(now + look);
        }
        let keys: Vec<usize> = self.clients.iter().map(|(key, _)| key).collect();
        for key in keys {
            let Some(client) = self.clients.get_mut(key) else { continue };
            client.session.handle_timeout(now);
            if let Some(timeout) = self.service.idle_timeout {
                let end = client.active.saturating_add(timeout);
                if end <= now {
                    let what = if client.unsent.is_empty() { "sends" } else { "takes" };
                    let time = timeout.as_secs_f64();
                    let why = format!("the client {what} nothing for {time} s, see --idle-timeout");
                    self.close(key, now, &why);
                    continue;
                }
                self.wait_until(end);
            }
            self.serve(key, now);
        }
    }

    fn wait_until(&mut self, at: Duration) {
        self.due = Some(self.due.map_or(at, |due| due.min(at)));
    }

    fn close(&mut self, key: usize, now: Duration, why: &str) {
        let Some(mut client) = self.clients.try_remove(key) else { return };
        // What was answered before is sent, as far as there is room.
        _ = client.stream.write(&client.unsent);
        _ = client.stream.shutdown(Shutdown::Both);
        _ = self.poll.registry().deregister(&mut client.stream);
        client.session.handle_disconnected(now);
        while let Some(event) = client.session.poll_event() {
            _ = (self.handle)(Notice::Event(client.peer, event));
        }
        _ = (self.handle)(Notice::Disconnected(client.peer, why));
        if let Some(path) = self.service.trace.finish(why) {
            _ = (self.handle)(Notice::Traced(path));
        }
    }
}

/// What a turn of a client needs beside the client.
struct Turn<'a, H> {
    service: &'a Service<'a>,
    handle: &'a mut H,
    now: Duration,
}

impl<S: Session> Client<S> {
    /// True when there is more to read; why the connection is to be closed.
    fn serve<H>(&mut self, input: &mut [u8], out: &mut [u8], turn: &mut Turn<'_, H>) -> Result<bool, String>
    where
        H: FnMut(Notice<'_, S::Event>) -> ControlFlow<String>,
    {
        self.settle(out, turn)?;
        for _ in 0..READS {
            self.flush(turn.now)?;
            if !self.is_readable || !self.unsent.is_empty() {
                return Ok(false);
            }
            match self.stream.read(input) {
                Ok(0) => return Err("the client closed the connection".into()),
                Ok(length) => {
                    // On Unix what comes after a read that was not filled is an event again; an end that was reported is not. On
                    // Windows nothing is until a read would have to wait.
                    self.is_readable = length == input.len() || self.is_ended || cfg!(windows);
                    self.active = turn.now;
                    let bytes = input.get(..length).unwrap_or_default();
                    turn.service.trace.add(turn.now, Way::Received, bytes);
                    self.session.handle_input(turn.now, bytes);
                    self.settle(out, turn)?;
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => self.is_readable = false,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error.to_string()),
            }
        }
        self.flush(turn.now)?;
        Ok(self.unsent.is_empty())
    }

    fn settle<H>(&mut self, out: &mut [u8], turn: &mut Turn<'_, H>) -> Result<(), String>
    where
        H: FnMut(Notice<'_, S::Event>) -> ControlFlow<String>,
    {
        let Self { session, unsent, peer, .. } = self;
        let mut steps = Steps::NEW;
        loop {
            match steps.next(session, turn.now, out) {
                Step::Event(event) => {
                    if let ControlFlow::Break(why) = (turn.handle)(Notice::Event(*peer, event)) {
                        return Err(why);
                    }
                }
                Step::Write(bytes) => {
                    turn.service.trace.add(turn.now, Way::Sent, bytes);
                    unsent.extend_from_slice(bytes);
                }
                Step::Wait { .. } => return Ok(()),
            }
        }
    }

    /// Sends what the system takes.
    fn flush(&mut self, now: Duration) -> Result<(), String> {
        while !self.unsent.is_empty() {
            match self.stream.write(&self.unsent) {
                Ok(length) => {
                    self.unsent.drain(..length);
                    self.active = now;
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error.to_string()),
            }
        }
        Ok(())
    }
}
