//! Parts that several functions share, read and written.

use super::function::{self, MEI};
use super::limit;
use crate::error::{DecodeError, EncodeError};

/// Returns the first `needed` bytes of `out`.
#[inline]
pub(super) fn room(out: &mut [u8], needed: usize) -> Result<&mut [u8], EncodeError> {
    let available = out.len();
    out.get_mut(..needed).ok_or(EncodeError::Space { needed, available })
}

/// Returns the first `N` bytes of `out`.
#[inline]
pub(super) fn room_for<const N: usize>(out: &mut [u8]) -> Result<&mut [u8; N], EncodeError> {
    let available = out.len();
    out.first_chunk_mut().ok_or(EncodeError::Space { needed: N, available })
}

/// Returns the bytes after the function code, exactly `N` of them.
#[inline]
pub(super) fn exactly<const N: usize>(function: u8, body: &[u8]) -> Result<&[u8; N], DecodeError> {
    let length = DecodeError::PduLength { function, expected: N + 1, found: body.len() + 1 };
    body.try_into().map_err(|_| length)
}

/// Decodes an address and a quantity, value or second half, as most functions have them.
#[inline]
pub(super) fn pair(function: u8, body: &[u8]) -> Result<(u16, u16), DecodeError> {
    let [a, b, c, d] = *exactly(function, body)?;
    Ok((u16::from_be_bytes([a, b]), u16::from_be_bytes([c, d])))
}

/// Decodes an address and a quantity within 1 to `max`.
#[inline(always)] // with `serve`
pub(crate) fn run(function: u8, body: &[u8], max: u16) -> Result<(u16, u16), DecodeError> {
    let (address, quantity) = pair(function, body)?;
    Ok((address, within(function, quantity, max)?))
}

pub(super) fn within(function: u8, quantity: u16, max: u16) -> Result<u16, DecodeError> {
    if (1..=max).contains(&quantity) {
        Ok(quantity)
    } else {
        Err(DecodeError::Quantity { function, found: quantity, max })
    }
}

/// Writes a function code and two words.
#[inline]
pub(super) fn put_pair(out: &mut [u8], function: u8, first: u16, second: u16) -> Result<usize, EncodeError> {
    let ([a, b], [c, d]) = (first.to_be_bytes(), second.to_be_bytes());
    *room_for(out)? = [function, a, b, c, d];
    Ok(5)
}

/// Checks that a function allows a run of `quantity` from `address`, for the encoder.
#[inline]
pub(super) fn check_run(function: u8, address: u16, quantity: usize, max: u16) -> Result<u16, EncodeError> {
    match u16::try_from(quantity) {
        Ok(run @ 1..) if run <= max && address <= u16::MAX - (run - 1) => Ok(run),
        _ => Err(no_run(function, address, quantity, max)),
    }
}

#[cold]
pub(super) fn no_run(function: u8, address: u16, found: usize, max: u16) -> EncodeError {
    match u16::try_from(found) {
        Ok(quantity @ 1..) if quantity <= max => EncodeError::Address { address, quantity },
        _ => EncodeError::Quantity { function, found, max },
    }
}

/// Writes a function code that may travel as `Other`, and its bytes.
pub(super) fn put_other(out: &mut [u8], function: u8, data: &[u8]) -> Result<usize, EncodeError> {
    let is_raw = match function {
        0 | function::EXCEPTION.. => false,
        function::READ_DEVICE_IDENTIFICATION => data.first() != Some(&MEI),
        function => !function::is_typed(function),
    };
    if !is_raw {
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
