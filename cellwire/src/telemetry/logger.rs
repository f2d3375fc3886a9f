//! Reads the telemetry block of a controller in regular periods, over as many connections as it takes.

use std::net::TcpStream;
use std::ops::ControlFlow;
use std::time::Duration;

use anyhow::Result;
use fanuc_hmi_modbus::{Client, ClientConfig, ClientEvent, Failure, Reply, Request, TelemetryBlock};
use robot_session::{Driver, Ended, Session as _};

use cellwire_io::backoff::Backoff;
use cellwire_io::clock::Clock;
use cellwire_io::drive::Lost;
use cellwire_io::interrupt;
use cellwire_io::tcp::{self, Dialing};
use cellwire_io::tls::{Carrier, Tls};

/// The address of the telemetry, and the interval at which it is read.
#[derive(Debug, Clone)]
pub struct Source {
    /// HOST:PORT.
    pub server: String,
    /// The Modbus unit.
    pub unit: u8,
    /// The PDU address of the block's first register.
    pub address: u16,
    /// The time from one request to the next.
    pub poll: Duration,
    /// The settings by which connections are opened.
    pub dialing: Dialing,
    /// The TLS of the connections; `None` without.
    pub tls: Option<Tls>,
    /// The session's configuration, of Modbus TCP.
    pub config: ClientConfig,
}

/// A client of a controller's telemetry.
#[derive(Debug)]
pub struct Logger {
    source: Source,
    /// The connection, or the reason that there has been none yet.
    connection: Result<Driver<Carrier<TcpStream>>, String>,
    client: Client<1>,
    clock: Clock,
    /// The pauses before another connection, until there is a block.
    backoff: Backoff,
}

