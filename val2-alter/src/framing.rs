//! The bytes of the envelope, and the details of it that the source leaves open (§3.2).

/// Data link escape: begins both marks, and is doubled inside the data.
pub const DLE: u8 = 0x10;
/// Start of text: the start mark is DLE DLE STX.
pub const STX: u8 = 0x02;
/// End of text: the end mark is DLE ETX.
pub const ETX: u8 = 0x03;

/// The details of the envelope that the source leaves open. The default is the text of the source, read literally.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Framing {
    /// The DLEs before STX: the number to write, and the least number that is read as a start mark. The text has two; the
    /// source's own tables of lengths fit one as well.
    pub leading_dle: LeadingDle,
    /// The checksum is the two's complement of the sum, instead of the sum. The text has only "simple checksum".
    pub negated_sum: bool,
    /// A checksum of 10h is doubled like a DLE of the data. The text doubles inside the data, and the checksum is outside.
    pub stuffed_checksum: bool,
    /// Reads a reply that sets bits 6 and 7 of its select byte as if they were clear, instead of refusing it.
    pub ignore_spare_select: bool,
}

impl Framing {
    /// Two DLEs in front, the plain sum, not doubled, spare select bits refused.
    pub const DEFAULT: Self = Self {
        leading_dle: LeadingDle::Two,
        negated_sum: false,
        stuffed_checksum: false,
        ignore_spare_select: false,
    };

    pub(crate) fn checksum(self, sum: u8) -> u8 {
        if self.negated_sum { sum.wrapping_neg() } else { sum }
    }

    pub(crate) const fn checksum_len(self, checksum: u8) -> usize {
        if self.stuffed_checksum && checksum == DLE { 2 } else { 1 }
    }
}

impl Default for Framing {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// The number of DLEs in a start mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "u8", into = "u8"))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum LeadingDle {
    /// One DLE before the STX: `10 02`.
    One,
    /// Two DLEs before the STX: `10 10 02`.
    Two,
}

impl LeadingDle {
    /// Returns the number.
    pub const fn count(self) -> usize {
        match self {
            Self::One => 1,
            Self::Two => 2,
        }
    }
}

impl From<LeadingDle> for u8 {
    fn from(leading: LeadingDle) -> u8 {
        match leading {
            LeadingDle::One => 1,
            LeadingDle::Two => 2,
        }
    }
}

impl TryFrom<u8> for LeadingDle {
    type Error = LeadingDleError;

    fn try_from(count: u8) -> Result<Self, LeadingDleError> {
        match count {
            1 => Ok(Self::One),
            2 => Ok(Self::Two),
            found => Err(LeadingDleError { found }),
        }
    }
}

/// A count that [`LeadingDle`] does not have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[error("a start mark has one or two leading DLEs, not {found}")]
#[non_exhaustive]
pub struct LeadingDleError {
    /// The number of DLEs that was given.
    pub found: u8,
}
