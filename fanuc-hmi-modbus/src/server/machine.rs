//! The server's machine: the request that is executed, and the time at which its reply may be sent. No bytes.

use core::time::Duration;

use robot_session::Unexpected;
use robot_session::end::{Expiry, Machine};

use super::config::{Rule, ServerConfig};
pub use crate::line::Line;

/// The state of a server with `N` entries for replies.
///
#[doc = include_str!("../../diagrams/server.md")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ServerMachine<const N: usize> {
    /// The connection, and the conditions before something is sent.
    pub link: ServerLink,
}

/// The connection, and the conditions before something is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ServerLink {
    /// There is no connection.
    Down,
    /// There is a connection, on which requests come.
    Up {
        /// The line's activity: whether bytes are arriving.
        line: Line,
        /// Whether the line is serial: then bytes are not read until it is silent; through TCP, they are not read until there
        /// is an entry for a reply.
        serial: bool,
        /// The number of replies that wait to be sent, 0 to `N`.
        replies: u8,
    },
}

/// An input of a server's machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// The caller reports a new connection.
    Connected,
    /// The caller reports that the connection is lost.
    Disconnected,
    /// Time has passed. Given after the bytes that have arrived were read: an unobserved silence does not count.
    Timeout,
    /// Bytes have arrived. Given before they are decoded.
    Received,
    /// The line is silent, and the bytes that have arrived may be the beginning of a frame.
    Partial,
    /// The bytes contained a frame.
    Request {
        /// The unit that the request is for; 0 is a broadcast if the server has broadcasts.
        unit: u8,
        /// Whether nothing has followed the request without a silence. Through TCP, over which a client need not wait,
        /// always true.
        is_last: bool,
    },
    /// The reply that was due is sent.
    Sent,
}

/// The output of a server: its oldest reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct DueReply;

/// An action of a server.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// The session has nothing to do.
    Nothing,
    /// Discards the replies that were not sent.
    Reset,
    /// The line is silent: the held bytes are checked.
    Cut,
    /// The rest of a frame that has begun has not come: the held bytes will not be continued.
    GiveUp,
    /// Executes the request, and stores the reply.
    Serve,
    /// Executes the request, without a reply.
    ServeBroadcast,
    /// The request is for another unit.
    Ignore,
    /// On a serial line the reply is no longer awaited, or it has no free entry: the request is not executed.
    Refuse,
    /// The oldest reply was sent.
    Sent,
}

robot_session::inputs!(
    Input: Received,
    Partial,
    Request { is_last: true } as "Request",
    Request { is_last: false } as "Request(followed)",
    Sent,
);

impl<const N: usize> ServerMachine<N> {
    /// A server without a connection.
    pub const NEW: Self = Self { link: ServerLink::Down };

    /// Returns whether there is a connection.
    pub fn is_connected(&self) -> bool {
        self.link != ServerLink::Down
    }

    /// Returns whether bytes from TCP must wait because there is no entry for a reply.
    #[inline]
    pub fn is_full(&self) -> bool {
        matches!(self.link, ServerLink::Up { serial: false, replies, .. } if usize::from(replies) >= N)
    }

    fn request(&mut self, unit: u8, is_last: bool, config: &ServerConfig) -> Option<Action> {
        if !self.reads() {
            return None;
        }
        let ServerLink::Up { replies, .. } = &mut self.link else { return None };
        if config.is_broadcast(unit) && config.keeps(Rule::NoReplyToBroadcast) {
            return Some(Action::ServeBroadcast);
        }
        let is_own = config.is_broadcast(unit) || config.unit.is_none_or(|own| own == unit);
        if !is_own && config.keeps(Rule::CheckUnit) {
            return Some(Action::Ignore);
        }
        let is_answered = is_last || !config.keeps(Rule::AnswerLast);
        if !is_answered || usize::from(*replies) >= N {
            return Some(Action::Refuse);
        }
        *replies += 1;
        Some(Action::Serve)
    }

    fn timeout(&mut self, now: Duration) -> Action {
        if !self.expires(now) {
            return Action::Nothing;
        }
        let ServerLink::Up { line, .. } = &mut self.link else { return Action::Nothing };
        match core::mem::replace(line, Line::Silent) {
            Line::Partial { .. } => Action::GiveUp,
            Line::Silent | Line::Busy { .. } => Action::Cut,
        }
    }

