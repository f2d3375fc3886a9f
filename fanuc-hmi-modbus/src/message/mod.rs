//! What stands inside the envelope: requests and replies (MODBUS Application Protocol V1.1b3, section 6).

mod buffer;
mod data;
mod exception;
mod reply;
mod request;
#[cfg(feature = "serde")]
mod shape;

pub use buffer::PduBuf;
pub use data::{Bits, BitsMut, Words, WordsMut};
pub use exception::Exception;
pub use reply::Reply;
pub use request::Request;

use crate::error::{DecodeError, EncodeError};

/// The function codes that have a type of their own.
pub mod function {
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
}

/// The limits of the specification, in bits, registers and bytes.
pub mod limit {
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
    /// Bytes of a PDU.
    pub const PDU: usize = 253;
}

/// Something that stands inside a [`Frame`](crate::Frame): a [`Request`], a [`Reply`], a [`PduBuf`], or the raw bytes.
pub trait Pdu: sealed::Sealed {
    /// The bytes that [`encode`](Self::encode) writes, whether or not the specification allows them.
    fn encoded_len(&self) -> usize;

    /// Writes the PDU to the beginning of `out`, and says how many bytes it took.
    ///
    /// # Errors
    /// When the specification does not allow the message, or `out` is too small: then nothing of use is in `out`.
    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError>;
}

impl Pdu for &[u8] {
    fn encoded_len(&self) -> usize {
        self.len()
    }

    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        if !(1..=limit::PDU).contains(&self.len()) {
            return Err(EncodeError::PduLength { found: self.len() });
        }
        room(out, self.len())?.copy_from_slice(self);
        Ok(self.len())
    }
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for &[u8] {}
    impl Sealed for super::Request<'_> {}
    impl Sealed for super::Reply<'_> {}
    impl Sealed for super::PduBuf {}
}

/// The first `needed` bytes of `out`.
#[inline]
fn room(out: &mut [u8], needed: usize) -> Result<&mut [u8], EncodeError> {
    let available = out.len();
    out.get_mut(..needed).ok_or(EncodeError::Space { needed, available })
}

/// The first `N` bytes of `out`.
#[inline]
fn room_for<const N: usize>(out: &mut [u8]) -> Result<&mut [u8; N], EncodeError> {
    let available = out.len();
    out.first_chunk_mut().ok_or(EncodeError::Space { needed: N, available })
}

/// The bytes behind the function code, where exactly `N` must stand.
#[inline]
fn exactly<const N: usize>(function: u8, body: &[u8]) -> Result<&[u8; N], DecodeError> {
    let length = DecodeError::PduLength { function, expected: N + 1, found: body.len() + 1 };
    body.try_into().map_err(|_| length)
}

/// An address and a quantity, value or second half, as most functions have them.
#[inline]
fn pair(function: u8, body: &[u8]) -> Result<(u16, u16), DecodeError> {
    let [a, b, c, d] = *exactly(function, body)?;
    Ok((u16::from_be_bytes([a, b]), u16::from_be_bytes([c, d])))
}

/// Writes a function code and two words.
#[inline]
fn put_pair(out: &mut [u8], function: u8, first: u16, second: u16) -> Result<usize, EncodeError> {
    let ([a, b], [c, d]) = (first.to_be_bytes(), second.to_be_bytes());
    *room_for(out)? = [function, a, b, c, d];
    Ok(5)
}

#[inline]
fn put_mask(out: &mut [u8], address: u16, and: u16, or: u16) -> Result<usize, EncodeError> {
    let ([a, b], [c, d], [e, f]) = (address.to_be_bytes(), and.to_be_bytes(), or.to_be_bytes());
    *room_for(out)? = [function::MASK_WRITE_REGISTER, a, b, c, d, e, f];
    Ok(7)
}

#[inline]
fn mask(body: &[u8]) -> Result<(u16, u16, u16), DecodeError> {
    let [a, b, c, d, e, f] = *exactly(function::MASK_WRITE_REGISTER, body)?;
    Ok((u16::from_be_bytes([a, b]), u16::from_be_bytes([c, d]), u16::from_be_bytes([e, f])))
}

const COIL_ON: u16 = 0xFF00;

fn coil(found: u16) -> Result<bool, DecodeError> {
    match found {
        COIL_ON => Ok(true),
        0 => Ok(false),
        found => Err(DecodeError::CoilValue { found }),
    }
}

const fn coil_word(value: bool) -> u16 {
    if value { COIL_ON } else { 0 }
}

/// A run of `quantity` from `address` that the function allows, for the encoder.
#[inline]
fn check_run(function: u8, address: u16, quantity: usize, max: u16) -> Result<u16, EncodeError> {
    match u16::try_from(quantity) {
        Ok(run @ 1..) if run <= max && address <= u16::MAX - (run - 1) => Ok(run),
        _ => Err(no_run(function, address, quantity, max)),
    }
}

#[cold]
fn no_run(function: u8, address: u16, found: usize, max: u16) -> EncodeError {
    match u16::try_from(found) {
        Ok(quantity @ 1..) if quantity <= max => EncodeError::Address { address, quantity },
        _ => EncodeError::Quantity { function, found, max },
    }
}

/// Writes a function code that may travel as `Other`, and its bytes.
fn put_other(out: &mut [u8], function: u8, data: &[u8]) -> Result<usize, EncodeError> {
    if function == 0 || function >= function::EXCEPTION || function::is_typed(function) {
        return Err(EncodeError::Function { found: function });
    }
    let found = data.len() + 1;
    if found > limit::PDU {
        return Err(EncodeError::PduLength { found });
    }
    if let Some((first, rest)) = room(out, found)?.split_first_mut() {
        *first = function;
        rest.copy_from_slice(data);
    }
    Ok(found)
}
