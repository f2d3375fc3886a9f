//! A central controller and a device, as their messages show them.

use core::time::Duration;
use std::collections::VecDeque;

use anyhow::Result;
use mmacell_proto::CentralConfig;
use serde_json::Value;

use crate::shadow::{LineEvent, Report, Setup, Shadow, ms};

const CENTRAL: &str = "central";

pub(super) fn shadow(setup: &Setup<'_>) -> Result<Box<dyn Shadow>> {
    let central = setup.config(CENTRAL, CentralConfig::DEFAULT, &[])?;
    let (timeout, settle) = (central.timeout, central.settle);
    let (is_known, since, open) = (false, None, VecDeque::new());
    let (axes, percent) = (Axes::Unknown, None);
    let is_at_rest = false;
    Ok(Box::new(Cell { timeout, settle, is_known, since, open, axes, is_at_rest, percent }))
}

struct Cell {
    timeout: Duration,
    settle: Duration,
    /// Every command that may still be answered was seen.
    is_known: bool,
    /// When a command was seen first.
    since: Option<Duration>,
    /// The commands without a reply, oldest first.
    open: VecDeque<OpenCommand>,
    axes: Axes,
    /// The device has reported rest after the `OK` to a motion, and was not seen moving.
    is_at_rest: bool,
    /// The override.
    percent: Option<u64>,
}

struct OpenCommand {
    at: Duration,
    /// `None` if the line is not a command.
    command: Option<Value>,
    is_missed: bool,
}

/// The known state of a device's axes (MM-72).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Axes {
    Unknown,
    Off,
    Still,
    /// Since the `OK` to the order, if no status was requested since.
    Moving(Option<Duration>),
    Fault,
}

impl Shadow for Cell {
    fn see(&mut self, seen: &LineEvent<'_>, report: &mut Report<'_>) {
        match *seen {
            LineEvent::Opened | LineEvent::Closed => {
                self.forget();
                (self.is_known, self.since) = (matches!(seen, LineEvent::Opened), None);
            }
            LineEvent::Missed { .. } => {
                self.since = None;
                self.forget();
                (self.is_known, self.axes, self.percent) = (false, Axes::Unknown, None);
            }
            LineEvent::Message { from: CENTRAL, message, .. } => self.ask(Some(message.clone()), report),
            // A line that is not a command is answered all the same.
            LineEvent::Corrupt { from: CENTRAL, .. } => self.ask(None, report),
            LineEvent::Message { from, message, .. } => self.answer(from, message, report),
            // It was a reply.
            LineEvent::Corrupt { .. } => {
                if self.open.pop_front().is_some_and(|open| open.name() != "STA") {
                    (self.axes, self.percent) = (Axes::Unknown, None);
                }
            }
            LineEvent::Bytes { .. } => {}
        }
    }

    fn pass(&mut self, report: &mut Report<'_>) {
        let timeout = self.timeout;
        // By now, commands before the first observed one are no longer answered.
        let is_old = |at: Duration| report.now > at.saturating_add(timeout.saturating_mul(10));
        if self.since.is_some_and(is_old) && !self.is_known {
            self.is_known = true;
            self.open.retain(|open| !is_old(open.at));
        }
        for open in self.open.iter_mut().filter(|open| !open.is_missed) {
            if report.now > open.at.saturating_add(timeout) {
                open.is_missed = true;
                let text = format!("no reply to {} within timeout ({})", open.name(), ms(timeout));
                report.assumption("device", "MM-60", text);
            }
        }
    }

    fn state(&self) -> String {
        let axes = match self.axes {
            Axes::Unknown => "of an unknown state",
            Axes::Off => "off",
            Axes::Still => "at rest",
            Axes::Moving(_) => "moving",
            Axes::Fault => "in fault",
        };
        let percent = self.percent.map_or_else(String::new, |percent| format!(", override {percent} %"));
        format!("the axes are {axes}{percent}; {} commands wait for replies", self.open.len())
    }
}

impl OpenCommand {
    fn name(&self) -> &str {
        self.command.as_ref().and_then(|command| command["command"].as_str()).unwrap_or("a line")
    }
}

impl Cell {
    /// Clears the state for another connection: commands without a reply may have been executed.
    fn forget(&mut self) {
        if self.open.drain(..).any(|open| open.name() != "STA") {
            (self.axes, self.percent) = (Axes::Unknown, None);
        }
    }

    fn ask(&mut self, command: Option<Value>, report: &mut Report<'_>) {
        if let Some(open) = self.open.front() {
            let waited = ms(report.now.saturating_sub(open.at));
            let text = format!("a command {waited} after {}, which is not answered", open.name());
            report.rule(CENTRAL, "MM-4", text);
        }
        self.since.get_or_insert(report.now);
        self.open.push_back(OpenCommand { at: report.now, command, is_missed: false });
    }

