//! Errors in bytes from the peer, in messages from the peer, and in calls of this crate.

use crate::number::Decimal;
use crate::role::{Field, Role};
use crate::text::Name;

/// Corruption in the bytes from the peer. The decoder continues at the next `<`.
///
/// Every `offset` counts from the first byte that was ever pushed, or from the beginning of a slice that is decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
#[allow(missing_docs, reason = "the error's message names the fields")]
pub enum DecodeError {
    /// Bytes between two messages.
    #[error("{length} bytes outside any message (at byte {offset})")]
    Garbage { offset: usize, length: usize },
    /// The name is empty.
    #[error("the message has no name (at byte {offset})")]
    NoName { offset: usize },
    /// The last field of the header is missing or is not a number: it is the length (thesis, section 10.1).
    #[error("the header does not end with a length (at byte {offset})")]
    NoLength { offset: usize },
    /// The length does not equal the bytes between the two `#` (thesis, sections 7.1 and 10.3).
    #[error("the header says {expected} bytes, the data part has {found} (at byte {offset})")]
    Length { offset: usize, expected: usize, found: usize },
    /// One of `<`, `>`, `#` at an invalid position. A `<` begins the next message: this one was truncated.
    #[error("a '{}' inside the message (at byte {offset})", *found as char)]
    Mark { offset: usize, found: u8 },
    /// The data part is not followed by `>`.
    #[error("byte {found:#04x} instead of the end mark '>' (at byte {offset})")]
    NoEndMark { offset: usize, found: u8 },
    /// A byte above 127 where only ASCII is allowed.
    #[error("byte {found:#04x} is not ASCII (at byte {offset})")]
    NotAscii { offset: usize, found: u8 },
    /// The message is, or by its length is, longer than the longest packet, or than the decoder can hold.
    #[error("the message is longer than {limit} bytes (at byte {offset})")]
    TooLong { offset: usize, limit: usize },
    /// The input or the datagram ends inside a message.
    #[error("the input ends inside a message after {found} of its bytes (at byte {offset})")]
    Incomplete { offset: usize, found: usize },
}

impl DecodeError {
    /// Returns the error with its position moved by `base` bytes: the error as seen from `base` bytes earlier.
    pub(crate) fn moved(mut self, base: usize) -> Self {
        match &mut self {
            Self::Garbage { offset, .. }
            | Self::NoName { offset }
            | Self::NoLength { offset }
            | Self::Length { offset, .. }
            | Self::Mark { offset, .. }
            | Self::NoEndMark { offset, .. }
            | Self::NotAscii { offset, .. }
            | Self::TooLong { offset, .. }
            | Self::Incomplete { offset, .. } => *offset = offset.wrapping_add(base),
        }
        self
    }
}

/// A whole message from the peer that cannot be used. The session continues with the next one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
#[allow(missing_docs, reason = "the error's message names the fields")]
pub enum MessageError {
    /// The table has no such message.
    #[error("there is no message named '{name}'")]
    UnknownName { name: Name },
    /// Fields are missing or left over.
    #[error("the message has {found} fields, not {expected}")]
    FieldCount { expected: usize, found: usize },
    /// A field, counted from 0, is not a whole number.
    #[error("field {field} is not a whole number")]
    NotANumber { field: usize },
    /// A field, counted from 0, is out of range: in most cases a coordinate.
    #[error("field {field} is {found}, not from {min} to {max}")]
    OutOfRange { field: usize, found: i32, min: i32, max: i32 },
    /// A field, counted from 0, differs from the constant of the dialect.
    #[error("field {field} is not the constant of the table")]
    NotTheConstant { field: usize },
    /// The header is not the dialect's. A header is not checked if the dialect has no header.
    #[error("the header differs from the table: value {value}")]
    Header { value: usize },
    /// A job's own fields are longer than those of any job.
    #[error("the job's own fields have {found} bytes, the maximum is {limit}")]
    JobTooLong { found: usize, limit: usize },
    /// A field of a job's own is missing or does not fit.
    #[error("{0}")]
    Field(FieldError),
    /// The message is about an order that is not active; 0: no order.
    #[error("order {found} is not active, order {active} is")]
    WrongOrder { active: u16, found: u16 },
    /// A job that is already in the queue or executed: dropped without harm.
    #[error("job {found} came again, job {expected} is the next")]
    Repeated { expected: u16, found: u16 },
    /// A job with others missing before it: it and the rest of the packet are discarded, and requested again.
    #[error("job {found} came out of order, job {expected} is the next")]
    OutOfOrder { expected: u16, found: u16 },
    /// The queue has no free slot for this job: it and the rest of the packet are discarded, and requested later.
    #[error("the queue is full, job {number} does not fit")]
    QueueFull { number: u16 },
    /// An order's end, though jobs before it are missing: they are requested again.
    #[error("the end of order {order} came before job {expected}")]
    JobsMissing { order: u16, expected: u16 },
    /// A message that the other end never sends, or not now.
    #[error("a message of the role {role:?} is not expected here")]
    NotExpected { role: Role },
}

