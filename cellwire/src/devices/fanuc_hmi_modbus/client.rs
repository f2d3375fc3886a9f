//! A Modbus client that asks one thing at a time, over TCP or a serial line.

use std::ops::ControlFlow;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::Result;
use cellwire_io::serial::Mode;
use fanuc_hmi_modbus::{
    self as modbus, ClientConfig, ClientEvent, DecodeError, Failure, Frame, Framing, Reply, Request,
};
use robot_session::end::End as _;
use robot_session::{Driver, EndReason, Session as _};

use cellwire_io::backoff::Backoff;
use cellwire_io::drive::ConnectionLost;
use cellwire_io::output::remark;
use cellwire_io::port::AnyPort;
use cellwire_io::stream::Stream;
use cellwire_io::tcp::Dialing;
use cellwire_io::tls::{Carrier, Tls};

/// A connection that the client itself has replaced is tried again for this long.
const REGAINED: Duration = Duration::from_secs(5);

/// The address of a server, and the settings of the connection.
#[derive(Debug, Clone)]
pub struct Port {
    /// The connection or the line, with its address.
    pub kind: PortKind,
    /// The configuration of the session.
    pub config: ClientConfig,
    /// The settings by which a connection is opened.
    pub dialing: Dialing,
}

/// A connection or a line.
#[derive(Debug, Clone)]
pub enum PortKind {
    /// A TCP connection to a server.
    Tcp {
        /// The address of the server, `HOST:PORT`.
        server: String,
        /// Whether RTU frames go through the connection.
        rtu: bool,
        /// The TLS of the connection; `None` without.
        tls: Option<Tls>,
    },
    /// A serial port, with RTU.
    Serial {
        /// The path of the serial port.
        path: String,
        /// The rate of the line, in baud.
        baud: u32,
        /// The data bits, parity and stop bits of the line.
        mode: Mode,
    },
}

impl Port {
    /// Modbus TCP with a timeout of a second.
    pub fn tcp(server: &str, dialing: Dialing) -> Self {
        Self::new(PortKind::Tcp { server: server.to_owned(), rtu: false, tls: None }, dialing)
    }

    /// Creates a client with the configuration for this kind of port.
    pub fn new(kind: PortKind, dialing: Dialing) -> Self {
        let config = match kind {
            PortKind::Tcp { rtu: false, .. } => ClientConfig::tcp(),
            PortKind::Tcp { rtu: true, .. } => ClientConfig::rtu_over_tcp(),
            PortKind::Serial { baud, .. } => ClientConfig::rtu(baud),
        };
        Self { kind, config, dialing }
    }

    /// Returns HOST:PORT, or the path of the serial port.
    pub fn server(&self) -> &str {
        match &self.kind {
            PortKind::Tcp { server, .. } => server,
            PortKind::Serial { path, .. } => path,
        }
    }

    fn open(&self) -> Result<Carrier<AnyPort>> {
        Ok(match &self.kind {
            PortKind::Tcp { server, tls, .. } => {
                let plain = |stream| AnyPort::Tcp(Stream::new(stream));
                Carrier::connect(server, self.dialing, tls.as_ref(), plain)?
            }
            PortKind::Serial { path, baud, mode } => {
                Carrier::Plain(AnyPort::open_with(path, *baud, *mode, self.dialing)?)
            }
        })
    }
}

/// A session, and the transport of its bytes.
#[allow(missing_debug_implementations, reason = "it holds a port")]
pub struct Client {
    port: Port,
    driver: Driver<Carrier<AnyPort>>,
    session: modbus::Client<1>,
    /// The next request needs another connection.
    is_used_up: bool,
    /// The pauses before another connection.
    backoff: Backoff,
    /// The first bytes that came in place of the reply to the last request, in words.
    instead: Option<String>,
    /// The time at which the connection was opened.
    opened: Instant,
    seen: RequestFacts,
}

/// Facts about all requests of a client, for remarks at the end of a command.
#[derive(Debug, Default)]
struct RequestFacts {
    /// The unit of the first request that timed out.
    silent_unit: Option<u8>,
    /// The replies that came after their timeout.
    late_replies: u64,
    /// The connections that the server closed, or that broke.
    lost_connections: u64,
    /// An exception came with a wrong length.
    has_odd_exceptions: bool,
}

/// The outcome of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RequestOutcome<T> {
    /// The value that was read from the reply, or from the exception.
    Replied(T),
    /// The request was sent as a broadcast, which has no reply.
    Announced,
    /// There is no usable reply.
    Failed(Failure),
}

impl Client {
    /// Opens a client with a connection.
    ///
    /// # Errors
    /// If there is no connection, no such port, or the configuration cannot work.
    pub fn open(port: &Port) -> Result<Self> {
        let mut session = modbus::Client::new(port.config)?;
        let driver = Driver::new(port.open()?);
        session.handle_connected(robot_session::now());
        Ok(Self {
            port: port.clone(),
            driver,
            session,
            is_used_up: false,
            backoff: Backoff::default(),
            instead: None,
            opened: Instant::now(),
            seen: RequestFacts::default(),
        })
    }

