//! Values wider than one register: 32-bit integers and reals over two words, and the scale of an assignment.

use crate::error::AssignmentError;

/// The order of the two registers of a 32-bit value. Within a register the high byte is always first on the wire.
///
/// The source does not state the order; public programs for FANUC controllers read the low word first ("CDAB").
/// [`OrderProbe`] finds it by watching a counter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum WordOrder {
    /// The first register holds bits 0 to 15.
    #[default]
    LowFirst,
    /// The first register holds bits 16 to 31.
    HighFirst,
}

impl WordOrder {
    /// Returns the 32 bits in two registers.
    #[inline]
    pub const fn join(self, words: [u16; 2]) -> u32 {
        let [first, second] = words;
        match self {
            Self::LowFirst => (second as u32) << 16 | first as u32,
            Self::HighFirst => (first as u32) << 16 | second as u32,
        }
    }

    /// Returns the two registers that contain these 32 bits.
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "each half is taken separately")]
    pub const fn split(self, bits: u32) -> [u16; 2] {
        let (high, low) = ((bits >> 16) as u16, bits as u16);
        match self {
            Self::LowFirst => [low, high],
            Self::HighFirst => [high, low],
        }
    }

    /// Returns the signed integer in two registers.
    #[inline]
    pub const fn i32(self, words: [u16; 2]) -> i32 {
        self.join(words).cast_signed()
    }

    /// Returns the real in two registers.
    #[inline]
    pub const fn f32(self, words: [u16; 2]) -> f32 {
        f32::from_bits(self.join(words))
    }
}

/// `$MULTIPLY` of an assignment: the form of a variable in a register or a pair of registers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "f32", into = "f32"))]
pub enum Multiply {
    /// 0: the variable as a 32-bit real in two registers.
    Real,
    /// 0.0001 to 10000: the variable times this, rounded to an integer of 16 or 32 bits.
    Scale(f32),
    /// −1: strings, alarms and program names, the first character in the high byte: see [`text`](crate::text).
    Text,
}

impl Multiply {
    /// Returns the meaning of the number.
    ///
    /// # Errors
    /// If a controller has no meaning for it.
    pub fn new(value: f32) -> Result<Self, AssignmentError> {
        let multiply = if value == 0.0 {
            Self::Real
        } else if value == -1.0 {
            Self::Text
        } else {
            Self::Scale(value)
        };
        multiply.check().map(|()| multiply)
    }

    /// Returns the number.
    pub const fn value(self) -> f32 {
        match self {
            Self::Real => 0.0,
            Self::Scale(scale) => scale,
            Self::Text => -1.0,
        }
    }

    pub(crate) fn check(self) -> Result<(), AssignmentError> {
        match self {
            Self::Scale(found) if !(0.0001..=10_000.0).contains(&found) => {
                Err(AssignmentError::Multiply { found })
            }
            _ => Ok(()),
        }
    }
}

impl TryFrom<f32> for Multiply {
    type Error = AssignmentError;

    fn try_from(value: f32) -> Result<Self, Self::Error> {
        Self::new(value)
    }
}

impl From<Multiply> for f32 {
    fn from(multiply: Multiply) -> Self {
        multiply.value()
    }
}

/// The form of a numeric variable in registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Kind {
    /// A signed integer in one register (`R[n]@1.1`).
    Int16,
    /// A signed integer in two registers.
    Int32,
    /// A real in two registers; its multiply is 0.
    Float32,
}

impl Kind {
    /// Returns the number of registers of the variable.
    pub const fn registers(self) -> u16 {
        match self {
            Self::Int16 => 1,
            Self::Int32 | Self::Float32 => 2,
        }
    }
}