    fn answer(&mut self, device: &'static str, reply: &Value, report: &mut Report<'_>) {
        let kind = reply["reply"].as_str().unwrap_or_default();
        let Some(open) = self.open.pop_front() else {
            if self.is_known {
                report.rule(device, "MM-3", format!("`{kind}`, unsolicited"));
            }
            return;
        };
        if open.is_missed {
            let late = ms(report.now.saturating_sub(open.at));
            let text = format!("the reply to {} after {late}: timeout is too short", open.name());
            report.assumption(device, "MM-60", text);
        }
        if !self.is_known {
            // The command that it answers is not known either.
            return;
        }
        let Some(command) = &open.command else {
            if kind != "error" {
                report.rule(device, "MM-51", format!("`{kind}` answers a line that is not a command"));
            }
            return;
        };
        let is_status = open.name() == "STA";
        match kind {
            "error" => {}
            "status" if is_status => self.status(device, open.at, reply, report),
            "ok" if !is_status => self.obeyed(device, command, report),
            _ => report.rule(device, "MM-18", format!("`{kind}` answers {}", open.name())),
        }
    }

    /// Checks a status that was requested at a time against the table of the axes (MM-74).
    fn status(&mut self, device: &'static str, asked: Duration, status: &Value, report: &mut Report<'_>) {
        let flag = |name: &str| status[name].as_bool().unwrap_or_default();
        let (moving, servo, fault) = (flag("moving"), flag("servo"), status["error"] != 0);
        if moving && !servo {
            report.rule(device, "MM-52", "moving with the servo off");
        }
        if fault && (moving || servo) {
            report.rule(device, "MM-57", "an error with the servo on");
        }
        let before = self.axes;
        self.axes = match (fault, servo, moving) {
            (true, ..) => Axes::Fault,
            (false, true, true) => Axes::Moving(None),
            (false, true, false) => Axes::Still,
            (false, false, _) => Axes::Off,
        };
        let wrong = match (before, self.axes) {
            (Axes::Unknown, _) | (_, Axes::Fault | Axes::Unknown) => None,
            (Axes::Off, Axes::Off) | (Axes::Still | Axes::Moving(_), Axes::Still) => None,
            (Axes::Moving(_), Axes::Moving(_)) => None,
            (Axes::Fault, _) => Some("the error was cleared without RST"),
            (Axes::Off, _) => Some("without an order the servo is on"),
            (_, Axes::Off) => Some("without an order or an error the servo is off"),
            (Axes::Still, _) => Some("without an order it moves"),
        };
        if self.is_at_rest && moving {
            let text = format!(
                "it moves, and at rest {} after its order it had not begun: settle is too short",
                ms(self.settle)
            );
            report.assumption(device, "MM-61", text);
        } else if let Some(wrong) = wrong {
            report.rule(device, "MM-74", wrong);
        }
        if let (Axes::Moving(Some(since)), Axes::Still) = (before, self.axes) {
            // Whether it has moved already, or not yet, shows the next status; until then it may move.
            let is_settled = asked >= since.saturating_add(self.settle);
            self.axes = if is_settled { Axes::Still } else { before };
            self.is_at_rest = is_settled;
        } else {
            self.is_at_rest &= !moving;
        }
        let percent = status["override"].as_u64();
        if let (Some(before), Some(percent)) = (self.percent, percent)
            && before != percent
        {
            report.rule(device, "MM-54", format!("an override of {percent}, and {before} was ordered"));
        }
        self.percent = percent;
    }

    /// Called when an order is accepted.
    fn obeyed(&mut self, device: &'static str, command: &Value, report: &mut Report<'_>) {
        let name = command["command"].as_str().unwrap_or_default();
        let is_on = command["on"] == true;
        let wrong = match (name, self.axes) {
            ("MOV", Axes::Off) => Some("a motion while the servo is off"),
            ("MOV", Axes::Fault) => Some("a motion while there is an error"),
            ("SRV", Axes::Fault) if is_on => Some("the servo on while there is an error"),
            _ => None,
        };
        if let Some(wrong) = wrong {
            report.rule(device, "MM-74", format!("OK to {wrong}"));
        }
        self.is_at_rest = false;
        self.axes = match (name, self.axes) {
            ("MOV" | "RST", _) => Axes::Moving(Some(report.now)),
            ("SRV", Axes::Off) if is_on => Axes::Still,
            ("SRV", Axes::Still | Axes::Moving(_)) if !is_on => Axes::Off,
            (_, axes) => axes,
        };
        if name == "OVR" {
            self.percent = command["percent"].as_u64();
        }
    }
}
