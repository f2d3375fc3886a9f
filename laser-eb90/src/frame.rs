//! The envelope: head, flag, doubled 90h, tail, checksum.

use robot_session::Encode;

use crate::error::{DecodeError, EncodeError};
use crate::items::{Items, is_tag};
use crate::profile::{Flag, Profile, Width};

/// The longest payload, unstuffed. The source gives no limit: this is twice its batch of seven six-axis moves.
pub const MAX_PAYLOAD: usize = 512;

pub(crate) const HEAD: [u8; 3] = [0xEB, 0x90, 0x82];
const FLAG: u8 = 0xF0;
/// The byte that begins the tail, and is doubled in the payload.
pub(crate) const MARK: u8 = 0x90;

/// One frame: a payload that begins with a tag, in the envelope of a [`Profile`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a> {
    payload: &'a [u8],
    profile: Profile,
}

impl<'a> Frame<'a> {
    /// The shortest frame: one item without values, in five bytes with its tail and the checksum.
    pub const MIN_LEN: usize = HEAD.len() + 5;
    /// The longest frame: every byte of the longest payload is a 90h; flag, tail and checksum take five.
    pub const MAX_LEN: usize = HEAD.len() + 2 * MAX_PAYLOAD + 5;

    /// Returns the frame of a payload that is known to begin with a tag.
    pub(crate) fn new(payload: &'a [u8], profile: &Profile) -> Self {
        Self { payload, profile: *profile }
    }

    /// Decodes the frame at the beginning of `bytes`: returns `None` if more bytes are needed, otherwise the frame and its
    /// length on the line.
    ///
    /// A frame without doubled bytes is used in place, any other is unstuffed into `payload`, whose length is also the limit
    /// of an accepted payload; [`MAX_PAYLOAD`] bytes suffice for every frame of [`Frame::encode`]. The items are not decoded
    /// yet.
    ///
    /// # Errors
    /// Everything in [`DecodeError`]. A stream continues at the next head: [`Decoder`](crate::Decoder) finds it.
    #[inline]
    pub fn decode(
        bytes: &'a [u8],
        payload: &'a mut [u8],
        profile: &Profile,
    ) -> Result<Option<(Self, usize)>, DecodeError> {
        match in_place(bytes, payload.len(), profile) {
            Some((payload, used)) => Ok(Some((Self::new(payload, profile), used))),
            None => Self::decode_in_steps(bytes, payload, profile),
        }
    }

    /// Decodes a frame in steps; out of line, so that the usual path is short.
    #[inline(never)]
    fn decode_in_steps(
        bytes: &'a [u8],
        payload: &'a mut [u8],
        profile: &Profile,
    ) -> Result<Option<(Self, usize)>, DecodeError> {
        let mut scan = Scan::NEW;
        match scan.advance(bytes, payload, profile) {
            Ok(None) => Ok(None),
            Ok(Some(body)) => Ok(Some((Self::new(body.payload(payload), profile), body.used))),
            Err(damage) => Err(damage.error),
        }
    }

    /// Appends the frame; grows or panics as the buffer's `put_slice` does.
    #[cfg(feature = "bytes")]
    pub fn append_to(&self, out: &mut impl bytes::BufMut) {
        self.write(|bytes| out.put_slice(bytes));
    }

    /// Returns the items of the frame.
    pub fn items(&self) -> Items<'a> {
        Items::new(self.payload, &self.profile)
    }

    /// Returns the unstuffed payload.
    pub fn payload(&self) -> &'a [u8] {
        self.payload
    }

    fn write(&self, mut put: impl FnMut(&[u8])) {
        put(&HEAD);
        if self.profile.flag == Flag::Separate {
            put(&[FLAG]);
        }
        let mut rest = self.payload;
        while let Some((marked, after)) = rest.split_at_checked(find_mark(rest) + 1) {
            put(marked);
            put(&[MARK]);
            rest = after;
        }
        put(rest);
        put(&[MARK, self.profile.tail.byte()]);
        let sum = checksum(self.payload, &self.profile);
        match self.profile.checksum {
            Width::U8 => put(&sum.to_le_bytes()[..1]),
            Width::U16Le => put(&sum.to_le_bytes()),
            Width::U16Be => put(&sum.to_be_bytes()),
        }
    }
}

