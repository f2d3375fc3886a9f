//! Words to millimetres and degrees, and back (§3.3.2).

use crate::error::EncodeError;

/// The scaling of a robot's ALTER values: `millimetres = word / per_mm`, `degrees = word / per_degree`.
///
/// ```
/// use val2_alter::{EncodeError, Scale};
///
/// let scale = Scale::PUMA_562;
/// assert_eq!(scale.translation(2.5), Ok(80));
/// assert_eq!(scale.rotation(1.0), Ok(182));
/// assert_eq!(scale.translation(1024.0), Err(EncodeError::Range { found: 32768 }));
/// assert_eq!(scale.translation_saturating(1024.0), 32767);
/// assert_eq!(scale.millimetres(-80), -2.5);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// The number of units in a millimetre.
    pub per_mm: f64,
    /// The number of units in a degree.
    pub per_degree: f64,
}

impl Scale {
    /// The scaling of the source's robot: 32 units a millimetre (±1024 mm), 65536/360 a degree (±180°). The source prints
    /// 182.044 and 182.0444, which are this number, and calls it specific to the robot.
    pub const PUMA_562: Self = Self { per_mm: 32.0, per_degree: 65536.0 / 360.0 };

    /// Returns the nearest word to a length in mm.
    ///
    /// # Errors
    /// Outside ±1024 mm, at 32 units a mm; or no number.
    pub fn translation(&self, mm: f64) -> Result<i16, EncodeError> {
        word(mm * self.per_mm)
    }

    /// Returns the nearest word to an angle in degrees.
    ///
    /// # Errors
    /// Outside ±180°, at 65536/360 units a degree; or no number.
    pub fn rotation(&self, degrees: f64) -> Result<i16, EncodeError> {
        word(degrees * self.per_degree)
    }

    /// Converts as [`Scale::translation`] does, but values that are too large become the largest one, and NaN becomes zero.
    pub fn translation_saturating(&self, mm: f64) -> i16 {
        word_saturating(mm * self.per_mm)
    }

    /// Converts as [`Scale::rotation`] does, but values that are too large become the largest one, and NaN becomes zero.
    pub fn rotation_saturating(&self, degrees: f64) -> i16 {
        word_saturating(degrees * self.per_degree)
    }

    /// Returns the length that a word stands for.
    pub fn millimetres(&self, word: i16) -> f64 {
        f64::from(word) / self.per_mm
    }

    /// Returns the angle that a word stands for.
    pub fn degrees(&self, word: i16) -> f64 {
        f64::from(word) / self.per_degree
    }
}

impl Default for Scale {
    fn default() -> Self {
        Self::PUMA_562
    }
}

fn word(units: f64) -> Result<i16, EncodeError> {
    let found = rounded(units);
    if units.is_nan() {
        return Err(EncodeError::Range { found: i32::MAX });
    }
    i16::try_from(found).map_err(|_| EncodeError::Range { found })
}

fn word_saturating(units: f64) -> i16 {
    i16::try_from(rounded(units)).unwrap_or(if units < 0.0 { i16::MIN } else { i16::MAX })
}

/// Rounds to the nearest whole number, halves away from zero.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a float saturates when cast to an integer, and NaN gives 0"
)]
fn rounded(units: f64) -> i32 {
    (units + if units < 0.0 { -0.5 } else { 0.5 }) as i32
}
