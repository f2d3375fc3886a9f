//! `cellwire modbus scan`.

use core::ops::RangeInclusive;
use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use anyhow::Result;
use fanuc_hmi_modbus::{Exception, Failure, Mismatch, Reply, Request};
use indicatif::{ProgressBar, ProgressDrawTarget};
use serde_json::json;

use super::PortArgs;
use super::range::{Range, TABLES};
use super::retries::RetryStatistics;
use crate::devices::fanuc_hmi_modbus::client::{Client, RequestOutcome};
use cellwire_io::bar;
use cellwire_io::drive::ConnectionLost;
use cellwire_io::interrupt::{self, Policy};
use cellwire_io::output::{log, remark};

/// The number of times that a request is made whose connection is lost.
const MAX_ATTEMPTS: usize = 2;
/// More units than this do not reply alike by chance.
const ALIKE: usize = 16;
/// A server that cannot be connected to for this long ends the scan.
const GIVEN_UP: Duration = Duration::from_secs(20);

/// Scans for units, or with --ranges for the readable addresses of one unit. Sends only read requests.
///
/// Units: reads holding register 0 of each. Any reply counts, also an exception, except for a gateway's report that a unit
/// does not respond (exceptions 10 and 11). A missing unit costs the timeout, on a serial line twice.
/// A request without a reply is made again if it was the first of its connection, or followed a reply: a warning then names
/// the setting that the server needs. The scan ends when the server has closed 8 connections without a reply.
///
/// Ranges: a refused range is split in halves, down to single addresses. Prints each readable range.
/// A sparse table takes many requests: limit it with --from and --to.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The server: HOST:PORT, or the name of a serial port
    server: String,
    /// The units to scan
    #[arg(long, value_name = "A-B", default_value = "1-247", value_parser = units)]
    units: RangeInclusive<u8>,
    /// Scan the addresses of --unit instead
    #[arg(long)]
    ranges: bool,
    /// The first address to try
    #[arg(long, value_name = "N", default_value_t = 0)]
    from: u16,
    /// The last address to try
    #[arg(long, value_name = "N", default_value_t = u16::MAX)]
    to: u16,
    #[command(flatten)]
    port: PortArgs,
}

pub(super) fn scan(args: &Args) -> Result<bool> {
    interrupt::on_interrupt(Policy::Note)?;
    let timeout = if args.ranges { super::REPLY } else { Duration::from_millis(200) };
    // A late reply names its unit: the wait for it need not be longer than the one for the reply.
    let (port, unit) = args.port.port_with(&args.server, timeout, |config| {
        config.settle = config.settle.min(config.timeout);
    })?;
    let mut client = super::open(&port)?;
    let mut seen = RetryStatistics::new();
    let found = if args.ranges {
        ranges(args, unit, &mut client, &mut seen)
    } else {
        units_of(args, &mut client, &mut seen)
    };
    seen.report(&client);
    let found = found?;
    if found == 0 {
        remark(if args.ranges { "no readable addresses" } else { "no unit replied" });
    }
    Ok(found > 0)
}

fn units_of(args: &Args, client: &mut Client, seen: &mut RetryStatistics) -> Result<u64> {
    let progress = progress(args.units.clone().count() as u64);
    let (mut found, mut replies) = (0, BTreeSet::new());
    for unit in args.units.clone() {
        if interrupt::requested() {
            break;
        }
        if seen.closes_all(client) {
            remark(&format!("units {unit} to {} were not asked", args.units.end()));
            break;
        }
        progress.inc(1);
        progress.set_message(format!("unit {unit}, {found} found"));
        let request = Request::ReadHoldingRegisters { address: 0, quantity: 1 };
        let Some(answer) = seen.ask(client, |client| ask(client, unit, &request))? else { break };
        let reply = match answer {
            RequestOutcome::Replied(Ok(())) => "has holding register 0".to_owned(),
            RequestOutcome::Replied(Err(
                Exception::GatewayPathUnavailable | Exception::GatewayTargetFailedToRespond,
            )) => continue,
            RequestOutcome::Replied(Err(exception)) => exception.to_string(),
            RequestOutcome::Failed(failure) if is_malformed(failure) => failure.to_string(),
            RequestOutcome::Failed(_) | RequestOutcome::Announced => continue,
        };
        found += 1;
        log(&json!({"unit": unit, "reply": reply}))?;
        replies.insert(reply);
    }
    bar::clear_bar();
    if found > ALIKE && found == args.units.clone().count() && replies.len() == 1 {
        remark(&format!("all {found} units reply alike: the server probably ignores the unit"));
    }
    Ok(found as u64)
}

/// The result of a request for a run of addresses.
enum ScanResult {
    Read,
    /// Smaller runs may be read.
    Refused,
    /// The same: the reply cannot be used.
    Malformed(String),
    /// None can.
    Nothing(String),
}

