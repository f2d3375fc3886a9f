//! The server's end ("slave").

mod config;
mod event;
mod machine;
mod replies;

use core::time::Duration;

use robot_session::{Decoder as _, EventQueue, Session};

pub use config::ServerConfig;
pub use event::{ServerEvent, ServerStatistics};
pub use machine::{ServerAction, ServerInput, ServerLink, ServerMachine};

use crate::decoder::Decoder;
use crate::error::{ConfigError, DecodeError};
use crate::frame::{Frame, Side};
use crate::framing::{Framing, Framings};
use crate::registers::Registers;
use replies::Replies;

/// One connection to a server, or one serial line, with `N` places for replies that wait to be sent, and for the framings `F`.
///
/// A [`Session`]: its verbs, and the order of calling them, are the trait's. Requests are carried out on the
/// [`Registers`] as they arrive, on a serial line when the line has been silent for 3.5 characters; replies are sent in the
/// same order. Any number of connections can share registers: implement [`Registers`] for what they share.
///
/// All bytes are taken. If more than `N` replies wait, further requests are neither carried out nor answered, and reported as
/// [`ServerEvent::Refused`]. Corrupt bytes cost the frames that they touch and are not answered. Every event is a notice, for
/// a log: nothing needs to be done about it.
///
/// A server that shares its line with others receives their replies as corrupt bytes.
#[derive(Debug, Clone)]
pub struct Server<R, const N: usize = 8, F = Framing> {
    config: ServerConfig,
    machine: ServerMachine<N>,
    decoder: Decoder<F>,
    registers: R,
    replies: Replies<N>,
    events: EventQueue<ServerEvent, 8>,
    statistics: ServerStatistics,
}

impl<R: Registers, const N: usize, F: Framings> Server<R, N, F> {
    /// A server without a connection.
    ///
    /// # Errors
    /// It would be unit 0, which is the broadcast; the type is for another framing.
    pub fn new(config: ServerConfig, registers: R) -> Result<Self, ConfigError> {
        const { assert!(N >= 1 && N <= 255, "a server has 1 to 255 places") };
        if let Some(found) = config.unit.filter(|unit| config.is_broadcast(*unit)) {
            return Err(ConfigError::Unit { found });
        }
        Ok(Self {
            config,
            machine: ServerMachine::NEW,
            decoder: Decoder::new(F::of(config.framing).ok_or(ConfigError::Framing)?, Side::Client),
            registers,
            replies: Replies::EMPTY,
            events: EventQueue::new(),
            statistics: ServerStatistics::default(),
        })
    }

    /// What requests are carried out on.
    pub const fn registers(&self) -> &R {
        &self.registers
    }

    /// What requests are carried out on.
    pub const fn registers_mut(&mut self) -> &mut R {
        &mut self.registers
    }

    /// The state of the machine.
    pub const fn machine(&self) -> &ServerMachine<N> {
        &self.machine
    }

    /// The configuration.
    pub const fn config(&self) -> &ServerConfig {
        &self.config
    }

    #[inline]
    fn step(&mut self, now: Duration, input: ServerInput) -> ServerAction {
        match self.machine.on(now, input, &self.config) {
            Ok(action) => action,
            Err(unexpected) => {
                self.statistics.unexpected += 1;
                self.events.push_notice(ServerEvent::Unexpected(unexpected));
                ServerAction::Nothing
            }
        }
    }

    /// Gives the machine every frame that the decoder has.
    fn judge(&mut self, now: Duration) {
        while let Some(found) = self.decoder.advance() {
            match found {
                Ok(range) => self.request(now, range),
                // More of the same was reported already.
                Err(DecodeError::Noise { .. }) => {}
                Err(error) => {
                    self.statistics.corrupt += 1;
                    self.events.push_notice(ServerEvent::Corrupt(error));
                }
            }
        }
    }

    fn request(&mut self, now: Duration, range: core::ops::Range<usize>) {
        let Some(frame) = self.decoder.frame(range.clone()) else { return };
        let (transaction, unit) = (frame.transaction, frame.unit);
        let function = frame.pdu.first().copied().unwrap_or_default();
        let action = self.step(now, ServerInput::Request { unit });
        let Some(frame) = self.decoder.frame(range) else { return };
        let exception = match action {
            ServerAction::Serve => {
                self.replies.push(transaction.is_some(), |out| frame.serve(&mut self.registers, out))
            }
            ServerAction::ServeBroadcast => {
                let mut out = [0; Frame::MAX_LEN];
                let length = frame.serve(&mut self.registers, &mut out).unwrap_or(0);
                out.get(..length).and_then(|reply| replies::exception(reply, transaction.is_some()))
            }
            ServerAction::Refuse => {
                self.statistics.refused += 1;
                self.events.push_notice(ServerEvent::Refused { transaction, unit, function });
                return;
            }
            _ => return,
        };
        self.statistics.served += 1;
        self.events.push_notice(ServerEvent::Served { transaction, unit, function, exception });
    }
}

impl<R: Registers, const N: usize, F: Framings> Session for Server<R, N, F> {
    type Event = ServerEvent;
    type Statistics = ServerStatistics;

    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize = Frame::MAX_LEN;

    fn handle_connected(&mut self, now: Duration) {
        if self.step(now, ServerInput::Connected) == ServerAction::Reset {
            self.decoder.clear();
            self.replies.clear();
        }
    }

    fn handle_disconnected(&mut self, now: Duration) {
        if self.step(now, ServerInput::Disconnected) == ServerAction::Reset {
            self.decoder.clear();
            self.replies.clear();
        }
    }

    fn handle_input(&mut self, now: Duration, mut bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        let (cut, judges) = match self.step(now, ServerInput::Received) {
            ServerAction::Judge { cut } => (cut, true),
            ServerAction::Keep { cut } => (cut, false),
            _ => return,
        };
        if cut {
            self.decoder.finish();
            self.judge(now);
        }
        let was_corrupt = self.decoder.corruption().is_some();
        while !bytes.is_empty() {
            let taken = self.decoder.push(bytes);
            bytes = bytes.get(taken..).unwrap_or_default();
            if judges {
                self.judge(now);
            } else if taken == 0 {
                self.discard();
            }
        }
        // On TCP the client is out of step: its next valid frame may never come.
        if let (false, Framing::Tcp, Some(error)) =
            (was_corrupt, self.config.framing, self.decoder.corruption())
        {
            self.events.push_notice(ServerEvent::OutOfStep(error));
        }
    }

    fn handle_timeout(&mut self, now: Duration) {
        while self.step(now, ServerInput::Timer) == ServerAction::Cut {
            self.decoder.finish();
            self.judge(now);
        }
    }

    fn poll_event(&mut self) -> Option<ServerEvent> {
        self.events.pop()
    }

    #[inline]
    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        let out = out.first_chunk_mut::<{ Frame::MAX_LEN }>()?;
        match self.step(now, ServerInput::Transmit) {
            ServerAction::Send => self.replies.pop(out),
            _ => None,
        }
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.machine.deadline()
    }

    fn statistics(&self) -> ServerStatistics {
        ServerStatistics { dropped_notices: self.events.dropped_notices(), ..self.statistics }
    }
}

impl<R: Registers, const N: usize, F: Framings> Server<R, N, F> {
    /// A burst without a silence fills the buffer: it holds no frame of a serial line.
    fn discard(&mut self) {
        let noise = DecodeError::Noise { length: self.decoder.pending() };
        self.decoder.clear();
        self.statistics.corrupt += 1;
        self.events.push_notice(ServerEvent::Corrupt(noise));
    }
}
