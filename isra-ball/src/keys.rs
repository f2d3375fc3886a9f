/// The eight user keys: bit k − 1 is key k, 1 = down (§4.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(transparent))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Keys(
    /// The byte on the wire.
    pub u8,
);

impl Keys {
    /// All keys up.
    pub const NONE: Self = Self(0);

    /// Returns these keys with key 1..=8 down. Other numbers have no effect: the ball has no such key.
    #[must_use]
    pub const fn with(self, key: u8) -> Self {
        Self(self.0 | Self::bit(key))
    }

    /// Returns whether a key, 1..=8, is down.
    pub const fn is_down(self, key: u8) -> bool {
        self.0 & Self::bit(key) != 0
    }

    /// Returns the numbers, 1..=8, of the keys that are down.
    pub fn iter(self) -> impl Iterator<Item = u8> {
        (1..=8).filter(move |key| self.is_down(*key))
    }

    const fn bit(key: u8) -> u8 {
        match key {
            1..=8 => 1 << (key - 1),
            _ => 0,
        }
    }
}
