//! `cellwire modbus poll`.

use std::time::{Duration, Instant};

use anyhow::{Error, Result};
use serde_json::{Map, Value, json};

use super::range::{Range, values};
use super::{PortArgs, silent_unit};
use crate::devices::fanuc_hmi_modbus::client::{Client, Port, PortKind, RequestOutcome};
use cellwire_io::backoff::Backoff;
use cellwire_io::clock::Clock;
use cellwire_io::drive::ConnectionLost;
use cellwire_io::input::time;
use cellwire_io::interrupt::{self, Policy};
use cellwire_io::output::{log, remark};
use cellwire_io::tcp;

/// Polls addresses, and prints changes.
///
/// The first line of each range has all of its values; each later line has one changed value, with the time in seconds
/// since the start, the old and the new value. A read error of a range is a line, and so is its end; likewise
/// a lost connection, which is reopened after a pause of 0.1 to 5 s, longer each time until the server replies. A server
/// over TCP that is off at the start is waited for in the same way. Runs for the time of --for, or until interrupted.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The server: HOST:PORT, or the name of a serial port
    server: String,
    /// PDU addresses to poll: TABLE:FIRST-LAST, where TABLE is coils, discrete, input or holding
    #[arg(required = true, value_name = "RANGE")]
    ranges: Vec<Range>,
    /// The polling period
    #[arg(long, value_name = "TIME", default_value = "500ms", value_parser = time(Duration::from_millis(1)..=Duration::from_secs(86_400)))]
    every: Duration,
    /// How long to read, from the first request on [default: until interrupted]
    #[arg(long = "for", value_name = "TIME", value_parser = time(Duration::from_millis(1)..=Duration::MAX))]
    duration: Option<Duration>,
    #[command(flatten)]
    port: PortArgs,
}

/// An interrupt is seen after this time at the latest.
const INTERRUPT_CHECK_INTERVAL: Duration = Duration::from_millis(100);

pub(super) fn poll(args: &Args) -> Result<bool> {
    interrupt::on_interrupt(Policy::Note)?;
    let (port, unit) = args.port.port(&args.server, super::REPLY)?;
    let mut client = open(&port, args.duration)?;
    // The time of --for begins with the first request.
    let end = Instant::now() + client.first_wait();
    while Instant::now() < end && !interrupt::requested() {
        client.idle(end.saturating_duration_since(Instant::now()).min(INTERRUPT_CHECK_INTERVAL))?;
    }
    let parts = args.ranges.iter().flat_map(|range| range.parts(range.most()));
    let mut watched: Vec<WatchedRange> = parts.map(|range| WatchedRange { range, shown: None }).collect();
    let (clock, every) = (Clock::start(), args.every);
    let (mut all, mut hinted) = (true, false);
    let mut next = clock.now();
    let goes_on = || args.duration.is_none_or(|end| clock.now() < end) && !interrupt::requested();
    while goes_on() {
        for watched in &mut watched {
            let answer = match watched.read(unit, &mut client) {
                Ok(answer) => answer,
                Err(error) => {
                    all = false;
                    again(&mut client, error, &clock, goes_on)?;
                    break;
                }
            };
            all &= answer.is_ok();
            for line in watched.changes(answer) {
                log(&event(&clock, line))?;
            }
            if let Some(unit) = client.silent_unit().filter(|_| !core::mem::replace(&mut hinted, true)) {
                remark(&silent_unit(&args.server, unit));
            }
        }
        // Missed polls are not made up for.
        next = (next + every).max(clock.now());
        while goes_on() && clock.now() < next {
            let step = next.saturating_sub(clock.now()).min(INTERRUPT_CHECK_INTERVAL);
            if let Err(error) = client.idle(step) {
                all = false;
                again(&mut client, error, &clock, goes_on)?;
            }
        }
    }
    Ok(all)
}

