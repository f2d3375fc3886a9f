//! The telemetry block: the values that the background task of the source writes to `R[1]` to `R[19]`, in 37 registers (Table
//! 2).

use crate::message::{Request, Words};
use crate::typed::{Kind, WordOrder};

/// One sample of the background task, every 8 ms (Table 2): 19 values in 37 holding registers from PDU address 0.
///
/// The velocities and the rate of the quaternion are the controller's own: it divides the difference of two samples by
/// a fixed 8 ms. The first sample after its start holds none, and its quaternion jumps in sign where `Q_1` passes zero.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct TelemetryBlock {
    /// `Life counter`, `R[1]`: one more at every run of the task; wraps at 2³².
    pub life_counter: u32,
    /// `Override`, `R[2]`, in percent: the only value of one register.
    #[cfg_attr(feature = "serde", serde(rename = "override"))]
    pub override_percent: i16,
    /// `POS_X`, `POS_Y`, `POS_Z`, `R[3]` to `R[5]`, in mm, in the world frame.
    pub position: [f32; 3],
    /// `POS_W`, `POS_P`, `POS_R`, `R[6]` to `R[8]`, in degrees about the fixed axes X, Y, Z.
    pub wpr: [f32; 3],
    /// `Q_1` to `Q_4`, `R[9]` to `R[12]`: w, x, y, z, with w never negative.
    pub quaternion: [f32; 4],
    /// `SPD_X`, `SPD_Y`, `SPD_Z`, `R[13]` to `R[15]`, in mm/s.
    pub velocity: [f32; 3],
    /// `SPD_Q1` to `SPD_Q4`, `R[16]` to `R[19]`, per second.
    pub quaternion_rate: [f32; 4],
}

impl TelemetryBlock {
    /// The PDU address of the block's first holding register.
    pub const ADDRESS: u16 = 0;
    /// The number of registers of the block: one request reads them all.
    pub const QUANTITY: u16 = 37;

    /// The contents of the block's registers, in their order: every row of Table 2.
    pub const FIELDS: [Field; 19] = [
        Field { name: "Life counter", register: 1, address: 0, kind: Kind::Int32 },
        Field { name: "Override", register: 2, address: 2, kind: Kind::Int16 },
        Field { name: "POS_X", register: 3, address: 3, kind: Kind::Float32 },
        Field { name: "POS_Y", register: 4, address: 5, kind: Kind::Float32 },
        Field { name: "POS_Z", register: 5, address: 7, kind: Kind::Float32 },
        Field { name: "POS_W", register: 6, address: 9, kind: Kind::Float32 },
        Field { name: "POS_P", register: 7, address: 11, kind: Kind::Float32 },
        Field { name: "POS_R", register: 8, address: 13, kind: Kind::Float32 },
        Field { name: "Q_1", register: 9, address: 15, kind: Kind::Float32 },
        Field { name: "Q_2", register: 10, address: 17, kind: Kind::Float32 },
        Field { name: "Q_3", register: 11, address: 19, kind: Kind::Float32 },
        Field { name: "Q_4", register: 12, address: 21, kind: Kind::Float32 },
        Field { name: "SPD_X", register: 13, address: 23, kind: Kind::Float32 },
        Field { name: "SPD_Y", register: 14, address: 25, kind: Kind::Float32 },
        Field { name: "SPD_Z", register: 15, address: 27, kind: Kind::Float32 },
        Field { name: "SPD_Q1", register: 16, address: 29, kind: Kind::Float32 },
        Field { name: "SPD_Q2", register: 17, address: 31, kind: Kind::Float32 },
        Field { name: "SPD_Q3", register: 18, address: 33, kind: Kind::Float32 },
        Field { name: "SPD_Q4", register: 19, address: 35, kind: Kind::Float32 },
    ];

