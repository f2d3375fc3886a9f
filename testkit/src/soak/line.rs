//! The line between both ends of a station, and the loop of `robot_session::drive` on a virtual clock.

use core::time::Duration;

use robot_session::{Session, Step, Steps};

use super::Wire;
use crate::link::{Delivery, End};

/// The wire, as long as it is not cut.
pub(super) struct Line<'a> {
    pub wire: &'a mut Wire,
    pub cut: bool,
}

impl Line<'_> {
    /// Runs one turn of an end: arrived input while the session wants it, the time, then events and transmissions until
    /// there are no more.
    pub fn turn<S: Session>(
        &mut self,
        end: End,
        session: &mut S,
        now: Duration,
        mut handler: impl FnMut(&mut S, S::Event),
    ) {
        let mut buffer = vec![0; S::MAX_TRANSMIT];
        loop {
            while session.wants_input()
                && let Some(delivery) = self.receive(end, now, S::MAX_INPUT)
            {
                match delivery {
                    Delivery::Bytes(bytes) => session.handle_input(now, &bytes),
                    Delivery::Closed => session.handle_disconnected(now),
                }
            }
            let held = !session.wants_input();
            session.handle_timeout(now);
            let mut steps = Steps::NEW;
            loop {
                match steps.next(session, now, &mut buffer) {
                    Step::Event(event) => handler(session, event),
                    Step::Write(_) if self.cut => {}
                    Step::Write(bytes) => self.wire.send(end, now, bytes),
                    Step::Wait { .. } => break,
                }
            }
            if !held || !session.wants_input() {
                return;
            }
        }
    }

    fn receive(&mut self, at: End, now: Duration, most: usize) -> Option<Delivery> {
        let delivery = self.wire.receive_part(at, now, most)?;
        if self.cut && delivery != Delivery::Closed { self.receive(at, now, most) } else { Some(delivery) }
    }
}