/// A field of a job that is missing or does not fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[error("field '{field}' {fault}")]
pub struct FieldError {
    /// The name of the field in the job's type.
    pub field: Name,
    /// The fault of the field.
    pub fault: FieldFault,
}

/// A fault in a field of a job. The ranges include both ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
#[allow(missing_docs, reason = "the error's message names the fields")]
pub enum FieldFault {
    /// The message ends before the field.
    #[error("is missing")]
    Missing,
    /// The value is not a number, or has too many digits.
    #[error("is not a number from {min} to {max}")]
    NotANumber { min: Decimal, max: Decimal },
    /// The value is out of range.
    #[error("is {found}, not from {min} to {max}")]
    OutOfRange { found: Decimal, min: Decimal, max: Decimal },
    /// The value would be rounded.
    #[error("has more than {places} decimals")]
    TooPrecise { places: u8 },
    /// The value is in range, but has no meaning.
    #[error("is {found}, which has no meaning")]
    Value { found: i32 },
    /// The text is too long or too short.
    #[error("has {found} characters, not from {min} to {max}")]
    Length { found: usize, min: usize, max: usize },
    /// One of `<`, `>`, `$`, `#` in a text.
    #[error("holds '{}', which is a mark", *found as char)]
    Reserved { found: u8 },
    /// A character that the character set does not have.
    #[error("holds {found:?}, which is not in the character set")]
    Character { found: char },
}

/// A message that cannot be encoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
#[allow(missing_docs, reason = "the error's message names the fields")]
pub enum EncodeError {
    /// A message without a name.
    #[error("the message has no name")]
    NoName,
    /// One of `<`, `>`, `$`, `#` in a name or a field: nothing escapes them (thesis, section 10.1).
    #[error("'{}' is not allowed in a name or field", *found as char)]
    Forbidden { found: u8 },
    /// A character that the character set does not have.
    #[error("character {found:?} is not in the character set")]
    Character { found: char },
    /// A field of the job's own does not fit.
    #[error("{0}")]
    Field(FieldError),
    /// The message is longer than the longest packet: it cannot be sent in a later cycle either.
    #[error("the message has {length} bytes, the maximum of a packet is {limit}")]
    TooLong { length: usize, limit: usize },
    /// The buffer is too small.
    #[error("the message needs {needed} bytes, the buffer has {available}")]
    BufferTooSmall { needed: usize, available: usize },
}

