//! The function codes that have a type of their own.

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
/// Write multiple coils.
pub const WRITE_COILS: u8 = 15;
/// Write multiple registers.
pub const WRITE_REGISTERS: u8 = 16;
/// Mask write register.
pub const MASK_WRITE_REGISTER: u8 = 22;
/// Read/write multiple registers.
pub const READ_WRITE_REGISTERS: u8 = 23;
/// Set in the function code of a reply that is an exception.
pub const EXCEPTION: u8 = 0x80;

/// True for the codes above; another one travels as `Other`.
pub const fn is_typed(code: u8) -> bool {
    matches!(code, 1..=6 | 15 | 16 | 22 | 23)
}
