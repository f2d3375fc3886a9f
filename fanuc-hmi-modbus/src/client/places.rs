//! A set of a client's request slots.

/// A set of request slots, below 16. An action with two sets is wider than a register: packed into one it would be unpacked
/// again.
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Places(u32);

impl Places {
    pub(super) fn insert(&mut self, place: u8) {
        self.0 |= 1 << place;
    }

    /// Returns the first slot that is not in the set; 16 if all are.
    pub(super) const fn first_outside(self) -> u8 {
        let [.., first] = self.0.trailing_ones().to_be_bytes();
        first
    }

    /// Returns the slots, in the order of their numbers.
    pub fn iter(self) -> impl Iterator<Item = u8> {
        (0..16).filter(move |place| self.0 >> place & 1 == 1)
    }
}

impl core::fmt::Debug for Places {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}
