//! The workstation's machine: when it asks, and whether its picture is stale. No bytes, no clock.
//!
//! It has a *credit of one* (§9.4): it asks in the first display cycle, then only after an answer, or after a pause of the display.
//!
//! As the model has explored it:
#![doc = include_str!("../../diagrams/workstation.md")]

use core::time::Duration;

use robot_session::Unexpected;

use super::config::{Rule, WorkstationConfig};

/// The state of a workstation. Every time is a deadline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum WorkstationMachine {
    /// No connection.
    Disconnected,
    /// The host is asked.
    Connected(Display),
}

/// What is known while there is a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Display {
    /// The request.
    pub request: Request,
    /// The picture.
    pub picture: Picture,
}

/// The request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request {
    /// The next display cycle asks.
    Allowed,
    /// It is to be sent.
    Due,
    /// The answer is awaited.
    Waiting {
        /// From when on the next display cycle asks again: the last one was so long before.
        again_from: Duration,
    },
}

/// The picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Picture {
    /// No pose has come for long.
    Stale,
    /// It follows the arm.
    Live {
        /// Until then, without a new pose.
        until: Duration,
    },
}

/// What happens to a workstation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// The port is open, perhaps again.
    Connected,
    /// The port is closed or lost.
    Disconnected,
    /// Time has passed.
    Timer,
    /// A display cycle.
    Draw,
    /// A request that [is to be sent](WorkstationMachine::transmits) can be sent and its outcome reported.
    Ask,
    /// A packet.
    Pose,
    /// Bytes that are no packet.
    Corrupt {
        /// They are a whole line.
        line: bool,
    },
}

/// What the workstation does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// Nothing.
    None,
    /// Sends ENQ.
    Transmit,
    /// Reports the packet as the answer.
    Pose,
    /// Reports the packet as no answer.
    Unasked,
    /// Reports that the request has no answer.
    Missed,
    /// Reports that the picture is stale.
    Stale,
    /// Reports what the connection's end has ended.
    Closed {
        /// The request has no answer.
        missed: bool,
        /// The picture is stale.
        stale: bool,
    },
}

impl WorkstationMachine {
    /// Moves the machine.
    ///
    /// # Errors
    /// Bytes without a connection, a request that is not due. Nothing has changed then.
    pub fn on(
        &mut self,
        now: Duration,
        input: Input,
        config: &WorkstationConfig,
    ) -> Result<Action, Unexpected> {
        match (&mut *self, input) {
            (_, Input::Connected) => Ok(self.close(Self::Connected(Display::NEW), config)),
            (_, Input::Disconnected) => Ok(self.close(Self::Disconnected, config)),
            (Self::Disconnected, Input::Timer | Input::Draw) => Ok(Action::None),
            (Self::Connected(display), Input::Timer) => Ok(display.expire(now)),
            (Self::Connected(display), Input::Draw) => Ok(display.draw(now, config)),
            (Self::Connected(display), Input::Ask) if display.request == Request::Due => {
                display.request = Request::Waiting { again_from: now.saturating_add(config.pause) };
                Ok(Action::Transmit)
            }
            (Self::Connected(display), Input::Pose) => Ok(display.pose(now, config)),
            (Self::Connected(display), Input::Corrupt { line }) => Ok(display.corrupt(line, config)),
            (Self::Connected(_), Input::Ask)
            | (Self::Disconnected, Input::Ask | Input::Pose | Input::Corrupt { .. }) => {
                Err(Unexpected { state: self.name(), input: input.name() })
            }
        }
    }

    /// Whether a request is to be sent.
    pub fn transmits(&self) -> bool {
        matches!(self, Self::Connected(Display { request: Request::Due, .. }))
    }

    /// When [`Input::Timer`] is to come.
    pub fn deadline(&self) -> Option<Duration> {
        self.live_until().filter(|until| *until < Duration::MAX)
    }

    /// Until when the picture follows the arm, without a new pose.
    pub fn live_until(&self) -> Option<Duration> {
        match self {
            Self::Connected(Display { picture: Picture::Live { until }, .. }) => Some(*until),
            Self::Connected(Display { picture: Picture::Stale, .. }) | Self::Disconnected => None,
        }
    }

    /// Visits every time.
    pub fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        let Self::Connected(display) = self else { return };
        if let Request::Waiting { again_from } = &mut display.request {
            f(again_from);
        }
        if let Picture::Live { until } = &mut display.picture {
            f(until);
        }
    }

    /// The state's name.
    pub fn name(&self) -> &'static str {
        let Self::Connected(display) = self else { return "Disconnected" };
        match (display.request, display.picture) {
            (Request::Allowed, Picture::Stale) => "AllowedStale",
            (Request::Allowed, Picture::Live { .. }) => "AllowedLive",
            (Request::Due, Picture::Stale) => "DueStale",
            (Request::Due, Picture::Live { .. }) => "DueLive",
            (Request::Waiting { .. }, Picture::Stale) => "WaitingStale",
            (Request::Waiting { .. }, Picture::Live { .. }) => "WaitingLive",
        }
    }

    /// Goes to a state without what was.
    fn close(&mut self, mut to: Self, config: &WorkstationConfig) -> Action {
        let Self::Connected(was) = *self else {
            *self = to;
            return Action::None;
        };
        if let (Self::Connected(display), false) = (&mut to, config.keeps(Rule::AskFirst)) {
            display.request = was.request;
        }
        *self = to;
        let missed = matches!(was.request, Request::Waiting { .. });
        let stale = matches!(was.picture, Picture::Live { .. });
        if (missed || stale) && config.keeps(Rule::ReportEnd) {
            Action::Closed { missed, stale }
        } else {
            Action::None
        }
    }
}

impl Display {
    const NEW: Self = Self { request: Request::Allowed, picture: Picture::Stale };

    fn draw(&mut self, now: Duration, config: &WorkstationConfig) -> Action {
        match self.request {
            Request::Allowed => {
                self.request = Request::Due;
                Action::None
            }
            Request::Due => Action::None,
            Request::Waiting { again_from } => {
                let is_again = is_due(again_from, now) && config.keeps(Rule::AskAgain);
                if is_again || !config.keeps(Rule::Credit) {
                    self.request = Request::Due;
                    return Action::Missed;
                }
                self.request = Request::Waiting { again_from: now.saturating_add(config.pause) };
                Action::None
            }
        }
    }

    fn pose(&mut self, now: Duration, config: &WorkstationConfig) -> Action {
        match self.request {
            Request::Waiting { .. } => {
                let last = if config.keeps(Rule::Expire) { config.stale_after } else { Duration::MAX };
                self.request = Request::Allowed;
                self.picture = Picture::Live { until: now.saturating_add(last) };
                Action::Pose
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
            Request::Waiting { .. } | Request::Allowed | Request::Due => Action::None,
        }
    }

    fn expire(&mut self, now: Duration) -> Action {
        match self.picture {
            Picture::Live { until } if is_due(until, now) => {
                self.picture = Picture::Stale;
                Action::Stale
            }
            Picture::Live { .. } | Picture::Stale => Action::None,
        }
    }
}

impl Input {
    /// The input's name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Connected => "Connected",
            Self::Disconnected => "Disconnected",
            Self::Timer => "Timer",
            Self::Draw => "Draw",
            Self::Ask => "Ask",
            Self::Pose => "Pose",
            Self::Corrupt { line: true } => "Corrupt(line)",
            Self::Corrupt { line: false } => "Corrupt(noise)",
        }
    }
}

/// `Duration::MAX` is never.
fn is_due(deadline: Duration, now: Duration) -> bool {
    now >= deadline && deadline < Duration::MAX
}