/// A numeric variable in holding registers: its form for reads and writes.
///
/// ```
/// use fanuc_hmi_modbus::{typed::{Kind, Multiply, Number}, WordOrder};
///
/// let speed = Number { kind: Kind::Int32, multiply: Multiply::new(100.0)?, order: WordOrder::LowFirst };
/// assert_eq!(speed.write(-12.34)?, [0xFB2E, 0xFFFF]);
/// assert_eq!(speed.read([0xFB2E, 0xFFFF]), -12.34);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Number {
    /// Integer or real, one register or two.
    pub kind: Kind,
    /// The scale of an integer. A real, and a kind without a scale, is not scaled.
    pub multiply: Multiply,
    /// The order of the two registers.
    pub order: WordOrder,
}

impl Number {
    /// Returns the value in these registers. For a value of one register, the second is ignored.
    pub fn read(&self, words: [u16; 2]) -> f64 {
        let [first, _] = words;
        match self.kind {
            Kind::Int16 => f64::from(first.cast_signed()) / self.scale(),
            Kind::Int32 => f64::from(self.order.i32(words)) / self.scale(),
            Kind::Float32 => self.order.f32(words).into(),
        }
    }

    /// Returns the registers of a value; for a value of one register, the second is 0.
    ///
    /// # Errors
    /// If the value is not a number, or does not fit: a register holds −32768 to 32767 after multiplication.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the range was checked; a real is rounded on purpose"
    )]
    pub fn write(&self, value: f64) -> Result<[u16; 2], NumberError> {
        let scaled = libm::round(value * self.scale());
        let within = |least: f64, most: f64| {
            if (least..=most).contains(&scaled) {
                Ok(scaled)
            } else {
                Err(NumberError { value, least, most })
            }
        };
        match self.kind {
            Kind::Int16 => Ok([(within(i16::MIN.into(), i16::MAX.into())? as i16).cast_unsigned(), 0]),
            Kind::Int32 => {
                Ok(self.order.split((within(i32::MIN.into(), i32::MAX.into())? as i32).cast_unsigned()))
            }
            Kind::Float32 if value.abs() <= f32::MAX.into() => Ok(self.order.split((value as f32).to_bits())),
            Kind::Float32 => Err(NumberError { value, least: f32::MIN.into(), most: f32::MAX.into() }),
        }
    }

    fn scale(&self) -> f64 {
        match self.multiply {
            Multiply::Scale(scale) => scale.into(),
            Multiply::Real | Multiply::Text => 1.0,
        }
    }
}

/// A value that its registers cannot hold.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[error("{value} does not fit: the registers hold {least} to {most} after the multiply")]
#[non_exhaustive]
pub struct NumberError {
    /// The value that was given, before multiplication.
    pub value: f64,
    /// The least number that the registers hold.
    pub least: f64,
    /// The largest number that the registers hold.
    pub most: f64,
}

/// Finds the [`WordOrder`] of a controller by watching a counter in two registers that grows by small steps.
///
/// The word that changes from sample to sample is the low one. While both orders are still possible (the counter is at rest,
/// or both words changed at once), it returns no order.
///
/// ```
/// use fanuc_hmi_modbus::{typed::OrderProbe, WordOrder};
///
/// let mut probe = OrderProbe::default();
/// assert_eq!(probe.watch([0x86A0, 1]), None);
/// assert_eq!(probe.watch([0x86A1, 1]), None);
/// assert_eq!(probe.watch([0x86A3, 1]), Some(WordOrder::LowFirst));
/// ```
#[derive(Debug, Clone, Copy, Default)]
pub struct OrderProbe {
    last: Option<[u16; 2]>,
    low_first: u8,
    high_first: u8,
}

impl OrderProbe {
    /// The largest step between two samples that is evidence of an order: 4 s of a counter that steps every 8 ms.
    pub const MAX_STEP: u32 = 500;

