//! The meanings of messages and fields for the sessions.

/// The meaning of a message for the sessions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Role {
    /// PC: a job to execute.
    Job,
    /// Robot: a job has been executed.
    JobAck,
    /// Robot: send the jobs from this number on, be it for the first time or again.
    JobRequest,
    /// Robot: the queue is full, or there is an error: send no job before the next request.
    Pause,
    /// PC: an order begins with this job number.
    OrderStart,
    /// Robot: the order that is active now; 0 if no order is.
    OrderAck,
    /// PC: no job follows; the order ends when those in the queue are executed.
    OrderEnd,
    /// PC: the order ends after the job that is being executed; the queue is cleared.
    OrderInterrupt,
    /// Robot: an order is over, and the active order: 0.
    EndAck,
    /// Both: order, phase and progress.
    Status,
    /// Both: no content. It keeps the connection alive (thesis, section 10.4).
    Filler,
    /// PC: a command of the application that bypasses the queue, such as a speed or a delay (thesis, section 11.1).
    Command(u8),
}

/// The contents of a field. The values that the sessions use are whole numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Field {
    /// An order's number, from 1; 0 for none.
    Order,
    /// The order that ended last, from 1; empty since the robot's start.
    Ended,
    /// The code of a [`Phase`](crate::Phase), 0 to 255.
    Phase,
    /// A job's number, 1 to 9999.
    Number,
    /// The job that was queued (robot) or sent (PC) last, 1 to 9999; empty for none.
    Queued,
    /// The job up to which all are executed, 1 to 9999; empty for none.
    Executed,
    /// The value of a [`Role::Command`], any 32-bit whole number.
    Value,
    /// All fields of a job's own, one after the other: see [`Work`](crate::Work).
    Work,
    /// A constant that a plant adds: a message without it is not for this end.
    Constant(&'static str),
    /// A field that the sessions do not need: written empty, not checked when read.
    Unused,
}

/// A field that the sessions use: its index among the stored values, and its range.
#[derive(Debug)]
pub(crate) struct Row {
    /// The index among the values of a message.
    pub(crate) index: usize,
    /// The least value and the greatest.
    pub(crate) range: (i32, i32),
    /// Whether the field may be empty, for none.
    pub(crate) may_be_empty: bool,
}

impl Field {
    pub(crate) const VALUES: usize = 7;

    /// Returns the row of a field; `None` for a field that the sessions do not use.
    #[inline]
    pub(crate) const fn row(&self) -> Option<&'static Row> {
        const ORDERS: (i32, i32) = (0, u16::MAX as i32);
        const JOBS: (i32, i32) = (1, 9999);
        Some(match self {
            Field::Order => &Row { index: 0, range: ORDERS, may_be_empty: false },
            Field::Ended => &Row { index: 1, range: ORDERS, may_be_empty: true },
            Field::Phase => &Row { index: 2, range: (0, u8::MAX as i32), may_be_empty: false },
            Field::Number => &Row { index: 3, range: JOBS, may_be_empty: false },
            Field::Queued => &Row { index: 4, range: JOBS, may_be_empty: true },
            Field::Executed => &Row { index: 5, range: JOBS, may_be_empty: true },
            Field::Value => &Row { index: 6, range: (i32::MIN, i32::MAX), may_be_empty: false },
            Field::Work | Field::Constant(_) | Field::Unused => return None,
        })
    }
}