impl Encode for Frame<'_> {
    type Error = EncodeError;

    fn encoded_len(&self) -> usize {
        let (mut rest, mut doubled) = (self.payload, 0);
        while let Some(after) = rest.get(find_mark(rest) + 1..) {
            (rest, doubled) = (after, doubled + 1);
        }
        prefix_len(&self.profile) + self.payload.len() + doubled + 2 + self.profile.checksum.len()
    }

    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let (needed, available) = (self.encoded_len(), out.len());
        if needed > available {
            return Err(EncodeError::BufferTooSmall { needed, available });
        }
        let mut rest = out;
        self.write(|bytes| {
            if let Some((slot, after)) = core::mem::take(&mut rest).split_at_mut_checked(bytes.len()) {
                slot.copy_from_slice(bytes);
                rest = after;
            }
        });
        Ok(needed)
    }
}

/// Returns the payload and the length of a whole frame without faults and without doubled bytes, as most are. Any other
/// frame is decoded a second time, in steps.
#[inline(always)]
pub(crate) fn in_place<'a>(bytes: &'a [u8], limit: usize, profile: &Profile) -> Option<(&'a [u8], usize)> {
    let mut rest = bytes.strip_prefix(&HEAD)?;
    if profile.flag == Flag::Separate {
        rest = rest.strip_prefix(&[FLAG])?;
    }
    let (length, sum) = sum_to_mark(rest);
    let (payload, end) = rest.split_at_checked(length)?;
    let [_, tail, check @ ..] = end else { return None };
    let good = is_tag(*payload.first()?, &profile.tags)
        && payload.len() <= limit
        && profile.tail.ends_with(*tail)
        && check_word(check, profile)? == checksum_of(sum, profile);
    good.then_some((payload, bytes.len() - check.len() + profile.checksum.len()))
}

/// The position up to which a frame has been read and its payload copied; continues from there when more bytes come.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scan {
    /// Bytes of the frame that are done with; 0 as long as nothing has been read.
    read: usize,
    /// Bytes of the payload, unstuffed.
    len: usize,
}

/// A whole frame whose payload has been copied.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Body {
    len: usize,
    /// The length of the frame.
    pub(crate) used: usize,
}

/// The error of a frame, and the number of its bytes that were examined to find it.
#[derive(Debug)]
pub(crate) struct CorruptFrame {
    pub(crate) error: DecodeError,
    pub(crate) examined: usize,
}

impl Scan {
    pub(crate) const NEW: Self = Self { read: 0, len: 0 };

    /// Returns whether nothing has been read yet.
    #[inline]
    pub(crate) fn is_new(&self) -> bool {
        self.read == 0
    }

    /// Reads on in `raw`, which begins with the frame: `None` when more bytes are needed.
    pub(crate) fn advance(
        &mut self,
        raw: &[u8],
        payload: &mut [u8],
        profile: &Profile,
    ) -> Result<Option<Body>, CorruptFrame> {
        if self.is_new() {
            let Some(begin) = begin(raw, profile)? else { return Ok(None) };
            self.read = begin;
        }
        loop {
            self.copy_blocks::<16>(raw, payload);
            self.copy_blocks::<8>(raw, payload);
            let (byte, taken) = match *raw.get(self.read..).unwrap_or_default() {
                [] | [MARK] => return Ok(None),
                [MARK, MARK, ..] => (MARK, 2),
                [MARK, byte, ..] if profile.tail.ends_with(byte) => return self.end(raw, payload, profile),
                [MARK, found, ..] => {
                    let error = DecodeError::Stuffing { offset: self.read + 1, found };
                    return Err(CorruptFrame { error, examined: self.read + 2 });
                }
                [byte, ..] => (byte, 1),
            };
            self.read += taken;
            let Some(slot) = payload.get_mut(self.len) else {
                let (offset, limit) = (self.read - 1, payload.len());
                return Err(CorruptFrame {
                    error: DecodeError::TooLong { offset, limit },
                    examined: self.read,
                });
            };
            *slot = byte;
            self.len += 1;
        }
    }

