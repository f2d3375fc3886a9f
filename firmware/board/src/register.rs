//! The registers of a chip, where no peripheral crate of it is kept.

/// A register of 32 bits.
#[derive(Clone, Copy)]
pub(crate) struct Register(u32);

impl Register {
    /// The register at an address.
    ///
    /// # Safety
    /// There is one, and neither reading nor writing it touches memory.
    pub(crate) const unsafe fn at(address: u32) -> Self {
        Self(address)
    }

    #[inline(always)]
    pub(crate) fn read(self) -> u32 {
        // SAFETY: as of `at`.
        unsafe { (self.0 as *const u32).read_volatile() }
    }

    #[inline(always)]
    pub(crate) fn write(self, value: u32) {
        // SAFETY: as of `at`.
        unsafe { (self.0 as *mut u32).write_volatile(value) }
    }

    #[inline(always)]
    pub(crate) fn modify(self, f: impl FnOnce(u32) -> u32) {
        self.write(f(self.read()));
    }
}

/// Names the registers of a peripheral, by its address and their offsets.
macro_rules! registers {
    ($base:literal: $($name:ident = $offset:literal),* $(,)?) => {
        $(const $name: $crate::register::Register =
            // SAFETY: it is in the data sheet.
            unsafe { $crate::register::Register::at($base + $offset) };)*
    };
}

pub(crate) use registers;
