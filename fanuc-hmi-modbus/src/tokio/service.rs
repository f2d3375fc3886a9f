//! The session of a handle, in its task.

use core::time::Duration;
use std::boxed::Box;
use std::io;
use std::sync::Arc;

use robot_session::end::End as _;
use robot_session::tokio::{Reports, Service};

use super::{AbandonedRequest, Error, Event, PendingRequest, Requests};
use crate::client::{ClientEvent, Failure, Ticket};
use crate::message::Reply;

impl Requests {
    /// Removes and returns the caller's request with this ticket.
    fn take(&mut self, ticket: Ticket) -> Option<PendingRequest> {
        let at = self.made.iter().position(|(made, _)| *made == ticket)?;
        Some(self.made.swap_remove(at).1)
    }
}

/// The client of a task: a slot for every request that may be in flight.
type Session = crate::Client<16>;

impl Service for Requests {
    type Session = Session;
    type Call = PendingRequest;
    type Event = Event;

    fn has_room(&self, session: &Session) -> bool {
        self.made.len() < session.config().in_flight
    }

    fn call(&mut self, session: &mut Session, _now: Duration, call: PendingRequest) {
        if call.reply.is_abandoned() {
            return;
        }
        let made = match call.pdu.request() {
            Ok(request) => session.request(call.unit, &request).map_err(Error::from),
            Err(error) => Err(Failure::Malformed(error).into()),
        };
        match made {
            Ok(ticket) => self.made.push((ticket, call)),
            // A caller that is gone does not need to know that nothing was sent.
            Err(error) => drop(call.reply.send(Err(error))),
        }
    }

    fn event(&mut self, session: &mut Session, event: ClientEvent, reports: &mut Reports<'_, Event>) {
        let Some(ticket) = event.outcome_of() else {
            if let ClientEvent::OutOfStep(error) = event {
                reports.reconnect(io::Error::new(io::ErrorKind::InvalidData, error));
            }
            reports.event(Event::Notice(event));
            return;
        };
        if let ClientEvent::Failed { failure, .. } = event
            && session.config().framing.has_transactions()
            && session.pending() > 0
        {
            match failure {
                Failure::TimedOut => reports.reconnect(io::Error::other("the server has cut a reply off")),
                // Otherwise the next reply would be read from the middle of this one.
                Failure::Malformed(_) | Failure::Refused(_) if session.in_flight() == 0 => {
                    reports.reconnect(io::Error::other("a reply is longer than its header says"));
                }
                // Over TCP no bytes are returned.
                Failure::Malformed(_)
                | Failure::Refused(_)
                | Failure::Disconnected
                | Failure::NotSent
                | Failure::Returned => {}
            }
        }
        let Some(PendingRequest { unit, mut pdu, reply }) = self.take(ticket) else { return };
        let request = *pdu;
        let outcome = match event {
            ClientEvent::Failed { failure, .. } => Err(failure.into()),
            ClientEvent::Replied { .. } => match session.reply(ticket) {
                Some(Reply::Exception { exception, .. }) => Err(Error::Exception(exception)),
                Some(reply) => pdu.put(&reply).map(|()| pdu).map_err(Error::from),
                None => return,
            },
            // A broadcast has no reply: its outcome is the request.
            _ => Ok(pdu),
        };
        if let Err(outcome) = reply.send(outcome) {
            let outcome = outcome.map(|pdu| *pdu);
            reports.event(Event::Abandoned(Box::new(AbandonedRequest { unit, request, outcome })));
        }
    }

    fn refuse(&mut self, call: PendingRequest, why: &Arc<io::Error>) {
        // As above: nothing was sent.
        let _ = call.reply.send(Err(Error::NotConnected(Arc::clone(why))));
    }
}
