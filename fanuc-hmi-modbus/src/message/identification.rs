//! Device identification: function 43 with MEI type 14 (section 6.21).

use core::fmt;

use super::function::{MEI, READ_DEVICE_IDENTIFICATION};
use super::limit;
use super::wire::room;
use crate::error::{DecodeError, EncodeError};

/// The bytes before the objects of a reply.
pub(crate) const HEAD: usize = 7;

/// Objects of a device's identification, as many as fit into a reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DeviceIdentification<'a> {
    /// The requested category: 1 basic, 2 regular, 3 extended, 4 a single object.
    pub category: u8,
    /// The categories of the device: 1 basic, 2 regular, 3 extended; and 128 if single objects can be read.
    pub conformity: u8,
    /// Whether further objects did not fit.
    pub more: bool,
    /// The id of the first object that did not fit, for the next request; otherwise 0.
    pub next: u8,
    /// The objects that fit into the reply.
    pub objects: DeviceObjects<'a>,
}

/// Objects of a device's identification: each an id and the bytes of a value, which are ASCII below id 128.
#[derive(Clone, Copy, PartialEq, Eq, Default)]
pub struct DeviceObjects<'a>(&'a [u8]);

impl<'a> DeviceObjects<'a> {
    /// Reads the objects in these bytes: each has its id, the length of its value, and the value. An incomplete last object
    /// is omitted.
    pub fn from_wire(bytes: &'a [u8]) -> Self {
        let length = Self(bytes).iter().map(|(_, value)| 2 + value.len()).sum();
        Self(bytes.get(..length).unwrap_or_default())
    }

    /// Returns the objects in sequence: id and value.
    pub fn iter(&self) -> impl Iterator<Item = (u8, &'a [u8])> + use<'a> {
        let mut rest = self.0;
        core::iter::from_fn(move || {
            let (&[id, length], after) = rest.split_first_chunk()?;
            let (value, after) = after.split_at_checked(length.into())?;
            rest = after;
            Some((id, value))
        })
    }

    /// Returns the value of the object with this id, if the list has it.
    pub fn get(&self, id: u8) -> Option<&'a [u8]> {
        self.iter().find_map(|(found, value)| (found == id).then_some(value))
    }

    fn count(&self) -> u8 {
        u8::try_from(self.iter().count()).unwrap_or(u8::MAX) // at most 123 are in a PDU
    }
}

impl fmt::Debug for DeviceObjects<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_map().entries(self.iter()).finish()
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for DeviceObjects<'_> {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{=[u8]:a}", self.0);
    }
}

impl<'a> DeviceIdentification<'a> {
    pub(super) fn decode(body: &'a [u8]) -> Result<Self, DecodeError> {
        let found = 1 + body.len();
        let length =
            |expected| DecodeError::PduLength { function: READ_DEVICE_IDENTIFICATION, expected, found };
        let (&[_, category, conformity, more, next, count], list) =
            body.split_first_chunk().ok_or(length(HEAD))?;
        let more = match more {
            0 => false,
            0xFF => true,
            found => return Err(DecodeError::MoreFollows { found }),
        };
        let mut rest = list;
        for _ in 0..count {
            let at = found - rest.len();
            let (&[_, size], after) = rest.split_first_chunk().ok_or(length(at + 2))?;
            rest = after.get(size.into()..).ok_or(length(at + 2 + usize::from(size)))?;
        }
        if !rest.is_empty() {
            return Err(length(found - rest.len()));
        }
        Ok(Self { category, conformity, more, next, objects: DeviceObjects(list) })
    }

    pub(super) const fn encoded_len(&self) -> usize {
        HEAD + self.objects.0.len()
    }

    pub(super) fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let found = self.encoded_len();
        if found > limit::PDU {
            return Err(EncodeError::PduLength { found });
        }
        let Self { category, conformity, more, next, objects } = *self;
        let more = if more { 0xFF } else { 0 };
        let (head, list) = room(out, found)?.split_at_mut(HEAD);
        let bytes = [READ_DEVICE_IDENTIFICATION, MEI, category, conformity, more, next, objects.count()];
        head.copy_from_slice(&bytes);
        list.copy_from_slice(objects.0);
        Ok(found)
    }
}
