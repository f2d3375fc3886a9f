//! Many messages in one packet, within both limits of the controller.

use crate::dialect::Dialect;
use crate::error::{ConfigError, EncodeError};
use crate::job::{Job, Work};
use crate::message::Message;
use crate::number;
use crate::params::Params;
use crate::role::{Field, Role};

/// The two limits of a packet. They are separate: a packet is an array of strings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Limits {
    /// The most bytes of one string in an AS program: 255 (thesis, section 7.4).
    pub element: usize,
    /// The most bytes of a packet: 4096 over TCP, 1472 over UDP (thesis, section 9.5).
    pub packet: usize,
}

impl Limits {
    /// Over TCP: 17 strings.
    pub const TCP: Self = Self { element: 255, packet: 4096 };
    /// Over UDP: 6 strings.
    pub const UDP: Self = Self { element: 255, packet: 1472 };
}

impl Limits {
    /// Checks that every message of a table can be written and fits a packet, and a session that can hold this many bytes of
    /// one message, for any values of its numbers; a job's own fields have at most this many bytes, with a separator for
    /// each.
    pub(crate) fn check(&self, dialect: &Dialect, work: usize, held: usize) -> Result<(), ConfigError> {
        let charset = dialect.charset();
        let mut longest = 0;
        for entry in dialect.entries() {
            let role = entry.role;
            if entry.name.chars().any(|c| charset.byte(c).is_err()) {
                return Err(ConfigError::Name { role });
            }
            // The maximum number of bytes of fields, with a separator for each.
            let part = |fields: &[Field]| {
                let mut length = 0;
                for field in fields {
                    length += match field {
                        Field::Work => work,
                        Field::Constant(text) => {
                            if let Some(found) = text.chars().find(|c| charset.byte(*c).is_err()) {
                                return Err(ConfigError::Constant { role, found });
                            }
                            text.chars().count() + 1
                        }
                        Field::Unused => "$".len(),
                        _ => "-2147483648$".len(),
                    };
                }
                Ok(length)
            };
            let header = part(entry.header)?;
            let data = part(entry.fields)?.saturating_sub(1);
            let digits = number::len(i32::try_from(data).unwrap_or(i32::MAX), 0);
            longest = longest.max("<$##>".len() + entry.name.chars().count() + header + digits + data);
        }
        if self.element == 0 || self.packet > Message::MAX_LEN || longest > self.packet {
            return Err(ConfigError::Limits { element: self.element, packet: self.packet });
        }
        if longest > held {
            return Err(ConfigError::LongMessages { longest, held });
        }
        Ok(())
    }
}

impl Default for Limits {
    fn default() -> Self {
        Self::TCP
    }
}

/// Whether a message fitted into the packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[must_use = "a message without room has to wait for the next cycle"]
pub enum AddResult {
    /// The message is in the packet.
    Added,
    /// The packet is full: try again in the next cycle (the source's `-100`).
    Full,
}

/// Builds a packet in a buffer of the caller.
///
/// The messages are one after the other, and the strings of the AS program are views of the bytes: each but the last is full,
/// none is empty, and a message continues in the next string.
///
/// The total is checked for every message. The source's own program checks it only when a string overflows, so that its
/// packets can reach 4334 of 4096 bytes (thesis, figure 3).
///
/// ```
/// use kawasaki_msg::{Dialect, Limits, Packet, Params, Role, AddResult};
///
/// let mut buffer = [0; 4096];
/// let mut packet = Packet::new(&mut buffer, Limits::TCP, Dialect::DEFAULT);
/// while packet.push(Role::Filler, &Params::default())? == AddResult::Added {}
/// assert_eq!(packet.as_bytes().len(), 341 * "<Huuhaa$0##>".len());
/// assert_eq!(packet.elements().map(<[u8]>::len).max(), Some(255));
/// # Ok::<(), kawasaki_msg::EncodeError>(())
/// ```
#[derive(Debug)]
pub struct Packet<'a> {
    buffer: &'a mut [u8],
    length: usize,
    limits: Limits,
    dialect: Dialect,
}

impl<'a> Packet<'a> {
    /// Creates an empty packet of messages of this table. A buffer shorter than `limits.packet` lowers the limit.
    pub fn new(buffer: &'a mut [u8], limits: Limits, dialect: Dialect) -> Self {
        let limit = limits.packet.min(buffer.len());
        Self { buffer: buffer.get_mut(..limit).unwrap_or_default(), length: 0, limits, dialect }
    }

    /// Appends a message if there is space for all of it; a role that the table lacks adds nothing.
    ///
    /// # Errors
    /// If no packet could ever hold the message; the packet is as it was.
    pub fn push(&mut self, role: Role, params: &Params) -> Result<AddResult, EncodeError> {
        if self.dialect.entry(role).is_none() {
            return Ok(AddResult::Added);
        }
        let free = self.buffer.get_mut(self.length..).unwrap_or_default();
        let written = self.dialect.write(role, params, free);
        self.append(written)
    }

    /// Appends a job if there is space for all of it.
    ///
    /// # Errors
    /// As [`push`](Self::push), and when a field of the job does not fit.
    #[inline]
    pub fn push_job<W: Work>(&mut self, job: &Job<W>, ranges: &W::Ranges) -> Result<AddResult, EncodeError> {
        let free = self.buffer.get_mut(self.length..).unwrap_or_default();
        let written = self.dialect.write_job(job, ranges, free);
        self.append(written)
    }

    /// Adds the bytes that were written into the free part.
    #[inline]
    fn append(&mut self, written: Result<usize, EncodeError>) -> Result<AddResult, EncodeError> {
        let limit = self.buffer.len();
        match written {
            Ok(length) => {
                self.length += length;
                Ok(AddResult::Added)
            }
            Err(EncodeError::BufferTooSmall { needed, .. }) if needed <= limit => Ok(AddResult::Full),
            Err(EncodeError::BufferTooSmall { needed, .. } | EncodeError::TooLong { length: needed, .. }) => {
                Err(EncodeError::TooLong { length: needed, limit })
            }
            Err(error) => Err(error),
        }
    }

    /// Returns the bytes of the packet so far.
    pub fn as_bytes(&self) -> &[u8] {
        self.buffer.get(..self.length).unwrap_or_default()
    }

    /// Returns the strings that an AS program would send: at most [`Limits::element`] bytes each, without empty strings.
    pub fn elements(&self) -> impl Iterator<Item = &[u8]> {
        self.as_bytes().chunks(self.limits.element.max(1))
    }

    /// Returns whether no message was added.
    pub fn is_empty(&self) -> bool {
        self.length == 0
    }
}
