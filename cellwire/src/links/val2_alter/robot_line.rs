//! The simulated robot's end of the line, and what the script says of it.

use std::io;
use std::time::Duration;

use robot_session::{Received, Sent, Transport, Wait};
use val2_alter::{ErrorCode, Framing};

use super::script::{misread, spoil};
use crate::io::line::Line;

/// The line by the robot's own clock.
pub(super) struct RobotLine<'a> {
    pub(super) line: &'a mut Line,
    pub(super) now: Duration,
    /// When this process gets no processor, a request leaves late through no fault of the host: the robot's clock stands still.
    pub(super) stood: Duration,
    pub(super) request: Option<Request>,
    framing: Framing,
    /// The error that the next reply is to have.
    pub(super) misread: Option<ErrorCode>,
    /// The next message is to be corrupt.
    pub(super) corrupt: bool,
}

/// The request that is being answered.
pub(super) struct Request {
    pub(super) arrived: Duration,
    pub(super) length: usize,
    pub(super) first_byte: Option<Duration>,
    pub(super) last_byte: Duration,
    /// Something else has arrived in the place of its reply.
    replaced: bool,
}

impl<'a> RobotLine<'a> {
    pub(super) fn new(line: &'a mut Line, framing: Framing) -> Self {
        let now = line.now();
        Self { line, now, stood: Duration::ZERO, request: None, framing, misread: None, corrupt: false }
    }

    /// What the controller gets of the bytes that have arrived.
    fn replace(&mut self, received: usize, is_first: bool, buffer: &mut [u8]) -> Received {
        let Some(request) = &mut self.request else { return Received::Bytes(received) };
        if let (Some(error), true) = (self.misread, is_first) {
            (request.replaced, self.misread) = (true, None);
            let reply = misread(error, self.framing);
            let length = reply.len().min(buffer.len());
            for (place, byte) in buffer.iter_mut().zip(reply) {
                *place = byte;
            }
            return if length > 0 { Received::Bytes(length) } else { Received::Nothing };
        }
        if request.replaced { Received::Nothing } else { Received::Bytes(received) }
    }
}

impl Transport for RobotLine<'_> {
    fn now(&self) -> Duration {
        self.now
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<Received> {
        let received = Transport::receive(self.line, buffer, wait)?;
        self.stood += self.line.take_lateness();
        self.now = self.now.max(self.line.now().saturating_sub(self.stood));
        // What comes before the request has left is an answer to the one before.
        if let (Received::Bytes(length), Some(request)) = (received, &mut self.request)
            && self.now >= request.arrived
        {
            let is_first = request.first_byte.is_none();
            request.first_byte.get_or_insert(self.now);
            request.last_byte = self.now;
            return Ok(self.replace(length, is_first, buffer));
        }
        Ok(received)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
        let mut frame = bytes.to_vec();
        if core::mem::take(&mut self.corrupt) {
            spoil(&mut frame);
        }
        let arrived = self.line.send(&frame).saturating_sub(self.stood);
        let (length, last_byte) = (frame.len(), Duration::ZERO);
        self.request = Some(Request { arrived, length, first_byte: None, last_byte, replaced: false });
        Ok(Sent::Buffered)
    }
}
