//! Records of files: functions 20 and 21 (sections 6.14 and 6.15).

use core::fmt;

use super::data::Words;
use super::function::{READ_FILE_RECORD, REFERENCE, WRITE_FILE_RECORD};
use super::limit;
use super::wire::{room, within};
use crate::error::{DecodeError, EncodeError};

/// A run of registers in a file, to be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct FileRange {
    /// The file; the specification has 1 to 65535.
    pub file: u16,
    /// The first record, of one register each; the specification has 0 to 9999.
    pub record: u16,
    /// The number of registers to read.
    pub quantity: u16,
}

/// Registers of a file, to be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct FileRecord<'a> {
    /// The file; the specification has 1 to 65535.
    pub file: u16,
    /// The first record, of one register each; the specification has 0 to 9999.
    pub record: u16,
    /// The registers to write.
    pub values: Words<'a>,
}

/// The groups of a message about files: [`FileRange`] to read files, [`Words`] in the reply, [`FileRecord`] to write files.
#[derive(Clone, Copy)]
pub struct Records<'a, T>(RecordsIn<'a, T>);

#[derive(Clone, Copy)]
enum RecordsIn<'a, T> {
    Wire(&'a [u8]),
    Memory(&'a [T]),
}

/// A group of a message about files.
pub trait Group<'a>: Copy {
    /// The function code.
    const FUNCTION: u8;
    /// The maximum number of bytes of all groups in the message that has their registers.
    const MAX_LEN: usize;
    /// The number of bytes of a group in that message in addition to its registers.
    const AROUND: usize;

    /// Reads the first group, its reference type, and the bytes after it; or returns the number of its bytes, if there are
    /// fewer.
    fn take(bytes: &'a [u8]) -> Result<(Self, u8, &'a [u8]), usize>;

    /// Returns the number of registers of the group.
    fn quantity(&self) -> usize;

    /// Returns the number of bytes of the group in the message.
    fn byte_len(&self) -> usize {
        Self::AROUND + 2 * self.quantity()
    }

    /// Writes the group to this many bytes.
    fn put(&self, out: &mut [u8]);
}

/// Reads the file, the record and the quantity of a group, its reference type, and the bytes after them.
fn head(bytes: &[u8]) -> Result<(FileRange, u8, &[u8]), usize> {
    let (&[reference, f0, f1, r0, r1, q0, q1], rest) = bytes.split_first_chunk::<7>().ok_or(7usize)?;
    let [file, record, quantity] = [[f0, f1], [r0, r1], [q0, q1]].map(u16::from_be_bytes);
    Ok((FileRange { file, record, quantity }, reference, rest))
}

impl<'a> Group<'a> for FileRange {
    const FUNCTION: u8 = READ_FILE_RECORD;
    const MAX_LEN: usize = limit::READ_FILES as usize;
    const AROUND: usize = 2;

    fn take(bytes: &'a [u8]) -> Result<(Self, u8, &'a [u8]), usize> {
        head(bytes)
    }

    fn quantity(&self) -> usize {
        self.quantity.into()
    }

    fn byte_len(&self) -> usize {
        7
    }

    fn put(&self, out: &mut [u8]) {
        let [f, r, q] = [self.file, self.record, self.quantity].map(u16::to_be_bytes);
        if let Some(out) = out.first_chunk_mut() {
            *out = [REFERENCE, f[0], f[1], r[0], r[1], q[0], q[1]];
        }
    }
}

impl<'a> Group<'a> for FileRecord<'a> {
    const FUNCTION: u8 = WRITE_FILE_RECORD;
    const MAX_LEN: usize = limit::WRITE_FILES as usize;
    const AROUND: usize = 7;

    fn take(bytes: &'a [u8]) -> Result<(Self, u8, &'a [u8]), usize> {
        let (FileRange { file, record, quantity }, reference, rest) = head(bytes)?;
        let size = 2 * usize::from(quantity);
        let (values, rest) = rest.split_at_checked(size).ok_or(7 + size)?;
        Ok((Self { file, record, values: Words::from_wire(values) }, reference, rest))
    }

    fn quantity(&self) -> usize {
        self.values.len()
    }

    fn put(&self, out: &mut [u8]) {
        let quantity = u16::try_from(self.quantity()).unwrap_or(u16::MAX); // at most 122: checked
        if let Some((head, values)) = out.split_at_mut_checked(7) {
            FileRange { file: self.file, record: self.record, quantity }.put(head);
            self.values.write(values);
        }
    }
}

