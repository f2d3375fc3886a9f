//! The envelope: `DLE DLE STX <data> DLE ETX <checksum>`, every DLE in the data doubled (§3.2).

use crate::error::{DecodeError, EncodeError};
use crate::framing::{DLE, ETX, Framing, LeadingDle, STX};

/// The data of one frame, without marks, doubled DLEs and checksum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    /// Zero after `len`: the sum and the count of DLEs then run over a constant length. The space after that is for
    /// words of eight bytes that end in it.
    data: [u8; Frame::SUMMED + 8],
    len: usize,
}

impl Frame {
    /// The most data bytes in a frame: a standard message with its transformation.
    pub const MAX_DATA: usize = 30;
    /// The longest frame on the line, with every data byte and the checksum doubled.
    pub const MAX_LEN: usize = 3 + 2 * (Self::MAX_DATA + 1) + 2;

    const SUMMED: usize = 32;

    /// Creates a frame around `data`.
    ///
    /// # Errors
    /// [`EncodeError::TooLong`] above [`Frame::MAX_DATA`] bytes.
    pub fn new(data: &[u8]) -> Result<Self, EncodeError> {
        let mut frame = Self::empty();
        if frame.push_run(data, Self::MAX_DATA) {
            Ok(frame)
        } else {
            Err(EncodeError::TooLong { found: data.len(), limit: Self::MAX_DATA })
        }
    }

    /// Reads the frame at the start of `bytes`, which begin with a start mark. `None`: more bytes are needed.
    /// The second value is the number of bytes that the frame has on the line.
    ///
    /// # Errors
    /// The error of the frame that begins there: in its marks, its length or its checksum.
    pub fn decode(bytes: &[u8], framing: Framing) -> Result<Option<(Self, usize)>, DecodeError> {
        Self::decode_limited(bytes, framing, Self::MAX_DATA)
    }

    /// Decodes a frame as [`Frame::decode`] does, for a side whose messages have at most `limit` data bytes.
    pub(crate) fn decode_limited(
        bytes: &[u8],
        framing: Framing,
        limit: usize,
    ) -> Result<Option<(Self, usize)>, DecodeError> {
        let mut reading = Reading::NEW;
        let length = reading.read(bytes, framing, limit)?;
        Ok(length.map(|length| (reading.frame, length)))
    }

    /// Writes the frame and returns its length.
    ///
    /// # Errors
    /// If `out` is too short: how many bytes are needed.
    pub fn encode(&self, framing: Framing, out: &mut [u8]) -> Result<usize, EncodeError> {
        let mut line = [0; Self::MAX_LEN];
        let (mut len, checksum) = (framing.leading_dle.count() + 1, self.checksum(framing));
        if let Some(leading) = line.first_chunk_mut() {
            *leading = [DLE; 2];
        }
        if let Some(stx) = line.get_mut(len - 1) {
            *stx = STX;
        }
        if !self.has_dle()
            && let Some(room) = line.get_mut(len..).and_then(<[u8]>::first_chunk_mut)
        {
            *room = *self.summed();
            len += self.len;
        } else {
            for byte in self.data() {
                // Written twice, and kept twice if it is a DLE.
                if let Some(pair) = line.get_mut(len..).and_then(<[u8]>::first_chunk_mut) {
                    *pair = [*byte; 2];
                    len += 1 + usize::from(*byte == DLE);
                }
            }
        }
        // The last one counts when the checksum is doubled.
        if let Some(end) = line.get_mut(len..).and_then(<[u8]>::first_chunk_mut) {
            *end = [DLE, ETX, checksum, DLE];
        }
        let (needed, available) = (len + 2 + framing.checksum_len(checksum), out.len());
        let (Some(line), Some(out)) = (line.get(..needed), out.get_mut(..needed)) else {
            return Err(EncodeError::BufferTooSmall { needed, available });
        };
        // Most replies: two overlapping words, because a call would take longer.
        if let (Some(first), Some(last)) = (line.first_chunk::<16>(), line.last_chunk::<16>())
            && needed <= 32
        {
            out.first_chunk_mut().into_iter().for_each(|room| *room = *first);
            out.last_chunk_mut().into_iter().for_each(|room| *room = *last);
        } else {
            out.copy_from_slice(line);
        }
        Ok(needed)
    }

