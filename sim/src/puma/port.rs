//! The controller's port: bytes leave it with the delays of the line, and a reply may be damaged on arrival.

use core::time::Duration;

use robot_session::Session;
use robot_session::end::End as _;
use val2_alter::timing::transmission_time;
use val2_alter::{Controller, ControllerEvent, ControllerStatistics, ErrorCode};

use super::incident::{misread, spoil};

/// A [`Controller`] at its port.
#[derive(Debug)]
pub struct Port {
    controller: Controller,
    is_paced: bool,
    /// The bytes on the line, with the time of their last byte.
    leaving: Option<(Duration, Vec<u8>)>,
    /// The time at which the message that is being answered was on the line, and the reply to it.
    asked: Option<(Duration, PortAnswer)>,
    /// The error that the next reply is to have.
    misread: Option<ErrorCode>,
    /// The next message is to be corrupt.
    corrupt: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PortAnswer {
    None,
    Begun,
    /// Another value has arrived in its place.
    Replaced,
}

impl Port {
    pub(super) fn new(controller: Controller, is_paced: bool) -> Self {
        Self { controller, is_paced, leaving: None, asked: None, misread: None, corrupt: false }
    }

    /// Returns the controller.
    pub fn controller(&self) -> &Controller {
        &self.controller
    }

    /// Returns the controller, to call it.
    pub fn controller_mut(&mut self) -> &mut Controller {
        &mut self.controller
    }

    /// Gives the next reply this error; returns false if a reply is still to get an error.
    pub(super) fn misread(&mut self, error: ErrorCode) -> bool {
        let is_free = self.misread.is_none();
        self.misread.get_or_insert(error);
        is_free
    }

    /// Corrupts the next message; returns false if a message is still to be corrupted.
    pub(super) fn corrupt(&mut self) -> bool {
        !core::mem::replace(&mut self.corrupt, true)
    }
}

impl Session for Port {
    type Event = ControllerEvent;
    type Statistics = ControllerStatistics;
    const MAX_INPUT: usize = <Controller as Session>::MAX_INPUT;
    const MAX_TRANSMIT: usize = <Controller as Session>::MAX_TRANSMIT;

    fn handle_connected(&mut self, now: Duration) {
        (self.leaving, self.asked) = (None, None);
        self.controller.handle_connected(now);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        (self.leaving, self.asked) = (None, None);
        self.controller.handle_disconnected(now);
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        match &mut self.asked {
            // Bytes that arrive before the message has left are an answer to the previous one.
            Some((left, answer)) if *left <= now && *answer == PortAnswer::None => {
                if let Some(error) = self.misread.take() {
                    *answer = PortAnswer::Replaced;
                    let reply = misread(error, self.controller.config().framing);
                    self.controller.handle_input(now, &reply);
                } else {
                    *answer = PortAnswer::Begun;
                    self.controller.handle_input(now, bytes);
                }
            }
            Some((_, PortAnswer::Replaced)) => {}
            _ => self.controller.handle_input(now, bytes),
        }
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.controller.handle_timeout(now);
    }

    fn wants_input(&self) -> bool {
        self.controller.wants_input()
    }

    fn poll_event(&mut self) -> Option<ControllerEvent> {
        self.controller.poll_event()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        if let Some((at, bytes)) = &self.leaving {
            let (length, place) = (bytes.len(), out.get_mut(..bytes.len())?);
            if *at > now {
                return None;
            }
            place.copy_from_slice(bytes);
            self.leaving = None;
            return Some(length);
        }
        let length = self.controller.poll_transmit(now, out)?;
        let bytes = out.get_mut(..length)?;
        if core::mem::take(&mut self.corrupt) {
            spoil(bytes);
        }
        let left = now.saturating_add(transmission_time(length, self.controller.config().baud));
        self.asked = Some((left, PortAnswer::None));
        if self.is_paced {
            self.leaving = Some((left, bytes.to_vec()));
            return None;
        }
        Some(length)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        let leaves = self.leaving.as_ref().map(|(at, _)| *at);
        [leaves, self.controller.poll_timeout()].into_iter().flatten().min()
    }

    fn statistics(&self) -> ControllerStatistics {
        self.controller.statistics()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::indexing_slicing)]
mod tests {
    use val2_alter::{ControllerConfig, ControllerState, Frame};

    use super::*;

    const MS: Duration = Duration::from_millis(1);
    /// Before anything can be over.
    const INSTANT: Duration = Duration::from_nanos(1);

