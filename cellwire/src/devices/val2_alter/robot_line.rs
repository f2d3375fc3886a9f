//! The simulated robot's end of the line, and the times of the bytes on it.

use std::cell::RefCell;
use std::io;
use std::time::Duration;

use robot_session::{ReceiveOutcome, SendOutcome, Transport, Wait};

use crate::io::line::Line;

/// The line by the robot's own clock.
pub(super) struct RobotLine<'a> {
    pub(super) line: &'a mut Line,
    pub(super) times: &'a RefCell<Times>,
}

/// The times of a robot's line.
#[derive(Debug, Default)]
pub(super) struct Times {
    /// The time of the robot's clock.
    pub(super) now: Duration,
    /// The time for which that clock was stopped: if this process gets no processor, a request is sent late, which is not
    /// the host's fault.
    pub(super) stood: Duration,
    /// The request that is being answered.
    pub(super) request: Option<Request>,
}

/// The times of a request and its reply.
#[derive(Debug)]
pub(super) struct Request {
    pub(super) arrived: Duration,
    pub(super) length: usize,
    pub(super) first_byte: Option<Duration>,
    pub(super) last_byte: Duration,
}

impl AsMut<Line> for RobotLine<'_> {
    fn as_mut(&mut self) -> &mut Line {
        self.line
    }
}

impl Transport for RobotLine<'_> {
    fn now(&self) -> Duration {
        let mut times = self.times.borrow_mut();
        times.stood = self.line.lateness();
        times.now = times.now.max(self.line.now().saturating_sub(times.stood));
        times.now
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        let received = Transport::receive(self.line, buffer, wait)?;
        let now = self.now();
        // Bytes that arrive before the request was sent are the reply to the previous request.
        if let (ReceiveOutcome::Bytes(_), Some(request)) = (received, &mut self.times.borrow_mut().request)
            && now >= request.arrived
        {
            request.first_byte.get_or_insert(now);
            request.last_byte = now;
        }
        Ok(received)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        let mut times = self.times.borrow_mut();
        let arrived = self.line.send(bytes).saturating_sub(times.stood);
        let (length, last_byte) = (bytes.len(), Duration::ZERO);
        times.request = Some(Request { arrived, length, first_byte: None, last_byte });
        Ok(SendOutcome::Buffered)
    }
}
