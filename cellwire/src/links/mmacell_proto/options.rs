//! The settings of the link: its dialect, and both ends.

use mmacell_proto::DeviceConfig;

use super::station::MotionFaults;
use cellwire_links::settings::{Configure, Fields};

/// How many times faster than life a simulated device may move.
pub const SPEEDS: core::ops::RangeInclusive<u32> = 1..=10_000;

/// A simulated robot or platform.
#[derive(Debug, Clone, Copy)]
pub struct DeviceSettings {
    /// Its session.
    pub config: DeviceConfig,
    /// How many times faster than life it moves.
    pub speed: u32,
    /// What goes wrong with its motions.
    pub faults: MotionFaults,
    /// Every how many reads one is not answered; 0: never.
    pub mute_every: u64,
    /// Every how many reads one ends the connection; 0: never.
    pub drop_every: u64,
}

impl Default for DeviceSettings {
    fn default() -> Self {
        let faults = MotionFaults { refuse_code: 1, ..MotionFaults::default() };
        Self { config: DeviceConfig::DEFAULT, speed: 1, faults, mute_every: 0, drop_every: 0 }
    }
}

impl Configure for DeviceSettings {
    fn configure(&mut self, fields: &mut impl Fields) {
        let Self { config, speed, faults, mute_every, drop_every } = self;
        speed_of_axes(fields, speed);
        faults.configure(fields);
        let about = "every how many reads one is not answered; 0: never";
        fields.whole("mute_every", 0..=u64::MAX, "reads", about, mute_every);
        let about = "every how many reads one ends the connection; 0: never";
        fields.whole("drop_every", 0..=u64::MAX, "reads", about, drop_every);
        config.configure(fields);
    }
}

/// The setting `speed`.
pub fn speed_of_axes(fields: &mut impl Fields, speed: &mut u32) {
    fields.whole("speed", SPEEDS, "times", "how many times faster than life the axes move", speed);
}

impl Configure for MotionFaults {
    fn configure(&mut self, fields: &mut impl Fields) {
        let Self { fail_every, stall_every, refuse_every, refuse_code } = self;
        let about = "after how many motions one stops half-way with an error of servo motor 1; 0: never";
        fields.whole("fail_every", 0..=u64::MAX, "motions", about, fail_every);
        let about = "after how many motions one stops half-way without an error; 0: never";
        fields.whole("stall_every", 0..=u64::MAX, "motions", about, stall_every);
        let about = "after how many motions one is refused; 0: never";
        fields.whole("refuse_every", 0..=u64::MAX, "motions", about, refuse_every);
        fields.whole("refuse_code", 1..=32767, "", "the error number of that refusal", refuse_code);
    }
}
