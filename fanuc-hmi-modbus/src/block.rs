//! The telemetry block: what the background task of the source writes to `R[1]` to `R[19]`, in 37 registers (Table 2).

use crate::typed::WordOrder;

/// One sample of the background task, every 8 ms (Table 2): 19 values in 37 holding registers from PDU address 0.
///
/// The velocities and the rate of the quaternion are the controller's own: it divides the difference of two samples by
/// a fixed 8 ms. The first sample after its start holds none, and its quaternion jumps in sign where `Q_1` passes zero.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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
    /// The PDU address of its first holding register.
    pub const ADDRESS: u16 = 0;
    /// How many registers it takes: one request reads them all.
    pub const QUANTITY: u16 = 37;

    /// The block in these registers.
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

    /// The registers that hold the block.
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

#[cfg(test)]
mod tests {
    use super::*;

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
