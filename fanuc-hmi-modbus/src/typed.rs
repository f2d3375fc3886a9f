//! Values wider than one register: 32-bit integers and reals over two words, and the scale of an assignment.

/// Which of the two registers of a 32-bit value comes first. Within a register the high byte is always first on the wire.
///
/// The source does not say; public programs for FANUC controllers read the low word first ("CDAB").
/// A counter that is watched for a while tells which.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum WordOrder {
    /// The first register holds bits 0 to 15.
    #[default]
    LowFirst,
    /// The first register holds bits 16 to 31.
    HighFirst,
}

impl WordOrder {
    /// The 32 bits in two registers.
    #[inline]
    pub const fn join(self, words: [u16; 2]) -> u32 {
        let [first, second] = words;
        match self {
            Self::LowFirst => (second as u32) << 16 | first as u32,
            Self::HighFirst => (first as u32) << 16 | second as u32,
        }
    }

    /// The two registers that hold these 32 bits.
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "each half is taken by itself")]
    pub const fn split(self, bits: u32) -> [u16; 2] {
        let (high, low) = ((bits >> 16) as u16, bits as u16);
        match self {
            Self::LowFirst => [low, high],
            Self::HighFirst => [high, low],
        }
    }

    /// The signed integer in two registers.
    #[inline]
    pub const fn i32(self, words: [u16; 2]) -> i32 {
        self.join(words).cast_signed()
    }

    /// The real in two registers.
    #[inline]
    pub const fn f32(self, words: [u16; 2]) -> f32 {
        f32::from_bits(self.join(words))
    }
}