fn ranges(args: &Args, unit: u8, client: &mut Client, seen: &mut RetryStatistics) -> Result<u64> {
    anyhow::ensure!(args.from <= args.to, "--from is after --to");
    let mut found = 0;
    for (table, name) in TABLES {
        let whole = Range { table, first: args.from, last: args.to };
        let progress = progress(whole.count().into());
        let (mut open, mut runs): (Option<Range>, Vec<Range>) = (None, Vec::new());
        let (mut why, mut malformed) = (None, false);
        // The parts that are still to try, the next one last.
        let mut parts: Vec<Range> = whole.parts(whole.most()).collect();
        parts.reverse();
        while let Some(part) = parts.pop() {
            if interrupt::requested() {
                break;
            }
            let tried = try_read(unit, client, seen, part)?;
            if let ScanResult::Malformed(reason) = &tried
                && !core::mem::replace(&mut malformed, true)
            {
                let place = format!("{name}:{}-{}", part.first, part.last);
                remark(&format!("{place} counts as refused: {reason}"));
            }
            match tried {
                ScanResult::Read => {
                    open = Some(open.map_or(part, |open: Range| Range { last: part.last, ..open }));
                }
                ScanResult::Refused | ScanResult::Malformed(_) if part.count() > 1 => {
                    let half = u16::try_from(part.count().div_ceil(2)).unwrap_or(u16::MAX);
                    let halves: Vec<Range> = part.parts(half).collect();
                    parts.extend(halves.into_iter().rev());
                    continue;
                }
                ScanResult::Refused | ScanResult::Malformed(_) => runs.extend(open.take()),
                ScanResult::Nothing(reason) => {
                    why = Some(reason);
                    break;
                }
            }
            progress.set_position(u64::from(part.last) - u64::from(args.from));
            progress.set_message(format!("{name} {}", part.last));
        }
        bar::clear_bar();
        runs.extend(open);
        for run in &runs {
            log(&json!({"table": name, "from": run.first, "to": run.last, "count": run.count()}))?;
        }
        if let Some(why) = why {
            log(&json!({"table": name, "stopped": why}))?;
        }
        found += runs.len() as u64;
    }
    Ok(found)
}

fn try_read(unit: u8, client: &mut Client, seen: &mut RetryStatistics, part: Range) -> Result<ScanResult> {
    let Some(request) = part.request() else { return Ok(ScanResult::Refused) };
    let Some(answer) = seen.ask(client, |client| ask(client, unit, &request))? else {
        return Ok(ScanResult::Nothing("the scan was interrupted".into()));
    };
    Ok(match answer {
        RequestOutcome::Replied(Ok(())) => ScanResult::Read,
        RequestOutcome::Replied(Err(exception @ Exception::IllegalFunction)) => {
            ScanResult::Nothing(exception.to_string())
        }
        RequestOutcome::Replied(Err(_)) => ScanResult::Refused,
        RequestOutcome::Failed(failure) if is_malformed(failure) => {
            ScanResult::Malformed(failure.to_string())
        }
        RequestOutcome::Failed(failure) => ScanResult::Nothing(client.explain(failure)),
        RequestOutcome::Announced => ScanResult::Nothing("unit 0 is a broadcast, without a reply".into()),
    })
}

/// Asks whether something can be read. A server that closes the connection, as some do at a request that they refuse, is
/// asked once more. `None`: the scan was interrupted.
fn ask(
    client: &mut Client,
    unit: u8,
    request: &Request<'_>,
) -> Result<Option<RequestOutcome<Result<(), Exception>>>> {
    let once = |client: &mut Client| {
        client.ask(unit, request, |reply| match reply.pdu {
            Reply::Exception { exception, .. } => Err(exception),
            _ => Ok(()),
        })
    };
    let mut failure = None;
    for _ in 0..MAX_ATTEMPTS {
        match once(client) {
            Err(error) if error.is::<ConnectionLost>() => {
                failure = Some(client.lost());
                let end = Instant::now() + GIVEN_UP;
                let goes_on = || !interrupt::requested() && Instant::now() < end;
                if !client.regain(goes_on) {
                    return if interrupt::requested() { Ok(None) } else { Err(error) };
                }
            }
            answer => return answer.map(Some),
        }
    }
    Ok(failure.map(RequestOutcome::Failed))
}

/// Returns whether the unit has answered with a reply that cannot be used.
fn is_malformed(failure: Failure) -> bool {
    match failure {
        Failure::Malformed(_) => true,
        Failure::Refused(mismatch) => !matches!(mismatch, Mismatch::Unit { .. }),
        _ => false,
    }
}

fn progress(length: u64) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::stderr_with_hz(10));
    bar::show_bar(&bar);
    bar
}

fn units(text: &str) -> Result<RangeInclusive<u8>, String> {
    let wrong = || format!("`{text}` is not FIRST-LAST, such as 1-32");
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let number = |text: &str| text.trim().parse::<u8>().map_err(|_| wrong());
    let (first, last) = (number(first)?, number(last)?);
    if first > last { Err(wrong()) } else { Ok(first..=last) }
}