    /// Takes the two registers of the counter; returns the order when it has two more steps as evidence than the other.
    pub fn watch(&mut self, words: [u16; 2]) -> Option<WordOrder> {
        if let Some(last) = self.last.replace(words) {
            let small = |order: WordOrder| {
                (1..=Self::MAX_STEP).contains(&order.join(words).wrapping_sub(order.join(last)))
            };
            self.low_first = self.low_first.saturating_add(small(WordOrder::LowFirst).into());
            self.high_first = self.high_first.saturating_add(small(WordOrder::HighFirst).into());
        }
        if self.low_first >= self.high_first.saturating_add(2) {
            Some(WordOrder::LowFirst)
        } else if self.high_first >= self.low_first.saturating_add(2) {
            Some(WordOrder::HighFirst)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_registers_mean_other_values_in_the_other_order() {
        assert_eq!(WordOrder::LowFirst.i32([0x86A0, 1]), 100_000);
        assert_eq!(WordOrder::HighFirst.i32([1, 0x86A0]), 100_000);
        assert_eq!(WordOrder::LowFirst.i32([0xFFFF, 0xFFFF]), -1);
        assert_eq!(WordOrder::LowFirst.f32([0xE979, 0x42F6]), 123.456);
        for order in [WordOrder::LowFirst, WordOrder::HighFirst] {
            assert_eq!(order.join(order.split(0x1234_5678)), 0x1234_5678);
        }
    }

    #[test]
    fn numbers_are_scaled_and_what_does_not_fit_is_refused_not_cut() {
        let number = |kind, scale| Number {
            kind,
            multiply: Multiply::new(scale).unwrap(),
            order: WordOrder::LowFirst,
        };
        let word = number(Kind::Int16, 1.0);
        assert_eq!(word.write(-32_768.0), Ok([0x8000, 0]));
        assert_eq!(word.write(32_767.4), Ok([0x7FFF, 0]));
        let error = word.write(32_768.0).unwrap_err();
        assert_eq!(error, NumberError { value: 32_768.0, least: -32_768.0, most: 32_767.0 });
        assert!(word.write(f64::NAN).is_err());
        assert_eq!(number(Kind::Int16, 0.5).write(246.0), Ok([123, 0]));
        assert_eq!(number(Kind::Int16, 0.5).read([123, 0]), 246.0);
        let long = number(Kind::Int32, 10_000.0);
        assert_eq!(long.write(214_748.364_7), Ok([0xFFFF, 0x7FFF]));
        assert!(long.write(214_748.364_8).is_err());
        assert_eq!(long.read([0xFFFF, 0x7FFF]), 214_748.364_7);
        let real = number(Kind::Float32, 0.0);
        assert_eq!(real.write(-50.0), Ok([0, 0xC248]));
        assert!(real.write(1e39).is_err() && real.write(f64::INFINITY).is_err());
    }

    #[test]
    fn a_multiply_is_0_or_minus_1_or_a_scale() {
        assert_eq!(Multiply::new(0.0), Ok(Multiply::Real));
        assert_eq!(Multiply::new(-1.0), Ok(Multiply::Text));
        for good in [0.0001, 1.0, 10_000.0] {
            assert_eq!(Multiply::new(good), Ok(Multiply::Scale(good)));
        }
        for bad in [0.000_09, 10_001.0, -2.0, f32::NAN] {
            assert!(Multiply::new(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn the_order_is_known_after_a_few_samples_whatever_it_is() {
        for order in [WordOrder::LowFirst, WordOrder::HighFirst] {
            for start in [0u32, 65_530, u32::MAX - 3] {
                let mut probe = OrderProbe::default();
                let seen = (0..6).find_map(|i| probe.watch(order.split(start.wrapping_add(2 * i))));
                assert_eq!(seen, Some(order), "{start}");
            }
        }
    }

    #[test]
    fn a_counter_that_is_at_rest_or_jumps_shows_no_order() {
        let mut probe = OrderProbe::default();
        for _ in 0..10 {
            assert_eq!(probe.watch([5, 5]), None);
        }
        for i in 0..10u16 {
            assert_eq!(probe.watch([i * 7, i * 7]), None);
        }
    }
}
