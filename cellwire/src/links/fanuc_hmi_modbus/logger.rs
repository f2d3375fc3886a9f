//! Reads the telemetry block of a controller once in every period of its background task.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use fanuc_hmi_modbus::client::{Client, Config, Event};
use fanuc_hmi_modbus::{Reply, TelemetryBlock};

use crate::line::Clock;
use crate::tcp;

/// A client of a controller's telemetry.
#[derive(Debug)]
pub struct Logger {
    socket: TcpStream,
    client: Client,
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
    /// Connects to a controller's Modbus TCP port.
    ///
    /// # Errors
    /// When nobody listens there.
    pub fn connect(address: &str, unit: u8, period: Duration, clock: Clock) -> Result<Self> {
        let socket = tcp::connect(address)?;
        Ok(Self { socket, client: Client::new(Config::tcp()), clock, unit, period })
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
        let (mut next, mut asked, mut buffer) = (self.clock.now(), None, [0; 4096]);
        loop {
            let now = self.clock.now();
            if end.is_some_and(|end| now >= end) {
                return Ok(());
            }
            if asked.is_none() && now >= next {
                self.client.request(self.unit, &TelemetryBlock::request())?;
                next = (next + self.period).max(now.saturating_sub(self.period)); // a late run skips what it missed
            }
            while let Some(len) = self.client.poll_transmit(self.clock.now(), &mut buffer) {
                asked = Some(self.clock.now());
                let request = buffer.get(..len).unwrap_or_default();
                self.socket.write_all(request).context("the controller is gone")?;
            }
            let due = self.client.poll_timeout().unwrap_or(next).min(end.unwrap_or(Duration::MAX));
            let wait = due.saturating_sub(self.clock.now()).max(Duration::from_micros(100));
            if asked.is_none() {
                thread::sleep(wait);
                continue;
            }
            self.socket.set_read_timeout(Some(wait))?;
            let mut bytes = match self.socket.read(&mut buffer) {
                Ok(0) => bail!("the controller closed the connection"),
                Ok(n) => buffer.get(..n).unwrap_or_default(),
                Err(e) if tcp::is_silence(&e) => &[],
                Err(e) => return Err(e).context("the connection broke"),
            };
            loop {
                let taken = self.client.handle_input(self.clock.now(), bytes);
                bytes = bytes.get(taken..).unwrap_or_default();
                self.client.handle_timeout(self.clock.now());
                while let Some(event) = self.client.poll_event() {
                    let took = asked.map_or(Duration::ZERO, |asked| self.clock.now().saturating_sub(asked));
                    let Some(reading) = reading(&event, took) else { continue };
                    asked = None;
                    let goes_on = match reading {
                        Ok((registers, took)) => each(Reading::Registers(&registers, took))?,
                        Err(why) => each(Reading::Failed(&why))?,
                    };
                    if !goes_on {
                        return Ok(());
                    }
                }
                if bytes.is_empty() {
                    break;
                }
            }
        }
    }
}

/// What ends a request. A late reply, or one that nobody asked for, does not: the request is still out.
fn reading(event: &Event<'_>, took: Duration) -> Option<Result<([u16; 37], Duration), String>> {
    Some(match event {
        Event::Reply { reply: Reply::HoldingRegisters(words), .. } => {
            words.first_chunk().map(|registers| (registers, took)).ok_or("fewer than 37 registers".into())
        }
        Event::Reply { reply: Reply::Exception { exception, .. }, .. } => Err(exception.to_string()),
        Event::Failed { failure, .. } => Err(failure.to_string()),
        _ => return None,
    })
}