    /// Copies whole blocks. A block counts up to its first 90h; a doubled 90h counts as one byte.
    #[inline]
    fn copy_blocks<const N: usize>(&mut self, raw: &[u8], payload: &mut [u8]) {
        let (mut rest, mut free) =
            (raw.get(self.read..).unwrap_or_default(), payload.get_mut(self.len..).unwrap_or_default());
        let (available, room) = (rest.len(), free.len());
        while let (Some((block, after)), Some(slot)) =
            (rest.split_first_chunk::<N>(), free.first_chunk_mut::<N>())
        {
            *slot = *block;
            if is_clean(block) {
                rest = after;
                free = core::mem::take(&mut free).get_mut(N..).unwrap_or_default();
                continue;
            }
            let clean = place_of_mark(block);
            rest = rest.get(clean..).unwrap_or_default();
            let [MARK, MARK, after @ ..] = rest else {
                free = core::mem::take(&mut free).get_mut(clean..).unwrap_or_default();
                break;
            };
            rest = after;
            free = core::mem::take(&mut free).get_mut(clean + 1..).unwrap_or_default();
        }
        self.read += available - rest.len();
        self.len += room - free.len();
    }

    /// Checks the checksum after the tail.
    fn end(&self, raw: &[u8], payload: &[u8], profile: &Profile) -> Result<Option<Body>, CorruptFrame> {
        let offset = self.read + 2;
        let Some(found) = check_word(raw.get(offset..).unwrap_or_default(), profile) else { return Ok(None) };
        let body = Body { len: self.len, used: offset + profile.checksum.len() };
        let expected = checksum(body.payload(payload), profile);
        if found == expected {
            Ok(Some(body))
        } else {
            let error = DecodeError::Checksum { offset, expected, found };
            Err(CorruptFrame { error, examined: body.used })
        }
    }
}

impl Body {
    /// Returns the payload, from `copied` if it has been copied.
    #[inline]
    pub(crate) fn payload<'a>(&self, copied: &'a [u8]) -> &'a [u8] {
        copied.get(..self.len).unwrap_or_default()
    }
}

/// Returns the length of everything before a payload.
#[inline]
pub(crate) fn prefix_len(profile: &Profile) -> usize {
    HEAD.len() + usize::from(profile.flag == Flag::Separate)
}

/// Returns the length of everything before the payload, when these bytes and the first tag are complete and valid.
fn begin(raw: &[u8], profile: &Profile) -> Result<Option<usize>, CorruptFrame> {
    let len = prefix_len(profile);
    let (error, examined) = match *raw {
        [0xEB, 0x90, 0x82, flag, ..] if flag != FLAG && profile.flag == Flag::Separate => {
            (DecodeError::Flag { offset: HEAD.len(), expected: FLAG, found: flag }, len)
        }
        [0xEB, 0x90, 0x82, ..] => match raw.get(len) {
            Some(&tag) if is_tag(tag, &profile.tags) => return Ok(Some(len)),
            Some(&found) => (DecodeError::Tag { offset: 0, found }, len + 1),
            None => return Ok(None),
        },
        [] | [0xEB] | [0xEB, 0x90] => return Ok(None),
        _ => (DecodeError::NoHead { skipped: raw.len() }, raw.len()),
    };
    Err(CorruptFrame { error, examined })
}

/// Returns the offset of the first head in `bytes`, whole or cut off by their end; their length if no head begins.
pub(crate) fn find_head(bytes: &[u8]) -> usize {
    let mut from = 0;
    loop {
        let rest = bytes.get(from..).unwrap_or_default();
        let Some(at) = rest.iter().position(|&b| b == HEAD[0]) else { return bytes.len() };
        let here = rest.get(at..).unwrap_or_default();
        if here.iter().zip(HEAD).all(|(a, b)| *a == b) {
            return from + at;
        }
        from += at + 1;
    }
}

/// Returns whether `bytes` begin with a whole head.
pub(crate) fn has_head(bytes: &[u8]) -> bool {
    bytes.starts_with(&HEAD)
}

/// Returns the offset of the first 90h; the length if there is no 90h. Blocks of a fixed size become a few vector
/// instructions, while a search is a branch per byte.
fn find_mark(bytes: &[u8]) -> usize {
    let mut rest = bytes;
    while let Some((block, after)) = rest.split_first_chunk::<64>()
        && is_clean(block)
    {
        rest = after;
    }
    while let Some((block, after)) = rest.split_first_chunk::<16>()
        && is_clean(block)
    {
        rest = after;
    }
    while let Some((word, after)) = rest.split_first_chunk::<8>() {
        let marks = marks(*word);
        if marks != 0 {
            return bytes.len() - rest.len() + marks.trailing_zeros() as usize / 8;
        }
        rest = after;
    }
    while let [byte, after @ ..] = rest
        && *byte != MARK
    {
        rest = after;
    }
    bytes.len() - rest.len()
}

