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
/// Read exception status, of a serial line.
pub const READ_EXCEPTION_STATUS: u8 = 7;
/// Diagnostics of a serial line.
pub const DIAGNOSTICS: u8 = 8;
/// Get communication event counter, of a serial line.
pub const GET_COMM_EVENT_COUNTER: u8 = 11;
/// Get communication event log, of a serial line.
pub const GET_COMM_EVENT_LOG: u8 = 12;
/// Write multiple coils.
pub const WRITE_COILS: u8 = 15;
/// Write multiple registers.
pub const WRITE_REGISTERS: u8 = 16;
/// Report server id.
pub const REPORT_SERVER_ID: u8 = 17;
/// Read file record.
pub const READ_FILE_RECORD: u8 = 20;
/// Write file record.
pub const WRITE_FILE_RECORD: u8 = 21;
/// Mask write register.
pub const MASK_WRITE_REGISTER: u8 = 22;
/// Read/write multiple registers.
pub const READ_WRITE_REGISTERS: u8 = 23;
/// Read FIFO queue.
pub const READ_FIFO_QUEUE: u8 = 24;
/// Read device identification: that of the encapsulated interface transports whose MEI type is 14.
pub const READ_DEVICE_IDENTIFICATION: u8 = 43;
/// The MEI type of device identification.
pub(crate) const MEI: u8 = 14;
/// The reference type of every group in a message about files.
pub(crate) const REFERENCE: u8 = 6;
/// Set in the function code of a reply that is an exception.
pub const EXCEPTION: u8 = 0x80;

/// Returns whether the code is one of those above. Messages of other functions travel as `Other`, and those of function 43
/// with another MEI type.
pub const fn is_typed(code: u8) -> bool {
    Row::of(code).is_typed
}

/// The length of a PDU, and the part of it that shows the length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Length {
    /// This number of bytes.
    Fixed(u8),
    /// A byte count at this offset from the function code, then as many bytes. The byte count of function 24 has two bytes,
    /// the first of which is 0.
    Counted(u8),
    /// A length that the PDU does not show.
    Unknown,
}

/// The unit of the values that a function reads or writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Unit {
    Bit,
    Byte,
    Word,
}

/// The messages of a function.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    is_typed: bool,
    /// The length of the request.
    pub(crate) request: Length,
    /// The length of the reply, if that is not an exception.
    pub(crate) reply: Length,
    /// The maximum number of bits, bytes or registers that the function reads; 0 if it does not read.
    pub(crate) reads: u16,
    /// The maximum number of bits, bytes or registers that the function writes; 0 if it does not write.
    pub(crate) writes: u16,
    unit: Unit,
}

impl Row {
    /// A function without a type of its own.
    const OTHER: Self = Self {
        is_typed: false,
        request: Length::Unknown,
        reply: Length::Unknown,
        reads: 0,
        writes: 0,
        unit: Unit::Byte,
    };

    /// Returns the row of every function with a type of its own, one per line.
    #[inline(always)] // most callers look at one of the fields
    pub(crate) const fn of(code: u8) -> Self {
        use Length::{Counted, Fixed, Unknown};
        use Unit::{Bit, Byte, Word};
        let (request, reply, reads, writes, unit) = match code {
            READ_COILS => (Fixed(5), Counted(1), limit::READ_BITS, 0, Bit),
            READ_DISCRETE_INPUTS => (Fixed(5), Counted(1), limit::READ_BITS, 0, Bit),
            READ_HOLDING_REGISTERS => (Fixed(5), Counted(1), limit::READ_REGISTERS, 0, Word),
            READ_INPUT_REGISTERS => (Fixed(5), Counted(1), limit::READ_REGISTERS, 0, Word),
            WRITE_COIL => (Fixed(5), Fixed(5), 0, 1, Bit),
            WRITE_REGISTER => (Fixed(5), Fixed(5), 0, 1, Word),
            READ_EXCEPTION_STATUS => (Fixed(1), Fixed(2), 1, 0, Byte),
            DIAGNOSTICS => (Unknown, Unknown, 0, limit::DIAGNOSTICS, Word),
            GET_COMM_EVENT_COUNTER => (Fixed(1), Fixed(5), 2, 0, Word),
            GET_COMM_EVENT_LOG => (Fixed(1), Counted(1), 6 + limit::EVENT_LOG, 0, Byte),
            WRITE_COILS => (Counted(5), Fixed(5), 0, limit::WRITE_BITS, Bit),
            WRITE_REGISTERS => (Counted(5), Fixed(5), 0, limit::WRITE_REGISTERS, Word),
            REPORT_SERVER_ID => (Fixed(1), Counted(1), limit::SERVER_ID, 0, Byte),
            READ_FILE_RECORD => (Counted(1), Counted(1), limit::READ_FILES, 0, Byte),
            WRITE_FILE_RECORD => (Counted(1), Counted(1), 0, limit::WRITE_FILES, Byte),
            MASK_WRITE_REGISTER => (Fixed(7), Fixed(7), 0, 1, Word),
            READ_WRITE_REGISTERS => {
                (Counted(9), Counted(1), limit::READ_REGISTERS, limit::READ_WRITE_REGISTERS, Word)
            }
            READ_FIFO_QUEUE => (Fixed(3), Counted(2), limit::FIFO, 0, Word),
            READ_DEVICE_IDENTIFICATION => (Unknown, Unknown, 0, 0, Byte),
            _ => return Self::OTHER,
        };
        Self { is_typed: true, request, reply, reads, writes, unit }
    }

    /// Returns the number of bytes of this many bits, bytes or registers.
    #[inline]
    pub(crate) const fn bytes(self, quantity: u16) -> u16 {
        match self.unit {
            Unit::Bit => quantity.div_ceil(8),
            Unit::Byte => quantity,
            Unit::Word => 2 * quantity,
        }
    }
}
