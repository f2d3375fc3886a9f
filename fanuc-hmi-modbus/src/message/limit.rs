//! The limits of the specification, in bits, registers and bytes.

/// Coils or discrete inputs in one read.
pub const READ_BITS: u16 = 2000;
/// Registers in one read.
pub const READ_REGISTERS: u16 = 125;
/// Coils in one write.
pub const WRITE_BITS: u16 = 1968;
/// Registers in one write.
pub const WRITE_REGISTERS: u16 = 123;
/// Registers written by a read/write request.
pub const READ_WRITE_REGISTERS: u16 = 121;
/// Words of a diagnostic.
pub const DIAGNOSTICS: u16 = 125;
/// Bytes of a log of communication events.
pub const EVENT_LOG: u16 = 64;
/// Registers of a queue.
pub const FIFO: u16 = 31;
/// Bytes of all groups in a reply about files.
pub const READ_FILES: u16 = 245;
/// Bytes of all groups in a write of files.
pub const WRITE_FILES: u16 = 251;
/// Bytes of a device's description of itself (function 17).
pub const SERVER_ID: u16 = 250;
/// Bytes of an object of a device's identification.
pub const DEVICE_OBJECT: usize = 244;
/// Bytes of a PDU.
pub const PDU: usize = 253;
