//! Errors in bytes from the peer, in messages from the peer, and in calls of this crate.

use core::fmt;

use crate::number::Decimal;
use crate::role::{Field, Role};

/// Corruption in the bytes from the peer. The decoder goes on at the next `<`.
///
/// Every `offset` counts from the first byte that was ever pushed (or of the slice, where a slice is decoded).
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum DecodeError {
    /// Bytes between two messages.
    #[error("{length} bytes outside any message (at byte {offset})")]
    #[allow(missing_docs, reason = "see the error's message")]
    Garbage { offset: usize, length: usize },
    /// The name is empty.
    #[error("the message has no name (at byte {offset})")]
    #[allow(missing_docs, reason = "see the error's message")]
    NoName { offset: usize },
    /// The last field of the header is missing or is not a number: it is the length (thesis, section 10.1).
    #[error("the header does not end with a length (at byte {offset})")]
    #[allow(missing_docs, reason = "see the error's message")]
    NoLength { offset: usize },
    /// The length does not equal the bytes between the two `#` (thesis, sections 7.1 and 10.3).
    #[error("the header says {expected} bytes, the data part has {found} (at byte {offset})")]
    #[allow(missing_docs, reason = "see the error's message")]
    Length { offset: usize, expected: usize, found: usize },
    /// One of `<`, `>`, `#` where it cannot stand. A `<` begins the next message: this one was cut off.
    #[error("a '{}' inside the message (at byte {offset})", *found as char)]
    #[allow(missing_docs, reason = "see the error's message")]
    Mark { offset: usize, found: u8 },
    /// The data part is not followed by `>`.
    #[error("byte {found:#04x} instead of the end mark '>' (at byte {offset})")]
    #[allow(missing_docs, reason = "see the error's message")]
    NoEndMark { offset: usize, found: u8 },
    /// A byte above 127 where only ASCII is allowed.
    #[error("byte {found:#04x} is not ASCII (at byte {offset})")]
    #[allow(missing_docs, reason = "see the error's message")]
    NotAscii { offset: usize, found: u8 },
    /// The message is, or says that it is, longer than the longest packet, or than the decoder can hold.
    #[error("the message is longer than {limit} bytes (at byte {offset})")]
    #[allow(missing_docs, reason = "see the error's message")]
    TooLong { offset: usize, limit: usize },
    /// The input or the datagram ends inside a message.
    #[error("the input ends inside a message after {found} of its bytes (at byte {offset})")]
    #[allow(missing_docs, reason = "see the error's message")]
    Incomplete { offset: usize, found: usize },
}

impl DecodeError {
    /// The same error seen from `base` bytes earlier.
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

/// A whole message from the peer that cannot be used. The session goes on with the next one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum MessageError {
    /// The table has no such message.
    #[error("there is no message named '{name}'")]
    #[allow(missing_docs, reason = "see the error's message")]
    UnknownName { name: Name },
    /// Fields are missing or left over.
    #[error("the message has {found} fields, not {expected}")]
    #[allow(missing_docs, reason = "see the error's message")]
    FieldCount { expected: usize, found: usize },
    /// A field, counted from 0, is not a whole number.
    #[error("field {field} is not a whole number")]
    #[allow(missing_docs, reason = "see the error's message")]
    NotANumber { field: usize },
    /// A field, counted from 0, is out of range: a coordinate, for the most part.
    #[error("field {field} is {found}, not from {min} to {max}")]
    #[allow(missing_docs, reason = "see the error's message")]
    OutOfRange { field: usize, found: i32, min: i32, max: i32 },
    /// A field that is not the constant which the dialect has in its place, counted from 0.
    #[error("field {field} is not the constant of the table")]
    #[allow(missing_docs, reason = "see the error's message")]
    NotTheConstant { field: usize },
    /// The header, which is not looked at where the dialect has none, is not the dialect's.
    #[error("the header differs from the table: value {value}")]
    #[allow(missing_docs, reason = "see the error's message")]
    Header { value: usize },
    /// A job's own fields are longer than those of any job.
    #[error("the job's own fields have {found} bytes, the maximum is {limit}")]
    #[allow(missing_docs, reason = "see the error's message")]
    JobTooLong { found: usize, limit: usize },
    /// A field of a job's own is missing or does not fit.
    #[error("{0}")]
    Field(FieldError),
    /// The message is about an order that is not active; 0 is none.
    #[error("order {found} is not active, order {active} is")]
    #[allow(missing_docs, reason = "see the error's message")]
    WrongOrder { active: u16, found: u16 },
    /// A job that is in the queue or executed already: dropped without harm.
    #[error("job {found} came again, job {expected} is the next")]
    #[allow(missing_docs, reason = "see the error's message")]
    Repeated { expected: u16, found: u16 },
    /// A job that leaves others out: it and the rest of the packet are discarded, and asked for again.
    #[error("job {found} came out of order, job {expected} is the next")]
    #[allow(missing_docs, reason = "see the error's message")]
    OutOfOrder { expected: u16, found: u16 },
    /// The queue has no room for this job: it and the rest of the packet are discarded, and asked for later.
    #[error("the queue is full, job {number} does not fit")]
    #[allow(missing_docs, reason = "see the error's message")]
    QueueFull { number: u16 },
    /// An order's end, though jobs before it are missing: they are asked for again.
    #[error("the end of order {order} came before job {expected}")]
    #[allow(missing_docs, reason = "see the error's message")]
    JobsMissing { order: u16, expected: u16 },
    /// A message that the other end never sends, or not now.
    #[error("a message of the role {role:?} is not expected here")]
    #[allow(missing_docs, reason = "see the error's message")]
    NotExpected { role: Role },
}

