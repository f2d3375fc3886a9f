//! The envelope: head, flag, doubled 90h, tail, checksum.

use crate::error::{DecodeError, EncodeError};
use crate::message::{Items, is_tag};
use crate::profile::{Flag, Profile, Width};

/// The longest payload, unstuffed. The source gives no limit: this is twice its batch of seven six-axis moves.
pub const MAX_PAYLOAD: usize = 512;

const HEAD: [u8; 3] = [0xEB, 0x90, 0x82];
const FLAG: u8 = 0xF0;
/// The byte that begins the tail, and is doubled in the payload.
const MARK: u8 = 0x90;

/// One frame: a payload of whole items, at least one, in the envelope of a [`Profile`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a> {
    payload: &'a [u8],
    profile: Profile,
}

impl<'a> Frame<'a> {
    /// The shortest frame: one item without values.
    pub const MIN_LEN: usize = HEAD.len() + 2 + 2 + 1;
    /// The longest frame: every byte of the longest payload is a 90h.
    pub const MAX_LEN: usize = HEAD.len() + 1 + 2 * MAX_PAYLOAD + 2 + 2;

    /// The frame of a payload that is known to be whole items.
    pub(crate) fn new(payload: &'a [u8], profile: &Profile) -> Self {
        Self { payload, profile: *profile }
    }

    /// Reads the frame that `bytes` begin with, and unstuffs it into `payload`: `None` when more bytes are needed, else
    /// the frame and the bytes that it took.
    ///
    /// `payload` limits the length that is taken; [`MAX_PAYLOAD`] bytes hold whatever [`Frame::encode`] writes.
    ///
    /// # Errors
    /// Everything in [`DecodeError`]. A stream goes on behind the next head: [`Decoder`](crate::Decoder) finds it.
    pub fn decode(
        bytes: &[u8],
        payload: &'a mut [u8],
        profile: &Profile,
    ) -> Result<Option<(Self, usize)>, DecodeError> {
        let found = Scan::default().advance(bytes, payload, profile).map_err(|damage| damage.error)?;
        Ok(found.map(|(len, used)| (Self::new(payload.get(..len).unwrap_or_default(), profile), used)))
    }