    /// Returns the length on the line, including doubled DLEs.
    pub fn encoded_len(&self, framing: Framing) -> usize {
        let doubled = self.data().iter().filter(|byte| **byte == DLE).count();
        let checksum_len = framing.checksum_len(self.checksum(framing));
        framing.leading_dle.count() + 1 + self.len + doubled + 2 + checksum_len
    }

    /// Returns the data bytes, at most [`Frame::MAX_DATA`].
    pub fn data(&self) -> &[u8] {
        self.data.get(..self.len).unwrap_or_default()
    }

    /// Returns the sum of the data modulo 256, or its two's complement.
    pub fn checksum(&self, framing: Framing) -> u8 {
        let mut sum = Sum::default();
        self.words().for_each(|word| sum.add(word));
        framing.checksum(sum.total())
    }

    /// Returns whether a data byte is doubled on the line.
    #[inline]
    pub(crate) fn has_dle(&self) -> bool {
        self.words().fold(0, |any, word| any | dles(word)) != 0
    }

    fn words(&self) -> impl Iterator<Item = u64> {
        let (words, _) = self.summed().as_chunks();
        words.iter().map(|word| u64::from_le_bytes(*word))
    }

    fn summed(&self) -> &[u8; Self::SUMMED] {
        let (summed, _) = self.data.split_first_chunk().unwrap_or((&[0; Self::SUMMED], &[]));
        summed
    }

    pub(crate) const fn empty() -> Self {
        Self { data: [0; Self::SUMMED + 8], len: 0 }
    }

    /// Appends bytes, which always fit: messages are shorter than [`Frame::MAX_DATA`] by their types.
    #[inline]
    pub(crate) fn push<const N: usize>(&mut self, bytes: [u8; N]) {
        self.push_if(true, bytes);
    }

    /// Appends bytes if they are wanted, without a branch: unwanted bytes are zero, and are written after the end.
    #[inline]
    pub(crate) fn push_if<const N: usize>(&mut self, wanted: bool, bytes: [u8; N]) {
        if let Some(room) = self.data.get_mut(self.len..).and_then(<[u8]>::first_chunk_mut) {
            *room = bytes;
            self.len += if wanted { N } else { 0 };
        }
    }

    /// Appends the data at `at`, up to the end mark; returns the offset of the first unread byte.
    fn unstuff(&mut self, bytes: &[u8], at: usize, limit: usize) -> (usize, StopReason) {
        let Self { data, len: total } = self;
        let mut len = *total;
        let mut rest = bytes.get(at..).unwrap_or_default();
        let stop = loop {
            // Words of eight bytes, up to the next DLE.
            while let Some((word, behind)) = rest.split_first_chunk()
                && let Some(room) = data.get_mut(len..).and_then(<[u8]>::first_chunk_mut)
            {
                *room = *word;
                let run = dle_in(*word);
                len += run;
                if run < 8 {
                    rest = rest.get(run..).unwrap_or_default();
                    break;
                }
                rest = behind;
            }
            // Doubled DLEs often follow each other: the same value again.
            while let Some((pairs, behind)) = rest.split_first_chunk()
                && *pairs == [DLE; 8]
                && let Some(room) = data.get_mut(len..).and_then(<[u8]>::first_chunk_mut)
            {
                *room = [DLE; 4];
                len += 4;
                rest = behind;
            }
            while let Some((pair, behind)) = rest.split_first_chunk()
                && *pair == PAIR // one comparison: a pattern is two
                && let Some(room) = data.get_mut(len)
            {
                *room = DLE;
                len += 1;
                rest = behind;
            }
            if len > limit {
                break StopReason::TooLong;
            }
            rest = match (rest, data.get_mut(len)) {
                ([] | [DLE], _) | (_, None) => break StopReason::Unread,
                ([DLE, ETX, ..], _) => break StopReason::End,
                ([DLE, found, ..], _) => break StopReason::NoMark(*found),
                ([byte, behind @ ..], Some(room)) => {
                    *room = *byte;
                    len += 1;
                    behind
                }
            };
        };
        *total = len;
        (bytes.len() - rest.len(), stop)
    }

