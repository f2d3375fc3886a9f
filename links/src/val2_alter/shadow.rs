//! A controller and a host, as their messages show them.

use core::time::Duration;

use anyhow::Result;
use serde_json::Value;
use val2_alter::HostConfig;
use val2_alter::timing::{CYCLE, transmission_time};

use crate::shadow::{JITTER, LineEvent, Report, Setup, Shadow, UNSEEN, ms};

const ROBOT: &str = "robot";
const HOST: &str = "host";
/// Bit 0 of a mode: a value moves by its amount; bit 2: messages have a transformation.
const CUMULATIVE: u64 = 1;
const TRANSFORM: u64 = 4;
/// The error code of a reply that did not come.
const NO_REPLY: u64 = 6;

pub(super) fn shadow(setup: &Setup<'_>) -> Result<Box<dyn Shadow>> {
    let host = setup.config(HOST, HostConfig::default(), &[])?;
    let baud = setup.baud().unwrap_or(host.baud);
    let (phase, asked, mode) = (Phase::Unknown, None, None);
    let (moves, values, last, loose) = (true, Vec::new(), None, 0);
    Ok(Box::new(Alter { host, baud, phase, asked, mode, moves, values, last, loose }))
}

struct Alter {
    host: HostConfig,
    baud: u32,
    phase: Phase,
    /// The last message of the controller that is to be answered.
    asked: Option<ControllerMessage>,
    /// The mode of the last start message; `None` if unknown.
    mode: Option<u64>,
    /// The last reply has moved an axis: the host has not stopped.
    moves: bool,
    /// The values of the last reply.
    values: Vec<i64>,
    /// When the last standard message was seen.
    last: Option<Duration>,
    /// The number of the controller's bytes that are not a message, or not yet: they may be a corrupt start message, which is
    /// answered (AL-47).
    loose: u64,
}

/// The phase of ALTER.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Unknown,
    Off,
    /// Start messages are sent.
    Starting,
    Running,
}

struct ControllerMessage {
    at: Duration,
    is_start: bool,
    is_interrupted: bool,
    /// An answer that ends before it is in time, whether the message was seen when it began or when it ended.
    sure: Duration,
    /// An answer that ends later is late.
    closes: Duration,
    answer: Option<HostAnswer>,
    /// The host sent bytes that are not an answer.
    is_damaged: bool,
}

struct HostAnswer {
    /// A good answer of the right kind, in time; `None` if it may have begun before its window.
    is_read: Option<bool>,
    exception: u64,
}

impl Shadow for Alter {
    fn see(&mut self, seen: &LineEvent<'_>, report: &mut Report<'_>) {
        match *seen {
            LineEvent::Opened | LineEvent::Closed | LineEvent::Missed { .. } => {
                let is_open = matches!(seen, LineEvent::Opened);
                self.phase = if is_open { Phase::Off } else { Phase::Unknown };
                (self.asked, self.last, self.loose) = (None, None, 0);
            }
            LineEvent::Message { from: ROBOT, length, message } => {
                self.loose = self.loose.saturating_sub(length);
                self.told(length, message, report);
            }
            LineEvent::Bytes { from: ROBOT, bytes } => self.loose += bytes.len() as u64,
            LineEvent::Message { from: HOST, length, message } => self.answered(length, message, report),
            LineEvent::Corrupt { from: HOST, .. } => {
                if let Some(asked) = &mut self.asked {
                    asked.is_damaged = true;
                }
            }
            // The contents of the message are unknown.
            LineEvent::Corrupt { from: ROBOT, .. } => (self.phase, self.asked) = (Phase::Unknown, None),
            LineEvent::Bytes { .. } | LineEvent::Corrupt { .. } | LineEvent::Message { .. } => {}
        }
    }

    fn pass(&mut self, report: &mut Report<'_>) {
        let limit = CYCLE.saturating_mul(self.host.silence_cycles);
        if self.phase == Phase::Running
            && let Some(last) = self.last
            && report.now >= last.saturating_add(limit).saturating_add(SLACK)
        {
            self.last = None;
            let text = format!("no message for {} although ALTER has not ended", ms(limit));
            report.assumption(ROBOT, "AL-53", text);
        }
    }