/// Returns the offset of the first 90h, and the sum of the bytes before it.
#[inline(never)]
fn sum_to_mark(bytes: &[u8]) -> (usize, u32) {
    let (mut rest, mut sum) = (bytes, 0);
    while let Some((block, after)) = rest.split_first_chunk::<64>()
        && is_clean(block)
    {
        sum += add(block);
        rest = after;
    }
    // Found first and summed then: if both are done to a block this short, each byte is taken out of the vector alone.
    let mut tail = rest;
    while let Some((block, after)) = tail.split_first_chunk::<16>()
        && is_clean(block)
    {
        tail = after;
    }
    while let Some((block, after)) = rest.split_first_chunk::<16>()
        && after.len() >= tail.len()
    {
        sum += add(block);
        rest = after;
    }
    while let [byte, after @ ..] = rest
        && *byte != MARK
    {
        sum += u32::from(*byte);
        rest = after;
    }
    (bytes.len() - rest.len(), sum)
}

#[inline]
fn is_clean<const N: usize>(block: &[u8; N]) -> bool {
    !block.iter().fold(false, |any, &b| any | (b == MARK))
}

/// Returns the offset of the first 90h of a block that has one.
#[inline]
fn place_of_mark(block: &[u8]) -> usize {
    let mut place = 0;
    for word in block.as_chunks().0 {
        let marks = marks(*word);
        if marks != 0 {
            return place + marks.trailing_zeros() as usize / 8;
        }
        place += 8;
    }
    place
}

/// Returns a word whose lowest set bit is the top bit of the first byte that is 90h (Mycroft's test for a zero byte).
#[inline]
fn marks(word: [u8; 8]) -> u64 {
    const ONES: u64 = u64::from_le_bytes([0x01; 8]);
    const TOPS: u64 = u64::from_le_bytes([0x80; 8]);
    let zero_at_mark = u64::from_le_bytes(word) ^ u64::from_le_bytes([MARK; 8]);
    zero_at_mark.wrapping_sub(ONES) & !zero_at_mark & TOPS
}

/// Returns the check word at the beginning of `bytes`.
#[inline]
fn check_word(bytes: &[u8], profile: &Profile) -> Option<u16> {
    Some(match (profile.checksum, bytes) {
        (Width::U8, [byte, ..]) => u16::from(*byte),
        (Width::U16Le, [low, high, ..]) | (Width::U16Be, [high, low, ..]) => {
            u16::from_le_bytes([*low, *high])
        }
        _ => return None,
    })
}

/// Returns the sum of the unstuffed payload, in the form that the profile requires.
fn checksum(payload: &[u8], profile: &Profile) -> u16 {
    checksum_of(sum(payload), profile)
}

#[inline]
fn checksum_of(mut sum: u32, profile: &Profile) -> u16 {
    if profile.checksum_with_flag && profile.flag == Flag::Separate {
        sum += u32::from(FLAG);
    }
    if profile.checksum_negated {
        sum = sum.wrapping_neg();
    }
    let [low, high, ..] = sum.to_le_bytes();
    match profile.checksum {
        Width::U8 => u16::from(low),
        Width::U16Le | Width::U16Be => u16::from_le_bytes([low, high]),
    }
}

/// Returns the sum of all bytes, in blocks of a fixed size: each block becomes a vector sum.
fn sum(bytes: &[u8]) -> u32 {
    let (mut rest, mut sum) = (bytes, 0);
    while let Some((block, after)) = rest.split_first_chunk::<64>() {
        sum += add(block);
        rest = after;
    }
    while let Some((block, after)) = rest.split_first_chunk::<16>() {
        sum += add(block);
        rest = after;
    }
    sum + add(rest)
}

#[inline]
fn add(bytes: &[u8]) -> u32 {
    bytes.iter().map(|&b| u32::from(b)).sum()
}
