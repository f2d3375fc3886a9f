//! Reads the telemetry block of a controller in regular periods, over as many connections as it takes.

use std::time::Duration;

use anyhow::Result;
use fanuc_hmi_modbus::{self as modbus, Failure, Frame, Reply, Request, TelemetryBlock};

use crate::devices::fanuc_hmi_modbus::client::{Client, Port, RequestOutcome};
use cellwire_io::backoff::Backoff;
use cellwire_io::clock::Clock;
use cellwire_io::drive::ConnectionLost;
use cellwire_io::interrupt;
use cellwire_io::tcp;

/// The address of the telemetry, and the interval at which it is read.
#[derive(Debug, Clone)]
pub struct TelemetrySource {
    /// The port over which the controller is reached.
    pub port: Port,
    /// The Modbus unit, 0 to 255.
    pub unit: u8,
    /// The PDU address of the block's first register.
    pub address: u16,
    /// The time from one request to the next.
    pub poll: Duration,
}

/// A client of a controller's telemetry.
#[allow(missing_debug_implementations, reason = "it holds a port")]
pub struct Logger {
    source: TelemetrySource,
    /// The client on its connection, or the reason that there has been none yet.
    client: Result<Client, String>,
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
const MAX_SILENT: u32 = 3;
/// An interrupt is seen after this time at the latest.
const INTERRUPT_CHECK_INTERVAL: Duration = Duration::from_millis(100);

impl Logger {
    /// Opens a client. If the controller does not accept a connection yet, [`run`](Self::run) waits for it.
    ///
    /// # Errors
    /// If the server's name has no address, or the configuration cannot work.
    pub fn open(source: TelemetrySource, clock: Clock) -> Result<Self> {
        tcp::resolve(source.port.server()).map(drop)?;
        modbus::Client::<1>::new(source.port.config)?;
        let client = Client::open(&source.port).map_err(|error| format!("{error:#}"));
        Ok(Self { source, client, clock, backoff: Backoff::default() })
    }

    /// Reads blocks until `end`, or until `each` returns false. Where the connection is lost it is opened again.
    ///
    /// # Errors
    /// [`ConnectionLost`] if there is no connection at the end; any error of `each`.
    pub fn run(
        &mut self,
        end: Option<Duration>,
        mut each: impl FnMut(Reading<'_>) -> Result<bool>,
    ) -> Result<()> {
        if let Err(why) = &self.client {
            let lost = ConnectionLost(why.clone());
            if !each(Reading::Absent(why))? || !self.reconnect(end, &mut each)? {
                return Err(lost.into());
            }
        }
        loop {
            let Err(lost) = self.read(end, &mut each) else { return Ok(()) };
            let Some(ConnectionLost(why)) = lost.downcast_ref() else { return Err(lost) };
            self.client = Err(why.clone()); // the controller may accept one connection
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
        let TelemetrySource { unit, address, poll, .. } = self.source;
        let request = Request::ReadHoldingRegisters { address, quantity: TelemetryBlock::QUANTITY };
        let (mut next, mut asked, mut silent) = (self.clock.now(), None, 0);
        loop {
            let now = self.clock.now();
            if end.is_some_and(|end| now >= end) || interrupt::requested() {
                return Ok(());
            }
            let Ok(client) = &mut self.client else { return Ok(()) };
            if asked.is_none() && now >= next {
                client.request(unit, &request)?;
                asked = Some(now);
                next = (next + poll).max(now.saturating_sub(poll)); // a late run skips what it missed
            }
            let due = if asked.is_some() { None } else { Some(next) };
            let wait = due.into_iter().chain(end).min().map(|due| due.saturating_sub(now));
            let wait = wait.map_or(INTERRUPT_CHECK_INTERVAL, |wait| wait.min(INTERRUPT_CHECK_INTERVAL));
            let Some(answer) = client.answer(unit, Some(wait), block)? else { continue };
            let took = asked.take().map_or(Duration::ZERO, |asked| self.clock.now().saturating_sub(asked));
            let is_silent = matches!(answer, RequestOutcome::Failed(Failure::TimedOut));
            silent = if is_silent { silent + 1 } else { 0 };
            let goes_on = match answer {
                RequestOutcome::Replied(Ok(registers)) => {
                    self.backoff.answered();
                    each(Reading::Registers(&registers, took))?
                }
                RequestOutcome::Replied(Err(why)) => each(Reading::Failed(&why))?,
                RequestOutcome::Failed(failure) => each(Reading::Failed(&failure.to_string()))?,
                RequestOutcome::Announced => each(Reading::Failed("unit 0 is a broadcast, without a reply"))?,
            };
            if silent >= MAX_SILENT {
                return Err(ConnectionLost(format!("no reply to {silent} requests in a row")).into());
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
        let clock = self.clock;
        let goes_on = || !interrupt::requested() && end.is_none_or(|end| clock.now() < end);
        while self.backoff.wait(goes_on) {
            match Client::open(&self.source.port) {
                Ok(client) => {
                    self.client = Ok(client);
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

/// Returns the block in a reply, or the reason why the reply lacks one.
fn block(reply: Frame<Reply<'_>>) -> Result<[u16; 37], String> {
    match reply.pdu {
        Reply::HoldingRegisters(words) => words.first_chunk().ok_or("fewer than 37 registers".into()),
        Reply::Exception { exception, .. } => Err(exception.to_string()),
        _ => Err("the reply has no registers".into()),
    }
}
