//! Fixed point: the last digit on the wire is the unit in code, so that nothing is lost on the way.

/// A length in micrometres, the last digit of the field `Sxxx.yyy` (§4): ±999.999 mm.
///
/// Any `i32` is possible; encoding rejects a value that does not fit the field.
///
/// ```
/// use mmacell_proto::Length;
/// assert_eq!(Length::from_mm(5.999).um(), 5999);
/// assert_eq!(Length::from_um(-2000).mm(), -2.0);
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Length(#[cfg_attr(feature = "arbitrary", arbitrary(with = coordinate))] i32);

impl Length {
    /// The largest length that fits its field; the smallest is its negative.
    pub const MAX: Self = Self(999_999);

    /// Creates a length of this many micrometres.
    pub const fn from_um(um: i32) -> Self {
        Self(um)
    }

    /// Returns the nearest length to this many millimetres, halves away from zero. A value that is not a number, or is too
    /// large for any length, becomes a length that encoding rejects.
    pub fn from_mm(mm: f64) -> Self {
        Self(nearest(mm * 1000.0))
    }

    /// Micrometres.
    pub const fn um(self) -> i32 {
        self.0
    }

    /// Millimetres: prints with at most three decimals.
    pub fn mm(self) -> f64 {
        f64::from(self.0) / 1000.0
    }
}

/// An angle in tenths of a milliradian, the last digit of the field `Sxx.yyyy` (§4): ±99.9999 rad.
///
/// Any `i32` is possible; encoding rejects a value that does not fit the field.
///
/// ```
/// use mmacell_proto::Angle;
/// assert_eq!(Angle::from_rad(-1.2322).tenths_mrad(), -12322);
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Angle(#[cfg_attr(feature = "arbitrary", arbitrary(with = coordinate))] i32);

impl Angle {
    /// The largest angle that fits its field; the smallest is its negative.
    pub const MAX: Self = Self(999_999);

    /// Creates an angle of this many tenths of a milliradian (0.0057° each).
    pub const fn from_tenths_mrad(tenths: i32) -> Self {
        Self(tenths)
    }

    /// Returns the nearest angle to this many radians, halves away from zero. A value that is not a number, or is too large
    /// for any angle, becomes an angle that encoding rejects.
    pub fn from_rad(rad: f64) -> Self {
        Self(nearest(rad * 10_000.0))
    }

    /// Tenths of a milliradian.
    pub const fn tenths_mrad(self) -> i32 {
        self.0
    }

    /// Radians: prints with at most four decimals.
    pub fn rad(self) -> f64 {
        f64::from(self.0) / 10_000.0
    }
}

/// Generates a number that fits its field.
#[cfg(feature = "arbitrary")]
fn coordinate(u: &mut arbitrary::Unstructured<'_>) -> arbitrary::Result<i32> {
    let most = Length::MAX.um();
    u.int_in_range(-most..=most)
}

/// Rounds to the nearest `i32`. Not a number becomes the smallest `i32`, never 0: a robot must not move to its origin
/// because a sum went wrong.
fn nearest(value: f64) -> i32 {
    if value.is_nan() {
        return i32::MIN;
    }
    #[expect(clippy::cast_possible_truncation, reason = "`as` saturates, and the ends are refused on encode")]
    let nearest = (value + 0.5_f64.copysign(value)) as i32;
    nearest
}

#[cfg(feature = "serde")]
mod serde_impls {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::{Angle, Length};

    impl Serialize for Length {
        fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            serializer.serialize_f64(self.mm())
        }
    }

    impl<'de> Deserialize<'de> for Length {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            f64::deserialize(deserializer).map(Self::from_mm)
        }
    }

    impl Serialize for Angle {
        fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            serializer.serialize_f64(self.rad())
        }
    }

    impl<'de> Deserialize<'de> for Angle {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            f64::deserialize(deserializer).map(Self::from_rad)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_rounded_away_from_zero() {
        assert_eq!(Length::from_mm(0.0015).um(), 2);
        assert_eq!(Length::from_mm(-0.0015).um(), -2);
        assert_eq!(Angle::from_rad(0.00025).tenths_mrad(), 3);
        assert_eq!(Angle::from_rad(-0.000_24).tenths_mrad(), -2);
    }

    #[test]
    fn every_length_survives_the_way_through_millimetres() {
        for um in (-999_999..=999_999).step_by(7) {
            assert_eq!(Length::from_mm(Length::from_um(um).mm()).um(), um);
            assert_eq!(Angle::from_rad(Angle::from_tenths_mrad(um).rad()).tenths_mrad(), um);
        }
    }

    #[test]
    fn what_is_no_length_is_never_the_origin() {
        assert_eq!(Length::from_mm(f64::NAN).um(), i32::MIN);
        assert_eq!(Length::from_mm(f64::INFINITY).um(), i32::MAX);
        assert_eq!(Angle::from_rad(f64::NEG_INFINITY).tenths_mrad(), i32::MIN);
    }
}
