//! What a plant may leave out of its messages, and which guarantees are lost then.

use core::fmt;

use crate::role::{Field, Role};

/// An optional message or field that a table lacks; displayed as the guarantee that is lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lack {
    /// The message.
    pub role: Role,
    /// The field of it; `None` for the whole message.
    pub field: Option<Field<'static>>,
    lost: &'static str,
}

impl fmt::Display for Lack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.lost)
    }
}

/// Whether a table can do without.
pub(crate) fn can_lack(role: Role, field: Option<Field<'_>>) -> bool {
    LACKS.iter().any(|lack| lack.role == role && lack.field == field)
}

const fn whole(role: Role, lost: &'static str) -> Lack {
    Lack { role, field: None, lost }
}

const fn field(role: Role, field: Field<'static>, lost: &'static str) -> Lack {
    Lack { role, field: Some(field), lost }
}

pub(crate) const LACKS: &[Lack] = &[
    whole(
        Role::JobAck,
        "executed jobs are known from the status alone, once in its period; jobs cannot overtake one another",
    ),
    whole(Role::Pause, "that the queue is full is not reported: the PC sees only that no jobs are requested"),
    whole(
        Role::OrderInterrupt,
        "the PC cannot break an order off: it ends after the jobs that the robot has queued",
    ),
    field(
        Role::Job,
        Field::Order,
        "a job of another order would be executed in the active one: no datagrams, and one PC alone",
    ),
    field(
        Role::JobAck,
        Field::Order,
        "an acknowledgement of another order is taken for one of the active: no datagrams",
    ),
    field(
        Role::JobRequest,
        Field::Order,
        "a request of another order is taken for one of the active: no datagrams",
    ),
    field(Role::Pause, Field::Order, "a pause of another order is taken for one of the active: no datagrams"),
    field(Role::Pause, Field::Queued, "a pause does not report how far the queue is filled"),
    field(Role::OrderStart, Field::Number, "nothing: an order begins with job 1"),
    field(Role::OrderEnd, Field::Order, "an end is taken for that of the active order: no datagrams"),
    field(
        Role::OrderInterrupt,
        Field::Order,
        "an interruption is taken for that of the active order: no datagrams",
    ),
    field(Role::EndAck, Field::Order, "after an order's end no other is taken to be active"),
    field(
        Role::Status,
        Field::Phase,
        "the phase is not reported; an order whose start was not answered is ended and begun again",
    ),
    field(
        Role::Status,
        Field::Ended,
        "when the acknowledgement of an order's end is lost, the outcome of its last jobs is unknown",
    ),
];