/// The registers of a group that was read.
impl<'a> Group<'a> for Words<'a> {
    const FUNCTION: u8 = READ_FILE_RECORD;
    const MAX_LEN: usize = FileRange::MAX_LEN;
    const AROUND: usize = FileRange::AROUND;

    fn take(bytes: &'a [u8]) -> Result<(Self, u8, &'a [u8]), usize> {
        let (&[size, reference], rest) = bytes.split_first_chunk().ok_or(2usize)?;
        let (words, rest) =
            rest.split_at_checked(usize::from(size).saturating_sub(1)).ok_or(1 + usize::from(size))?;
        Ok((Self::from_wire(words), reference, rest))
    }

    fn quantity(&self) -> usize {
        self.len()
    }

    fn put(&self, out: &mut [u8]) {
        if let Some((head, words)) = out.split_first_chunk_mut() {
            *head = [u8::try_from(1 + words.len()).unwrap_or(u8::MAX), REFERENCE]; // at most 243: checked
            self.write(words);
        }
    }
}

impl<'a, T: Group<'a>> Records<'a, T> {
    /// Returns the groups in these bytes; an incomplete last group is omitted.
    pub const fn from_wire(bytes: &'a [u8]) -> Self {
        Self(RecordsIn::Wire(bytes))
    }

    /// Returns the groups in sequence.
    pub fn iter(&self) -> impl Iterator<Item = T> + use<'a, T> {
        let (mut wire, mut memory) = match self.0 {
            RecordsIn::Wire(bytes) => (bytes, [].iter()),
            RecordsIn::Memory(groups) => (Default::default(), groups.iter()),
        };
        core::iter::from_fn(move || match T::take(wire) {
            Ok((group, _, rest)) => {
                wire = rest;
                Some(group)
            }
            Err(_) => memory.next().copied(),
        })
    }

    /// Decodes the groups after a byte count.
    pub(super) fn decode(body: &'a [u8]) -> Result<Self, DecodeError> {
        let (function, found) = (T::FUNCTION, 1 + body.len());
        let length = |expected| DecodeError::PduLength { function, expected, found };
        let (&count, data) = body.split_first().ok_or(length(2))?;
        if data.len() != usize::from(count) {
            return Err(length(2 + usize::from(count)));
        }
        let (mut rest, mut left) = (data, T::MAX_LEN);
        loop {
            let (group, reference, after) =
                T::take(rest).map_err(|needed| length(found - rest.len() + needed))?;
            let size = rest.len() - after.len();
            if reference != REFERENCE {
                return Err(DecodeError::ReferenceType { function, found: reference });
            }
            if size != group.byte_len() {
                let found = u8::try_from(size - 1).unwrap_or(u8::MAX);
                return Err(DecodeError::ReplyByteCount { function, found });
            }
            within(function, u16::try_from(group.quantity()).unwrap_or(u16::MAX), most::<T>(left))?;
            (rest, left) = (after, left - T::AROUND - 2 * group.quantity());
            if rest.is_empty() {
                return Ok(Self(RecordsIn::Wire(data)));
            }
        }
    }

    pub(crate) fn encoded_len(&self) -> usize {
        2 + self.iter().map(|group| group.byte_len()).sum::<usize>()
    }

    pub(crate) fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let (function, mut left) = (T::FUNCTION, T::MAX_LEN);
        let quantity = |found, max| EncodeError::Quantity { function, found, max };
        let mut groups = self.iter().map(|group| group.quantity()).peekable();
        if groups.peek().is_none() {
            return Err(quantity(0, most::<T>(left)));
        }
        for found in groups {
            let max = most::<T>(left);
            if !(1..=max.into()).contains(&found) {
                return Err(quantity(found, max));
            }
            left -= T::AROUND + 2 * found;
        }
        let found = self.encoded_len();
        if found > limit::PDU {
            return Err(EncodeError::PduLength { found });
        }
        let (head, mut rest) = room(out, found)?.split_at_mut(2);
        head.copy_from_slice(&[function, u8::try_from(rest.len()).unwrap_or(u8::MAX)]); // at most 251: checked
        for group in self.iter() {
            let (to, after) = rest.split_at_mut_checked(group.byte_len()).unwrap_or_default();
            group.put(to);
            rest = after;
        }
        Ok(found)
    }
}

/// Returns the maximum number of registers of a group, if this many bytes are left for it.
fn most<'a, T: Group<'a>>(left: usize) -> u16 {
    u16::try_from(left.saturating_sub(T::AROUND) / 2).unwrap_or(u16::MAX)
}

impl<'a, T> From<&'a [T]> for Records<'a, T> {
    fn from(groups: &'a [T]) -> Self {
        Self(RecordsIn::Memory(groups))
    }
}

impl<'a, T, const N: usize> From<&'a [T; N]> for Records<'a, T> {
    fn from(groups: &'a [T; N]) -> Self {
        Self(RecordsIn::Memory(groups))
    }
}

impl<'a, T: Group<'a> + PartialEq> PartialEq for Records<'a, T> {
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}

impl<'a, T: Group<'a> + Eq> Eq for Records<'a, T> {}

impl<'a, T: Group<'a> + fmt::Debug> fmt::Debug for Records<'a, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

#[cfg(feature = "defmt")]
impl<'a, T: Group<'a> + defmt::Format> defmt::Format for Records<'a, T> {
    fn format(&self, f: defmt::Formatter<'_>) {
        super::data::format_list(f, self.iter());
    }
}
