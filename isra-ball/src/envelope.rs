//! The envelope around the data of every packet.

use crate::error::DecodeError;

/// The byte that requests one packet, ASCII Enquire (§4.2).
pub const ENQ: u8 = 0x05;

/// Length byte, its complement, its XOR, and the checksum.
pub(crate) const OVERHEAD: usize = 4;
/// The data bytes of a packet whose layout the source gives.
pub(crate) const DATA_LEN: usize = 8;

const XOR: u8 = 0x55;

/// Checks that up to three bytes can begin a packet.
#[inline]
pub(crate) fn check_header(bytes: &[u8]) -> Result<(), DecodeError> {
    let Some(n) = bytes.first() else { return Ok(()) };
    for (offset, (&found, expected)) in bytes.iter().zip(header(*n)).enumerate() {
        if found != expected {
            return Err(DecodeError::Header { offset, expected, found });
        }
    }
    Ok(())
}

/// Returns the offset of the first whole header.
#[inline]
pub(crate) fn find_header(bytes: &[u8]) -> Option<usize> {
    let is_header = |head: &[u8]| matches!(head, [n, minus_n, xor_n] if [*n, *minus_n, *xor_n] == header(*n));
    bytes.windows(3).position(is_header)
}

#[inline]
pub(crate) const fn header(n: u8) -> [u8; 3] {
    [n, n.wrapping_neg(), n ^ XOR]
}

pub(crate) fn envelope(data: &[u8; DATA_LEN]) -> [u8; DATA_LEN + OVERHEAD] {
    const HEADER: [u8; 3] = header(8);
    let [n, minus_n, xor_n] = HEADER;
    let [id, fx, fy, fz, mx, my, mz, keys] = *data;
    [n, minus_n, xor_n, id, fx, fy, fz, mx, my, mz, keys, checksum(data)]
}

/// Returns the data of a packet whose envelope is valid.
#[inline]
pub(crate) fn open(packet: &[u8; DATA_LEN + OVERHEAD]) -> Option<&[u8]> {
    let [n, minus_n, xor_n, data @ .., found] = packet;
    ([*n, *minus_n, *xor_n] == header(8) && checksum(data) == *found).then_some(data)
}

/// Returns −(n + Σ data) modulo 256. The source's formula lacks the outer modulus (§4.2).
#[inline]
pub(crate) fn checksum(data: &[u8]) -> u8 {
    let n = data.len().to_le_bytes()[0];
    data.iter().fold(n, |sum, byte| sum.wrapping_add(*byte)).wrapping_neg()
}
