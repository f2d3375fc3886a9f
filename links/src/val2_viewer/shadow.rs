//! A host and a workstation, as their messages and requests show them.

use core::time::Duration;

use anyhow::Result;
use serde_json::Value;
use val2_viewer::{HostConfig, WorkstationConfig};

use crate::shadow::{JITTER, LineEvent, Report, Setup, Shadow, UNSEEN, ms};

const HOST: &str = "host";
const WORKSTATION: &str = "workstation";
const ENQ: u8 = 0x05;
const XON: u8 = 0x11;
const XOFF: u8 = 0x13;

pub(super) fn shadow(setup: &Setup<'_>) -> Result<Box<dyn Shadow>> {
    let host = setup.config(HOST, HostConfig::default(), &[])?;
    let workstation = setup.config(WORKSTATION, WorkstationConfig::default(), &[])?;
    let (request, sent, count, holds) = (Request::Unknown, None, None, [None; 2]);
    Ok(Box::new(Viewer { host, workstation, request, sent, count, holds }))
}

struct Viewer {
    host: HostConfig,
    workstation: WorkstationConfig,
    request: Request,
    /// The last packet, or when the connection was made.
    sent: Option<Duration>,
    /// The number of the last packet.
    count: Option<u16>,
    /// The times of the XOFF that hold the host and the workstation; `None` if that end may send.
    holds: [Option<Duration>; 2],
}

/// The request that has no packet yet.
#[derive(Debug, Clone, Copy)]
enum Request {
    /// Whether there is one was not seen.
    Unknown,
    None,
    Open {
        at: Duration,
        is_missed: bool,
    },
}

impl Shadow for Viewer {
    fn see(&mut self, seen: &LineEvent<'_>, report: &mut Report<'_>) {
        match *seen {
            LineEvent::Opened => {
                (self.request, self.sent, self.holds) = (Request::None, Some(report.now), [None; 2]);
            }
            LineEvent::Closed | LineEvent::Missed { .. } => {
                (self.request, self.sent, self.count, self.holds) = (Request::Unknown, None, None, [None; 2]);
            }
            LineEvent::Bytes { from, bytes } => {
                for byte in bytes {
                    self.handshake(from, *byte, report);
                    if from == WORKSTATION && *byte == ENQ {
                        self.ask(report);
                    }
                }
            }
            LineEvent::Message { message, .. } => self.answer(message, report),
            // A whole line that cannot be read was the answer (VV-26).
            LineEvent::Corrupt { error, .. } => {
                let kind = error["kind"].as_str().unwrap_or_default();
                if ["checksum", "format", "number", "too_long"].contains(&kind)
                    && !matches!(self.request, Request::Unknown)
                {
                    self.request = Request::None;
                }
            }
        }
    }

    fn pass(&mut self, report: &mut Report<'_>) {
        let limit = self.workstation.stale_after;
        if let Request::Open { at, is_missed } = &mut self.request
            && !*is_missed
            && report.now > at.saturating_add(limit)
        {
            *is_missed = true;
            let text = format!("no packet within stale_after ({}) of its request", ms(limit));
            report.assumption(HOST, "VV-40", text);
        }
        let limits = [self.host.max_hold, self.workstation.max_hold];
        for (hold, (limit, by)) in self.holds.iter_mut().zip(limits.into_iter().zip([WORKSTATION, HOST])) {
            if hold.is_some_and(|since| report.now >= since.saturating_add(limit)) {
                *hold = None;
                let text = format!("a hold that does not end within max_hold ({})", ms(limit));
                report.assumption(by, "VV-38", text);
            }
        }
    }

    fn state(&self) -> String {
        let request = match self.request {
            Request::Unknown => UNSEEN,
            Request::None => "no request is open",
            Request::Open { is_missed: false, .. } => "a request waits for its packet",
            Request::Open { is_missed: true, .. } => "a request has no packet",
        };
        let held = match self.holds.map(|hold| hold.is_some()) {
            [false, false] => "",
            [true, false] => "; the host is held",
            [false, true] => "; the workstation is held",
            [true, true] => "; both are held",
        };
        format!("{request}{held}")
    }
}

impl Viewer {
    /// Follows XON and XOFF of an end, which release and hold the other one; reports bytes that a held end sends.
    fn handshake(&mut self, from: &'static str, byte: u8, report: &mut Report<'_>) {
        let [host, workstation] = &mut self.holds;
        let (its, others) = if from == HOST { (host, workstation) } else { (workstation, host) };
        match byte {
            XON => *others = None,
            XOFF => *others = Some(report.now),
            _ => {
                if let Some(since) = *its {
                    let text = format!("sends {} after XOFF", ms(report.now.saturating_sub(since)));
                    report.rule(from, "VV-36", text);
                    // Once for each hold.
                    *its = None;
                }
            }
        }
    }

    fn ask(&mut self, report: &mut Report<'_>) {
        if let Request::Open { at, .. } = self.request
            && report.now < at.saturating_add(self.workstation.pause)
        {
            let waited = ms(report.now.saturating_sub(at));
            report.rule(WORKSTATION, "VV-25", format!("asks {waited} after a request without an answer"));
        }
        self.request = Request::Open { at: report.now, is_missed: false };
    }

    fn answer(&mut self, message: &Value, report: &mut Report<'_>) {
        let now = report.now;
        match self.request {
            Request::None => report.rule(HOST, "VV-3", "an unsolicited packet"),
            Request::Unknown => {}
            Request::Open { at, is_missed } => {
                if is_missed {
                    let late = ms(now.saturating_sub(at));
                    let text = format!("a packet {late} after its request: stale_after is too short");
                    report.assumption(HOST, "VV-40", text);
                }
            }
        }
        self.request = Request::None;
        if let Some(sent) = self.sent
            && now.saturating_add(JITTER) < sent.saturating_add(self.host.interval)
        {
            let text = format!("a packet {} after the one before", ms(now.saturating_sub(sent)));
            report.rule(HOST, "VV-19", text);
        }
        self.sent = Some(now);
        let count = message["count"].as_u64().and_then(|count| u16::try_from(count).ok());
        if let (Some(before), Some(count)) = (self.count, count) {
            let lost = count.wrapping_sub(before).wrapping_sub(1);
            if lost > 0 && count > 0 {
                report.rule(
                    HOST,
                    "VV-10",
                    format!("{lost} packets are missing before the one of count {count}"),
                );
            }
        }
        self.count = count;
    }
}
