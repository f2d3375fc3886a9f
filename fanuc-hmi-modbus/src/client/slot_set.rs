//! A set of a client's request slots.

/// A set of request slots, below 16. An action with two sets is wider than a register: packed into one it would be unpacked
/// again.
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct SlotSet(u32);

impl SlotSet {
    pub(super) fn insert(&mut self, slot: u8) {
        self.0 |= 1 << slot;
    }

    /// Returns the first slot that is not in the set; 16 if all are.
    pub(super) const fn first_outside(self) -> u8 {
        let [.., first] = self.0.trailing_ones().to_be_bytes();
        first
    }

    /// Returns the slots, in the order of their numbers.
    pub fn iter(self) -> impl Iterator<Item = u8> {
        (0..16).filter(move |slot| self.0 >> slot & 1 == 1)
    }
}

impl core::fmt::Debug for SlotSet {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}