    /// Appends `run`; false, and nothing appended, when there were then more than `limit` bytes.
    fn push_run(&mut self, run: &[u8], limit: usize) -> bool {
        let end = self.len + run.len();
        match self.data.get_mut(self.len..end) {
            Some(room) if end <= limit => {
                room.copy_from_slice(run);
                self.len = end;
                true
            }
            _ => false,
        }
    }
}

/// A DLE of the data.
const PAIR: [u8; 2] = [DLE; 2];

/// The reason that no more data is read.
enum StopReason {
    /// The end mark is here.
    End,
    /// The next byte has not arrived yet.
    Unread,
    /// There are more bytes than a message has.
    TooLong,
    /// A DLE before this byte.
    NoMark(u8),
}

/// A frame that is being read: bytes that were examined are not examined again when more bytes have come.
#[derive(Debug, Clone)]
pub(crate) struct Reading {
    pub(crate) frame: Frame,
    /// Bytes that were read, from the start mark on; 0 before that is whole.
    at: usize,
}

impl Reading {
    pub(crate) const NEW: Self = Self { frame: Frame::empty(), at: 0 };

    /// Returns whether a start mark was read.
    pub(crate) const fn has_begun(&self) -> bool {
        self.at > 0
    }

    /// Appends a byte of the data that is not a DLE, after the frame has begun; returns false if it does not fit.
    #[inline]
    pub(crate) fn take(&mut self, byte: u8, limit: usize) -> bool {
        // Below the limit there is free space.
        let data = self.frame.data.get_mut(..limit);
        let room = data.and_then(|data| data.get_mut(self.frame.len));
        if let Some(room) = room {
            *room = byte;
            self.frame.len += 1;
            self.at += 1;
            return true;
        }
        false
    }

    /// Returns the number of bytes read.
    #[inline]
    pub(crate) const fn at(&self) -> usize {
        self.at
    }

    /// Reads on in the frame at the start of `bytes`, of which some may have been read before; gives its length on the line.
    pub(crate) fn read(
        &mut self,
        bytes: &[u8],
        framing: Framing,
        limit: usize,
    ) -> Result<Option<usize>, DecodeError> {
        if self.at == 0 {
            let Some(mark) = start_mark_len(bytes, framing.leading_dle)? else { return Ok(None) };
            self.at = mark;
        }
        let (at, stop) = self.frame.unstuff(bytes, self.at, limit);
        self.at = at;
        match stop {
            StopReason::End => {}
            StopReason::Unread => return Ok(None),
            StopReason::TooLong => return Err(DecodeError::TooLong { offset: 0, limit }),
            StopReason::NoMark(found) => return Err(DecodeError::EndMark { offset: at + 1, found }),
        }
        // Clear the bytes that the last word has written after the end.
        if let Some(behind) = self.frame.data.get_mut(self.frame.len..).and_then(<[u8]>::first_chunk_mut) {
            *behind = [0; 8];
        }
        let end = at + 2;
        let Some(&found) = bytes.get(end) else { return Ok(None) };
        let expected = self.frame.checksum(framing);
        if found != expected {
            return Err(DecodeError::Checksum { offset: end, expected, found });
        }
        if framing.stuffed_checksum && found == DLE {
            return match bytes.get(end + 1) {
                None => Ok(None),
                Some(&DLE) => Ok(Some(end + 2)),
                Some(&found) => Err(DecodeError::EndMark { offset: end + 1, found }),
            };
        }
        Ok(Some(end + 1))
    }
}

