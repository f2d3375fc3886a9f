use isra_ball::Packet;
use val2_alter::{AXES, Accumulation, Limits, Mode};

use super::filter::Filter;

/// What the ball's forces ask of the robot. Signs and units of both ends are open in the source, so try it slowly.
#[derive(Debug, Clone, Copy)]
pub struct Mapping {
    /// The ball's TRA, ROT and DOM keys, in software.
    pub filter: Filter,
    /// Forces up to this count as none: the springs never stand quite still.
    pub deadband: u8,
    /// Cumulative ALTER: the units a cycle that full force asks for; negative turns an axis round.
    pub speed: [i16; AXES],
    /// Non-cumulative ALTER: the units off the path that full force asks for.
    pub reach: [i16; AXES],
}

impl Mapping {
    /// Full force asks for `percent` of the highest velocity; or for 50 mm and 10° off the path.
    pub fn for_limits(limits: &Limits, percent: u16) -> Self {
        let speed = limits
            .velocity
            .map(|most| i16::try_from(u32::from(most) * u32::from(percent) / 100).unwrap_or(i16::MAX));
        Self { filter: Filter::default(), deadband: 4, speed, reach: [1600, 1600, 1600, 1820, 1820, 1820] }
    }

    /// What a packet asks for, in units of ALTER's words.
    pub fn target(&self, packet: &Packet, mode: Mode) -> [i16; AXES] {
        let full = match mode.accumulation() {
            Accumulation::Cumulative => self.speed,
            Accumulation::NonCumulative => self.reach,
        };
        let mut target = self.filter.apply(packet.axes()).map(|axis| i32::from(self.without_play(axis)));
        for (axis, full) in target.iter_mut().zip(full) {
            *axis = *axis * i32::from(full) / i32::from(i8::MAX);
        }
        target.map(|axis| i16::try_from(axis).unwrap_or(if axis < 0 { i16::MIN } else { i16::MAX }))
    }

    fn without_play(&self, axis: i8) -> i8 {
        if axis.unsigned_abs() <= self.deadband { 0 } else { axis }
    }
}

#[cfg(test)]
mod tests {
    use isra_ball::{Keys, Status};

    use super::*;

    #[test]
    fn full_force_asks_for_the_full_amount_and_trembling_for_nothing() {
        let mapping = Mapping { deadband: 3, ..Mapping::for_limits(&Limits::GENTLE, 150) };
        let packet = Packet {
            sensor_type: 0,
            sensor: 0,
            status: Status::Fresh,
            force: [127, -128, 3],
            moment: [-3, 64, -127],
            keys: Keys::NONE,
        };
        assert_eq!(mapping.target(&packet, Mode::CUMULATIVE_23), [135, -136, 0, 0, 113, -225]);
        assert_eq!(mapping.target(&packet, Mode::NON_CUMULATIVE_22), [1600, -1612, 0, 0, 917, -1820]);
    }
}