/// Opens a client. A server over TCP that is off is waited for.
///
/// # Errors
/// [`ConnectionLost`] if it is off until the end; when a serial port cannot be opened, or the name of a server has no address.
fn open(port: &Port, duration: Option<Duration>) -> Result<Client> {
    let (clock, mut backoff, mut is_reported) = (Clock::start(), Backoff::default(), false);
    if let PortKind::Tcp { server, .. } = &port.kind {
        tcp::resolve(server).map(drop)?;
    }
    let goes_on = || duration.is_none_or(|end| clock.now() < end) && !interrupt::requested();
    loop {
        match (super::open(port), &port.kind) {
            (Ok(client), _) if is_reported => {
                log(&event(&clock, json!({"event": "connected"})))?;
                return Ok(client);
            }
            (Ok(client), _) => return Ok(client),
            (Err(error), PortKind::Serial { .. }) => return Err(error),
            (Err(error), PortKind::Tcp { .. }) if !core::mem::replace(&mut is_reported, true) => {
                log(&event(&clock, json!({"event": "not_connected", "why": format!("{error:#}")})))?;
            }
            (Err(error), PortKind::Tcp { .. }) if !goes_on() => {
                return Err(ConnectionLost(format!("{error:#}")).into());
            }
            _ => {}
        }
        backoff.wait(goes_on);
    }
}

/// Reports that the connection is lost, and connects again.
fn again(client: &mut Client, error: Error, clock: &Clock, goes_on: impl Fn() -> bool) -> Result<()> {
    if !error.is::<ConnectionLost>() {
        return Err(error);
    }
    log(&event(clock, json!({"event": "disconnected", "why": error.to_string()})))?;
    if !client.regain(goes_on) {
        return Err(error);
    }
    log(&event(clock, json!({"event": "reconnected"})))
}

/// Returns a line with its time.
fn event(clock: &Clock, line: Value) -> Value {
    let seconds = (clock.now().as_secs_f64() * 1e3).round() / 1e3;
    let mut object = Map::from_iter([("time".into(), json!(seconds))]);
    if let Value::Object(line) = line {
        object.extend(line);
    }
    Value::Object(object)
}

/// The range of one request, and its values that were shown last.
struct WatchedRange {
    range: Range,
    shown: Option<Result<Vec<Value>, String>>,
}

/// The reason why a range could not be read.
struct ReadFailure {
    /// The reason, which is the same as long as nothing changes.
    why: String,
    /// The same, with the bytes that came in place of the reply.
    explained: String,
}

impl From<String> for ReadFailure {
    fn from(why: String) -> Self {
        Self { explained: why.clone(), why }
    }
}

impl WatchedRange {
    fn read(&self, unit: u8, client: &mut Client) -> Result<Result<Vec<Value>, ReadFailure>> {
        let Some(request) = self.range.request() else { return Ok(Err("too many".to_owned().into())) };
        Ok(match client.ask(unit, &request, values)? {
            RequestOutcome::Replied(values) => values.map_err(ReadFailure::from),
            RequestOutcome::Failed(failure) => {
                Err(ReadFailure { why: failure.to_string(), explained: client.explain(failure) })
            }
            RequestOutcome::Announced => Err("unit 0 is a broadcast, without a reply".to_owned().into()),
        })
    }

    /// Returns the lines that show the changes.
    fn changes(&mut self, answer: Result<Vec<Value>, ReadFailure>) -> Vec<Value> {
        let name = self.range.name();
        let place = |more: Value| {
            let mut line = Map::from_iter([("table".into(), json!(name))]);
            if let Value::Object(more) = more {
                line.extend(more);
            }
            Value::Object(line)
        };
        let first = self.range.first;
        let lines = match (&self.shown, &answer) {
            (Some(Ok(before)), Ok(values)) => (u32::from(first)..)
                .zip(before.iter().zip(values))
                .filter(|(_, (before, value))| before != value)
                .map(|(address, (before, value))| {
                    place(json!({"address": address, "was": before, "is": value}))
                })
                .collect(),
            (_, Ok(values)) => vec![place(json!({"address": first, "values": values}))],
            (Some(Err(before)), Err(unread)) if *before == unread.why => Vec::new(),
            (_, Err(unread)) => vec![place(json!({"address": first, "failed": unread.explained}))],
        };
        self.shown = Some(answer.map_err(|unread| unread.why));
        lines
    }
}
