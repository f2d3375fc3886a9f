//! The settings of the link: its dialect, and both ends.

use mmacell_proto::{CentralConfig, DeviceConfig, Dialect, ErrorCode};

use super::station::MotionFaults;
use crate::links::settings::{ANY_TIME, Configure, SOME_TIME, Table};

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
    fn configure(&mut self, table: &mut Table<'_>) {
        let Self { config, speed, faults, mute_every, drop_every } = self;
        speed_of_axes(table, speed);
        faults.configure(table);
        let about = "every how many reads one is not answered; 0: never";
        table.whole("mute_every", 0..=u64::MAX, "reads", about, mute_every);
        let about = "every how many reads one ends the connection; 0: never";
        table.whole("drop_every", 0..=u64::MAX, "reads", about, drop_every);
        config.configure(table);
    }
}

/// The setting `speed`.
pub fn speed_of_axes(table: &mut Table<'_>, speed: &mut u32) {
    table.whole("speed", SPEEDS, "times", "how many times faster than life the axes move", speed);
}

impl Configure for MotionFaults {
    fn configure(&mut self, table: &mut Table<'_>) {
        let Self { fail_every, stall_every, refuse_every, refuse_code } = self;
        let about = "after how many motions one stops half-way with an error of servo motor 1; 0: never";
        table.whole("fail_every", 0..=u64::MAX, "motions", about, fail_every);
        let about = "after how many motions one stops half-way without an error; 0: never";
        table.whole("stall_every", 0..=u64::MAX, "motions", about, stall_every);
        let about = "after how many motions one is refused; 0: never";
        table.whole("refuse_every", 0..=u64::MAX, "motions", about, refuse_every);
        table.whole("refuse_code", 1..=32767, "", "the error number of that refusal", refuse_code);
    }
}

impl Configure for Dialect {
    fn configure(&mut self, table: &mut Table<'_>) {
        table.flag("itr", "ITR is STP", &mut self.itr);
        table.flag("ovrd", "OVRD is OVR", &mut self.ovrd);
        table.flag("clos", "HND…CLOS is HND…CLOSE", &mut self.clos);
        table.flag("off", "SRVOFF is SRVOF", &mut self.off);
        table.flag("lone_lf", "a line ends with a line feed alone", &mut self.lone_lf);
        table.flag("blank", "a blank follows the sign of an integer", &mut self.blank);
        let about = "all five digits of an integer count, also above 32767";
        table.flag("wide_integers", about, &mut self.wide_integers);
    }
}

impl Configure for DeviceConfig {
    fn configure(&mut self, table: &mut Table<'_>) {
        let mut refusal = i32::from(self.refusal);
        let about = "the error number of what the protocol itself refuses";
        table.whole("refusal", 1..=32767, "", about, &mut refusal);
        self.refusal = ErrorCode::from(refusal);
        table.group("accepts", |table| self.accepts.configure(table));
        table.group("writes", |table| self.writes.configure(table));
    }
}

impl Configure for CentralConfig {
    fn configure(&mut self, table: &mut Table<'_>) {
        table.time("timeout", SOME_TIME, "how long a reply may take", &mut self.timeout);
        let about = "a status asked for sooner after the start of a motion may be older than it";
        table.time("settle", ANY_TIME, about, &mut self.settle);
        let about = "how far from its target a device has arrived: 1 µm, 0.1 mrad";
        table.whole("tolerance", 0..=u32::MAX, "units", about, &mut self.tolerance);
        table.group("accepts", |table| self.accepts.configure(table));
        table.group("writes", |table| self.writes.configure(table));
    }
}
