//! A client and a server, as their messages show them.

use core::time::Duration;

use anyhow::Result;
use fanuc_hmi_modbus::{ClientConfig, Frame, Framing, PduBuf, Reply, TelemetryBlock};
use serde_json::{Value, json};

use super::ends::client_config;
use super::options::{Frames, ViewSettings};
use crate::codec;
use crate::given::GivenFields;
use crate::settings;
use crate::shadow::{LineEvent, Report, Setup, Shadow, UNSEEN, ms};

const CLIENT: &str = "client";
const SERVER: &str = "server";

/// The number of requests that are remembered after they were not answered in time.
const REMEMBERED: usize = 16;

pub(super) fn shadow(setup: &Setup<'_>) -> Result<Box<dyn Shadow>> {
    let (GivenFields(mut client), GivenFields(server)) = (setup.given(CLIENT), setup.given(SERVER));
    client.remove("places");
    // Both ends have the same frames.
    for shared in ["framing", "baud", "broadcast"] {
        if let (None, Some(value)) = (client.get(shared), server.get(shared)) {
            client.insert(shared.into(), value.clone());
        }
    }
    let view = settings::read("fanuc", ViewSettings::default(), setup.settings)?;
    if view.frames == Frames::Rtu {
        let framing = if setup.is_serial { "rtu" } else { "rtu_over_tcp" };
        client.entry("framing").or_insert_with(|| framing.into());
    }
    if let Some(baud) = setup.baud.filter(|_| setup.is_serial) {
        client.insert("baud".into(), baud.into());
    }
    let config = client_config(GivenFields(client))?;
    let (is_known, since, open, malformed) = (false, None, Vec::new(), 0);
    Ok(Box::new(Modbus { config, is_known, since, open, malformed, quiet_until: Duration::ZERO }))
}

struct Modbus {
    config: ClientConfig,
    /// Every request that may still be answered was seen.
    is_known: bool,
    /// The time at which the first byte was observed.
    since: Option<Duration>,
    /// Requests without a reply, oldest first.
    open: Vec<Request>,
    /// The number of malformed requests, which are answered with an exception all the same.
    malformed: u32,
    /// The end of the turnaround delay after a broadcast.
    quiet_until: Duration,
}

struct Request {
    at: Duration,
    frame: Frame<PduBuf>,
    /// The missing reply was reported.
    is_missed: bool,
    /// Bytes that are not a reply came after the request.
    is_damaged: bool,
}

impl Shadow for Modbus {
    fn see(&mut self, seen: &LineEvent<'_>, report: &mut Report<'_>) {
        if let LineEvent::Message { .. } = seen {
            self.since.get_or_insert(report.now);
        }
        match *seen {
            LineEvent::Opened | LineEvent::Closed | LineEvent::Missed { .. } => {
                self.is_known = matches!(seen, LineEvent::Opened) && !self.is_serial();
                self.since = None;
                (self.open, self.malformed) = (Vec::new(), 0);
                self.quiet_until = Duration::ZERO;
            }
            LineEvent::Message { from: CLIENT, message, .. } => {
                match codec::read(message.clone()) {
                    Ok(frame) => self.ask(frame, report),
                    // Beyond address 65535.
                    Err(_) => self.malformed += 1,
                }
            }
            LineEvent::Message { from: SERVER, message, .. } => {
                if let Some(frame) = reply(message) {
                    self.answer(&frame, report);
                }
            }
            LineEvent::Corrupt { from: CLIENT, error, .. } => {
                let kinds =
                    ["function", "pdu_length", "quantity", "byte_count", "coil_value", "reference_type"];
                let is_kind = |kind: &str| error.get("kind").is_some_and(|found| found == kind);
                self.malformed += u32::from(kinds.into_iter().any(is_kind));
            }
            LineEvent::Corrupt { from: SERVER, .. } => {
                self.open.iter_mut().for_each(|request| request.is_damaged = true);
            }
            LineEvent::Corrupt { .. } | LineEvent::Message { .. } | LineEvent::Bytes { .. } => {}
        }
    }

    fn pass(&mut self, report: &mut Report<'_>) {
        let timeout = self.config.timeout;
        // By now, requests before the first observed byte are no longer answered.
        self.is_known |= self.since.is_some_and(|since| {
            report.now > since.saturating_add(timeout).saturating_add(self.config.settle)
        });
        for request in self.open.iter_mut().filter(|request| !request.is_missed) {
            if report.now > request.at.saturating_add(timeout) {
                request.is_missed = true;
                if !request.is_damaged {
                    let text =
                        format!("no reply to {} within timeout ({})", name(&request.frame), ms(timeout));
                    report.assumption(SERVER, "FM-42", text);
                }
            }
        }
    }

    fn state(&self) -> String {
        let open = self.open.iter().filter(|request| !request.is_missed).count();
        match (self.is_known, open) {
            (false, _) => UNSEEN.into(),
            (true, 0) => "no request is open".into(),
            (true, 1) => "a request waits for its reply".into(),
            (true, open) => format!("{open} requests wait for their replies"),
        }
    }
}

impl Modbus {
    fn is_serial(&self) -> bool {
        matches!(self.config.framing, Framing::Rtu { .. })
    }

