//! The beginnings and ends of RTU frames.

use crate::error::DecodeError;
use crate::frame::{Frame, RTU, RtuLen, Side, pdu_length};
use crate::message::function::Length;
use crate::stream::Stream;

/// Returns the length of the RTU frame that begins here, or the number of bytes that show it.
pub(crate) fn len(data: &[u8], side: Side, finished: bool) -> Result<usize, DecodeError> {
    let (RtuLen::Known(len) | RtuLen::AtLeast(len)) = RtuLen::of(data, side) else {
        // However many bytes there are: the division into reads must have no effect.
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

/// The index of the byte of an RTU frame that shows its length, by function code, for a client and for a server; 0 if no byte
/// does.
static LENGTH_OFFSETS: ([u8; PLACES], [u8; PLACES]) = (shown(Side::Client), shown(Side::Server));

const fn shown(side: Side) -> [u8; PLACES] {
    let mut shown = [0; PLACES];
    let mut rest: &mut [u8] = &mut shown;
    let mut code = 0;
    while let [first, after @ ..] = rest {
        *first = match pdu_length(code, side) {
            Length::Fixed(_) => 1,
            Length::Counted(at) => at + 1,
            Length::Unknown => 0,
        };
        (rest, code) = (after, code.wrapping_add(1));
    }
    shown
}

/// The number of positions modulo 256; 0 in a build without RTU.
const PLACES: usize = if cfg!(feature = "rtu") { 256 } else { 0 };

/// The ends of the frames that may have begun within corruption: for each end (modulo 256) the length of a frame less one,
/// and for each beginning the same of another frame with the same end, or 0.
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

    /// Removes a frame that ends here; returns its length.
    fn take(&mut self, end: u8) -> Option<usize> {
        let last = self.last.get_mut(usize::from(end)).filter(|less_one| **less_one > 0)?;
        let start = end.wrapping_sub(*last).wrapping_sub(1);
        let other = *self.other.get(usize::from(start))?;
        Some(usize::from(core::mem::replace(last, other)) + 1)
    }

    /// Returns the beginning of the frame that ends first, and of several such frames of the longest; otherwise the end of
    /// the tried bytes. A beginning is recorded with the byte that shows its length, and tried when its end has come.
    #[inline(never)]
    pub(super) fn next(
        &mut self,
        stream: &Stream,
        side: Side,
        from: usize,
        tried: usize,
        limit: usize,
    ) -> Result<usize, usize> {
        let (shown_by, shown): (&[u8], _) = match side {
            Side::Client => (&[1, 2, 6, 10], &LENGTH_OFFSETS.0),
            Side::Server => (&[1, 2, 3], &LENGTH_OFFSETS.1),
        };
        let bytes = stream.get(0..limit).unwrap_or_default();
        for end in tried + 1..=limit {
            let count = bytes.get(end - 1).copied().unwrap_or_default();
            for at in shown_by.iter().take_while(|at| from + usize::from(**at) < end) {
                let code = bytes.get(end - usize::from(*at)).copied().unwrap_or_default();
                if shown.get(usize::from(code)) == Some(at) {
                    let pdu = match pdu_length(code, side) {
                        Length::Fixed(pdu) => pdu.into(),
                        Length::Counted(_) | Length::Unknown => usize::from(*at) + usize::from(count),
                    };
                    self.add(place(stream, end - usize::from(*at) - 1), RTU + pdu);
                }
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

/// Returns a position in the stream, modulo 256.
fn place(stream: &Stream, index: usize) -> u8 {
    let [low, ..] = stream.position_of(index).to_le_bytes();
    low
}