    fn state(&self) -> String {
        match (self.phase, self.mode) {
            (Phase::Unknown, _) => UNSEEN.into(),
            (Phase::Off, _) => "ALTER is off".into(),
            (Phase::Starting, _) => "ALTER starts".into(),
            (Phase::Running, None) => "ALTER runs".into(),
            (Phase::Running, Some(mode)) => format!("ALTER runs in mode {mode}"),
        }
    }
}

impl Alter {
    /// Checks a message of the controller.
    fn told(&mut self, length: u64, message: &Value, report: &mut Report<'_>) {
        let kind = message["kind"].as_str().unwrap_or_default();
        let error = message["error"].as_u64().unwrap_or_default();
        if kind == "motion" && matches!(self.phase, Phase::Off | Phase::Starting) {
            // It is not answered (AL-49); a start message still is.
            return report.rule(ROBOT, "AL-89", "a standard message, and ALTER was not accepted");
        }
        let before = self.asked.take();
        if let Some(before) = &before {
            let is_known = self.phase != Phase::Unknown && !before.is_damaged;
            if before.answer.is_none() && is_known && report.now < before.sure {
                let since = ms(report.now.saturating_sub(before.at));
                report.rule(
                    ROBOT,
                    "AL-73",
                    format!("a message {since} after one that may still be answered"),
                );
            }
            self.outcome(before, message, report);
        }
        let is_start = kind == "start";
        match kind {
            "start" => {
                if self.phase == Phase::Running {
                    report.rule(ROBOT, "AL-89", "a start message while ALTER runs");
                }
                let is_again = self.phase == Phase::Starting && before.is_some();
                if error != 0 && self.phase != Phase::Unknown && !is_again {
                    report.rule(
                        ROBOT,
                        "AL-15",
                        format!("the first start message has the error code {error}"),
                    );
                }
                // One that begins after unknown bytes may not be used.
                let is_known = matches!(self.phase, Phase::Off | Phase::Starting);
                self.mode = message["mode"].as_u64().filter(|_| is_known);
                (self.phase, self.last, self.moves) = (Phase::Starting, None, true);
            }
            "motion" => {
                let has_transform = !message["transform"].is_null();
                let is_other = self.mode.is_some_and(|mode| (mode & TRANSFORM != 0) != has_transform);
                if is_other {
                    report.rule(
                        ROBOT,
                        "AL-16",
                        "a transformation is in a message where the mode says otherwise",
                    );
                }
                self.cycle(report);
            }
            _ => {
                if self.phase == Phase::Off {
                    report.rule(ROBOT, "AL-89", "an end message, and ALTER does not run");
                }
                (self.phase, self.last) = (Phase::Off, None);
                return;
            }
        }
        let line = transmission_time(usize::try_from(length).unwrap_or(usize::MAX), self.baud);
        let is_cumulative = self.mode.is_some_and(|mode| mode & CUMULATIVE != 0);
        let window = Duration::from_millis(if is_cumulative { 15 } else { 17 });
        let window = window.min(CYCLE.saturating_sub(line));
        let sure = report.now.saturating_add(window).saturating_sub(SLACK);
        let closes = report.now.saturating_add(line).saturating_add(window).saturating_add(SLACK);
        let is_interrupted = message["phase"] == "interrupted";
        let (answer, is_damaged) = (None, false);
        self.asked = Some(ControllerMessage {
            at: report.now,
            is_start,
            is_interrupted,
            sure,
            closes,
            answer,
            is_damaged,
        });
    }

    /// Checks the cycle: standard messages are 28 ms apart.
    fn cycle(&mut self, report: &mut Report<'_>) {
        let now = report.now;
        if let Some(last) = self.last.replace(now) {
            let since = now.saturating_sub(last);
            if since.saturating_add(self.host.max_delay) < CYCLE {
                let text = format!("{} after the one before, which was later than max_delay", ms(since));
                report.assumption(ROBOT, "AL-93", text);
            } else if since > CYCLE.saturating_add(self.host.max_delay) {
                report.budget(
                    ROBOT,
                    "AL-73",
                    format!("a standard message {} after the one before", ms(since)),
                );
            }
        }
    }

