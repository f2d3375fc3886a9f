//! The details that the source leaves open, as settings with documented defaults.

/// The format of an installation's frames.
///
/// The source prints the frame's marks and two of the four tags; everything else here is open. Each default is the project's
/// reading, for the reason in its field's documentation. Both ends must agree: a capture from a real controller would settle
/// all of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Profile {
    /// The frame's end mark. Printed as `90 82`, the same as the last two bytes of the head.
    pub tail: Tail,
    /// The position of the frame flag F0h (帧标志). F0h is also the tag of floats, so it may be one and the same byte.
    pub flag: Flag,
    /// The tags in front of the values. F0h (float) and F3h (char) are printed; F1h and F2h follow from the sizes.
    pub tags: Tags,
    /// The width of the checksum, "校验字": a check *word*. One byte is the habit of comparable serial protocols.
    pub checksum: Width,
    /// The checksum is the two's complement of the sum, so that sum and checksum add up to 0. Default: the sum itself.
    pub checksum_negated: bool,
    /// The sum counts the frame flag too. Default: the values alone. Without a separate flag it has no effect.
    pub checksum_with_flag: bool,
    /// The order of the bytes of a value. Little-endian as on the 486 controller and its Windows host.
    pub byte_order: ByteOrder,
}

/// The frame's end mark: 90h and one more byte.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum Tail {
    /// `90 82`, as printed.
    #[default]
    Printed,
    /// `90 83`: with bit 7 cleared the head's `90 82` is DLE STX, whose natural counterpart is DLE ETX.
    Etx,
    /// Writes `90 82`, accepts `90 83` as well: for listening to an unknown controller.
    Either,
}

impl Tail {
    /// Returns the byte after 90h that is written.
    pub(crate) fn byte(self) -> u8 {
        match self {
            Tail::Printed | Tail::Either => 0x82,
            Tail::Etx => 0x83,
        }
    }

    /// Returns whether 90h and this byte end a frame.
    pub(crate) fn ends_with(self, byte: u8) -> bool {
        byte == self.byte() || (self == Tail::Either && byte == 0x83)
    }
}

/// The position of the frame flag F0h.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum Flag {
    /// A byte of its own between head and values: `EB 90 82 F0 F0 06 …`.
    #[default]
    Separate,
    /// The first tag is the flag: `EB 90 82 F0 06 …`, and the head is followed by a tag at once.
    FirstTag,
}

/// The tags in front of the four types of values: always four different bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(try_from = "TagBytes", into = "TagBytes")
)]
pub struct Tags {
    pub(crate) f32: u8,
    pub(crate) i16: u8,
    pub(crate) u8: u8,
    pub(crate) char: u8,
}

impl Tags {
    /// Creates a map of tags; `None` unless all four differ.
    pub const fn new(f32: u8, i16: u8, u8: u8, char: u8) -> Option<Self> {
        let same = f32 == i16 || f32 == u8 || f32 == char || i16 == u8 || i16 == char || u8 == char;
        if same { None } else { Some(Self { f32, i16, u8, char }) }
    }
}

impl Default for Tags {
    fn default() -> Self {
        Self { f32: 0xF0, i16: 0xF1, u8: 0xF2, char: 0xF3 }
    }
}

/// The width of the checksum, and its byte order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum Width {
    /// One byte: the sum modulo 256.
    #[default]
    U8,
    /// Two bytes, low byte first: the sum modulo 65536.
    U16Le,
    /// Two bytes, high byte first.
    U16Be,
}

impl Width {
    /// Returns the length of a checksum of this width, in bytes.
    pub const fn len(self) -> usize {
        match self {
            Width::U8 => 1,
            Width::U16Le | Width::U16Be => 2,
        }
    }

    /// Returns false: a checksum has at least one byte.
    pub const fn is_empty(self) -> bool {
        false
    }
}

/// The order of the bytes of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum ByteOrder {
    /// The low byte of a value comes first.
    #[default]
    Little,
    /// The high byte of a value comes first.
    Big,
}

#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct TagBytes {
    f32: u8,
    i16: u8,
    u8: u8,
    char: u8,
}

#[cfg(feature = "serde")]
impl TryFrom<TagBytes> for Tags {
    type Error = &'static str;

    fn try_from(t: TagBytes) -> Result<Self, Self::Error> {
        Self::new(t.f32, t.i16, t.u8, t.char).ok_or("two value types have the same tag")
    }
}

#[cfg(feature = "serde")]
impl From<Tags> for TagBytes {
    fn from(t: Tags) -> Self {
        Self { f32: t.f32, i16: t.i16, u8: t.u8, char: t.char }
    }
}