/// An invalid configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
#[allow(missing_docs, reason = "the error's message names the fields")]
pub enum ConfigError {
    /// A role that every session needs is missing in the dialect's table, or a role is there twice.
    #[error("the table must have the role {role:?} once")]
    Role { role: Role },
    /// A message of the dialect's table lacks a field that every session needs.
    #[error("the message of the role {role:?} lacks the field {field:?}")]
    MissingField { role: Role, field: Field },
    /// A message of the dialect's table has a field twice, or one without a meaning in such a message.
    #[error("the message of the role {role:?} has a duplicate or invalid field")]
    Fields { role: Role },
    /// A message of the dialect's table has too many fields.
    #[error("the message of the role {role:?} has {found} fields, the maximum is 16")]
    TooManyFields { role: Role, found: usize },
    /// A constant of the dialect's table cannot be written.
    #[error("a constant in the message of the role {role:?} cannot be written: it holds {found:?}")]
    Constant { role: Role, found: char },
    /// A name of the dialect's table is empty, occurs twice, or holds a mark or a letter that its character set does not have.
    #[error("the name of the role {role:?} is empty, duplicate or unencodable")]
    Name { role: Role },
    /// A limit is too small to carry a message, or a string element has no byte.
    #[error("a packet of {packet} bytes in strings of {element} cannot carry the messages of the table")]
    Limits { element: usize, packet: usize },
    /// The queue numbers its jobs up to another number than the configuration names.
    #[error("the queue numbers jobs up to {queue}, the configuration up to {config}")]
    QueueNumbers { queue: u16, config: u16 },
    /// A queue holds 1 to 9999 jobs, and has more numbers than jobs.
    #[error("a queue of {capacity} jobs does not match job numbers up to {max}")]
    Queue { capacity: usize, max: u16 },
    /// The highest job number is from 2 to 9999.
    #[error("the highest job number is {found}, not from 2 to 9999")]
    MaxNumber { found: u16 },
    /// No value is in the range of a job's field: the least is above the greatest.
    #[error("the range of the job's field '{field}' is empty")]
    EmptyRange { field: Name },
    /// A job with the longest values is longer than a message allows.
    #[error("the job's own fields can have {found} bytes, the maximum is {limit}")]
    JobTooLong { found: usize, limit: usize },
    /// The type of the session can hold no message that is as long as the table's longest one with the longest values: see
    /// [`Robot::with_ranges`](crate::Robot::with_ranges).
    #[error("a message can have {longest} bytes, the session holds {held}")]
    LongMessages { longest: usize, held: usize },
    /// Jobs may overtake one another, and the queue has more jobs than can be distinguished then.
    #[error(
        "a queue of {capacity} jobs is too long where jobs may overtake one another, the maximum is {limit}"
    )]
    LongQueue { capacity: usize, limit: usize },
    /// The dialect lacks this role, and the configuration needs it.
    #[error("the table lacks the role {role:?}, which the configuration needs")]
    Lacks { role: Role },
    /// Over datagrams a message may come late: without this field its order is unknown.
    #[error("over datagrams the message of the role {role:?} needs the number of the order")]
    LateMessages { role: Role },
}

/// A call that is invalid in this state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
#[allow(missing_docs, reason = "the error's message names the fields")]
pub enum SessionError {
    /// There is an order already.
    #[error("order {active} is active")]
    OrderActive { active: u16 },
    /// There is no order for this call.
    #[error("no order is active")]
    NoOrder,
    /// An order's number is from 1.
    #[error("the order number must be 1 or more")]
    OrderZero,
    /// Impossible progress of an order: fewer jobs were sent than are executed, or more are in flight than job numbers can
    /// distinguish.
    #[error("an order cannot have {sent} jobs sent and {executed} executed")]
    NotInFlight { executed: u32, sent: u32 },
    /// The source has fewer jobs than were sent: it is not the list with which the order began.
    #[error(
        "the list of jobs ends before job {sent}, which was sent: give the list with which the order was begun"
    )]
    FewerJobs { sent: u32 },
    /// No job of this number is in the queue: it was never queued, or it is reported again.
    #[error("job {number} is not in the queue")]
    NotQueued { number: u16 },
    /// The dialect has no such command.
    #[error("the table has no command {id}")]
    UnknownCommand { id: u8 },
    /// The dialect has no message for this request.
    #[error("the table lacks the role {role:?}")]
    Lacks { role: Role },
    /// The event queue has no free entry for the outcomes of this call: poll the events.
    #[error("event queue full")]
    TooManyEvents,
    /// The command queue is full of commands that wait for their turn.
    #[error("the command queue is full with {waiting} commands")]
    TooManyCommands { waiting: usize },
}
