//! The configurations of both ends, field by field.

use core::num::NonZeroU16;

use robot_session::spec::{ANY_TIME, Configure, FieldVisitor, SOME_TIME};

use crate::dialect::Dialect;
use crate::job::Bounds;
use crate::message::Message;
use crate::packet::Limits;
use crate::pc::{PcConfig, Takeover};
use crate::robot::{Acks, RecoveryLimits, RobotConfig};

impl Configure for Limits {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { element, packet } = self;
        let range = 1..=Message::MAX_LEN;
        let about = "the longest string of the AS program";
        fields.source("§7.4").whole("element", range.clone(), "bytes", about, element);
        let about = "the largest packet: all its strings; over UDP 1472";
        fields.source("§9.5").whole("packet", range, "bytes", about, packet);
    }
}

impl Configure for Bounds {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { min, max } = self;
        let widest = Self::WIDEST;
        let (x, y) = (widest.min.x..=widest.max.x, widest.min.y..=widest.max.y);
        for (name, point) in [("min", min), ("max", max)] {
            fields.group(name, |fields| {
                let about = "the limit of the robot's workspace";
                fields.whole("x", x.clone(), "in 1/100 mm", about, &mut point.x);
                fields.whole("y", y.clone(), "in 1/100 mm", about, &mut point.y);
            });
        }
    }
}

impl Configure for RecoveryLimits {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { resends, pauses, clears } = self;
        const NAMED: &str = "§6.3; this project's value";
        let all = 0..=u16::MAX;
        let about = "how often jobs are requested again";
        fields.source(NAMED).whole("resends", all.clone(), "times", about, resends);
        let about = "how often the PC is asked to pause";
        fields.source(NAMED).whole("pauses", all.clone(), "times", about, pauses);
        fields.source(NAMED).whole("clears", all, "times", "how often the queue is cleared", clears);
    }
}

/// Visits the fields `dialect`, `limits`, `datagrams` and `max_number`, on which both ends agree.
fn agreed(fields: &mut impl FieldVisitor, limits: &mut Limits, datagrams: &mut bool, max_number: &mut u16) {
    let shape = "a table that `Dialect::new` takes (KM-27, KM-28)";
    fields.source("§10.1; ours").code("dialect", shape, "the table of messages", "the plant's messages");
    fields.source("§9.5").part("limits", "Limits", "the limits of a packet", limits);
    let about = "packets are datagrams, which may be lost, repeated and late";
    fields.flag("datagrams", about, datagrams);
    let about = "the highest job number; above the jobs of the robot's queue";
    fields.source("§11.1.1").whole("max_number", 2..=Dialect::MAX_NUMBER, "", about, max_number);
}

impl Configure for RobotConfig {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self {
            dialect: _,
            limits,
            datagrams,
            max_number,
            acks,
            low_water,
            recovery,
            patience,
            pause,
            reply_timeout,
            exchange,
            silent_cycles,
            reconnect_delay,
            status_period,
            refuse_repeated_start,
            end_foreign_order,
            #[cfg(feature = "model")]
                rules: _,
        } = self;
        agreed(fields, limits, datagrams, max_number);
        acks.configure(fields);
        let about = "after a full queue, request jobs when at most this many are left; half: of the queue";
        fields.source("§7").whole_or("low_water", 0..=9998, "jobs", "half", about, low_water);
        let about = "how often each step of the recovery is taken";
        fields.source("§6.3").part("recovery", "RecoveryLimits", about, recovery);
        let about = "how long the next job may be missing before a step of the recovery";
        fields.time("patience", ANY_TIME, about, patience);
        fields.time("pause", ANY_TIME, "how long the recovery pauses", pause);
        let about = "how long a cycle waits for an answer before it starts again";
        fields.time("reply_timeout", ANY_TIME, about, reply_timeout);
        let about = "the shortest time between packets";
        fields.source("§9.4").time("exchange", ANY_TIME, about, exchange);
        let about = "the cycles without an answer before the connection is dropped; 0: never";
        fields.whole("silent_cycles", 0..=u16::MAX, "cycles", about, silent_cycles);
        let about = "the delay before a lost connection is reopened";
        fields.time("reconnect_delay", ANY_TIME, about, reconnect_delay);
        let about = "the longest time between two status messages";
        fields.time("status_period", ANY_TIME, about, status_period);
        let about = "answer 0 when the active order is started again and has jobs";
        fields.flag("refuse_repeated_start", about, refuse_repeated_start);
        let about = "end the active order when the PC's status has another one or none";
        fields.source("§11.2").flag("end_foreign_order", about, end_foreign_order);
    }
}

/// The field `acks`.
impl Configure for Acks {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let mut jobs = match self {
            Self::Cumulative { every } => Some(every.get()),
            Self::Individual => None,
        };
        let about = "acknowledge every Nth job, which covers earlier ones; or each job individually, required where \
                     jobs may overtake one another";
        fields.source("§11.2").whole_or("acks", 1..=u16::MAX, "jobs", "individual", about, &mut jobs);
        *self = match jobs.and_then(NonZeroU16::new) {
            Some(every) => Self::Cumulative { every },
            None => Self::Individual,
        };
    }
}

impl Configure for PcConfig {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self {
            dialect: _,
            limits,
            datagrams,
            max_number,
            cumulative_acks,
            reply_delay,
            silence,
            takeover,
            start_retries,
            end_when_done,
            #[cfg(feature = "model")]
                rules: _,
        } = self;
        agreed(fields, limits, datagrams, max_number);
        let about = "an acknowledgement covers earlier jobs; false where jobs may overtake one another";
        fields.source("§11.2").flag("cumulative_acks", about, cumulative_acks);
        let about = "the delay between the robot's last byte and the answer";
        fields.source("§7.1").time("reply_delay", ANY_TIME, about, reply_delay);
        let about = "the silence after which the connection is dropped";
        fields.time("silence", SOME_TIME, about, silence);
        let choices =
            [("never", Takeover::Never), ("end", Takeover::End), ("interrupt", Takeover::Interrupt)];
        let about = "how another active order is ended: not at all, after its queue, or interrupted";
        fields.source("§11.2").choice("takeover", &choices, about, takeover);
        let about = "how often a start is retried that was refused without an active order";
        fields.whole("start_retries", 0..=u16::MAX, "times", about, start_retries);
        let about = "end the order when all its jobs are executed";
        fields.flag("end_when_done", about, end_when_done);
    }
}

#[cfg(feature = "settings")]
robot_session::deserialize!(RobotConfig, RobotConfig::tcp());
#[cfg(feature = "settings")]
robot_session::deserialize!(PcConfig, PcConfig::tcp());
