//! Reads the telemetry block of a controller once in every period of its background task.

use std::net::TcpStream;
use std::ops::ControlFlow;
use std::time::Duration;

use anyhow::Result;
use fanuc_hmi_modbus::{Client, ClientConfig, ClientEvent, Reply, TelemetryBlock};
use robot_session::{Driver, Ended, Session as _};

use crate::io::drive::Lost;
use crate::io::line::Clock;

/// A client of a controller's telemetry.
#[derive(Debug)]
pub struct Logger {
    driver: Driver<TcpStream>,
    client: Client<1>,
    clock: Clock,
    unit: u8,
    period: Duration,
}

/// What a request for the block came to.
#[derive(Debug, Clone, Copy)]
pub enum Reading<'a> {
    /// The 37 registers, as they stand, and the time from the request to them.
    Registers(&'a [u16; 37], Duration),
    /// Nothing: a timeout or an exception, in words.
    Failed(&'a str),
}

impl Logger {
    /// A client on a connection to a controller's Modbus TCP port.
    ///
    /// # Errors
    /// None.
    pub fn new(stream: TcpStream, unit: u8, period: Duration, clock: Clock) -> Result<Self> {
        let driver = Driver::new(stream);
        let mut client = Client::new(ClientConfig::tcp())?;
        client.handle_connected(robot_session::now());
        Ok(Self { driver, client, clock, unit, period })
    }

    /// Reads blocks until `end`, or until `each` returns false.
    ///
    /// # Errors
    /// When the connection breaks, or `each` fails.
    pub fn run(
        &mut self,
        end: Option<Duration>,
        mut each: impl FnMut(Reading<'_>) -> Result<bool>,
    ) -> Result<()> {
        let (mut next, mut asked) = (self.clock.now(), None);
        loop {
            let now = self.clock.now();
            if end.is_some_and(|end| now >= end) {
                return Ok(());
            }
            if asked.is_none() && now >= next {
                self.client.request(self.unit, &TelemetryBlock::request())?;
                asked = Some(now);
                next = (next + self.period).max(now.saturating_sub(self.period)); // a late run skips what it missed
            }
            let due = if asked.is_some() { None } else { Some(next) };
            let wait = due.into_iter().chain(end).min().map(|due| due.saturating_sub(now));
            let turn =
                self.driver.turn(&mut self.client, wait, |client, event| match reading(client, event) {
                    Some(reading) => ControlFlow::Break(reading),
                    None => ControlFlow::Continue(()),
                });
            let reading = match turn.map_err(|error| Lost(format!("the connection broke: {error}")))? {
                ControlFlow::Continue(()) => continue,
                ControlFlow::Break(Ended::ByPeer) => {
                    return Err(Lost("the controller closed the connection".into()).into());
                }
                ControlFlow::Break(Ended::ByHandler(reading)) => reading,
            };
            let took = asked.take().map_or(Duration::ZERO, |asked| self.clock.now().saturating_sub(asked));
            let goes_on = match reading {
                Ok(registers) => each(Reading::Registers(&registers, took))?,
                Err(why) => each(Reading::Failed(&why))?,
            };
            if !goes_on {
                return Ok(());
            }
        }
    }
}

/// What ends a request. A late reply, or one that nobody asked for, does not: the request is still in flight.
fn reading(client: &Client<1>, event: ClientEvent) -> Option<Result<[u16; 37], String>> {
    Some(match event {
        ClientEvent::Replied { ticket, .. } => match client.reply(ticket)? {
            Reply::HoldingRegisters(words) => words.first_chunk().ok_or("fewer than 37 registers".into()),
            Reply::Exception { exception, .. } => Err(exception.to_string()),
            _ => return None,
        },
        ClientEvent::Failed { failure, .. } => Err(failure.to_string()),
        _ => return None,
    })
}
