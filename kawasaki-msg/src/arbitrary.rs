//! Messages in ASCII that fit a packet, messages of a table, and jobs of any kind.

use core::ops::RangeInclusive;
use std::format;
use std::string::String;
use std::vec::Vec;

use arbitrary::{Arbitrary, Error, Result, Unstructured};

use crate::dialect::{Dialect, Entry};
use crate::error::FieldError;
use crate::job::{FieldVisitor, Job, Unfit, VisitResult, Work};
use crate::marks::{SEPARATOR, is_mark};
use crate::message::Message;
use crate::params::Params;
use crate::role::{Role, Row};
use crate::text::Text;
use crate::value::Charset;

impl Message<'_> {
    /// Generates the bytes of a message in ASCII that fits a packet. Half of the names are those of the default table; each
    /// part ends at the first byte that it cannot have.
    ///
    /// # Errors
    /// The errors of `u`.
    pub fn arbitrary(u: &mut Unstructured<'_>) -> Result<Vec<u8>> {
        let mut free = Self::MAX_LEN - "<$$4096##>".len();
        let known = u.choose(Dialect::DEFAULT.entries())?.name.as_bytes();
        let name = if u.arbitrary()? { part(u, free, |byte| byte == SEPARATOR)? } else { &[] };
        let name = if name.is_empty() { known } else { name };
        free -= name.len();
        let header = if u.arbitrary()? { [b"$", part(u, free, |_| false)?].concat() } else { Vec::new() };
        free = free.saturating_sub(header.len());
        let data = part(u, free, |_| false)?;
        let length = format!("${}#", data.len());
        Ok([b"<", name, &header, length.as_bytes(), data, b"#>"].concat())
    }
}

impl Dialect {
    /// Returns a message of this table other than a job, with values in their ranges; optional values may be missing. Written
    /// by [`write`](Self::write), it is read again as the same.
    ///
    /// # Errors
    /// The errors of `u`.
    pub fn arbitrary(&self, u: &mut Unstructured<'_>) -> Result<(Role, Params)> {
        let entries: Vec<&Entry> = self.entries().iter().filter(|entry| entry.role != Role::Job).collect();
        let entry = u.choose(&entries)?;
        let mut params = Params::default();
        for field in entry.header.iter().chain(entry.fields) {
            if let Some(Row { range: (min, max), may_be_empty, .. }) = field.row()
                && (!may_be_empty || u.arbitrary()?)
            {
                params.set(*field, u.int_in_range(*min..=*max)?);
            }
        }
        Ok((entry.role, params))
    }
}

impl<W: Work> Job<W> {
    /// Generates a job whose fields are within these ranges, in ASCII.
    ///
    /// # Errors
    /// [`Error::IncorrectFormat`] when a range is empty, or the job refuses a value in its range, such as the code of an enum.
    pub fn arbitrary_within(u: &mut Unstructured<'_>, ranges: &W::Ranges) -> Result<Self> {
        let (order, number) = (u.int_in_range(1..=u16::MAX)?, u.int_in_range(1..=Dialect::MAX_NUMBER)?);
        let mut work = W::default();
        work.fields(ranges, &mut Filler(u)).map_err(|Unfit(())| Error::IncorrectFormat)?;
        Ok(Self { order, number, work })
    }
}

/// As [`Job::arbitrary_within`] the default ranges.
impl<'a, W: Work> Arbitrary<'a> for Job<W> {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        Self::arbitrary_within(u, &W::Ranges::default())
    }
}

/// Sets the fields of a job.
struct Filler<'u, 'a>(&'u mut Unstructured<'a>);

impl FieldVisitor for Filler<'_, '_> {
    fn decimal(&mut self, _: &str, value: &mut i32, _: u8, range: RangeInclusive<i32>) -> VisitResult {
        if range.is_empty() {
            return Err(Unfit(()));
        }
        *value = self.0.int_in_range(range).map_err(|_| Unfit(()))?;
        Ok(())
    }

    fn text<const N: usize>(
        &mut self,
        name: &str,
        text: &mut Text<N>,
        length: RangeInclusive<usize>,
    ) -> VisitResult {
        let (least, most) = (*length.start(), N.min(*length.end()));
        let of = |length| i32::try_from(length).map_err(|_| Unfit(()));
        let mut length = 0;
        self.decimal(name, &mut length, 0, of(least)?..=of(most)?)?;
        let character = |u: &mut Unstructured<'_>| {
            let byte = u.int_in_range(0..=0x7F)?;
            Ok(if is_mark(byte) { ' ' } else { char::from(byte) })
        };
        let made: Result<String> = (0..length).map(|_| character(self.0)).collect();
        *text = made.ok().as_deref().and_then(Text::new).ok_or(Unfit(()))?;
        Ok(())
    }

    fn refuse(&mut self, _: FieldError) -> Unfit {
        Unfit(())
    }
}

/// Generates text up to the first byte that a part of a message cannot have, which is omitted.
fn part<'a>(u: &mut Unstructured<'a>, free: usize, ends: impl Fn(u8) -> bool) -> Result<&'a [u8]> {
    let length = u.arbitrary_len::<u8>()?.min(free);
    let bytes = u.peek_bytes(length).unwrap_or_default();
    let is_end = |byte: &u8| ends(*byte) || Charset::Ascii.ends_text(*byte);
    let end = bytes.iter().position(is_end);
    let part = u.bytes(end.unwrap_or(length))?;
    u.bytes(usize::from(end.is_some()))?;
    Ok(part)
}
