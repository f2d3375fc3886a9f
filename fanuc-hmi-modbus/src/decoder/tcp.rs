//! The beginnings and ends of TCP frames.

use crate::error::DecodeError;
use crate::frame::{Frame, RtuLen, Side};
use crate::message::{Exception, function};
use crate::stream::Stream;

/// The number of bytes of a header that are checked.
pub(super) const MBAP: usize = 6;

/// The number of bytes that a header and the length of the message after it take, minus one.
pub(super) const HEADER: usize = MBAP + 10;

/// The number of bytes of the shortest TCP frame.
pub(super) const MIN_LEN: usize = MBAP + 2;

/// The number of bytes of an exception over TCP.
pub(super) const EXCEPTION: usize = MBAP + EXCEPTION_LENGTH;

/// The length field of an exception.
const EXCEPTION_LENGTH: usize = 3;

/// Returns the length of the TCP frame that begins here, or the number of bytes that show it.
#[inline]
pub(super) fn len(data: &[u8], side: Side) -> Result<usize, DecodeError> {
    let len = data.first_chunk().map_or(Ok(MBAP), Frame::tcp_len)?;
    Ok(if is_exception(data, side) { len.min(EXCEPTION) } else { len })
}

/// Returns whether the TCP frame that begins here is an exception to a function of the specification, which has two bytes of
/// PDU.
#[inline]
fn is_exception(data: &[u8], side: Side) -> bool {
    let code = data.get(MBAP + 1).copied().unwrap_or_default();
    code >= function::EXCEPTION && side == Side::Server && function::is_typed(code & !function::EXCEPTION)
}

/// Returns the number of bytes that may follow the TCP frame at the beginning, if that is an exception with a wrong length:
/// those that its header counts beyond the PDU, or those of the PDU that it does not count.
#[cold]
pub(super) fn excess(data: &[u8], side: Side) -> usize {
    match data.get(4..6) {
        Some(&[l0, l1]) if is_exception(data, side) => {
            usize::from(u16::from_be_bytes([l0, l1])).abs_diff(EXCEPTION_LENGTH)
        }
        _ => 0,
    }
}

/// Returns the error of a whole exception with a wrong length.
#[cold]
pub(super) fn exception_error(frame: &[u8], side: Side) -> Option<DecodeError> {
    let &[t0, t1, _, _, l0, l1, unit, function, code] = frame.first_chunk()?;
    let found = u16::from_be_bytes([l0, l1]);
    (is_exception(frame, side) && usize::from(found) != EXCEPTION_LENGTH).then(|| {
        DecodeError::ExceptionLength {
            transaction: u16::from_be_bytes([t0, t1]),
            unit,
            function: function & 0x7F,
            exception: Exception::from(code),
            expected: 3,
            found,
        }
    })
}

/// Returns whether the next frame begins at `at`, for any message, right after a frame of another protocol. Otherwise a
/// header must have the length of the message after it.
pub(super) fn is_placed(at: usize, from: usize, start: usize) -> bool {
    at == from && from > start + 1
}

/// Returns the number of bytes to skip of a frame whose header is bad: all of them, if its length is a possible one.
pub(super) fn foreign_len(data: &[u8]) -> usize {
    let length = data.get(4..6).and_then(<[u8]>::first_chunk);
    let length = length.map_or(usize::MAX, |length| usize::from(u16::from_be_bytes(*length)));
    if length <= 254 { MBAP + length } else { 1 }
}

/// Returns the index of the next bytes that can be an MBAP header, as far as they have come; otherwise the end of the tried
/// bytes.
#[inline(never)]
pub(super) fn next(
    stream: &Stream,
    side: Side,
    from: usize,
    tried: usize,
    limit: usize,
) -> Result<usize, usize> {
    let mut rest = stream.get(from.max(tried)..limit).unwrap_or_default();
    while let ([_, after @ ..], data) = (rest, rest) {
        rest = after;
        // Protocol 0, a length below 256: checked as soon as it is there.
        if let [_, _, p0, ..] = *data
            && (p0 != 0 || data.get(3).is_some_and(|p1| *p1 != 0) || data.get(4).is_some_and(|l0| *l0 != 0))
        {
            continue;
        }
        let start = limit - data.len();
        let Some((six, message)) = data.split_first_chunk() else { return Err(start) };
        let Ok(len) = Frame::tcp_len(six) else { continue };
        if is_placed(start, from, stream.start()) {
            return Ok(start);
        }
        match RtuLen::of(message, side) {
            RtuLen::Known(rtu) if MBAP + rtu == len + 2 => return Ok(start),
            RtuLen::AtLeast(_) if !stream.has_ended() => return Err(start),
            RtuLen::Known(_) | RtuLen::AtLeast(_) | RtuLen::Silence => {}
        }
    }
    Err(limit)
}
