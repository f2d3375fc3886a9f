//! The server's end ("slave").

mod config;
mod event;
pub mod machine;
mod receiver;
mod replies;

use core::ops::Range;
use core::time::Duration;

use robot_session::end::{Core, Echo, End, EventQueue, QueueSpace};

#[doc(hidden)]
pub use config::Rule;
pub use config::ServerConfig;
pub use event::{ServerEvent, ServerStatistics};
use machine::{Action, DueReply, Input, ServerMachine};

use crate::decoder::{Decoder, WINDOW};
use crate::error::{ConfigError, DecodeError};
use crate::frame::Frame;
use crate::message::function::Row;
use crate::message::{Exception, limit};
use crate::registers::{Registers, serve_other};
use receiver::Receiver;
use replies::Replies;

/// The number of bytes of an RTU request to read.
const READ_REQUEST: usize = 8;

/// One connection to a server, or one serial line, with `N` entries for replies that wait to be sent.
///
/// A [`Session`](robot_session::Session) with the methods and the order of calls of the trait. Requests are executed on the
/// [`Registers`] as they arrive, on a serial line when the line has been silent for 3.5 characters; replies are sent in the
/// same order. Any number of connections can share registers: implement [`Registers`] for the shared value.
///
/// Through TCP a request is read when there is an entry for its reply, and until then the session wants no input: a client
/// that does not wait gets every reply. On a serial line a client waits: a request that is followed by another frame without
/// a silence, or has no entry, is neither executed nor answered, and reported as [`ServerEvent::Refused`]. Every event is a
/// notice, for a log: no reaction is needed.
///
/// Any data of a message may look like a request, so corrupt bytes are not searched for requests. An RTU request is executed
/// only if it begins after a silence, or after a whole frame, even one of another unit; on a serial line, the bytes before a
/// silence are dropped unless all of them are whole frames. A frame whose length is not reached at a silence is awaited, up
/// to [`ServerConfig::frame_timeout`]: bytes may be delayed between the line and the program. A silence counts when the
/// driver has observed it: [`handle_timeout`](robot_session::Session::handle_timeout) is called after the bytes that have
/// arrived were read.
#[derive(Debug, Clone)]
pub struct Server<R, const N: usize = 8> {
    core: Core<ServerMachine<N>, Receiver, EventQueue<ServerEvent, 8>, ServerStatistics>,
    registers: R,
    replies: Replies<N>,
    echo: Echo<{ Frame::MAX_LEN }>,
    /// Whether the bytes that were read last ended within corruption.
    was_corrupt: bool,
}

impl<R: Registers, const N: usize> Server<R, N> {
    /// Creates a server without a connection.
    ///
    /// # Errors
    /// The unit would be 0, which is the broadcast; or the configuration sets `echo` over TCP.
    pub fn new(config: ServerConfig, registers: R) -> Result<Self, ConfigError> {
        const { assert!(N >= 1 && N <= 255, "a server has 1 to 255 places") };
        if let Some(found) = config.unit.filter(|unit| config.is_broadcast(*unit)) {
            return Err(ConfigError::Unit { found });
        }
        if config.echo && config.framing.has_transactions() {
            return Err(ConfigError::Echo);
        }
        Ok(Self {
            core: Core::new(config, ServerMachine::NEW, Receiver::new(&config)),
            registers,
            replies: Replies::EMPTY,
            echo: Echo::new(config.echo),
            was_corrupt: false,
        })
    }

    /// Returns the registers that requests read and write.
    pub const fn registers(&self) -> &R {
        &self.registers
    }

    /// Returns the registers that requests read and write.
    pub const fn registers_mut(&mut self) -> &mut R {
        &mut self.registers
    }

    /// Handles the end of a read. On TCP a client that stops within corruption is out of step: its next valid frame may never
    /// come.
    #[inline]
    fn all_read(&mut self) {
        let Some(error) = self.core.decoder.corruption() else {
            self.was_corrupt = false;
            return;
        };
        if !core::mem::replace(&mut self.was_corrupt, true) {
            self.core.events.push_notice(ServerEvent::OutOfStep(error));
        }
    }

    /// Executes a request, and stores its reply.
    #[inline(always)] // into the two places that read
    fn serve(&mut self, request: Range<usize>) {
        let Some(frame) = self.core.decoder.frame(request) else { return };
        let Some(reply) = self.replies.push() else { return };
        reply.length = frame.serve(&mut self.registers, &mut reply.bytes).unwrap_or(0);
        let served = served(&frame, reply.exception(frame.transaction.is_some()));
        self.core.statistics.served += 1;
        self.core.events.push_notice(served);
    }

    /// Executes a request; its reply is not sent.
    #[cold]
    fn serve_broadcast(&mut self, request: Range<usize>) {
        let Some(frame) = self.core.decoder.frame(request) else { return };
        let exception = serve_other(frame.pdu, &mut self.registers, &mut [0; limit::PDU]).err();
        let served = served(&frame, exception);
        self.core.statistics.served += 1;
        self.core.events.push_notice(served);
    }

