//! The 24 transformation bytes of a standard message.

/// The twelve transformation words as they are on the wire, low byte first. The source does not describe them further.
/// Elsewhere in the protocol 16384 is 1.0 and a millimetre is 32, and VAL lists transformations by columns: the natural
/// reading is the columns n, o, a of a rotation and a position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(transparent))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Transform(pub [i16; 12]);

impl Transform {
    pub(crate) fn from_bytes(bytes: &[u8; 24]) -> Self {
        let mut words = [0; 12];
        let (pairs, _) = bytes.as_chunks::<2>();
        for (to, from) in words.iter_mut().zip(pairs) {
            *to = i16::from_le_bytes(*from);
        }
        Self(words)
    }

    pub(crate) fn to_bytes(self) -> [u8; 24] {
        let mut bytes = [0; 24];
        let (pairs, _) = bytes.as_chunks_mut::<2>();
        for (to, from) in pairs.iter_mut().zip(self.0) {
            *to = from.to_le_bytes();
        }
        bytes
    }
}
