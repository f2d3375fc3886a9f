//! The loop of `robot_session::drive` on a virtual clock: one turn of one end.

use core::time::Duration;

use robot_session::Session;

use crate::link::{Delivery, End, Link};

/// What carries bytes between two ends on a virtual clock.
pub trait Carrier {
    /// Takes bytes from an end.
    fn send(&mut self, from: End, now: Duration, bytes: &[u8]);

    /// What has arrived at an end by `now`: to be called until it returns `None`.
    fn receive(&mut self, at: End, now: Duration) -> Option<Delivery>;
}

impl Carrier for Link {
    fn send(&mut self, from: End, now: Duration, bytes: &[u8]) {
        Link::send(self, from, now, bytes);
    }

    fn receive(&mut self, at: End, now: Duration) -> Option<Delivery> {
        Link::receive(self, at, now)
    }
}

/// One turn of an end: what has arrived, the time, then events and transmissions until there are none.
pub fn turn<S: Session>(
    carrier: &mut impl Carrier,
    end: End,
    session: &mut S,
    now: Duration,
    mut handler: impl FnMut(&mut S, S::Event),
) {
    while let Some(delivery) = carrier.receive(end, now) {
        match delivery {
            Delivery::Bytes(bytes) => session.handle_input(now, &bytes),
            Delivery::Closed => session.handle_disconnected(now),
        }
    }
    session.handle_timeout(now);
    let mut out = vec![0; S::MAX_TRANSMIT];
    loop {
        let mut idle = true;
        while let Some(event) = session.poll_event() {
            handler(session, event);
            idle = false;
        }
        while let Some(length) = session.poll_transmit(now, &mut out) {
            carrier.send(end, now, &out[..length]);
            idle = false;
        }
        if idle {
            return;
        }
    }
}