    /// Makes one request, and returns the result of `read` for the reply.
    ///
    /// # Errors
    /// [`ConnectionLost`] if the connection is lost: [`lost`](Self::lost) describes the effect on the request; also a
    /// request that the specification does not allow.
    pub fn ask<T>(
        &mut self,
        unit: u8,
        request: &Request<'_>,
        mut read: impl FnMut(Frame<Reply<'_>>) -> T,
    ) -> Result<RequestOutcome<T>> {
        // A server that has room for one connection may not have seen the end of the last one yet: it refuses this one, or
        // closes it.
        let (is_own, end) = (self.is_used_up, Instant::now() + REGAINED);
        loop {
            let asked = self.ask_once(unit, request, &mut read);
            let again =
                |error: &anyhow::Error| is_own && error.is::<ConnectionLost>() && changes_nothing(request);
            match asked {
                Err(error) if again(&error) => {
                    let pause = self.backoff.pause();
                    if Instant::now() + pause >= end {
                        return Err(error);
                    }
                    thread::sleep(pause);
                    self.is_used_up = true;
                }
                answer => return answer,
            }
        }
    }

    fn ask_once<T>(
        &mut self,
        unit: u8,
        request: &Request<'_>,
        mut read: impl FnMut(Frame<Reply<'_>>) -> T,
    ) -> Result<RequestOutcome<T>> {
        self.request(unit, request)?;
        loop {
            if let Some(answer) = self.answer(unit, None, &mut read)? {
                return Ok(answer);
            }
        }
    }

    /// Begins a request, on another connection if this one is used up. [`answer`](Self::answer) returns its outcome.
    ///
    /// # Errors
    /// As [`ask`](Self::ask).
    pub fn request(&mut self, unit: u8, request: &Request<'_>) -> Result<()> {
        if self.is_used_up {
            self.reconnect()?;
        }
        // Bytes that have arrived before the request are not a reply to it.
        self.turn(Some(Duration::ZERO), |_| ())?;
        self.instead = None;
        self.session.request(unit, request)?;
        Ok(())
    }

    /// Waits for the outcome of a request to `unit`; `None` after `wait`.
    ///
    /// # Errors
    /// As [`ask`](Self::ask).
    pub fn answer<T>(
        &mut self,
        unit: u8,
        wait: Option<Duration>,
        read: impl FnMut(Frame<Reply<'_>>) -> T,
    ) -> Result<Option<RequestOutcome<T>>> {
        let Some(answer) = self.turn(wait, read)? else { return Ok(None) };
        if let RequestOutcome::Replied(_) = answer {
            self.backoff.answered();
        }
        if matches!(answer, RequestOutcome::Failed(Failure::TimedOut)) {
            self.seen.silent_unit.get_or_insert(unit);
        }
        let pending = self.session.pending();
        if matches!(answer, RequestOutcome::Failed(Failure::TimedOut)) && pending > 0 {
            let instead = || format!("an incomplete reply, of which {pending} bytes have arrived");
            self.instead.get_or_insert_with(instead);
        }
        self.is_used_up = matches!(answer, RequestOutcome::Failed(_)) && self.is_best_connected_again();
        Ok(Some(answer))
    }

    /// Explains the failure of the last request, with the message that came in place of its reply.
    pub fn explain(&self, failure: Failure) -> String {
        match (&self.instead, failure) {
            (Some(instead), Failure::TimedOut) => format!("{failure}; received instead: {instead}"),
            _ => failure.to_string(),
        }
    }

    /// Returns the time before the first request on a serial line: a reply to a request of an earlier client may still come.
    pub const fn first_wait(&self) -> Duration {
        let ClientConfig { framing, timeout, settle, .. } = self.port.config;
        if matches!(framing, Framing::Rtu { .. }) { timeout.saturating_add(settle) } else { Duration::ZERO }
    }

    /// Returns the time at which the connection was opened.
    pub const fn opened(&self) -> Instant {
        self.opened
    }

    /// Returns the unit of the first request that timed out.
    pub const fn silent_unit(&self) -> Option<u8> {
        self.seen.silent_unit
    }

    /// Returns the number of replies that came after their timeout.
    pub const fn late_replies(&self) -> u64 {
        self.seen.late_replies
    }

    /// Returns the number of connections that the server closed, or that broke.
    pub const fn lost_connections(&self) -> u64 {
        self.seen.lost_connections
    }

    /// Opens another connection in place of one that is lost, after a pause that is longer each time until the server has
    /// replied. Returns false when `goes_on` is over before.
    pub fn regain(&mut self, goes_on: impl Fn() -> bool) -> bool {
        while self.backoff.wait(&goes_on) {
            if self.reconnect().is_ok() {
                return true;
            }
        }
        false
    }

    /// Reads the bytes that come meanwhile, for this long: unexpected replies, and the end of the connection.
    ///
    /// # Errors
    /// As [`ask`](Self::ask).
    pub fn idle(&mut self, time: Duration) -> Result<()> {
        if self.is_used_up {
            thread::sleep(time);
            return Ok(());
        }
        self.turn(Some(time), |_| ()).map(drop)
    }

    /// Reports the loss of the connection, and returns its effect on the last request.
    pub fn lost(&mut self) -> Failure {
        self.session.handle_disconnected(robot_session::now());
        let outcome = core::iter::from_fn(|| self.session.poll_event()).find_map(|event| match event {
            ClientEvent::Failed { failure, .. } => Some(failure),
            _ => None,
        });
        outcome.unwrap_or(Failure::NotSent)
    }

    /// Runs one turn of the driver; returns the outcome of the request, if it has one.
    fn turn<T>(
        &mut self,
        wait: Option<Duration>,
        mut read: impl FnMut(Frame<Reply<'_>>) -> T,
    ) -> Result<Option<RequestOutcome<T>>> {
        let (instead, seen) = (&mut self.instead, &mut self.seen);
        let turn = self.driver.turn(&mut self.session, wait, |session, event| {
            match answer(session, event, instead, seen, &mut read) {
                Some(answer) => ControlFlow::Break(answer),
                None => ControlFlow::Continue(()),
            }
        });
        let why = match turn {
            Ok(ControlFlow::Continue(())) => return Ok(None),
            Ok(ControlFlow::Break(EndReason::ByHandler(answer))) => return Ok(Some(answer)),
            Ok(ControlFlow::Break(EndReason::ByPeer)) => "the server closed the connection".into(),
            Ok(ControlFlow::Break(EndReason::Stalled)) => "the server does not read".into(),
            Err(error) => format!("the connection broke: {error}"),
        };
        self.seen.lost_connections += 1;
        Err(ConnectionLost(why).into())
    }

    /// Returns whether a new connection is best after a failure. Without it, the rest of a truncated reply would be taken
    /// for a part of the next one; and with RTU over TCP, the wait for a late reply is much longer than a new connection.
    fn is_best_connected_again(&self) -> bool {
        let config = self.session.config();
        match self.port.kind {
            PortKind::Tcp { rtu, .. } => self.session.pending() > 0 || rtu && config.settle > config.timeout,
            PortKind::Serial { .. } => false,
        }
    }

    /// Opens another connection in place of this one.
    ///
    /// # Errors
    /// [`ConnectionLost`] when there is no connection.
    fn reconnect(&mut self) -> Result<()> {
        self.session.handle_disconnected(robot_session::now());
        while self.session.poll_event().is_some() {}
        // Close the old connection first: some servers accept only one.
        match self.driver.transport_mut() {
            Carrier::Plain(port) => port.close(),
            Carrier::Secure(stream) => stream.close(),
        }
        self.driver = Driver::new(self.port.open().map_err(|error| ConnectionLost(format!("{error:#}")))?);
        self.is_used_up = false;
        self.opened = Instant::now();
        self.session.handle_connected(robot_session::now());
        Ok(())
    }
}

/// Returns whether a request can be repeated without harm.
pub fn changes_nothing(request: &Request<'_>) -> bool {
    request.reads() && !matches!(request, Request::ReadWriteRegisters { .. })
}

/// Returns the answer in an event; other events are printed on standard error, and the first of them is stored in `instead`.
fn answer<T>(
    session: &modbus::Client<1>,
    event: ClientEvent,
    instead: &mut Option<String>,
    seen: &mut RequestFacts,
    read: &mut impl FnMut(Frame<Reply<'_>>) -> T,
) -> Option<RequestOutcome<T>> {
    match event {
        ClientEvent::Replied { ticket, unit } => session
            .reply(ticket)
            .map(|pdu| RequestOutcome::Replied(read(Frame { transaction: None, unit, pdu }))),
        ClientEvent::Announced { .. } => Some(RequestOutcome::Announced),
        // An exception with a wrong length is one all the same.
        ClientEvent::Failed {
            failure:
                failure @ Failure::Malformed(DecodeError::ExceptionLength { unit, function, exception, .. }),
            ..
        } => {
            // Once: such a server gives every exception so.
            if !core::mem::replace(&mut seen.has_odd_exceptions, true) {
                remark(&failure.to_string());
            }
            let pdu = Reply::Exception { function, exception };
            Some(RequestOutcome::Replied(read(Frame { transaction: None, unit, pdu })))
        }
        ClientEvent::Failed { failure, .. } => Some(RequestOutcome::Failed(failure)),
        ClientEvent::Stray { late, .. } => {
            seen.late_replies += u64::from(late.is_some());
            let what = if late.is_some() { "late" } else { "unasked" };
            remark(&format!("unexpected reply ({what}): {event}"));
            instead.get_or_insert_with(|| event.to_string());
            None
        }
        ClientEvent::Corrupt(error) | ClientEvent::OutOfStep(error) => {
            remark(&format!("corrupt: {error}"));
            instead.get_or_insert_with(|| event.to_string());
            None
        }
        ClientEvent::Echo(error) => {
            remark(&format!("echo: {error}"));
            None
        }
        _ => None,
    }
}
