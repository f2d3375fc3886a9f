//! The configurations of both ends, by field.

use crate::settings::{ANY_TIME, Configure, SOME_TIME, Table, json};
use laser_eb90::{ByteOrder, ControllerConfig, Flag, Frame, HostConfig, Profile, Tags, Tail, Width, Words};

impl Configure for Profile {
    fn configure(&mut self, table: &mut Table<'_>) {
        let choices = [("printed", Tail::Printed), ("etx", Tail::Etx), ("either", Tail::Either)];
        table.choice("tail", &choices, "the end mark: 90 82, 90 83, or both are read", &mut self.tail);
        let choices = [("separate", Flag::Separate), ("first_tag", Flag::FirstTag)];
        table.choice("flag", &choices, "where the frame flag F0h is", &mut self.flag);
        let (shape, default) = ("{f32, i16, u8, char}, four different bytes", json(&self.tags));
        table.parsed::<Tags>("tags", shape, default, "the tags in front of the values", &mut self.tags);
        let choices = [("u8", Width::U8), ("u16_le", Width::U16Le), ("u16_be", Width::U16Be)];
        table.choice("checksum", &choices, "the width of the checksum", &mut self.checksum);
        let about = "the checksum is the two's complement of the sum";
        table.flag("checksum_negated", about, &mut self.checksum_negated);
        let about = "the sum counts the frame flag, too";
        table.flag("checksum_with_flag", about, &mut self.checksum_with_flag);
        let choices = [("little", ByteOrder::Little), ("big", ByteOrder::Big)];
        table.choice("byte_order", &choices, "the order of the bytes of a value", &mut self.byte_order);
    }
}

/// The settings `words` and `batch`, which both ends have.
fn instructions(table: &mut Table<'_>, words: &mut Words, batch: &mut u8) {
    let shape = "{commands: [{first, last, class}], errors: {bad_checksum, …}}";
    let about = "command words by class (interpreted, immediate, query), and error codes";
    table.parsed("words", shape, json(words), about, words);
    let about = "the most interpreted instructions in a frame";
    table.whole("batch", 1..=u8::MAX, "instructions", about, batch);
}

impl Configure for ControllerConfig {
    fn configure(&mut self, table: &mut Table<'_>) {
        instructions(table, &mut self.words, &mut self.batch);
        let about = "the controller's cycle, at whose end answers are sent";
        table.time("tick", SOME_TIME, about, &mut self.tick);
        let about =
            "without a byte for so long corrupt bytes are answered and an incomplete frame is dropped";
        table.time("silence", ANY_TIME, about, &mut self.silence);
        self.profile.configure(table);
    }
}

impl Configure for HostConfig {
    fn configure(&mut self, table: &mut Table<'_>) {
        table.baud(&mut self.baud);
        instructions(table, &mut self.words, &mut self.batch);
        let about = "how often a frame is sent again that an error code answers";
        table.whole("resends", 0..=u8::MAX, "times", about, &mut self.resends);
        let about = "send a frame again without an answer: it may then be executed several times";
        table.flag("resend_on_silence", about, &mut self.resend_on_silence);
        let about = "how long the answer of interpreted instructions is awaited; longer below 9600 baud";
        table.time("answer_timeout", SOME_TIME, about, &mut self.answer_timeout);
        let about = "assumed: the longest execution of an immediate instruction or a query";
        table.time("execution_timeout", SOME_TIME, about, &mut self.execution_timeout);
        let about = "assumed: no answer comes later than this after what it answers";
        table.time("settle", ANY_TIME, about, &mut self.settle);
        let about = "assumed: the longest that PC and line pause within a frame";
        table.time("max_pause", ANY_TIME, about, &mut self.max_pause);
        let about = "assumed: the longest from the controller's decision to the end of its answer";
        table.time("reply_time", ANY_TIME, about, &mut self.reply_time);
        let about = "assumed: the longest frame that a host on this line sends";
        table.whole("longest_frame", 0..=Frame::MAX_LEN, "bytes", about, &mut self.longest_frame);
        let about = "assumed: how long what an earlier host has sent may still be executed";
        table.time("earlier_execution", ANY_TIME, about, &mut self.earlier_execution);
        let about = "the controller drops what it holds of a frame when it answers an error code";
        table.flag("controller_drops_partial", about, &mut self.controller_drops_partial);
        table.time("backoff", ANY_TIME, "the wait when the queue is full", &mut self.backoff);
        let about = "after so long with a full queue the frame counts as refused";
        table.time("full_timeout", ANY_TIME, about, &mut self.full_timeout);
        self.profile.configure(table);
    }
}
