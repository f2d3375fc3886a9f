use std::borrow::Cow;

use crate::error::Error;

/// The most bytes of a string.
pub const MAX_TEXT_LEN: usize = 255;

/// The greatest index.
pub(crate) const HIGHEST_INDEX: f32 = 9999.0;

/// X, Y, Z in millimetres and O, A, T in degrees.
pub type Pose = [f32; 6];

pub(crate) type Bytes = Vec<u8>;

/// The contents of a variable.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum VariableContents {
    Real(f32),
    Text(Bytes),
    Pose(Pose),
}

/// The result of an expression.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Value<'a> {
    Real(f32),
    Text(Cow<'a, [u8]>),
    Pose(Pose),
}

impl Value<'_> {
    pub(crate) const fn truth(is_true: bool) -> Self {
        Value::Real(if is_true { -1.0 } else { 0.0 })
    }

    pub(crate) fn real(&self) -> Result<f32, Error> {
        if let Value::Real(real) = self { Ok(*real) } else { Err(Error::Type) }
    }

    pub(crate) fn is_true(&self) -> Result<bool, Error> {
        self.real().map(|real| real != 0.0)
    }

    pub(crate) fn pose(&self) -> Result<Pose, Error> {
        if let Value::Pose(pose) = self { Ok(*pose) } else { Err(Error::Type) }
    }

    pub(crate) fn text(&self) -> Result<&[u8], Error> {
        if let Value::Text(text) = self { Ok(text) } else { Err(Error::Type) }
    }

    pub(crate) fn into_stored(self) -> VariableContents {
        match self {
            Value::Real(real) => VariableContents::Real(real),
            Value::Text(text) => VariableContents::Text(text.into_owned()),
            Value::Pose(pose) => VariableContents::Pose(pose),
        }
    }
}

impl VariableContents {
    pub(crate) fn value(&self) -> Value<'_> {
        match self {
            VariableContents::Real(real) => Value::Real(*real),
            VariableContents::Text(text) => Value::Text(Cow::Borrowed(text)),
            VariableContents::Pose(pose) => Value::Pose(*pose),
        }
    }
}

/// Returns a whole number from 0 on.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked before")]
pub(crate) fn whole(real: f32, most: f32) -> Option<usize> {
    ((0.0..=most).contains(&real) && real.fract() == 0.0).then_some(real as usize)
}

/// Writes a number as `PRINT` and `$ENCODE` do: a whole number without a point, otherwise seven digits.
pub(crate) fn decimal(real: f32) -> String {
    if real.fract() == 0.0 && real.abs() < 1e7 { format!("{real:.0}") } else { format!("{real:.6e}") }
}

/// Returns the number at the beginning of a string, after any blanks; 0 if there is no number.
pub(crate) fn leading_number(text: &[u8]) -> f32 {
    let text: String = text.trim_ascii_start().iter().map(|byte| char::from(*byte)).collect();
    let mut end = 0;
    let (mut digits, mut point) = (false, false);
    for (i, c) in text.char_indices() {
        match c {
            '0'..='9' => digits = true,
            '-' | '+' if i == 0 => {}
            '.' if !point => point = true,
            _ => break,
        }
        end = i + 1;
    }
    let number = text.get(..end).unwrap_or_default();
    if digits { number.parse().unwrap_or(0.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_and_read_as_the_manual_does() {
        for (real, text) in [(0.0, "0"), (50.0, "50"), (-9_999_999.0, "-9999999"), (65535.0, "65535")] {
            assert_eq!(decimal(real), text);
            assert_eq!(leading_number(text.as_bytes()), real);
        }
        for (text, real) in [(" 7", 7.0), ("12x", 12.0), ("", 0.0), ("x", 0.0), ("-", 0.0), ("1.5$2", 1.5)] {
            assert_eq!(leading_number(text.as_bytes()), real, "{text:?}");
        }
        assert_eq!(
            (whole(3.0, 9.0), whole(3.5, 9.0), whole(-1.0, 9.0), whole(10.0, 9.0)),
            (Some(3), None, None, None)
        );
    }
}