    /// Writes the frame; returns its length.
    ///
    /// # Errors
    /// `out` is too short; nothing is written then.
    pub fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let (needed, available) = (self.encoded_len(), out.len());
        if needed > available {
            return Err(EncodeError::BufferTooSmall { needed, available });
        }
        let mut rest = out;
        self.write(|bytes| {
            if let Some((slot, behind)) = core::mem::take(&mut rest).split_at_mut_checked(bytes.len()) {
                slot.copy_from_slice(bytes);
                rest = behind;
            }
        });
        Ok(needed)
    }

    /// The length on the wire.
    pub fn encoded_len(&self) -> usize {
        let mut len = 0;
        self.write(|bytes| len += bytes.len());
        len
    }

    /// Appends the frame; grows or panics as the buffer's `put_slice` does.
    #[cfg(feature = "bytes")]
    pub fn append_to(&self, out: &mut impl bytes::BufMut) {
        self.write(|bytes| out.put_slice(bytes));
    }

    /// What it carries.
    pub fn items(&self) -> Items<'a> {
        Items::trusted(self.payload, &self.profile)
    }

    /// The unstuffed payload.
    pub fn payload(&self) -> &'a [u8] {
        self.payload
    }

    fn write(&self, mut put: impl FnMut(&[u8])) {
        put(&HEAD);
        if self.profile.flag == Flag::Separate {
            put(&[FLAG]);
        }
        let mut rest = self.payload;
        while let Some((span, behind)) = find_mark(rest).and_then(|at| rest.split_at_checked(at + 1)) {
            put(span);
            put(&[MARK]);
            rest = behind;
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

/// How far a frame has been read; goes on where it stopped when more bytes come.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Scan {
    /// Bytes of the frame that are done with.
    read: usize,
    /// Bytes of the payload that are written.
    written: usize,
}

/// What is wrong with a frame, and how many of its bytes were looked at to see it.
#[derive(Debug)]
pub(crate) struct Damage {
    pub(crate) error: DecodeError,
    pub(crate) examined: usize,
}

impl Scan {
    /// Nothing has been read yet.
    pub(crate) fn is_new(&self) -> bool {
        self.read == 0
    }

    /// Reads on in `raw`, which begins with the frame: the payload's length and the frame's when it is whole.
    pub(crate) fn advance(
        &mut self,
        raw: &[u8],
        payload: &mut [u8],
        profile: &Profile,
    ) -> Result<Option<(usize, usize)>, Damage> {
        if self.is_new() {
            let Some(begin) = begin(raw, profile)? else { return Ok(None) };
            self.read = begin;
        }
        loop {
            let rest = raw.get(self.read..).unwrap_or_default();
            let Some((span, marked)) = find_mark(rest).and_then(|at| rest.split_at_checked(at)) else {
                self.copy(rest, payload)?;
                return Ok(None);
            };
            self.copy(span, payload)?;
            match marked.get(1) {
                None => return Ok(None),
                Some(&MARK) => {
                    self.copy(&[MARK], payload)?;
                    self.read += 1;
                }
                Some(&byte) if profile.tail.ends_with(byte) => return self.end(raw, payload, profile),
                Some(&found) => {
                    let error = DecodeError::Stuffing { offset: self.read + 1, found };
                    return Err(Damage { error, examined: self.read + 2 });
                }
            }
        }
    }

    /// Copies a stretch without marks.
    fn copy(&mut self, span: &[u8], payload: &mut [u8]) -> Result<(), Damage> {
        let limit = payload.len();
        let room = payload.get_mut(self.written..).unwrap_or_default();
        let Some(slot) = room.get_mut(..span.len()) else {
            let offset = self.read + room.len();
            return Err(Damage { error: DecodeError::TooLong { offset, limit }, examined: offset + 1 });
        };
        slot.copy_from_slice(span);
        self.written += span.len();
        self.read += span.len();
        Ok(())
    }

    /// Checks what stands behind the tail, and what the payload holds.
    fn end(&self, raw: &[u8], payload: &[u8], profile: &Profile) -> Result<Option<(usize, usize)>, Damage> {
        let offset = self.read + 2;
        let width = profile.checksum;
        let Some(bytes) = raw.get(offset..offset + width.len()) else { return Ok(None) };
        let found = match (width, bytes) {
            (Width::U16Le, &[low, high]) | (Width::U16Be, &[high, low]) => u16::from_le_bytes([low, high]),
            _ => u16::from(bytes.first().copied().unwrap_or_default()),
        };
        let examined = offset + width.len();
        let payload = payload.get(..self.written).unwrap_or_default();
        let expected = checksum(payload, profile);
        if found != expected {
            return Err(Damage { error: DecodeError::Checksum { offset, expected, found }, examined });
        }
        match Items::parse(payload, profile) {
            Ok(_) => Ok(Some((self.written, examined))),
            Err(error) => Err(Damage { error, examined }),
        }
    }
}

/// The length of everything in front of the payload, once it and the first tag are there and as they must be.
fn begin(raw: &[u8], profile: &Profile) -> Result<Option<usize>, Damage> {
    let (head, mut rest) = raw.split_at_checked(HEAD.len()).unwrap_or((raw, &[]));
    if !HEAD.starts_with(head) {
        return Err(Damage { error: DecodeError::NoHead { skipped: raw.len() }, examined: raw.len() });
    }
    let mut len = HEAD.len();
    if profile.flag == Flag::Separate {
        match rest.split_first() {
            None => return Ok(None),
            Some((&FLAG, behind)) => rest = behind,
            Some((&found, _)) => {
                let error = DecodeError::Flag { offset: len, expected: FLAG, found };
                return Err(Damage { error, examined: len + 1 });
            }
        }
        len += 1;
    }
    match rest.first() {
        None => Ok(None),
        Some(&tag) if is_tag(tag, &profile.tags) => Ok(Some(len)),
        Some(&found) => Err(Damage { error: DecodeError::Tag { offset: 0, found }, examined: len + 1 }),
    }
}

/// Where the first head in `bytes` begins, whole or cut off by their end; their length if none does.
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

/// Whether `bytes` begin with a whole head.
pub(crate) fn has_head(bytes: &[u8]) -> bool {
    bytes.starts_with(&HEAD)
}

/// The place of the first 90h.
fn find_mark(bytes: &[u8]) -> Option<usize> {
    let (blocks, rest) = bytes.as_chunks::<BLOCK>();
    for (index, block) in blocks.iter().enumerate() {
        // Written so that the compiler compares a whole block in one vector instruction.
        if block.iter().fold(false, |any, &b| any | (b == MARK)) {
            return block.iter().position(|&b| b == MARK).map(|at| index * BLOCK + at);
        }
    }
    rest.iter().position(|&b| b == MARK).map(|at| blocks.len() * BLOCK + at)
}

const BLOCK: usize = 16;

/// The check word: the sum of the unstuffed payload, as the profile wants it.
fn checksum(payload: &[u8], profile: &Profile) -> u16 {
    let (blocks, rest) = payload.as_chunks::<BLOCK>();
    let block_sum = |block: &[u8; BLOCK]| block.iter().map(|&b| u16::from(b)).sum::<u16>();
    let mut sum = blocks.iter().map(block_sum).fold(0, u16::wrapping_add);
    sum = rest.iter().fold(sum, |sum, &b| sum.wrapping_add(u16::from(b)));
    if profile.checksum_with_flag && profile.flag == Flag::Separate {
        sum = sum.wrapping_add(u16::from(FLAG));
    }
    if profile.checksum_negated {
        sum = sum.wrapping_neg();
    }
    match profile.checksum {
        Width::U8 => sum & 0xFF,
        Width::U16Le | Width::U16Be => sum,
    }
}