    /// Follows the controller's reaction to the answer to its previous message.
    fn outcome(&self, before: &ControllerMessage, message: &Value, report: &mut Report<'_>) {
        let kind = message["kind"].as_str().unwrap_or_default();
        let error = message["error"].as_u64().unwrap_or_default();
        let is_interrupted = message["phase"] == "interrupted";
        if self.phase == Phase::Unknown {
            return;
        }
        if before.answer.as_ref().is_some_and(|answer| answer.is_read.is_none()) {
            return;
        }
        let read = before.answer.as_ref().filter(|answer| answer.is_read == Some(true));
        let is_over = report.now > before.closes;
        if !before.is_start && before.answer.is_none() && !before.is_damaged && self.moves && is_over {
            report.budget(HOST, "AL-53", "no reply to a standard message");
        }
        match (kind, read) {
            _ if before.is_damaged => {}
            // The reply that came was read after all.
            ("motion", None) if error == 0 && before.answer.is_none() => {
                report.rule(ROBOT, "AL-76", "error code 0, and no reply came in time");
            }
            ("motion", None) if error == NO_REPLY => {
                report.rule(ROBOT, "AL-76", "ALTER continues without a reply");
            }
            ("motion" | "end", Some(_)) if error == NO_REPLY => {
                report.budget(HOST, "AL-61", "the controller says that the reply did not come in time");
            }
            ("motion" | "end", Some(_)) if error != 0 => {
                let text = format!("error code {error}, but the reply was good: the fault is beyond the tap");
                report.rule(ROBOT, "AL-19", text);
            }
            _ => {}
        }
        let was_excepted = read.is_some_and(|read| read.exception != 0) && !before.is_interrupted;
        if was_excepted && kind == "motion" && !is_interrupted {
            report.rule(ROBOT, "AL-78", "an exception was read, and ALTER runs on");
        }
    }

    /// Follows an answer of the host.
    fn answered(&mut self, length: u64, message: &Value, report: &mut Report<'_>) {
        let now = report.now;
        let line = transmission_time(usize::try_from(length).unwrap_or(usize::MAX), self.baud);
        let is_start = message["kind"] == "start_reply";
        let word = message["reply"].as_str().unwrap_or_default();
        if is_start && self.loose > 0 {
            self.loose = 0;
            return;
        }
        let Some(asked) = &mut self.asked else {
            if self.phase != Phase::Unknown {
                report.rule(HOST, "AL-53", "an answer, and no message is to be answered");
            }
            return;
        };
        if let Some(answer) = &mut asked.answer {
            // The controller's next message shows which answer it has read.
            (answer.is_read, self.phase) = (None, Phase::Unknown);
            report.rule(HOST, "AL-53", "a second answer to one message");
            return;
        }
        let is_right = asked.is_start == is_start;
        if !is_right && self.phase != Phase::Unknown && self.mode.is_some() {
            report.rule(HOST, "AL-23", "an answer to a message of the other kind");
        }
        if now > asked.closes {
            let late = ms(now.saturating_sub(asked.at));
            report.budget(HOST, if is_start { "AL-60" } else { "AL-61" }, format!("an answer after {late}"));
        }
        let of = |value: &Value| value.as_i64().unwrap_or_default();
        let values: Vec<i64> = message["values"].as_array().into_iter().flatten().map(of).collect();
        let is_cumulative = self.mode.is_some_and(|mode| mode & CUMULATIVE != 0);
        let grows = values.iter().zip(&self.values).any(|(value, before)| value.abs() > before.abs());
        if asked.is_interrupted && is_cumulative && grows {
            report.rule(HOST, "AL-86", "values that grow while ALTER is interrupted");
        }
        let is_zero = values.iter().all(|value| *value == 0);
        self.values = values;
        if !is_start {
            self.moves = !is_zero;
        }
        let exception = message["exception"].as_u64().unwrap_or_default();
        let is_read = match (is_right, asked.at.saturating_add(line)) {
            (false, _) => Some(false),
            _ if now > asked.closes.saturating_add(JITTER) => Some(false),
            // It may have begun before its window.
            (true, earliest) => (now >= earliest && now < asked.sure).then_some(true),
        };
        asked.answer = Some(HostAnswer { is_read, exception });
        match (is_start, is_read, word) {
            (true, Some(true), "accept") => (self.phase, self.last) = (Phase::Running, Some(now)),
            (true, Some(true), "refuse") => (self.phase, self.asked) = (Phase::Off, None),
            // The controller's next message shows whether it has read the reply.
            (true, ..) => self.phase = Phase::Unknown,
            (false, ..) if is_right => self.phase = Phase::Running,
            _ => {}
        }
    }
}

/// The largest delay that a tap between the ends cannot distinguish from an answer in time.
const SLACK: Duration = Duration::from_millis(2);