    fn frame(data: &[u8]) -> Vec<u8> {
        let mut bytes = [0; Frame::MAX_LEN];
        let length =
            Frame::new(data).unwrap().encode(ControllerConfig::default().framing, &mut bytes).unwrap();
        bytes[..length].to_vec()
    }

    /// Returns a port whose controller has sent its first standard message, and the time at which it has left.
    fn asked() -> (Port, Duration) {
        let config = ControllerConfig { gap: None, ..ControllerConfig::default() };
        let mut port = Port::new(Controller::new(config).unwrap(), true);
        port.handle_connected(Duration::ZERO);
        port.controller_mut().start(Duration::ZERO).unwrap();
        send(&mut port, Duration::ZERO);
        port.handle_input(5 * MS, &frame(&[0]));
        assert_eq!(port.poll_event(), Some(ControllerEvent::Started));
        let left = send(&mut port, 28 * MS);
        (port, left)
    }

    /// Puts a message on the line; returns the time at which it has left, when it is carried.
    fn send(port: &mut Port, now: Duration) -> Duration {
        let mut out = [0; Frame::MAX_LEN];
        assert_eq!(port.poll_transmit(now, &mut out), None);
        let left = port.poll_timeout().unwrap();
        assert!(left > now + MS, "{left:?}");
        assert_eq!(port.poll_transmit(left - INSTANT, &mut out), None);
        let length = port.poll_transmit(left, &mut out).unwrap();
        assert_eq!(left - now, transmission_time(length, port.controller().config().baud));
        assert_eq!(port.poll_transmit(left, &mut out), None, "once");
        left
    }

    fn next(port: &mut Port) -> Option<ControllerEvent> {
        core::iter::from_fn(|| port.poll_event()).find(|event| !matches!(event, ControllerEvent::Stray(_)))
    }

    #[test]
    fn the_reply_to_the_message_is_misread_and_nothing_before_and_behind_it() {
        let (mut port, left) = asked();
        assert!(port.misread(ErrorCode::Checksum) && !port.misread(ErrorCode::Format));
        port.handle_input(left - INSTANT, &frame(&[0, 0]));
        assert_eq!(next(&mut port), None, "an answer to the message before");
        port.handle_input(left, &frame(&[0, 0]));
        assert!(port.misread(ErrorCode::Format), "the next one is to be misread as well");
        port.handle_input(left + MS, &frame(&[0, 0]));
        port.handle_timeout(55 * MS);
        assert_eq!(next(&mut port), Some(ControllerEvent::BadReply(ErrorCode::Checksum)));
        let left = send(&mut port, 56 * MS);
        port.handle_input(left, &frame(&[0, 0]));
        port.handle_timeout(83 * MS);
        assert_eq!(next(&mut port), Some(ControllerEvent::BadReply(ErrorCode::Format)));
    }

    #[test]
    fn one_message_is_corrupt_for_each_time_that_it_is_asked_for() {
        let (mut port, _) = asked();
        assert!(port.corrupt() && !port.corrupt());
        send(&mut port, 56 * MS);
        assert!(port.corrupt());
    }

    #[test]
    fn a_reply_that_has_begun_is_read_to_its_end() {
        let (mut port, left) = asked();
        let reply = frame(&[0, 0]);
        port.handle_input(left, &reply[..2]);
        assert!(port.misread(ErrorCode::Checksum));
        port.handle_input(left + MS, &reply[2..]);
        assert!(matches!(next(&mut port), Some(ControllerEvent::Reply { .. })));
    }

    #[test]
    fn a_reply_that_does_not_come_is_missed_when_its_time_is_over() {
        let (mut port, left) = asked();
        let over = port.poll_timeout().unwrap();
        assert!(over > left);
        port.handle_timeout(over - INSTANT);
        assert_eq!(port.poll_event(), None);
        port.handle_timeout(over);
        assert_eq!(port.poll_event(), Some(ControllerEvent::BadReply(ErrorCode::Timeout)));
    }

    #[test]
    fn nothing_of_a_connection_is_left_in_the_next_one() {
        let (mut port, left) = asked();
        port.handle_disconnected(left);
        assert_eq!(port.controller().state(), ControllerState::Disconnected);
        assert!(matches!(port.poll_event(), Some(ControllerEvent::Ended(_))));
        assert_eq!(port.poll_timeout(), None);
    }
}
