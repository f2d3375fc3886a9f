//! The workstation's machine: the times of its requests, and whether its picture is stale. No bytes, no clock.
//!
//! It has a *credit of one* (§9.4): it sends a request in the first display cycle, then only after an answer, or after a
//! pause of the display.
//!
//! As the model has explored it:
#![doc = include_str!("../../diagrams/workstation.md")]

use core::time::Duration;

use robot_session::Unexpected;
use robot_session::end::{Expiry, Machine, is_due};

use super::config::{Rule, WorkstationConfig};
use crate::flow::Flow;

/// The state of a workstation. Every time is a deadline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum WorkstationMachine {
    /// There is no connection.
    Disconnected,
    /// A connection to the host.
    Connected(Display),
}

/// The state during a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Display {
    /// The state of the request to the host.
    pub request: Request,
    /// Whether the picture follows the arm.
    pub picture: Picture,
    /// Whether the host holds the line.
    pub flow: Flow,
}

/// The request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request {
    /// The next display cycle sends a request.
    Allowed,
    /// The request is to be sent.
    Due,
    /// A request was sent, and its answer is awaited.
    Waiting {
        /// The time from which the next display cycle sends a request again: the previous one was so long before.
        again_from: Duration,
        /// The time from which the request counts as missed.
        missed_from: Duration,
    },
    /// No answer has come in time, which is reported. The picture is stale.
    Overdue {
        /// The time from which the next display cycle sends a request again: the previous one was so long before.
        again_from: Duration,
    },
}

/// The picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Picture {
    /// No pose has come for long.
    Stale,
    /// The picture follows the arm.
    Live {
        /// The time until which the picture counts as following the arm without a new pose.
        until: Duration,
    },
}

/// An input of the workstation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// The port is open, perhaps again.
    Connected,
    /// The port is closed or lost.
    Disconnected,
    /// A deadline may have passed.
    Timeout,
    /// A display cycle: the picture is drawn.
    Draw,
    /// The request that was due is sent.
    Sent,
    /// A packet with a pose has come.
    Pose,
    /// Bytes that are not a packet.
    Corrupt {
        /// Whether the bytes are a whole line.
        line: bool,
    },
    /// The host has sent XOFF: it holds the line.
    Xoff,
    /// The host has sent XON: it releases the line.
    Xon,
}

/// A request of the workstation: ENQ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Enquiry;

/// An action of the workstation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// The session has nothing to do.
    Nothing,
    /// Counts a request that was sent.
    Sent,
    /// Reports the packet as the answer.
    Pose,
    /// Reports that the packet is not an answer.
    Unasked,
    /// Reports that the request has no answer.
    Missed,
    /// Reports that the picture is stale.
    Stale,
    /// Reports that no XON has come.
    HoldEnded,
    /// Reports the request and the picture that the connection's end has ended.
    Closed {
        /// Whether the request has no answer.
        missed: bool,
        /// Whether the picture is stale.
        stale: bool,
    },
}

impl Machine for WorkstationMachine {
    const END: &'static str = "workstation";
    const EXPIRY: Expiry = Expiry::First;
    type Input = Input;
    type Action = Action;
    type Transmit = Enquiry;
    type Config = WorkstationConfig;

    /// # Errors
    /// Bytes without a connection, a request that is not due.
    fn on(&mut self, now: Duration, input: Input, config: &WorkstationConfig) -> Result<Action, Unexpected> {
        match (&mut *self, input) {
            (_, Input::Connected) => Ok(self.close(Self::Connected(Display::NEW), config)),
            (_, Input::Disconnected) => Ok(self.close(Self::Disconnected, config)),
            (Self::Disconnected, Input::Timeout | Input::Draw) => Ok(Action::Nothing),
            (Self::Connected(display), Input::Timeout) => Ok(display.expire(now)),
            (Self::Connected(display), Input::Draw) => Ok(display.draw(now, config)),
            (Self::Connected(display), Input::Sent) if display.transmits() => Ok(display.wait(now, config)),
            (Self::Connected(display), Input::Pose) => Ok(display.pose(now, config)),
            (Self::Connected(display), Input::Corrupt { line }) => Ok(display.corrupt(line, config)),
            (Self::Connected(display), Input::Xoff) => Ok(display.hold(now, config)),
            (Self::Connected(display), Input::Xon) => Ok(display.resume(config)),
            (Self::Connected(_), Input::Sent)
            | (
                Self::Disconnected,
                Input::Sent | Input::Pose | Input::Corrupt { .. } | Input::Xoff | Input::Xon,
            ) => Err(self.unexpected(&input)),
        }
    }

