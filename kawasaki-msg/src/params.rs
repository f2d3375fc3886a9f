//! The values of a message that the sessions use.

use crate::number::Fault;
use crate::role::{Field, Row};
use crate::value::Values;
use crate::writer::Writer;

/// The values of a message by what they are, in whatever sequence the table puts them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Params {
    /// 0 for each that is not there.
    values: [i32; Field::VALUES],
    /// A bit for each that is there.
    there: u8,
}

impl Params {
    /// The value of a field; `None` when the message has none or has it empty.
    #[inline]
    pub fn get(&self, field: Field) -> Option<i32> {
        let index = field.row()?.index;
        self.values.get(index).copied().filter(|_| self.there >> index & 1 == 1)
    }

    /// Sets the value of a field; a field that the sessions do not use has none.
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

    /// These values and one more.
    #[must_use]
    pub fn with(mut self, field: Field, value: impl Into<Option<u16>>) -> Self {
        if let Some(value) = value.into() {
            self.set(field, i32::from(value));
        }
        self
    }

    /// The value of a field that counts something; `None` also when it is no `u16`.
    pub fn number(&self, field: Field) -> Option<u16> {
        self.get(field).and_then(|value| u16::try_from(value).ok())
    }

    /// The value of a field that counts something; 0 if the message has none.
    pub(crate) fn or_zero(&self, field: Field) -> u16 {
        self.number(field).unwrap_or(0)
    }

    /// Sets the value of a field that has none.
    pub(crate) fn add(&mut self, field: Field, value: u16) {
        if self.get(field).is_none() {
            self.set(field, value.into());
        }
    }

    /// Stores the next value, which is that of a field.
    #[inline(always)]
    pub(crate) fn read(&mut self, field: &Field, values: &mut Values<'_>) -> Result<(), Misfit> {
        let Some(row) = field.row() else { return Self::skip(field, values) };
        if row.may_be_empty && values.skip_empty() {
            return Ok(());
        }
        let (min, max) = row.range;
        let found = values.number(0).map_err(|fault| match fault {
            Fault::Missing => Misfit::Missing,
            Fault::NotANumber | Fault::TooPrecise => Misfit::NotANumber,
        })?;
        if found < min || max < found {
            return Err(Misfit::OutOfRange { found, min, max });
        }
        self.store(row, found);
        Ok(())
    }

    /// Reads a value that the sessions do not use.
    fn skip(field: &Field, values: &mut Values<'_>) -> Result<(), Misfit> {
        let value = values.text().ok_or(Misfit::Missing)?;
        match field {
            Field::Constant(text) if value != *text => Err(Misfit::Constant),
            _ => Ok(()),
        }
    }

    /// Writes the value of a field, which is empty without one.
    #[inline]
    pub(crate) fn write(&self, field: Field, writer: &mut Writer<'_>) {
        match (field, self.get(field)) {
            (Field::Constant(text), _) => writer.text(text),
            (_, Some(number)) => writer.number(number, 0),
            (_, None) => writer.empty(),
        }
    }
}

/// Why a value is not that of its field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Misfit {
    Missing,
    Constant,
    NotANumber,
    OutOfRange { found: i32, min: i32, max: i32 },
}
