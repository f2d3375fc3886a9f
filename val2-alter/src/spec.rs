//! The configurations of both ends, field by field.

use core::time::Duration;

use robot_session::spec::{ANY_TIME, Configure, FieldVisitor};

use crate::controller::{ControllerConfig, Unselected};
use crate::framing::{Framing, LeadingDle};
use crate::host::{HostConfig, Policy};
use crate::limit::Limits;
use crate::message::Mode;

impl Configure for Framing {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { leading_dle, negated_sum, stuffed_checksum, ignore_spare_select } = self;
        let choices = [("1", LeadingDle::One), ("2", LeadingDle::Two)];
        fields.source("§3.2").choice("leading_dle", &choices, "how many DLEs are before STX", leading_dle);
        let about = "the checksum is the two's complement of the sum";
        fields.source("§3.2").flag("negated_sum", about, negated_sum);
        let about = "a checksum of 10h is doubled like a DLE of the data";
        fields.source("§3.2").flag("stuffed_checksum", about, stuffed_checksum);
        let about = "ignore bits 6 and 7 of the select byte of a reply";
        fields.flag("ignore_spare_select", about, ignore_spare_select);
    }
}

impl Configure for Limits {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { velocity, acceleration } = self;
        let (unit, range) = ("units a cycle (1.116 mm/s, 0.196 °/s)", 0..=u16::MAX);
        let about = "the largest motion of each axis in one cycle; above 32767 counts as 32767";
        fields.wholes("velocity", range.clone(), unit, about, velocity);
        let about = "the largest change of that per cycle, also when braking; above 32767 counts as 32767";
        fields.wholes("acceleration", range, unit, about, acceleration);
    }
}

/// Visits the fields `baud` and `mode`, which both ends have.
fn line(fields: &mut impl FieldVisitor, baud: &mut u32, mode: &mut Mode) {
    let about =
        "the rate of the serial line, 10 bits a byte; high enough for one value in the window of a reply";
    fields.source("§3.2").baud(about, baud);
    let about = "the mode of the ALTER instruction, five bits";
    fields.source("§10.4").whole("mode", 0..=31, "", about, &mut mode.0);
}

/// Visits the field `gap`, which both ends have.
fn gap_of(fields: &mut impl FieldVisitor, gap: &mut Option<Duration>) {
    let about = "the longest silence inside a frame; off if reads are further apart than bytes";
    fields.time_or("gap", ANY_TIME, "off", about, gap);
}

/// Visits the field `framing`, which both ends have.
fn framing_of(fields: &mut impl FieldVisitor, framing: &mut Framing) {
    fields.source("§3.2").inline("framing", "Framing", "the envelope", framing);
}

impl Configure for ControllerConfig {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self {
            framing,
            baud,
            mode,
            data,
            subroutine,
            attempts,
            unselected,
            gap,
            #[cfg(feature = "model")]
                rules: _,
        } = self;
        line(fields, baud, mode);
        let shape = "[up to 14 numbers of -32768 to 32767]";
        fields.source("§3").parsed("data", shape, "the data list of the ALTER instruction", data);
        let about = "the ALTER instruction has an exception subroutine";
        fields.source("§10.4").flag("subroutine", about, subroutine);
        let about = "start messages sent before giving up";
        fields.source("§3.2").whole("attempts", 1..=u8::MAX, "", about, attempts);
        let choices =
            [("by_mode", Unselected::ByMode), ("hold", Unselected::Hold), ("zero", Unselected::Zero)];
        let about = "the meaning of a value that a reply omits";
        fields.source("§3.3.2").choice("unselected", &choices, about, unselected);
        gap_of(fields, gap);
        framing_of(fields, framing);
    }
}

impl Configure for HostConfig {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self {
            framing,
            baud,
            mode,
            limits,
            subroutine,
            policy,
            repeats,
            silence_cycles,
            gap,
            target_timeout,
            reserve,
            max_delay,
            #[cfg(feature = "model")]
                rules: _,
        } = self;
        line(fields, baud, mode);
        fields.part("limits", "Limits", "the limits of each axis", limits);
        let about = "the robot's program has an exception subroutine for the gripper";
        fields.source("§10.4").flag("subroutine", about, subroutine);
        let choices = [("accept", Policy::Accept), ("refuse", Policy::Refuse), ("ignore", Policy::Ignore)];
        fields.source("§10.6").choice("policy", &choices, "how start messages are answered", policy);
        let about = "how often in a row a corrupt start message is requested again";
        fields.source("§3.2").whole("repeats", 0..=u8::MAX, "times", about, repeats);
        let about = "the silence after which the controller counts as lost";
        fields.whole("silence_cycles", 2..=u32::MAX, "cycles of 28 ms", about, silence_cycles);
        gap_of(fields, gap);
        fields.time("target_timeout", ANY_TIME, "how long a target holds", target_timeout);
        let about =
            "the time left in the window when another axis begins to move; at most what one value leaves";
        fields.time("reserve", ANY_TIME, about, reserve);
        let about = "assumed: the longest total delay of reading a message and sending its reply";
        fields.time("max_delay", ANY_TIME, about, max_delay);
        framing_of(fields, framing);
    }
}

#[cfg(feature = "settings")]
robot_session::deserialize!(ControllerConfig, ControllerConfig::default());
#[cfg(feature = "settings")]
robot_session::deserialize!(HostConfig, HostConfig::default());
