//! What every job of a table begins with.

use crate::role::Field;
use crate::value::{SEPARATOR, START, is_mark};

/// `<name$00` of a table whose jobs have no header and no fields but order, number and their own: made once, then copied. The zeros
/// are where most jobs have their length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Head {
    bytes: [u8; Self::MAX],
    length: u8,
}

impl Head {
    pub(super) const MAX: usize = 16;

    /// `None` where the name is too long or no plain ASCII, and where there are other fields: such a job is written field by field.
    pub(crate) const fn new(name: &str, header: &[Field<'_>], fields: &[Field<'_>]) -> Option<Self> {
        if !header.is_empty() || !matches!(fields, [Field::Order, Field::Number, Field::Work]) {
            return None;
        }
        let mut bytes = [0; Self::MAX];
        let (mut name, mut length) = (name.as_bytes(), 4);
        let [start, rest @ ..] = &mut bytes;
        *start = START;
        let mut rest: &mut [u8] = rest;
        while let [byte, others @ ..] = name {
            let [place, places @ ..] = rest else { return None };
            if is_mark(*byte) || !byte.is_ascii() {
                return None;
            }
            *place = *byte;
            (name, rest) = (others, places);
            length += 1;
        }
        let [separator, tens, ones, ..] = rest else { return None };
        (*separator, *tens, *ones) = (SEPARATOR, b'0', b'0');
        Some(Self { bytes, length })
    }

    pub(super) const fn bytes(&self) -> &[u8; Self::MAX] {
        &self.bytes
    }

    /// At most 16: the remainder only shows its bound.
    #[inline(always)]
    pub(super) const fn len(&self) -> usize {
        (self.length % 32) as usize
    }
}
