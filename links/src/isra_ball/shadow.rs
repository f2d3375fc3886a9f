//! A host and a ball, as polls and packets show them.

use core::time::Duration;

use anyhow::Result;
use isra_ball::HostConfig;
use isra_ball::timing::transmission_time;
use serde_json::Value;

use crate::shadow::{JITTER, LineEvent, Report, Setup, Shadow, UNSEEN, ms};

const HOST: &str = "host";
const BALL: &str = "ball";
const ENQ: u8 = 0x05;
/// Bytes of a packet.
const PACKET: usize = 12;

pub(super) fn shadow(setup: &Setup<'_>) -> Result<Box<dyn Shadow>> {
    let baud = setup.baud().unwrap_or(HostConfig::default().baud);
    let host = setup.config(HOST, HostConfig { baud, ..HostConfig::default() }, &[])?;
    Ok(Box::new(PollState { host, poll: Poll::Unknown, last: None, fresh_at: None }))
}

struct PollState {
    host: HostConfig,
    poll: Poll,
    /// The last packet.
    last: Option<Value>,
    /// When values were last marked as new.
    fresh_at: Option<Duration>,
}

/// The poll that has no packet yet.
#[derive(Debug, Clone, Copy)]
enum Poll {
    /// Whether there is one was not seen.
    Unknown,
    None {
        /// The poll before it.
        before: Option<Duration>,
    },
    Open {
        at: Duration,
        is_missed: bool,
    },
}

impl Shadow for PollState {
    fn see(&mut self, seen: &LineEvent<'_>, report: &mut Report<'_>) {
        match *seen {
            LineEvent::Opened => (self.poll, self.fresh_at) = (Poll::None { before: None }, None),
            LineEvent::Closed | LineEvent::Missed { .. } => {
                (self.poll, self.last, self.fresh_at) = (Poll::Unknown, None, None);
            }
            LineEvent::Bytes { from: HOST, bytes } => {
                for byte in bytes {
                    match *byte {
                        ENQ => self.ask(report),
                        byte => report.rule(HOST, "IB-9", format!("sends {byte:02X}h, which is not a poll")),
                    }
                }
            }
            LineEvent::Message { message, .. } => self.answer(message, report),
            LineEvent::Bytes { .. } | LineEvent::Corrupt { .. } => {}
        }
    }

    fn pass(&mut self, report: &mut Report<'_>) {
        let window = self.window();
        if let Poll::Open { at, is_missed } = &mut self.poll
            && !*is_missed
            && report.now >= at.saturating_add(window)
        {
            *is_missed = true;
            let limit = ms(self.host.max_delay);
            report.assumption(BALL, "IB-24", format!("no packet within max_delay ({limit}) of its poll"));
        }
    }

    fn state(&self) -> String {
        match self.poll {
            Poll::Unknown => UNSEEN,
            Poll::None { .. } => "no poll is open",
            Poll::Open { is_missed: false, .. } => "a poll waits for its packet",
            Poll::Open { is_missed: true, .. } => "a poll has no packet",
        }
        .into()
    }
}

impl PollState {
    /// Returns the longest time from a poll to its packet (§7.1).
    fn window(&self) -> Duration {
        transmission_time(1 + PACKET, self.host.baud).saturating_add(self.host.max_delay)
    }

    fn ask(&mut self, report: &mut Report<'_>) {
        match self.poll {
            Poll::Open { at, is_missed: false } => {
                let waited = ms(report.now.saturating_sub(at));
                report.rule(HOST, "IB-25", format!("a poll {waited} after one that is not answered"));
            }
            Poll::None { before: Some(before) } | Poll::Open { at: before, .. }
                if report.now.saturating_add(JITTER) < before.saturating_add(self.host.period) =>
            {
                let since = ms(report.now.saturating_sub(before));
                report.assumption(HOST, "IB-25", format!("a poll {since} after the last: period is another"));
            }
            _ => {}
        }
        self.poll = Poll::Open { at: report.now, is_missed: false };
    }

    fn answer(&mut self, message: &Value, report: &mut Report<'_>) {
        let now = report.now;
        let before = match self.poll {
            Poll::Unknown => None,
            Poll::None { before } => {
                report.rule(BALL, "IB-35", "a packet that no poll has asked for");
                before
            }
            Poll::Open { at, is_missed } => {
                let late = now.saturating_sub(at);
                if is_missed {
                    let text = format!("a packet {} after its poll: max_delay is too short", ms(late));
                    report.assumption(BALL, "IB-31", text);
                }
                Some(at)
            }
        };
        self.poll = if let Poll::Unknown = self.poll { Poll::Unknown } else { Poll::None { before } };
        self.values(message, report);
        self.last = Some(message.clone());
    }

    /// Values that are marked as old are those before; sensor and type are always the same.
    fn values(&mut self, message: &Value, report: &mut Report<'_>) {
        let status = message["status"].as_str().unwrap_or_default();
        if let Some(last) = &self.last {
            let same = |name: &str| message.get(name) == last.get(name);
            if !same("sensor") || !same("sensor_type") {
                report.rule(BALL, "IB-10", "another sensor than in the packet before");
            }
            let is_repeated = ["force", "moment", "keys"].into_iter().all(same);
            if status == "old" && !is_repeated {
                report.rule(BALL, "IB-33", "values marked as old that were not sent before");
            }
        }
        let max_age = self.host.max_age;
        if self.fresh_at.is_some_and(|fresh| report.now > fresh.saturating_add(max_age)) {
            let text = format!("no new values within max_age ({})", ms(max_age));
            report.assumption(BALL, "IB-26", text);
            self.fresh_at = None;
        }
        match status {
            "fresh" => self.fresh_at = Some(report.now),
            "reserved" => report.rule(BALL, "IB-11", "a status without a meaning"),
            _ => {}
        }
    }
}