    fn transmit(&self, _now: Duration, _config: &WorkstationConfig) -> Option<Enquiry> {
        matches!(self, Self::Connected(display) if display.transmits()).then_some(Enquiry)
    }

    fn deadline(&self) -> Option<Duration> {
        let Self::Connected(display) = self else { return None };
        Some(display.due()).filter(|due| *due < Duration::MAX)
    }

    fn expires(&self, now: Duration) -> bool {
        matches!(self, Self::Connected(display) if is_due(display.due(), now))
    }

    fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        let Self::Connected(display) = self else { return };
        if let Request::Waiting { again_from, .. } | Request::Overdue { again_from } = &mut display.request {
            f(again_from);
        }
        if let Request::Waiting { missed_from, .. } = &mut display.request {
            f(missed_from);
        }
        if let Picture::Live { until } = &mut display.picture {
            f(until);
        }
        if let Flow::Held { until } = &mut display.flow {
            f(until);
        }
    }

    /// Returns the state's name, which does not show whether XOFF stops the line.
    fn name(&self) -> &'static str {
        let Self::Connected(display) = self else { return "Disconnected" };
        match (display.request, display.picture) {
            (Request::Allowed, Picture::Stale) => "AllowedStale",
            (Request::Allowed, Picture::Live { .. }) => "AllowedLive",
            (Request::Due, Picture::Stale) => "DueStale",
            (Request::Due, Picture::Live { .. }) => "DueLive",
            (Request::Waiting { .. }, Picture::Stale) => "WaitingStale",
            (Request::Waiting { .. }, Picture::Live { .. }) => "WaitingLive",
            // The picture was stale before.
            (Request::Overdue { .. }, Picture::Stale | Picture::Live { .. }) => "Overdue",
        }
    }
}

impl WorkstationMachine {
    /// Returns the time until which the picture follows the arm without a new pose; `None` if it is stale.
    pub fn live_until(&self) -> Option<Duration> {
        match self {
            Self::Connected(Display { picture: Picture::Live { until }, .. }) => Some(*until),
            Self::Connected(Display { picture: Picture::Stale, .. }) | Self::Disconnected => None,
        }
    }

    /// Goes to a state without the previous request and picture.
    fn close(&mut self, mut to: Self, config: &WorkstationConfig) -> Action {
        let Self::Connected(was) = *self else {
            *self = to;
            return Action::Nothing;
        };
        if let Self::Connected(display) = &mut to {
            if !config.keeps(Rule::AskFirst) {
                display.request = was.request;
            }
            if !config.keeps(Rule::ForgetHold) {
                display.flow = was.flow;
            }
        }
        *self = to;
        let missed = matches!(was.request, Request::Waiting { .. });
        let stale = matches!(was.picture, Picture::Live { .. });
        if (missed || stale) && config.keeps(Rule::ReportEnd) {
            Action::Closed { missed, stale }
        } else {
            Action::Nothing
        }
    }
}

impl Display {
    const NEW: Self = Self { request: Request::Allowed, picture: Picture::Stale, flow: Flow::Free };

    fn transmits(&self) -> bool {
        self.request == Request::Due && self.flow == Flow::Free
    }

    fn wait(&mut self, now: Duration, config: &WorkstationConfig) -> Action {
        let reports = config.keeps(Rule::ReportOverdue);
        let most = if reports { config.stale_after } else { Duration::MAX };
        self.request = Request::Waiting {
            again_from: now.saturating_add(config.pause),
            missed_from: now.saturating_add(most),
        };
        Action::Sent
    }

