//! The configurations of both ends, by field.

use crate::settings::{ANY_TIME, Configure, SOME_TIME, Table, json};
use std::time::Duration;
use val2_alter::{ControllerConfig, Framing, HostConfig, LeadingDle, Limits, List, Mode, Policy, Unselected};

impl Configure for Framing {
    fn configure(&mut self, table: &mut Table<'_>) {
        let choices = [("1", LeadingDle::One), ("2", LeadingDle::Two)];
        table.choice("leading_dle", &choices, "how many DLEs are before STX", &mut self.leading_dle);
        let about = "the checksum is the two's complement of the sum";
        table.flag("negated_sum", about, &mut self.negated_sum);
        let about = "a checksum of 10h is doubled like a DLE of the data";
        table.flag("stuffed_checksum", about, &mut self.stuffed_checksum);
        let about = "read a reply that sets bits 6 and 7 of its select byte as if they were clear";
        table.flag("ignore_spare_select", about, &mut self.ignore_spare_select);
    }
}

/// The setting `mode`.
pub fn mode(table: &mut Table<'_>, mode: &mut Mode) {
    table.whole("mode", 0..=31, "", "the mode of the ALTER instruction, five bits", &mut mode.0);
}

/// The setting `gap`.
fn gap(table: &mut Table<'_>, gap: &mut Option<Duration>) {
    let about = "a longer silence inside a frame ends it; off where reads are far apart though bytes are not";
    table.time_or("gap", SOME_TIME, "off", about, gap);
}

impl Configure for ControllerConfig {
    fn configure(&mut self, table: &mut Table<'_>) {
        table.baud(&mut self.baud);
        mode(table, &mut self.mode);
        let mut words = self.data.words().to_vec();
        let shape = "[up to 14 numbers of -32768 to 32767]";
        let about = "the data list of the ALTER instruction";
        let default = json(&words);
        table.parsed("data", shape, default, about, &mut words);
        self.data = List::new(&words).unwrap_or(self.data);
        let about = "the ALTER instruction names an exception subroutine";
        table.flag("subroutine", about, &mut self.subroutine);
        let about = "start messages sent before giving up";
        table.whole("attempts", 1..=u8::MAX, "", about, &mut self.attempts);
        let choices =
            [("by_mode", Unselected::ByMode), ("hold", Unselected::Hold), ("zero", Unselected::Zero)];
        let about = "what a value means that a reply does not transmit";
        table.choice("unselected", &choices, about, &mut self.unselected);
        gap(table, &mut self.gap);
        self.framing.configure(table);
    }
}

impl Configure for Limits {
    fn configure(&mut self, table: &mut Table<'_>) {
        let (unit, range) = ("units a cycle (1.116 mm/s, 0.196 °/s)", 0..=u16::MAX);
        let about = "the most that a value moves each axis in one cycle";
        table.wholes("velocity", range.clone(), unit, about, &mut self.velocity);
        let about = "the most by which that changes from cycle to cycle, braking included";
        table.wholes("acceleration", range, unit, about, &mut self.acceleration);
    }
}

impl Configure for HostConfig {
    fn configure(&mut self, table: &mut Table<'_>) {
        table.baud(&mut self.baud);
        mode(table, &mut self.mode);
        table.group("limits", |table| self.limits.configure(table));
        let about = "the robot's program names an exception subroutine, for the gripper";
        table.flag("subroutine", about, &mut self.subroutine);
        let choices = [("accept", Policy::Accept), ("refuse", Policy::Refuse), ("ignore", Policy::Ignore)];
        table.choice("policy", &choices, "how start messages are answered", &mut self.policy);
        let about = "how often in a row a corrupt start message is asked for again";
        table.whole("repeats", 0..=u8::MAX, "times", about, &mut self.repeats);
        let about = "without a message for so long the controller counts as lost";
        table.whole("silence_cycles", 2..=u32::MAX, "cycles of 28 ms", about, &mut self.silence_cycles);
        gap(table, &mut self.gap);
        table.time("target_timeout", ANY_TIME, "how long a target holds", &mut self.target_timeout);
        let about = "what must be left of the window when another axis begins to move";
        table.time("reserve", ANY_TIME, about, &mut self.reserve);
        let about = "assumed: the longest that reading a message and sending its reply are late together";
        table.time("max_delay", ANY_TIME, about, &mut self.max_delay);
        self.framing.configure(table);
    }
}
