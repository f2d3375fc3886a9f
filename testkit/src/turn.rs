//! The loop of `robot_session::drive` on a virtual clock: one turn of one end.

use core::time::Duration;

use robot_session::{Session, Step, Steps};

use crate::link::{Delivery, End, Link};

/// A transport between two ends on a virtual clock.
pub trait Carrier {
    /// Takes bytes from an end.
    fn send(&mut self, from: End, now: Duration, bytes: &[u8]);

    /// Returns the next delivery to an end by `now`, at most this many bytes: to be called until it returns `None`.
    fn receive(&mut self, at: End, now: Duration, most: usize) -> Option<Delivery>;
}

impl Carrier for Link {
    fn send(&mut self, from: End, now: Duration, bytes: &[u8]) {
        Link::send(self, from, now, bytes);
    }

    fn receive(&mut self, at: End, now: Duration, most: usize) -> Option<Delivery> {
        Link::receive_part(self, at, now, most)
    }
}

/// Runs one turn of an end: arrived input while the session wants it, the time, then events and transmissions until
/// there are no more.
pub fn turn<S: Session>(
    carrier: &mut impl Carrier,
    end: End,
    session: &mut S,
    now: Duration,
    mut handler: impl FnMut(&mut S, S::Event),
) {
    let mut buffer = vec![0; S::MAX_TRANSMIT];
    loop {
        while session.wants_input()
            && let Some(delivery) = carrier.receive(end, now, S::MAX_INPUT)
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
                Step::Write(bytes) => carrier.send(end, now, bytes),
                Step::Wait { .. } => break,
            }
        }
        if !held || !session.wants_input() {
            return;
        }
    }
}
