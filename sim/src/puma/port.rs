//! The controller's port: what leaves it takes its time, and what arrives may be something else.

use core::time::Duration;

use robot_session::Session;
use val2_alter::timing::transmission_time;
use val2_alter::{Controller, ControllerEvent, ControllerStatistics, ErrorCode};

use super::incident::{misread, spoil};

/// A [`Controller`] at its port.
#[derive(Debug)]
pub struct Port {
    controller: Controller,
    is_paced: bool,
    /// What is on the line, and when its last byte is.
    leaving: Option<(Duration, Vec<u8>)>,
    /// When the message that is being answered was on the line, and which reply it has got.
    asked: Option<(Duration, Answer)>,
    /// The error that the next reply is to have.
    misread: Option<ErrorCode>,
    /// The next message is to be corrupt.
    corrupt: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Answer {
    None,
    Begun,
    /// Something else has arrived in its place.
    Replaced,
}

impl Port {
    pub(super) fn new(controller: Controller, is_paced: bool) -> Self {
        Self { controller, is_paced, leaving: None, asked: None, misread: None, corrupt: false }
    }

    /// The controller.
    pub fn controller(&self) -> &Controller {
        &self.controller
    }

    /// The controller, to call it.
    pub fn controller_mut(&mut self) -> &mut Controller {
        &mut self.controller
    }

    /// The next reply is to have this error; false: one still is.
    pub(super) fn misread(&mut self, error: ErrorCode) -> bool {
        let is_free = self.misread.is_none();
        self.misread.get_or_insert(error);
        is_free
    }

    /// The next message is to be corrupt; false: one still is.
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
            // What comes before the message has left is an answer to the one before.
            Some((left, answer)) if *left <= now && *answer == Answer::None => {
                if let Some(error) = self.misread.take() {
                    *answer = Answer::Replaced;
                    let reply = misread(error, self.controller.config().framing);
                    self.controller.handle_input(now, &reply);
                } else {
                    *answer = Answer::Begun;
                    self.controller.handle_input(now, bytes);
                }
            }
            Some((_, Answer::Replaced)) => {}
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
        self.asked = Some((left, Answer::None));
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
