//! Payloads whose items fit, and tags that differ.

use std::vec::Vec;

use arbitrary::{Arbitrary, Error, Result, Unstructured};

use crate::frame::MAX_PAYLOAD;
use crate::payload::Payload;
use crate::profile::{Profile, Tags};

impl<'b> Payload<'b> {
    /// Writes the items that a fuzzer's bytes stand for into `buffer`. Most payloads are instructions: each a command word,
    /// mostly one of the default words, and the items of its parameters.
    ///
    /// # Errors
    /// [`Error::IncorrectFormat`] when `buffer` is too short for the first item.
    pub fn arbitrary(u: &mut Unstructured<'_>, buffer: &'b mut [u8], profile: &Profile) -> Result<Self> {
        let available = buffer.len().min(MAX_PAYLOAD);
        let mut payload = Self::new(buffer, profile);
        let mut kind = if u.ratio(1u8, 8)? { u.int_in_range(0..=4u8)? } else { 0 };
        loop {
            let free = available.saturating_sub(payload.as_bytes().len());
            let added = match kind {
                0 => payload.word(word(u)?),
                1 => payload.i16(&values(u, free)?),
                2 => payload.u8(&values(u, free)?),
                3 => payload.char(&values(u, free)?),
                _ => {
                    let mut numbers: Vec<f32> = values(u, free)?;
                    numbers.retain(|number| number.is_finite());
                    payload.f32(&numbers)
                }
            };
            if added.is_err() || !u.arbitrary::<bool>()? {
                break;
            }
            kind = u.int_in_range(0..=4)?;
        }
        if payload.as_bytes().is_empty() { Err(Error::IncorrectFormat) } else { Ok(payload) }
    }
}

/// Returns one of the default command words, or any word.
fn word(u: &mut Unstructured<'_>) -> Result<u16> {
    if u.ratio(7u8, 8)? { u.int_in_range(0x0100..=0x03FF) } else { u.arbitrary() }
}

/// Values of an item of at most `free` bytes.
fn values<'a, T: Arbitrary<'a>>(u: &mut Unstructured<'a>, free: usize) -> Result<Vec<T>> {
    let most = (free.saturating_sub(2).min(u.len()) / size_of::<T>()).min(255);
    (0..u.int_in_range(0..=most)?).map(|_| u.arbitrary()).collect()
}

/// The default tags in any order, or four others.
impl<'a> Arbitrary<'a> for Tags {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        let mut tags = [0xF0, 0xF1, 0xF2, 0xF3];
        for last in 1..tags.len() {
            tags.swap(last, u.choose_index(last + 1)?);
        }
        let [f32, i16, u8, char] = if u.ratio(1u8, 4)? { u.arbitrary()? } else { tags };
        Ok(Self::new(f32, i16, u8, char).unwrap_or_default())
    }
}