/// A field of a job that is missing or does not fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[error("field '{field}' {fault}")]
pub struct FieldError {
    /// What the job's type calls it.
    pub field: Name,
    /// What is wrong.
    pub fault: FieldFault,
}

/// What is wrong with a field of a job. The ranges include both ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
#[allow(missing_docs, reason = "see the error's message")]
pub enum FieldFault {
    /// The message ends before it.
    #[error("is missing")]
    Missing,
    /// It is no number, or has more digits than any.
    #[error("is not a number from {min} to {max}")]
    NotANumber { min: Decimal, max: Decimal },
    /// It is out of range.
    #[error("is {found}, not from {min} to {max}")]
    OutOfRange { found: Decimal, min: Decimal, max: Decimal },
    /// It would have to be rounded.
    #[error("has more than {places} decimals")]
    TooPrecise { places: u8 },
    /// It is in range, and none of the values that there are.
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

/// The beginning of a name, as long as a name can be in AS: 15 characters (thesis, section 5.1).
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Name {
    text: [u8; 15],
    length: u8,
}

impl Name {
    /// The beginning of a name.
    pub fn of(name: &str) -> Self {
        Self::new(name.chars())
    }

    pub(crate) fn new(name: impl Iterator<Item = char>) -> Self {
        let mut text = [0; 15];
        let mut length = 0;
        for (place, c) in text.iter_mut().zip(name) {
            *place = u8::try_from(c).unwrap_or(b'?');
            length += 1;
        }
        Self { text, length }
    }

    fn chars(&self) -> impl Iterator<Item = char> {
        self.text.iter().take(usize::from(self.length)).map(|byte| char::from(*byte))
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Name {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::Display2Format(self).format(f);
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.chars().try_for_each(|c| fmt::Write::write_char(f, c))
    }
}

impl fmt::Debug for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "\"{self}\"")
    }
}

#[cfg(feature = "serde")]
impl serde::Serialize for Name {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// A message that cannot be encoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum EncodeError {
    /// A message without a name.
    #[error("the message has no name")]
    NoName,
    /// One of `<`, `>`, `$`, `#` in a name or a field: nothing escapes them (thesis, section 10.1).
    #[error("'{}' is not allowed in a name or field", *found as char)]
    #[allow(missing_docs, reason = "see the error's message")]
    Forbidden { found: u8 },
    /// A character that the character set does not have.
    #[error("character {found:?} is not in the character set")]
    #[allow(missing_docs, reason = "see the error's message")]
    Character { found: char },
    /// A field of the job's own does not fit.
    #[error("{0}")]
    Field(FieldError),
    /// The message is longer than the longest packet: no later cycle will take it.
    #[error("the message has {length} bytes, the maximum of a packet is {limit}")]
    #[allow(missing_docs, reason = "see the error's message")]
    TooLong { length: usize, limit: usize },
    /// The buffer is too small.
    #[error("the message needs {needed} bytes, the buffer has {available}")]
    #[allow(missing_docs, reason = "see the error's message")]
    BufferTooSmall { needed: usize, available: usize },
}

