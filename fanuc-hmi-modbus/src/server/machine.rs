//! The server's machine: which request is carried out, and when its reply may be sent. No bytes.

use core::time::Duration;

use robot_session::Unexpected;

use super::config::ServerConfig;
use crate::line::Line;
use crate::model::Rule;

/// The state of a server with `N` places for replies.
///
#[doc = include_str!("../../diagrams/server.md")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ServerMachine<const N: usize> {
    /// The connection.
    pub link: ServerLink,
}

/// The connection, and what has to pass before something is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ServerLink {
    /// There is none.
    Down,
    /// There is one.
    Up {
        /// Whether bytes are arriving.
        line: Line,
        /// The replies that wait to be sent.
        replies: u8,
    },
}

/// What happens to a server.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ServerInput {
    /// A connection was made.
    Connected,
    /// The connection is lost.
    Disconnected,
    /// Bytes have arrived. Given before they are decoded.
    Received,
    /// They held a frame for this unit.
    Request {
        /// The unit.
        unit: u8,
    },
    /// The caller asks for what is to be sent.
    Transmit,
    /// The time of [`ServerMachine::deadline`] has come. Given until nothing is left to do.
    Timer,
}

/// What a server does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ServerAction {
    /// Nothing.
    Nothing,
    /// It forgets what the decoder holds, and the replies that were not sent.
    Reset,
    /// It judges what has arrived, the bytes that arrive now among it.
    Judge {
        /// The line was silent before them: they do not go on with what came before.
        cut: bool,
    },
    /// It keeps what arrives until the line is silent.
    Keep {
        /// As in `Judge`: what came before is judged.
        cut: bool,
    },
    /// The line is silent: what the decoder holds will not be continued, and is judged.
    Cut,
    /// It carries the request out, and keeps the reply.
    Serve,
    /// It carries the request out; nobody waits for a reply.
    ServeBroadcast,
    /// The request is for another unit.
    Ignore,
    /// There is no place for a reply: the request is not carried out.
    Refuse,
    /// It sends the oldest reply.
    Send,
}

impl ServerInput {
    /// Its name.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Connected => "connected",
            Self::Disconnected => "disconnected",
            Self::Received => "bytes received",
            Self::Request { .. } => "request",
            Self::Transmit => "transmit",
            Self::Timer => "timer",
        }
    }
}

impl<const N: usize> ServerMachine<N> {
    /// Without a connection.
    pub const NEW: Self = Self { link: ServerLink::Down };

    /// Takes an input.
    ///
    /// # Errors
    /// The state does not allow it: bytes without a connection. Nothing has changed then.
    pub fn on(
        &mut self,
        now: Duration,
        input: ServerInput,
        config: &ServerConfig,
    ) -> Result<ServerAction, Unexpected> {
        let ServerLink::Up { line, replies } = &mut self.link else {
            return match input {
                ServerInput::Connected => {
                    self.link = ServerLink::Up { line: Line::Silent, replies: 0 };
                    Ok(ServerAction::Reset)
                }
                ServerInput::Disconnected => Ok(ServerAction::Reset),
                ServerInput::Received | ServerInput::Request { .. } => {
                    Err(Unexpected { state: self.name(), input: input.name() })
                }
                ServerInput::Transmit | ServerInput::Timer => Ok(ServerAction::Nothing),
            };
        };
        Ok(match input {
            ServerInput::Connected | ServerInput::Disconnected if !config.keeps(Rule::DropReplies) => {
                ServerAction::Nothing
            }
            ServerInput::Connected => {
                self.link = ServerLink::Up { line: Line::Silent, replies: 0 };
                ServerAction::Reset
            }
            ServerInput::Disconnected => {
                self.link = ServerLink::Down;
                ServerAction::Reset
            }
            ServerInput::Received => {
                let cut = line.is_due(now);
                *line = Line::received(now, config.framing);
                if config.framing.is_serial() {
                    ServerAction::Keep { cut }
                } else {
                    ServerAction::Judge { cut }
                }
            }
            ServerInput::Request { unit } if config.is_broadcast(unit) => {
                if config.keeps(Rule::NoReplyToBroadcast) {
                    ServerAction::ServeBroadcast
                } else {
                    *replies += 1;
                    ServerAction::Serve
                }
            }
            ServerInput::Request { unit }
                if config.keeps(Rule::CheckUnit) && config.unit.is_some_and(|own| own != unit) =>
            {
                ServerAction::Ignore
            }
            ServerInput::Request { .. } if usize::from(*replies) >= N => ServerAction::Refuse,
            ServerInput::Request { .. } => {
                *replies += 1;
                ServerAction::Serve
            }
            ServerInput::Transmit => {
                let may_send = line.may_send(config.framing) || !config.keeps(Rule::ReplyAfterSilence);
                if may_send && *replies > 0 {
                    *replies -= 1;
                    ServerAction::Send
                } else {
                    ServerAction::Nothing
                }
            }
            ServerInput::Timer if line.is_due(now) => {
                *line = Line::Silent;
                ServerAction::Cut
            }
            ServerInput::Timer => ServerAction::Nothing,
        })
    }

    /// When [`ServerInput::Timer`] is due.
    pub fn deadline(&self) -> Option<Duration> {
        match self.link {
            ServerLink::Up { line: Line::Busy { silent_at }, .. } => Some(silent_at),
            ServerLink::Up { line: Line::Silent, .. } | ServerLink::Down => None,
        }
    }

    /// Visits every time in the state.
    pub fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        if let ServerLink::Up { line: Line::Busy { silent_at }, .. } = &mut self.link {
            f(silent_at);
        }
    }

    /// The state's name.
    pub fn name(&self) -> &'static str {
        match self.link {
            ServerLink::Down => "disconnected",
            ServerLink::Up { line: Line::Busy { .. }, .. } => "receiving",
            ServerLink::Up { line: Line::Silent, replies: 1.. } => "replying",
            ServerLink::Up { line: Line::Silent, replies: 0 } => "idle",
        }
    }
}
