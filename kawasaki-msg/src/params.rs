//! The values of a message that the sessions use.

use crate::number::Fault;
use crate::role::{Field, Row};
use crate::value::Values;
use crate::writer::Writer;

/// The values of a message by their fields, in any sequence of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Params {
    /// The value of each field; 0 for an absent one.
    values: [i32; Field::VALUES],
    /// A bit for each field that is present.
    there: u8,
}

impl Params {
    /// Returns the value of a field; `None` if it is absent or empty.
    #[inline]
    pub fn get(&self, field: Field) -> Option<i32> {
        let index = field.row()?.index;
        self.values.get(index).copied().filter(|_| self.there >> index & 1 == 1)
    }

    /// Sets the value of a field; ignores a field that the sessions do not use.
    #[inline]
    pub fn set(&mut self, field: Field, value: i32) {
        if let Some(row) = field.row() {
            self.store(row, value);
        }
    }

    #[inline(always)]
    fn store(&mut self, row: &Row, value: i32) {
        if let Some(place) = self.values.get_mut(row.index) {
            *place = value;
            self.there |= 1 << row.index;
        }
    }

    /// Returns these values and one more.
    #[must_use]
    pub fn with(mut self, field: Field, value: impl Into<Option<u16>>) -> Self {
        if let Some(value) = value.into() {
            self.set(field, i32::from(value));
        }
        self
    }

    /// Returns the value of a field that counts something; `None` if it is absent or not a `u16`.
    pub fn number(&self, field: Field) -> Option<u16> {
        self.get(field).and_then(|value| u16::try_from(value).ok())
    }

    /// Returns the value of a field that counts something; 0 if it is absent.
    pub(crate) fn or_zero(&self, field: Field) -> u16 {
        self.number(field).unwrap_or(0)
    }

    /// Sets the value of a field that is absent.
    pub(crate) fn add(&mut self, field: Field, value: u16) {
        if self.get(field).is_none() {
            self.set(field, value.into());
        }
    }

    /// Stores the next value as that of a field.
    #[inline(always)]
    pub(crate) fn read(&mut self, field: &Field, values: &mut Values<'_>) -> Result<(), ValueFault> {
        let Some(row) = field.row() else { return Self::skip(field, values) };
        if row.may_be_empty && values.skip_empty() {
            return Ok(());
        }
        let (min, max) = row.range;
        let found = values.number(0).map_err(|fault| match fault {
            Fault::Missing => ValueFault::Missing,
            Fault::NotANumber | Fault::TooPrecise => ValueFault::NotANumber,
        })?;
        if found < min || max < found {
            return Err(ValueFault::OutOfRange { found, min, max });
        }
        self.store(row, found);
        Ok(())
    }

    /// Skips a value that the sessions do not use.
    fn skip(field: &Field, values: &mut Values<'_>) -> Result<(), ValueFault> {
        let value = values.text().ok_or(ValueFault::Missing)?;
        match field {
            Field::Constant(text) if value != *text => Err(ValueFault::Constant),
            _ => Ok(()),
        }
    }

    /// Writes the value of a field, or an empty value if it is absent.
    #[inline]
    pub(crate) fn write(&self, field: Field, writer: &mut Writer<'_>) {
        match (field, self.get(field)) {
            (Field::Constant(text), _) => writer.text(text),
            (_, Some(number)) => writer.number(number, 0),
            (_, None) => writer.empty(),
        }
    }
}

/// The reason that a value does not fit its field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ValueFault {
    Missing,
    Constant,
    NotANumber,
    OutOfRange { found: i32, min: i32, max: i32 },
}
