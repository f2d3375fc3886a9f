//! Values that can be written by the default [`Rules`](crate::Rules), and are read again as the same.

pub(crate) mod texts;

use alloc::string::String;
use alloc::vec::Vec;

use arbitrary::{Arbitrary, Result, Unstructured};

use self::texts::{list, options, register, text};
use crate::instruction::Instruction;
use crate::motion::{Motion, MotionKind, Speed, SpeedUnit};

impl<'a> Arbitrary<'a> for Speed {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        Ok(match u.int_in_range(0..=3u8)? {
            0 => Self::Register { register: register(u)?, unit: u.arbitrary()? },
            1 => Self::Named(text(u, b"abcdefghijklmnopqrstuvwxyz_", 1..=12)?),
            form => {
                let unit: SpeedUnit = u.arbitrary()?;
                let most = if unit == SpeedUnit::Percent { 100 } else { 100_000 };
                let value = match form {
                    2 => u.int_in_range(1..=most)?.into(),
                    _ => f64::from(u.int_in_range(1..=1000 * most)?) / 1000.0,
                };
                Self::Fixed { value, unit }
            }
        })
    }
}

impl<'a> Arbitrary<'a> for Motion {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        let speed: Speed = u.arbitrary()?;
        let mut kind: MotionKind = u.arbitrary()?;
        match speed.unit() {
            Some(unit) if !unit.fits(kind) && unit == SpeedUnit::Percent => kind = MotionKind::Joint,
            Some(unit) if !unit.fits(kind) => kind = MotionKind::Linear,
            _ => {}
        }
        let is_circular = kind == MotionKind::Circular;
        Ok(Self {
            kind,
            via: if is_circular { Some(u.arbitrary()?) } else { None },
            via_options: if is_circular { options(u, 1)? } else { String::new() },
            target: u.arbitrary()?,
            speed,
            termination: u.arbitrary()?,
            options: options(u, 3)?,
        })
    }
}

/// Generates instructions. The first one is not a line of a block, because no motion precedes it.
pub(crate) fn instructions(u: &mut Unstructured<'_>) -> Result<Vec<Instruction>> {
    let mut instructions: Vec<_> = list::<0, 32, _>(u)?;
    if let Some(first @ Instruction::Nested(_)) = instructions.first_mut() {
        *first = Instruction::Empty;
    }
    Ok(instructions)
}