    fn is_tcp(&self) -> bool {
        self.config.framing == Framing::Tcp
    }

    fn ask(&mut self, frame: Frame<PduBuf>, report: &mut Report<'_>) {
        let now = report.now;
        if now < self.quiet_until {
            let text = format!("a request {} before the turnaround is over", ms(self.quiet_until - now));
            report.rule(CLIENT, "FM-43", text);
        }
        let is_awaited = |request: &&Request| !request.is_missed;
        if self.is_tcp() {
            let is_same = |request: &&Request| request.frame.transaction == frame.transaction;
            if let Some(other) = self.open.iter().filter(is_awaited).find(is_same) {
                let text = format!("the transaction of {} again, which is not answered", name(&other.frame));
                report.rule(CLIENT, "FM-41", text);
            }
        } else if let Some(other) =
            self.open.iter().filter(is_awaited).find(|other| !other.is_damaged && self.is_known)
        {
            let waited = ms(now.saturating_sub(other.at));
            let text =
                format!("the next request {waited} after {}, which is not answered", name(&other.frame));
            report.rule(CLIENT, "FM-40", text);
        } else if let Some(other) = self.open.last()
            && self.is_known
            && now < other.at.saturating_add(self.config.timeout).saturating_add(self.config.settle)
        {
            let waited = ms(now.saturating_sub(other.at));
            let text =
                format!("a request {waited} after one without a reply: a late one is taken for its own");
            report.rule(CLIENT, "FM-52", text);
        }
        if self.config.is_broadcast(frame.unit) {
            self.quiet_until = now.saturating_add(self.config.turnaround);
            return;
        }
        if self.open.len() == REMEMBERED {
            self.open.remove(0);
        }
        self.open.push(Request { at: now, frame, is_missed: false, is_damaged: false });
    }

    fn answer(&mut self, frame: &Frame<PduBuf>, report: &mut Report<'_>) {
        let Ok(reply) = frame.pdu.reply() else { return };
        let Some(place) = self.request_of(frame, &reply) else {
            let of_malformed = matches!(reply, Reply::Exception { .. }) && self.malformed > 0;
            if of_malformed {
                self.malformed -= 1;
            } else if self.is_known {
                report.rule(SERVER, "FM-48", format!("{}, which was not requested", name(frame)));
            }
            return;
        };
        let late = report.now.saturating_sub(self.open.get(place).map_or(report.now, |request| request.at));
        let is_before = |request: &Request| !request.is_missed && request.frame.unit == frame.unit;
        let has_earlier = self.open.iter().take(place).any(is_before);
        let request = self.open.remove(place);
        if !self.is_tcp() {
            // Overtaken requests have no reply.
            self.open.drain(..place);
        } else if has_earlier {
            let text = format!("{} before the reply to an earlier request", name(frame));
            report.rule(SERVER, "FM-60", text);
        }
        if request.is_missed {
            let limit = self.config.timeout.saturating_add(self.config.settle);
            let short = if late > limit && !self.is_tcp() { "settle" } else { "timeout" };
            let text = format!("{} {} after its request: {short} is too short", name(frame), ms(late));
            report.assumption(SERVER, "FM-57", text);
        }
        let Ok(asked) = request.frame.pdu.request() else { return };
        if frame.unit != request.frame.unit && !self.config.any_unit {
            let text = format!("unit {} answers for unit {}", frame.unit, request.frame.unit);
            report.rule(SERVER, "FM-61", text);
        }
        match reply.answers(&asked) {
            Ok(()) => {}
            // Before the first exchange its request may not have been seen.
            Err(_) if !self.is_known => {}
            Err(mismatch) => report.rule(SERVER, "FM-44", format!("{}: {mismatch}", name(frame))),
        }
    }

    /// Returns the index of the request to which a reply seems to belong.
    fn request_of(&self, frame: &Frame<PduBuf>, reply: &Reply<'_>) -> Option<usize> {
        let is_its = |request: &Request| request.frame.transaction == frame.transaction;
        let fits = |request: &Request| {
            let asked = request.frame.pdu.request();
            request.frame.unit == frame.unit && asked.is_ok_and(|asked| reply.answers(&asked).is_ok())
        };
        let awaited = |request: &&Request| is_its(request) && !request.is_missed;
        let place =
            |wanted: &dyn Fn(&&Request) -> bool| self.open.iter().position(|request| wanted(&request));
        place(&|request| awaited(request) && fits(request))
            .or_else(|| place(&awaited))
            .or_else(|| self.open.iter().rposition(is_its))
    }
}

/// Returns a reply, even if it is shown as the telemetry block.
fn reply(message: &Value) -> Option<Frame<PduBuf>> {
    let mut message = message.clone();
    if let Some(object) = message.as_object_mut()
        && object.remove("telemetry").is_some()
    {
        object.insert("registers".into(), json!(vec![0; usize::from(TelemetryBlock::QUANTITY)]));
    }
    codec::read(message).ok()
}

fn name(frame: &Frame<PduBuf>) -> String {
    let function = frame.pdu.as_bytes().first().copied().unwrap_or_default();
    match frame.transaction {
        Some(transaction) => format!("function {function} of transaction {transaction}"),
        None => format!("function {function} of unit {}", frame.unit),
    }
}