    fn draw(&mut self, now: Duration, config: &WorkstationConfig) -> Action {
        let (again_from, is_open) = match &mut self.request {
            Request::Allowed | Request::Due => {
                self.request = Request::Due;
                return Action::Nothing;
            }
            Request::Waiting { again_from, .. } => (again_from, true),
            Request::Overdue { again_from } => (again_from, !config.keeps(Rule::MissOnce)),
        };
        let is_again = is_due(*again_from, now) && config.keeps(Rule::AskAgain);
        if !is_again && config.keeps(Rule::Credit) {
            *again_from = now.saturating_add(config.pause);
            return Action::Nothing;
        }
        self.request = Request::Due;
        if is_open { Action::Missed } else { Action::Nothing }
    }

    fn pose(&mut self, now: Duration, config: &WorkstationConfig) -> Action {
        match self.request {
            Request::Waiting { .. } => {
                let last = if config.keeps(Rule::Expire) { config.stale_after } else { Duration::MAX };
                self.request = Request::Allowed;
                self.picture = Picture::Live { until: now.saturating_add(last) };
                Action::Pose
            }
            Request::Overdue { .. } => {
                self.is_alive(config);
                Action::Unasked
            }
            Request::Allowed | Request::Due => Action::Unasked,
        }
    }

    fn corrupt(&mut self, line: bool, config: &WorkstationConfig) -> Action {
        let rule = if line { Rule::CorruptIsAnswer } else { Rule::NoiseIsNoAnswer };
        let is_answer = line == config.keeps(rule);
        match self.request {
            Request::Waiting { .. } if is_answer => {
                self.request = Request::Allowed;
                Action::Missed
            }
            Request::Overdue { .. } if is_answer => {
                self.is_alive(config);
                Action::Nothing
            }
            Request::Waiting { .. } | Request::Overdue { .. } | Request::Allowed | Request::Due => {
                Action::Nothing
            }
        }
    }

    /// Called when an answer has come too late: another request may be sent.
    fn is_alive(&mut self, config: &WorkstationConfig) {
        if config.keeps(Rule::LateIsAlive) {
            self.request = Request::Allowed;
        }
    }

    fn hold(&mut self, now: Duration, config: &WorkstationConfig) -> Action {
        let most = if config.keeps(Rule::EndHold) { config.max_hold } else { Duration::MAX };
        if config.keeps(Rule::Hold) {
            self.flow.hold(now.saturating_add(most), config.keeps(Rule::Prolong));
        }
        Action::Nothing
    }

    fn resume(&mut self, config: &WorkstationConfig) -> Action {
        if config.keeps(Rule::Resume) {
            self.flow = Flow::Free;
        }
        Action::Nothing
    }

    /// Returns the time of the next deadline.
    fn due(&self) -> Duration {
        let picture = match self.picture {
            Picture::Live { until } => until,
            Picture::Stale => Duration::MAX,
        };
        let request = match self.request {
            Request::Waiting { missed_from, .. } => missed_from,
            Request::Allowed | Request::Due | Request::Overdue { .. } => Duration::MAX,
        };
        picture.min(request).min(self.flow.until())
    }

    fn expire(&mut self, now: Duration) -> Action {
        if matches!(self.picture, Picture::Live { until } if is_due(until, now)) {
            self.picture = Picture::Stale;
            return Action::Stale;
        }
        if let Request::Waiting { again_from, missed_from } = self.request
            && is_due(missed_from, now)
        {
            self.request = Request::Overdue { again_from };
            return Action::Missed;
        }
        if self.flow.is_over(now) {
            self.flow = Flow::Free;
            return Action::HoldEnded;
        }
        Action::Nothing
    }
}

robot_session::inputs!(
    Input: Draw,
    Sent,
    Pose,
    Corrupt { line: true } as "Corrupt(line)",
    Corrupt { line: false } as "Corrupt(noise)",
    Xoff,
    Xon,
);