/// Returns the start mark's length: a run of DLEs, at least the framing's number, then STX. `None` if more bytes are needed.
fn start_mark_len(bytes: &[u8], leading: LeadingDle) -> Result<Option<usize>, DecodeError> {
    match (leading, bytes) {
        (LeadingDle::One, [DLE, STX, ..]) => return Ok(Some(2)),
        (LeadingDle::Two, [DLE, DLE, STX, ..]) => return Ok(Some(3)),
        _ => {}
    }
    let run = bytes.iter().take_while(|byte| **byte == DLE).count();
    match bytes.get(run) {
        None => Ok(None),
        Some(&STX) if run >= leading.count() => Ok(Some(run + 1)),
        Some(_) => Err(DecodeError::StartMark { offset: 0, length: bytes.len() }),
    }
}

/// Returns the data of a whole frame if neither the data nor the checksum has a DLE, as in nearly all frames. `None`:
/// the frame has a DLE, is corrupt, or is not whole in the first `available` bytes; the bytes after them only fill
/// the words.
#[inline]
pub(crate) fn plain_data(bytes: &[u8], available: usize, framing: Framing) -> Option<&[u8]> {
    let rest = match (framing.leading_dle, bytes) {
        (LeadingDle::One, [DLE, STX, rest @ ..]) | (LeadingDle::Two, [DLE, DLE, STX, rest @ ..]) => rest,
        _ => return None,
    };
    let (words, _) = rest.first_chunk::<{ Frame::SUMMED }>()?.as_chunks();
    let (mut len, mut sum) = (0, Sum::default());
    for word in words {
        let word = u64::from_le_bytes(*word);
        let found = dles(word);
        if found == 0 {
            sum.add(word);
            len += 8;
            continue;
        }
        sum.add(word & (found ^ (found - 1)) >> 8); // the bytes before the first one
        len += found.trailing_zeros() as usize / 8;
        let (data, [_, ETX, found, ..]) = rest.split_at_checked(len)? else { return None };
        let is_good =
            plain_len(data, framing) <= available && *found == framing.checksum(sum.total()) && *found != DLE;
        return is_good.then_some(data);
    }
    None
}

/// Returns the length on the line of a frame without a DLE in its data.
pub(crate) const fn plain_len(data: &[u8], framing: Framing) -> usize {
    framing.leading_dle.count() + 1 + data.len() + 3
}

/// Returns the offset of the first DLE, or the length of `bytes`.
pub(crate) fn find_dle(bytes: &[u8]) -> usize {
    let mut at = 0;
    let mut rest = bytes;
    while let Some((word, behind)) = rest.split_first_chunk() {
        let run = dle_in(*word);
        at += run;
        if run < 8 {
            return at;
        }
        rest = behind;
    }
    at + rest.iter().position(|byte| *byte == DLE).unwrap_or(rest.len())
}

/// Returns the offset of the first DLE, or 8.
#[inline]
const fn dle_in(word: [u8; 8]) -> usize {
    dles(u64::from_le_bytes(word)).trailing_zeros() as usize / 8
}

/// Returns a value other than zero if a byte is a DLE; then the lowest bit that is set is the highest of the first
/// DLE.
#[inline]
const fn dles(word: u64) -> u64 {
    const ONES: u64 = 0x0101_0101_0101_0101;
    const HIGH: u64 = 0x8080_8080_8080_8080;
    // The lowest zero byte of `x` has the lowest high bit that survives.
    let x = word ^ (ONES * DLE as u64);
    x.wrapping_sub(ONES) & !x & HIGH
}

/// A sum of bytes, eight at a time.
#[derive(Default)]
struct Sum {
    words: u64,
    /// Of the even bytes, in four parts of 16 bits.
    even: u64,
}

impl Sum {
    #[inline]
    const fn add(&mut self, word: u64) {
        self.words = self.words.wrapping_add(word);
        self.even += word & 0x00FF_00FF_00FF_00FF;
    }

    /// Returns the sum modulo 256.
    #[inline]
    const fn total(self) -> u8 {
        let odd = self.words.wrapping_sub(self.even) >> 8;
        // The highest part of the product is the sum of all four.
        let [.., total, _] = odd.wrapping_add(self.even).wrapping_mul(0x0001_0001_0001_0001).to_le_bytes();
        total
    }
}