    /// Returns the one request that reads the block.
    pub const fn request() -> Request<'static> {
        Request::ReadHoldingRegisters { address: Self::ADDRESS, quantity: Self::QUANTITY }
    }

    /// Returns the block in the reply to [`request`](Self::request); `None` if there are fewer than 37 registers.
    pub fn from_words(words: &Words<'_>, order: WordOrder) -> Option<Self> {
        Some(Self::from_registers(&words.first_chunk()?, order))
    }

    /// Returns the block in these registers.
    pub fn from_registers(registers: &[u16; 37], order: WordOrder) -> Self {
        let mut reals = [0f32; 17];
        let (head, tail) = registers.split_at(3);
        for (real, words) in reals.iter_mut().zip(tail.chunks_exact(2)) {
            *real = words.first_chunk().map_or(0.0, |words| order.f32(*words));
        }
        let [x, y, z, w, p, r, q1, q2, q3, q4, vx, vy, vz, d1, d2, d3, d4] = reals;
        let [counter @ .., percent] = head.first_chunk::<3>().copied().unwrap_or_default();
        Self {
            life_counter: order.join(counter),
            override_percent: percent.cast_signed(),
            position: [x, y, z],
            wpr: [w, p, r],
            quaternion: [q1, q2, q3, q4],
            velocity: [vx, vy, vz],
            quaternion_rate: [d1, d2, d3, d4],
        }
    }

    /// Returns the registers of the block.
    pub fn to_registers(&self, order: WordOrder) -> [u16; 37] {
        let mut registers = [0u16; 37];
        let (head, tail) = registers.split_at_mut(3);
        let [first, second] = order.split(self.life_counter);
        head.copy_from_slice(&[first, second, self.override_percent.cast_unsigned()]);
        let reals = self.position.iter().chain(&self.wpr).chain(&self.quaternion);
        let reals = reals.chain(&self.velocity).chain(&self.quaternion_rate);
        for (words, real) in tail.chunks_exact_mut(2).zip(reals) {
            words.copy_from_slice(&order.split(real.to_bits()));
        }
        registers
    }
}

/// A row of Table 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// The source's name of the value.
    pub name: &'static str,
    /// The numeric register R\[n\] of the value.
    pub register: u16,
    /// The PDU address of the value's first holding register.
    pub address: u16,
    /// The form of the value in these registers.
    pub kind: Kind,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::typed::{Multiply, Number};

    #[test]
    fn the_rows_tile_the_37_registers_and_name_what_the_block_reads() {
        let registers: [u16; 37] = core::array::from_fn(|i| 0x4000 + u16::try_from(i).unwrap());
        let block = TelemetryBlock::from_registers(&registers, WordOrder::LowFirst);
        let reals = block.position.iter().chain(&block.wpr).chain(&block.quaternion);
        let reals = reals.chain(&block.velocity).chain(&block.quaternion_rate).map(|real| f64::from(*real));
        let whole = [f64::from(block.life_counter), f64::from(block.override_percent)];
        let mut next = TelemetryBlock::ADDRESS;
        for (row, value) in TelemetryBlock::FIELDS.iter().zip(whole.into_iter().chain(reals)) {
            assert_eq!(row.address, next, "{}", row.name);
            next += row.kind.registers();
            let words = [0, 1].map(|i| registers.get(usize::from(row.address) + i).copied().unwrap_or(0));
            let number =
                Number { kind: row.kind, multiply: Multiply::Scale(1.0), order: WordOrder::LowFirst };
            assert_eq!(number.read(words), value, "{}", row.name);
        }
        assert_eq!(next, TelemetryBlock::QUANTITY);
    }

    #[test]
    fn the_worked_reply_holds_the_values_that_it_was_made_from() {
        let block = TelemetryBlock {
            life_counter: 100_000,
            override_percent: 100,
            position: [123.456, -50.0, 300.25],
            wpr: [180.0, 0.0, 45.0],
            quaternion: [0.0, 0.923_879_5, 0.382_683_4, 0.0],
            velocity: [12.5, 0.0, -3.75],
            quaternion_rate: [0.0, 0.01, -0.02, 0.0],
        };
        let registers = block.to_registers(WordOrder::LowFirst);
        assert_eq!(registers[..5], [0x86A0, 0x0001, 0x0064, 0xE979, 0x42F6]);
        for order in [WordOrder::LowFirst, WordOrder::HighFirst] {
            assert_eq!(TelemetryBlock::from_registers(&block.to_registers(order), order), block);
        }
    }
}