/// An invalid configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum ConfigError {
    /// A role that no session can do without is missing in the dialect's table, or a role is there twice.
    #[error("the table must have the role {role:?} once")]
    #[allow(missing_docs, reason = "see the error's message")]
    Role { role: Role },
    /// A message of the dialect's table lacks a field that no session can do without.
    #[error("the message of the role {role:?} lacks the field {field:?}")]
    #[allow(missing_docs, reason = "see the error's message")]
    MissingField { role: Role, field: Field<'static> },
    /// A message of the dialect's table has a field twice, or one that is nothing in such a message.
    #[error("the message of the role {role:?} has a duplicate or invalid field")]
    #[allow(missing_docs, reason = "see the error's message")]
    Fields { role: Role },
    /// A message of the dialect's table has too many fields.
    #[error("the message of the role {role:?} has {found} fields, the maximum is 16")]
    #[allow(missing_docs, reason = "see the error's message")]
    TooManyFields { role: Role, found: usize },
    /// A constant of the dialect's table cannot be written.
    #[error("a constant in the message of the role {role:?} cannot be written: it holds {found:?}")]
    #[allow(missing_docs, reason = "see the error's message")]
    Constant { role: Role, found: char },
    /// A name of the dialect's table is empty, occurs twice, or holds a mark or a letter that its character set does not have.
    #[error("the name of the role {role:?} is empty, duplicate or unencodable")]
    #[allow(missing_docs, reason = "see the error's message")]
    Name { role: Role },
    /// A limit is too small to carry a message, or a string element has no byte.
    #[error("a packet of {packet} bytes in strings of {element} cannot carry the messages of the table")]
    #[allow(missing_docs, reason = "see the error's message")]
    Limits { element: usize, packet: usize },
    /// The queue numbers its jobs up to another number than the configuration names.
    #[error("the queue numbers jobs up to {queue}, the configuration up to {config}")]
    #[allow(missing_docs, reason = "see the error's message")]
    QueueNumbers { queue: u16, config: u16 },
    /// A queue holds 1 to 9999 jobs, and has more numbers than jobs.
    #[error("a queue of {capacity} jobs does not match job numbers up to {max}")]
    #[allow(missing_docs, reason = "see the error's message")]
    Queue { capacity: usize, max: u16 },
    /// The highest job number is from 2 to 9999.
    #[error("the highest job number is {found}, not from 2 to 9999")]
    #[allow(missing_docs, reason = "see the error's message")]
    MaxNumber { found: u16 },
    /// No value is in the range of a job's field: the least is above the greatest.
    #[error("the range of the job's field '{field}' is empty")]
    #[allow(missing_docs, reason = "see the error's message")]
    EmptyRange { field: Name },
    /// A job with the longest values is longer than any can be.
    #[error("the job's own fields can have {found} bytes, the maximum is {limit}")]
    #[allow(missing_docs, reason = "see the error's message")]
    JobTooLong { found: usize, limit: usize },
    /// The type of the session can hold no message that is as long as the table's longest one with the longest values: see
    /// [`Robot::sized`](crate::Robot::sized).
    #[error("a message can have {longest} bytes, the session holds {held}")]
    #[allow(missing_docs, reason = "see the error's message")]
    LongMessages { longest: usize, held: usize },
    /// The type of the session cannot tell all job numbers apart, which it has to where jobs are acknowledged individually: see
    /// [`Robot::sized`](crate::Robot::sized).
    #[error("jobs are numbered up to {max}, the session only distinguishes numbers below {numbers}")]
    #[allow(missing_docs, reason = "see the error's message")]
    TooManyNumbers { max: u16, numbers: usize },
    /// The dialect lacks this role, and the configuration needs it.
    #[error("the table lacks the role {role:?}, which the configuration needs")]
    #[allow(missing_docs, reason = "see the error's message")]
    Lacks { role: Role },
    /// Over datagrams a message may come late: without this field its order is unknown.
    #[error("over datagrams the message of the role {role:?} needs the number of the order")]
    #[allow(missing_docs, reason = "see the error's message")]
    LateMessages { role: Role },
}

/// A call that is invalid in this state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum SessionError {
    /// There is an order already.
    #[error("order {active} is active")]
    #[allow(missing_docs, reason = "see the error's message")]
    OrderActive { active: u16 },
    /// There is no order that this could be about.
    #[error("no order is active")]
    NoOrder,
    /// An order's number is from 1.
    #[error("the order number must be 1 or more")]
    OrderZero,
    /// No order can be so far: fewer jobs were sent than are executed, or more are in flight than job numbers can tell apart.
    #[error("an order cannot have {sent} jobs sent and {executed} executed")]
    #[allow(missing_docs, reason = "see the error's message")]
    NotInFlight { executed: u32, sent: u32 },
    /// No job of this number is in the queue: it was never queued, or is reported again.
    #[error("job {number} is not in the queue")]
    #[allow(missing_docs, reason = "see the error's message")]
    NotQueued { number: u16 },
    /// The dialect has no such command.
    #[error("the table has no command {id}")]
    #[allow(missing_docs, reason = "see the error's message")]
    UnknownCommand { id: u8 },
    /// The dialect has no message to ask it with.
    #[error("the table lacks the role {role:?}")]
    #[allow(missing_docs, reason = "see the error's message")]
    Lacks { role: Role },
    /// Events wait, and there is no room for the outcome of what is to begin: poll them.
    #[error("event queue full")]
    TooManyEvents,
    /// Commands wait for their turn and no more find room.
    #[error("the command queue is full with {waiting} commands")]
    #[allow(missing_docs, reason = "see the error's message")]
    TooManyCommands { waiting: usize },
}
