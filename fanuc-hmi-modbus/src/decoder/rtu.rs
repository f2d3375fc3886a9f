//! Where RTU frames begin and end.

use crate::error::DecodeError;
use crate::frame::{Frame, RTU, RtuLen, Side, pdu_length};
use crate::message::function::Length;
use crate::stream::Stream;

/// The length of the RTU frame that begins here, or how many bytes show it.
pub(crate) fn len(data: &[u8], side: Side, finished: bool) -> Result<usize, DecodeError> {
    let (RtuLen::Known(len) | RtuLen::AtLeast(len)) = RtuLen::of(data, side) else {
        // However many bytes there are: how the stream was cut must not show.
        let too_long = Frame::MAX_RTU_LEN + 1;
        return match data.len() {
            len if len >= too_long => Err(DecodeError::TooLong { found: too_long }),
            len if finished => Frame::decode_rtu_whole(data).map(|_| len),
            _ => Ok(too_long),
        };
    };
    match data.get(..len) {
        _ if len > Frame::MAX_RTU_LEN => Err(DecodeError::TooLong { found: len }),
        Some(frame) => Frame::decode_rtu_whole(frame).map(|_| len),
        None => Ok(len),
    }
}

/// The places modulo 256; none in a build without RTU.
const PLACES: usize = if cfg!(feature = "rtu") { 256 } else { 0 };

/// Where the frames end that may have begun within corruption: of a frame that ends at some place (modulo 256) the length less one, and at
/// its own beginning the same of another that ends there, or 0.
#[derive(Debug, Clone)]
pub(super) struct Ends {
    last: [u8; PLACES],
    other: [u8; PLACES],
}

impl Ends {
    pub(super) const NONE: Self = Self { last: [0; PLACES], other: [0; PLACES] };

    /// Adds a frame of 5 to 256 bytes.
    fn add(&mut self, start: u8, len: usize) {
        let Ok(less_one) = u8::try_from(len - 1) else { return };
        let end = start.wrapping_add(less_one).wrapping_add(1);
        let (last, other) = (self.last.get_mut(usize::from(end)), self.other.get_mut(usize::from(start)));
        if let (Some(last), Some(other)) = (last, other) {
            *other = core::mem::replace(last, less_one);
        }
    }

    /// Removes one that ends here; gives its length.
    fn take(&mut self, end: u8) -> Option<usize> {
        let last = self.last.get_mut(usize::from(end)).filter(|less_one| **less_one > 0)?;
        let start = end.wrapping_sub(*last).wrapping_sub(1);
        let other = *self.other.get(usize::from(start))?;
        Some(usize::from(core::mem::replace(last, other)) + 1)
    }

    /// Where the frame begins that ends first, and of those the longest; else what was tried. A beginning is noted with the byte
    /// that shows its length, and tried when its end has come.
    #[inline(never)]
    pub(super) fn next(
        &mut self,
        stream: &Stream,
        side: Side,
        from: usize,
        tried: usize,
        limit: usize,
    ) -> Result<usize, usize> {
        let shown_by: &[usize] = match side {
            Side::Client => &[1, 6, 10],
            Side::Server => &[1, 2],
        };
        for end in tried + 1..=limit {
            for at in shown_by {
                let Some(start) = end.checked_sub(at + 1).filter(|start| *start >= from) else {
                    break;
                };
                let data = stream.get(start..end).unwrap_or_default();
                let (Some(code), Some(shows)) = (data.get(1), data.last()) else { break };
                let pdu = match pdu_length(*code, side) {
                    Length::Fixed(pdu) if *at == 1 => pdu.into(),
                    Length::Counted(count_at) if usize::from(count_at) + 1 == *at => at + usize::from(*shows),
                    _ => continue,
                };
                self.add(place(stream, start), RTU + pdu);
            }
            let mut longest = None;
            while let Some(len) = self.take(place(stream, end)) {
                let frame = stream.get(end.saturating_sub(len)..end).unwrap_or_default();
                if Frame::decode_rtu_whole(frame).is_ok() {
                    longest = longest.max(Some(len));
                }
            }
            if let Some(len) = longest {
                return Ok(end.saturating_sub(len));
            }
        }
        Err(limit)
    }
}

/// A place in the stream, modulo 256.
fn place(stream: &Stream, index: usize) -> u8 {
    let [low, ..] = stream.position_of(index).to_le_bytes();
    low
}
