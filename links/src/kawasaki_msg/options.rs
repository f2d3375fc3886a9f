//! The configurations of both ends, by field.

use super::plant::Plant;
use crate::settings::{ANY_TIME, Configure, SOME_TIME, Table};
use kawasaki_msg::{Bounds, Limits, Message, PcConfig, RobotConfig, Takeover};

/// What `decode` and `encode` are set to.
#[derive(Debug, Clone, Default)]
pub struct CodecSettings {
    /// The plant's messages.
    pub plant: Plant,
    /// Messages are read and written as what they mean in the plant's table.
    pub roles: bool,
}

impl Configure for CodecSettings {
    fn configure(&mut self, table: &mut Table<'_>) {
        let about = "message objects are a role and values in place of a name and fields";
        table.flag("roles", about, &mut self.roles);
        self.plant.configure(table);
    }
}

impl Configure for Limits {
    fn configure(&mut self, table: &mut Table<'_>) {
        let longest = Message::MAX_LEN;
        table.whole(
            "element",
            1..=longest,
            "bytes",
            "the most of a string of the AS program",
            &mut self.element,
        );
        table.whole(
            "packet",
            1..=longest,
            "bytes",
            "the most of a packet: all its strings",
            &mut self.packet,
        );
    }
}

impl Configure for Bounds {
    fn configure(&mut self, table: &mut Table<'_>) {
        let widest = Bounds::WIDEST;
        let (x, y) = (widest.min.x..=widest.max.x, widest.min.y..=widest.max.y);
        for (name, point) in [("min", &mut self.min), ("max", &mut self.max)] {
            table.group(name, |table| {
                let about = "the end of what the robot reaches";
                table.whole("x", x.clone(), "in 1/100 mm", about, &mut point.x);
                table.whole("y", y.clone(), "in 1/100 mm", about, &mut point.y);
            });
        }
    }
}

impl Configure for RobotConfig<'_> {
    fn configure(&mut self, table: &mut Table<'_>) {
        let about = "after a full queue, jobs are asked for when at most so many are left";
        table.whole_or("low_water", 0..=9998, "half", about, &mut self.low_water);
        table.group("recovery", |table| {
            let recovery = &mut self.recovery;
            table.whole(
                "resends",
                0..=u16::MAX,
                "times",
                "how often jobs are asked for again",
                &mut recovery.resends,
            );
            table.whole(
                "pauses",
                0..=u16::MAX,
                "times",
                "how often the PC is asked to pause",
                &mut recovery.pauses,
            );
            table.whole(
                "clears",
                0..=u16::MAX,
                "times",
                "how often the queue is cleared",
                &mut recovery.clears,
            );
        });
        let about = "how long the next job may be missing before a step of the recovery";
        table.time("patience", ANY_TIME, about, &mut self.patience);
        table.time("pause", ANY_TIME, "how long the recovery pauses", &mut self.pause);
        let about = "how long a cycle waits for an answer before it starts again";
        table.time("reply_timeout", ANY_TIME, about, &mut self.reply_timeout);
        table.time("exchange", ANY_TIME, "the least time from packet to packet", &mut self.exchange);
        let about = "the connection is given up after so many cycles without an answer; 0: never";
        table.whole("silent_cycles", 0..=u16::MAX, "cycles", about, &mut self.silent_cycles);
        let about = "the wait before a lost connection is opened again";
        table.time("reconnect_delay", ANY_TIME, about, &mut self.reconnect_delay);
        let about = "how often at least the status is sent";
        table.time("status_period", ANY_TIME, about, &mut self.status_period);
        let about = "answer 0 to the start of the order that is active already and has jobs";
        table.flag("refuse_repeated_start", about, &mut self.refuse_repeated_start);
        let about = "end the active order when the PC's status names another one or none";
        table.flag("end_foreign_order", about, &mut self.end_foreign_order);
    }
}

impl Configure for PcConfig<'_> {
    fn configure(&mut self, table: &mut Table<'_>) {
        let about = "the wait between the robot's last byte and the answer";
        table.time("reply_delay", ANY_TIME, about, &mut self.reply_delay);
        let about = "without a message for so long the connection is given up";
        table.time("silence", SOME_TIME, about, &mut self.silence);
        let choices =
            [("never", Takeover::Never), ("end", Takeover::End), ("interrupt", Takeover::Interrupt)];
        let about =
            "what happens to another order that is active: its queue is executed, or it is interrupted";
        table.choice("takeover", &choices, about, &mut self.takeover);
        let about = "how often a start that is refused without an active order is tried again";
        table.whole("start_retries", 0..=u16::MAX, "times", about, &mut self.start_retries);
        let about = "end the order when all its jobs are executed";
        table.flag("end_when_done", about, &mut self.end_when_done);
    }
}
