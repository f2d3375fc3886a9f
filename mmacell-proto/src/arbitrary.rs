//! Numbers that fit their fields, and the poses of a device without axes.

use arbitrary::{Arbitrary, Error, Result, Unstructured};

use crate::pose::NoPose;

pub(crate) fn percent(u: &mut Unstructured<'_>) -> Result<u8> {
    u.int_in_range(0..=100)
}

/// Returns one of the few numbers that cameras, grippers and errors have, or any of 16 bits.
pub(crate) fn integer(u: &mut Unstructured<'_>) -> Result<i32> {
    if u.arbitrary()? { u.int_in_range(0..=3) } else { u.arbitrary::<i16>().map(Into::into) }
}

/// Always an error: a message with such a pose does not exist.
impl<'a> Arbitrary<'a> for NoPose {
    fn arbitrary(_: &mut Unstructured<'a>) -> Result<Self> {
        Err(Error::EmptyChoose)
    }
}