    fn sent(&mut self, now: Duration, config: &ServerConfig) -> Option<Action> {
        self.transmit(now, config)?;
        let is_full = self.is_full();
        let ServerLink::Up { line, replies, .. } = &mut self.link else { return None };
        // The server reads again, and a silence can begin.
        if is_full {
            line.receive(now, config.framing);
        }
        *replies -= 1;
        Some(Action::Sent)
    }
}

impl<const N: usize> Machine for ServerMachine<N> {
    const END: &'static str = "server";
    /// A late driver has not seen whether the line was silent.
    const EXPIRY: Expiry = Expiry::Last;
    type Input = Input;
    type Action = Action;
    type Transmit = DueReply;
    type Config = ServerConfig;

    /// # Errors
    /// Bytes without a connection, a request while none is read, a reply that was not due.
    #[inline(always)] // where the input is known, little of it is left
    fn on(&mut self, now: Duration, input: Input, config: &ServerConfig) -> Result<Action, Unexpected> {
        let action = match (input, &mut self.link) {
            (Input::Connected | Input::Disconnected, ServerLink::Up { .. })
                if !config.keeps(Rule::DropReplies) =>
            {
                Some(Action::Nothing)
            }
            (Input::Connected, link) => {
                // Without the rule the server refuses requests without a free entry, as on a serial line.
                let serial = config.framing.is_serial() || !config.keeps(Rule::WaitForPlace);
                *link = ServerLink::Up { line: Line::Silent, serial, replies: 0 };
                Some(Action::Reset)
            }
            (Input::Disconnected, link) => {
                *link = ServerLink::Down;
                Some(Action::Reset)
            }
            (Input::Timeout, _) => Some(self.timeout(now)),
            (Input::Received, ServerLink::Up { line, .. }) => {
                line.receive(now, config.framing);
                Some(Action::Nothing)
            }
            (Input::Partial, ServerLink::Up { line: line @ Line::Silent, serial: true, .. }) => {
                if config.keeps(Rule::AwaitRest) {
                    line.wait_for_rest(now.saturating_add(config.frame_timeout));
                    Some(Action::Nothing)
                } else {
                    Some(Action::GiveUp)
                }
            }
            (Input::Request { unit, is_last }, ServerLink::Up { .. }) => self.request(unit, is_last, config),
            (Input::Sent, ServerLink::Up { line: Line::Silent, replies: replies @ 1.., .. }) => {
                *replies -= 1;
                Some(Action::Sent)
            }
            (Input::Sent, ServerLink::Up { .. }) => self.sent(now, config),
            (Input::Partial, ServerLink::Up { .. })
            | (Input::Received | Input::Partial | Input::Request { .. } | Input::Sent, ServerLink::Down) => {
                None
            }
        };
        action.ok_or_else(|| self.unexpected(&input))
    }

    #[inline]
    fn transmit(&self, _now: Duration, config: &ServerConfig) -> Option<DueReply> {
        let ServerLink::Up { line, replies, .. } = self.link else { return None };
        let may_send = line.may_send(config.framing) || !config.keeps(Rule::ReplyAfterSilence);
        (may_send && replies > 0).then_some(DueReply)
    }

    fn deadline(&self) -> Option<Duration> {
        match self.link {
            // While the server does not read, nothing shows that the line is silent.
            ServerLink::Up { line, .. } => line.ends_at().filter(|at| *at < Duration::MAX && !self.is_full()),
            ServerLink::Down => None,
        }
    }

    #[inline]
    fn expires(&self, now: Duration) -> bool {
        self.deadline().is_some_and(|silent_at| now >= silent_at)
    }

    #[inline]
    fn reads(&self) -> bool {
        match self.link {
            ServerLink::Up { line, serial: true, .. } => line == Line::Silent,
            ServerLink::Up { serial: false, .. } | ServerLink::Down => !self.is_full(),
        }
    }

    fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        if let ServerLink::Up { line, .. } = &mut self.link {
            line.ends_at_mut().into_iter().for_each(&mut f);
        }
    }

    fn name(&self) -> &'static str {
        match self.link {
            ServerLink::Down => "Disconnected",
            ServerLink::Up { line: Line::Busy { .. } | Line::Partial { .. }, .. } => "Receiving",
            ServerLink::Up { line: Line::Silent, replies: 1.., .. } => "Replying",
            ServerLink::Up { line: Line::Silent, replies: 0, .. } => "Idle",
        }
    }
}