/// The outcome of a request for the block, or a change of the connection.
#[derive(Debug, Clone, Copy)]
pub enum Reading<'a> {
    /// The 37 registers, as they stand, and the time from the request to them.
    Registers(&'a [u16; 37], Duration),
    /// Nothing: a timeout or an exception, in words.
    Failed(&'a str),
    /// There is no connection at the beginning, in words; the next ones try to open one.
    Absent(&'a str),
    /// The connection is lost, in words; the next ones try to open another.
    Disconnected(&'a str),
    /// An attempt has failed, in words.
    Retried(&'a str),
    /// There is a connection, after this long without one.
    Reconnected(Duration),
}

/// The number of requests in a row without a reply after which the controller counts as gone: a connection to one that was
/// switched off stays open for a quarter of an hour.
const MOST_SILENT: u32 = 3;
/// An interrupt is seen after this time at the latest.
const TURN: Duration = Duration::from_millis(100);

impl Source {
    fn connect(&self) -> Result<Driver<Carrier<TcpStream>>> {
        let tls = self.tls.as_ref();
        Ok(Driver::new(Carrier::connect(&self.server, self.dialing, tls, |stream| stream)?))
    }
}

impl Logger {
    /// A client. If the controller does not accept a connection yet, [`run`](Self::run) waits for it.
    ///
    /// # Errors
    /// When the server's name has no address, or the configuration cannot work.
    pub fn open(source: Source, clock: Clock) -> Result<Self> {
        tcp::resolve(&source.server).map(drop)?;
        let mut client = Client::new(source.config)?;
        let connection = match source.connect() {
            Ok(driver) => {
                client.handle_connected(robot_session::now());
                Ok(driver)
            }
            Err(error) => Err(format!("{error:#}")),
        };
        Ok(Self { source, connection, client, clock, backoff: Backoff::default() })
    }

    /// Reads blocks until `end`, or until `each` returns false. Where the connection is lost it is opened again.
    ///
    /// # Errors
    /// [`Lost`] when there is no connection at the end; whatever `each` fails with.
    pub fn run(
        &mut self,
        end: Option<Duration>,
        mut each: impl FnMut(Reading<'_>) -> Result<bool>,
    ) -> Result<()> {
        if let Err(why) = &self.connection {
            let lost = Lost(why.clone());
            if !each(Reading::Absent(why))? || !self.reconnect(end, &mut each)? {
                return Err(lost.into());
            }
        }
        loop {
            let Err(lost) = self.read(end, &mut each) else { return Ok(()) };
            let Some(Lost(why)) = lost.downcast_ref() else { return Err(lost) };
            if !each(Reading::Disconnected(why))? || !self.reconnect(end, &mut each)? {
                return Err(lost);
            }
        }
    }

    /// Reads blocks on this connection.
    fn read(
        &mut self,
        end: Option<Duration>,
        each: &mut impl FnMut(Reading<'_>) -> Result<bool>,
    ) -> Result<()> {
        let request = Request::ReadHoldingRegisters {
            address: self.source.address,
            quantity: TelemetryBlock::QUANTITY,
        };
        let (mut next, mut asked, mut silent) = (self.clock.now(), None, 0);
        loop {
            let now = self.clock.now();
            if end.is_some_and(|end| now >= end) || interrupt::requested() {
                return Ok(());
            }
            if asked.is_none() && now >= next {
                self.client.request(self.source.unit, &request)?;
                asked = Some(now);
                let poll = self.source.poll;
                next = (next + poll).max(now.saturating_sub(poll)); // a late run skips what it missed
            }
            let due = if asked.is_some() { None } else { Some(next) };
            let wait = due.into_iter().chain(end).min().map(|due| due.saturating_sub(now));
            let wait = wait.map_or(TURN, |wait| wait.min(TURN));
            let Ok(driver) = &mut self.connection else { return Ok(()) };
            let turn =
                driver.turn(&mut self.client, Some(wait), |client, event| match reading(client, event) {
                    Some(reading) => ControlFlow::Break(reading),
                    None => ControlFlow::Continue(()),
                });
            let reading = match turn.map_err(|error| Lost(format!("the connection broke: {error}")))? {
                ControlFlow::Continue(()) => None,
                ControlFlow::Break(Ended::ByPeer) => {
                    return Err(Lost("the controller closed the connection".into()).into());
                }
                ControlFlow::Break(Ended::Stalled) => {
                    return Err(Lost("the controller does not read".into()).into());
                }
                ControlFlow::Break(Ended::ByHandler(reading)) => Some(reading),
            };
            let Some(reading) = reading else { continue };
            let took = asked.take().map_or(Duration::ZERO, |asked| self.clock.now().saturating_sub(asked));
            silent = if matches!(reading, Answer::Silence(_)) { silent + 1 } else { 0 };
            let goes_on = match reading {
                Answer::Block(registers) => {
                    self.backoff.answered();
                    each(Reading::Registers(&registers, took))?
                }
                Answer::Silence(why) | Answer::Refusal(why) => each(Reading::Failed(&why))?,
            };
            if silent >= MOST_SILENT {
                return Err(Lost(format!("no reply to {silent} requests in a row")).into());
            }
            if !goes_on {
                return Ok(());
            }
        }
    }

    /// Opens another connection, however often it takes. False when the end has come, or `each` returns false.
    fn reconnect(
        &mut self,
        end: Option<Duration>,
        each: &mut impl FnMut(Reading<'_>) -> Result<bool>,
    ) -> Result<bool> {
        let lost = self.clock.now();
        if self.connection.is_ok() {
            self.client.handle_disconnected(robot_session::now());
        }
        while self.client.poll_event().is_some() {} // the request that was in flight: there is no block
        let clock = self.clock;
        let goes_on = || !interrupt::requested() && end.is_none_or(|end| clock.now() < end);
        while self.backoff.wait(goes_on) {
            match self.source.connect() {
                Ok(driver) => {
                    self.connection = Ok(driver);
                    self.client.handle_connected(robot_session::now());
                    return each(Reading::Reconnected(self.clock.now().saturating_sub(lost)));
                }
                Err(error) => {
                    if !each(Reading::Retried(&format!("{error:#}")))? {
                        return Ok(false);
                    }
                }
            }
        }
        Ok(false)
    }
}

/// The outcome of a request.
enum Answer {
    Block([u16; 37]),
    /// There is a controller, and no block.
    Refusal(String),
    /// There is no reply.
    Silence(String),
}

/// A late or unsolicited reply ends nothing: the request is still in flight.
fn reading(client: &Client<1>, event: ClientEvent) -> Option<Answer> {
    Some(match event {
        ClientEvent::Replied { ticket, .. } => match client.reply(ticket)? {
            Reply::HoldingRegisters(words) => match words.first_chunk() {
                Some(registers) => Answer::Block(registers),
                None => Answer::Refusal("fewer than 37 registers".into()),
            },
            Reply::Exception { exception, .. } => Answer::Refusal(exception.to_string()),
            _ => return None,
        },
        ClientEvent::Failed { failure: failure @ Failure::TimedOut, .. } => {
            Answer::Silence(failure.to_string())
        }
        ClientEvent::Failed { failure, .. } => Answer::Refusal(failure.to_string()),
        _ => return None,
    })
}
