//! The functions that have a type of their own.

use super::limit;

/// Read coils.
pub const READ_COILS: u8 = 1;
/// Read discrete inputs.
pub const READ_DISCRETE_INPUTS: u8 = 2;
/// Read holding registers.
pub const READ_HOLDING_REGISTERS: u8 = 3;
/// Read input registers.
pub const READ_INPUT_REGISTERS: u8 = 4;
/// Write single coil.
pub const WRITE_COIL: u8 = 5;
/// Write single register.
pub const WRITE_REGISTER: u8 = 6;
/// Diagnostics of a serial line.
pub const DIAGNOSTICS: u8 = 8;
/// Write multiple coils.
pub const WRITE_COILS: u8 = 15;
/// Write multiple registers.
pub const WRITE_REGISTERS: u8 = 16;
/// Report server id.
pub const REPORT_SERVER_ID: u8 = 17;
/// Mask write register.
pub const MASK_WRITE_REGISTER: u8 = 22;
/// Read/write multiple registers.
pub const READ_WRITE_REGISTERS: u8 = 23;
/// Read device identification: that of the encapsulated interface transports whose MEI type is 14.
pub const READ_DEVICE_IDENTIFICATION: u8 = 43;
/// The MEI type of device identification.
pub(crate) const MEI: u8 = 14;
/// Set in the function code of a reply that is an exception.
pub const EXCEPTION: u8 = 0x80;

/// Returns whether the code is one of those above. Messages of other functions travel as `Other`, and those of function 43 with another
/// MEI type.
pub const fn is_typed(code: u8) -> bool {
    Row::of(code).is_typed
}

/// The length of a PDU, and the part of it that shows the length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Length {
    /// So many bytes.
    Fixed(u8),
    /// A byte count at this offset from the function code, then so many bytes.
    Counted(u8),
    /// Not shown by the PDU.
    Unknown,
}

/// The messages of a function.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    is_typed: bool,
    /// The length of the request.
    pub(crate) request: Length,
    /// The length of the reply, if that is not an exception.
    pub(crate) reply: Length,
    /// The most bits, registers or bytes that it reads; 0 if it reads none.
    pub(crate) reads: u16,
    /// The most bits, registers or words that it writes; 0 if it writes none.
    pub(crate) writes: u16,
    /// Whether it reads or writes bits, not registers.
    is_of_bits: bool,
}

impl Row {
    /// A function without a type of its own.
    const OTHER: Self = Self {
        is_typed: false,
        request: Length::Unknown,
        reply: Length::Unknown,
        reads: 0,
        writes: 0,
        is_of_bits: false,
    };

    /// Every function with a type of its own, one a line.
    #[inline(always)] // most callers look at one of the fields
    pub(crate) const fn of(code: u8) -> Self {
        use Length::{Counted, Fixed, Unknown};
        let (request, reply, reads, writes, is_of_bits) = match code {
            READ_COILS => (Fixed(5), Counted(1), limit::READ_BITS, 0, true),
            READ_DISCRETE_INPUTS => (Fixed(5), Counted(1), limit::READ_BITS, 0, true),
            READ_HOLDING_REGISTERS => (Fixed(5), Counted(1), limit::READ_REGISTERS, 0, false),
            READ_INPUT_REGISTERS => (Fixed(5), Counted(1), limit::READ_REGISTERS, 0, false),
            WRITE_COIL => (Fixed(5), Fixed(5), 0, 1, true),
            WRITE_REGISTER => (Fixed(5), Fixed(5), 0, 1, false),
            DIAGNOSTICS => (Unknown, Unknown, 0, limit::DIAGNOSTICS, false),
            WRITE_COILS => (Counted(5), Fixed(5), 0, limit::WRITE_BITS, true),
            WRITE_REGISTERS => (Counted(5), Fixed(5), 0, limit::WRITE_REGISTERS, false),
            REPORT_SERVER_ID => (Fixed(1), Counted(1), limit::SERVER_ID, 0, false),
            MASK_WRITE_REGISTER => (Fixed(7), Fixed(7), 0, 1, false),
            READ_WRITE_REGISTERS => {
                (Counted(9), Counted(1), limit::READ_REGISTERS, limit::READ_WRITE_REGISTERS, false)
            }
            READ_DEVICE_IDENTIFICATION => (Unknown, Unknown, 0, 0, false),
            _ => return Self::OTHER,
        };
        Self { is_typed: true, request, reply, reads, writes, is_of_bits }
    }

    /// Returns how many bytes this many bits or registers take.
    #[inline]
    pub(crate) const fn bytes(self, quantity: u16) -> u16 {
        if self.is_of_bits { quantity.div_ceil(8) } else { 2 * quantity }
    }
}
