//! The simulated robot's end of the line, and when what was on it.

use std::io;
use std::time::Duration;

use robot_session::{Received, Sent, Transport, Wait};

use crate::io::line::Line;

/// The line by the robot's own clock.
pub(super) struct RobotLine<'a> {
    pub(super) line: &'a mut Line,
    pub(super) now: Duration,
    /// When this process gets no processor, a request leaves late through no fault of the host: the robot's clock is stopped.
    pub(super) stood: Duration,
    pub(super) request: Option<Request>,
}

/// The request that is being answered.
pub(super) struct Request {
    pub(super) arrived: Duration,
    pub(super) length: usize,
    pub(super) first_byte: Option<Duration>,
    pub(super) last_byte: Duration,
}

impl<'a> RobotLine<'a> {
    pub(super) fn new(line: &'a mut Line) -> Self {
        let now = line.now();
        Self { line, now, stood: Duration::ZERO, request: None }
    }
}

impl RobotLine<'_> {
    /// Carries bytes up to now while the robot does not read.
    pub(super) fn pass(&mut self) {
        self.line.pass();
        self.go_on();
    }

    fn go_on(&mut self) {
        self.stood += self.line.take_lateness();
        self.now = self.now.max(self.line.now().saturating_sub(self.stood));
    }
}

impl Transport for RobotLine<'_> {
    fn now(&self) -> Duration {
        self.now
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<Received> {
        let received = Transport::receive(self.line, buffer, wait)?;
        self.go_on();
        // What comes before the request has left is an answer to the one before.
        if let (Received::Bytes(_), Some(request)) = (received, &mut self.request)
            && self.now >= request.arrived
        {
            request.first_byte.get_or_insert(self.now);
            request.last_byte = self.now;
        }
        Ok(received)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
        let arrived = self.line.send(bytes).saturating_sub(self.stood);
        let (length, last_byte) = (bytes.len(), Duration::ZERO);
        self.request = Some(Request { arrived, length, first_byte: None, last_byte });
        Ok(Sent::Buffered)
    }
}