    #[cold]
    fn refused(&mut self, request: Range<usize>) {
        let Some(frame) = self.core.decoder.frame(request) else { return };
        let refused = ServerEvent::Refused { unit: frame.unit, function: frame.function() };
        self.core.statistics.refused += 1;
        self.core.events.push_notice(refused);
    }

    #[cold]
    fn corrupt(&mut self, error: DecodeError) {
        self.core.statistics.corrupt += 1;
        self.core.events.push_notice(ServerEvent::Corrupt(error));
    }
}

impl<R: Registers, const N: usize> End for Server<R, N> {
    type Machine = ServerMachine<N>;
    type Decoder = Receiver;
    type Events = EventQueue<ServerEvent, 8>;
    type Statistics = ServerStatistics;
    /// The range of a request in the decoder.
    type Payload = Range<usize>;

    const LINK: &'static str = "fanuc-hmi-modbus";
    const END: &'static str = "server";
    /// The number of bytes that fit beside a run of corrupt bytes.
    const MAX_INPUT: usize = Decoder::CAPACITY - WINDOW;
    const MAX_TRANSMIT: usize = Frame::MAX_LEN;
    const QUEUE_SPACE: QueueSpace = QueueSpace::NONE;

    robot_session::core!(ServerEvent::Unexpected);
    robot_session::echo!(ServerEvent::Echo);

    #[inline(always)] // into the one place that often has bytes
    fn next_input(&mut self) -> Option<(Input, Option<Range<usize>>)> {
        loop {
            let Some(found) = self.core.decoder.advance() else {
                self.all_read();
                return None;
            };
            match found {
                Ok(range) => {
                    let unit = self.core.decoder.unit(&range)?;
                    let is_last = self.core.decoder.was_last();
                    return Some((Input::Request { unit, is_last }, Some(range)));
                }
                // Further bytes of the same corruption were reported already.
                Err(DecodeError::Noise { .. }) => {}
                Err(error) => self.corrupt(error),
            }
        }
    }

    #[inline(always)] // where there is no request, little is left
    fn act(&mut self, now: Duration, action: Action, request: Option<Range<usize>>) {
        match (action, request) {
            (Action::Reset, _) => {
                self.was_corrupt = false;
                self.replies.clear();
            }
            (Action::Cut, _) => {
                self.core.decoder.pause();
                self.read(now);
                if self.core.decoder.is_partial() {
                    self.advance(now, Input::Partial, None);
                }
            }
            (Action::GiveUp, _) => self.finish(now),
            (Action::Serve, Some(request)) => self.serve(request),
            (Action::ServeBroadcast, Some(request)) => self.serve_broadcast(request),
            (Action::Refuse, Some(request)) => self.refused(request),
            (Action::Nothing | Action::Ignore | Action::Sent, _) => {}
            (Action::Serve | Action::ServeBroadcast | Action::Refuse, None) => {}
        }
    }

    #[inline]
    fn write(&mut self, _now: Duration, DueReply: DueReply, out: &mut [u8]) -> Option<(usize, Input)> {
        let out = out.first_chunk_mut::<{ Frame::MAX_LEN }>()?;
        let length = self.replies.pop(out)?;
        if !self.core.config.framing.has_transactions() {
            let reply = out.get(..length).unwrap_or_default();
            self.echo.sent(reply, is_long_read(reply));
        }
        Some((length, Input::Sent))
    }

    #[inline]
    fn begin_input(&mut self, now: Duration) -> bool {
        let result = self.core.on(now, Input::Received);
        result.map_err(|unexpected| self.refuse(unexpected)).is_ok()
    }

    /// Returns true even while a frame arrives that only the silence ends.
    #[inline]
    fn takes_input(&self) -> bool {
        !self.core.machine.is_full()
    }

    /// Handles lost bytes. On a serial line the bytes before, without a silence, are past. Through TCP the caller gives more
    /// than the session wants.
    #[cold]
    fn overrun(&mut self, _now: Duration) {
        if self.core.machine.is_full() {
            let noise = self.core.decoder.lose();
            self.corrupt(noise);
        }
        while let Some(request) = self.core.decoder.next_followed() {
            self.refused(request);
        }
    }
}

/// Returns the event of an executed request.
#[inline]
fn served(request: &Frame<&[u8]>, exception: Option<Exception>) -> ServerEvent {
    let Frame { transaction, unit, .. } = *request;
    ServerEvent::Served { transaction, unit, function: request.function(), exception }
}

/// Returns whether an RTU reply has values, and is longer than a request to read them.
fn is_long_read(reply: &[u8]) -> bool {
    reply.len() > READ_REQUEST && reply.get(1).is_some_and(|code| Row::of(*code).reads > 0)
}
