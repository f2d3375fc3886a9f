//! The registers of a chip.

/// A register of 8 or 32 bits.
#[derive(Clone, Copy)]
pub(crate) struct Register<T = u32>(*mut T);

impl<T: Copy> Register<T> {
    /// Returns the register at an address.
    ///
    /// # Safety
    /// There is one, and neither reading nor writing it touches memory.
    pub(crate) const unsafe fn at(address: usize) -> Self {
        Self(address as *mut T)
    }

    #[inline(always)]
    pub(crate) fn read(self) -> T {
        // SAFETY: as of `at`.
        unsafe { self.0.read_volatile() }
    }

    #[inline(always)]
    pub(crate) fn write(self, value: T) {
        // SAFETY: as of `at`.
        unsafe { self.0.write_volatile(value) }
    }
}

/// Names the registers of a peripheral, by its address and their offsets.
macro_rules! registers {
    ($base:literal: $($name:ident = $offset:literal),* $(,)?) => {
        $crate::register::registers!(u32, $base: $($name = $offset),*);
    };
    ($type:ty, $base:literal: $($name:ident = $offset:literal),* $(,)?) => {
        $(const $name: $crate::register::Register<$type> =
            // SAFETY: it is in the data sheet.
            unsafe { $crate::register::Register::at($base + $offset) };)*
    };
}

pub(crate) use registers;
