//! Position registers: a position in 50 registers.

use crate::message::{Request, Words};
use crate::typed::WordOrder;

/// A position register PR\[n\], of an assignment with `$VAR_NAME` `PR[n]`, `$SIZE` 50 a register and `$MULTIPLY` 0.
///
/// One request reads or writes it whole. A controller stores it in one of the two forms, the one whose flag is set, and
/// computes the other one if it can. The order of the 50 registers is that of a public client program, that of the
/// configuration the one of a sample program for the vendor's PC interface (F/N, L/R, U/D, T/B, three turns); our source
/// shows neither.
///
/// ```
/// use fanuc_hmi_modbus::position::{Cartesian, PositionRegister};
/// use fanuc_hmi_modbus::WordOrder;
///
/// let position = PositionRegister {
///     cartesian: Some(Cartesian { xyzwpr: [500.0, 0.0, 300.0, 180.0, 0.0, 0.0], ..Cartesian::default() }),
///     user_frame: 1,
///     user_tool: 2,
///     ..PositionRegister::default()
/// };
/// let registers = position.to_registers(WordOrder::LowFirst);
/// assert_eq!(registers[..2], [0, 0x43FA]); // 500.0
/// assert_eq!(PositionRegister::from_registers(&registers, WordOrder::LowFirst), position);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct PositionRegister {
    /// Registers 1 to 25; `None` if register 26 marks them as empty.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub cartesian: Option<Cartesian>,
    /// Registers 27 to 44, J1 to J9 in degrees (or mm, for a linear axis); `None` if register 45 marks them as empty.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub joints: Option<[f32; 9]>,
    /// Register 46, the user frame.
    #[cfg_attr(feature = "serde", serde(default))]
    pub user_frame: i16,
    /// Register 47, the tool frame.
    #[cfg_attr(feature = "serde", serde(default))]
    pub user_tool: i16,
}

/// The Cartesian form.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Cartesian {
    /// Registers 1 to 12: X, Y, Z in mm and W, P, R in degrees.
    pub xyzwpr: [f32; 6],
    /// Registers 13 to 18: E1 to E3, in mm or degrees.
    #[cfg_attr(feature = "serde", serde(default))]
    pub external: [f32; 3],
    /// Registers 19 to 25: the solution of the arm.
    #[cfg_attr(feature = "serde", serde(default))]
    pub configuration: Configuration,
}

/// The solution of the arm that is meant: the `CONFIG` of a program's position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Configuration {
    /// Register 19: `F` (1), not `N` (0).
    pub flip: i16,
    /// Register 20: the arm to the left (1), not to the right (0). Six-axis arms have 0.
    pub left: i16,
    /// Register 21: `U` (1), not `D` (0).
    pub up: i16,
    /// Register 22: `T` (1), not `B` (0).
    pub front: i16,
    /// Registers 23 to 25: the turns of J4, J5 and J6.
    pub turns: [i16; 3],
}

impl Default for Configuration {
    /// Returns `N U T, 0, 0, 0`.
    fn default() -> Self {
        Self { flip: 0, left: 0, up: 1, front: 1, turns: [0; 3] }
    }
}

impl PositionRegister {
    /// The number of registers of a position register.
    pub const QUANTITY: u16 = 50;

    /// Returns the request that reads a position register; `address` is the PDU address of its first register.
    pub const fn request(address: u16) -> Request<'static> {
        Request::ReadHoldingRegisters { address, quantity: Self::QUANTITY }
    }

    /// Returns the position in the reply to [`request`](Self::request); `None` if there are fewer than 50 registers.
    pub fn from_words(words: &Words<'_>, order: WordOrder) -> Option<Self> {
        Some(Self::from_registers(&words.first_chunk()?, order))
    }

    /// Returns the position in these registers.
    pub fn from_registers(registers: &[u16; 50], order: WordOrder) -> Self {
        let (cartesian, rest) = registers.split_at(18);
        let (configuration, joints) = rest.split_at(8);
        let [x, y, z, w, p, r, e1, e2, e3] = reals(cartesian, order);
        let signed = |words: &[u16]| -> [i16; 8] {
            let mut values = [0; 8];
            values.iter_mut().zip(words).for_each(|(value, word)| *value = word.cast_signed());
            values
        };
        let [flip, left, up, front, t4, t5, t6, has_cartesian] = signed(configuration);
        let (joints, flags) = joints.split_at(18);
        let [has_joints, user_frame, user_tool, ..] = signed(flags);
        let turns = [t4, t5, t6];
        Self {
            cartesian: (has_cartesian != 0).then_some(Cartesian {
                xyzwpr: [x, y, z, w, p, r],
                external: [e1, e2, e3],
                configuration: Configuration { flip, left, up, front, turns },
            }),
            joints: (has_joints != 0).then(|| reals(joints, order)),
            user_frame,
            user_tool,
        }
    }

    /// Returns the registers of the position; the last three, which are undocumented, are 0.
    pub fn to_registers(&self, order: WordOrder) -> [u16; 50] {
        let mut registers = [0; 50];
        let Cartesian { xyzwpr, external, configuration } = self.cartesian.unwrap_or_default();
        let Configuration { flip, left, up, front, turns: [t4, t5, t6] } = match self.cartesian {
            Some(_) => configuration,
            None => Configuration { up: 0, front: 0, ..configuration },
        };
        let (cartesian, rest) = registers.split_at_mut(18);
        let (middle, rest) = rest.split_at_mut(8);
        let (joints, flags) = rest.split_at_mut(18);
        put(cartesian, xyzwpr.iter().chain(&external), order);
        let flag = i16::from(self.cartesian.is_some());
        put_signed(middle, &[flip, left, up, front, t4, t5, t6, flag]);
        put(joints, self.joints.unwrap_or_default().iter(), order);
        put_signed(flags, &[i16::from(self.joints.is_some()), self.user_frame, self.user_tool]);
        registers
    }
}

fn reals(words: &[u16], order: WordOrder) -> [f32; 9] {
    let mut values = [0.0; 9];
    for (value, words) in values.iter_mut().zip(words.chunks_exact(2)) {
        *value = words.first_chunk().map_or(0.0, |words| order.f32(*words));
    }
    values
}

fn put<'a>(words: &mut [u16], values: impl Iterator<Item = &'a f32>, order: WordOrder) {
    for (words, value) in words.chunks_exact_mut(2).zip(values) {
        words.copy_from_slice(&order.split(value.to_bits()));
    }
}

fn put_signed(words: &mut [u16], values: &[i16]) {
    for (word, value) in words.iter_mut().zip(values) {
        *word = value.cast_unsigned();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn both() -> PositionRegister {
        PositionRegister {
            cartesian: Some(Cartesian {
                xyzwpr: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
                external: [7.0, 8.0, 9.0],
                configuration: Configuration { flip: 1, left: 0, up: 1, front: 0, turns: [0, -1, 1] },
            }),
            joints: Some([10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0]),
            user_frame: 3,
            user_tool: -1,
        }
    }

    #[test]
    fn every_value_is_in_its_register() {
        let registers = both().to_registers(WordOrder::HighFirst);
        let real = |n: usize| f32::from_bits(u32::from(registers[n - 1]) << 16 | u32::from(registers[n]));
        let cartesian: [f32; 9] = core::array::from_fn(|k| real(1 + 2 * k));
        assert_eq!(cartesian, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
        assert_eq!(registers[18..26], [1, 0, 1, 0, 0, 0xFFFF, 1, 1], "19 to 26");
        let joints: [f32; 9] = core::array::from_fn(|k| real(27 + 2 * k));
        assert_eq!(joints, [10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0]);
        assert_eq!(registers[44..], [1, 3, 0xFFFF, 0, 0, 0], "45 to 50");
    }

    #[test]
    fn it_reads_as_it_was_written_in_either_order_and_form() {
        let cartesian = PositionRegister { joints: None, ..both() };
        let joints = PositionRegister { cartesian: None, ..both() };
        for position in [both(), cartesian, joints, PositionRegister::default()] {
            for order in [WordOrder::LowFirst, WordOrder::HighFirst] {
                assert_eq!(PositionRegister::from_registers(&position.to_registers(order), order), position);
            }
        }
        assert_eq!(PositionRegister::default().to_registers(WordOrder::LowFirst), [0; 50]);
    }
}
